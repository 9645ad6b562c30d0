//! `trefoil campaign`: every way to fly it gives the same table; an interruption loses no flight and counts none twice.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::fs::{FlockOperation, flock};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::harness::{launcher, python_with, top, write_script};

/// Twenty-four short flights of two controllers: listed, drawn, with noise and faults; some pass, some fail.
const CAMPAIGN: &str = r#"
name = "small"
samples = 6

[settings]
run.duration_s = 1.0
bounds.max_position_error_m = 0.01
plant.noise.position_m = 0.002

[vary]
run.command_delay_ms = [0.0, 10.0]
plant.airframe.mass_kg = { uniform = [1.0, 1.2] }

[controller.cone]
attitude.mpc.constraints = "cone"

[controller.lqr]
attitude.law = "lqr"

[random_faults]
count = [0, 1]
at_s = [0.2, 0.5]
for_s = [0.1, 0.4]
targets = ["controls", "attitude"]
"#;

/// Temporary folder with a campaign file.
pub struct Place {
    folder: tempfile::TempDir,
}

impl Place {
    pub fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("small.toml"), text).expect("can be written");
        Self { folder }
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns `trefoil campaign small.toml`, or one of its commands, with results in `out`.
    fn command(&self, before: &[&str], arguments: &[&str], out: &str) -> Command {
        let mut command = launcher();
        command.arg("campaign").args(before).arg(self.at("small.toml")).args(arguments).arg("--out").arg(self.at(out));
        command
    }

    fn fly(&self, arguments: &[&str], out: &str) -> Output {
        self.fly_by(&[], arguments, out)
    }

    /// Runs [`Self::command`] to its end.
    pub fn fly_by(&self, before: &[&str], arguments: &[&str], out: &str) -> Output {
        self.command(before, arguments, out).output().expect("the launcher runs")
    }

    /// Returns the table of all flights, as the bytes of its file.
    pub fn table(&self, out: &str) -> Vec<u8> {
        fs::read(self.at(out).join("flights.parquet")).expect("flights.parquet")
    }

    fn shard(&self, out: &str, index: usize) -> PathBuf {
        self.at(out).join("shards").join(format!("{index:05}.parquet"))
    }
}

fn check(output: &Output, code: i32, parts: &[&str]) {
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    for part in parts {
        assert!(said.contains(part), "should say '{part}': {said}");
    }
}

#[test]
fn the_table_is_the_same_whatever_flies_it() {
    let place = Place::new(CAMPAIGN);
    let here = place.fly(&[], "here");
    check(&here, 0, &[]);
    let said = String::from_utf8_lossy(&here.stdout);
    assert!(said.contains("small: 24 flights") && said.contains("cone") && said.contains("lqr"), "{said}");
    check(&place.command(&[], &["--shard", "5"], "one").env("RAYON_NUM_THREADS", "1").output().expect("runs"), 0, &[]);
    assert_eq!(place.table("one"), place.table("here"), "on one core, in other shards");
    for index in [2, 0, 1] {
        let index = index.to_string();
        let arguments = ["--index", &index, "--of", "3"];
        check(&place.command(&["shard"], &arguments, "engine").output().expect("runs"), 0, &[]);
    }
    check(
        &place.command(&["shard"], &["--index", "1", "--of", "3"], "engine").output().expect("runs"),
        0,
        &["is there already"],
    );
    check(&place.fly(&["--collect"], "engine"), 0, &[]);
    assert_eq!(place.table("engine"), place.table("here"), "by another engine");
    // The folder's own file flies the same campaign.
    let merged = place.at("here").join("campaign.toml");
    let again = launcher().arg("campaign").arg(merged).arg("--out").arg(place.at("merged")).output().expect("runs");
    check(&again, 0, &[]);
    assert_eq!(place.table("merged"), place.table("here"));
}

