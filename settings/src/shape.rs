//! The shape of one source: TOML, known keys, right types. No other source is needed, so errors point into the text.

use std::ops::Range;
use std::sync::LazyLock;

use serde_json::Value as Json;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use crate::moved;
use crate::moved::{Moved, NameKind, Replacement};
use crate::schema::schema;
use crate::table::run::Scenario;
use crate::text::report::{MAX_PROBLEMS, Problem, SettingsText};
use crate::words::{at, nearest, shortened, suggest};

const ALL_NAMES: &str = "docs/names.md has all old names with the new ones";

const SET_HELP: &str = "write `--set key=value`, for instance `--set run.duration_s=20`";

/// Reads the settings of `source`, or returns the problems with their shape.
pub fn read(source: &SettingsText) -> Result<Table, Vec<Problem<'_>>> {
    let settings: Table = source.text.parse().map_err(|error| vec![not_toml(source, &error)])?;
    let tree = DeTable::parse(&source.text).map_err(|error| vec![not_toml(source, &error)])?.into_inner();
    let mut problems = vec![];
    if source.path.is_none() && settings.is_empty() {
        problems.push(Problem { title: "nothing to set".into(), place: Some((source, 0..0)), help: SET_HELP.into() });
    }
    let mut keys = Keys { source, problems };
    keys.check("", &tree, example());
    if !keys.problems.is_empty() {
        return Err(keys.problems);
    }
    let scenario: Scenario =
        toml::from_str(&source.text).map_err(|error| vec![wrong_type(source, &tree, error.message(), error.span())])?;
    let kept = Table::try_from(scenario).expect("what came from TOML has a form in it");
    match surplus("", &Value::Table(settings.clone()), &Value::Table(kept)) {
        Some((key, given, kept)) => {
            let message = format!("invalid length {given}, expected {kept}");
            Err(vec![wrong_type(source, &tree, &message, span_of(&tree, &key))])
        }
        None => Ok(settings),
    }
}

/// Finds the place where `key` got its value: the last source that sets it, and the bytes there.
pub fn find<'a>(sources: &'a [SettingsText], key: &str) -> Option<(&'a SettingsText, Range<usize>)> {
    sources.iter().rev().find_map(|source| {
        let tree = DeTable::parse(&source.text).ok()?;
        Some((source, span_of(tree.get_ref(), key)?))
    })
}

/// Returns every known key with an example of its value.
fn example() -> &'static Table {
    static EXAMPLE: LazyLock<Table> =
        LazyLock::new(|| example_of(&schema()).try_into().expect("the schema is one of a table"));
    &EXAMPLE
}

/// Makes an example of what `schema` allows: its default or its own example, or any value. A table with required
/// keys gets only the required keys.
fn example_of(schema: &Json) -> Value {
    let is_full = |value: &&Json| value.as_array().is_none_or(|all| !all.is_empty());
    let given = schema.get("default").filter(is_full).or_else(|| schema["examples"].get(0));
    if let Some(Ok(value)) = given.map(Value::try_from) {
        return value;
    }
    if let Some(first) = schema["anyOf"].get(0).or_else(|| schema["oneOf"].get(0)) {
        return example_of(first);
    }
    let is_needed = |key: &str| schema["required"].as_array().is_none_or(|all| all.iter().any(|needed| needed == key));
    match (schema["type"].as_str(), &schema["properties"], &schema["items"]) {
        (Some("object"), Json::Object(keys), _) => {
            let needed = keys.iter().filter(|(key, _)| is_needed(key));
            Value::Table(needed.map(|(key, of)| (key.clone(), example_of(of))).collect())
        }
        (Some("object"), ..) => Value::Table([("NAME".to_owned(), "value".into())].into_iter().collect()),
        (Some("array"), _, Json::Array(each)) => each.iter().map(example_of).collect::<Vec<_>>().into(),
        (Some("array"), _, each) => vec![example_of(each); schema["minItems"].as_u64().unwrap_or(1) as usize].into(),
        (Some("boolean"), ..) => true.into(),
        (Some("integer"), ..) => schema["minimum"].as_i64().unwrap_or(1).max(1).into(),
        (Some("number"), ..) => schema["maximum"].as_f64().unwrap_or(1.0).min(1.0).into(),
        _ => schema["const"].as_str().unwrap_or("text").into(),
    }
}

