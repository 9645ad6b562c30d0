//! Shared memory with other users, with containers, and on small machines.
//!
//! The tests change a `/dev/shm` that no other process sees, in a mount namespace of their own.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

use runtime::domain::Domain;
use runtime::port::bytes_needed;

use crate::harness::{
    AS_NOBODY, Flight, PATIENT, copy_program, has_root, launcher, namespace, shared_memory_of, skip, top, wait_until,
};
use crate::processes::{kill, start_flying};

/// A flight independent of timing; `$OUT` is a folder that every user may write to.
const FLY: &str = "$LAUNCHER fly --namespace here --mode lockstep --no-log --set run.duration_s=0.5";

/// Option of a flight without end: two of them in the real-time class would leave no CPU time to other processes.
const LONG: &str = "--set realtime.policy=other";

/// Returns whether namespaces cannot be made here; prints a note if so.
fn cannot_separate(kind: &str) -> bool {
    if !has_root() {
        return true;
    }
    let can = Command::new("unshare").args([kind, "true"]).status().is_ok_and(|status| status.success());
    if !can {
        skip(&format!("`unshare {kind}` is refused"));
    }
    !can
}

/// Runs `script` with a `/dev/shm` of its own, mounted with `options`.
fn with_memory(options: &str, script: &str) -> Output {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("trefoil");
    copy_program(Path::new(launcher().get_program()), &program);
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).expect("it is ours");
    let script = format!("set -e\nmount -t tmpfs -o {options} trefoil-test /dev/shm\ncd $OUT\n{script}");
    let mut shell = Command::new("unshare");
    shell.args(["--mount", "sh", "-c", &script]).env("LAUNCHER", &program).env("OUT", folder.path());
    shell.output().expect("unshare runs")
}

fn words(output: &Output) -> String {
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    format!("{out}{err}")
}

#[test]
fn files_that_another_user_plants_do_not_keep_a_flight_from_starting() {
    if cannot_separate("--mount") {
        return;
    }
    let plant = format!(
        "touch $OUT/target; chmod 666 $OUT/target\n\
         {AS_NOBODY} sh -c 'cd /dev/shm; mkfifo trefoil-0 trefoil.here.lock; ln -s $OUT/target trefoil-0.1; \
         ln -s $OUT trefoil-0.2; mkdir -m 777 trefoil-0.3; touch trefoil-0.4'\n"
    );
    let flown = with_memory(
        "mode=1777",
        &format!("umask 000\n{plant}{FLY} --out $OUT/run\nls /dev/shm; ls -s $OUT/target; ls $OUT"),
    );
    assert!(flown.status.success(), "{}", words(&flown));
    let said = words(&flown);
    assert!(said.contains("0 ") && said.contains("/target"), "nothing was written through the link: {said}");
    for name in
        ["trefoil-0\n", "trefoil-0.1\n", "trefoil-0.2\n", "trefoil-0.3\n", "trefoil-0.4\n", "trefoil.here.lock\n"]
    {
        assert!(said.contains(name), "{name} is not ours to remove: {said}");
    }
    assert!(!said.contains("trefoil-0.5\n"), "what is ours is gone: {said}");

    let all = format!(
        "{AS_NOBODY} sh -c 'cd /dev/shm; mkfifo trefoil-0 trefoil-0.1 trefoil-0.2 trefoil-0.3 trefoil-0.4 \
         trefoil-0.5 trefoil-0.6 trefoil-0.7'\n"
    );
    let refused = with_memory("mode=1777", &format!("{all}{FLY} --out $OUT/run || {{ echo code $?; ls $OUT; }}"));
    let said = words(&refused);
    assert!(said.contains("code 2") && said.contains("files of other users stand under all names"), "{said}");
    assert!(!said.contains("run\n"), "a refused flight leaves no folder: {said}");
}

