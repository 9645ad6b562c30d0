//! Checks of the programs in `[node.NAME]`.

use contract::topic::Topic;

use crate::check::found::Found;
use crate::table::program::{NodeSettings, ProgramKind};
use crate::table::run::{Mode, Scenario};

/// Finds every rule that the programs of the nodes of `scenario` break.
pub fn check(scenario: &Scenario, found: &mut Found) {
    for topic in Topic::ALL {
        let (program, name) = (scenario.node.of(topic), topic.publisher());
        let key = |setting: &str| format!("node.{name}.{setting}");
        let NodeSettings { files, args, env, settings, .. } = program;
        let given = [
            ("files", !files.is_empty()),
            ("args", !args.is_empty()),
            ("env", !env.is_empty()),
            ("settings", !settings.is_empty()),
        ];
        let kind = program.kind();
        for (setting, _) in given.iter().filter(|(setting, given)| {
            *given && (kind == ProgramKind::Own || kind == ProgramKind::Library && *setting == "args")
        }) {
            found.require(
                false,
                &[&key(setting), &key("exec")],
                format!("`{}` has no effect here", key(setting)),
                match kind {
                    ProgramKind::Own => "`exec` = a library or program with it, or remove it",
                    _ => "no `args` for a library: give it `settings`",
                },
            );
        }
        found.require(
            kind != ProgramKind::Executable || scenario.run.mode != Mode::Inprocess,
            &[&key("exec"), "run.mode"],
            format!("`{}` is a program of its own, and in process there is none", key("exec")),
            "`run.mode` = \"lockstep\" or \"realtime\", or a library (`.so`)",
        );
    }
}
