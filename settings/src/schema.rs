//! The JSON Schema of a scenario file, for editors, programs and the reference pages.
//!
//! Types, descriptions and defaults come from the structs, ranges from the check. The schema is of draft 7, which
//! editors of TOML know. It shares no part by reference, because a range belongs to a key and not to a type.

use std::ops::Bound::{self, Excluded, Included};

use schemars::generate::{Contract, SchemaSettings};
use schemars::transform::{RecursiveTransform, Transform};
use schemars::{JsonSchema, Schema};
use serde_json::{Map, Value};

use crate::check::ranges::range_of;
use crate::table::run::Scenario;

/// Returns the schema of a scenario file. Every setting may be absent; unknown keys are errors. The defaults are those
/// of the profile robust.
pub fn schema() -> Value {
    let mut schema = schema_of::<Scenario>("Scenario of Trefoil", Contract::Deserialize);
    as_in_toml(&mut schema);
    add_ranges("", &mut schema);
    schema
}

/// Returns the schema of the type `T`, as it is read or as it is written: in draft 7, without references, and with
/// descriptions in plain text.
pub fn schema_of<T: JsonSchema>(title: &str, contract: Contract) -> Value {
    let settings = SchemaSettings::draft07().with(|settings| {
        settings.inline_subschemas = true;
        settings.contract = contract;
    });
    let mut schema = settings.into_generator().into_root_schema_for::<T>();
    RecursiveTransform(describe_plainly).transform(&mut schema);
    schema.insert("title".into(), title.into());
    schema.to_value()
}

/// Replaces the Markdown of Rust's documentation in a description, and removes Rust's names of number formats.
fn describe_plainly(schema: &mut Schema) {
    schema.remove("format");
    if let Some(Value::String(text)) = schema.get_mut("description") {
        let (whole, links) = (text.replace("\\[", "[").replace("\\]", "]"), ["[`", "`]"]);
        let paragraphs = whole.split("\n\n").map(|paragraph| paragraph.replace('\n', " "));
        *text = links.iter().fold(paragraphs.collect::<Vec<_>>().join("\n\n"), |text, link| text.replace(link, "`"));
    }
}

/// Removes null and defaults of whole tables: TOML has no null, and a table has the defaults of its keys.
pub fn as_in_toml(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            object.retain(|key, value| key != "default" || !(value.is_null() || value.is_object()));
            if let Some(Value::Array(types)) = object.get_mut("type") {
                types.retain(|name| name != "null");
                if let [only] = &types[..] {
                    let only = only.clone();
                    object.insert("type".into(), only);
                }
            }
            take_out_null(object);
            object.values_mut().for_each(as_in_toml);
        }
        Value::Array(all) => all.iter_mut().for_each(as_in_toml),
        _ => {}
    }
}

/// Replaces a choice between a schema and null by that schema.
fn take_out_null(object: &mut Map<String, Value>) {
    let Some(Value::Array(choices)) = object.get_mut("anyOf") else { return };
    choices.retain(|choice| choice["type"] != "null");
    if let [Value::Object(only)] = &choices[..] {
        let only = only.clone();
        object.remove("anyOf");
        for (key, value) in only {
            object.entry(key).or_insert(value);
        }
    }
}

/// Adds the range of each number below the dotted key `path`.
fn add_ranges(path: &str, schema: &mut Value) {
    if let Some(Value::Object(keys)) = schema.get_mut("properties") {
        for (name, inner) in keys {
            add_ranges(&if path.is_empty() { name.clone() } else { format!("{path}.{name}") }, inner);
        }
        return;
    }
    if schema["items"]["properties"].is_object() {
        return add_ranges(path, &mut schema["items"]);
    }
    let (low, high) = range_of(path);
    limit(schema, low, ["minimum", "exclusiveMinimum"]);
    limit(schema, high, ["maximum", "exclusiveMaximum"]);
}

/// Adds a limit to every number of a schema: the schema itself, or the parts of an array or a choice.
fn limit(schema: &mut Value, bound: Bound<f64>, [inclusive, exclusive]: [&str; 2]) {
    match schema {
        Value::Object(object) => {
            if object.get("type").is_some_and(|kind| kind == "number" || kind == "integer") {
                let given = match bound {
                    Included(limit) => Some((inclusive, limit)),
                    Excluded(limit) => Some((exclusive, limit)),
                    Bound::Unbounded => None,
                };
                if let Some((key, limit)) = given {
                    object.insert(key.into(), number(limit));
                }
            }
            for key in ["items", "anyOf", "oneOf"] {
                object.entry(key).and_modify(|inner| limit(inner, bound, [inclusive, exclusive]));
            }
        }
        Value::Array(all) => all.iter_mut().for_each(|inner| limit(inner, bound, [inclusive, exclusive])),
        _ => {}
    }
}

/// Returns `limit` as a JSON integer if it is whole.
fn number(limit: f64) -> Value {
    if limit.fract() == 0.0 && limit.abs() < 1e15 { Value::from(limit as i64) } else { Value::from(limit) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of<'a>(schema: &'a Value, key: &str) -> &'a Value {
        key.split('.').fold(schema, |schema, name| &schema["properties"][name])
    }

    #[test]
    fn a_number_has_the_range_of_its_key_its_default_and_its_meaning() {
        let schema = schema();
        let rate = of(&schema, "run.rate_hz");
        assert_eq!([&rate["minimum"], &rate["maximum"], &rate["default"]], [50, 2000, 100]);
        assert!(rate["description"].as_str().unwrap().contains("[Hz]"));
        assert_eq!(of(&schema, "plant.tilt_max_deg")["exclusiveMinimum"], 0);
        assert_eq!(of(&schema, "initial.position_m")["items"]["maximum"], 1_000_000_000);
        assert_eq!(of(&schema, "bounds.max_fallback_s")["maximum"], Value::Null, "infinity lifts a bound");
        assert_eq!(of(&schema, "plant.sensors.receiver.latency_ms")["maximum"], 500, "the narrower of two ranges");
    }

    #[test]
    fn every_table_refuses_unknown_keys_and_no_value_is_null() {
        fn check(path: &str, schema: &Value) {
            if let Some(keys) = schema["properties"].as_object() {
                assert_eq!(schema["additionalProperties"], false, "{path}");
                keys.iter().for_each(|(name, inner)| check(&format!("{path}.{name}"), inner));
            }
            assert!(schema["description"].as_str().is_some_and(|text| !text.is_empty()), "{path} has no description");
        }
        let schema = schema();
        check("", &schema);
        assert!(!schema.to_string().contains("null"));
    }
}
