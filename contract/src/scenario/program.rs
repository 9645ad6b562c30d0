//! `[node.<name>]`: program of a node in place of the launcher's own core, and settings for it.
//!
//! | `exec` | is |
//! |---|---|
//! | absent, or `""` | the launcher's own core |
//! | a file that ends in `.so` | a library with the interface of `trefoil.h`, which a process of the launcher loads |
//! | any other file | a program of its own, started as `EXEC ARGS --namespace NAME --epoch N --settings FILE` |

use std::collections::BTreeMap;
use std::path::{Path, absolute};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::Topic;

/// Programs of all nodes, `[node]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Nodes {
    /// Program of the plant, `[node.plant]`.
    #[serde(skip_serializing_if = "NodeProgram::is_ours")]
    pub plant: NodeProgram,
    /// Program of guidance, `[node.guidance]`.
    #[serde(skip_serializing_if = "NodeProgram::is_ours")]
    pub guidance: NodeProgram,
    /// Program of attitude-mpc, `[node.attitude-mpc]`.
    #[serde(rename = "attitude-mpc", skip_serializing_if = "NodeProgram::is_ours")]
    pub attitude_mpc: NodeProgram,
    /// Program of the mixer, `[node.mixer]`.
    #[serde(skip_serializing_if = "NodeProgram::is_ours")]
    pub mixer: NodeProgram,
}

/// Program of one node, `[node.<name>]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NodeProgram {
    /// File of the library or program. A relative path that exists beside the scenario file is that file; any other is
    /// seen from where the launcher is started, or, without a slash, found in `PATH`. Empty = the launcher's own core.
    pub exec: String,
    /// SHA-256 of the file; the launcher adds it, and refuses another file where it is given. Empty = any file.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub sha256: String,
    /// Arguments before those of the launcher, for a program; paths as in `exec`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub args: Vec<String>,
    /// SHA-256 of each file that `args` names, by its path; the launcher adds them, and refuses other files where they
    /// are given.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
    /// Variables added to the environment of the process.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub env: BTreeMap<String, String>,
    /// Settings handed over as JSON, `[node.<name>.settings]`: any keys.
    #[serde(skip_serializing_if = "Table::is_empty")]
    #[schemars(schema_with = "any_table")]
    pub settings: Table,
}

/// Makes the schema of a table with any keys.
pub fn any_table(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "object" })
}

/// Kind of a node's program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProgramKind {
    /// The launcher's own core.
    Own,
    /// A shared library, loaded by a process of the launcher.
    Library,
    /// A program with its own `main`.
    Executable,
}

impl NodeProgram {
    /// Kind of the program.
    pub fn kind(&self) -> ProgramKind {
        match self.exec.as_str() {
            "" => ProgramKind::Own,
            exec if Path::new(exec).extension().is_some_and(|ending| ending == "so") => ProgramKind::Library,
            _ => ProgramKind::Executable,
        }
    }

    /// Returns whether nothing is set: the node is the launcher's own.
    pub fn is_ours(&self) -> bool {
        *self == Self::default()
    }
}

impl Nodes {
    /// Returns the topics of the nodes that are libraries.
    pub fn libraries(&self) -> impl Iterator<Item = Topic> {
        Topic::ALL.into_iter().filter(|topic| self.of(*topic).kind() == ProgramKind::Library)
    }

    /// Returns whether a node is a program of its own, which flies as a process only.
    pub fn has_program(&self) -> bool {
        Topic::ALL.into_iter().any(|topic| self.of(topic).kind() == ProgramKind::Executable)
    }

    /// Program of the node that publishes `topic`.
    pub fn of(&self, topic: Topic) -> &NodeProgram {
        [&self.plant, &self.guidance, &self.attitude_mpc, &self.mixer][topic as usize]
    }

    /// Program of the node that publishes `topic`, to be changed.
    pub fn of_mut(&mut self, topic: Topic) -> &mut NodeProgram {
        match topic {
            Topic::State => &mut self.plant,
            Topic::Reference => &mut self.guidance,
            Topic::Controls => &mut self.attitude_mpc,
            Topic::Actuators => &mut self.mixer,
        }
    }
}

/// Makes the paths of programs in `settings` absolute that name a file in `folder`.
pub fn find_programs(settings: &mut Table, folder: &Path) {
    let find = |word: &mut Value| {
        if let Value::String(path) = word
            && !path.is_empty()
            && let Ok(file) = absolute(folder.join(&path))
            && file.is_file()
            && let Some(file) = file.to_str()
        {
            *path = file.into();
        }
    };
    let nodes = settings.get_mut("node").and_then(Value::as_table_mut);
    for (_, program) in nodes.into_iter().flatten() {
        program.get_mut("exec").map(find);
        program.get_mut("args").and_then(Value::as_array_mut).into_iter().flatten().for_each(find);
    }
    let swaps = settings.get_mut("swap").and_then(Value::as_array_mut);
    swaps.into_iter().flatten().filter_map(|swap| swap.get_mut("exec")).for_each(find);
}

/// Drops from the settings `below` all of each program that `above` replaces by another `exec`.
pub(super) fn drop_replaced_programs(below: &mut Table, above: &Table) {
    let Some(nodes) = above.get("node").and_then(Value::as_table) else { return };
    let Some(below) = below.get_mut("node").and_then(Value::as_table_mut) else { return };
    below.retain(|name, _| nodes.get(name).is_none_or(|program| program.get("exec").is_none()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_follows_from_the_name_of_the_file() {
        let kind = |exec: &str| NodeProgram { exec: exec.into(), ..NodeProgram::default() }.kind();
        assert_eq!(
            ["", "lib/my.so", "my-program", "my.so.py"].map(kind),
            [ProgramKind::Own, ProgramKind::Library, ProgramKind::Executable, ProgramKind::Executable]
        );
    }

    #[test]
    fn files_beside_the_scenario_become_absolute_and_other_words_stay() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my.py"), "").unwrap();
        let text = "node.mixer = { exec = 'python3', args = ['my.py', '-v'] }\nswap = [{ exec = 'my.py' }]";
        let mut settings: Table = text.parse().unwrap();
        find_programs(&mut settings, folder.path());
        let mixer: NodeProgram = settings["node"]["mixer"].clone().try_into().unwrap();
        let file = folder.path().join("my.py").to_str().unwrap().to_owned();
        assert_eq!((mixer.exec.as_str(), mixer.args), ("python3", vec![file.clone(), "-v".into()]));
        assert_eq!(settings["swap"][0]["exec"].as_str(), Some(file.as_str()));
    }
}
