//! Templates of controllers, part of the launcher's program.
//!
//! In a file `@NODE@` stands for the name of the node, `@MODES@` and `@ABOUT@` for the texts `modes.md` and `about.md`.

use std::collections::BTreeMap;

use clap::ValueEnum;
use include_dir::{Dir, DirEntry, include_dir};

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
    /// Folders of its files, read after `common`; a file replaces one of the same path in an earlier folder.
    folders: &'static [&'static str],
    /// Generated files: the path, and the function that makes the text.
    made: &'static [(&'static str, Make)],
}

/// Makes the text of a file.
type Make = fn(&HoverModel) -> String;

/// The folders, read when the launcher is built.
static FOLDERS: Dir = include_dir!("$CARGO_MANIFEST_DIR/templates");
const C: &[(&str, Make)] = &[("model.h", HoverModel::c), ("trefoil.h", trefoil_h)];
const JSON: &[(&str, Make)] = &[("model.json", HoverModel::json)];
const C_AND_JSON: &[(&str, Make)] = &[C[0], C[1], JSON[0]];

const TEMPLATES: [Template; 9] = [
    attitude_mpc(Language::C, &["test", "lqr", "c", "c-attitude-mpc"], C),
    Template {
        language: Language::C,
        node: TemplateNode::Guidance,
        folders: &["c", "c-guidance"],
        made: &[("trefoil.h", trefoil_h)],
    },
    Template { language: Language::C, node: TemplateNode::Mixer, folders: &["c", "c-mixer"], made: C },
    attitude_mpc(Language::Cpp, &["test", "lqr", "cpp"], C),
    attitude_mpc(Language::Casadi, &["casadi"], JSON),
    attitude_mpc(Language::Acados, &["test", "acados"], C_AND_JSON),
    attitude_mpc(Language::Simulink, &["test", "lqr", "simulink"], C),
    attitude_mpc(Language::Python, &["python"], JSON),
    attitude_mpc(Language::Rust, &["rust"], &[("src/model.rs", HoverModel::rust), ("src/trefoil.rs", types_in_rust)]),
];

const fn attitude_mpc(
    language: Language,
    folders: &'static [&'static str],
    made: &'static [(&'static str, Make)],
) -> Template {
    Template { language, node: TemplateNode::AttitudeMpc, folders, made }
}

impl Template {
    /// Lists all templates.
    pub fn all() -> &'static [Self] {
        &TEMPLATES
    }

    /// Returns the texts of all files for the node named `node`, by their paths in the folder.
    pub fn files(&self, node: &str, model: &HoverModel) -> BTreeMap<String, String> {
        let mut files = BTreeMap::new();
        for folder in ["common"].iter().chain(self.folders) {
            let found = FOLDERS.find(&format!("{folder}/**/*")).expect("a pattern").filter_map(DirEntry::as_file);
            for file in found {
                let path = file.path().strip_prefix(folder).expect("it is in the folder");
                let path = path.display().to_string().replace("gitignore", ".gitignore");
                files.insert(path, file.contents_utf8().expect("text").to_owned());
            }
        }
        files.extend(self.made.iter().map(|(path, make)| ((*path).to_owned(), make(model))));
        files.insert("scenario.schema.json".to_owned(), Described::Scenario.schema());
        let [modes, about] = ["modes.md", "about.md"].map(|name| files.remove(name).expect("each template has it"));
        for text in files.values_mut() {
            *text = text.replace("@MODES@\n", &modes).replace("@ABOUT@\n", &about).replace("@NODE@", node);
        }
        files
    }
}

fn trefoil_h(_: &HoverModel) -> String {
    include_str!("../../../foreign/include/trefoil.h").to_owned()
}

/// Types of `trefoil.h` in Rust, without the derived traits that need another crate.
fn types_in_rust(_: &HoverModel) -> String {
    let types = include_str!("../../../foreign/src/abi.rs");
    types.replace("use bytemuck::{Pod, Zeroable};\n\n", "").replace(", Pod, Zeroable", "").replace("pub(crate)", "pub")
}
