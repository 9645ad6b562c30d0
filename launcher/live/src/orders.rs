//! Buttons of the page as command lines: each runs `trefoil inject`, `clear`, `swap` or `stop`, and shows its answer.
//!
//! The page therefore can do what these commands can, with one exception: a swap takes settings of the control laws
//! only. Otherwise a user of the page could start any program under the account of the user who flies, or give a
//! process more of the machine than the scenario does: priority, processors, locked memory, CPU time, time to solve.

use std::process::Stdio;

use flight::own_program;
use serde::{Deserialize, Serialize};

/// Longest word of an order \[characters\].
const WORD_CHARS: usize = 200;
/// Largest number of settings of a swap.
const SETTINGS: usize = 20;
/// Tables of a scenario that a swap by the page may set: the control laws.
const LAWS: [&str; 3] = ["guidance", "attitude", "mixer"];
/// Settings in these tables that limit the time of a solve; the page may not set them.
const LIMITS: [&str; 2] = ["attitude.mpc.max_iterations", "attitude.mpc.time_limit_ms"];

/// Order of the page. Times are written as on the command line: `500ms`, `2s`, `inf`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PageOrder {
    Inject {
        target: String,
        kind: String,
        #[serde(default, rename = "for")]
        for_s: Option<String>,
        #[serde(default)]
        value: Option<String>,
        #[serde(default)]
        ms: Option<String>,
        #[serde(default)]
        vector: Option<String>,
    },
    Clear {
        #[serde(default)]
        target: Option<String>,
    },
    Swap {
        node: String,
        #[serde(default)]
        set: Vec<String>,
    },
    Stop {},
}

/// Answer to an order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OrderAnswer {
    /// Command line that was run, as a user would write it.
    pub line: String,
    pub ok: bool,
    /// Text that the command printed.
    pub said: String,
}

impl PageOrder {
    /// Returns the arguments for the launcher; no value of the page can become an option of its own.
    ///
    /// # Errors
    /// A word is too long or has control characters, or the swap has too many settings or one that the page may not
    /// set.
    pub fn arguments(&self, namespace: &str) -> Result<Vec<String>, String> {
        let mut options = vec![format!("--namespace={namespace}")];
        let mut option = |name: &str, value: &Option<String>| {
            options.extend(value.as_ref().filter(|value| !value.is_empty()).map(|value| format!("--{name}={value}")));
        };
        let (command, words) = match self {
            Self::Inject { target, kind, for_s, value, ms, vector } => {
                for (name, value) in [("for", for_s), ("value", value), ("ms", ms), ("vector", vector)] {
                    option(name, value);
                }
                ("inject", vec![target.clone(), kind.clone()])
            }
            Self::Clear { target } => ("clear", target.iter().filter(|target| !target.is_empty()).cloned().collect()),
            Self::Swap { node, set } => {
                if set.len() > SETTINGS {
                    return Err(format!("a swap by the page has {SETTINGS} settings at most"));
                }
                set.iter().try_for_each(|setting| check_setting(setting))?;
                options.extend(set.iter().map(|setting| format!("--set={setting}")));
                ("swap", vec![node.clone()])
            }
            Self::Stop {} => ("stop", vec![]),
        };
        let is_unfit = |word: &&String| word.len() > WORD_CHARS || word.chars().any(char::is_control);
        if let Some(word) = options.iter().chain(&words).find(is_unfit) {
            return Err(format!("this is no word of a command: {word:?}"));
        }
        let separator = (!words.is_empty()).then(|| "--".to_owned());
        Ok([command.to_owned()].into_iter().chain(options).chain(separator).chain(words).collect())
    }

    /// Carries the order out, and waits until the command ends; a swap ends after its trial.
    pub fn run(&self, namespace: &str) -> OrderAnswer {
        let arguments = match self.arguments(namespace) {
            Ok(arguments) => arguments,
            Err(said) => return OrderAnswer { line: String::new(), ok: false, said },
        };
        let line =
            format!("trefoil {}", arguments.iter().filter(|word| *word != "--").cloned().collect::<Vec<_>>().join(" "));
        match own_program().args(&arguments).stdin(Stdio::null()).output() {
            Ok(output) => {
                let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
                OrderAnswer { line, ok: output.status.success(), said: said.concat().trim_end().to_owned() }
            }
            Err(error) => OrderAnswer { line, ok: false, said: format!("the command cannot be started: {error}") },
        }
    }
}

