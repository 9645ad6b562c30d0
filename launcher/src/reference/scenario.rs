//! docs/reference/scenario.md: every setting of a scenario.

use contract::topic::NODES;
use serde_json::Value;
use settings::{Profile, Scenario, to_toml};
use toml::Table;

use super::is_generated;
use super::page::{Object, SchemaField, head, meanings, objects, range_of, row, text, type_of};

const PAGE: &str = "# Settings of a scenario

This page is for users who write a scenario: it has every setting of the file with its type, unit, range and defaults. It
is generated from [`settings/src/`](../../settings/src/lib.rs); a test compares. Editors that know JSON
Schema complete the same settings: [`scenario.json`](../schema/scenario.json), or `trefoil schema scenario`. `trefoil
check FILE` prints a file merged with its defaults.

The defaults are those of the profiles `robust` and `paper`; `-` = not set. The default of a preset (`airframe.preset`,
`plant.sensors.preset`) replaces them. World frame: north, east, down (NED). Body frame: forward, right, down. Heading
frame: ahead, right, down, which is NED turned by the yaw. Rotor speeds are in the paper's unit, called *rotor speed unit*.
Rules between settings are in the messages of `trefoil check`. A setting that has no effect beside the others is an error.
";

/// Description of the table of a node; each of the four nodes has such a table.
const A_NODE: &str = "Settings of one node; NAME is `plant`, `guidance`, `attitude-mpc` or `mixer`.";

/// Units that a description names in brackets.
const UNITS: &[&str] = &[
    "s",
    "ms",
    "us",
    "ns",
    "m",
    "mm",
    "m/s",
    "m/s2",
    "m s",
    "Hz",
    "rad",
    "rad/s",
    "rad/m",
    "rad/(m s)",
    "rad s/m",
    "deg",
    "deg/s",
    "kg",
    "kg m2",
    "N",
    "N m",
    "N/m",
    "N s/m",
    "N s2/m",
    "N s2/m2",
    "W h",
    "1/s",
    "1/s2",
    "1/s3",
    "1",
    "samples",
    "rotor speed unit",
    "rotor speed unit / s",
    "N / rotor speed unit squared",
    "N m / rotor speed unit squared",
    "unit",
    "unit / sqrt(Hz)",
    "deg/s / sqrt(Hz)",
    "deg/s / sqrt(s)",
    "unit / sqrt(s)",
    "m / sqrt(Hz)",
    "m / sqrt(s)",
    "m/s / sqrt(Hz)",
    "m/s2 / sqrt(Hz)",
    "m/s2 / sqrt(s)",
    "share / sqrt(Hz)",
    "s2/m2",
    "1/rad2",
    "s2/rad2",
    "1/N2",
    "1/(N m)2",
    "kB",
    "bytes",
    "byte",
    "kWh",
];

/// Numbers without a unit: counts, shares, factors, seeds and indices.
const PURE: &[&str] = &[
    "run.seed",
    "run.command_drop_probability",
    "mission.part[].laps",
    "mission.limits.share",
    "plant.rotor_speed_max_ratio",
    "plant.rotor_effectiveness",
    "plant.sensors.barometer.wind_pressure",
    "plant.sensors.imu.count",
    "plant.sensors.imu.scale",
    "plant.sensors.magnetometer.disturbance",
    "plant.sensors.telemetry.rotor_speed_noise",
    "plant.battery.droop",
    "plant.battery.sag",
    "plant.ground.friction",
    "attitude.mpc.max_iterations",
    "attitude.disturbance_gain",
    "realtime.priority",
    "realtime.affinity",
    "node.NAME.priority",
    "node.NAME.affinity",
    "fault[].value",
    "fault[].probability",
    "fault[].count",
    "fault[].imu",
    "swap[].bounds.difference",
    "swap[].bounds.similarity",
    "swap[].bounds.ticks",
    "mission.ramp_s",
];

/// Returns the units in the description of a setting.
fn units(about: &str) -> Vec<&str> {
    let brackets = about.split('[').skip(1).filter_map(|rest| rest.split(']').next());
    brackets.filter(|word| UNITS.contains(word)).collect()
}