#[test]
fn a_campaign_that_is_killed_at_any_moment_goes_on() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&[], "whole"), 0, &[]);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for kill in 0..12 {
        let mut child = place
            .command(&[], &["--shard", "2"], "killed")
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .expect("starts");
        std::thread::sleep(Duration::from_millis(rng.random_range(10..150)));
        let signal = if kill % 3 == 0 { Signal::INT } else { Signal::KILL };
        let _ = kill_process(Pid::from_child(&child), signal); // it may have ended by itself
        let status = child.wait().expect("it can be waited for");
        assert!(matches!(status.code(), None | Some(0 | 130)), "{status}");
    }
    check(&place.fly(&["--shard", "2"], "killed"), 0, &[]);
    assert_eq!(place.table("killed"), place.table("whole"));
    let shards = fs::read_dir(place.at("killed").join("shards")).expect("shards").flatten();
    assert_eq!(shards.count(), 12, "and nothing half-written");
}

#[test]
fn ctrl_c_keeps_what_is_complete_and_says_how_to_go_on() {
    let place = Place::new(&CAMPAIGN.replace("samples = 6", "samples = 6000"));
    let child = place
        .command(&[], &["--shard", "1"], "out")
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("starts");
    crate::harness::wait_until("a shard is there", || place.shard("out", 0).exists());
    kill_process(Pid::from_child(&child), Signal::INT).expect("it flies");
    let output = child.wait_with_output().expect("it ends");
    check(&output, 130, &["the same command continues", "shards are missing"]);
    let html = fs::read_to_string(place.at("out").join("campaign.html")).expect("a page of what is there");
    assert!(html.contains("of 24000 flights are there"));
    check(&place.fly(&["--status"], "out"), 3, &[]);
}

#[test]
fn shards_that_cannot_be_counted_are_named_and_nothing_is_lost() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&["--shard", "6"], "out"), 0, &[]);
    let whole = place.table("out");
    let shard = |index| place.shard("out", index);
    let good = fs::read(shard(1)).expect("a shard");

    fs::remove_file(shard(1)).expect("it is there");
    check(&place.fly(&["--collect"], "out"), 3, &["1 of 4 shards are missing (1)"]);
    assert!(!place.at("out").join("flights.parquet").exists(), "no table without all flights");

    let mut bad = good.clone();
    // This byte belongs to the hash of the columns: some bytes of the file are not checked.
    let hash = good.windows(14).rposition(|word| word == b"columns_sha256").expect("its hash") + 20;
    bad[hash] ^= 1;
    for (bytes, why) in [
        (bad, "it is damaged"),
        (good[..good.len() / 2].to_vec(), "it is damaged"),
        (vec![], "it is damaged"),
        (fs::read(shard(2)).expect("a shard"), "another index: 2, not 1"),
    ] {
        fs::write(shard(1), &bytes).expect("can be written");
        for arguments in [&["--collect"][..], &["--status"], &["--only", "7"], &[]] {
            check(&place.fly(arguments, "out"), 2, &["shard 1", "00001.parquet", why, "remove the file"]);
        }
        assert_eq!(fs::read(shard(1)).expect("it is kept"), bytes, "nothing is removed unasked");
    }
    fs::remove_file(shard(1)).expect("it is there");
    check(&place.fly(&[], "out"), 0, &["18 of 24 flights are there already"]);
    assert_eq!(place.table("out"), whole);

    // A folder with shards of another program is refused.
    let layout = place.at("out").join("layout.toml");
    let text = fs::read_to_string(&layout).expect("a layout");
    fs::write(&layout, text.replace("program = \"", "program = \"0.0.1, ")).expect("can be written");
    check(&place.fly(&[], "out"), 2, &["another program (0.0.1, ", "--out"]);
}

#[test]
fn two_campaigns_do_not_fly_into_one_folder() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&["--shard", "6"], "out"), 0, &[]);
    let lock = fs::File::open(place.at("out").join("lock")).expect("the lock");
    flock(&lock, FlockOperation::LockExclusive).expect("it is free");
    check(&place.fly(&[], "out"), 2, &["another campaign is flying into it"]);
    let shard = place.command(&["shard"], &["--index", "0", "--of", "4"], "out").output().expect("runs");
    check(&shard, 2, &["another campaign is flying into it"]);
    flock(&lock, FlockOperation::Unlock).expect("it is ours"); // a child of another test may hold the file open
    fs::write(place.at("small.toml"), CAMPAIGN.replace("1.2", "1.3")).expect("can be written");
    check(&place.fly(&[], "out"), 2, &["another campaign, or an earlier or renamed version of this one", "--out"]);
    check(&place.fly(&["--shard", "3"], "occupied/by/nobody"), 0, &[]);
}

