//! Files that are written whole or not at all, never through a link and never into a device.

use std::fs::{self, Permissions};
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use anyhow::{Context, ensure};

/// Writes a file whole or not at all: under another name, which takes the place of `path` at the end.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let write = || {
        check_target(path)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut part = tempfile::Builder::new();
        let mode = Permissions::from_mode(0o666); // of which the umask takes its share
        let mut part = part.prefix(".").suffix(".part").permissions(mode).tempfile_in(folder)?;
        part.write_all(bytes)?;
        part.as_file().sync_all()?;
        part.persist(path).map_err(|failed| failed.error)?;
        anyhow::Ok(())
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

/// Refuses a `path` at which there is something else than a regular file.
pub fn check_target(path: &Path) -> anyhow::Result<()> {
    let is_other = fs::symlink_metadata(path).is_ok_and(|found| !found.is_file());
    ensure!(!is_other, "there is a link, a folder or a device, and only a regular file is replaced");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn said(path: &Path) -> String {
        format!("{:#}", write_whole(path, b"new").expect_err("refused"))
    }

    #[test]
    fn a_file_is_replaced_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write_whole(&at("file"), b"old").unwrap();
        write_whole(&at("file"), b"new").unwrap();
        assert_eq!(fs::read(at("file")).unwrap(), b"new");

        fs::write(at("precious"), "precious").unwrap();
        symlink(at("precious"), at("link")).unwrap();
        fs::create_dir(at("folder")).unwrap();
        for name in ["link", "folder"] {
            assert!(said(&at(name)).contains("only a regular file is replaced"), "{name}");
        }
        assert!(said(Path::new("/dev/null")).contains("only a regular file is replaced"));
        assert_eq!(fs::read(at("precious")).unwrap(), b"precious");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 4, "no parts are left");
    }

    #[test]
    fn a_part_that_somebody_has_laid_out_is_not_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("precious"), "precious").unwrap();
        symlink(at("precious"), at("trace.part")).unwrap();
        write_whole(&at("trace.json"), b"new").unwrap();
        assert_eq!(fs::read(at("precious")).unwrap(), b"precious");
    }

    #[test]
    fn what_cannot_be_written_is_told_once() {
        let folder = tempfile::tempdir().unwrap();
        let text = said(&folder.path().join("none/file"));
        assert_eq!(text.matches("No such file").count(), 1, "{text}");
    }
}