/// Checks that a setting of a candidate is `KEY=VALUE`, with a key of a control law that is no limit of a solve.
fn check_setting(setting: &str) -> Result<(), String> {
    let key = setting.split_once('=').map(|(key, _)| key.trim());
    let is_plain = |key: &&str| key.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b"._".contains(&b));
    let key = key
        .filter(is_plain)
        .ok_or_else(|| format!("'{setting}' is not KEY=VALUE, as in attitude.disturbance_gain=0.1"))?;
    let is_of_law = key.split_once('.').is_some_and(|(table, _)| LAWS.contains(&table));
    // A key that names a table with a limit could set the limit.
    let is_limit = LIMITS.iter().any(|limit| limit.starts_with(key));
    if !is_of_law || is_limit {
        return Err(format!(
            "the page starts no other program and changes no limits: it sets {}.KEY, except {}; on the command line: \
             trefoil swap NODE --set {setting}",
            LAWS.join(".KEY, "),
            LIMITS.join(" and "),
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(json: &str) -> Result<Vec<String>, String> {
        serde_json::from_str::<PageOrder>(json).map_err(|error| error.to_string())?.arguments("here")
    }

    #[test]
    fn a_button_is_the_command_line_that_a_user_would_write() {
        for (json, expected) in [
            (
                r#"{"command":"inject","target":"wind","kind":"step","for":"2s","vector":"5,0,0","ms":""}"#,
                "inject --namespace=here --for=2s --vector=5,0,0 -- wind step",
            ),
            (r#"{"command":"clear"}"#, "clear --namespace=here"),
            (r#"{"command":"clear","target":"wind"}"#, "clear --namespace=here -- wind"),
            (
                r#"{"command":"swap","node":"attitude-mpc","set":["attitude.law=lqr"]}"#,
                "swap --namespace=here --set=attitude.law=lqr -- attitude-mpc",
            ),
            (r#"{"command":"stop"}"#, "stop --namespace=here"),
        ] {
            assert_eq!(order(json).map(|words| words.join(" ")).as_deref(), Ok(expected));
        }
    }

    #[test]
    fn no_order_starts_a_program_or_smuggles_in_an_option() {
        for json in [
            r#"{"command":"swap","node":"mixer","exec":"/bin/sh"}"#,
            r#"{"command":"swap","node":"mixer","set":["node.mixer.exec='/tmp/x.so'"]}"#,
            r#"{"command":"swap","node":"mixer","set":["\"node\".mixer.exec='/tmp/x.so'"]}"#,
            r#"{"command":"swap","node":"mixer","set":["attitude.disturbance_gain=0.1\nnode.mixer.exec='/tmp/x.so'"]}"#,
            r#"{"command":"swap","node":"mixer","set":["attitude.disturbance_gain"]}"#,
            r#"{"command":"swap","node":"mixer","set":["realtime.priority=95"]}"#,
            r#"{"command":"swap","node":"mixer","set":["realtime={priority=95}"]}"#,
            r#"{"command":"swap","node":"mixer","set":["node.mixer.affinity=[0]"]}"#,
            r#"{"command":"swap","node":"mixer","set":["realtime.lock_memory=false"]}"#,
            r#"{"command":"swap","node":"mixer","set":["realtime.rttime_ms=0"]}"#,
            r#"{"command":"swap","node":"mixer","set":["deadline.late='send'"]}"#,
            r#"{"command":"swap","node":"mixer","set":["supervision.start_limit_s=1000"]}"#,
            r#"{"command":"swap","node":"mixer","set":["run.rate_hz=1000"]}"#,
            r#"{"command":"swap","node":"mixer","set":["profile='paper'"]}"#,
            r#"{"command":"swap","node":"mixer","set":["attitude.mpc.time_limit_ms=0"]}"#,
            r#"{"command":"swap","node":"mixer","set":["attitude.mpc.max_iterations = 9"]}"#,
            r#"{"command":"swap","node":"mixer","set":["attitude.mpc={time_limit_ms=0}"]}"#,
            r#"{"command":"fly"}"#,
            r#"{"command":"stop","namespace":"another"}"#,
        ] {
            assert!(order(json).is_err(), "{json}");
        }
        let words = order(r#"{"command":"inject","target":"--namespace=another","kind":"step"}"#).unwrap();
        assert_eq!(
            words,
            ["inject", "--namespace=here", "--", "--namespace=another", "step"],
            "a target, and no good one"
        );
    }
}
