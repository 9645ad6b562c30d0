//! The JSON Schema of a campaign file: the keys of the file, and below them the settings of a scenario.

use schemars::generate::Contract;
use serde_json::{Value, json};
use settings::{as_in_toml, schema_of};

use crate::form::File;
use crate::variation::{Variation, WORDS};

/// Returns the JSON Schema of a campaign file. Its settings are those of a scenario, without defaults.
pub fn schema() -> Value {
    let mut schema = schema_of::<File>("Campaign of Trefoil", Contract::Deserialize);
    as_in_toml(&mut schema);
    let mut settings = settings::schema();
    settings["title"] = "Settings of a flight".into();
    without_defaults(&mut settings);
    let mut case = settings.clone();
    case["properties"]["scenario"] =
        json!({ "type": "string", "description": "Path of the scenario of this case, relative to this file." });
    let mut variation = schema_of::<Variation>("Values of a setting", Contract::Deserialize);
    as_in_toml(&mut variation);
    let value = json!({ "anyOf": [{ "type": "array", "minItems": 1 }, variation, { "$ref": "#/definitions/vary" }] });
    let names = json!({ "not": { "enum": WORDS } });
    let vary = json!({ "type": "object", "minProperties": 1, "propertyNames": names, "additionalProperties": value });
    schema["definitions"] = json!({ "settings": settings, "case": case, "vary": vary });
    let named = |name: &str| json!({ "$ref": format!("#/definitions/{name}") });
    let properties = &mut schema["properties"];
    for key in ["settings", "vary"] {
        properties[key]["allOf"] = json!([named(key)]);
    }
    properties["controller"]["additionalProperties"] = named("settings");
    properties["case"]["additionalProperties"] = named("case");
    schema
}

/// Removes every default, because an absent setting has the scenario's value.
fn without_defaults(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            object.remove("default"); // no setting has this name
            object.values_mut().for_each(without_defaults);
        }
        Value::Array(all) => all.iter_mut().for_each(without_defaults),
        _ => {}
    }
}
