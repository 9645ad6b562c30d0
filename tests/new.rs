//! `trefoil new`: the controller of every language is built, tested and flown as it is written, with the error that
//! docs/results/controllers.md has.

use std::path::Path;
use std::process::{Command, Output};

use crate::controllers::{compiled, flies_in_every_mode, swapped_in_and_out};
use crate::harness::{fly, launcher, python_with, skip, top};
use crate::libtrefoil::{flies_as_a_program, python_with_trefoil};

/// Runs `trefoil new DIR` with `arguments`.
fn new(dir: &Path, arguments: &[&str]) -> Output {
    launcher().arg("new").arg(dir).args(arguments).output().expect("the launcher runs")
}

/// Makes the `goals` of the controller in `dir`, with this Python if it needs one.
fn made(dir: &Path, goals: &[&str], python: Option<&Path>) {
    let mut make = Command::new("make");
    make.arg("-C").arg(dir).args(goals).env_remove("MAKEFLAGS");
    make.args(python.map(|python| format!("PYTHON={}", python.display())));
    let output = make.output().expect("make runs");
    let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    assert!(output.status.success() && !said.contains("warning: "), "{said}");
}

/// Writes the template of `lang` for `node`, builds and tests it, and flies it in every mode and in swaps. `settings`
/// are the node's settings in the template's scenario, which another `exec` does not have. Returns a temporary folder,
/// in which `mine` has the template.
fn flies(lang: &str, node: &str, settings: &[&str], python: Option<&Path>) -> Option<tempfile::TempDir> {
    if Command::new("make").arg("--version").output().is_err() {
        skip("make is not here");
        return None;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let dir = folder.path().join("mine");
    let written = new(&dir, &["--lang", lang, "--node", node]);
    let said = String::from_utf8_lossy(&written.stdout);
    let last = said.lines().last().unwrap_or_default();
    let scenario = dir.join("scenario.toml");
    assert!(last.starts_with("make -C ") && last.ends_with(&format!(" fly {}", scenario.display())), "{said}");
    made(&dir, &["all", "test"], python);
    let library = dir.join("controller.so");
    let scenario = scenario.to_str().expect("plain names");
    let whole = fly(&[scenario, "--mode", "inprocess"]);
    assert_eq!(whole.code(), Some(0), "{}", whole.stderr);
    let of = if node == "attitude-mpc" { lang.to_owned() } else { format!("{lang} --node {node}") };
    let error_m = whole.run()["metrics"]["max_position_error_m"].as_f64().expect("a number");
    let row = format!("\n{of}:   position error        {error_m:.4} m max");
    let page = std::fs::read_to_string(top().join("docs/results/controllers.md")).expect("a page");
    assert!(page.contains(&row), "docs/results/controllers.md does not have:{row}");
    flies_in_every_mode(scenario, node, &library, settings);
    swapped_in_and_out(scenario, node, &library, settings, ["lockstep", "inprocess"]);
    Some(folder)
}

#[test]
fn an_lqr_in_c_is_written_and_flies() {
    flies("c", "attitude-mpc", &[], None);
}

#[test]
fn a_guidance_in_c_is_written_and_flies() {
    let course = "node.guidance.settings={ leg_s=5.0, waypoints_m=[[0, 0, 0], [0, 0, -4], [4, 0, -4], [4, 4, -4]] }";
    flies("c", "guidance", &[course], None);
}

#[test]
fn a_mixer_in_c_is_written_and_flies() {
    flies("c", "mixer", &[], None);
}

#[test]
fn an_lqr_in_cpp_is_written_and_flies() {
    flies("cpp", "attitude-mpc", &[], None);
}

#[test]
fn code_of_simulink_is_written_and_flies() {
    flies("simulink", "attitude-mpc", &[], None);
}

#[test]
fn an_lqr_in_rust_is_written_and_flies() {
    flies("rust", "attitude-mpc", &[], None);
}

#[test]
fn an_mpc_of_casadi_is_written_and_flies() {
    let Some(python) = python_with(&["casadi==3.8.2"]) else { return };
    flies("casadi", "attitude-mpc", &[], Some(&python));
}

#[test]
fn an_mpc_of_acados_is_written_and_flies() {
    if !cfg!(target_arch = "x86_64") {
        return skip("acados is on PyPI for x86_64 with AVX2");
    }
    let packages = ["comma-deps-acados==0.2.2.post92", "casadi==3.8.2", "numpy"];
    let Some(python) = python_with(&packages) else { return };
    let Some(folder) = flies("acados", "attitude-mpc", &[], Some(&python)) else { return };
    let scenario = folder.path().join("mine/scenario.toml");
    let fly = |settings: &str| {
        let settings = format!("node.attitude-mpc.settings={settings}");
        fly(&[scenario.to_str().expect("plain names"), "--mode", "inprocess", "--set", &settings])
    };
    let of_generate = "{ weights=[1e2, 1e3, 1e3, 1e3, 1e1, 1e1, 1e1, 2e2, 2e2, 2e2, 1e2] }";
    assert_eq!(fly(of_generate).state_hash(), fly("{}").state_hash());
    assert_ne!(fly(&of_generate.replace("1e3", "5e2")).state_hash(), fly("{}").state_hash());
    for wrong in ["{ weights=[1e2, 1e3] }", &of_generate.replace("weights", "w"), &of_generate.replace("2e2", "-2e2")] {
        let refused = fly(wrong);
        assert_eq!(refused.code(), Some(2), "{}", refused.stderr);
        assert!(refused.stderr.contains("give settings.weights: 11 positive numbers"), "{}", refused.stderr);
    }
}

#[test]
fn an_lqr_in_python_is_written_and_flies() {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = python_with_trefoil(&[], folder.path()) else { return };
    let dir = folder.path().join("mine");
    assert_eq!(new(&dir, &["--lang", "python"]).status.code(), Some(0));
    made(&dir, &["test"], Some(&python));
    let scenario = dir.join("scenario.toml");
    let (scenario, script) = (scenario.to_str().unwrap(), dir.join("controller.py"));
    flies_as_a_program(scenario, &python, &script, &[]);
    let script = format!("node.attitude-mpc.args=['{}']", script.display());
    swapped_in_and_out(scenario, "attitude-mpc", &python, &[&script], ["lockstep", "lockstep"]);
}

#[test]
fn an_mpc_of_do_mpc_flies() {
    let folder = tempfile::tempdir().unwrap();
    let Some(python) = python_with_trefoil(&["do-mpc==5.1.0", "casadi==3.7.2", "sympy"], folder.path()) else { return };
    let script = top().join("tests/controllers/do_mpc_node.py");
    flies_as_a_program("scenarios/survey.toml", &python, &script, &["mission.trajectory=hover"]);
}

#[test]
fn a_geometric_controller_in_cpp_flies() {
    let folder = tempfile::tempdir().unwrap();
    let library = compiled(&top().join("tests/controllers/geometric.cpp"), folder.path(), "geometric", &[]);
    let bounds = ["bounds.max_position_error_m=0.3"];
    flies_in_every_mode("scenarios/survey.toml", "attitude-mpc", &library, &bounds);
    swapped_in_and_out("scenarios/survey.toml", "attitude-mpc", &library, &bounds, ["lockstep", "inprocess"]);
}

#[test]
fn a_folder_in_use_and_a_pair_without_a_template_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mine = folder.path().join("it's mine");
    for (dir, arguments, why) in [
        (
            &mine,
            &["--lang", "rust", "--node", "mixer"][..],
            "there is no mixer in rust; there are: attitude-mpc in c, guidance in c, mixer in c",
        ),
        (&mine, &["--lang", "ada"], "[possible values: c, cpp, casadi, acados, simulink, python, rust]"),
        (&mine, &[], "--lang <LANG>"),
        (&folder.path().to_owned(), &["--lang", "c"], "is not empty"),
    ] {
        std::fs::write(folder.path().join("other"), "").unwrap();
        let output = new(dir, arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(why), "{said}");
    }
    let written = new(&mine, &["--lang", "c"]);
    let said = String::from_utf8_lossy(&written.stdout);
    assert!(said.ends_with("it'\\''s mine/scenario.toml'\n"), "a path is one word of the shell: {said}");
    assert_eq!(new(&mine, &["--lang", "c"]).status.code(), Some(2), "it is not empty any more");
}
