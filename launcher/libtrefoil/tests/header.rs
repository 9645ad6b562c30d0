//! `trefoil_process.h` is what cbindgen makes of the exported functions, and compilers of C and C++ accept it.

use std::path::{Path, PathBuf};
use std::process::Command;

const SOURCES: [&str; 4] = ["src/sizes.rs", "src/process.rs", "src/plant.rs", "src/stepped.rs"];

fn include() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../foreign/include")
}

/// Drops the sections `# Safety`, which are for callers in Rust.
fn for_c(text: &str) -> String {
    let mut is_safety = false;
    let mut lines = vec![];
    for line in text.lines() {
        is_safety = line.trim_start().starts_with("//") && (is_safety || line.trim() == "// # Safety");
        if is_safety && lines.last().is_some_and(|last: &&str| last.trim() == "//") {
            lines.pop();
        }
        if !is_safety {
            lines.push(line);
        }
    }
    lines.join("\n") + "\n"
}

/// Regenerate the header with `TREFOIL_WRITE_HEADER=1 cargo test -p trefoil --test header`.
#[test]
fn the_header_is_generated_from_the_functions() {
    let crate_folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(crate_folder.join("cbindgen.toml")).expect("cbindgen.toml");
    let builder = SOURCES.iter().fold(cbindgen::Builder::new().with_config(config), |builder, source| {
        builder.with_src(crate_folder.join(source))
    });
    let mut text = vec![];
    builder.generate().expect("the functions have a form in C").write(&mut text);
    let text = for_c(&String::from_utf8(text).expect("a header is text"));
    let path = include().join("trefoil_process.h");
    if std::env::var_os("TREFOIL_WRITE_HEADER").is_some() {
        std::fs::write(&path, &text).expect("the header can be written");
    }
    let header = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(header == text, "include/trefoil_process.h is not what cbindgen makes of {SOURCES:?}");
}

#[test]
fn compilers_of_c_and_of_cpp_accept_the_header() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (compiler, source, standard) in [("cc", "header.c", "-std=c11"), ("c++", "header.cpp", "-std=c++17")] {
        let file = folder.path().join(source);
        std::fs::write(
            &file,
            "#include \"trefoil_process.h\"\nint main(void) { return trefoil_abi() != TREFOIL_ABI; }\n",
        )
        .expect("a file");
        let flags = [standard, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I"];
        let output = Command::new(compiler).args(flags).arg(include()).arg(&file).output().expect("a compiler");
        assert!(output.status.success(), "{compiler}: {}", String::from_utf8_lossy(&output.stderr));
    }
}
