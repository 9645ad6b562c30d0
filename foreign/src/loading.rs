//! Loading of a library, with the dependencies that it has in a process of its own.
//!
//! The loader identifies a dependency by its name only (SONAME), with or without `RTLD_LOCAL`. If two libraries each
//! bring a `libblasfeo.so.0`, the second gets the file of the first, and may answer otherwise in process than in
//! lockstep. Before a second library of a process is used, the loader is asked, in a process of its own (as `ldd`
//! does), which files the library would get alone. These are compared with the files that this process has.

#![expect(unsafe_code, reason = "code from other languages is loaded")]

use std::collections::BTreeSet;
use std::fs::{metadata, read_to_string};
use std::mem::ManuallyDrop;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use libloading::os::unix::{Library as Handle, RTLD_LOCAL, RTLD_NOW};

/// Libraries that this process has loaded.
static LOADED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
/// `true` in a program other than the launcher, which may have mapped files of any name before its first library.
static IS_OF_OTHERS: AtomicBool = AtomicBool::new(false);

/// Loads the library at `path`, which is never unloaded.
///
/// # Errors
/// The loader refuses it, or gives it another file for a dependency than in a process of its own.
pub fn load(path: &Path) -> Result<ManuallyDrop<Handle>, String> {
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner); // no other thread loads meanwhile
    let is_alone = loaded.is_empty() && !IS_OF_OTHERS.load(Ordering::Relaxed);
    // SAFETY: the code of the library runs here, and nothing can vouch for it. The user named it as the program of
    // a node, the launcher has tried it in a process of its own before, and a crash costs this process.
    let handle = unsafe { Handle::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(ManuallyDrop::new);
    if !is_alone && !loaded.contains(path) {
        as_alone(path, handle.is_ok())?; // reported before the loader's error, which may only name a missing function
    }
    let handle = handle.map_err(|error| match error {
        libloading::Error::DlOpen { source } => source.to_string(),
        other => other.to_string(),
    })?;
    loaded.insert(path.into());
    Ok(handle)
}

/// Marks this process as a program other than the launcher, so that all dependencies of its libraries are compared.
pub fn in_program_of_others() {
    IS_OF_OTHERS.store(true, Ordering::Relaxed);
}

/// Checks that the library at `path` has the dependencies here that it would have alone. If the loader has refused the
/// library, and so has not mapped all dependencies, only those count of which this process has a file of the same name.
fn as_alone(path: &Path, is_loaded: bool) -> Result<(), String> {
    let unknown = |why: String| format!("it cannot be found out which files it shares with other libraries: {why}");
    let mapped = mapped().map_err(|error| unknown(error.to_string()))?;
    let here: BTreeSet<(u64, u64)> = mapped.iter().filter_map(|file| identity(file)).collect();
    let alone = match resolved(&mapped, path) {
        Err(_) if !is_loaded => return Ok(()),
        alone => alone.map_err(unknown)?,
    };
    // The dependencies of the launcher itself, such as the C library, are present in every process of a node.
    let own = format!("/proc/{}/exe", std::process::id());
    let own = if IS_OF_OTHERS.load(Ordering::Relaxed) { Ok(vec![]) } else { resolved(&mapped, Path::new(&own)) };
    let own = own.map_err(unknown)?;
    for (name, file) in alone.iter().filter(|(name, _)| own.iter().all(|(own, _)| own != name)) {
        if identity(file).is_some_and(|file| here.contains(&file)) {
            continue;
        }
        let has_name = |file: &&PathBuf| file.file_name().is_some_and(|own| own.to_string_lossy().starts_with(name));
        let other = match mapped.iter().find(has_name) {
            Some(other) => other.display().to_string(),
            None if is_loaded => "another file".into(),
            None => continue,
        };
        let file = file.display();
        return Err(format!(
            "it needs `{name}`, which alone would be {file}, and this process has {other} under that name from another \
             library, which the loader gives to both: fly in lockstep or real time, where each library has a process of \
             its own (in a replay, name one of them only), or link both with one file of that name"
        ));
    }
    Ok(())
}

/// Returns the files that this process has mapped; a file that was replaced meanwhile has a name that does not exist.
fn mapped() -> std::io::Result<BTreeSet<PathBuf>> {
    let maps = read_to_string("/proc/self/maps")?;
    Ok(maps.lines().filter_map(|line| line.find('/').map(|at| line[at..].into())).collect())
}

/// Returns device and inode of a file; `None` if it does not exist.
fn identity(file: &Path) -> Option<(u64, u64)> {
    metadata(file).ok().map(|file| (file.dev(), file.ino()))
}

/// Asks the loader, which is among the `mapped` files, for all dependencies of `file` alone: the name of each, and its
/// file.
fn resolved(mapped: &BTreeSet<PathBuf>, file: &Path) -> Result<Vec<(String, PathBuf)>, String> {
    let is_loader = |file: &&PathBuf| file.file_name().is_some_and(|name| name.to_string_lossy().starts_with("ld-"));
    let loader = mapped.iter().find(is_loader).ok_or("this process has no loader")?;
    let asked = Command::new(loader).arg("--list").arg(file).stdin(Stdio::null()).output();
    let asked = asked.map_err(|error| format!("{}: {error}", loader.display()))?;
    if !asked.status.success() {
        return Err(String::from_utf8_lossy(&asked.stderr).trim().into());
    }
    let lines = String::from_utf8_lossy(&asked.stdout);
    let dependencies = lines.lines().filter_map(|line| line.trim().split_once(" => "));
    let found = |found: &str| PathBuf::from(found.rsplit_once(" (").map_or(found, |(file, _)| file));
    Ok(dependencies.map(|(name, file)| (name.to_owned(), found(file))).collect())
}