/// Returns the default of a dotted key, as the file writes it.
fn default_of(defaults: &Table, key: &str) -> String {
    let mut words = key.split('.');
    let first = words.next().and_then(|name| defaults.get(name));
    let value = words.fold(first, |value, name| value.and_then(|value| value.get(name)));
    value.map_or("-".into(), |value| format!("`{value}`"))
}

fn describe(page: &mut String, told: &mut Vec<String>, object: &Object, [robust, paper]: &[Table; 2]) {
    let title = match object.key.as_str() {
        "" => "Top of the file".to_owned(),
        key => key.strip_suffix("[]").map_or(format!("`[{key}]`"), |key| format!("`[[{key}]]`")),
    };
    *page += &format!(
        "\n## {title}\n\n{}\n\n",
        if object.key.is_empty() { "Settings outside of any table." } else { object.about }
    );
    *page += &head(&["key", "type", "unit", "range", "robust", "paper", "meaning"]);
    for SchemaField { key, schema } in &object.fields {
        let about = text(schema);
        let found = units(about);
        let (unit, about) = match found[..] {
            [] => ("", about.to_owned()),
            [only] => (only, about.replace(&format!(" [{only}]"), "")),
            _ => ("see right", about.to_owned()),
        };
        let name = key.strip_prefix(&object.key).unwrap_or(key).trim_start_matches('.');
        let defaults = [robust, paper].map(|defaults| default_of(defaults, key));
        let [robust, paper] = defaults.each_ref().map(String::as_str);
        *page += &row(&[&format!("`{name}`"), &type_of(schema), unit, &range_of(schema), robust, paper, &about]);
    }
    *page += &meanings(&object.fields, told);
}

/// Returns whether a value has numbers.
fn has_numbers(schema: &Value) -> bool {
    match schema {
        Value::Object(all) => {
            let is_number = |kind: &Value| kind == "number" || kind == "integer";
            all.get("type").is_some_and(is_number) || ["items", "anyOf"].iter().any(|key| has_numbers(&schema[*key]))
        }
        Value::Array(all) => all.iter().any(has_numbers),
        _ => false,
    }
}

/// Lists the tables of settings. The table of a node is listed once, as `node.NAME`, and so are the keys of
/// `[airframe]`, which `[plant.airframe]` has too.
fn tables(schema: &Value) -> Vec<Object<'_>> {
    let mut all = objects(schema);
    let (first, others) = NODES.split_first().expect("there are nodes");
    all.retain(|object| others.iter().all(|node| object.key != format!("node.{node}")));
    let rename = |key: &mut String| *key = key.replace(&format!("node.{first}"), "node.NAME");
    let known: Vec<_> = all.iter().filter(|object| object.key == "airframe").flat_map(|table| &table.fields).collect();
    let known: Vec<_> = known.iter().map(|field| format!("plant.{}", field.key)).collect();
    for object in &mut all {
        object.fields.retain(|field| !known.contains(&field.key));
        rename(&mut object.key);
        object.fields.iter_mut().for_each(|field| rename(&mut field.key));
        if object.key == "node.NAME" {
            object.about = A_NODE;
        }
    }
    all
}

#[test]
fn the_page_of_settings_is_generated() {
    let schema = settings::schema();
    let defaults =
        [Profile::Robust, Profile::Paper].map(|profile| to_toml(&Scenario::from(profile)).parse::<Table>().unwrap());
    let (mut page, mut told) = (PAGE.to_owned(), vec![]);
    tables(&schema)
        .iter()
        .filter(|object| !object.fields.is_empty())
        .for_each(|object| describe(&mut page, &mut told, object, &defaults));
    is_generated("docs/reference/scenario.md", &page);
}

#[test]
fn every_setting_that_is_a_number_has_a_unit_in_its_description() {
    let schema = settings::schema();
    let tables = tables(&schema);
    let numbers = tables.iter().flat_map(|object| &object.fields).filter(|field| has_numbers(field.schema));
    let mut pure = vec![];
    for SchemaField { key, schema } in numbers {
        if units(text(schema)).is_empty() {
            pure.push(key.as_str());
        }
    }
    let unknown: Vec<_> = pure.iter().filter(|key| !PURE.contains(key)).collect();
    assert!(unknown.is_empty(), "give these settings a unit in brackets, or a place in `PURE`: {unknown:?}");
}
