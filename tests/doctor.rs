//! `doctor` on this machine: its findings agree with the first lines of a flight.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::harness::{AS_NOBODY, NOBODY, has_root, launcher, namespace};
use crate::surroundings::program;

/// Commands that start another command as root without one capability.
const NO_NICE: &str = "setpriv --bounding-set=-sys_nice --inh-caps=-sys_nice";
const NO_LOCK: &str = "setpriv --bounding-set=-ipc_lock --inh-caps=-ipc_lock";

/// Runs `program` under the command `wrap`, with 8 MiB of lockable memory and no priority by limits.
fn wrapped(wrap: &str, program: &Path, words: &[&str]) -> Output {
    let mut command = Command::new("prlimit");
    command.args(["--memlock=8388608", "--rtprio=0"]).args(wrap.split(' ')).arg(program).args(words);
    command.current_dir(program.parent().expect("a folder")).output().expect("util-linux is there")
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)))
}

fn finding<'a>(report: &'a Value, check: &str) -> &'a Value {
    let all = report["findings"].as_array().expect("findings");
    all.iter().find(|finding| finding["check"] == check).unwrap_or_else(|| panic!("no {check} in {report}"))
}

#[test]
fn this_machine_is_examined_and_the_exit_code_follows_from_the_findings() {
    let output = launcher().args(["doctor", "--watch", "500ms", "--json"]).output().expect("it runs");
    let report = json(&output);
    let findings = report["findings"].as_array().expect("findings");
    assert!(findings.len() > 15, "{report}");
    let levels = ["ok", "warn", "bad", "unknown"];
    assert!(findings.iter().all(|finding| levels.contains(&finding["level"].as_str().expect("a word"))), "{report}");
    let is_bad = findings.iter().any(|finding| finding["level"] == "bad");
    assert!(!is_bad || report["fit"] == false, "{report}");
    assert_eq!(output.status.code(), Some(i32::from(report["fit"] == false)));
    assert!(report["canary"]["noted"]["n"].as_u64() > Some(50), "{report}");
    finding(&report, "stolen time");
}

#[test]
fn what_is_foretold_is_what_a_flight_gets_and_its_first_lines_say_so() {
    if !has_root() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = program(folder.path());
    for (wrap, fifo, lock) in
        [(AS_NOBODY, false, false), (NO_NICE, false, true), (NO_LOCK, true, false), ("env", true, true)]
    {
        let report = json(&wrapped(wrap, &program, &["doctor", "--watch", "0s", "--json"]));
        let [found_class, found_memory] = ["scheduling class", "memory lock"].map(|check| finding(&report, check));
        let flown = tempfile::tempdir_in(folder.path()).expect("a folder");
        std::os::unix::fs::chown(flown.path(), Some(NOBODY), Some(NOBODY)).expect("root may");
        let out = flown.path().join("run").display().to_string();
        let ns = namespace();
        let words = ["fly", "--no-log", "--set", "run.duration_s=0.5", "--namespace", &ns, "--out", &out];
        let flight = wrapped(wrap, &program, &words);
        let said = String::from_utf8_lossy(&flight.stderr);
        let text = std::fs::read_to_string(flown.path().join("run/run.json")).unwrap_or_else(|e| panic!("{e}: {said}"));
        let run: Value = serde_json::from_str(&text).expect("run.json is JSON");
        let nodes = ["plant", "guidance", "attitude-mpc", "mixer"].map(|node| &run["provenance"]["scheduling"][node]);
        let has_all = |has: fn(&Value) -> bool| nodes.iter().all(|node| has(node));
        let got = [has_all(|of| of["policy"] == "fifo"), has_all(|of| of["locked_kb"].as_u64() > Some(0))];
        assert_eq!(got, [fifo, lock], "{wrap}: {nodes:?}");
        let foretold = [found_class, found_memory].map(|found| found["level"] == "ok");
        assert_eq!(foretold, got, "{wrap}: {report}");
        for found in [found_class, found_memory] {
            let note =
                format!("note: {}: {}", found["check"].as_str().unwrap_or("?"), found["found"].as_str().unwrap_or("?"));
            // The sizes in brackets are left out: the flight's process differs slightly in size from the doctor's.
            let note = note.split(" MB may be locked").next().unwrap_or(&note);
            assert_eq!(said.contains(note), found["level"] == "bad", "{note}: {said}");
        }
        let told = [&flight.stdout, &flight.stderr].map(|said| String::from_utf8_lossy(said).matches("setcap").count());
        assert_eq!(told, [0, usize::from(!fifo || !lock)], "once, in the notes: {wrap}: {said}");
        let whole = format!("+ep {}\n", program.display());
        assert!(fifo && lock || said.contains(&whole), "with the whole path: {wrap}: {said}");
    }
}

#[test]
fn an_ordinary_user_reads_what_to_do_and_gets_exit_code_1() {
    if !has_root() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = program(folder.path());
    let output = wrapped(AS_NOBODY, &program, &["doctor", "--watch", "200ms"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let setcap = format!("do: sudo setcap cap_sys_nice,cap_ipc_lock+ep {}", program.display());
    assert_eq!(said.matches(&setcap).count(), 2, "{said}");
    let last = said.lines().last().unwrap_or_default();
    assert!(last.contains("does not get what it asks for: scheduling class, memory lock, canary"), "{last}");
    let modest = ["--set", "realtime.policy=\"other\"", "--set", "realtime.lock_memory=false", "--watch", "0s"];
    let output = wrapped(AS_NOBODY, &program, &[&["doctor"][..], &modest].concat());
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "it asks for neither: {said}");
    assert!(said.contains("'survey' gets what it asks for"), "{said}");
}

#[test]
fn bad_arguments_are_refused() {
    for words in
        [&["no-such-file.toml"][..], &["--watch", "1h"], &["--watch", "soon"], &["--set", "realtime.policy=\"rr\""]]
    {
        let output = launcher().arg("doctor").args(words).output().expect("it runs");
        assert_eq!(output.status.code(), Some(2), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(output.stdout.is_empty(), "{words:?}");
    }
}
