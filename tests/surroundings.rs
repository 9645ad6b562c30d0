//! Environments of a flight: in each one the default flight stays inside its bounds, or is refused with the
//! reason. `cargo test --test stack surroundings -- --nocapture` prints the table.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::Value;

use crate::harness::{AS_NOBODY, PATIENT, copy_program, has_root, namespace, top};

/// Expected end of a flight.
#[derive(Clone, Copy)]
enum Must {
    Fly,
    /// Fly, and end with exit code 3 because its output cannot be printed.
    FlyUnprinted,
    /// Not begin; the message has this text.
    Say(&'static str),
}
use Must::{Fly, FlyUnprinted, Say};

/// Returns a shell command whose `script` gets the flight as its arguments.
fn sh(script: &'static str) -> Vec<&'static str> {
    vec!["sh", "-c", script, "sh"]
}

fn as_user(limit: &'static str) -> Vec<&'static str> {
    ["prlimit", limit].into_iter().chain(AS_NOBODY.split(' ')).collect()
}

/// Returns a command that limits the flight and runs it as an ordinary user without other processes.
fn alone(limit: &'static str, user: &'static str) -> Vec<&'static str> {
    vec!["prlimit", limit, "setpriv", user, "--regid=65534", "--clear-groups"]
}

fn without(capability: &'static str, dropped: &'static str) -> Vec<&'static str> {
    vec!["prlimit", "--memlock=8388608", "setpriv", capability, dropped]
}

fn cases() -> Vec<(&'static str, Vec<&'static str>, Must)> {
    let files = Say("a flight needs 128; raise the limit (`ulimit -Hn`)");
    vec![
        ("ordinary user, 8 MiB lockable", as_user("--memlock=8388608"), Fly),
        ("ordinary user, 64 KiB lockable", as_user("--memlock=65536"), Fly),
        ("ordinary user, nothing lockable", as_user("--memlock=0"), Fly),
        ("no CAP_SYS_NICE", without("--bounding-set=-sys_nice", "--inh-caps=-sys_nice"), Fly),
        ("no CAP_IPC_LOCK", without("--bounding-set=-ipc_lock", "--inh-caps=-ipc_lock"), Fly),
        ("64 open files", as_user("--nofile=64"), files),
        ("48 open files", as_user("--nofile=48"), files),
        ("/dev/shm of 64 MB", sh("mount -t tmpfs -o size=64m none /dev/shm && exec \"$@\""), Fly),
        ("/dev/shm of 1 MB", sh("mount -t tmpfs -o size=1m none /dev/shm && exec \"$@\""), Say("/dev/shm")),
        ("HOME unset", vec!["env", "-u", "HOME"], Fly),
        ("stdout and stderr closed", sh("exec \"$@\" >&- 2>&-"), Fly),
        ("stdout and stderr full", sh("exec \"$@\" >/dev/full 2>/dev/full"), FlyUnprinted),
        ("stdout and stderr slow", sh("(\"$@\" 2>&1; echo $? >&3) 3>\"$OUT.code\" | (sleep 3; cat >/dev/null)"), Fly),
        ("SIGCHLD ignored", sh("trap '' CHLD; exec \"$@\""), Fly),
        ("SIGHUP ignored", vec!["nohup"], Fly),
        ("a PID namespace", vec!["unshare", "--pid", "--fork", "--mount-proc"], Fly),
        ("a user namespace", vec!["unshare", "--user", "--map-root-user"], Fly),
        ("a mount namespace", vec!["unshare", "--mount"], Fly),
        ("umask 000", sh("umask 000; exec \"$@\""), Fly),
        ("umask 077", sh("umask 077; exec \"$@\""), Fly),
        ("a locale with commas", vec!["env", "LC_ALL=de_DE.UTF-8", "LC_NUMERIC=de_DE.UTF-8"], Fly),
        ("one CPU", vec!["taskset", "-c", "0"], Fly),
        ("256 KiB of stack", vec!["prlimit", "--stack=262144"], Say("raise the limit (`ulimit -s`)")),
        ("20 MB of data", vec!["prlimit", "--data=20000000"], Say("raise the limit (`ulimit -d`)")),
        ("40 MB of address space", vec!["prlimit", "--as=40000000"], Say("raise the limit (`ulimit -v`)")),
        ("files of no byte", vec!["prlimit", "--fsize=0"], Say("raise the limit (`ulimit -f`)")),
        ("no thread", alone("--nproc=2", "--reuid=64321"), Say("allow more processes (`ulimit -u`)")), // the launcher, and `timeout` around it
        ("too few processes", alone("--nproc=5", "--reuid=64322"), Say("allow this user more processes (`ulimit -u`)")),
        ("threads of a petabyte", vec!["env", "RUST_MIN_STACK=999999999999999"], Say("unset RUST_MIN_STACK")),
        ("threads of nonsense", vec!["env", "RUST_MIN_STACK=much"], Fly),
    ]
}

/// Result of a flight: its exit code, what it printed, and its run.json.
struct Came {
    code: Option<i32>,
    said: String,
    run: Option<Value>,
}

fn fly(program: &Path, wrap: &[&str]) -> Came {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o777)).expect("it is ours");
    let out = folder.path().join("run");
    // A flight that mounts a file system gets its own mount namespace.
    let mounts = wrap.iter().any(|word| word.contains("mount -t"));
    let mut words: Vec<&str> = if mounts { vec!["unshare", "--mount"] } else { vec![] };
    words.extend(wrap);
    let program = program.display().to_string();
    let ns = namespace();
    let out_text = out.display().to_string();
    words.extend([
        "timeout",
        "60",
        &program,
        "fly",
        "--set",
        "run.duration_s=2.0",
        "--set",
        PATIENT,
        "--namespace",
        &ns,
    ]);
    words.extend(["--out", &out_text]);
    let mut command = Command::new(words[0]);
    command.args(&words[1..]).env("OUT", &out).stdin(Stdio::null()).current_dir(folder.path());
    let ended = command.output().expect("util-linux and coreutils are there");
    // In a pipeline the shell's exit code hides that of the flight.
    let piped = fs::read_to_string(format!("{out_text}.code")).ok().and_then(|code| code.trim().parse().ok());
    Came {
        code: piped.or(ended.status.code()),
        said: String::from_utf8_lossy(&ended.stderr).into_owned() + &String::from_utf8_lossy(&ended.stdout),
        run: fs::read_to_string(out.join("run.json")).ok().and_then(|text| serde_json::from_str(&text).ok()),
    }
}

