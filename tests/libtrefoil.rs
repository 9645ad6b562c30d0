//! libtrefoil: a program in C with its own main flies as a node, and steps a flight, with the bits of the same law in a
//! library. The tests of the Python package that uses libtrefoil are run from here too.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{LazyLock, Once};

use serde_json::Value;

use crate::controllers::{needs_dependency, with_dependency};
use crate::harness::{Outcome, PATIENT, fly, launcher, python_with, top};

/// Links libtrefoil, as built for these tests, into `folder` under its usual name; returns the folder.
pub fn library_folder(folder: &Path) -> PathBuf {
    let built = Path::new(env!("CARGO_BIN_EXE_trefoil")).parent().expect("a folder").to_owned();
    let library =
        ["deps/libtrefoil.so", "libtrefoil.so"].map(|file| built.join(file)).into_iter().find(|file| file.exists());
    let link = folder.join("libtrefoil.so");
    std::os::unix::fs::symlink(library.expect("cargo has built libtrefoil"), link).expect("a link");
    folder.to_owned()
}

/// Compiles `tests/controllers/own_main.c` against the library in `folder`.
fn program(folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    linked("own_main.c", folder, name, flags)
}

/// Compiles the program `source` of `tests/controllers` against the library in `folder`.
pub fn linked(source: &str, folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    let file = folder.join(name);
    let mut cc = Command::new("cc");
    // The folder given below then counts before those of LD_LIBRARY_PATH, in which cargo may have an older library.
    cc.arg("-Wl,--disable-new-dtags");
    cc.args(["-std=gnu11", "-Wall", "-Wextra", "-Werror", "-O2"])
        .args(flags)
        .arg("-I")
        .arg(top().join("foreign/include"));
    cc.arg("-o").arg(&file).arg(top().join("tests/controllers").join(source)).arg("-L").arg(folder);
    let output = cc
        .args(["-ltrefoil", "-lm"])
        .arg(format!("-Wl,-rpath,{}", folder.display()))
        .output()
        .expect("the C compiler of Rust");
    assert!(output.status.success(), "{}", said(&output));
    file
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

fn library(folder: &Path) -> PathBuf {
    let file = folder.join("pd.so");
    let mut cc = Command::new("cc");
    cc.args(["-std=gnu11", "-O2", "-fPIC", "-shared", "-DCOLD", "-I"]).arg(top().join("foreign/include"));
    let output = cc.arg("-o").arg(&file).arg(top().join("tests/controllers/pd.c")).arg("-lm").output();
    assert!(output.is_ok_and(|output| output.status.success()));
    file
}

/// Bound that the law of these tests keeps.
const BOUND: &str = "bounds.max_position_error_m=0.5";
const KILL: &str = "fault=[{at_s=1, target='attitude-mpc', kind='kill'}]";

fn survey(mode: &str, program: &Path, settings: &[&str]) -> Outcome {
    let exec = format!("node.attitude-mpc.exec={}", program.display());
    let mut arguments =
        vec!["scenarios/survey.toml", "--mode", mode, "--set", "run.duration_s=3", "--set", BOUND, "--set", &exec];
    arguments.extend(["--set", PATIENT]);
    for set in settings {
        arguments.extend(["--set", set]);
    }
    fly(&arguments)
}

#[test]
fn a_program_in_c_flies_with_the_bits_of_the_same_law_in_a_library() {
    let folder = tempfile::tempdir().unwrap();
    let program = program(&library_folder(folder.path()), "own", &[]);
    let library = survey("inprocess", &library(folder.path()), &[KILL]);
    let gain = "node.attitude-mpc.settings.gain=1.0";
    let lockstep = survey("lockstep", &program, &[KILL, gain]);
    assert_eq!(lockstep.code(), Some(0), "{}", lockstep.stderr);
    assert_eq!(lockstep.state_hash(), library.state_hash());
    let log = |epoch: u32| std::fs::read_to_string(lockstep.out.join(format!("attitude-mpc.{epoch}.log"))).unwrap();
    assert_eq!(log(1), "left: 0 byte, 0 steps; settings {\"gain\":1.0}\n");
    assert_eq!(log(2), "left: 8 byte, 100 steps; settings {\"gain\":1.0}\n");
}

#[test]
fn a_program_in_c_flies_against_the_clock_and_is_replayed_from_its_log() {
    let folder = tempfile::tempdir().unwrap();
    let program = program(&library_folder(folder.path()), "own", &[]);
    let flown = survey("realtime", &program, &[]);
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    assert!(flown.run()["timing"]["nodes"]["attitude-mpc"]["execution"]["n"].as_u64().unwrap() > 250);
    let replayed = launcher().arg("replay").arg(&flown.out).output().unwrap();
    assert!(
        replayed.status.success() && said(&replayed).contains("not computed: attitude-mpc 1"),
        "{}",
        said(&replayed)
    );
}

#[test]
fn a_program_that_misses_a_deadline_with_the_policy_stop_ends_with_exit_code_4() {
    let folder = tempfile::tempdir().unwrap();
    let program = program(&library_folder(folder.path()), "own", &[]);
    let slow = "fault=[{at_s=1, for_s=0.1, target='attitude-mpc', kind='slow', ms=15.0}]";
    let late = survey("realtime", &program, &[slow, "deadline.late=stop"]);
    assert_eq!(late.code(), Some(i32::from(contract::exit::BUDGET_BROKEN)), "{}", late.stderr);
}

#[test]
fn a_program_that_the_launcher_has_not_started_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let program = program(&library_folder(folder.path()), "own", &[]);
    let alone = Command::new(&program).output().unwrap();
    assert_eq!(alone.status.code(), Some(2));
    assert!(said(&alone).contains("the launcher has not started this program"), "{}", said(&alone));
    let orphan = Command::new(&program).args(["--namespace", "no-such-stack"]).output().unwrap();
    assert!(said(&orphan).contains("no stack runs in namespace 'no-such-stack'"), "{}", said(&orphan));
}