#[test]
fn a_full_disk_loses_one_shard_at_most() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&[], "whole"), 0, &[]);
    let limited = |kilobytes: u32| {
        let mut command = Command::new("bash");
        let program = launcher().get_program().to_owned();
        command.args(["-c", &format!("ulimit -f {kilobytes}; exec \"$@\""), "bash"]).arg(program).arg("campaign");
        command.arg(place.at("small.toml")).args(["--shard", "6", "--out"]).arg(place.at("out")).current_dir(top());
        command.output().expect("bash runs")
    };
    check(&limited(4), 3, &["cannot write", ".parquet"]);
    assert!(fs::read_dir(place.at("out").join("shards")).expect("the folder").next().is_none(), "nothing half-written");
    check(&place.fly(&["--shard", "6"], "out"), 0, &[]);
    assert_eq!(place.table("out"), place.table("whole"));
}

#[test]
fn one_flight_again_is_the_flight_of_the_table() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&["--only", "4"], "out"), 0, &[]); // before the other flights
    check(&place.fly(&[], "out"), 0, &[]);
    let (table, _) = campaign::table::FlightTable::from_parquet(place.table("out"), 24).expect("the table");
    for number in [3, 20] {
        let again = place.fly(&["--only", &number.to_string()], "out");
        let verdict = table.column("verdict").expect("a verdict").text(number).to_owned();
        check(&again, i32::from(verdict == "failed"), &[]);
        let said = String::from_utf8_lossy(&again.stdout).into_owned();
        assert!(said.starts_with(&format!("flight {number} is the one of the table\n")), "{said}");
        let run = fs::read_to_string(place.at("out").join(format!("flight-{number}/run.json"))).expect("run.json");
        let run: Value = serde_json::from_str(&run).expect("JSON");
        for metric in ["max_position_error_m", "rms_position_error_m", "tilt_max_deg", "rms_w_error_mps"] {
            let in_table = table.column(metric).expect("a metric").number(number);
            assert_eq!(run["metrics"][metric].as_f64(), in_table, "{metric} of flight {number}");
        }
        assert!(place.at("out").join(format!("flight-{number}/flight.mcap")).exists());
    }
    check(&place.fly(&["--only", "24"], "out"), 2, &["the numbers 0 to 23"]);
}

#[test]
fn the_plan_is_the_same_again_and_says_what_cannot_be_flown() {
    let place = Place::new(
        "[vary]\nattitude.mpc.prediction_horizon_s = [0.04, 0.2]\nattitude.mpc.control_horizon_s = [0.03, 0.05]\n",
    );
    let [one, two] = [(); 2].map(|()| place.fly(&["--plan"], "out"));
    check(&one, 0, &[]);
    let said = String::from_utf8_lossy(&one.stdout).into_owned();
    assert_eq!(said, String::from_utf8_lossy(&two.stdout));
    assert_eq!(said.lines().count(), 5);
    let invalid = "2\tscenario\t0.05\t0.04\t-\tinvalid: `attitude.mpc.control_horizon_s` = 0.05 is longer than \
                   `attitude.mpc.prediction_horizon_s` = 0.04";
    assert!(said.contains(invalid), "{said}");
    assert!(!place.at("out").exists(), "a plan writes nothing");
}

#[test]
fn a_flight_that_cannot_be_flown_is_told_and_counted_as_neither() {
    let place = Place::new(
        "[settings]\nrun.duration_s = 0.5\n[vary]\nattitude.mpc.prediction_horizon_s = [0.04, 0.2]\n\
         attitude.mpc.control_horizon_s = [0.03, 0.05]\n",
    );
    let output = place.fly(&[], "out");
    check(&output, 1, &["1 flights could not be flown"]);
    assert!(String::from_utf8_lossy(&output.stdout).contains("3 passed, 0 failed, 1 invalid"));
}

