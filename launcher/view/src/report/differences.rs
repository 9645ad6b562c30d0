//! What the flight's settings have that the defaults of its profile do not: the table that the page opens with.

use contract::Scenario;
use contract::scenario::{from_merged, to_toml};
use serde_json::Value;

use crate::draw::{DASH, escape, table};

/// The settings that differ, as a section. Faults and swaps stand in it one by one.
pub fn section(flown: &Scenario) -> String {
    let profile = format!("{:?}", flown.profile).to_lowercase();
    let rows = differences(flown);
    let told = if rows.is_empty() {
        format!("<p>Every setting is the default of profile <b>{profile}</b>.</p>")
    } else {
        let heading = format!("default of {profile}");
        let cells = |[key, default, here]: Row| vec![format!("<code>{key}</code>"), default, here];
        table(&["setting", &heading, "this flight"], rows.into_iter().map(|row| cells(row.map(|words| escape(&words)))))
    };
    format!("<section id=\"differences\"><h2>What differs from the defaults</h2>{told}</section>")
}

/// What was flown, with what was ordered while it flew; none where the summary does not tell.
pub fn flown(run: &Value) -> Option<Scenario> {
    from_merged(run["provenance"]["scenario"].as_str()?, "run.json").ok()
}

/// Key, default and value.
type Row = [String; 3];

/// Every setting that differs. The name of a flight is none.
fn differences(flown: &Scenario) -> Vec<Row> {
    let tree = |scenario: &Scenario| to_toml(scenario).parse().map(toml::Value::Table).ok();
    let defaults = Scenario { name: flown.name.clone(), ..Scenario::from(flown.profile) };
    let (Some(defaults), Some(flown)) = (tree(&defaults), tree(flown)) else { return vec![] };
    let mut rows = vec![];
    compare("", Some(&defaults), Some(&flown), &mut rows);
    rows
}

fn compare(key: &str, default: Option<&toml::Value>, here: Option<&toml::Value>, rows: &mut Vec<Row>) {
    use toml::Value::{Array, Table};
    if default == here {
        return;
    }
    let below = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
    match (default, here) {
        (Some(Table(default)), Some(Table(here))) => {
            let mut names: Vec<_> = default.keys().chain(here.keys()).collect();
            names.sort();
            names.dedup();
            for name in names {
                compare(&below(name), default.get(name), here.get(name), rows);
            }
        }
        (None | Some(Array(_)), Some(Array(all))) if !all.is_empty() && all.iter().all(toml::Value::is_table) => {
            let one = |(i, each): (usize, _)| [format!("{key} {i}"), DASH.into(), words(Some(each))];
            rows.extend((1..).zip(all).map(one));
        }
        _ => rows.push([key.into(), words(default), words(here)]),
    }
}

/// A value as one writes it in a scenario file, on one line.
fn words(value: Option<&toml::Value>) -> String {
    match value {
        None => DASH.into(),
        Some(toml::Value::String(text)) => text.clone(),
        Some(toml::Value::Table(fields)) => {
            // What a fault or a swap is of needs no names.
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
    use contract::scenario::{Fault, FaultKind, FaultTarget, Profile};

    #[test]
    fn only_what_differs_is_told_with_its_default() {
        let mut flown = Scenario::from(Profile::Paper);
        flown.name = "another name".into();
        assert!(differences(&flown).is_empty());
        assert!(section(&flown).contains("Every setting is the default of profile <b>paper</b>"));
        flown.run.duration_s = 12.5;
        flown.bounds.max_position_error_m = Some(0.3);
        flown.deadline.mixer_ms = Some(9.0);
        flown.fault = vec![Fault::new(FaultTarget::Mixer, FaultKind::Kill, 2.0, Some(0.3)); 2];
        let kill = "mixer kill, at_s 2.0, for_s 0.3";
        let expected = [
            ["bounds.max_position_error_m", DASH, "0.3"],
            ["deadline.mixer_ms", DASH, "9.0"],
            ["fault 1", DASH, kill],
            ["fault 2", DASH, kill],
            ["run.duration_s", "60.0", "12.5"],
        ];
        assert_eq!(differences(&flown), expected);
        // What was ordered in flight stands in it, as the summary tells.
        let run = serde_json::json!({ "provenance": { "scenario": to_toml(&flown) } });
        assert!(section(&super::flown(&run).unwrap()).contains(kill));
    }
}
