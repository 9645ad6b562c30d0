//! Collects the shipped scenarios and campaigns.

#![expect(clippy::disallowed_macros, reason = "it is how a build script speaks to cargo")]

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, error::Error, fs};

fn main() -> Result<(), Box<dyn Error>> {
    fs::write(PathBuf::from(env::var("OUT_DIR")?).join("shipped.rs"), shipped()?)?;
    Ok(())
}

/// Returns the list of the shipped files as Rust: paths from the top of the repository, and texts.
fn shipped() -> Result<String, Box<dyn Error>> {
    let top = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("../..").canonicalize()?;
    let mut files = vec![];
    for folder in ["scenarios", "campaigns"] {
        println!("cargo::rerun-if-changed={}", top.join(folder).display());
        collect(&top.join(folder), &mut files)?;
    }
    files.sort();
    let mut list = "static FILES: &[(&str, &str)] = &[\n".to_owned();
    for file in files {
        let path = file.strip_prefix(&top)?.display().to_string();
        writeln!(list, "    ({path:?}, include_str!({:?})),", file.display().to_string())?;
    }
    Ok(list + "];\n")
}

/// Collects the TOML files in `folder` and the folders in it.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path.extension().is_some_and(|ending| ending == "toml") {
            files.push(path);
        }
    }
    Ok(())
}