#[test]
fn what_is_wrong_is_told_before_anything_is_flown() {
    for (text, parts) in [
        ("[vary]\nmpc.np = [3, 4]\n", &["small.toml", "`mpc.np` is `attitude.mpc.prediction_horizon_s` now"][..]),
        ("[vary]\nplant.airframe.mass_kg = [1.1, -1.0]\n", &["small.toml", "`plant.airframe.mass_kg` = -1.0"]),
        ("[vary]\nattitude.mpc.max_iterations = 3\n", &["small.toml", "[settings]"]),
        ("sedes = 3\n", &["small.toml", "seeds"]),
        ("seeds = 60\n[settings]\nrun.duration_s = 0.5\n", &["small.toml", "seeds change no flight", "remove `seeds`"]),
        ("seeds = [4, 5, 4]\n", &["small.toml", "`run.seed` lists 4 twice"]),
        ("[vary]\ninitial.attitude_deg.00 = [0.0, 5.0]\n", &["small.toml", "is written `0`"]),
        ("[settings]\nrun.duration_s = 3.0\n", &["small.toml", "nothing varies"]),
        (
            "samples = 2\n[random_faults]\ncount = [1, 1]\nat_s = [1.0, 70.0]\nfor_s = [1.0, 2.0]\n",
            &["small.toml", "a flight ends after 60 s"],
        ),
        (
            "samples = 2\n[random_faults]\ncount = [1, 1]\nat_s = [1.0, 2.0]\nfor_s = [1.0, 2.0]\ntargets = ['attitude', 'mpc']\n\
             kinds = ['nan']\n",
            &["small.toml", "`attitude` has none of these `kinds`; it has off, stuck"],
        ),
        ("scenario = \"none.toml\"\n", &["none.toml"]),
    ] {
        let place = Place::new(text);
        check(&place.fly(&[], "out"), 2, parts);
        assert!(!place.at("out").exists(), "{text} leaves nothing");
    }
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&["--partition", "p"], "out"), 2, &["--slurm"]);
    check(&place.fly(&["--collect"], "out"), 2, &["there is no campaign in it"]);
    let shard = place.command(&["shard"], &["--index", "3", "--of", "3"], "out").output().expect("runs");
    check(&shard, 2, &["--index 3", "0 to 2"]);
    assert!(!place.at("out").exists());
}

#[test]
fn flights_that_share_a_draw_are_one_observation_and_copies_are_reported() {
    let noise = "run.duration_s = 0.5\nplant.noise.position_m = 0.01\nattitude.law = 'pid'\n";
    let place = Place::new(&format!(
        "seeds = 20\n[settings]\n{noise}[vary]\nattitude.mpc.prediction_horizon_s = [0.2, 0.25, 0.3]\n"
    ));
    let output = place.fly(&[], "out");
    check(&output, 0, &[]);
    let said = String::from_utf8_lossy(&output.stdout);
    for part in [
        "scenario      60  60     20  100.0 %  83.2 to 100.0 %",
        "Of 60 flights 20 differ",
        "`attitude.mpc.prediction_horizon_s` had no effect",
        "The 3 flights that a controller has of each of the 20 draws are one observation.",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    let place = Place::new("[settings]\nrun.duration_s = 0.5\n[vary]\nplant.airframe.mass_kg = [1.0, 1.1, 1.2]\n");
    let output = place.fly(&[], "out");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("Nothing is drawn") && said.contains("100.0 %  none"), "{said}");
}

#[test]
fn a_broken_promise_is_told_and_decides_the_exit_code() {
    let promised = |limit: f64| {
        format!(
            "[settings]\nrun.duration_s = 1.0\n[case.calm]\n[case.pushed]\ninitial.velocity_mps = [1.0, 0.0, 0.0]\n\
             [[promise]]\nfigure = \"{{case}}: largest error\"\ncases = [\"calm\", \"pushed\"]\n\
             metric = \"max_position_error_m\"\nat_most = {limit:?}\nunit = \"m\"\nbecause = \"it is a test\"\n"
        )
    };
    for (limit, code, pushed) in [(5.0, 0, "ok            pushed"), (0.1, 1, "short         pushed")] {
        let place = Place::new(&promised(limit));
        let output = place.fly(&[], "out");
        check(&output, code, &[]);
        let said = String::from_utf8_lossy(&output.stdout);
        let parts = ["ok            calm: largest error", pushed, "it is a test"];
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
        let page = fs::read_to_string(place.at("out/campaign.html")).expect("the page");
        assert!(page.contains("<h2>Promises</h2>") && page.contains("pushed: largest error"), "{page}");
    }
}