#[test]
fn a_stepped_flight_in_c_has_the_bits_of_the_same_law_in_a_library() {
    let folder = tempfile::tempdir().unwrap();
    let program = program(&library_folder(folder.path()), "stepped", &["-DSTEPPED"]);
    let library = library(folder.path());
    for settings in [&[][..], &[KILL]] {
        let step = |more: &[&str]| {
            let mut command = Command::new(&program);
            command.current_dir(top()).args(["scenarios/survey.toml", "run.duration_s=3", BOUND]).args(settings);
            command.args(more).output().unwrap()
        };
        let stepped = step(&[]);
        let record: Value = serde_json::from_slice(&stepped.stdout).unwrap_or_else(|_| panic!("{}", said(&stepped)));
        assert_eq!(record["state_hash"].as_str(), Some(survey("inprocess", &library, settings).state_hash().as_str()));
        assert_eq!((&record["stepped"], &record["exit_code"]), (&"attitude-mpc".into(), &0.into()));
        let refused = step(&["run.mode=lockstep"]);
        assert_eq!(refused.status.code(), Some(2));
        assert!(said(&refused).contains("a stepped flight is in process"), "{}", said(&refused));
    }
}

#[test]
fn a_stepped_flight_refuses_a_library_whose_dependency_its_program_has_from_another_file() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] = ["one", "other"].map(|name| with_dependency(folder.path(), name, "1.0"));
    let beside_one = one.parent().unwrap();
    let rpath = format!("-Wl,-rpath,{}", beside_one.display());
    let flags = [&needs_dependency(beside_one)[..], &["-DSTEPPED", &rpath]].concat();
    let program = program(&library_folder(folder.path()), "stepped", &flags);
    let step = |guidance: &Path| {
        let exec = format!("node.guidance.exec={}", guidance.display());
        let mut command = Command::new(&program);
        command.current_dir(top()).args(["scenarios/survey.toml", "run.duration_s=1", BOUND, &exec]).output().unwrap()
    };
    assert_eq!(step(&one).status.code(), Some(0), "{}", said(&step(&one)));
    let refused = step(&other);
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    for file in [&one, &other].map(|file| file.with_file_name("libdep.so.0").display().to_string()) {
        assert!(said(&refused).contains(&file), "should name {file}: {}", said(&refused));
    }
}

