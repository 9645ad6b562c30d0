//! The pages of docs/reference/, docs/names.md and the schemas of docs/schema/ are generated from the code. Regenerate
//! with `TREFOIL_WRITE_REFERENCE=1 cargo test -p launcher reference`.

mod command_line;
mod log;
mod names;
mod page;
mod scenario;
mod written;

use std::path::Path;

use crate::manual::Described;

/// Checks that the file at `path`, relative to the top of the repository, has this `text`; writes it first if
/// `TREFOIL_WRITE_REFERENCE` is set.
fn is_generated(path: &str, text: &str) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    if std::env::var_os("TREFOIL_WRITE_REFERENCE").is_some() {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, text).unwrap();
    }
    let written = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        written == text,
        "{path} is not what the code gives: TREFOIL_WRITE_REFERENCE=1 cargo test -p launcher reference"
    );
}

#[test]
fn the_schemas_are_generated() {
    for (name, of) in [("scenario", Described::Scenario), ("campaign", Described::Campaign), ("run", Described::Run)] {
        is_generated(&format!("docs/schema/{name}.json"), &of.schema());
    }
}
