//! The folder of a run: created before the flight, and locked while it flies.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail, ensure};
use settings::Scenario;

use rustix::fs::{CWD, RenameFlags, renameat_with};
use rustix::io::Errno;

use crate::dir::Dir;
use runtime::console::eprint_line;

/// Attempts to create a folder whose parent another run has just removed.
const FOLDER_TRIES: u32 = 5;
/// Files by which the folder of a run is recognised.
const SIGNS_OF_A_RUN: [&str; 3] = ["run.json", "flight.mcap", "scenario.toml"];

pub struct Folder {
    pub path: PathBuf,
    /// Folders that were created for this run, outermost first, the run's own last.
    made: Vec<PathBuf>,
    /// Path to which an earlier run was moved, if there was one.
    aside: Option<PathBuf>,
    /// The open, locked folder; `None` while no folder is locked.
    hold: Option<Dir>,
}

impl Folder {
    /// Takes the folder `out`, or creates a new folder below `runs`, and writes the settings into the folder.
    ///
    /// An earlier run in the folder is moved aside. A folder to which another run is writing is refused.
    pub fn prepare(out: Option<&Path>, scenario: &Scenario) -> anyhow::Result<Self> {
        let mut folder = Self { path: PathBuf::new(), made: vec![], aside: None, hold: None };
        let taken = match out {
            Some(out) => folder.take(out),
            None => folder.take_new(&default_name(scenario)),
        };
        let settings = || folder.write("scenario.toml", &settings::to_toml(scenario));
        let written = taken.and_then(|()| settings());
        let cannot =
            || format!("cannot write to the output folder {}; choose another with --out", folder.path.display());
        written.with_context(cannot).inspect_err(|_| folder.withdraw())?;
        if let Some(aside) = &folder.aside {
            let (path, aside) = (folder.path.display(), aside.display());
            eprint_line(&format!("note: {path} held an earlier run; it is now {aside}"));
        }
        Ok(folder)
    }

    /// Writes the file `name` of the run, completely or not at all.
    pub fn write(&self, name: &str, text: &str) -> anyhow::Result<()> {
        self.hold.as_ref().context("the folder was given back")?.write_whole(name, text.as_bytes())
    }

    /// Removes the files and folders of a run that never flew, and moves an earlier run back.
    pub fn withdraw(&self) {
        if let Some(dir) = &self.hold {
            for name in ["scenario.toml", "flight.mcap"] {
                let _ = dir.remove(name); // the file may not be there yet
            }
        }
        for made in self.made.iter().rev() {
            // A folder that another run has taken since stays, and so does a folder that is not empty.
            let is_ours = *made != self.path || self.hold.is_some();
            let _ = if is_ours { fs::remove_dir(made) } else { Ok(()) };
        }
        if let Some(aside) = &self.aside {
            let _ = fs::rename(aside, &self.path); // fails if another folder has the path by now
        }
    }

    fn take(&mut self, out: &Path) -> anyhow::Result<()> {
        self.path = out.components().collect(); // removes a slash at the end
        loop {
            make(&self.path, &mut self.made)?;
            if !self.lock()? {
                continue; // another run has moved the folder aside meanwhile
            }
            if !self.hold.as_ref().is_some_and(|dir| SIGNS_OF_A_RUN.iter().any(|name| dir.has(name))) {
                return Ok(());
            }
            self.aside = Some(move_aside(&self.path)?);
            self.hold = None;
        }
    }

    /// Creates the first folder of `name`, `<name>-2`, `<name>-3`, ... that does not exist.
    fn take_new(&mut self, name: &str) -> anyhow::Result<()> {
        let mut number = 1;
        self.path = name.into();
        while !make(&self.path, &mut self.made)? {
            number += 1;
            self.path = format!("{name}-{number}").into();
        }
        self.lock().map(drop)
    }

    /// Locks the folder, which must not be a link; returns false if its path names another folder by now.
    fn lock(&mut self) -> anyhow::Result<bool> {
        let dir = match (self.path.parent(), self.path.file_name()) {
            (Some(above), Some(name)) => Dir::open(above)?.folder(name)?,
            _ => Dir::open(&self.path)?,
        };
        ensure!(dir.hold(), "another flight is writing to it");
        Ok(self.hold.insert(dir).is_in_its_place())
    }
}

