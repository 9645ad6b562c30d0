//! Compiles the schemas in `proto/` twice: to Rust types, and to the descriptor sets that logs carry. `view` uses
//! this script too.

#![expect(clippy::disallowed_macros, reason = "it is how a build script speaks to cargo")]

use std::path::PathBuf;
use std::{env, error::Error, fs};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=proto");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    for schema in fs::read_dir("proto")? {
        let schema = PathBuf::from(schema?.file_name());
        let mut compiler = protox::Compiler::new(["proto"])?;
        compiler.include_imports(true).open_file(&schema)?;
        fs::write(out.join(schema.with_extension("fds")), compiler.encode_file_descriptor_set())?;
        compiler.include_source_info(true); // the comments of the schema become the docs of the types
        prost_build::Config::new().compile_well_known_types().compile_fds(compiler.file_descriptor_set())?;
    }
    Ok(())
}
