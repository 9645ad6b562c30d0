//! Files of every template, part of the launcher's program.
//!
//! In a file `@NODE@` stands for the name of the node, `@EXEC@` for its program, `@ABOUT@` for the text of the template.

use clap::ValueEnum;

use super::model::Model;

/// Language, or tool that generates C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// C: a library by trefoil.h
    C,
    /// C++: a library by trefoil.h
    Cpp,
    /// C from `CasADi`, by its own names
    Casadi,
    /// C from acados, with a shim on trefoil.h
    Acados,
    /// C of Simulink Coder, with a shim on trefoil.h
    Simulink,
    /// Python: a program
    Python,
    /// Rust: a library by trefoil.h
    Rust,
}

/// Node that a controller flies as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Node {
    /// Trajectory to attitude and vertical velocity
    Guidance,
    /// Attitude and vertical velocity to forces and moments
    AttitudeMpc,
    /// Forces and moments to rotor speeds and tilt
    Mixer,
}

/// File of a template: its path in the new folder, and its text.
pub type File = (&'static str, String);

/// Reads a file of the templates when the launcher is built.
macro_rules! template {
    ($path:literal) => {
        include_str!(concat!("../../templates/", $path)).to_owned()
    };
}

/// Types of `trefoil.h` in Rust, without those derived traits that need another crate.
fn types_in_rust() -> String {
    let types = include_str!("../../../foreign/src/abi.rs");
    types.replace("use bytemuck::{Pod, Zeroable};\n\n", "").replace(", Pod, Zeroable", "").replace("pub(crate)", "pub")
}

/// Template of a controller: the file that flies, what its README says, and its files.
pub struct Template {
    /// Program of the node in `scenario.toml`, for a replay; the build makes it.
    pub exec: &'static str,
    about: &'static str,
    files: Vec<File>,
}

impl Template {
    /// Finds the template of `node` in `language`, and puts the `model` into it; `None` if there is none.
    pub fn find(language: Language, node: Node, model: &Model) -> Option<Self> {
        let of = |exec, about, files: Vec<File>| Some(Self { exec, about, files });
        let library = |about, files: Vec<File>| of("controller.so", about, files);
        let scenario = || ("scenario.toml", template!("common/scenario.toml"));
        let header = || ("trefoil.h", include_str!("../../../foreign/include/trefoil.h").to_owned());
        let model_h = || ("model.h", model.c());
        let model_json = || ("model.json", model.json());
        let lqr_h = || ("lqr.h", template!("common/lqr.h"));
        let test_c = || ("test_controller.c", template!("common/test_attitude.c"));
        match (language, node) {
            (Language::C, Node::AttitudeMpc) => library(
                include_str!("../../templates/c/attitude-mpc.md"),
                vec![
                    ("controller.c", template!("c/attitude-mpc.c")),
                    ("Makefile", template!("c/Makefile")),
                    scenario(),
                    header(),
                    model_h(),
                    lqr_h(),
                    test_c(),
                ],
            ),
            (Language::C, Node::Guidance) => library(
                include_str!("../../templates/c/guidance.md"),
                vec![
                    ("controller.c", template!("c/guidance.c")),
                    ("test_controller.c", template!("c/test_guidance.c")),
                    ("Makefile", template!("c/Makefile")),
                    ("scenario.toml", template!("c/guidance.toml")),
                    header(),
                ],
            ),
            (Language::C, Node::Mixer) => library(
                include_str!("../../templates/c/mixer.md"),
                vec![
                    ("controller.c", template!("c/mixer.c")),
                    ("test_controller.c", template!("c/test_mixer.c")),
                    ("Makefile", template!("c/Makefile")),
                    scenario(),
                    header(),
                    model_h(),
                ],
            ),
            (Language::Cpp, Node::AttitudeMpc) => library(
                include_str!("../../templates/cpp/about.md"),
                vec![
                    ("controller.cpp", template!("cpp/controller.cpp")),
                    ("Makefile", template!("cpp/Makefile")),
                    scenario(),
                    header(),
                    model_h(),
                    lqr_h(),
                    test_c(),
                ],
            ),
            (Language::Casadi, Node::AttitudeMpc) => library(
                include_str!("../../templates/casadi/about.md"),
                vec![
                    ("generate.py", template!("casadi/generate.py")),
                    ("test_controller.py", template!("casadi/test_controller.py")),
                    ("Makefile", template!("casadi/Makefile")),
                    scenario(),
                    model_json(),
                ],
            ),
            (Language::Acados, Node::AttitudeMpc) => library(
                include_str!("../../templates/acados/about.md"),
                vec![
                    ("generate.py", template!("acados/generate.py")),
                    ("shim.c", template!("acados/shim.c")),
                    ("Makefile", template!("acados/Makefile")),
                    scenario(),
                    model_json(),
                    header(),
                    model_h(),
                    test_c(),
                ],
            ),
            (Language::Simulink, Node::AttitudeMpc) => library(
                include_str!("../../templates/simulink/about.md"),
                vec![
                    ("controller.c", template!("simulink/controller.c")),
                    ("controller.h", template!("simulink/controller.h")),
                    ("rtwtypes.h", template!("simulink/rtwtypes.h")),
                    ("shim.c", template!("simulink/shim.c")),
                    ("Makefile", template!("simulink/Makefile")),
                    scenario(),
                    header(),
                    model_h(),
                    lqr_h(),
                    test_c(),
                ],
            ),
            (Language::Python, Node::AttitudeMpc) => of(
                "python3",
                include_str!("../../templates/python/about.md"),
                vec![
                    ("controller.py", template!("python/controller.py")),
                    ("test_controller.py", template!("python/test_controller.py")),
                    ("Makefile", template!("python/Makefile")),
                    ("scenario.toml", template!("python/scenario.toml")),
                    model_json(),
                ],
            ),
            (Language::Rust, Node::AttitudeMpc) => library(
                include_str!("../../templates/rust/about.md"),
                vec![
                    ("Cargo.toml", template!("rust/Cargo.toml")),
                    ("Makefile", template!("rust/Makefile")),
                    ("src/lib.rs", template!("rust/lib.rs")),
                    ("src/lqr.rs", template!("rust/lqr.rs")),
                    ("src/model.rs", model.rust()),
                    ("src/trefoil.rs", types_in_rust()),
                    scenario(),
                ],
            ),
            _ => None,
        }
    }

    /// Returns all files for the node that is called `node`.
    pub fn files(self, node: &str) -> Vec<File> {
        let own = [("README.md", template!("common/README.md")), (".gitignore", template!("common/gitignore"))];
        let filled = |text: &str| {
            let text = text.replace("@ABOUT@\n", self.about).replace("@NODE@", node);
            text.replace("@EXEC@", self.exec)
        };
        self.files.iter().chain(&own).map(|(path, text)| (*path, filled(text))).collect()
    }
}