fn default_name(scenario: &Scenario) -> String {
    let name: String = scenario.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("runs/{name}-{}", since_epoch.as_millis())
}

/// Creates the folder `path` and its missing parents, and adds them to `made`; returns false if `path` exists already.
fn make(path: &Path, made: &mut Vec<PathBuf>) -> io::Result<bool> {
    let mut tries = 0;
    loop {
        let error = match fs::create_dir(path) {
            Ok(()) => {
                made.push(path.into());
                return Ok(true);
            }
            Err(error) => error,
        };
        match (error.kind(), path.parent().filter(|parent| !parent.as_os_str().is_empty())) {
            (ErrorKind::AlreadyExists, _) => return Ok(false),
            (ErrorKind::NotFound, Some(parent)) if tries < FOLDER_TRIES => _ = make(parent, made)?,
            _ => return Err(error),
        }
        tries += 1;
    }
}

/// Renames the folder of an earlier run to the first free name of `<path>.1`, `<path>.2`, ...
fn move_aside(path: &Path) -> anyhow::Result<PathBuf> {
    for number in 1..=9999 {
        let aside = PathBuf::from(format!("{}.{number}", path.display()));
        let moved = match renameat_with(CWD, path, CWD, &aside, RenameFlags::NOREPLACE) {
            // The file system does not support NOREPLACE, so the name is checked first.
            Err(Errno::INVAL | Errno::NOSYS) if !aside.exists() => fs::rename(path, &aside),
            Err(Errno::EXIST | Errno::INVAL | Errno::NOSYS) => continue,
            moved => moved.map_err(io::Error::from),
        };
        return moved.map(|()| aside).with_context(|| format!("cannot move the earlier run in {}", path.display()));
    }
    bail!("no free name for the earlier run in {}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let all = fs::read_dir(folder).unwrap().flatten();
        let mut names: Vec<String> = all.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_folder_is_held_by_one_run_and_free_after_it() {
        let top = tempfile::tempdir().unwrap();
        let out = top.path().join("run");
        let scenario = Scenario::default();
        let first = Folder::prepare(Some(&out), &scenario).unwrap();
        let Err(refused) = Folder::prepare(Some(&out), &scenario) else { panic!("two runs have it") };
        assert!(format!("{refused:#}").ends_with("another flight is writing to it"), "{refused:#}");
        assert_eq!([names(top.path()), names(&out)], [["run"], ["scenario.toml"]], "nothing was touched");
        drop(first);
        let second = Folder::prepare(Some(&out), &scenario).unwrap();
        assert_eq!(names(top.path()), ["run", "run.1"]);
        second.withdraw();
        assert_eq!([names(top.path()), names(&out)], [["run"], ["scenario.toml"]], "the first is where it was");
    }

    #[test]
    fn flights_that_begin_at_the_same_time_have_folders_of_their_own() {
        let top = tempfile::tempdir().unwrap();
        let name = top.path().join("runs/survey-1").display().to_string();
        let start = || {
            let mut folder = Folder { path: PathBuf::new(), made: vec![], aside: None, hold: None };
            folder.take_new(&name).unwrap();
            folder
        };
        let flights = [start(), start(), start()];
        flights[1].withdraw();
        assert_eq!(names(&top.path().join("runs")), ["survey-1", "survey-1-3"], "a neighbour's files are not touched");
    }

    #[test]
    fn a_run_that_never_flew_leaves_no_folder() {
        let top = tempfile::tempdir().unwrap();
        let out = top.path().join("a/b/run");
        let folder = Folder::prepare(Some(&out), &Scenario::default()).unwrap();
        fs::write(out.join("flight.mcap"), "begun").unwrap();
        folder.withdraw();
        assert!(names(top.path()).is_empty());

        fs::create_dir_all(&out).unwrap();
        fs::write(out.join("note.txt"), "mine").unwrap();
        Folder::prepare(Some(&out), &Scenario::default()).unwrap().withdraw();
        assert_eq!(names(&out), ["note.txt"], "neither the user's folder nor what is in it");
    }

    #[test]
    fn a_folder_that_cannot_be_made_leaves_none_of_its_parents() {
        let top = tempfile::tempdir().unwrap();
        let long = "x".repeat(300);
        assert!(Folder::prepare(Some(&top.path().join("a/b").join(long)), &Scenario::default()).is_err());
        assert!(names(top.path()).is_empty());
    }
}