/// `/dev/shm` can hold any number of foreign files. A user who may not list it can fly.
#[test]
fn two_users_fly_in_one_namespace_and_neither_lists_what_is_not_theirs() {
    if cannot_separate("--mount") {
        return;
    }
    let script = format!(
        "$LAUNCHER fly --namespace here --no-log --mode lockstep {LONG} --set run.duration_s=86400.0 --out $OUT/other &\n\
         trap 'kill -INT $! 2>/dev/null || true' EXIT\n\
         until $LAUNCHER status | grep -q ', flying,'; do sleep 0.05; done\n\
         {AS_NOBODY} ls /dev/shm && exit 9\n\
         {AS_NOBODY} {FLY} --out $OUT/run\n\
         {AS_NOBODY} $LAUNCHER status\n\
         {AS_NOBODY} $LAUNCHER stop --namespace here || echo refused\n\
         $LAUNCHER stop --namespace here; wait; ! ls -A /dev/shm/trefoil-* | grep -v :"
    );
    let flown = with_memory("mode=1733", &script);
    let said = words(&flown);
    assert!(flown.status.success(), "{said}");
    assert!(said.contains("no stack is flying"), "the other user's stack is not shown: {said}");
    assert!(said.contains("refused") && said.contains("stopped: 'survey' in namespace 'here'"), "{said}");
}

