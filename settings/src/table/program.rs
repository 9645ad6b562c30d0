//! `[node.NAME]`: settings of one node. They replace the launcher's own core by a library or program, and override the
//! scheduling and the deadline of all nodes.
//!
//! | `exec` | is |
//! |---|---|
//! | absent, or `""` | the launcher's own core |
//! | a file that ends in `.so` | a library with the interface of `trefoil.h` or a function of CasADi, which a process of the launcher loads |
//! | any other file | a program of its own, started as `EXEC ARGS --namespace NAME --epoch N --settings FILE` |

use std::collections::BTreeMap;
use std::path::{Path, absolute};

use contract::topic::Topic;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::table::timing::{Late, SchedulingPolicy};

/// Settings of single nodes, `[node]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Nodes {
    /// Settings of the plant, `[node.plant]`.
    #[serde(skip_serializing_if = "NodeSettings::is_default")]
    pub plant: NodeSettings,
    /// Settings of guidance, `[node.guidance]`.
    #[serde(skip_serializing_if = "NodeSettings::is_default")]
    pub guidance: NodeSettings,
    /// Settings of attitude-mpc, `[node.attitude-mpc]`.
    #[serde(rename = "attitude-mpc", skip_serializing_if = "NodeSettings::is_default")]
    pub attitude_mpc: NodeSettings,
    /// Settings of the mixer, `[node.mixer]`.
    #[serde(skip_serializing_if = "NodeSettings::is_default")]
    pub mixer: NodeSettings,
}

/// Settings of one node, `[node.NAME]`: NAME is `plant`, `guidance`, `attitude-mpc` or `mixer`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct NodeSettings {
    /// File of the library or program. A relative path that exists beside the scenario file is that file; any other
    /// path is relative to the launcher's working directory, or, without a slash, searched in `PATH`. Empty = the
    /// launcher's own core.
    #[schemars(example = "my-controller.so")]
    #[serde(skip_serializing_if = "String::is_empty")]
    pub exec: String,
    /// Arguments of a program, before the launcher's arguments; relative paths as in `exec`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub args: Vec<String>,
    /// SHA-256 of the file of `exec` and of each file that `args` names, by its path. The launcher adds missing hashes,
    /// and refuses a file whose given hash differs.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
    /// Variables added to the environment of the process.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub env: BTreeMap<String, String>,
    /// Scheduling class; absent = `realtime.policy`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<SchedulingPolicy>,
    /// `SCHED_FIFO` priority; absent = `realtime.priority` plus the node's place in the ring, 0 (plant) to 3 (mixer).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<u32>,
    /// CPUs that the node may run on; absent = `realtime.affinity`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub affinity: Option<Vec<usize>>,
    /// Deadline of the node's message \[ms\]; absent = a share of the deadline of the whole chain: 20 % for STATE, 40 %
    /// for REFERENCE, 80 % for CONTROLS, all of it for ACTUATORS.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deadline_ms: Option<f64>,
    /// Treatment of a late message; absent = `deadline.late`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub late: Option<Late>,
    /// Settings handed to the program as JSON, `[node.NAME.settings]`: any keys.
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

impl NodeSettings {
    /// Kind of the program.
    pub fn kind(&self) -> ProgramKind {
        match self.exec.as_str() {
            "" => ProgramKind::Own,
            exec if Path::new(exec).extension().is_some_and(|ending| ending == "so") => ProgramKind::Library,
            _ => ProgramKind::Executable,
        }
    }

    /// SHA-256 of the file of `exec`; empty if it is not known.
    pub fn sha256(&self) -> &str {
        self.files.get(&self.exec).map_or("", String::as_str)
    }

    /// Gives the file of `exec` another path, and keeps its hash.
    pub fn move_to(&mut self, exec: String) {
        if let Some(sha256) = self.files.remove(&self.exec) {
            self.files.insert(exec.clone(), sha256);
        }
        self.exec = exec;
    }