fn not_toml<'a>(source: &'a SettingsText, error: &toml::de::Error) -> Problem<'a> {
    let help = match source.path {
        Some(_) => "a scenario is a TOML file: tables `[run]`, settings `key = value`",
        None => SET_HELP,
    };
    let place = Some((source, error.span().unwrap_or_default()));
    Problem { title: format!("not TOML: {}", error.message()), place, help: help.into() }
}

/// Keys of one source, and the first problems with them.
struct Keys<'a> {
    source: &'a SettingsText,
    problems: Vec<Problem<'a>>,
}

impl Keys<'_> {
    /// Requires that every key is known, and is a table exactly where a table is expected.
    fn check(&mut self, path: &str, given: &DeTable, known: &Table) {
        for (name, value) in given {
            let key = join(path, name.get_ref());
            let (title, span, help) = match (known.get(name.get_ref().as_ref()), value.get_ref()) {
                (None, DeValue::Table(given)) if moved::were_in(&key) && !given.is_empty() => {
                    self.check(&key, given, &Table::new());
                    continue;
                }
                (None, _) => {
                    let (title, help) = self.unknown(path, name.get_ref(), known);
                    (title, name.span(), help)
                }
                (Some(Value::Table(known)), DeValue::Table(given)) => {
                    if !has_any_keys(&key) {
                        self.check(&key, given, known);
                    }
                    continue;
                }
                (Some(Value::Table(known)), _) => {
                    (format!("`{key}` is a table"), value.span(), format!("set its keys one by one: {}", list(known)))
                }
                (Some(known), DeValue::Table(_)) => {
                    (format!("`{key}` is not a table"), name.span(), format!("for example `{key} = {known}`"))
                }
                _ => continue,
            };
            self.problems.push(Problem { title, place: Some((self.source, span)), help });
            if self.problems.len() > MAX_PROBLEMS {
                return; // a file may have a million wrong keys
            }
        }
    }

    /// Returns title and help for the key `name` that is not `known` at `path`.
    fn unknown(&self, path: &str, name: &str, known: &Table) -> (String, String) {
        let key = join(path, name);
        let is_known = |moved: &Moved| moved.name.as_ref().is_none_or(|new| at(example(), new).is_some());
        if let Some(Moved { title, name, now }) = moved::find(NameKind::Key, &key).filter(is_known) {
            let help = match (now, name) {
                (Replacement::Seconds(_), Some(new)) => self.in_seconds(&key, &new),
                _ => ALL_NAMES.into(),
            };
            return (title, help);
        }
        let new = moved::find(NameKind::Key, path).and_then(|moved| moved.name);
        let table = new.as_ref().and_then(|new| at(example(), new)?.as_table());
        let help = match (&new, table) {
            (Some(new), Some(table)) => help_on(new, name, table),
            _ => help_on(path, name, known),
        };
        (format!("unknown key `{}`", shortened(&key)), help)
    }

    /// Returns help on the key `old`, a number of samples: the same time as a value of the key `new`, at the rate that
    /// this source sets, or else at the default rate.
    fn in_seconds(&self, old: &str, new: &str) -> String {
        let number = |of: &Table, key: &str| {
            let (table, name) = key.split_once('.')?;
            u32::try_from(of.get(table)?.get(name)?.as_integer()?).ok().filter(|number| *number > 0)
        };
        let given: Table = self.source.text.parse().unwrap_or_default();
        let rate_hz = number(&given, "run.rate_hz").or_else(|| number(example(), "run.rate_hz"));
        match (number(&given, old), rate_hz) {
            (Some(samples), Some(rate_hz)) => {
                let time_s = f64::from(samples) / f64::from(rate_hz);
                format!("{samples} samples at {rate_hz} Hz are `{new} = {time_s:?}`")
            }
            _ => format!("`{new}` is the number of samples by `run.rate_hz`"),
        }
    }
}

