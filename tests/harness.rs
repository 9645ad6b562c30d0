//! Flights for tests: the launcher's own binary, a folder and a namespace per flight, a watchdog.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use runtime::domain::Domain;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Longest wall-clock time of a flight of the tests.
const WATCHDOG: Duration = Duration::from_secs(120);

/// Setting for flights in real time in which no process may be replaced because the machine has stalled it.
pub const PATIENT: &str = "supervision={ hang_ms = 60000.0, start_limit_s = 60.0 }";

/// Result of a run of the launcher: exit status, messages, and the folder of the run.
pub struct Outcome {
    pub status: ExitStatus,
    pub stderr: String,
    pub out: PathBuf,
    _folder: tempfile::TempDir,
}

impl Outcome {
    pub fn code(&self) -> Option<i32> {
        self.status.code()
    }

    /// Returns run.json of the flight.
    pub fn run(&self) -> Value {
        let text = std::fs::read_to_string(self.out.join("run.json"))
            .unwrap_or_else(|e| panic!("no run.json: {e}; the launcher said: {}", self.stderr));
        serde_json::from_str(&text).expect("run.json is JSON")
    }

    pub fn metric(&self, name: &str) -> f64 {
        self.run()["metrics"][name].as_f64().unwrap_or_else(|| panic!("no metric {name}"))
    }

    pub fn state_hash(&self) -> String {
        let run = self.run();
        run["state_hash"].as_str().unwrap_or_else(|| panic!("no state hash in {run}")).to_owned()
    }
}

/// Copies a program by a child process. A file that this process opens for writing may stay open in the child of
/// another test, and a file that is open for writing cannot be run.
pub fn copy_program(from: &Path, to: &Path) {
    assert!(Command::new("cp").args([from, to]).status().expect("cp runs").success(), "{}", to.display());
}

/// Writes a script by a child process, for the reason given at [`copy_program`].
pub fn write_script(path: &Path, script: &str) {
    let mut shell = Command::new("sh");
    let mut shell =
        shell.args(["-c", "cat >\"$0\" && chmod 755 \"$0\""]).arg(path).stdin(Stdio::piped()).spawn().expect("sh");
    shell.stdin.take().expect("a pipe").write_all(script.as_bytes()).expect("it is read");
    assert!(shell.wait().expect("sh ends").success(), "{}", path.display());
}

/// The user `nobody`, and a command that starts another command as that user.
pub const NOBODY: u32 = 65534;
pub const AS_NOBODY: &str = "setpriv --reuid=65534 --regid=65534 --clear-groups";

/// Prints on the terminal that the current test is skipped, and `why`. Writes to stderr directly, because the test
/// runner hides the printed output of passing tests.
pub fn skip(why: &str) {
    let thread = std::thread::current();
    // One write, so that no line of another test comes between: `.ci/run` counts these lines.
    let line = format!("skipped: {why}: {}\n", thread.name().unwrap_or("a test"));
    let _ = std::io::stderr().write_all(line.as_bytes());
}

/// Returns whether this process is root, which other users, mounts and namespaces need; prints a note if not.
pub fn has_root() -> bool {
    let is_root = rustix::process::geteuid().is_root();
    if !is_root {
        skip("needs root");
    }
    is_root
}

/// Returns a Python with `packages` of the Python Package Index, installed once for all tests and runs that need the
/// same packages; `None`, and a note, if that fails.
pub fn python_with(packages: &[&str]) -> Option<PathBuf> {
    let name = packages.join("-").replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python").join(name);
    let (venv, whole) = (folder.join("venv"), folder.join("whole"));
    let python = venv.join("bin/python");
    std::fs::create_dir_all(&folder).expect("a folder of cargo");
    let lock = File::create(folder.join("lock")).expect("a file");
    lock.lock().expect("a lock"); // held until this function returns
    if whole.exists() && Command::new(&python).arg("--version").output().is_ok() {
        return Some(python);
    }
    let made = Command::new("python3").args(["-m", "venv", "--clear"]).arg(&venv).output();
    if !made.as_ref().is_ok_and(|made| made.status.success()) {
        skip(&format!("python3 with venv is not here: {made:?}"));
        return None;
    }
    let install = ["-m", "pip", "install", "-q", "--disable-pip-version-check"];
    let installed = Command::new(&python).args(install).args(packages).output().expect("pip runs");
    if !installed.status.success() {
        skip(&format!("{packages:?} cannot be had from PyPI: {}", String::from_utf8_lossy(&installed.stderr)));
        return None;
    }
    File::create(whole).expect("a file");
    Some(python)
}

