//! The flying stack that a command addresses, and its description in the answer.

use anyhow::{Context, bail, ensure};
use flight::control::view::{phase, time_s};
use runtime::domain::Domain;

/// Argument that selects a flying stack.
#[derive(clap::Args)]
pub struct TargetArgs {
    /// Namespace of the stack; needed if several fly
    #[arg(long)]
    namespace: Option<String>,
}

impl TargetArgs {
    /// Finds the stack that is named, or else the only stack that flies; an error if none or several fly.
    pub fn find(&self) -> anyhow::Result<Domain> {
        if let Some(namespace) = &self.namespace {
            return Ok(Domain::find(namespace)?);
        }
        let mut flying = Domain::list();
        let names: Vec<String> = flying.iter().map(describe).collect();
        check_only(&names)?;
        flying.pop().context("no stack is flying")
    }
}

/// Returns an error unless `names` has exactly one stack.
fn check_only(names: &[String]) -> anyhow::Result<()> {
    ensure!(!names.is_empty(), "no stack is flying; `trefoil fly` starts one");
    if names.len() > 1 {
        bail!("{} stacks fly, say which one with --namespace:\n  {}", names.len(), names.join("\n  "));
    }
    Ok(())
}

/// Describes a flight for the answers to commands: its scenario, namespace and process, and the time it has flown.
pub fn describe(domain: &Domain) -> String {
    let name = domain.scenario().map_or("a flight".into(), |scenario| format!("'{}'", scenario.name));
    let pid = domain.launcher_pid().map_or(String::new(), |pid| format!(", process {pid}"));
    let stands = match (phase(domain), time_s(domain)) {
        (Some("flying"), Some(time_s)) => format!(", flying for {time_s:.2} s"),
        (Some(phase), _) => format!(", {phase}"),
        (None, _) => String::new(),
    };
    format!("{name} in namespace '{}'{pid}{stands}", domain.namespace())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_that_names_no_stack_is_for_the_only_one() {
        let names = |names: &[&str]| check_only(&names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert!(names(&["'survey' in namespace 'a'"]).is_ok());
        assert!(names(&[]).unwrap_err().to_string().contains("no stack is flying"));
        let many = names(&["'survey' in namespace 'a'", "'hover' in namespace 'b'"]).unwrap_err().to_string();
        for part in ["2 stacks fly", "--namespace", "\n  'survey' in namespace 'a'", "\n  'hover' in namespace 'b'"] {
            assert!(many.contains(part), "{many}");
        }
    }
}
