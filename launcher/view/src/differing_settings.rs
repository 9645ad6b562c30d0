//! Differences between the settings of scenarios.

use std::path::Path;

use contract::Topic;
use settings::{Scenario, to_toml};
use toml::Value;

use crate::draw::DASH;

/// Returns every setting that differs between `scenarios`: its key, then its value in each of them. Faults and swaps
/// are listed one by one. The name of a flight is no setting, nor is the path of a program where the hash of its file
/// is known.
pub fn differences(scenarios: &[&Scenario]) -> Vec<Vec<String>> {
    let tree = |scenario: &&Scenario| {
        let mut nameless = Scenario { name: String::new(), ..(*scenario).clone() };
        for topic in Topic::ALL {
            let program = nameless.node.of_mut(topic);
            if !program.sha256().is_empty() {
                let file = Path::new(&program.exec).file_name().unwrap_or_default();
                program.move_to(file.to_string_lossy().into_owned());
            }
        }
        to_toml(&nameless).parse().map(Value::Table).ok()
    };
    let Some(trees) = scenarios.iter().map(tree).collect::<Option<Vec<_>>>() else { return vec![] };
    let mut rows = vec![];
    compare("", &trees.iter().map(Some).collect::<Vec<_>>(), &mut rows);
    rows
}

fn compare(key: &str, values: &[Option<&Value>], rows: &mut Vec<Vec<String>>) {
    if values.windows(2).all(|pair| pair[0] == pair[1]) {
        return;
    }
    let below = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
    let tables: Option<Vec<_>> = values.iter().map(|value| value.and_then(Value::as_table)).collect();
    let lists: Option<Vec<_>> = values.iter().map(|value| list_of_tables(*value)).collect();
    if let Some(tables) = tables {
        let mut names: Vec<_> = tables.iter().flat_map(|table| table.keys()).collect();
        names.sort();
        names.dedup();
        for name in names {
            compare(&below(name), &tables.iter().map(|table| table.get(name)).collect::<Vec<_>>(), rows);
        }
    } else if let Some(lists) = lists.filter(|lists| lists.iter().any(|list| !list.is_empty())) {
        let longest = lists.iter().map(|list| list.len()).max().unwrap_or(0);
        for i in 0..longest {
            let each: Vec<_> = lists.iter().map(|list| list.get(i)).collect();
            if each.iter().any(|value| *value != each[0]) {
                rows.push(row(&format!("{key} {}", i + 1), &each));
            }
        }
    } else {
        rows.push(row(key, values));
    }
}

fn row(key: &str, values: &[Option<&Value>]) -> Vec<String> {
    std::iter::once(key.to_owned()).chain(values.iter().map(|value| words(*value))).collect()
}

/// Tables of an array that holds nothing else; empty without a value, `None` for any other value.
fn list_of_tables(value: Option<&Value>) -> Option<&[Value]> {
    match value {
        None => Some(&[]),
        Some(Value::Array(all)) if all.iter().all(Value::is_table) => Some(all),
        Some(_) => None,
    }
}

/// Formats a value on one line: a string without quotes, a table as names and values.
fn words(value: Option<&Value>) -> String {
    match value {
        None => DASH.into(),
        Some(Value::String(text)) => text.clone(),
        Some(Value::Table(fields)) => {
            // Target, node and kind of a fault or a swap are shown without their keys.
            let of: Vec<_> = ["target", "node", "kind"].iter().filter_map(|name| fields.get(*name)?.as_str()).collect();
            let named = fields.iter().filter(|(_, value)| !value.as_str().is_some_and(|text| of.contains(&text)));
            let named = named.map(|(name, value)| format!("{name} {}", words(Some(value))));
            (!of.is_empty()).then(|| of.join(" ")).into_iter().chain(named).collect::<Vec<_>>().join(", ")
        }
        Some(value) => value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::{Fault, FaultKind, FaultTarget};

    #[test]
    fn only_settings_that_differ_are_told_with_the_value_of_each() {
        let usual = Scenario::default();
        let mut other = Scenario { name: "another name".into(), ..usual.clone() };
        assert!(differences(&[&usual, &other]).is_empty());
        other.run.duration_s = 12.5;
        other.node.mixer.deadline_ms = Some(9.0);
        let mut broken = other.clone();
        broken.fault = vec![Fault::new(FaultTarget::Mixer, FaultKind::Kill, 2.0, Some(0.3))];
        let kill = "mixer kill, at_s 2.0, for_s 0.3";
        let expected = [
            ["fault 1", DASH, DASH, kill],
            ["node.mixer", DASH, "deadline_ms 9.0", "deadline_ms 9.0"],
            ["run.duration_s", "60.0", "12.5", "12.5"],
        ];
        assert_eq!(differences(&[&usual, &other, &broken]), expected);
    }

    #[test]
    fn the_path_to_one_and_the_same_program_is_no_difference() {
        let by = |exec: &str, sha256: &str| {
            let mut scenario = Scenario::default();
            scenario.node.mixer.exec = exec.into();
            let files = [(exec.to_owned(), sha256.to_owned())];
            scenario.node.mixer.files = files.into_iter().filter(|(_, sha256)| !sha256.is_empty()).collect();
            scenario
        };
        let told = |one: &Scenario, other: &Scenario| differences(&[one, other]).len();
        assert_eq!(told(&by("pd.so", "ab"), &by("../x/pd.so", "ab")), 0);
        assert_eq!(told(&by("pd.so", "ab"), &by("../x/pd.so", "cd")), 1, "another file");
        assert_eq!(told(&by("pd.so", ""), &by("../x/pd.so", "")), 1, "the files are not known");
    }

    #[test]
    fn only_faults_that_differ_are_told() {
        let fault = |at_s| Fault::new(FaultTarget::Mixer, FaultKind::Kill, at_s, None);
        let [one, other] =
            [1.0, 2.0].map(|at_s| Scenario { fault: vec![fault(0.5), fault(at_s)], ..Scenario::default() });
        let rows = differences(&[&one, &other]);
        assert_eq!(rows, [["fault 2", "mixer kill, at_s 1.0", "mixer kill, at_s 2.0"]]);
    }
}
