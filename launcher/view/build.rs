//! Compiles the schema of scenes twice: to Rust types, and to the descriptor set for viewers.

#![expect(clippy::disallowed_macros, reason = "it is how a build script speaks to cargo")]

use std::path::PathBuf;
use std::{env, error::Error, fs};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=proto");
    let mut compiler = protox::Compiler::new(["proto"])?;
    compiler.include_imports(true).open_file("foxglove.proto")?;
    let descriptors = compiler.encode_file_descriptor_set();
    fs::write(PathBuf::from(env::var("OUT_DIR")?).join("foxglove.fds"), descriptors)?;
    compiler.include_source_info(true); // the comments of the schema become the docs of the types
    prost_build::Config::new().compile_well_known_types().compile_fds(compiler.file_descriptor_set())?;
    Ok(())
}
