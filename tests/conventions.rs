//! Conventions of the command line: schemas, completions, manual pages, shipped files by name, lists, colours.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::harness::{fly, launcher, python_with, top};

fn run(command: &mut Command) -> Output {
    command.output().expect("the launcher runs")
}

/// Runs the launcher, which must succeed; returns its output.
fn printed(arguments: &[&str]) -> String {
    let output = run(launcher().args(arguments));
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Lists the TOML files in a folder of the repository, and in the folders in it.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path());
    let inside = |path: PathBuf| if path.is_dir() { files_in(&path) } else { vec![path] };
    entries.flat_map(inside).filter(|path| path.extension().is_some_and(|ending| ending == "toml")).collect()
}

/// Validates files by Python's `jsonschema`; returns one line for each error.
fn errors(python: &Path, schema: &str, files: &[PathBuf]) -> String {
    let mut command = Command::new(python);
    command
        .arg(top().join("tests/python/validate.py"))
        .arg(top().join(format!("docs/schema/{schema}.json")))
        .args(files);
    let output = command.output().expect("Python runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

#[test]
fn every_shipped_file_and_every_record_fits_its_schema_and_an_unknown_key_does_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let Some(python) = python_with(&["jsonschema==4.26.0"]) else { return };
    let mut scenarios = files_in(&top().join("scenarios"));
    for language in ["c", "python"] {
        let dir = folder.path().join(language);
        printed(&["new", dir.to_str().expect("a plain path"), "--lang", language]);
        scenarios.push(dir.join("scenario.toml"));
        assert!(
            std::fs::read_to_string(dir.join("scenario.toml")).unwrap().starts_with("#:schema scenario.schema.json\n")
        );
        let beside = std::fs::read_to_string(dir.join("scenario.schema.json")).expect("the schema");
        assert_eq!(beside, printed(&["schema", "scenario"]));
    }
    let flown = fly(&["faults/swap-law", "--mode", "inprocess", "--set", "run.duration_s=30.0"]);
    scenarios.push(flown.out.join("scenario.toml")); // it has every setting
    assert!(scenarios.len() > 25);
    assert_eq!(errors(&python, "scenario", &scenarios), "");
    assert_eq!(errors(&python, "campaign", &files_in(&top().join("campaigns"))), "");
    assert_eq!(errors(&python, "run", &[flown.out.join("run.json")]), "");
    for (schema, text) in [
        ("scenario", "[plant]\nrotor_lag = 0.03"),
        ("scenario", "run.rate_hz = 10"),
        ("scenario", "attitude.law = 'lqg'"),
        ("scenario", "attitude.mpc.r = [1.0, 1.0]"),
        ("campaign", "[settings]\nrun.duration = 3.0"),
        ("campaign", "[case.step]\nscenari = 'step.toml'"),
        ("campaign", "[vary]\nattitude.mpc.max_iterations = { uniform = [1.0] }"),
        ("campaign", "[[promise]]\nmetric = 'max_position_error_m'"),
    ] {
        let path = folder.path().join("wrong.toml");
        std::fs::write(&path, text).expect("can be written");
        assert_ne!(errors(&python, schema, &[path]), "", "{text}");
    }
}

#[test]
fn a_shipped_scenario_flies_by_its_name_in_any_folder_and_a_file_of_that_name_wins() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let check = |name: &str| run(launcher().current_dir(folder.path()).args(["check", name]));
    let said = |name: &str| {
        let shipped = check(name);
        let said = String::from_utf8_lossy(&shipped.stderr).into_owned();
        assert_eq!(shipped.status.code(), Some(0), "{said}");
        said
    };
    let note = "note: no file `scenarios/wind.toml`; scenarios/wind.toml is part of the launcher";
    assert!(said("scenarios/wind.toml").contains(note), "a path may have been meant for a file");
    assert!(!said("wind").contains("note: no file"), "a name is that of the scenario");
    std::fs::create_dir(folder.path().join("wind")).expect("can be made");
    said("wind"); // a folder cannot be flown, so that it hides nothing
    std::fs::remove_dir(folder.path().join("wind")).expect("can be removed");
    std::fs::write(folder.path().join("wind"), "name = \"mine\"").expect("can be written");
    let own = check("wind");
    assert!(String::from_utf8_lossy(&own.stdout).contains("name = \"mine\"") && !own.stderr.contains(&b'`'));
    let plan = run(launcher().current_dir(folder.path()).args(["campaign", "aggressive", "--plan"]));
    assert_eq!(plan.status.code(), Some(0), "{}", String::from_utf8_lossy(&plan.stderr));
    let unknown = run(launcher().current_dir(folder.path()).args(["fly", "surwey"]));
    assert_eq!(unknown.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("did you mean `survey`"));
    let campaign = folder.path().join("mine.toml");
    std::fs::write(&campaign, "seeds = 2\n[controller.pid]\nattitude.law = 'pid'\n").expect("can be written");
    for (arguments, said) in [
        (&["fly", "mine.toml"][..], "`trefoil campaign mine.toml` flies it"),
        (&["campaign", "lows"], "did you mean `laws`?"),
        (&["scenarios", "survy"], "did you mean `survey`?"),
        (&["new", "mine.toml", "--lang", "c"], "mine.toml is a file"),
        (&["tune", "mine.toml"], "\n[tune]\nseed = 101"),
        (&["stop", "mine"], "`trefoil stop --namespace mine`"),
        (&["inject", "controls", "drop", "--for", "500", "ms"], "a time is one word: 500ms"),
        (&["inject", "controls", "drop", "--for", "500"], "'500' has no unit: say 500s or 500ms"),
        (&["report", "runs/x", "--from", "5"], "'5' has no unit: say 5s or 5ms"),
    ] {
        let output = run(launcher().current_dir(folder.path()).args(arguments));
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {stderr}");
        assert!(stderr.contains(said), "{arguments:?} should say {said}: {stderr}");
    }
}

