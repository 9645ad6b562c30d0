//! Files of a run in shared memory, watched while it flies: notices a file that is removed or cut short.
//!
//! A removed file harms no process that has it mapped, but a process that is started later cannot join. A file that is
//! cut short kills the process that touches the missing part (SIGBUS). Files of dead processes, which are cleared away,
//! and files of guests, which may come and go, are not watched.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use runtime::domain::Domain;
use runtime::port;

use super::children::Children;
use crate::event::{Event, What};
use crate::limits::FILES_LOOK;

/// Name of the host in events.
const HOST: &str = "host";
/// Number of looks in a row at which a file is missing before it counts as removed: a process that leaves removes its
/// files before it ends, on a busy machine more than 0.1 s before (a Python program, at commit f7c49549).
const MISSING_LOOKS: u32 = 10;

pub struct Files {
    domain: Domain,
    looked: Instant,
    known: BTreeMap<PathBuf, Known>,
}

struct Known {
    bytes: u64,
    /// Number of looks in a row at which the file was missing.
    missing: u32,
}

impl Files {
    /// Creates the watch over the files of `domain`; no file is known yet.
    pub fn new(domain: Domain) -> Self {
        Self { domain, looked: Instant::now(), known: BTreeMap::new() }
    }

    /// Returns an event at `tick` for each file that the launcher or `children` have lost since the last look.
    pub fn events(&mut self, tick: u64, children: &Children) -> Vec<Event> {
        let living = children.all.iter().map(|process| process.child.id()).chain([std::process::id()]);
        let event = |(what, path): (What, PathBuf)| Event::new(tick, HOST, 0, what).because(path.display().to_string());
        self.look(&living.collect::<Vec<_>>()).into_iter().map(event).collect()
    }

    /// Returns the files that the processes `living` have lost since the last look; none before `FILES_LOOK` is over.
    fn look(&mut self, living: &[u32]) -> Vec<(What, PathBuf)> {
        if self.looked.elapsed() < FILES_LOOK {
            return vec![];
        }
        self.looked = Instant::now();
        let of_the_living = |path: &PathBuf| port::makers(&name(path)).all(|pid| living.contains(&pid));
        let found: BTreeMap<PathBuf, u64> =
            self.domain.files().into_iter().filter(|(path, _)| of_the_living(path)).collect();
        let mut losses = vec![];
        self.known.retain(|path, known| {
            let loss = match found.get(path) {
                Some(bytes) if *bytes < known.bytes => Some(What::ShmCutShort),
                None if known.missing + 1 >= MISSING_LOOKS => Some(What::ShmRemoved),
                _ => None,
            };
            known.missing = if found.contains_key(path) { 0 } else { known.missing + 1 };
            known.bytes = found.get(path).copied().unwrap_or(known.bytes);
            losses.extend(loss.filter(|_| of_the_living(path)).map(|loss| (loss, path.clone())));
            of_the_living(path) && loss != Some(What::ShmRemoved)
        });
        for (path, bytes) in found {
            self.known.entry(path).or_insert(Known { bytes, missing: 0 });
        }
        losses
    }
}

fn name(path: &std::path::Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use runtime::domain::Hold;

    /// Looks often enough that a removal counts.
    fn look(files: &mut Files, living: &[u32]) -> Vec<(What, PathBuf)> {
        let mut losses = vec![];
        for _ in 0..MISSING_LOOKS {
            std::thread::sleep(FILES_LOOK);
            losses.extend(files.look(living));
        }
        losses
    }

    #[test]
    fn a_lost_file_of_a_living_process_is_noticed_once() {
        let hold = Hold::take(&format!("files-{}", std::process::id())).expect("the namespace is free");
        let domain = hold.domain.clone();
        let segment = |pid: u128, number: u128| {
            let id = (1_u128 << 96) + (pid << 64) + number;
            domain.file(&format!("iox/hash_{id}.data"))
        };
        let (kept, removed, cut, dead) = (segment(41, 1), segment(41, 2), domain.file("page"), segment(42, 3));
        std::fs::create_dir(domain.file("iox")).expect("the run's folder is ours");
        for path in [&kept, &removed, &cut, &dead] {
            std::fs::write(path, [0; 64]).expect("shared memory can be written");
        }
        let mut files = Files::new(domain);
        assert_eq!(look(&mut files, &[41, 42]), []);
        for path in [&removed, &dead] {
            std::fs::remove_file(path).expect("it was there");
        }
        std::fs::write(&cut, [0; 16]).expect("it was there");
        assert_eq!(look(&mut files, &[41]), [(What::ShmCutShort, cut), (What::ShmRemoved, removed)]);
        assert_eq!(look(&mut files, &[41]), []);
    }
}
