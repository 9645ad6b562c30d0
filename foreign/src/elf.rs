//! Contents of a library's file: its length, and the names that it exports.

use std::collections::BTreeSet;
use std::path::Path;

use object::elf::{FileHeader64, PT_LOAD};
use object::read::elf::{ElfFile64, FileHeader, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol};

/// Checks that the file at `path` is as long as its segments. The loader of the system maps a file that was cut short
/// without an error, and the first access beyond the file's end is a crash that does not name the file.
///
/// # Errors
/// The file is shorter.
pub fn check_length(path: &Path) -> Result<(), String> {
    let Ok(bytes) = std::fs::read(path) else { return Ok(()) }; // the loader reports the reason
    let length = bytes.len() as u64;
    match needed_bytes(&bytes) {
        Some(needed) if needed > length => Err(format!(
            "its file is cut short: it has {length} byte, and its segments need {needed}; build or copy it again"
        )),
        _ => Ok(()),
    }
}

/// Returns the number of bytes up to the end of the last segment; `None` if the file is no ELF file of 64 bit, which is
/// left to the loader.
fn needed_bytes(bytes: &[u8]) -> Option<u64> {
    let header = FileHeader64::<Endianness>::parse(bytes).ok()?;
    let endian = header.endian().ok()?;
    let table_bytes = u64::from(header.e_phentsize(endian)) * u64::from(header.e_phnum(endian));
    let table_end = header.e_phoff(endian).checked_add(table_bytes)?;
    let segments = header.program_headers(endian, bytes).unwrap_or_default(); // empty if the table is cut off
    let loaded = segments.iter().filter(|segment| segment.p_type(endian) == PT_LOAD);
    let ends = loaded.filter_map(|segment| segment.p_offset(endian).checked_add(segment.p_filesz(endian)));
    Some(ends.fold(table_end, u64::max))
}

/// Returns the names that the library of these `bytes` exports. The names are read from its dynamic symbol table: in a
/// search of its strings, `law_n_in` could be missed, which the linker may keep as the tail of `jac_law_n_in`.
pub fn exported(bytes: &[u8]) -> object::Result<BTreeSet<&str>> {
    let file = ElfFile64::<Endianness>::parse(bytes)?;
    Ok(file.dynamic_symbols().filter(ObjectSymbol::is_definition).filter_map(|symbol| symbol.name().ok()).collect())
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
        let needed = needed_bytes(&whole).unwrap() as usize;
        for length in [whole.len(), needed] {
            assert_eq!(checked(&whole[..length]), Ok(()), "{length} of {}", whole.len());
        }
        for length in [64, 164, 5000, needed - 1] {
            assert!(checked(&whole[..length]).unwrap_err().contains("cut short"), "{length}");
        }
        for other in [&b""[..], b"no library", &[0x7f; 200]] {
            assert_eq!(checked(other), Ok(()));
        }
    }
}