/// Returns the folder of this repository's Python package, as built for these tests and installed once for all of them.
fn installed_package(python: &Path) -> &'static Path {
    static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| Path::new(env!("CARGO_TARGET_TMPDIR")).join("python/trefoil"));
    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let _ = std::fs::remove_dir_all(&*FOLDER); // it does not exist before the first run
        let built = FOLDER.join("built");
        std::fs::create_dir_all(&built).expect("a folder of cargo");
        library_folder(&built);
        std::os::unix::fs::symlink(env!("CARGO_BIN_EXE_trefoil"), built.join("trefoil")).expect("a link");
        let mut pip = Command::new(python);
        pip.args(["-m", "pip", "install", "-q", "--no-build-isolation", "--no-deps", "--no-index", "--target"]);
        pip.arg(FOLDER.join("site")).arg(top().join("python")).env("TREFOIL_BUILT", &built);
        let output = pip.output().expect("pip runs");
        assert!(output.status.success(), "{}", said(&output));
    });
    &FOLDER
}

/// Makes a venv in `folder` that has these packages and the Python package of this repository; returns its Python.
/// Without the package index returns `None` and prints a note.
pub fn python_with_trefoil(packages: &[&str], folder: &Path) -> Option<PathBuf> {
    let python = python_with(&[&["setuptools>=77", "wheel", "numpy"], packages].concat())?;
    let venv = folder.join("venv");
    let made = Command::new(&python).args(["-m", "venv", "--without-pip"]).arg(&venv).output().expect("it has venv");
    assert!(made.status.success(), "{}", said(&made));
    let packages_of = |venv: &Path| {
        let lib = std::fs::read_dir(venv.join("lib")).expect("a venv").next().expect("one Python").expect("a folder");
        lib.path().join("site-packages")
    };
    let shared = packages_of(python.ancestors().nth(2).expect("a venv"));
    let paths = format!("{}\n{}\n", shared.display(), installed_package(&python).join("site").display());
    std::fs::write(packages_of(&venv).join("shared.pth"), paths).expect("a file");
    Some(venv.join("bin/python"))
}

#[test]
fn the_python_package_installs_and_its_tests_pass() {
    let folder = tempfile::tempdir().unwrap();
    let packages = ["pandas", "pyarrow", "mcap", "mcap-protobuf-support", "gymnasium==1.4.*", "pytest"];
    let Some(python) = python_with_trefoil(&packages, folder.path()) else { return };
    let mut pytest = Command::new(&python);
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "--basetemp"]).arg(folder.path().join("tests"));
    let tested = pytest.env("PYTHONDONTWRITEBYTECODE", "1").arg(top().join("python/tests")).output().unwrap();
    assert!(tested.status.success(), "{}", said(&tested));
}

/// Checks that the Python program `script` flies as attitude-mpc: with the same bits in each of two lockstep flights
/// with a kill, and against the clock, where its answers are recorded and the rest is computed again.
pub fn flies_as_a_program(scenario: &str, python: &Path, script: &Path, settings: &[&str]) {
    let node = format!("node.attitude-mpc={{ exec='{}', args=['{}'] }}", python.display(), script.display());
    let flown = |mode: &str, more: &[&str]| {
        let all = [&["run.duration_s=3", &node as &str], settings, more].concat();
        let arguments: Vec<&str> = all.iter().flat_map(|set| ["--set", set]).collect();
        fly(&[&[scenario, "--mode", mode][..], &arguments].concat())
    };
    let flights = [flown("lockstep", &[KILL]), flown("lockstep", &[KILL])];
    for flight in &flights {
        assert_eq!(flight.code(), Some(0), "{}", flight.stderr);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    let flight = flown("realtime", &[]);
    assert!(flight.out.join("flight.mcap").exists(), "{}", flight.stderr);
    let (code, said) = crate::controllers::replay(&flight.out, &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("not computed: attitude-mpc"), "{said}");
}

#[test]
fn a_copy_that_a_program_makes_of_its_process_answers_to_nothing() {
    let folder = tempfile::tempdir().unwrap();
    library_folder(folder.path());
    let [plain, forks] =
        [("plain", &[][..]), ("forks", &["-DFORK=100"])].map(|(name, flags)| program(folder.path(), name, flags));
    let gain = "node.attitude-mpc.settings.gain=1.0";
    for mode in ["lockstep", "realtime"] {
        let flown = survey(mode, &forks, &[gain]);
        assert_eq!(flown.code(), Some(0), "{mode}: {}", flown.stderr);
        let run = flown.run();
        assert_eq!(run["port_failures"]["attitude-mpc"]["copy"], 1, "{mode}: {run}");
        assert_eq!(run["refused"]["mixer"]["order"], 0, "{mode}: {run}");
        if mode == "lockstep" {
            assert_eq!(flown.state_hash(), survey(mode, &plain, &[gain]).state_hash());
        }
    }
}