#[test]
fn shipped_files_are_listed_and_printed() {
    let list = printed(&["scenarios"]);
    for part in ["Scenarios:\n", "  survey ", "The default run", "  faults/swap-law ", "Campaigns:\n", "  fifty-seeds "]
    {
        assert!(list.contains(part), "{part}: {list}");
    }
    let text = printed(&["scenarios", "aggressive/step"]);
    let file = std::fs::read_to_string(top().join("scenarios/aggressive/step.toml")).expect("the scenario");
    assert_eq!(file.split_once('\n').map(|(_, rest)| rest), Some(text.as_str()), "without the line of the schema");
    assert_eq!(run(launcher().args(["scenarios", "nothing"])).status.code(), Some(2));
}

#[test]
fn the_flights_of_a_folder_are_listed() {
    let flown = fly(&["circle", "--mode", "inprocess", "--no-log"]);
    let runs = flown.out.parent().expect("a folder");
    std::fs::create_dir(runs.join("torn")).expect("can be made");
    std::fs::write(runs.join("torn/flight.mcap"), "").expect("can be written");
    std::fs::create_dir(runs.join("other")).expect("can be made");
    let list = printed(&["runs", runs.to_str().expect("a plain path")]);
    let hash = flown.state_hash();
    for part in [": 2\n", "circle", "inprocess", &hash[..12], "incomplete: there is no run.json"] {
        assert!(list.contains(part), "{part}: {list}");
    }
    assert!(!list.contains("other"), "{list}");
    assert_eq!(run(launcher().args(["runs", "no/such/folder"])).status.code(), Some(2));
}

#[test]
fn completions_and_manual_pages_name_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let text = printed(&["completions", shell]);
        assert!(["campaign", "--namespace", "realtime"].iter().all(|word| text.contains(word)), "{shell}");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    printed(&["man", folder.path().join("man1").to_str().expect("a plain path")]);
    for page in ["trefoil.1", "trefoil-fly.1", "trefoil-measure-timing.1"] {
        let text = std::fs::read_to_string(folder.path().join("man1").join(page)).expect("a page");
        assert!(text.contains(".TH") && (page == "trefoil.1" || text.contains("Examples:")), "{text}");
    }
}

#[test]
fn diagnostics_have_colours_only_where_they_are_wanted() {
    let refused = |variable: &str, value: &str| {
        let mut command = launcher();
        for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
            command.env_remove(name);
        }
        let output = run(command.env(variable, value).args(["fly", "--set", "attitude.mpc.npp=3"]));
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).expect("UTF-8")
    };
    let plain = refused("TERM", "xterm");
    assert!(plain.starts_with("error: unknown key `attitude.mpc.npp`") && !plain.contains('\x1b'), "a pipe: {plain}");
    let forced = refused("CLICOLOR_FORCE", "1");
    assert!(forced.starts_with("\x1b[1;31merror:\x1b[0m unknown key"), "{forced}");
    assert_eq!(forced.replace("\x1b[1;31m", "").replace("\x1b[1;32m", "").replace("\x1b[0m", ""), plain);
}