/// Returns help on the unknown key `name`: the key that was probably meant, and the known keys.
fn help_on(path: &str, name: &str, known: &Table) -> String {
    let has_it =
        |tables: &Table| tables.iter().find(|(_, table)| table.get(name).is_some()).map(|(table, _)| table.clone());
    let table = has_it(known).map(|within| join(path, &within)).or_else(|| has_it(example()));
    let hint = match (table, nearest(name, known.keys().map(String::as_str))) {
        (Some(table), _) => format!("did you mean `{table}.{name}`? "),
        (None, Some(nearest)) => format!("did you mean `{}`? ", join(path, nearest)),
        _ => String::new(),
    };
    let table = if path.is_empty() { "at the top".into() } else { format!("in `{path}`") };
    format!("{hint}known {table}: {}", list(known))
}

/// Returns whether the table at `key` may have any keys: settings, environment and file hashes of a program.
fn has_any_keys(key: &str) -> bool {
    matches!(key.split('.').collect::<Vec<_>>()[..], ["node", _, "settings" | "env" | "files"])
}

fn wrong_type<'a>(source: &'a SettingsText, tree: &DeTable, message: &str, span: Option<Range<usize>>) -> Problem<'a> {
    let span = span.unwrap_or_default();
    let key = key_at(tree, "", span.start).unwrap_or_default();
    let value = at(example(), &key);
    if let Some(Moved { title, .. }) = moved::refused(&key, source.text.get(span.clone()).unwrap_or_default(), message)
    {
        return Problem { title, place: Some((source, span)), help: ALL_NAMES.into() };
    }
    let message = &suggest(message);
    // Serde's messages name Rust's types.
    let message =
        [("f64", "a number"), ("usize", "a whole number"), ("u64", "a whole number"), ("u32", "a whole number")]
            .iter()
            .fold(message.to_owned(), |text, (rust, plain)| {
                text.replace(&format!("expected {rust}"), &format!("expected {plain}"))
            });
    Problem {
        title: if key.is_empty() { message } else { format!("`{key}`: {message}") },
        place: Some((source, span)),
        help: value.map_or(String::new(), |value| format!("for example `{key} = {value}`")),
    }
}

/// Finds the first array that is longer than the part of it that Serde `kept`, and returns its key and both lengths:
/// Serde stops reading where an array of fixed length is full.
fn surplus(path: &str, given: &Value, kept: &Value) -> Option<(String, usize, usize)> {
    match (given, kept) {
        (Value::Table(given), Value::Table(kept)) => {
            given.iter().find_map(|(name, value)| surplus(&join(path, name), value, kept.get(name)?))
        }
        (Value::Array(given), Value::Array(kept)) if given.len() == kept.len() => {
            given.iter().zip(kept).find_map(|(given, kept)| surplus(path, given, kept))
        }
        (Value::Array(given), Value::Array(kept)) => Some((path.into(), given.len(), kept.len())),
        _ => None,
    }
}

/// Bytes of the value of a dotted key; a number in the key is the index of an array element, from 0. `None` if the key
/// is not in the tree.
fn span_of(tree: &DeTable, key: &str) -> Option<Range<usize>> {
    let Some((name, rest)) = key.split_once('.') else { return tree.get(key).map(Spanned::span) };
    match tree.get(name)?.get_ref() {
        DeValue::Table(inner) => span_of(inner, rest),
        DeValue::Array(all) => {
            let (number, rest) = rest.split_once('.').map_or((rest, None), |(number, rest)| (number, Some(rest)));
            let element = all.get(number.parse::<usize>().ok()?)?;
            rest.map_or(Some(element.span()), |rest| span_of(element.get_ref().as_table()?, rest))
        }
        _ => None,
    }
}

/// Dotted key whose value stands at `byte`.
fn key_at(tree: &DeTable, path: &str, byte: usize) -> Option<String> {
    tree.iter().find_map(|(name, value)| {
        let key = join(path, name.get_ref());
        let inner = value.get_ref().as_table().and_then(|tree| key_at(tree, &key, byte));
        inner.or_else(|| value.span().contains(&byte).then_some(key))
    })
}

fn join(table: &str, name: &str) -> String {
    if table.is_empty() { name.into() } else { format!("{table}.{name}") }
}

fn list(known: &Table) -> String {
    known.keys().map(String::as_str).collect::<Vec<_>>().join(", ")
}