/// Returns a namespace that no other flight on this machine has.
pub fn namespace() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    format!("test-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}

/// Returns the repository's top folder.
pub fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("launcher/ lies in the repository").to_owned()
}

/// Runs `trefoil fly` with `arguments` to its end.
pub fn fly(arguments: &[&str]) -> Outcome {
    Flight::start(&namespace(), arguments).finish()
}

/// Flight under way. Drop kills its launcher.
pub struct Flight {
    pub child: Child,
    pub out: PathBuf,
    folder: Option<tempfile::TempDir>,
}

impl Flight {
    pub fn start(namespace: &str, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let out = folder.path().join("run");
        let child = launcher()
            .arg("fly")
            .args(arguments)
            .args(["--namespace", namespace, "--out"])
            .arg(&out)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the launcher starts");
        Self { child, out, folder: Some(folder) }
    }

    /// Waits for the end, no longer than the watchdog.
    pub fn finish(mut self) -> Outcome {
        use std::io::Read;
        let deadline = Instant::now() + WATCHDOG;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("the launcher can be waited for") {
                break status;
            }
            assert!(Instant::now() < deadline, "the flight did not end within {WATCHDOG:?}");
            std::thread::sleep(Duration::from_millis(5));
        };
        let mut stderr = String::new();
        self.child.stderr.take().map(|mut e| e.read_to_string(&mut stderr));
        let folder = self.folder.take().expect("a flight is finished once");
        Outcome { status, stderr, out: self.out.clone(), _folder: folder }
    }
}

/// Interrupts a flight in real time; returns its run.json.
pub fn land(flight: Flight) -> Value {
    let _ = kill_process(Pid::from_child(&flight.child), Signal::INT); // it may have ended by itself
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    outcome.run()
}

impl Drop for Flight {
    fn drop(&mut self) {
        let _ = self.child.kill(); // it has ended already, in tests that pass
        let _ = self.child.wait();
    }
}

/// Returns a command of the launcher's binary, as built for these tests, in the top folder.
pub fn launcher() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_trefoil"));
    command.current_dir(top());
    command
}

/// Waits until `condition` holds, no longer than the watchdog.
pub fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + WATCHDOG;
    while !condition() {
        assert!(Instant::now() < deadline, "timed out: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Runs `command` and returns its exit status; panics after [`WATCHDOG`]. Discards the output, since a process left
/// behind would keep a pipe open.
pub fn ended(command: &mut Command) -> ExitStatus {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the launcher starts");
    let deadline = Instant::now() + WATCHDOG;
    loop {
        if let Some(status) = child.try_wait().expect("the launcher can be waited for") {
            return status;
        }
        if Instant::now() > deadline {
            let _ = child.kill().and_then(|()| child.wait()); // it may have ended by itself
            panic!("{command:?} did not end within {WATCHDOG:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Returns the running processes that have the environment variable `name`.
pub fn processes_with(name: &str) -> Vec<String> {
    let variable = format!("{name}=");
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten().map(|entry| entry.path());
    let has = |path: &PathBuf| {
        let variables = std::fs::read(path.join("environ")).unwrap_or_default();
        variables.split(|byte| *byte == 0).any(|one| one.starts_with(variable.as_bytes()))
    };
    let line = |path: PathBuf| {
        let words = std::fs::read(path.join("cmdline")).unwrap_or_default();
        format!("{} {}", path.display(), String::from_utf8_lossy(&words).replace('\0', " "))
    };
    processes.filter(has).map(line).collect()
}

/// Lists what a namespace has in shared memory: its folder, and the files in it.
pub fn shared_memory_of(namespace: &str) -> Vec<String> {
    let Some(domain) = Domain::left(namespace) else { return vec![] };
    let files = domain.files().into_iter().map(|(path, _)| path);
    [domain.folder.clone()].into_iter().chain(files).map(|path| path.display().to_string()).collect()
}

/// Lists the namespaces with `part` in their names that have a folder in shared memory, alive or left behind.
pub fn in_memory(part: &str) -> Vec<String> {
    let folder = format!("/dev/shm/trefoil-{}", rustix::process::geteuid().as_raw());
    let all = std::fs::read_dir(folder).into_iter().flatten().flatten(); // without this folder nothing is in memory
    all.map(|entry| entry.file_name().to_string_lossy().into_owned()).filter(|name| name.contains(part)).collect()
}
