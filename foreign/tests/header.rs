//! `trefoil.h` and the page of its types are generated from `src/abi.rs`.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use quote::ToTokens;
use syn::{Attribute, Expr, ExprLit, Item, ItemStruct, Lit, Meta, Type};

fn in_crate(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Checks that the file at `path` has this text. Regenerate the file with
/// `TREFOIL_WRITE_HEADER=1 cargo test --workspace --test header`.
fn is_generated(path: &str, text: &str) {
    if std::env::var_os("TREFOIL_WRITE_HEADER").is_some() {
        std::fs::write(in_crate(path), text).expect("the file can be written");
    }
    let written = std::fs::read_to_string(in_crate(path)).expect("the generated file");
    assert!(written == text, "{path} is not what src/abi.rs gives");
}

#[test]
fn the_header_is_generated_from_the_types() {
    let config = cbindgen::Config::from_file(in_crate("cbindgen.toml")).expect("cbindgen.toml");
    let bindings = cbindgen::Builder::new().with_config(config).with_src(in_crate("src/abi.rs")).generate();
    let mut text = vec![];
    bindings.expect("the types have a form in C").write(&mut text);
    let text = String::from_utf8(text).expect("a header is text").replace("\\[", "[").replace("\\]", "]");
    is_generated("include/trefoil.h", &text);
}

/// Beginning of the page.
const PAGE: &str = "# Types of `trefoil.h`\n
This page is for users whose controller is a library: every field that a node gets and gives, with its unit and frame.
It is generated from [`abi.rs`](../foreign/src/abi.rs); a test compares. [`controllers.md`](controllers.md) says how the
types are used. World frame: north, east, down. Body frame: forward, right, down. SI units and radians.\n";

#[test]
fn the_page_of_types_is_generated_from_the_types() {
    let source = std::fs::read_to_string(in_crate("src/abi.rs")).expect("src/abi.rs");
    let mut page = PAGE.to_owned();
    for item in syn::parse_file(&source).expect("Rust").items {
        if let Item::Struct(item) = item {
            describe(&mut page, &item);
        }
    }
    assert!(page.matches("\n## ").count() > 8, "the types are found");
    let header = std::fs::read_to_string(in_crate("include/trefoil.h")).expect("trefoil.h");
    for row in page.lines().filter(|row| row.contains("| double[")) {
        let [name, lengths] = row.split(" | ").take(2).collect::<Vec<_>>().try_into().expect("name and type");
        let declared = format!("{name}{};", &lengths["double".len()..]).replace("| `", " ").replace('`', "");
        assert!(header.contains(&declared), "trefoil.h has no `{declared}`");
    }
    is_generated("../docs/controllers-reference.md", &page);
}

/// Adds a section with a row for each field of a type.
fn describe(page: &mut String, item: &ItemStruct) {
    let written =
        writeln!(page, "\n## {}\n\n{}\n\n| field | type | meaning |\n|---|---|---|", item.ident, doc(&item.attrs));
    written.expect("a string grows");
    for field in &item.fields {
        let name = field.ident.as_ref().expect("a field has a name");
        let row = writeln!(page, "| `{name}` | {} | {} |", in_c(&field.ty), doc(&field.attrs));
        row.expect("a string grows");
    }
}

/// Returns the text of the doc comment as one line.
fn doc(attributes: &[Attribute]) -> String {
    let line = |attribute: &Attribute| {
        let Meta::NameValue(meta) = &attribute.meta else { return None };
        let Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) = &meta.value else { return None };
        meta.path.is_ident("doc").then(|| text.value().trim().replace('|', "\\|"))
    };
    attributes.iter().filter_map(line).collect::<Vec<_>>().join(" ")
}

/// Returns the form of a type in C; a type of `trefoil.h` is a link to its section.
fn in_c(of: &Type) -> String {
    match of {
        Type::Array(_) => {
            // The length of the outer array is the last in Rust, and the first in C.
            let (mut element, mut lengths) = (of, String::new());
            while let Type::Array(array) = element {
                write!(lengths, "[{}]", array.len.to_token_stream()).expect("a string grows");
                element = &array.elem;
            }
            in_c(element) + &lengths
        }
        Type::Ptr(_) => "const char \\*".into(),
        Type::Path(path) => {
            let name = path.path.segments.last().expect("a type has a name").ident.to_string();
            match name.as_str() {
                "f64" => "double".into(),
                "u64" => "uint64\\_t".into(),
                "u32" => "uint32\\_t".into(),
                "Option" => "function".into(),
                other => format!("[{other}](#{})", other.to_lowercase()),
            }
        }
        other => unreachable!("no type of the interface: {}", other.to_token_stream()),
    }
}
