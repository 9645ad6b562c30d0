//! Files in which the kernel shows the state of the machine.

use std::fs;
use std::path::{Path, PathBuf};

/// Bit of the capability to change the scheduling class, in `CapEff`.
pub const CAP_SYS_NICE: u32 = 23;
/// Bit of the capability to lock memory beyond the limit, in `CapEff`.
pub const CAP_IPC_LOCK: u32 = 14;

/// Machine whose files lie below a root folder, which is `/` except in tests.
#[derive(Debug, Clone)]
pub struct Machine {
    root: PathBuf,
}

/// Limit on a resource of this process; a field that is `None` is unlimited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResourceLimit {
    /// Limit in force.
    pub soft: Option<u64>,
    /// Limit up to which the process itself may raise the limit in force.
    pub hard: Option<u64>,
}

impl Machine {
    /// Returns the machine that this program runs on.
    pub fn this() -> Self {
        Self::below("/")
    }

    /// Returns the machine whose files lie below `root`.
    pub fn below(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// Path of a file, which is given without a slash at its beginning.
    pub fn path(&self, path: impl AsRef<Path>) -> PathBuf {
        self.root.join(path)
    }

    /// Reads the text of a file, without blanks at its ends; `None` if the file cannot be read.
    pub fn text(&self, path: impl AsRef<Path>) -> Option<String> {
        Some(String::from_utf8_lossy(&self.bytes(path)?).trim().to_owned())
    }

    /// Reads a file that holds a number; `None` if it cannot be read, or holds anything else.
    pub fn number(&self, path: impl AsRef<Path>) -> Option<i64> {
        self.text(path)?.parse().ok()
    }

    /// Reads the bytes of a file; `None` if it cannot be read.
    pub fn bytes(&self, path: impl AsRef<Path>) -> Option<Vec<u8>> {
        fs::read(self.path(path)).ok()
    }

    /// Lists the entries of a folder whose names are `prefix` and a number, by number; empty if the folder cannot be
    /// read.
    pub fn numbered(&self, folder: &str, prefix: &str) -> Vec<(usize, PathBuf)> {
        let entries = fs::read_dir(self.path(folder)).into_iter().flatten().flatten();
        let number = |entry: &fs::DirEntry| entry.file_name().to_str()?.strip_prefix(prefix)?.parse().ok();
        let mut found: Vec<_> = entries.filter_map(|entry| Some((number(&entry)?, entry.path()))).collect();
        found.sort();
        found
    }

    /// Returns a limit of this process by its name in `/proc/self/limits`; `None` if the limit cannot be read.
    pub fn limit(&self, name: &str) -> Option<ResourceLimit> {
        let text = self.text("proc/self/limits")?;
        let mut words = text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace();
        let mut value = || match words.next()? {
            "unlimited" => Some(None),
            number => Some(Some(number.parse().ok()?)),
        };
        Some(ResourceLimit { soft: value()?, hard: value()? })
    }

    /// Returns the first word of a field of `/proc/self/status`; `name` ends with its colon. `None` if the field cannot
    /// be read.
    pub fn status(&self, name: &str) -> Option<String> {
        let text = self.text("proc/self/status")?;
        text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next().map(str::to_owned)
    }

    /// Returns whether this process has the capability at the bit `place`; `None` if the capabilities cannot be read.
    /// In a user namespace a process has none that counts: the kernel asks for capabilities in the initial namespace.
    pub fn has_capability(&self, place: u32) -> Option<bool> {
        let effective = u64::from_str_radix(&self.status("CapEff:")?, 16).ok()?;
        let map = self.text("proc/self/uid_map")?;
        let is_system = map.split_whitespace().eq(["0", "0", "4294967295"]);
        Some(is_system && effective & (1 << place) != 0)
    }

    /// Lists the processors that this process may use; `None` if the list cannot be read.
    pub fn allowed_cpus(&self) -> Option<Vec<usize>> {
        cpu_list(&self.status("Cpus_allowed_list:")?)
    }
}

/// Parses a list of processors in the kernel's form, such as `0-3,8`; `None` if `text` is not such a list.
pub fn cpu_list(text: &str) -> Option<Vec<usize>> {
    let range = |range: &str| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        Some(first.parse::<usize>().ok()?..=last.parse().ok()?)
    };
    let ranges = text.split(',').map(str::trim).filter(|part| !part.is_empty()).map(range);
    Some(ranges.collect::<Option<Vec<_>>>()?.into_iter().flatten().collect())
}
