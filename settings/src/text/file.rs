//! Reading of files that come from outside: only regular files of limited size, which never block.
//!
//! A FIFO without a writer, a terminal or `/dev/zero` in the place of a scenario or a log would otherwise block the
//! program or fill its memory.

use std::fs::{File, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result};
#[cfg(target_os = "linux")]
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::Path;

#[cfg(target_os = "linux")]
use rustix::fs::OFlags;

/// Largest scenario or settings file \[bytes\], more than people write.
pub const MAX_TEXT_BYTES: u64 = 1 << 20;
/// Largest run.json or other file of results \[bytes\].
pub const MAX_RESULTS_BYTES: u64 = 64 << 20;
/// Largest flight log \[bytes\]: a day at 100 Hz takes a third of it.
pub const MAX_LOG_BYTES: u64 = 64 << 30;

/// Opens the regular file at `path` without ever waiting, and returns it with its length, at most `limit` bytes.
pub fn open(path: &Path, limit: u64) -> Result<(File, u64)> {
    let mut options = OpenOptions::new();
    // std adds O_CLOEXEC. O_NONBLOCK means nothing to a regular file, and keeps the open of a FIFO from waiting.
    #[cfg(target_os = "linux")]
    options.custom_flags((OFlags::NONBLOCK | OFlags::NOCTTY).bits().cast_signed());
    checked(options.read(true).open(path)?, limit)
}

/// Refuses a file that is not regular, or has more than `limit` bytes; otherwise returns it with its length.
pub fn checked(file: File, limit: u64) -> Result<(File, u64)> {
    let metadata = file.metadata()?;
    let kind = metadata.file_type();
    if !kind.is_file() {
        let what = match () {
            () if kind.is_dir() => "a directory",
            #[cfg(target_os = "linux")]
            () if kind.is_fifo() => "a FIFO",
            #[cfg(target_os = "linux")]
            () if kind.is_char_device() || kind.is_block_device() => "a device",
            () => "of another kind",
        };
        return Err(Error::new(ErrorKind::InvalidInput, format!("it is {what}; give a regular file")));
    }
    if metadata.len() > limit { Err(too_large(metadata.len(), limit)) } else { Ok((file, metadata.len())) }
}

/// Reads the regular file at `path`; more than `limit` bytes are an error.
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    read_all(open(path, limit)?, limit)
}

/// Reads an open file of the given length; more than `limit` bytes are an error, also if the file grows meanwhile.
pub fn read_all((file, length): (File, u64), limit: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::with_capacity(length as usize);
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(too_large(bytes.len() as u64, limit)) } else { Ok(bytes) }
}

/// Reads the regular file at `path` as UTF-8; more than `limit` bytes are an error.
pub fn read_text(path: &Path, limit: u64) -> Result<String> {
    text(read(path, limit)?)
}

/// Converts the bytes of a file to text; bytes that are not UTF-8 are an error.
pub fn text(bytes: Vec<u8>) -> Result<String> {
    String::from_utf8(bytes).map_err(|error| Error::new(ErrorKind::InvalidData, error.utf8_error()))
}

fn too_large(bytes: u64, limit: u64) -> Error {
    let why = format!("it has {bytes} bytes, and {limit} are the most that is read");
    Error::new(ErrorKind::FileTooLarge, why)
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn only_regular_files_within_the_limit_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("text"), "12345").unwrap();
        rustix::fs::mkfifoat(rustix::fs::CWD, at("fifo"), rustix::fs::Mode::RUSR).unwrap();
        let _socket = UnixListener::bind(at("socket")).unwrap();
        std::os::unix::fs::symlink(at("text"), at("link")).unwrap();

        assert_eq!(read(&at("text"), 5).unwrap(), b"12345");
        assert_eq!(read_text(&at("link"), 5).unwrap(), "12345");
        let refused = |path: &Path, limit| read(path, limit).unwrap_err().to_string();
        assert!(refused(&at("text"), 4).contains("it has 5 bytes, and 4 are the most"));
        assert!(refused(&at("fifo"), 9).contains("it is a FIFO"));
        assert!(refused(folder.path(), 9).contains("it is a directory"));
        assert!(refused(Path::new("/dev/zero"), 9).contains("it is a device"));
        assert!(read(&at("socket"), 9).is_err() && read(&at("none"), 9).is_err());
    }
}
