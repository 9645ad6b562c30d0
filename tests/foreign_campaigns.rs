//! Controllers of users in campaigns and measurements: beside ours in the same tables, and one that crashes, ends its
//! process or hangs costs its own flights only.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use campaign::table::FlightTable;
use contract::exit;
use rustix::process::{Pid, Signal, kill_process};

use crate::controllers::{library, with_dependency};
use crate::harness::{ended, launcher, namespace, processes_with, wait_until};

/// Sixty flights of four controllers, three of which end some of their flights, chosen by the vehicle's mass.
const CAMPAIGN: &str = r#"
name = "foreign"
samples = 15

[settings]
run.duration_s = 1.2
mission.trajectory = "hover"
supervision.wall_limit_s = 6.0

[vary]
plant.airframe.mass_kg = { uniform = [1.05, 1.15] }

[controller.ours]

[controller.crashes]
node.attitude-mpc = { exec = "crashes.so", settings = { gain = 1.1 } }

[controller.exits]
node.attitude-mpc.exec = "exits.so"

[controller.hangs]
node.attitude-mpc.exec = "hangs.so"
"#;

/// Folder with a campaign file and the libraries that it names.
struct Place(tempfile::TempDir);

impl Place {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("foreign.toml"), text).expect("can be written");
        Self(folder)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Compiles the controller with a trap that takes effect in this share of the flights.
    fn library(&self, name: &str, trap: u32, share: f64) -> PathBuf {
        library(self.0.path(), name, &[&format!("-DTRAP={trap}"), &format!("-DTRAP_SHARE={share}")])
    }

    fn command(&self, arguments: &[&str], out: &str) -> Command {
        let mut command = launcher();
        command.arg("campaign").arg(self.at("foreign.toml")).args(arguments).arg("--out").arg(self.at(out));
        command
    }

    fn fly(&self, arguments: &[&str], out: &str) -> Output {
        self.command(arguments, out).output().expect("the launcher runs")
    }

    fn table(&self, out: &str) -> Vec<u8> {
        fs::read(self.at(out).join("flights.parquet")).expect("flights.parquet")
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

/// Checks that the launcher refused with exit code 2 and these words.
fn refused(output: &Output, words: &str) {
    assert_eq!(output.status.code(), Some(i32::from(exit::USAGE)), "{}", said(output));
    assert!(said(output).contains(words), "should say {words:?}: {}", said(output));
}

#[test]
fn a_library_that_crashes_exits_or_hangs_costs_its_flights_and_the_table_stays_the_same() {
    let place = Place::new(CAMPAIGN);
    for (name, trap, share) in [("crashes", 2, 0.3), ("exits", 6, 0.3), ("hangs", 4, 0.1)] {
        place.library(name, trap, share);
    }
    let here = place.fly(&[], "here");
    assert_eq!(here.status.code(), Some(0), "{}", said(&here));
    let (flights, _) = FlightTable::from_parquet(place.table("here"), 60).unwrap();
    let text = |row: usize, column: &str| flights.column(column).unwrap().text(row).to_owned();
    for (controller, cause) in [
        ("ours", ""),
        ("crashes", "lost attitude-mpc (its library crashed: SIGSEGV)"),
        ("exits", "lost attitude-mpc (its library ended its process with exit code 0)"),
        ("hangs", "lost attitude-mpc (its library has not answered for 6 s, `supervision.wall_limit_s`)"),
    ] {
        let rows: Vec<usize> = (0..60).filter(|row| text(*row, "controller") == controller).collect();
        let lost: Vec<&usize> = rows.iter().filter(|row| text(**row, "verdict") == "failed").collect();
        assert!(lost.iter().all(|row| text(**row, "cause") == cause), "{controller}: {}", text(*lost[0], "cause"));
        assert!(lost.iter().all(|row| text(**row, "outcome").ends_with("at 0.99 s; attitude-mpc failed in flight")));
        let expected = if cause.is_empty() { 0..=0 } else { 1..=8 };
        assert!(expected.contains(&lost.len()), "{controller} lost {} of {}", lost.len(), rows.len());
        assert!(rows.iter().all(|row| text(*row, "verdict") != "invalid"));
    }
    let one = place.command(&["--shard", "7"], "one").env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert_eq!(one.status.code(), Some(0), "{}", said(&one));
    assert_eq!(place.table("one"), place.table("here"), "on one core, in other shards");

    let mut killed = place.command(&["--shard", "4"], "killed");
    let mut child = killed.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    wait_until("a shard is there", || place.at("killed/shards/00000.parquet").exists());
    kill_process(Pid::from_child(&child), Signal::KILL).unwrap();
    child.wait().unwrap();
    assert_eq!(place.fly(&["--shard", "4"], "killed").status.code(), Some(0));
    assert_eq!(place.table("killed"), place.table("here"), "after a kill");

    let crashed = (0..60).find(|row| text(*row, "cause").contains("crashed")).unwrap();
    let again = place.fly(&["--only", &crashed.to_string()], "here");
    assert!(said(&again).contains("is the one of the table"), "{}", said(&again));
    assert_eq!(again.status.code(), Some(i32::from(exit::PROCESS_LOST)), "{}", said(&again));
}

/// Controllers and their traps: a plain one, some that reach beyond their flight, and one that crashes in every flight.
const BEYOND: [(&str, u32); 9] = [
    ("plain", 0),
    ("forks", 17),
    ("daemon", 18),
    ("strays", 19),
    ("variable", 20),
    ("directory", 21),
    ("limit", 22),
    ("mask", 23),
    ("crashes", 2),
];

#[test]
fn a_library_that_reaches_beyond_its_flight_changes_no_other_and_leaves_no_process() {
    const MARK: &str = "TREFOIL_TEST_BEYOND";
    let settings = "samples = 5\nsettings.run.duration_s = 1.2\nsettings.mission.trajectory = 'hover'\n\
        vary.plant.airframe.mass_kg = { uniform = [1.05, 1.15] }\n";
    let controllers = BEYOND.map(|(name, _)| format!("controller.{name}.node.attitude-mpc.exec = '{name}.so'\n"));
    let place = Place::new(&(settings.to_owned() + &controllers.concat()));
    for (name, trap) in BEYOND {
        place.library(name, trap, 1.0);
    }
    for threads in ["1", "4"] {
        let flown = ended(place.command(&[], threads).env("RAYON_NUM_THREADS", threads).env(MARK, "1"));
        assert_eq!(flown.code(), Some(0));
        wait_until("no process of the campaign is left", || processes_with(MARK).is_empty());
    }
    assert_eq!(place.table("1"), place.table("4"), "whichever flights share a process");
    let (flights, _) = FlightTable::from_parquet(place.table("1"), 45).unwrap();
    let column = |name: &str, of: &str| -> Vec<String> {
        let text = |row: usize, name: &str| flights.column(name).unwrap().text(row).to_owned();
        (0..45).filter(|row| text(*row, "controller") == of).map(|row| text(row, name)).collect()
    };
    for (name, _) in BEYOND {
        let (verdicts, cause) = (column("verdict", name), &column("cause", name)[0]);
        match name {
            "daemon" => assert_eq!(cause, "lost attitude-mpc (its library ended its process with exit code 0)"),
            "crashes" => assert_eq!(cause, "lost attitude-mpc (its library crashed: SIGSEGV)"),
            _ => assert_eq!(column("hash", name), column("hash", "plain"), "{name}: {cause}"),
        }
        let lost = matches!(name, "daemon" | "crashes");
        assert!(verdicts.iter().all(|verdict| (verdict == "failed") == lost), "{name}: {verdicts:?}, {cause}");
    }
}

/// Two flights of the library `lib.so`.
const OF_ONE: &str = "settings.run.duration_s = 0.1\nvary.plant.airframe.mass_kg = [1.1, 1.12]\n[controller.lib]\nnode.attitude-mpc.exec = 'lib.so'\n";

#[test]
fn controllers_that_cannot_be_in_one_process_fly_in_one_campaign() {
    let place = Place::new(
        "settings.run.duration_s = 0.5\nvary.plant.airframe.mass_kg = [1.1, 1.12]\n\
         [controller.one]\nnode.attitude-mpc.exec = 'one/one.so'\n\
         [controller.other]\nnode.attitude-mpc.exec = 'other/other.so'\n",
    );
    for (name, gain) in [("one", "1.0"), ("other", "0.8")] {
        with_dependency(&place.at(""), name, gain);
    }
    let flown = place.command(&[], "out").env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert_eq!(flown.status.code(), Some(0), "{}", said(&flown));
    let (flights, _) = FlightTable::from_parquet(place.table("out"), 4).unwrap();
    let flight = |row: usize| ["controller", "hash"].map(|column| flights.column(column).unwrap().text(row).to_owned());
    let flights: Vec<[String; 2]> = (0..4).map(flight).collect();
    for [controller, hash] in &flights {
        let others = flights.iter().filter(|[other, _]| other != controller);
        assert!(others.clone().count() == 2 && others.clone().all(|[_, other]| other != hash), "{flights:?}");
    }
}

#[test]
fn another_file_under_the_same_name_is_refused() {
    let place = Place::new(OF_ONE);
    place.library("lib", 0, 1.0);
    assert_eq!(place.fly(&[], "out").status.code(), Some(0));
    library(&place.at(""), "lib", &["-O1"]);
    for arguments in [&[][..], &["--only", "0"], &["--collect"]] {
        refused(&place.fly(arguments, "out"), "another campaign, or an earlier or renamed version of this one");
    }
    let merged = place.at("out/campaign.toml");
    let of_the_folder = launcher().arg("campaign").arg(merged).args(["--only", "0"]).output().unwrap();
    refused(&of_the_folder, "is another file than the settings name");
}

#[test]
fn the_folder_of_another_user_starts_no_library() {
    let theirs = Place::new(OF_ONE);
    theirs.library("lib", 15, 1.0);
    let mark = theirs.at("mark");
    let flown = theirs.command(&[], "out").env("TREFOIL_MARK", &mark).output().unwrap();
    assert_eq!(flown.status.code(), Some(0), "{}", said(&flown));
    assert!(mark.exists(), "it was loaded");
    fs::remove_file(&mark).unwrap();
    let ours = Place::new("settings.run.duration_s = 0.1\nvary.plant.airframe.mass_kg = [1.1, 1.12]\n");
    for arguments in [&["--only", "0"][..], &["--collect"], &["--status"], &[]] {
        let mut command = launcher();
        command.arg("campaign").arg(ours.at("foreign.toml")).args(arguments).arg("--out").arg(theirs.at("out"));
        refused(&command.env("TREFOIL_MARK", &mark).output().unwrap(), "another campaign");
    }
    let run = theirs.at("run");
    let mut fly = launcher();
    fly.args(["fly", "--mode", "lockstep", "--set", "run.duration_s=2", "--namespace", &namespace()]);
    fly.args(["--set", "fault=[{at_s=1, target='guidance', kind='kill'}]", "--set"]);
    fly.arg(format!("node.attitude-mpc.exec={}", theirs.at("lib.so").display())).arg("--out").arg(&run);
    assert_eq!(fly.env("TREFOIL_MARK", &mark).output().unwrap().status.code(), Some(0));
    fs::remove_file(&mark).expect("it was loaded");
    for (command, code) in [("replay", 0), ("explain", 2), ("report", 0)] {
        let read = launcher().arg(command).arg(&run).env("TREFOIL_MARK", &mark).output().unwrap();
        assert_eq!(read.status.code(), Some(code), "{command}: {}", said(&read));
    }
    assert!(!mark.exists(), "nothing of their folders was loaded");
}

#[test]
fn a_controller_of_the_command_line_flies_beside_those_of_the_file() {
    let place = Place::new(
        "samples = 2\nsettings.run.duration_s = 1.2\nvary.plant.airframe.mass_kg = { uniform = [1.05, 1.15] }\n\
         [[promise]]\nfigure = 'lost'\npassed = 'all'\n",
    );
    let mine = place.library("mine", 2, 1.0); // it crashes: a promise covers only controllers of the file
    let argument = |name: &str, file: &Path| format!("{name}={}", file.display());
    let flown = place.fly(&["--controller", &argument("mine", &mine), "--controller", &argument("too", &mine)], "out");
    assert_eq!(flown.status.code(), Some(0), "{}", said(&flown));
    for words in ["6 flights", "scenario", "mine", "too"] {
        assert!(said(&flown).contains(words), "{words}: {}", said(&flown));
    }
    let page = fs::read_to_string(place.at("out/campaign.html")).unwrap();
    assert!(page.contains(&format!("--controller mine={}", mine.display())), "the command that flies one again");

    refused(&place.fly(&["--controller", "mine"], "x"), "give NAME=FILE");
    refused(&place.fly(&["--controller", &argument("scenario", &mine)], "x"), "has a controller of this name");
    refused(&place.fly(&["--controller", "mine=./missing.so"], "x"), "is not there");
    refused(&place.fly(&["--controller", "mine=/bin/true"], "x"), "in process there is none");
    let crashes = place.library("crashes", 14, 1.0);
    refused(&place.fly(&["--controller", &argument("bad", &crashes)], "x"), "ended the process that tried it");
    fs::write(place.at("foreign.toml"), "[vary]\nnode.attitude-mpc.exec = ['mine.so', '']\n").unwrap();
    refused(&place.fly(&[], "x"), "give each library a [controller.NAME] of its own");
    assert!(!place.at("x").exists());
}

#[test]
fn settings_of_a_library_are_varied_like_all_others() {
    let place = Place::new(
        "settings.run.duration_s = 0.5\nsettings.node.attitude-mpc.exec = 'mine.so'\n\
         [vary]\nnode.attitude-mpc.settings.gain = [0.9, 1.1]\n",
    );
    place.library("mine", 0, 1.0);
    let flown = place.fly(&[], "out");
    assert_eq!(flown.status.code(), Some(0), "{}", said(&flown));
    let (flights, _) = FlightTable::from_parquet(place.table("out"), 2).unwrap();
    let hashes = flights.column("hash").unwrap();
    assert_ne!(hashes.text(0), hashes.text(1));
}

#[test]
fn a_controller_stands_beside_ours_in_the_measurements() {
    let folder = tempfile::tempdir().unwrap();
    let mine = format!("mine={}", library(folder.path(), "mine", &[]).display());
    let out = folder.path().join("laws");
    let laws = launcher().args(["campaign", "aggressive", "--controller", &mine, "--out"]).arg(out).output().unwrap();
    assert_eq!(laws.status.code(), Some(0), "ours keep their promises: {}", said(&laws));
    let row = |name: &str| said(&laws).lines().any(|line| line.trim_start().starts_with(name));
    assert!(row("cone ") && row("mine "), "{}", said(&laws));
}
