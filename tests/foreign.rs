//! Untrusted folders: no link in them is followed, no FIFO blocks, no program that they name is run, and a refused
//! folder is left unchanged.

use std::fs;
use std::os::unix::fs::{PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rustix::fs::{CWD, Mode, mkfifoat};
use rustix::process::{Pid, Signal, kill_process};

use crate::harness::{NOBODY, copy_program, has_root, launcher, write_script};

/// Longest time that a command of these tests may take.
const WATCHDOG: Duration = Duration::from_secs(60);

const CAMPAIGN: &str = "seeds = 6\n[settings]\nrun.duration_s = 0.2\nplant.noise.position_m = 0.002\n";

/// A folder `top/out` with a campaign that was flown, and `top/elsewhere` with a file that must not be touched.
struct Place {
    top: tempfile::TempDir,
}

impl Place {
    fn flown() -> Self {
        let place = Self { top: tempfile::tempdir().expect("a temporary folder") };
        fs::write(place.at("small.toml"), CAMPAIGN).expect("can be written");
        fs::create_dir(place.at("elsewhere")).expect("can be made");
        fs::write(place.at("elsewhere/half.part"), "precious").expect("can be written");
        let output = place.campaign(&["--shard", "3"]);
        assert!(output.status.success(), "{}", said(&output));
        place
    }

    fn at(&self, name: &str) -> PathBuf {
        self.top.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = launcher();
        command.arg("campaign").arg(self.at("small.toml")).arg("--out").arg(self.at("out")).args(arguments);
        command
    }

    fn campaign(&self, arguments: &[&str]) -> Output {
        finished(&mut self.command(arguments))
    }

    fn check_elsewhere(&self) {
        let names: Vec<_> = fs::read_dir(self.at("elsewhere")).expect("it is there").flatten().collect();
        assert_eq!(names.len(), 1, "{names:?}");
        assert_eq!(fs::read(self.at("elsewhere/half.part")).expect("it is there"), b"precious");
    }
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs a command to its end, and kills it when it takes too long.
fn finished(command: &mut Command) -> Output {
    finished_within(WATCHDOG, command)
}

/// Runs a command to its end, within `limit`. The command's output must be less than a pipe holds.
pub fn finished_within(limit: Duration, command: &mut Command) -> Output {
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).stdin(Stdio::null()).spawn();
    ended_within(limit, child.expect("the launcher starts"))
}

fn ended(child: Child) -> Output {
    ended_within(WATCHDOG, child)
}

fn ended_within(limit: Duration, mut child: Child) -> Output {
    let deadline = Instant::now() + limit;
    while child.try_wait().expect("it can be waited for").is_none() {
        if Instant::now() > deadline {
            let _ = child.kill();
            panic!("it did not end within {limit:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait_with_output().expect("it has ended")
}

/// Puts a FIFO, or a link to `target`, at `path`.
fn put(kind: &str, path: &Path, target: &Path) {
    match kind {
        "a FIFO" => mkfifoat(CWD, path, Mode::RWXU).expect("a FIFO"),
        _ => symlink(target, path).expect("a link"),
    }
}

#[test]
fn what_stands_in_the_place_of_a_file_of_a_campaign_is_neither_followed_nor_waited_for() {
    for (name, all) in [
        ("lock", &[&[][..], &["--slurm"]][..]),
        ("layout.toml", &[&[], &["--status"], &["--collect"], &["--only", "1"]]),
        ("shards", &[&[], &["--status"], &["--collect"]]),
        ("shards/00001.parquet", &[&[], &["--status"], &["--collect"], &["--only", "4"]]),
    ] {
        for kind in ["a FIFO", "a link"] {
            let place = Place::flown();
            let whole = fs::read(place.at("out/flights.parquet")).expect("the table");
            fs::rename(place.at("out").join(name), place.at("kept")).expect("it was there");
            put(kind, &place.at("out").join(name), &place.at("elsewhere"));
            for arguments in all {
                let output = place.campaign(arguments);
                let said = said(&output);
                assert_eq!(output.status.code(), Some(2), "{name} {arguments:?}: {said}");
                assert!(said.contains(name) && said.contains(kind), "{name} {arguments:?}: {said}");
            }
            place.check_elsewhere();
            assert_eq!(fs::read(place.at("out/flights.parquet")).expect("it stays"), whole);
        }
    }
}

#[test]
fn a_result_that_is_a_link_is_not_written_through() {
    let place = Place::flown();
    for name in ["campaign.html", "flights.parquet"] {
        let kept = fs::read(place.at("out").join(name)).expect("it was written");
        fs::remove_file(place.at("out").join(name)).expect("it is there");
        symlink(place.at("elsewhere/half.part"), place.at("out").join(name)).expect("a link");
        let output = place.campaign(&[]);
        assert_eq!(output.status.code(), Some(3), "{}", said(&output));
        assert!(said(&output).contains("it is a link"), "{}", said(&output));
        place.check_elsewhere();
        fs::remove_file(place.at("out").join(name)).expect("the link");
        fs::write(place.at("out").join(name), kept).expect("can be written");
    }
    symlink(place.at("elsewhere"), place.at("out/flight-1")).expect("a link");
    let output = place.campaign(&["--only", "1"]);
    assert!(output.status.code() == Some(2) && said(&output).contains("it is a link"), "{}", said(&output));
    place.check_elsewhere();
}

#[test]
fn numbers_of_shards_that_cannot_be_lose_no_table() {
    let place = Place::flown();
    let layout = fs::read_to_string(place.at("out/layout.toml")).expect("a layout");
    assert!(layout.contains("shards = 2"), "{layout}");
    let whole = fs::read(place.at("out/flights.parquet")).expect("the table");
    for (from, to) in [
        ("shards = 2", "shards = 0"),
        ("shards = 2", "shards = 9223372036854775807"),
        ("shards = 2", "shards = 7"),
        ("flights = 6", "flights = 9223372036854775807"),
        ("flights = 6", "flights = 2"),
    ] {
        fs::write(place.at("out/layout.toml"), layout.replace(from, to)).expect("can be written");
        for arguments in [&[][..], &["--status"], &["--collect"]] {
            let output = place.campaign(arguments);
            assert_eq!(output.status.code(), Some(2), "{to} {arguments:?}: {}", said(&output));
            assert!(said(&output).contains("another folder with --out"), "{to}: {}", said(&output));
        }
        assert_eq!(fs::read(place.at("out/flights.parquet")).expect("it stays"), whole, "{to}");
    }
}

#[test]
fn the_folder_of_a_run_is_written_into_and_nowhere_else() {
    let top = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| top.path().join(name);
    for folder in ["elsewhere", "run"] {
        fs::create_dir(at(folder)).expect("can be made");
    }
    symlink(at("elsewhere"), at("run/histograms")).expect("a link");
    let fly = |out: &str| {
        let flight = ["fly", "--mode", "lockstep", "--set", "run.duration_s=0.1", "--out"];
        finished(launcher().args(flight).arg(at(out)).args(["--namespace", &crate::harness::namespace()]))
    };
    let output = fly("run");
    assert!(output.status.code() == Some(3) && said(&output).contains("histograms"), "{}", said(&output));
    assert!(at("run/run.json").exists(), "the flight itself is kept");
    symlink(at("elsewhere"), at("linked")).expect("a link");
    let output = fly("linked");
    assert!(output.status.code() == Some(2) && said(&output).contains("it is a link"), "{}", said(&output));
    assert_eq!(fs::read_dir(at("elsewhere")).expect("it is there").count(), 0);

    fs::write(at("precious"), "precious").expect("can be written");
    for (name, verb) in [("run.json", "report"), ("report.html", "report"), ("flight.mcap", "replay")] {
        let path = at("run").join(name);
        let kept = fs::read(&path).unwrap_or_default();
        let _ = fs::remove_file(&path); // the report was not written
        for kind in ["a FIFO", "a link"] {
            put(kind, &path, &at("precious"));
            let output = finished(launcher().arg(verb).arg(at("run")));
            assert_eq!(output.status.code(), Some(2), "{name}, {kind}: {}", said(&output));
            assert!(said(&output).contains(kind), "{name}, {kind}: {}", said(&output));
            fs::remove_file(&path).expect("it is there");
        }
        fs::write(&path, kept).expect("can be written");
    }
    assert_eq!(fs::read(at("precious")).expect("it is there"), b"precious");
}

#[test]
fn files_of_another_user_are_told() {
    if !has_root() {
        return;
    }
    let place = Place::flown();
    chown(place.at("out/shards/00001.parquet"), Some(NOBODY), None).expect("root may");
    let output = place.campaign(&["--status"]);
    let told = "00001.parquet belongs to another user (65534)";
    assert!(output.status.success() && said(&output).contains(told), "{}", said(&output));
}

#[test]
fn names_do_not_control_the_terminal() {
    let top = tempfile::tempdir().expect("a temporary folder");
    let out = top.path().join("\u{1b}]0;folder\u{7}");
    let flight = ["fly", "--mode", "inprocess", "--set", "run.duration_s=0.1", "--set", r#"name="\u001b[2Jscenario""#];
    let flown = finished(launcher().args(flight).arg("--out").arg(&out));
    let again = finished(launcher().args(flight).arg("--out").arg(&out));
    let report = finished(launcher().arg("report").arg(&out));
    let none = finished(launcher().arg("report").arg(out.join("none")));
    let usage = finished(launcher().args(["fly", "x.toml"]).arg(&out));
    for output in [&flown, &again, &report, &none, &usage] {
        let all = [&output.stdout[..], &output.stderr[..]].concat();
        assert!(!all.contains(&0x1b) && !all.contains(&7), "{}", String::from_utf8_lossy(&all));
    }
    assert!(String::from_utf8_lossy(&flown.stdout).contains(r"\u{1b}[2Jscenario"));
    assert!([&again, &none].iter().all(|output| said(output).contains(r"\u{1b}]0;folder\u{7}")));
}

/// Writes a command called `name` into a folder for PATH.
fn put_command(folder: &Path, name: &str, script: &str) {
    write_script(&folder.join(name), script);
}

#[test]
fn a_scheduler_that_hangs_or_never_stops_talking_holds_up_nothing() {
    let place = Place::flown();
    fs::remove_file(place.at("out/shards/00000.parquet")).expect("it is there");
    let slurm = || {
        let mut command = place.command(&["--slurm"]);
        let path = format!("{}:{}", place.top.path().display(), std::env::var("PATH").expect("a PATH"));
        command.env("PATH", path).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    put_command(place.top.path(), "squeue", "#!/bin/sh\nexec yes\n");
    let output = finished(&mut slurm());
    assert!(output.status.code() == Some(2) && said(&output).contains("more than 16 MB"), "{}", said(&output));

    put_command(place.top.path(), "squeue", "#!/bin/sh\ntouch \"$0.called\"\nexec sleep 1000\n");
    let child = slurm().spawn().expect("the launcher starts");
    crate::harness::wait_until("squeue is called", || place.at("squeue.called").exists());
    kill_process(Pid::from_child(&child), Signal::TERM).expect("it runs");
    let output = ended(child);
    assert_eq!(output.status.code(), Some(130), "{}", said(&output));
}

#[test]
fn a_script_that_stands_in_the_folder_is_not_submitted() {
    let place = Place::flown();
    fs::remove_file(place.at("out/shards/00000.parquet")).expect("it is there");
    put_command(place.top.path(), "squeue", "#!/bin/sh\n");
    // The job script is piped to sbatch. The file with the name of the script is replaced meanwhile.
    let sbatch = "#!/bin/sh\necho 'touch \"$0.foreign\"' > \"$TOP/out/slurm/shard.sh\"\ncat > \"$TOP/job\"\n\
                  for word in \"$@\"; do case $word in *.sh) sh $word;; esac; done\nSLURM_ARRAY_TASK_ID=0 sh \"$TOP/job\" 2>/dev/null\n";
    put_command(place.top.path(), "sbatch", sbatch);
    let path = format!("{}:{}", place.top.path().display(), std::env::var("PATH").expect("a PATH"));
    let output = finished(place.command(&["--slurm"]).env("PATH", path).env("TOP", place.top.path()));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(!place.at("out/slurm/shard.sh.foreign").exists());
}

#[test]
fn programs_of_other_sources_are_told_apart() {
    let place = Place::flown();
    let other = place.at("other-launcher");
    let same = fs::read(env!("CARGO_BIN_EXE_trefoil")).expect("can be read");
    let bytes = place.at("other-bytes"); // the same program with other bytes
    fs::write(&bytes, [&same[..], b"\0"].concat()).expect("can be written");
    fs::set_permissions(&bytes, fs::Permissions::from_mode(0o755)).expect("it is ours");
    copy_program(&bytes, &other);
    let run = || {
        let mut command = Command::new(&other);
        command.arg("campaign").arg(place.at("small.toml")).arg("--out").arg(place.at("out"));
        finished(&mut command)
    };
    let layout = fs::read_to_string(place.at("out/layout.toml")).expect("a layout");
    let output = run();
    if layout.contains("sha256") {
        assert!(output.status.code() == Some(2) && said(&output).contains("another program"), "{}", said(&output));
    } else {
        assert!(output.status.success(), "the commit tells a program of clean sources: {}", said(&output));
    }
}

#[test]
fn no_program_that_a_folder_names_is_run() {
    let top = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| top.path().join(name);
    put_command(
        top.path(),
        "program",
        &format!("#!/bin/sh\nexec {} node attitude-mpc \"$@\"\n", env!("CARGO_BIN_EXE_trefoil")),
    );
    let swap = |more: &str| {
        let program = at("program").display().to_string();
        format!("at_s = 0.2, node = \"attitude-mpc\", standby_s = 0.1, watch_s = 0.1, exec = \"{program}\"{more}")
    };
    let flight =
        ["fly", "--mode", "lockstep", "--set", "run.duration_s=0.6", "--namespace", &crate::harness::namespace()];
    let flown = finished(
        launcher().args(flight).args(["--set", &format!("swap=[{{ {} }}]", swap(""))]).arg("--out").arg(at("run")),
    );
    assert!(flown.status.success(), "{}", said(&flown));
    let campaign =
        format!("seeds = 2\n[settings]\nrun.duration_s = 0.6\nswap = [{{ {} }}]\n", swap(", may_fail = true"));
    fs::write(at("campaign.toml"), campaign).expect("can be written");
    put_command(top.path(), "program", "#!/bin/sh\ntouch \"$0.was-run\"\n");
    let run = at("run").display().to_string();
    for arguments in [
        &["report", &run][..],
        &["replay", &run],
        &["replay", &run, "--node", "attitude-mpc"],
        &["explain", &run],
        &["compare", &run, &run, "--out", &at("compare.html").display().to_string()],
        &["export", &run, "--to", "perfetto"],
        &["campaign", &at("campaign.toml").display().to_string(), "--out", &at("out").display().to_string()],
        &[
            "campaign",
            &at("campaign.toml").display().to_string(),
            "--out",
            &at("out").display().to_string(),
            "--only",
            "0",
        ],
    ] {
        let output = finished(launcher().args(arguments));
        assert!(!at("program.was-run").exists(), "{arguments:?}: {}", said(&output));
    }
}
