//! `--controller NAME=FILE`: a controller of the user, flown beside those of a campaign.

use std::path::{Path, PathBuf, absolute};
use std::str::FromStr;

use anyhow::ensure;
use contract::topic::Topic;
use toml::{Table, Value};

use crate::named::Named;

/// Attitude controller in a library or program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnController {
    pub name: String,
    /// File as on the command line, relative to the folder in which the launcher was started.
    pub file: PathBuf,
}

impl FromStr for OwnController {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').filter(|(name, file)| !name.is_empty() && !file.is_empty());
        let (name, file) = parts.ok_or("give NAME=FILE, for instance mine=./my.so")?;
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if !name.chars().all(is_plain) {
            return Err(format!("the name {name:?} may have letters, digits, - and _"));
        }
        Ok(Self { name: name.into(), file: file.into() })
    }
}

impl OwnController {
    /// Returns the path of the file, absolute.
    pub fn path(&self) -> PathBuf {
        absolute(&self.file).unwrap_or_else(|_| self.file.clone())
    }

    /// Returns the argument `NAME=FILE`, as on the command line.
    pub fn argument(&self) -> String {
        format!("--controller {}={}", self.name, self.file.display())
    }

    /// Adds controllers to those of a campaign file. If the file has none, its own flights are flown too, as controller
    /// `ours`.
    ///
    /// # Errors
    /// Two controllers have the same name.
    pub fn add_all(own: &[Self], to: &mut Named, ours: &str) -> anyhow::Result<()> {
        if to.is_empty() && !own.is_empty() {
            to.0.push((ours.into(), Table::new()));
        }
        for controller in own {
            let name = &controller.name;
            let is_twice = to.0.iter().any(|(other, _)| other == name);
            ensure!(!is_twice, "--controller {name}: the campaign has a controller of this name; give yours another");
            to.0.push((name.clone(), settings(&controller.path())));
        }
        Ok(())
    }
}

/// Makes the settings of a controller: `node.attitude-mpc.exec`.
fn settings(file: &Path) -> Table {
    let table = |key: &str, value: Value| Table::from_iter([(key.to_owned(), value)]);
    let program = table("exec", file.to_string_lossy().into_owned().into());
    table("node", table(Topic::Controls.publisher(), program.into()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_controller_needs_a_name_and_a_file() {
        let mine: OwnController = "mine=./my.so".parse().unwrap();
        assert_eq!((mine.name.as_str(), mine.file.as_path()), ("mine", Path::new("./my.so")));
        for text in ["", "mine", "=my.so", "mine=", "a b=my.so", "a.b=my.so"] {
            assert!(text.parse::<OwnController>().is_err(), "{text}");
        }
    }
}
