//! Compiles the flight log's schema twice: to Rust types, and to the descriptor set that every log carries.

#![expect(clippy::disallowed_macros, reason = "it is how a build script speaks to cargo")]

use std::{env, error::Error, fs, path::Path};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=proto");
    let mut compiler = protox::Compiler::new(["proto"])?;
    compiler.open_file("trefoil.proto")?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("trefoil.fds"), compiler.encode_file_descriptor_set())?;
    compiler.include_source_info(true); // the comments of the schema become the docs of the types
    prost_build::Config::new().compile_fds(compiler.file_descriptor_set())?;
    Ok(())
}
