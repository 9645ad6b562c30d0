//! Tables of Markdown from a JSON Schema.

use serde_json::Value;

/// A setting or field of a schema.
#[derive(Clone)]
pub struct SchemaField<'a> {
    /// Dotted key; `[]` after the name of an array.
    pub key: String,
    pub schema: &'a Value,
}

/// A table of a schema: an object with its fields.
pub struct Object<'a> {
    pub key: String,
    pub about: &'a str,
    pub fields: Vec<SchemaField<'a>>,
}

/// Lists the objects of `schema` in order, the schema itself first.
pub fn objects(schema: &Value) -> Vec<Object<'_>> {
    let mut found = vec![];
    collect("", schema, &mut found);
    found
}

fn collect<'a>(key: &str, schema: &'a Value, found: &mut Vec<Object<'a>>) {
    let Some(properties) = schema["properties"].as_object() else { return };
    let at = |name: &String| if key.is_empty() { name.clone() } else { format!("{key}.{name}") };
    let place = found.len();
    found.push(Object { key: key.into(), about: text(schema), fields: vec![] });
    for (name, inner) in properties {
        let (key, object) = object_in(at(name), inner);
        match object {
            Some(object) if object["properties"].is_object() => {
                let own = found.len();
                collect(&key, object, found);
                found[own].about = text(inner); // the text of the field says more than that of its type
            }
            _ => found[place].fields.push(SchemaField { key, schema: inner }),
        }
    }
}

/// Returns the object in a schema and its key: the schema itself, each element of an array, each value of a map, or the
/// choice beside null.
fn object_in(key: String, schema: &Value) -> (String, Option<&Value>) {
    let choices = schema["anyOf"].as_array().into_iter().flatten();
    let mut choices = choices.filter(|choice| choice["type"] != "null");
    match (choices.next(), choices.next()) {
        (Some(only), None) => object_in(key, only),
        _ if schema["items"]["properties"].is_object() => (key + "[]", Some(&schema["items"])),
        _ if schema["additionalProperties"]["properties"].is_object() => {
            (key + ".*", Some(&schema["additionalProperties"]))
        }
        _ => (key, Some(schema)),
    }
}

/// Returns the description of a schema; empty if it has none.
pub fn text(schema: &Value) -> &str {
    schema["description"].as_str().unwrap_or_default()
}

/// Names the type of a value in words.
pub fn type_of(schema: &Value) -> String {
    if let Some(all) = choices(schema).filter(|_| schema["oneOf"].is_array()) {
        let names: Vec<String> = all.iter().map(|(name, _)| format!("`{name}`")).collect();
        return if names.len() > 6 { "one of those below".into() } else { names.join(", ") };
    }
    if let Some(any) = schema["anyOf"].as_array() {
        return any.iter().map(type_of).filter(|name| !name.is_empty()).collect::<Vec<_>>().join(" or ");
    }
    match &schema["type"] {
        Value::Array(types) => {
            let of = |kind: &str| if kind == "array" { array(schema) } else { name(kind).to_owned() };
            types.iter().filter_map(Value::as_str).map(of).collect::<Vec<_>>().join(" or ")
        }
        kind if kind == "array" => array(schema),
        kind if kind == "object" && schema["additionalProperties"].is_object() => {
            format!("table of {}", type_of(&schema["additionalProperties"]))
        }
        kind => kind.as_str().map_or(String::new(), |kind| name(kind).into()),
    }
}

fn array(schema: &Value) -> String {
    match (&schema["items"], schema["minItems"].as_u64().filter(|least| schema["maxItems"] == *least)) {
        (Value::Array(items), _) => format!("[{}]", items.iter().map(type_of).collect::<Vec<_>>().join(", ")),
        (item, Some(count)) => format!("{count} x {}", type_of(item)),
        (item, None) => format!("list of {}", type_of(item)),
    }
}

fn name(json: &str) -> &str {
    match json {
        "integer" => "whole number",
        "boolean" => "`true`, `false`",
        "string" => "text",
        "object" => "table",
        other => other,
    }
}

/// Returns the words that a value may have, each with its meaning; `None` if the value is no choice of words.
pub fn choices(schema: &Value) -> Option<Vec<(&str, &str)>> {
    let inner = schema["anyOf"].as_array().and_then(|all| all.iter().find_map(choices));
    if inner.is_some() {
        return inner;
    }
    let one_of = schema["oneOf"].as_array()?;
    let found: Vec<(&str, &str)> = one_of.iter().filter_map(|one| Some((one["const"].as_str()?, text(one)))).collect();
    (found.len() == one_of.len()).then_some(found)
}

/// Formats the range of a number, or of the numbers of an array; empty if there is no range.
pub fn range_of(schema: &Value) -> String {
    let inner = |schema: &Value| ["items", "anyOf", "oneOf"].iter().find_map(|key| first_range(&schema[*key]));
    let bound = |key: &str| schema[key].as_f64().map(plain);
    let low = bound("minimum").map(|x| format!("\u{2265} {x}"));
    let low = low.or_else(|| bound("exclusiveMinimum").map(|x| format!("> {x}")));
    let high = bound("maximum").map(|x| format!("\u{2264} {x}"));
    let high = high.or_else(|| bound("exclusiveMaximum").map(|x| format!("< {x}")));
    let own: Vec<String> = low.into_iter().chain(high).collect();
    if own.is_empty() { inner(schema).unwrap_or_default() } else { own.join(", ") }
}

fn first_range(schema: &Value) -> Option<String> {
    match schema {
        Value::Array(all) => all.iter().find_map(first_range),
        Value::Object(_) => Some(range_of(schema)).filter(|range| !range.is_empty()),
        _ => None,
    }
}

fn plain(x: f64) -> String {
    if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") }
}

/// Formats a row of a table.
pub fn row(cells: &[&str]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| cell.replace('|', "\\|").replace("\n\n", " ")).collect();
    format!("| {} |\n", cells.join(" | "))
}

/// Formats the head of a table.
pub fn head(names: &[&str]) -> String {
    format!("{}|{}\n", row(names), "---|".repeat(names.len()))
}

/// Formats the words that fields may have with their meanings, as lists; fields with the same words share a list.
/// `told` has the lists that the page has already.
pub fn meanings(fields: &[SchemaField], told: &mut Vec<String>) -> String {
    let mut lists: Vec<(String, Vec<&str>)> = vec![];
    for SchemaField { key, schema } in fields {
        let all = choices(schema).unwrap_or_default();
        let list: String = all.iter().map(|(word, meaning)| format!("- `{word}`: {meaning}\n")).collect();
        match lists.iter_mut().find(|(other, _)| *other == list) {
            Some((_, keys)) => keys.push(key),
            None if !list.is_empty() && !told.contains(&list) => lists.push((list, vec![key])),
            None => {}
        }
    }
    told.extend(lists.iter().map(|(list, _)| list.clone()));
    let text = |(list, keys): &(String, Vec<&str>)| format!("\n`{}`:\n\n{list}", keys.join("`, `"));
    lists.iter().map(text).collect()
}