#[test]
fn another_pid_namespace_neither_wipes_a_flight_nor_misses_it() {
    if cannot_separate("--pid") {
        return;
    }
    let ns = namespace();
    let flight = start_flying(&ns);
    let elsewhere = |arguments: &[&str]| {
        let mut command = Command::new("unshare");
        command.args(["--pid", "--fork", "--mount-proc"]).arg(launcher().get_program()).args(arguments);
        command.output().expect("unshare runs")
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("run").display().to_string();
    let other = namespace();
    let short = ["--mode", "lockstep", "--set", "run.duration_s=0.5", "--out", &out, "--namespace"];
    let flown = elsewhere(&[&["fly"], &short[..], &[&other]].concat());
    assert!(flown.status.success(), "a flight in a PID namespace: {}", words(&flown));
    let refused = elsewhere(&[&["fly"], &short[..], &[&ns]].concat());
    assert!(words(&refused).contains("in use"), "{}", words(&refused));
    assert!(shared_memory_of(&ns).len() > 10, "it is all there");
    let seen = elsewhere(&["status"]);
    assert!(words(&seen).contains(&ns), "{}", words(&seen));
    // In the other PID namespace the launcher's process id belongs to another process, or to none.
    let stopped = elsewhere(&["stop", "--namespace", &ns]);
    assert!(stopped.status.success(), "{}", words(&stopped));
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    assert_eq!(outcome.run()["events"].as_array().map(Vec::len), Some(0), "nothing was removed");
}

#[test]
fn the_next_launcher_of_any_namespace_removes_what_a_killed_one_left() {
    let (dead, live) = (namespace(), namespace());
    let (killed, living) = (start_flying(&dead), start_flying(&live));
    kill("-KILL", &[killed.child.id() as i32]);
    wait_until("the lock is free", || Domain::find(&dead).is_err());
    let flown = Flight::start(&namespace(), &["--mode", "lockstep", "--set", "run.duration_s=0.5"]).finish();
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    assert_eq!(shared_memory_of(&dead), Vec::<String>::new());
    assert!(shared_memory_of(&live).len() > 10, "the living flight keeps all of its files");
    kill("-INT", &[living.child.id() as i32]);
    assert_eq!(living.finish().code(), Some(130));
}

#[test]
fn a_flight_says_what_memory_it_needs_and_has_enough_of_64_megabytes() {
    if cannot_separate("--mount") {
        return;
    }
    let code = "|| { echo code $?; ls -A $OUT /dev/shm; }";
    let small = words(&with_memory("size=20m", &format!("{FLY} --out $OUT/run {code}")));
    let [need_mb, fast_mb] = [100, 500].map(|rate_hz| bytes_needed(rate_hz).div_ceil(1 << 20));
    for (page, words) in [
        ("README.md", [format!("needs {need_mb} MB free in `/dev/shm`"), format!("{fast_mb} MB at\n500 Hz")]),
        ("docs/security.md", [format!("asks for {need_mb} MB before"), format!("above it is {fast_mb} MB")]),
    ] {
        let text = std::fs::read_to_string(top().join(page)).unwrap();
        assert!(words.iter().all(|words| text.contains(words)), "{page} says something else than {words:?}");
    }
    assert!(small.contains(&format!("a flight needs {need_mb} MB")) && small.contains("MB free"), "{small}");
    assert!(small.contains("code 2") && !small.contains("run\n") && !small.contains("trefoil-"), "{small}");
    let crowded = words(&with_memory("nr_inodes=100", &format!("{FLY} --out $OUT/run {code}")));
    assert!(crowded.contains("code 2") && crowded.contains("makes up to 300 files"), "{crowded}");
    let read_only = format!("mount -o remount,ro /dev/shm\n{FLY} --out $OUT/run {code}");
    let read_only = words(&with_memory("size=64m", &read_only));
    assert!(read_only.contains("code 2") && read_only.contains("Read-only file system"), "{read_only}");

    // Every process is replaced once or more, and then another user fills what is left.
    let kill = |at_s: f64, node: &str| format!("{{at_s={at_s:?}, target=\"{node}\", kind=\"kill\"}}");
    let kills = [(0.3, "guidance"), (0.3, "attitude-mpc"), (0.3, "mixer"), (0.6, "guidance"), (0.6, "mixer")];
    let faults = kills.map(|(at_s, node)| kill(at_s, node)).join(",");
    let script = format!(
        "$LAUNCHER fly --namespace here --mode realtime --out $OUT/run --set run.duration_s=15.0 --set '{PATIENT}' --set 'fault=[{faults}]' &\n\
         time_s() {{ $LAUNCHER status --json | grep -o '\"time_s\": *[0-9]*' | grep -o '[0-9]*$'; }}\n\
         until [ 0$(time_s) -ge 3 ]; do kill -0 $!; sleep 0.05; done\n\
         until df -k /dev/shm | grep '100% /dev/shm'; do kill -0 $!; cat /dev/zero >> /dev/shm/full || true; done\n\
         wait $!"
    );
    let flown = with_memory("size=64m", &script);
    assert!(flown.status.success(), "{}", words(&flown));
    assert!(words(&flown).contains("100% /dev/shm"), "{}", words(&flown));
}

#[test]
fn half_of_what_is_asked_for_holds_a_flight_without_replacements() {
    for rate_hz in [100, 500] {
        let ns = namespace();
        let rate = format!("run.rate_hz={rate_hz}");
        let long: Vec<&str> = LONG.split(' ').collect();
        let flight = ["--mode", "lockstep", "--set", "run.duration_s=3600.0", "--set", &rate];
        let flight = Flight::start(&ns, &[&flight[..], &long].concat());
        let half = bytes_needed(rate_hz) / 2;
        let bytes = || Domain::find(&ns).map_or(0, |domain| domain.files().iter().map(|(_, bytes)| bytes).sum::<u64>());
        wait_until("all segments are there", || {
            let connections = shared_memory_of(&ns).iter().filter(|f| f.ends_with(".connection")).count();
            connections >= 14 && bytes() >= half * 8 / 10
        });
        let had = bytes();
        assert!(had < half, "{had} of {half} bytes at {rate_hz} Hz");
        kill("-INT", &[flight.child.id() as i32]);
        flight.finish();
    }
}

#[test]
fn limits_that_are_too_low_are_said_before_flying_and_raised_where_possible() {
    let limited = |limits: &str| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let script = format!("{limits}; exec {FLY} --out {}", folder.path().join("run").display());
        let script = script.replace("--namespace here", &format!("--namespace {}", namespace()));
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]).env("LAUNCHER", launcher().get_program()).output().expect("sh runs")
    };
    let refused = limited("ulimit -Sn 64; ulimit -Hn 64");
    assert_eq!(refused.status.code(), Some(2), "{}", words(&refused));
    assert!(words(&refused).contains("a process may have 64 files open"), "{}", words(&refused));
    let refused = limited("ulimit -f 1000");
    assert_eq!(refused.status.code(), Some(2), "{}", words(&refused));
    assert!(words(&refused).contains("(`ulimit -f`)"), "{}", words(&refused));
    let raised = limited("ulimit -Sn 64");
    assert!(raised.status.success(), "{}", words(&raised));
}

#[test]
fn without_proc_the_reason_is_said() {
    if cannot_separate("--mount") {
        return;
    }
    let said = words(&with_memory("mode=1777", &format!("umount -l /proc\n{FLY} --out $OUT/run || echo code $?")));
    assert!(said.contains("code 2") && said.contains("/proc is not there"), "{said}");
}