#[test]
fn the_campaigns_of_the_page_can_be_flown() {
    let page = fs::read_to_string(top().join("docs/campaigns.md")).expect("the page");
    let examples: Vec<&str> =
        page.split("```toml\n").skip(1).map(|rest| rest.split("```").next().expect("a block ends")).collect();
    let [whole, compare, promise, limit, faults] = examples[..] else { panic!("{} examples", examples.len()) };
    let shipped = fs::read_to_string(top().join("campaigns/fifty-seeds.toml")).expect("it is shipped");
    assert!(shipped.contains(whole), "{shipped}");
    let place = Place::new(&format!("samples = 3\n[settings]\nrun.duration_s = 20.0\n{faults}"));
    check(&place.fly(&["--plan"], "out"), 0, &[]);
    let promised =
        "[vary]\nrun.command_delay_ms = [0.0, 10.0]\n[case.calm]\n[case.gusts]\n[controller.lqr]\n[controller.pid]\n";
    check(&Place::new(&format!("{promised}{compare}{promise}")).fly(&["--plan"], "out"), 0, &[]);
    check(&Place::new(limit).fly(&["--plan"], "out"), 0, &[]);
    let shipped = fs::read_to_string(top().join("campaigns/delay-limit.toml")).expect("it is shipped");
    let settings = |text: &str| {
        text.lines().filter_map(|line| Some(line.split('#').next()?.trim().to_owned())).collect::<Vec<_>>()
    };
    assert!(settings(&shipped).windows(6).any(|lines| lines == settings(limit)), "{limit}");
}

#[test]
fn the_shipped_campaigns_can_be_flown() {
    let mut flown = 0;
    for entry in fs::read_dir(top().join("campaigns")).expect("the campaigns").flatten() {
        let plan = campaign::Plan::new(campaign::Campaign::load(&entry.path()).expect("a campaign")).expect("a plan");
        plan.check().unwrap_or_else(|error| panic!("{}: {error}", entry.path().display()));
        flown += 1;
    }
    assert!(flown >= 3);
}

#[test]
fn the_vehicle_lands_without_a_controller_and_falls_without_a_mixer_or_a_rotor() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("out");
    let output = launcher().args(["campaign", "brought-down", "--out"]).arg(&out).output().expect("the launcher runs");
    check(&output, 0, &[]);
    let table = fs::read(out.join("flights.parquet")).expect("flights.parquet");
    let (table, _) = campaign::table::FlightTable::from_parquet(table, 6).expect("the table");
    let column = |name: &str| table.column(name).expect("a column");
    assert_eq!(table.rows(), 6);
    for row in 0..table.rows() {
        let (case, cause) = (column("case").text(row), column("cause").text(row));
        let sink_mps = column("touchdown_sink_mps").number(row).expect("every flight touches down");
        let must_land = ["guidance kill", "attitude-mpc kill"].contains(&case);
        assert_eq!(cause, if must_land { "" } else { "crashed" }, "{case}");
        assert!(if must_land { sink_mps < 1.0 } else { sink_mps > 10.0 }, "{case}: {sink_mps}");
    }
}

