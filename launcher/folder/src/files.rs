//! Files by their paths: each file is accessed through its folder, which is held open meanwhile ([`Dir`]). A file is
//! written completely or not at all, never through a link and never into a device.

use std::fs::File;
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};

use crate::dir::Dir;

/// Writes a file completely or not at all: a temporary file replaces `path` at the end.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let (folder, name) = split(path).with_context(|| format!("cannot write {}", path.display()))?;
    folder.write_whole(name, bytes)
}

/// Returns the path of the file that a user named with `--out`; adds `suffix` if `out` has none and nothing has this
/// name.
///
/// # Errors
/// The path has a file already, which may be the very log that is read, or work of another program.
pub fn named_file(out: &Path, suffix: &str) -> anyhow::Result<PathBuf> {
    let is_bare = out.file_name().is_some() && out.extension().is_none() && out.symlink_metadata().is_err();
    let path = if is_bare { out.with_extension(suffix) } else { out.to_owned() };
    ensure!(!path.is_file(), "{} is there already: name another with --out, or remove it", path.display());
    Ok(path)
}

/// Returns the path of the folder that a user named with `--out`; an error if anything is in it.
pub fn named_folder(out: &Path) -> anyhow::Result<PathBuf> {
    let is_empty = std::fs::read_dir(out).map_or(true, |mut entries| entries.next().is_none());
    ensure!(is_empty, "the folder {} is not empty: name another with --out", out.display());
    Ok(out.to_owned())
}

/// Opens a file of a run or a campaign, and returns it with its size; an error if it has more than `limit` bytes.
pub fn open(path: &Path, limit: u64) -> Result<(File, u64)> {
    let (folder, name) = split(path)?;
    folder.file(name, limit)
}

/// Reads the text of a file of a run or a campaign; an error if it has more than `limit` bytes.
pub fn read_text(path: &Path, limit: u64) -> Result<String> {
    let (folder, name) = split(path)?;
    folder.read_text(name, limit)
}

/// Opens a file and empties it, for writing; creates it if nothing has the name.
pub fn create(path: &Path) -> Result<File> {
    let (folder, name) = split(path)?;
    folder.create(name)
}

/// Opens the folder of a path, and returns the folder and the file name; an error if the path has no file name.
fn split(path: &Path) -> Result<(Dir, &Path)> {
    let no_name = || Error::new(ErrorKind::IsADirectory, "it is a directory; give a regular file");
    let name = path.file_name().ok_or_else(no_name)?;
    Ok((Dir::open(path.parent().unwrap_or(Path::new("")))?, Path::new(name)))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    fn said(path: &Path) -> String {
        format!("{:#}", write_whole(path, b"new").expect_err("refused"))
    }

    #[test]
    fn only_a_regular_file_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write_whole(&at("file"), b"old").unwrap();
        write_whole(&at("file"), b"new").unwrap();
        assert_eq!(fs::read(at("file")).unwrap(), b"new");

        fs::write(at("precious"), "precious").unwrap();
        symlink(at("precious"), at("link")).unwrap();
        fs::create_dir(at("folder")).unwrap();
        for (name, expected) in [("link", "it is a link"), ("folder", "it is a directory")] {
            assert!(said(&at(name)).contains(expected), "{name}");
        }
        assert!(said(Path::new("/dev/null")).contains("it is a device"));
        assert_eq!(fs::read(at("precious")).unwrap(), b"precious");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4, "no parts are left");
    }

    #[test]
    fn an_output_that_a_user_names_gets_its_suffix_and_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("empty")).unwrap();
        for (name, path) in [("page", "page.html"), ("page.htm", "page.htm"), ("empty", "empty")] {
            assert_eq!(named_file(&at(name), "html").unwrap(), at(path));
        }
        assert_eq!([named_folder(&at("empty")).unwrap(), named_folder(&at("new")).unwrap()], [at("empty"), at("new")]);
        fs::write(at("page.html"), "mine").unwrap();
        for refused in
            [named_file(&at("page"), "html"), named_file(&at("page.html"), "csv"), named_folder(folder.path())]
        {
            assert!(refused.unwrap_err().to_string().contains("name another with --out"));
        }
    }

    #[test]
    fn a_link_with_the_name_of_a_temporary_file_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("precious"), "precious").unwrap();
        symlink(at("precious"), at("trace.part")).unwrap();
        write_whole(&at("trace.json"), b"new").unwrap();
        assert_eq!(fs::read(at("precious")).unwrap(), b"precious");
    }

    #[test]
    fn a_write_error_names_its_cause_once() {
        let folder = tempfile::tempdir().unwrap();
        let text = said(&folder.path().join("none/file"));
        assert_eq!(text.matches("No such file").count(), 1, "{text}");
    }
}
