//! `trefoil.h` is what cbindgen makes of `src/abi.rs`.

use std::path::Path;

/// Regenerate with `TREFOIL_WRITE_HEADER=1 cargo test -p foreign --test header`.
#[test]
fn the_header_is_generated_from_the_types() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(crate_folder.join("cbindgen.toml")).expect("cbindgen.toml");
    let bindings = cbindgen::Builder::new().with_config(config).with_src(crate_folder.join("src/abi.rs")).generate();
    let mut text = vec![];
    bindings.expect("the types have a form in C").write(&mut text);
    let text = String::from_utf8(text).expect("a header is text").replace("\\[", "[").replace("\\]", "]");
    let path = crate_folder.join("include/trefoil.h");
    if std::env::var_os("TREFOIL_WRITE_HEADER").is_some() {
        std::fs::write(&path, &text).expect("the header can be written");
    }
    let header = std::fs::read_to_string(&path).expect("include/trefoil.h");
    assert!(header == text, "include/trefoil.h is not what cbindgen makes of src/abi.rs");
}
