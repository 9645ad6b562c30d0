//! Controllers of users: a library in C flies in every mode with the same bits, and no trap in it does more harm than
//! docs/controllers.md says.

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use contract::exit;
use serde_json::Value;

use crate::harness::{
    Outcome, PATIENT, ended, fly, launcher, namespace, processes_with, python_with, top, wait_until, write_script,
};

/// Compiles `tests/controllers/pd.c` into `folder/name.so`, with these flags for the compiler.
pub fn library(folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    compiled(&top().join("tests/controllers/pd.c"), folder, name, flags)
}

/// Compiles `source`, in C or C++, into `folder/name.so`, with these flags for the compiler.
pub fn compiled(source: &Path, folder: &Path, name: &str, flags: &[&str]) -> PathBuf {
    let file = folder.join(name).with_extension("so");
    let is_cpp = source.extension().is_some_and(|ending| ending == "cpp");
    let (compiler, standard) = if is_cpp { ("c++", "-std=c++17") } else { ("cc", "-std=gnu11") };
    let mut cc = Command::new(compiler);
    cc.args([standard, "-Wall", "-Wextra", "-Werror", "-O2", "-fPIC", "-shared"]).args(flags);
    cc.arg("-I").arg(top().join("foreign/include")).arg("-o").arg(&file).arg(source).arg("-lm");
    let output = cc.output().expect("the C compiler that Rust links with");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    file
}

fn exec(library: &Path) -> String {
    format!("node.attitude-mpc.exec={}", library.display())
}

/// Hovers for 4 s in `mode` with these settings.
fn hover(mode: &str, settings: &[&str]) -> Outcome {
    let settings = [&["run.duration_s=4", "mission.trajectory=hover"], settings].concat();
    flown("scenarios/survey.toml", mode, &settings)
}

/// Flies `scenario` in `mode` with these settings.
fn flown(scenario: &str, mode: &str, settings: &[&str]) -> Outcome {
    let settings = settings.iter().flat_map(|set| ["--set", set]);
    fly(&[scenario, "--mode", mode].into_iter().chain(settings).collect::<Vec<_>>())
}

#[test]
fn a_library_flies_with_the_same_bits_in_every_mode() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(folder.path(), "pd", &[]);
    let kill = "fault=[{at_s=1, target='attitude-mpc', kind='kill'}]";
    for settings in [&[][..], &[kill]] {
        let settings: Vec<&str> = settings.iter().copied().chain([exec(&library).leak() as &str]).collect();
        let [inprocess, lockstep] = ["inprocess", "lockstep"].map(|mode| hover(mode, &settings));
        assert_eq!((inprocess.code(), lockstep.code()), (Some(0), Some(0)), "{}", lockstep.stderr);
        assert_eq!(inprocess.state_hash(), lockstep.state_hash());
        let ours = hover("inprocess", &settings[..settings.len() - 1]);
        assert_ne!(ours.state_hash(), inprocess.state_hash(), "another law");
    }
    let stronger = hover("inprocess", &[&exec(&library), "node.attitude-mpc.settings={ gain = 1.1 }"]);
    assert_ne!(stronger.state_hash(), hover("inprocess", &[&exec(&library)]).state_hash(), "it reads its settings");
}

