//! The pages in a headless browser, narrow and wide, light and dark: no text clipped, no number or word broken, no
//! labels over each other, no violation of axe-core's rules. `tests/pages/` holds the scripts, which need npm and
//! Chromium.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::harness::{Outcome, fly, launcher, skip, top};

/// Files of the scripts, with the lock file of their packages.
const SCRIPTS: [&str; 8] = [
    "package.json",
    "package-lock.json",
    "harness.mjs",
    "in-page.mjs",
    "look.mjs",
    "live.mjs",
    "replay.mjs",
    "campaign.mjs",
];

/// Returns a folder with the scripts of `tests/pages/` and their packages, installed once for all tests; `None`, and a
/// note, if that fails.
pub fn browser() -> Option<&'static Path> {
    static MADE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let made = MADE.get_or_init(install);
    made.as_ref().map_err(|why| skip(why)).ok().map(PathBuf::as_path)
}

fn install() -> Result<PathBuf, String> {
    let chromium = std::env::var("CHROMIUM").unwrap_or("/usr/bin/chromium".into());
    if !Path::new(&chromium).exists() {
        return Err(format!("no browser: {chromium} does not exist (apt-get install chromium, or set CHROMIUM)"));
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pages");
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for script in SCRIPTS {
        let copied = std::fs::copy(top().join("tests/pages").join(script), folder.join(script));
        copied.map_err(|error| format!("{script}: {error}"))?;
    }
    let install = ["ci", "--no-audit", "--no-fund", "--prefer-offline"];
    match Command::new("npm").args(install).current_dir(&folder).output() {
        Ok(done) if done.status.success() => Ok(folder),
        Ok(failed) => Err(format!("npm cannot install the packages: {}", String::from_utf8_lossy(&failed.stderr))),
        Err(error) => Err(format!("npm does not start: {error}")),
    }
}

/// Checks `pages`, files or addresses, and panics with the faults found; skips without a browser.
pub fn look_at(pages: &[&Path]) {
    let Some(scripts) = browser() else { return };
    let output = Command::new("node").arg(scripts.join("look.mjs")).args(pages).output().expect("node starts");
    let [told, failed] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(output.status.success(), "{pages:?}:\n{told}{failed}");
}

/// Page with one fault of every kind that is looked for.
const FAULTY: &str = "<!doctype html><html><title>x</title><body style=\"width:600px\"><main><h1>x</h1>
    <p style=\"width:30px;overflow-wrap:anywhere\">123456789</p>
    <p style=\"width:40px;overflow:hidden;white-space:nowrap\">much longer than that</p>
    <svg width=\"300\" height=\"40\"><text x=\"5\" y=\"20\">died</text><text x=\"15\" y=\"22\">started</text></svg>
    <p style=\"color:#eee;background:#fff\">pale</p>
    <canvas id=\"c\" width=\"90\" height=\"20\" role=\"img\" aria-label=\"c\"></canvas>
    <script>document.getElementById('c').getContext('2d').fillText('beyond the edge', 60, 15); nothing();</script></main>";

#[test]
fn the_faults_that_are_looked_for_are_found() {
    let Some(scripts) = browser() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let page = folder.path().join("faulty.html");
    std::fs::write(&page, FAULTY).expect("written");
    let output = Command::new("node").arg(scripts.join("look.mjs")).arg(&page).output().expect("node starts");
    let told = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{told}");
    for fault in [
        "390 px light: the page is 6",
        "1440 px dark: broken over",
        "clipped: \"much longer than that\"",
        "labels overlap: \"died\" and \"started\"",
        "clipped in a plot: \"beyond the edge\"",
        "error in a script: nothing is not defined",
        "axe color-contrast",
        "axe html-has-lang",
    ] {
        assert!(told.contains(fault), "{fault}: {told}");
    }
}

/// Settings of a flight with as many events as a page must show.
const BUSY: &str = r#"
name = "busy"
[run]
duration_s = 16.0
[plant]
drag_linear_nspm = [0.2, 0.2, 0.1]
wind_ned_mps = [[2.0, [3.0, 1.0, 0.0]]]
noise = { position_m = 0.02, velocity_mps = 0.05, attitude_deg = 0.5, rates_dps = 2.0 }
[guidance]
disturbance_observer_radps = 5.0
[bounds]
max_position_error_m = 30.0
[[fault]]
at_s = 3.0
target = "mixer"
kind = "kill"
[[fault]]
at_s = 4.0
for_s = 1.0
target = "controls"
kind = "drop"
probability = 0.3
[[fault]]
at_s = 5.0
for_s = 2.0
target = "wind"
kind = "gust"
vector = [3.0, 0.0, 0.0]
[[fault]]
at_s = 8.0
target = "guidance"
kind = "kill"
[[fault]]
at_s = 8.2
target = "attitude-mpc"
kind = "kill"
[[fault]]
at_s = 12.0
for_s = 0.4
target = "controls"
kind = "drop"
probability = 1.0
[[swap]]
at_s = 9.0
node = "mixer"
"#;

/// Runs the launcher, which must succeed.
fn run(arguments: &[&str], files: &[&Path]) {
    let output = launcher().args(arguments).args(files).output().expect("the launcher starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn busy(more: &[&str]) -> Outcome {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("busy.toml");
    std::fs::write(&file, BUSY).expect("written");
    fly(&[&[file.to_str().expect("a plain path"), "--mode", "lockstep"], more].concat())
}

#[test]
fn the_report_of_a_quiet_and_of_a_busy_flight_can_be_read() {
    if browser().is_none() {
        return;
    }
    let quiet = fly(&["scenarios/survey-paper.toml", "--mode", "inprocess"]);
    let real = fly(&["--set", "run.duration_s=3.0"]);
    let landed = fly(&["take-off-and-land", "--mode", "inprocess"]); // it has phases
    look_at(
        &[&quiet, &real, &landed, &busy(&[])]
            .map(|flight| flight.out.join("report.html"))
            .each_ref()
            .map(PathBuf::as_path),
    );
}

#[test]
fn the_pages_of_explain_and_compare_can_be_read() {
    if browser().is_none() {
        return;
    }
    let paper = ["profile=paper", "run.command_delay_ms=1.0", "guidance.disturbance_observer_radps=0"];
    let (one, other) = (busy(&[]), busy(&paper.map(|set| ["--set", set]).concat()));
    run(&["explain", "--all"], &[&one.out]);
    run(&["compare"], &[&one.out, &other.out]);
    look_at(&[&one.out.join("explain.html"), &one.out.with_file_name("compare.html")]);
}

#[test]
fn the_page_of_a_campaign_can_be_read() {
    if browser().is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("pages.toml");
    let text = "samples = 12\n[settings]\nrun.duration_s = 6.0\nbounds.max_position_error_m = 0.05\n\
                fault = [{ at_s = 2.0, target = \"mixer\", kind = \"kill\" }]\n\
                [vary]\nplant.airframe.mass_kg = { uniform = [0.9, 1.4] }\nrun.command_delay_ms = { uniform = [0.0, 30.0] }\n\
                [controller.mpc]\nattitude.law = \"mpc\"\n[controller.pid]\nattitude.law = \"pid\"\n";
    std::fs::write(&file, text).expect("written");
    let out = folder.path().join("campaign");
    run(&["campaign", file.to_str().expect("a plain path"), "--out"], &[&out]);
    look_at(&[&out.join("campaign.html")]);
}
