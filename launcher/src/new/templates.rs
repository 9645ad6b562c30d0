//! Templates of controllers, part of the launcher's program.
//!
//! In a file `@NODE@` stands for the name of the node, `@MODES@` and `@ABOUT@` for texts of the template.

use clap::ValueEnum;

use super::model::HoverModel;
use crate::manual::Described;

/// Language, or tool that generates C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Language {
    /// C: a library by trefoil.h
    C,
    /// C++: a library by trefoil.h
    Cpp,
    /// C from CasADi, by its own names
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
pub enum TemplateNode {
    /// Trajectory to attitude and vertical velocity
    Guidance,
    /// Attitude and vertical velocity to forces and moments
    AttitudeMpc,
    /// Forces and moments to rotor speeds and tilt
    Mixer,
}

/// Controller for one node in one language.
pub struct Template {
    pub language: Language,
    pub node: TemplateNode,
    /// Modes in which it flies, for its README.
    modes: &'static str,
    /// Description of the files, for its README.
    about: &'static str,
    /// Files beside those of every template, by their paths in the folder.
    files: &'static [(&'static str, Text)],
}

/// Text of a file.
#[derive(Clone, Copy)]
enum Text {
    Fixed(&'static str),
    Made(fn(&HoverModel) -> String),
}

/// Reads a file of the templates when the launcher is built.
macro_rules! template {
    ($path:literal) => {
        include_str!(concat!("../../templates/", $path))
    };
}

/// Text of a file of the templates.
macro_rules! text {
    ($path:literal) => {
        Text::Fixed(template!($path))
    };
}

/// Makes a template without files, of a controller that is built to a library.
const fn library(language: Language, node: TemplateNode, about: &'static str) -> Template {
    Template { language, node, modes: template!("common/library.md"), about, files: &[] }
}

const SCENARIO: Text = text!("common/scenario.toml");
const TREFOIL_H: Text = Text::Fixed(include_str!("../../../foreign/include/trefoil.h"));
const LQR_H: Text = text!("common/lqr.h");
const TEST_C: Text = text!("common/test_attitude.c");
/// Files of every template.
const COMMON: [(&str, Text); 3] = [
    ("README.md", text!("common/README.md")),
    (".gitignore", text!("common/gitignore")),
    ("scenario.schema.json", Text::Made(schema)),
];

const TEMPLATES: [Template; 9] = [
    Template {
        files: &[
            ("controller.c", text!("c/attitude-mpc.c")),
            ("lqr.h", LQR_H),
            ("model.h", Text::Made(HoverModel::c)),
            ("trefoil.h", TREFOIL_H),
            ("test_controller.c", TEST_C),
            ("Makefile", text!("c/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::C, TemplateNode::AttitudeMpc, template!("c/attitude-mpc.md"))
    },
    Template {
        files: &[
            ("controller.c", text!("c/guidance.c")),
            ("trefoil.h", TREFOIL_H),
            ("test_controller.c", text!("c/test_guidance.c")),
            ("Makefile", text!("c/Makefile")),
            ("scenario.toml", text!("c/guidance.toml")),
        ],
        ..library(Language::C, TemplateNode::Guidance, template!("c/guidance.md"))
    },
    Template {
        files: &[
            ("controller.c", text!("c/mixer.c")),
            ("model.h", Text::Made(HoverModel::c)),
            ("trefoil.h", TREFOIL_H),
            ("test_controller.c", text!("c/test_mixer.c")),
            ("Makefile", text!("c/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::C, TemplateNode::Mixer, template!("c/mixer.md"))
    },
    Template {
        files: &[
            ("controller.cpp", text!("cpp/controller.cpp")),
            ("lqr.h", LQR_H),
            ("model.h", Text::Made(HoverModel::c)),
            ("trefoil.h", TREFOIL_H),
            ("test_controller.c", TEST_C),
            ("Makefile", text!("cpp/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::Cpp, TemplateNode::AttitudeMpc, template!("cpp/about.md"))
    },
    Template {
        files: &[
            ("generate.py", text!("casadi/generate.py")),
            ("model.json", Text::Made(HoverModel::json)),
            ("test_controller.py", text!("casadi/test_controller.py")),
            ("Makefile", text!("casadi/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::Casadi, TemplateNode::AttitudeMpc, template!("casadi/about.md"))
    },
    Template {
        files: &[
            ("generate.py", text!("acados/generate.py")),
            ("shim.c", text!("acados/shim.c")),
            ("model.json", Text::Made(HoverModel::json)),
            ("model.h", Text::Made(HoverModel::c)),
            ("trefoil.h", TREFOIL_H),
            ("test_controller.c", TEST_C),
            ("Makefile", text!("acados/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::Acados, TemplateNode::AttitudeMpc, template!("acados/about.md"))
    },
    Template {
        files: &[
            ("controller.c", text!("simulink/controller.c")),
            ("controller.h", text!("simulink/controller.h")),
            ("rtwtypes.h", text!("simulink/rtwtypes.h")),
            ("shim.c", text!("simulink/shim.c")),
            ("lqr.h", LQR_H),
            ("model.h", Text::Made(HoverModel::c)),
            ("trefoil.h", TREFOIL_H),
            ("test_controller.c", TEST_C),
            ("Makefile", text!("simulink/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::Simulink, TemplateNode::AttitudeMpc, template!("simulink/about.md"))
    },
    Template {
        language: Language::Python,
        node: TemplateNode::AttitudeMpc,
        modes: template!("python/modes.md"),
        about: template!("python/about.md"),
        files: &[
            ("controller.py", text!("python/controller.py")),
            ("model.json", Text::Made(HoverModel::json)),
            ("test_controller.py", text!("python/test_controller.py")),
            ("Makefile", text!("python/Makefile")),
            ("scenario.toml", text!("python/scenario.toml")),
        ],
    },
    Template {
        files: &[
            ("src/lib.rs", text!("rust/lib.rs")),
            ("src/lqr.rs", text!("rust/lqr.rs")),
            ("src/model.rs", Text::Made(HoverModel::rust)),
            ("src/trefoil.rs", Text::Made(types_in_rust)),
            ("Cargo.toml", text!("rust/Cargo.toml")),
            ("Makefile", text!("rust/Makefile")),
            ("scenario.toml", SCENARIO),
        ],
        ..library(Language::Rust, TemplateNode::AttitudeMpc, template!("rust/about.md"))
    },
];

impl Template {
    /// Lists all templates.
    pub fn all() -> &'static [Self] {
        &TEMPLATES
    }

    /// Writes all files for the node that is called `node`: paths in the folder, and texts.
    pub fn files(&self, node: &str, model: &HoverModel) -> Vec<(&'static str, String)> {
        let filled = |text: Text| {
            let text = match text {
                Text::Fixed(text) => text.replace("@MODES@\n", self.modes).replace("@ABOUT@\n", self.about),
                Text::Made(make) => make(model),
            };
            text.replace("@NODE@", node)
        };
        self.files.iter().chain(&COMMON).map(|(path, text)| (*path, filled(*text))).collect()
    }
}

/// JSON Schema of the scenario, which its first line names, so that editors complete it.
fn schema(_: &HoverModel) -> String {
    Described::Scenario.schema()
}

/// Types of `trefoil.h` in Rust, without the derived traits that need another crate.
fn types_in_rust(_: &HoverModel) -> String {
    let types = include_str!("../../../foreign/src/abi.rs");
    types.replace("use bytemuck::{Pod, Zeroable};\n\n", "").replace(", Pod, Zeroable", "").replace("pub(crate)", "pub")
}