/// Judges a flight: returns its text for the table, or the error.
fn judge(must: Must, came: &Came) -> Result<String, String> {
    let flown = |code: i32| -> Result<String, String> {
        let run = came.run.as_ref().ok_or_else(|| format!("no run.json, exit {:?}: {}", came.code, came.said))?;
        let error_m = run["metrics"]["max_position_error_m"].as_f64().unwrap_or(f64::NAN);
        let whole = run["flown_s"].as_f64() >= Some(2.0) && run["unobserved"] == 0 && run["log"]["dropped"] == 0;
        if came.code != Some(code) || !whole || error_m.is_nan() || error_m > 0.2 {
            return Err(format!("exit {:?}, {error_m} m, {}: {}", came.code, run["ended"], came.said));
        }
        let mixer = &run["provenance"]["scheduling"]["mixer"];
        let memory = if mixer["locked_kb"].as_u64() > Some(0) { "locked" } else { "pageable" };
        Ok(format!("flown, {error_m:.4} m, {}, memory {memory}", mixer["policy"].as_str().unwrap_or("?")))
    };
    let refused = |word: &str| -> Result<String, String> {
        let says = came.said.contains(word) && !came.said.contains("backtrace") && !came.said.contains("panicked");
        let first = came.said.lines().find(|line| line.contains("error") || line.contains("topic")).unwrap_or_default();
        let told = matches!(came.code, Some(2 | 3)) && says;
        if told { Ok(format!("refused: {first}")) } else { Err(format!("exit {:?}: {}", came.code, came.said)) }
    };
    match must {
        Fly => flown(0),
        FlyUnprinted => flown(3),
        Say(word) => refused(word),
    }
}

/// Copies the launcher into `folder`, where every user can start it.
pub fn program(folder: &Path) -> PathBuf {
    fs::set_permissions(folder, fs::Permissions::from_mode(0o755)).expect("it is ours");
    let program = folder.join("trefoil");
    copy_program(Path::new(env!("CARGO_BIN_EXE_trefoil")), &program);
    program
}

#[test]
#[expect(clippy::disallowed_macros, reason = "the table is for --nocapture")]
fn in_every_surrounding_the_vehicle_flies_or_the_reason_is_told() {
    if !has_root() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (program, cases) = (program(folder.path()), cases());
    let next = AtomicUsize::new(0);
    let results = std::sync::Mutex::new(vec![]);
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                while let Some((name, wrap, must)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let came = fly(&program, wrap);
                    results.lock().expect("no test panics there").push((*name, judge(*must, &came)));
                }
            });
        }
    });
    let results = results.into_inner().expect("no test panics there");
    for (name, result) in &results {
        println!("{name:<36} {}", result.as_ref().map_or_else(|why| format!("FAILED {why}"), Clone::clone));
    }
    let failed: Vec<_> = results.iter().filter(|(_, result)| result.is_err()).collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
fn a_working_folder_that_cannot_be_written_is_named() {
    if !has_root() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = program(folder.path());
    let script = "mount -t tmpfs -o ro none \"$0\" && cd \"$0\" && exec \"$@\"";
    let place = folder.path().join("ro");
    fs::create_dir(&place).expect("it is ours");
    for mode in ["inprocess", "realtime"] {
        let mut command = Command::new("unshare");
        command.args(["--mount", "sh", "-c", script]).arg(&place).arg(&program).args(["fly", "--mode", mode]);
        let output = command.args(["--namespace", &namespace()]).current_dir(top()).output().expect("unshare runs");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{mode}: {said}");
        assert!(said.contains("cannot write to the output folder") && said.contains("--out"), "{mode}: {said}");
    }
}