    fn is_default(&self) -> bool {
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

    /// Settings of the node that publishes `topic`.
    pub fn of(&self, topic: Topic) -> &NodeSettings {
        match topic {
            Topic::State => &self.plant,
            Topic::Reference => &self.guidance,
            Topic::Controls => &self.attitude_mpc,
            Topic::Actuators => &self.mixer,
        }
    }

    /// Settings of the node that publishes `topic`, to be changed.
    pub fn of_mut(&mut self, topic: Topic) -> &mut NodeSettings {
        match topic {
            Topic::State => &mut self.plant,
            Topic::Reference => &mut self.guidance,
            Topic::Controls => &mut self.attitude_mpc,
            Topic::Actuators => &mut self.mixer,
        }
    }
}

/// Makes paths in `settings` absolute if they name a file in `folder`: programs, their arguments and hashed files.
pub fn find_programs(settings: &mut Table, folder: &Path) {
    let found = |path: &str| {
        let file = absolute(folder.join(path)).ok().filter(|file| !path.is_empty() && file.is_file())?;
        file.to_str().map(str::to_owned)
    };
    let find = |word: &mut Value| {
        if let Some(file) = word.as_str().and_then(found) {
            *word = file.into();
        }
    };
    let nodes = settings.get_mut("node").and_then(Value::as_table_mut);
    for (_, program) in nodes.into_iter().flatten() {
        program.get_mut("exec").map(find);
        program.get_mut("args").and_then(Value::as_array_mut).into_iter().flatten().for_each(find);
        if let Some(files) = program.get_mut("files").and_then(Value::as_table_mut) {
            *files =
                std::mem::take(files).into_iter().map(|(path, hash)| (found(&path).unwrap_or(path), hash)).collect();
        }
    }
    let swaps = settings.get_mut("swap").and_then(Value::as_array_mut);
    swaps.into_iter().flatten().filter_map(|swap| swap.get_mut("exec")).for_each(find);
}

/// Settings of a node that belong to its program.
const PROGRAM: [&str; 5] = ["exec", "args", "files", "env", "settings"];

/// Drops the settings of a program from each node in `below` to which `above` gives an `exec`.
pub(crate) fn drop_replaced_programs(below: &mut Table, above: &Table) {
    let Some(nodes) = above.get("node").and_then(Value::as_table) else { return };
    let Some(below) = below.get_mut("node").and_then(Value::as_table_mut) else { return };
    for (name, node) in below {
        if let Value::Table(node) = node
            && nodes.get(name).is_some_and(|above| above.get("exec").is_some())
        {
            node.retain(|key, _| !PROGRAM.contains(&key));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_follows_from_the_name_of_the_file() {
        let kind = |exec: &str| NodeSettings { exec: exec.into(), ..NodeSettings::default() }.kind();
        assert_eq!(
            ["", "lib/my.so", "my-program", "my.so.py"].map(kind),
            [ProgramKind::Own, ProgramKind::Library, ProgramKind::Executable, ProgramKind::Executable]
        );
    }

    #[test]
    fn files_beside_the_scenario_become_absolute_and_other_words_stay() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my.py"), "").unwrap();
        let text = "node.mixer = { exec = 'python3', args = ['my.py', '-v'], files = { 'my.py' = '00' } }\n\
                    swap = [{ exec = 'my.py' }]";
        let mut settings: Table = text.parse().unwrap();
        find_programs(&mut settings, folder.path());
        let mixer: NodeSettings = settings["node"]["mixer"].clone().try_into().unwrap();
        let file = folder.path().join("my.py").to_str().unwrap().to_owned();
        assert_eq!((mixer.exec.as_str(), mixer.args), ("python3", vec![file.clone(), "-v".into()]));
        assert_eq!(mixer.files, [(file.clone(), "00".to_owned())].into());
        assert_eq!(settings["swap"][0]["exec"].as_str(), Some(file.as_str()));
    }

    #[test]
    fn another_program_keeps_the_scheduling_of_the_node() {
        let mut below: Table =
            "node.mixer = { exec = 'a.so', settings = { gain = 1 }, priority = 40 }".parse().unwrap();
        drop_replaced_programs(&mut below, &"node.mixer.exec = 'b.so'".parse().unwrap());
        assert_eq!(below, "node.mixer = { priority = 40 }".parse().unwrap());
    }
}