pub fn replay(run: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = launcher().arg("replay").arg(run).args(arguments).output().expect("the launcher runs");
    (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
}

#[test]
fn a_replay_computes_the_answers_of_a_library_only_if_the_user_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let (own, other) = (library(folder.path(), "pd", &[]), library(folder.path(), "other", &["-O1"]));
    let flown = hover("realtime", &[&exec(&own), PATIENT]);
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    let (code, said) = replay(&flown.out, &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("not computed: attitude-mpc 1"), "{said}");
    assert!(said.contains("with --program attitude-mpc=FILE"), "it says how: {said}");
    let named = |file: &Path| format!("attitude-mpc={}", file.display());
    let (code, said) = replay(&flown.out, &["--program", &named(&own)]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the same bits") && said.contains(&flown.state_hash()), "{said}");
    let (code, said) = replay(&flown.out, &["--program", &named(&other)]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("is another file"), "{said}");
    let (code, said) = replay(&flown.out, &["--node", "attitude-mpc", "--exec", other.to_str().unwrap()]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the same answers, bit for bit"), "{said}");
}

#[test]
fn a_flight_of_a_library_without_a_disturbed_tick_is_explained_without_loading_it() {
    let folder = tempfile::tempdir().unwrap();
    let flown = hover("lockstep", &[&exec(&library(folder.path(), "pd", &[])), "run.duration_s=1"]);
    let explained = launcher().arg("explain").arg(&flown.out).output().expect("the launcher runs");
    let said = String::from_utf8_lossy(&explained.stdout);
    assert_eq!(explained.status.code(), Some(0), "{}", String::from_utf8_lossy(&explained.stderr));
    assert!(said.contains("0 disturbed ticks"), "{said}");
}

/// Checks that 20 swaps between our core of `node` and `program` lose no tick in a flight of `scenario` in each of the
/// `modes`. The `settings` that begin with `node.` belong to the program.
pub fn swapped_in_and_out(scenario: &str, node: &str, program: &Path, settings: &[&str], modes: [&str; 2]) {
    let (times, bounds) = ("standby_s=0.1, watch_s=0.1", "bounds={ difference=1e3, similarity=-1 }");
    let of_program: Vec<&&str> = settings.iter().filter(|set| set.starts_with("node.")).collect();
    let swap = |i: u32| {
        let at_s = 0.5 + f64::from(i) * 0.25;
        let program = match i % 2 {
            0 => "exec=''".to_owned(),
            _ => format!("exec='{}', set={of_program:?}", program.display()),
        };
        format!("{{ node='{node}', at_s={at_s}, {times}, {bounds}, {program} }}")
    };
    let swaps = format!("swap=[{}]", (0..20).map(swap).collect::<Vec<_>>().join(", "));
    let own = format!("node.{node}.exec={}", program.display());
    let settings = [&["run.duration_s=7", &own as &str, &swaps], settings].concat();
    let flights = modes.map(|mode| flown(scenario, mode, &settings));
    for flight in &flights {
        assert_eq!(flight.code(), Some(0), "{}", flight.stderr);
        let run = flight.run();
        let kept = run["events"].as_array().expect("events").iter().filter(|event| event["what"] == "kept").count();
        assert_eq!(kept, 20, "{:?}", run["events"]);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
}

#[test]
fn a_swap_to_a_library_and_back_loses_no_tick() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(folder.path(), "pd", &[]);
    let hover = ["mission.trajectory=hover"];
    swapped_in_and_out("scenarios/survey.toml", "attitude-mpc", &library, &hover, ["lockstep", "inprocess"]);
}

/// Flies the library with `trap` in `mode`; returns its outcome.
fn trapped(folder: &Path, trap: u32, mode: &str) -> Outcome {
    let library = library(folder, &format!("trap{trap}"), &[&format!("-DTRAP={trap}")]);
    // What hangs is waited for; nothing else is lost because the machine has stalled it.
    let wall_limit_s = if trap == 4 { 2.0 } else { 30.0 };
    let supervision = format!("supervision={{ restart_ms = [0.0], hang_ms = 500.0, wall_limit_s = {wall_limit_s:?} }}");
    hover(mode, &[&exec(&library), &supervision])
}

#[test]
fn a_library_that_cannot_be_loaded_or_tried_is_refused_before_the_flight() {
    let folder = tempfile::tempdir().unwrap();
    for (trap, why) in [
        (1, "ended the process that tried it"),
        (3, "it did not load and answer within 10 s"),
        (5, "ended the process that tried it"),
        (9, "build it with the header of this launcher"),
        (10, "it has interface 99, and this launcher has 1"),
        (11, "it has no node `attitude-mpc`"),
        (12, "it cannot create attitude-mpc: no gain in {}"),
        (14, "ended the process that tried it"),
    ] {
        let outcome = trapped(folder.path(), trap, "inprocess");
        assert_eq!(outcome.code(), Some(i32::from(exit::USAGE)), "trap {trap}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "trap {trap}: {}", outcome.stderr);
    }
    for (name, why) in [
        ("my_node", "it does not export `trefoil_node_v1`"),
        ("trefoil_node_v7", "it has interface 7 (`trefoil_node_v7`), and this launcher has 1"),
    ] {
        let renamed = library(folder.path(), name, &[&format!("-Dtrefoil_node_v1={name}")]);
        let outcome = hover("inprocess", &[&exec(&renamed)]);
        assert_eq!(outcome.code(), Some(i32::from(exit::USAGE)), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "{}", outcome.stderr);
    }
    let text = folder.path().join("text.so");
    std::fs::write(&text, "no library").unwrap();
    let foreign_machine = folder.path().join("machine.so");
    let mut bytes = std::fs::read(library(folder.path(), "good", &[])).unwrap();
    bytes[18] = 0xf3; // e_machine: RISC-V
    std::fs::write(&foreign_machine, bytes).unwrap();
    for (file, why) in [(&text, "file too short"), (&foreign_machine, "cannot open shared object file")] {
        let outcome = hover("inprocess", &[&exec(file)]);
        assert_eq!(outcome.code(), Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "{}", outcome.stderr);
    }
    let missing = hover("inprocess", &[&exec(&folder.path().join("missing.so"))]);
    assert!(missing.stderr.contains("is not there"), "{}", missing.stderr);
}

#[test]
fn a_library_that_fails_in_flight_costs_its_process_and_is_restarted() {
    let folder = tempfile::tempdir().unwrap();
    let rounding = "it changed the rounding mode of the processor";
    for (trap, why) in [(2, ""), (6, ""), (7, rounding), (13, "`step` returned 7")] {
        if trap == 7 && !cfg!(target_arch = "x86_64") {
            continue;
        }
        let outcome = trapped(folder.path(), trap, "lockstep");
        assert_eq!(outcome.code(), Some(0), "trap {trap}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "trap {trap}: {}", outcome.stderr);
        let run = outcome.run();
        let died = |event: &&Value| event["what"] == "died" && event["node"] == "attitude-mpc";
        let deaths = run["events"].as_array().unwrap().iter().filter(died).count();
        assert_eq!(deaths, 1, "trap {trap}: the next process begins behind the sample of the trap");
        if why.is_empty() {
            continue;
        }
        let same = trapped(folder.path(), trap, "inprocess");
        assert_eq!((same.code(), same.state_hash()), (Some(0), outcome.state_hash()), "trap {trap}: {}", same.stderr);
        assert!(same.stderr.contains(why), "trap {trap}: {}", same.stderr);
    }
    let not_a_number = trapped(folder.path(), 8, "lockstep");
    assert_eq!(not_a_number.code(), Some(0), "{}", not_a_number.stderr);
    let run = not_a_number.run();
    assert!(run["refused"].to_string().contains("range"), "the mixer refuses the answer: {}", run["refused"]);
    let refused = "mixer refused 1 messages with numbers that are not finite or out of range";
    assert!(run["reservations"].to_string().contains(refused), "{}", run["reservations"]);
}

#[test]
fn a_file_that_a_library_puts_over_descriptors_of_its_process_keeps_its_mode() {
    let folder = tempfile::tempdir().unwrap();
    let library = library(folder.path(), "over", &["-DTRAP=31"]);
    let mark = folder.path().join("mark");
    std::fs::write(&mark, "").unwrap();
    std::fs::set_permissions(&mark, Permissions::from_mode(0o644)).unwrap();
    for mode in ["inprocess", "lockstep", "realtime"] {
        let env = format!("node.attitude-mpc.env={{ TREFOIL_MARK = {:?} }}", mark.display());
        let flown = hover(mode, &[&exec(&library), &env]);
        let mode_of_file = std::fs::metadata(&mark).unwrap().permissions().mode() & 0o777;
        assert_eq!(mode_of_file, 0o644, "{mode}: {}", flown.stderr);
        let is_said = flown.stderr.contains("attitude-mpc: a library has put another file over descriptor");
        assert_eq!(
            (is_said, flown.code()),
            if mode == "inprocess" { (false, Some(0)) } else { (true, Some(3)) },
            "{mode}: {}",
            flown.stderr
        );
    }
}

#[test]
fn a_library_that_hangs_ends_a_flight_in_lockstep_and_is_replaced_in_real_time() {
    let folder = tempfile::tempdir().unwrap();
    let lockstep = trapped(folder.path(), 4, "lockstep");
    assert_eq!(lockstep.code(), Some(i32::from(exit::PROCESS_LOST)), "{}", lockstep.stderr);
    let realtime = trapped(folder.path(), 4, "realtime");
    let run = realtime.run();
    let hung = |event: &&Value| event["what"] == "hung" && event["node"] == "attitude-mpc";
    assert!(run["events"].as_array().unwrap().iter().any(|event| hung(&event)), "{}", realtime.stderr);
}

#[test]
fn a_library_that_crashes_or_hangs_in_process_ends_its_flight_and_not_the_launcher() {
    let folder = tempfile::tempdir().unwrap();
    for (trap, why) in [
        (2, "its library crashed: SIGSEGV"),
        (4, "its library has not answered for 2 s, `supervision.wall_limit_s`"),
        (6, "its library ended its process with exit code 0"),
    ] {
        let outcome = trapped(folder.path(), trap, "inprocess");
        assert_eq!(outcome.code(), Some(i32::from(exit::PROCESS_LOST)), "trap {trap}: {}", outcome.stderr);
        assert!(outcome.stderr.contains(&format!("lost attitude-mpc ({why})")), "trap {trap}: {}", outcome.stderr);
        let run = outcome.run();
        assert_eq!(run["flown_s"].as_f64(), Some(0.99), "every whole sample is there: {run}");
        assert!(outcome.out.join("report.html").exists() && outcome.out.join("flight.mcap").exists());
    }
}

/// Returns whether run.json says in its events and its reservations that the attitude controller was restarted cold.
fn restarted_cold(flown: &Outcome) -> bool {
    let run = flown.run();
    let started = |event: &&Value| event["what"] == "started" && event["node"] == "attitude-mpc";
    let is_marked = run["events"].as_array().expect("events").iter().filter(started).any(|event| event["cold"] == true);
    let is_told = run["reservations"].to_string().contains("attitude-mpc restarted cold");
    assert_eq!(is_marked, is_told, "{run}");
    is_told
}

#[test]
fn a_replay_computes_the_answers_of_each_library_that_was_swapped_in() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (library(folder.path(), "first", &[]), library(folder.path(), "second", &["-O1"]));
    let swap =
        format!("swap=[{{ node='attitude-mpc', at_s=1, standby_s=0.5, watch_s=0.5, exec='{}' }}]", second.display());
    let flown = hover("inprocess", &[&exec(&first), &swap]);
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    let [first, second] = [first, second].map(|file| format!("attitude-mpc={}", file.display()));
    for (programs, words) in [
        (&["--program", &first][..], "not computed: attitude-mpc 2"),
        (&["--program", &second], "not computed: attitude-mpc 1"),
        (&["--program", &first, "--program", &second], "the same bits"),
    ] {
        let (code, said) = replay(&flown.out, programs);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains(words), "{programs:?}: {said}");
    }
}

#[test]
fn another_script_of_the_same_interpreter_is_another_program() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("law.py");
    std::fs::write(&script, "gain = 1\n").unwrap();
    let program = format!("node.attitude-mpc={{ exec='python3', args=['{}'] }}", script.display());
    let checked = |scenario: &Path, set: &[&str]| {
        let output = launcher().arg("check").arg(scenario).args(set).output().expect("the launcher runs");
        (output.status.code(), [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned()))
    };
    let settings = ["--set", "run.mode=lockstep", "--set", &program];
    let (code, [merged, said]) = checked(&top().join("scenarios/survey.toml"), &settings);
    assert_eq!(code, Some(0), "{said}");
    let kept = folder.path().join("kept.toml");
    std::fs::write(&kept, merged).unwrap();
    let (code, [_, said]) = checked(&kept, &[]);
    assert_eq!(code, Some(0), "{said}");
    std::fs::write(&script, "gain = 2\n").unwrap();
    let (code, [_, said]) = checked(&kept, &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("is another file than the settings name"), "{said}");
}

#[test]
fn a_library_that_crashes_or_ends_its_process_in_a_replay_is_no_success() {
    let folder = tempfile::tempdir().unwrap();
    let ours = hover("inprocess", &[]);
    for (trap, why) in [(2, "a library crashed: SIGSEGV"), (6, "a library ended its process with exit code 0")] {
        let library = library(folder.path(), &format!("trap{trap}"), &[&format!("-DTRAP={trap}")]);
        let (code, said) = replay(&ours.out, &["--node", "attitude-mpc", "--exec", library.to_str().unwrap()]);
        assert_eq!(code, Some(i32::from(exit::PROCESS_LOST)), "trap {trap}: {said}");
        assert!(said.contains(why), "trap {trap}: {said}");
    }
}

#[test]
fn a_library_without_a_memory_or_that_refuses_it_is_restarted_cold() {
    let folder = tempfile::tempdir().unwrap();
    let [library, refuses] =
        [("cold", "-DCOLD"), ("refuses", "-DTRAP=16")].map(|(name, flag)| library(folder.path(), name, &[flag]));
    let kill = "fault=[{at_s=1, target='attitude-mpc', kind='kill'}]";
    let flights = ["inprocess", "lockstep"].map(|mode| hover(mode, &[&exec(&library), kill, "run.duration_s=12"]));
    for flown in &flights {
        assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    for flown in &flights {
        assert!(restarted_cold(flown), "{}", flown.run());
    }
    for mode in ["inprocess", "lockstep"] {
        let refused = hover(mode, &[&exec(&refuses), kill]);
        assert!(restarted_cold(&refused), "{mode}: {}", refused.run());
    }
    let warm = hover("inprocess", &[&exec(&self::library(folder.path(), "warm", &[])), kill]);
    assert!(!restarted_cold(&warm), "{}", warm.run());
    let named = format!("attitude-mpc={}", library.display());
    let (code, said) = replay(&flights[1].out, &["--program", &named]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the same bits"), "{said}");
    let (code, said) = replay(&flights[1].out, &["--program", &named, "--from", "11s"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(!said.contains("begun with the snapshots"), "{said}");
}

/// Returns whether run.json reports copies of the attitude controller, and their number.
fn copies(flown: &Outcome) -> (bool, u64) {
    let run = flown.run();
    let is_told = run["reservations"].to_string().contains("attitude-mpc was copied");
    (is_told, run["port_failures"]["attitude-mpc"]["copy"].as_u64().unwrap_or_default())
}

#[test]
fn a_copy_that_a_library_makes_of_its_process_answers_to_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let plain = hover("inprocess", &[&exec(&library(folder.path(), "plain", &[]))]);
    for (trap, modes) in [(17, &["inprocess", "lockstep", "realtime"][..]), (30, &["lockstep", "realtime"])] {
        for mode in modes {
            let flown = trapped(folder.path(), trap, mode);
            assert_eq!(flown.code(), Some(0), "trap {trap}, {mode}: {}", flown.stderr);
            let run = flown.run();
            assert_eq!(run["refused"]["mixer"]["order"].as_u64().unwrap_or_default(), 0, "{run}");
            match *mode {
                "inprocess" => assert!(flown.stderr.contains("this is a copy that a library"), "{}", flown.stderr),
                _ => assert_eq!(copies(&flown), (true, 1), "trap {trap}, {mode}: {run}"),
            }
            if *mode != "realtime" {
                assert_eq!(flown.state_hash(), plain.state_hash(), "trap {trap}, {mode}");
            }
            let named = format!("attitude-mpc={}", folder.path().join(format!("trap{trap}.so")).display());
            let (code, said) = replay(&flown.out, &["--program", &named]);
            assert_eq!(code, Some(0), "trap {trap}, {mode}: {said}");
            assert!(said.contains("the same bits") && said.contains(&flown.state_hash()), "{said}");
        }
    }
    // The parent has ended, so the node's process has died, and the copy does not replace it.
    let (daemon, ended) = (trapped(folder.path(), 18, "lockstep"), trapped(folder.path(), 6, "lockstep"));
    assert_eq!((daemon.code(), daemon.state_hash()), (Some(0), ended.state_hash()), "{}", daemon.stderr);
    // The launcher kills the processes that a dead process leaves, so the copy may end before it has counted itself.
    assert!(
        daemon.run()["reservations"].to_string().contains("attitude-mpc failed in flight"),
        "{}",
        daemon.run()["reservations"]
    );
    let daemon = trapped(folder.path(), 18, "inprocess");
    assert_eq!(daemon.code(), Some(i32::from(exit::PROCESS_LOST)), "{}", daemon.stderr);
    assert!(daemon.stderr.contains("its library ended its process with exit code 0"), "{}", daemon.stderr);
}

#[test]
fn a_process_that_a_library_leaves_in_a_session_of_its_own_ends_with_the_flight() {
    const MARK: &str = "TREFOIL_TEST_STRAY";
    let folder = tempfile::tempdir().unwrap();
    let library = library(folder.path(), "stray", &["-DTRAP=19"]);
    let settings = ["run.duration_s=2", "mission.trajectory=hover", &exec(&library)].map(str::to_owned);
    for mode in ["inprocess", "lockstep", "realtime"] {
        let out = folder.path().join(mode);
        let mut fly = launcher();
        fly.args(["fly", "scenarios/survey.toml", "--mode", mode, "--namespace", &namespace(), "--out"]).arg(&out);
        let flown = ended(fly.args(settings.iter().flat_map(|set| ["--set", set])).env(MARK, "1"));
        assert_eq!(flown.code(), Some(0), "{mode}");
        wait_until("no process of the flight is left", || processes_with(MARK).is_empty());
    }
    let out = folder.path().join("inprocess");
    let named = format!("attitude-mpc={}", library.display());
    let replayed = ended(launcher().arg("replay").arg(out).args(["--program", &named]).env(MARK, "1"));
    assert_eq!(replayed.code(), Some(0));
    wait_until("no process of the replay is left", || processes_with(MARK).is_empty());
}

#[test]
fn a_library_that_changes_the_rounding_mode_in_another_call_than_step_is_named_with_that_call() {
    if !cfg!(target_arch = "x86_64") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let refused = trapped(folder.path(), 26, "inprocess");
    assert_eq!(refused.code(), Some(i32::from(exit::USAGE)), "{}", refused.stderr);
    assert!(refused.stderr.contains("(was it built with -ffast-math?) in `destroy`"), "{}", refused.stderr);

    let snapshot = trapped(folder.path(), 24, "lockstep");
    assert_eq!(snapshot.code(), Some(0), "it is restarted: {}", snapshot.stderr);
    assert!(snapshot.stderr.contains("in `snapshot`"), "{}", snapshot.stderr);

    let restores = library(folder.path(), "restores", &["-DTRAP=25"]);
    let kill = "fault=[{at_s=1, target='attitude-mpc', kind='kill'}]";
    for mode in ["inprocess", "lockstep"] {
        let restored = hover(mode, &[&exec(&restores), kill, "supervision.restart_ms=[0.0]"]);
        assert_eq!(restored.code(), Some(i32::from(exit::PROCESS_LOST)), "{mode}: {}", restored.stderr);
        assert!(restored.stderr.contains("in `restore`"), "{mode}: {}", restored.stderr);
    }
}

#[test]
fn numbers_that_stay_not_finite_end_with_their_process_and_its_memory() {
    let folder = tempfile::tempdir().unwrap();
    let flights = ["inprocess", "lockstep"].map(|mode| trapped(folder.path(), 27, mode));
    for flown in &flights {
        assert!(flown.stderr.contains("the last 50 answers had numbers that are not finite"), "{}", flown.stderr);
        assert!(restarted_cold(flown), "{}", flown.run());
        assert!(flown.metric("fallback_s") < 1.0, "{}", flown.metric("fallback_s"));
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    let named = format!("attitude-mpc={}", folder.path().join("trap27.so").display());
    let (_, said) = replay(&flights[1].out, &["--program", &named]);
    assert!(said.contains("the same bits"), "{said}");

    let library = library(folder.path(), "killed", &["-DTRAP=27"]);
    let kill = "fault=[{at_s=1.2, target='attitude-mpc', kind='kill'}]";
    for mode in ["inprocess", "lockstep"] {
        let killed = hover(mode, &[&exec(&library), kill, "supervision.restart_ms=[0.0]"]);
        assert!(restarted_cold(&killed), "a kill before that: {}", killed.run());
        assert!(!killed.stderr.contains("the last 50 answers"), "{mode}: {}", killed.stderr);
    }
}

#[test]
fn a_replay_says_its_verdict_whatever_a_library_does_to_variables_and_stdout() {
    let folder = tempfile::tempdir().unwrap();
    for trap in [28, 29] {
        let flown = trapped(folder.path(), trap, "inprocess");
        assert_eq!(flown.code(), Some(0), "trap {trap}: {}", flown.stderr);
        let named = format!("attitude-mpc={}", folder.path().join(format!("trap{trap}.so")).display());
        let (code, said) = replay(&flown.out, &["--program", &named]);
        assert_eq!(code, Some(0), "trap {trap}: {said}");
        assert!(said.contains("the same bits"), "trap {trap}: {said}");
    }
}

#[test]
fn a_library_whose_file_is_cut_short_is_refused_by_that_name() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(library(folder.path(), "whole", &[])).unwrap();
    let cut = folder.path().join("cut.so");
    std::fs::write(&cut, &whole[..12_000]).unwrap();
    let refused = hover("inprocess", &[&exec(&cut)]);
    assert_eq!(refused.code(), Some(i32::from(exit::USAGE)), "{}", refused.stderr);
    assert!(refused.stderr.contains("its file is cut short: it has 12000 byte"), "{}", refused.stderr);
}

#[test]
fn a_program_that_never_joins_is_named_in_the_last_line() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("never");
    write_script(&program, "#!/bin/sh\nexec sleep 600\n");
    let outcome = hover("lockstep", &[&exec(&program)]);
    assert_eq!(outcome.code(), Some(i32::from(exit::PROCESS_LOST)), "{}", outcome.stderr);
    let last = outcome.stderr.lines().last().unwrap_or_default();
    assert!(last.contains(&format!("`{}` of attitude-mpc has not joined the run", program.display())), "{last}");
}

/// Mass and moments of inertia in the order of the demand, for the functions of these tests.
const P: &str = "node.attitude-mpc.settings.p=[1.1, 0.01271, 0.0239, 0.01273]";

/// Checks that a library flies as `node` in `scenario`, is continued after a kill, and is replayed, with the same bits
/// in every mode.
pub fn flies_in_every_mode(scenario: &str, node: &str, library: &Path, settings: &[&str]) {
    let kill = format!("fault=[{{at_s=1, target='{node}', kind='kill'}}]");
    let own = format!("node.{node}.exec={}", library.display());
    let settings = [&["run.duration_s=4", &own as &str], settings].concat();
    let flights = ["inprocess", "lockstep"].map(|mode| flown(scenario, mode, &[&settings[..], &[&kill]].concat()));
    for flight in &flights {
        assert_eq!(flight.code(), Some(0), "{}", flight.stderr);
    }
    assert_eq!(flights[0].state_hash(), flights[1].state_hash());
    let flight = flown(scenario, "realtime", &[&settings[..], &[PATIENT]].concat());
    assert_eq!(flight.code(), Some(0), "{}", flight.stderr);
    let (code, said) = replay(&flight.out, &["--program", &format!("{node}={}", library.display())]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("the same bits") && said.contains(&flight.state_hash()), "{said}");
}

/// Checks that a CasADi function with the parameters [`P`] flies in every mode.
fn hovers_in_every_mode(function: &Path) {
    flies_in_every_mode("scenarios/survey.toml", "attitude-mpc", function, &["mission.trajectory=hover", P]);
}

#[test]
fn a_function_in_the_form_of_casadi_is_found_by_its_names() {
    let folder = tempfile::tempdir().unwrap();
    let source = top().join("tests/controllers/function.c");
    let function = |trap: u32| compiled(&source, folder.path(), &format!("law{trap}"), &[&format!("-DTRAP={trap}")]);
    hovers_in_every_mode(&function(0));
    let [standing, lying, in_full] = [0, 15, 16].map(|trap| hover("inprocess", &[&exec(&function(trap)), P]));
    assert_eq!((lying.code(), lying.state_hash()), (Some(0), standing.state_hash()), "{}", lying.stderr);
    assert_eq!((in_full.code(), in_full.state_hash()), (Some(0), standing.state_hash()), "{}", in_full.stderr);
    for (trap, why) in [
        (1, "no input of attitude-mpc is called `speed`; there are time, position, velocity, attitude, rates"),
        (2, "input `attitude` of `law` is sparse"),
        (3, "input `attitude_ref` of `law` is 2 x 1, not 3 x 1"),
        (4, "`law_casadi_int_size` is not 8"),
        (5, "input `z` and output `z_next` go together, and are 4 x 1 and 0 x 0"),
        (7, "`law_n_in` says that there are -1"),
        (8, "`law_n_out` says that there are -1"),
        (9, "input `attitude` of `law` is -3 x -1, which is no shape"),
        (10, "input `preview` of `law` is 8 x 4, not 4 x 8"),
        (11, "output `demand` of `law` is 2 x 2, not 4 x 1"),
        (12, "input `z` and output `z_next` go together, and are 2 x 2 and 4 x 1"),
        (13, "input `attitude` of `law` is there twice"),
        (14, "input `attitude` of `law` has a pattern that is none of CasADi's"),
    ] {
        let refused = hover("inprocess", &[&exec(&function(trap)), P]);
        assert_eq!(refused.code(), Some(2), "trap {trap}: {}", refused.stderr);
        assert!(refused.stderr.contains(why), "trap {trap}: {}", refused.stderr);
    }
    let failed = hover("inprocess", &[&exec(&function(6)), P, "supervision.restart_ms=[0.0]"]);
    assert_eq!(failed.code(), Some(0), "{}", failed.stderr);
    assert!(failed.stderr.contains("tick 100") && failed.stderr.contains("returned 3"), "{}", failed.stderr);
    for (settings, why) in [
        (&[][..], "input `p` has 4 numbers, and `settings.p` has 0"),
        (&[P, "node.attitude-mpc.settings.q=1"], "`settings.q` has no effect on a CasADi function"),
    ] {
        let function = exec(&function(0));
        let refused = hover("inprocess", &[&[&function as &str], settings].concat());
        assert!(refused.stderr.contains(why), "{}", refused.stderr);
    }
}

#[test]
fn a_function_is_found_beside_one_whose_name_ends_in_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let source = top().join("tests/controllers/function.c");
    let alone = hover("inprocess", &[&exec(&compiled(&source, folder.path(), "alone", &[])), P]);
    let both = compiled(&source, folder.path(), "both", &["-DJACOBIAN", "-Wl,-O1", "-s"]);
    let bytes = std::fs::read(&both).unwrap();
    let has = |text: &[u8]| bytes.windows(text.len()).any(|window| window == text);
    assert!(has(b"jac_law_n_in\0") && !has(b"\0law_n_in\0"), "one name is kept as the tail of the other");
    let named =
        |name: &str| hover("inprocess", &[&exec(&both), P, &format!("node.attitude-mpc.settings.function={name}")]);
    let law = named("law");
    assert_eq!((law.code(), law.state_hash()), (Some(0), alone.state_hash()), "{}", law.stderr);
    for (refused, why) in [
        (hover("inprocess", &[&exec(&both), P]), r#"give `settings.function` one of ["jac_law", "law"]"#),
        (named("aw"), r#"it has no CasADi function `aw`, but ["jac_law", "law"]"#),
    ] {
        assert_eq!(refused.code(), Some(2), "{}", refused.stderr);
        assert!(refused.stderr.contains(why), "{}", refused.stderr);
    }
}

/// Compiles `tests/controllers/sharing.c` into the new folder `name`, beside a `libdep.so.0` of its own with this gain.
pub fn with_dependency(folder: &Path, name: &str, gain: &str) -> PathBuf {
    let source = top().join("tests/controllers/sharing.c");
    let folder = folder.join(name);
    std::fs::create_dir(&folder).expect("a new folder");
    let dependency = compiled(&source, &folder, "libdep", &[&format!("-DGAIN={gain}"), "-Wl,-soname,libdep.so.0"]);
    std::fs::rename(dependency, folder.join("libdep.so.0")).expect("can be renamed");
    compiled(&source, &folder, name, &[&needs_dependency(&folder)[..], &["-Wl,-rpath,$ORIGIN"]].concat())
}

/// Flags for a library or program that needs the `libdep.so.0` in `folder`.
pub fn needs_dependency(folder: &Path) -> [&'static str; 3] {
    ["-Wl,--no-as-needed", format!("-L{}", folder.display()).leak(), "-l:libdep.so.0"]
}

#[test]
fn libraries_with_dependencies_of_one_name_fly_in_processes_of_their_own_only() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] =
        [("one", "1.0"), ("other", "0.8")].map(|(name, gain)| with_dependency(folder.path(), name, gain));
    let too = one.with_file_name("too.so");
    std::fs::copy(&one, &too).unwrap();
    let [by_one, by_other, by_too] = [&one, &other, &too]
        .map(|file| ["guidance", "attitude-mpc"].map(|node| format!("node.{node}.exec={}", file.display())));
    let second = "run.duration_s=1";
    let refused = |said: &str| {
        let files = ["one", "other"].map(|name| folder.path().join(name).join("libdep.so.0").display().to_string());
        let words =
            ["it needs `libdep.so.0`", &files[0], &files[1], "lockstep", "link both with one file of that name"];
        for words in words {
            assert!(said.contains(words), "should say {words:?}: {said}");
        }
    };
    let mixed = [&by_one[0] as &str, &by_other[1], second];
    let in_process = hover("inprocess", &mixed);
    assert_eq!(in_process.code(), Some(2), "{}", in_process.stderr);
    refused(&in_process.stderr);
    let lockstep = hover("lockstep", &mixed);
    assert_eq!(lockstep.code(), Some(0), "{}", lockstep.stderr);
    for settings in
        [&[&by_one[0] as &str, &by_too[1], second][..], &[&by_one[0], &by_one[1], second], &[&by_other[1], second]]
    {
        let [in_process, lockstep] = ["inprocess", "lockstep"].map(|mode| hover(mode, settings));
        assert_eq!((in_process.code(), lockstep.code()), (Some(0), Some(0)), "{}", in_process.stderr);
        assert_eq!(in_process.state_hash(), lockstep.state_hash(), "one file for both");
    }

    let swap =
        format!("swap=[{{ node='attitude-mpc', at_s=0.5, standby_s=0.1, watch_s=0.1, exec='{}' }}]", other.display());
    let swapped = hover("inprocess", &[&by_one[1], &swap, second]);
    assert_eq!(swapped.code(), Some(2), "{}", swapped.stderr);
    refused(&swapped.stderr);

    let named = [("guidance", &one), ("attitude-mpc", &other)].map(|(node, file)| format!("{node}={}", file.display()));
    let (code, said) = replay(&lockstep.out, &["--program", &named[0], "--program", &named[1]]);
    assert_ne!(code, Some(0), "{said}");
    refused(&said);
    for program in &named {
        let (code, said) = replay(&lockstep.out, &["--program", program]);
        assert_eq!(code, Some(0), "{said}");
        assert!(said.contains("no difference in what was compared"), "{said}");
    }
}

#[test]
fn an_mpc_of_casadi_flies_as_it_was_generated() {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = python_with(&["casadi==3.8.2"]) else { return };
    let source = folder.path().join("mpc.c");
    let generated = Command::new(python).arg(top().join("tests/python/casadi_mpc.py")).arg(&source).output().unwrap();
    assert!(generated.status.success(), "{}", String::from_utf8_lossy(&generated.stderr));
    let function = compiled(&source, folder.path(), "mpc", &["-Wno-unused-parameter", "-Wno-unused-function"]);
    hovers_in_every_mode(&function);
}

#[test]
fn a_law_of_casadi_is_found_beside_its_jacobian_and_its_matrix_has_one_shape() {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = python_with(&["casadi==3.8.2"]) else { return };
    let script = top().join("tests/python/casadi_jacobian.py");
    let law = |name: &str, shape: [&str; 2]| {
        let source = folder.path().join(name).with_extension("c");
        let generated = Command::new(&python).arg(&script).arg(&source).args(shape).output().unwrap();
        assert!(generated.status.success(), "{}", String::from_utf8_lossy(&generated.stderr));
        compiled(&source, folder.path(), name, &["-Wno-unused-parameter", "-Wno-unused-function"])
    };
    let fly = |library: &Path| {
        hover("inprocess", &[&exec(library), P, "node.attitude-mpc.settings.function=law", "guidance.preview_s=0.2"])
    };
    let flown = fly(&law("law", ["4", "8"]));
    assert_eq!(flown.code(), Some(0), "{}", flown.stderr);
    let turned = fly(&law("turned", ["8", "4"]));
    assert_eq!(turned.code(), Some(2), "{}", turned.stderr);
    assert!(turned.stderr.contains("input `preview` of `law` is 8 x 4, not 4 x 8"), "{}", turned.stderr);
}

#[test]
fn settings_of_programs_without_effect_are_refused() {
    for (settings, why) in [
        (&["node.mixer.args=['x']"][..], "`node.mixer.args` has no effect here"),
        (&["node.mixer.exec=my.so", "node.mixer.args=['x']"], "`node.mixer.args` has no effect here"),
        (&["node.mixer.exec=my-program"], "in process there is none"),
        (&["node.mixr.exec=my.so"], "did you mean `node.mixer`?"),
        (&["node.mixer.exec=3"], "`node.mixer.exec`"),
    ] {
        let outcome = hover("inprocess", settings);
        assert_eq!(outcome.code(), Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(why), "{settings:?}: {}", outcome.stderr);
    }
}