/// Writes stand-ins for Slurm's commands into a folder for PATH: `sbatch` runs the tasks of an array at once, but loses
/// the first task of all.
fn fake_slurm(folder: &Path) {
    let sbatch = r#"#!/bin/bash
script=$(cat)
for word in "$@"; do case $word in --array=*) array=${word#--array=};; --output=*) output=${word#--output=};; esac; done
echo "$array" >> "$(dirname "$0")/arrays"
for range in ${array//,/ }; do
  for i in $(seq "${range%-*}" "${range#*-}"); do
    if [ ! -e "$(dirname "$0")/lost" ]; then touch "$(dirname "$0")/lost"; continue; fi
    SLURM_ARRAY_TASK_ID=$i sh -c "$script" > "${output//%a/$i}" 2>&1
  done
done
echo 7
"#;
    let sacct = "#!/bin/sh\nprintf '7_0|NODE_FAIL\\n7_10|TIMEOUT\\n7_0|FAILED\\n7_1|COMPLETED\\n'\n";
    for (name, text) in [("sbatch", sbatch), ("squeue", "#!/bin/sh\n"), ("sacct", sacct)] {
        write_script(&folder.join(name), text);
    }
}

#[test]
fn slurm_flies_the_shards_and_a_lost_one_again() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly(&[], "here"), 0, &[]);
    let bin = place.at("bin");
    fs::create_dir(&bin).expect("can be made");
    fake_slurm(&bin);
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").expect("a PATH"));
    let slurm = || place.command(&[], &["--slurm", "--shard", "6"], "slurm").env("PATH", &path).output().expect("runs");
    check(&slurm(), 0, &[]);
    assert_eq!(place.table("slurm"), place.table("here"));
    assert_eq!(
        fs::read_to_string(bin.join("arrays")).expect("what was submitted"),
        "0-3\n0\n",
        "all, then the lost one"
    );
    check(&slurm(), 0, &[]);
    assert_eq!(
        fs::read_to_string(bin.join("arrays")).expect("the same").lines().count(),
        2,
        "nothing is left to submit"
    );
}

#[test]
fn a_scheduler_that_is_not_there_or_whose_tasks_fail_is_told() {
    let place = Place::new(CAMPAIGN);
    let none = place.command(&[], &["--slurm"], "none").env("PATH", place.at("")).output().expect("runs");
    check(&none, 2, &["there is no `squeue` here", "without it the campaign flies on this machine"]);
    let bin = place.at("bin");
    fs::create_dir(&bin).expect("can be made");
    fake_slurm(&bin);
    fs::write(bin.join("lost"), "").expect("can be written"); // no task is lost
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").expect("a PATH"));
    let arguments = ["--slurm", "--program", "echo no trefoil on this node; false"];
    let output = place.command(&[], &arguments, "failing").env("PATH", path).output().expect("runs");
    let task = "Slurm ended task 0 as FAILED";
    check(&output, 3, &["ended without them", task, "no trefoil on this node", "the same command submits them again"]);
}

#[test]
fn duckdb_pandas_and_polars_read_it() {
    let place = Place::new(CAMPAIGN);
    let Some(python) = python_with(&["duckdb", "pandas", "polars", "pyarrow"]) else { return };
    check(&place.fly(&["--shard", "5"], "out"), 0, &[]);
    let script = top().join("tests/python/read_campaign.py");
    let read = Command::new(python).arg(script).arg(place.at("out")).output().expect("python runs");
    assert!(read.status.success(), "{}", String::from_utf8_lossy(&read.stderr));
    let seen: Value = serde_json::from_slice(&read.stdout).expect("one line of JSON");
    let numbers =
        |of: &Value| of.as_array().expect("numbers").iter().map(|n| n.as_f64().expect("a number")).collect::<Vec<_>>();
    let expected = numbers(&seen["pandas"]);
    assert!(expected[0] == 24.0 && expected[1] > 0.0 && expected[1] < 24.0, "{seen}");
    for (reader, found) in [
        ("polars", numbers(&seen["polars"])),
        ("duckdb", numbers(&seen["duckdb"][0])),
        ("duckdb", numbers(&seen["duckdb"][1])),
    ] {
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{reader}: {seen}");
    }
    for column in [
        "flight",
        "controller",
        "run.seed",
        "run.command_delay_ms",
        "random_fault.0.target",
        "verdict",
        "outcome",
        "hash",
    ] {
        assert!(seen["columns"].as_array().expect("columns").contains(&column.into()), "{column}: {seen}");
    }
    assert_eq!(
        (&seen["types"]["flight"], &seen["types"]["max_position_error_m"]),
        (&"int64".into(), &"float64".into())
    );
}
