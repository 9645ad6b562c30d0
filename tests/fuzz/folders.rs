//! Folders of runs and campaigns with damaged files: every command that reads them ends within ten seconds and 500 MB,
//! with a message and a regular exit code.
//!
//! `PROPTEST_CASES=10000 cargo test --workspace --test stack fuzz::folders` tries more cases.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use rustix::fs::{CWD, Mode, mkfifoat};

use super::{Edit, cases, edited, edits};
use crate::foreign::finished_within;
use crate::harness::{fly, launcher};
use crate::recorded::confined;

/// Longest time \[s\] and most memory \[kB\] of a command.
const LIMIT: Duration = Duration::from_secs(10);
const LIMIT_KB: u32 = 500_000;

/// Files of a folder: path relative to the folder, and content.
type Files = Vec<(PathBuf, Vec<u8>)>;

/// The folder of a short flight in which guidance is killed.
static RUN: LazyLock<Files> = LazyLock::new(|| {
    let kill = "fault=[{ at_s = 0.1, for_s = 0.1, target = \"guidance\", kind = \"kill\" }]";
    let outcome = fly(&["--mode", "inprocess", "--set", "run.duration_s=0.4", "--set", kill]);
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    files_of(&outcome.out)
});

/// The folder of a campaign of six flights in two shards, with its file.
static CAMPAIGN: LazyLock<Files> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("small.toml");
    fs::write(&file, "seeds = 6\n[settings]\nrun.duration_s = 0.2\nplant.noise.position_m = 0.002\n").expect("written");
    let mut command = launcher();
    command.args(["campaign", "--shard", "3"]).arg(&file).arg("--out").arg(folder.path().join("out"));
    let output = finished_within(LIMIT, &mut command);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    files_of(folder.path())
});

fn files_of(folder: &Path) -> Files {
    let mut found = vec![];
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        let name = PathBuf::from(entry.file_name());
        if path.is_dir() {
            found.extend(files_of(&path).into_iter().map(|(inner, bytes)| (name.join(inner), bytes)));
        } else {
            found.push((name, fs::read(&path).expect("a readable file")));
        }
    }
    found.sort();
    found
}

/// Damage done to a file.
#[derive(Debug, Clone)]
enum Damage {
    Edit(Vec<Edit>),
    /// Cut to this share.
    Cut(f64),
    /// Replaced by the content of another file of the folder.
    Like(Index),
    Gone,
    Empty,
    /// Sparse file of zeros of this length.
    Long(u64),
    Fifo,
    Folder,
    /// A link to its own folder, to a file outside, or to a device.
    Link(&'static str),
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        8 => edits().prop_map(Damage::Edit),
        4 => (0.0..1.0_f64).prop_map(Damage::Cut),
        2 => any::<Index>().prop_map(Damage::Like),
        1 => Just(Damage::Gone),
        1 => Just(Damage::Empty),
        1 => select(vec![1 << 20, 1 << 32, 1 << 42]).prop_map(Damage::Long),
        1 => Just(Damage::Fifo),
        1 => Just(Damage::Folder),
        1 => select(vec!["/dev/zero", "/dev/stdin", "/etc/hostname", "."]).prop_map(Damage::Link),
    ]
}

/// Writes the files to the folder `top`, with the damages.
fn lay(top: &Path, files: &Files, damages: &[(Index, Damage)]) {
    for (name, bytes) in files {
        let path = top.join(name);
        fs::create_dir_all(path.parent().expect("it is in the folder")).expect("can be made");
        fs::write(&path, bytes).expect("can be written");
    }
    for (which, damage) in damages {
        let (name, bytes) = which.get(files);
        let path = top.join(name);
        let _ = fs::remove_file(&path); // an earlier damage may have removed it
        let put = |bytes: &[u8]| drop(fs::write(&path, bytes));
        match damage {
            Damage::Edit(edits) => put(&edited(bytes.clone(), edits)),
            Damage::Cut(share) => put(&bytes[..(bytes.len() as f64 * share) as usize]),
            Damage::Like(other) => put(&other.get(files).1),
            Damage::Gone => {}
            Damage::Empty => put(&[]),
            Damage::Long(length) => drop(fs::File::create(&path).and_then(|file| file.set_len(*length))),
            Damage::Fifo => drop(mkfifoat(CWD, &path, Mode::RWXU)),
            Damage::Folder => drop(fs::create_dir(&path)),
            Damage::Link(target) => drop(symlink(target, &path)),
        }
    }
}

/// Runs the launcher on the folder `place`, and checks its exit code and message.
fn read(place: &Path, arguments: &[&str]) {
    let arguments: Vec<String> =
        arguments.iter().map(|argument| argument.replace('@', &place.display().to_string())).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let output = finished_within(LIMIT, confined(LIMIT_KB, &arguments).current_dir(place));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code().is_some_and(|code| code <= 3), "{arguments:?}: {:?} {said}", output.status);
    assert!(!said.contains("panicked"), "{arguments:?}: {said}");
    assert!(output.status.success() || !(said.is_empty() && output.stdout.is_empty()), "{arguments:?} says nothing");
}

proptest! {
    #![proptest_config(cases(12))]

    #[test]
    fn of_a_run(
        damages in vec((any::<Index>(), damage()), 1..3),
        command in select(vec![
            &["report", "@"][..], &["replay", "@"], &["replay", "@", "--node", "mixer", "--from", "0.2s"], &["explain", "@", "--all"],
            &["export", "@", "--to", "perfetto"], &["compare", "@", "@"], &["measure", "mpc", "@", "--rounds", "1"],
        ]),
    ) {
        let folder = tempfile::tempdir_in("/dev/shm").expect("a temporary folder");
        lay(folder.path(), &RUN, &damages);
        read(folder.path(), command);
    }

    #[test]
    fn of_a_campaign(
        damages in vec((any::<Index>(), damage()), 1..3),
        command in select(vec![&[][..], &["--status"], &["--collect"], &["--only", "3"], &["--plan"]]),
    ) {
        let folder = tempfile::tempdir_in("/dev/shm").expect("a temporary folder");
        lay(folder.path(), &CAMPAIGN, &damages);
        read(folder.path(), &[&["campaign", "@/small.toml", "--out", "@/out"], command].concat());
    }
}
