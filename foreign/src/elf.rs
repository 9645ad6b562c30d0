//! Length of a library's file. The loader of the system maps a file that was cut short without an error, and the first
//! access beyond its end is a crash that says nothing of the file.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Beginning of the files that are looked at: ELF, 64 bit, least byte first. Others are left to the loader.
const ELF64: &[u8] = b"\x7fELF\x02\x01";
/// Length of the header \[byte\].
const HEADER_BYTES: usize = 64;
/// Length of the header of a segment \[byte\], and its type if the segment is loaded.
const SEGMENT_BYTES: usize = 56;
const LOADED: u64 = 1;

/// Checks that the file at `path` is as long as its segments.
///
/// # Errors
/// It is shorter.
pub fn check_length(path: &Path) -> Result<(), String> {
    let Ok(file) = File::open(path) else { return Ok(()) }; // the loader says why
    let length = file.metadata().map_or(u64::MAX, |metadata| metadata.len());
    match needed_bytes(&file) {
        Some(needed) if needed > length => Err(format!(
            "its file is cut short: it has {length} byte, and its segments need {needed}; build or copy it again"
        )),
        _ => Ok(()),
    }
}

/// Returns the number of bytes up to the end of the last segment; `None` if the file is no ELF file of this kind.
fn needed_bytes(file: &File) -> Option<u64> {
    let mut header = [0; HEADER_BYTES];
    file.read_exact_at(&mut header, 0).ok()?;
    let (segments, size, count) = (number(&header, 32, 8)?, number(&header, 54, 2)?, number(&header, 56, 2)?);
    if !header.starts_with(ELF64) || size != SEGMENT_BYTES as u64 {
        return None;
    }
    let mut needed = segments.checked_add(size * count)?;
    for i in 0..count {
        let mut segment = [0; SEGMENT_BYTES];
        if file.read_exact_at(&mut segment, segments + i * size).is_err() {
            break; // the table itself is cut off
        }
        if number(&segment, 0, 4)? == LOADED {
            needed = needed.max(number(&segment, 8, 8)?.checked_add(number(&segment, 32, 8)?)?);
        }
    }
    Some(needed)
}

/// Reads the number of `length` bytes at `at`, least byte first.
fn number(bytes: &[u8], at: usize, length: usize) -> Option<u64> {
    let bytes = bytes.get(at..at + length)?;
    Some(bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_whole_or_cut_short_and_other_files_are_left_to_the_loader() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let whole = std::fs::read("/proc/self/exe").unwrap();
        let checked = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            check_length(&path)
        };
        let needed = needed_bytes(&File::open("/proc/self/exe").unwrap()).unwrap() as usize;
        for length in [whole.len(), needed] {
            assert_eq!(checked(&whole[..length]), Ok(()), "{length} of {}", whole.len());
        }
        for length in [HEADER_BYTES, HEADER_BYTES + 100, 5000, needed - 1] {
            assert!(checked(&whole[..length]).unwrap_err().contains("cut short"), "{length}");
        }
        for other in [&b""[..], b"no library", &[0x7f; 200]] {
            assert_eq!(checked(other), Ok(()));
        }
    }
}
