//! docs/reference/log.md: topics and fields of `flight.mcap`, from the comments of its schema.

use super::is_generated;
use super::page::{head, row};

const SCHEMA: &str = include_str!("../../flight/proto/trefoil.proto");

const PAGE: &str = "# The flight log

This page is for users who read `flight.mcap`: every topic and field with its unit and frame. It is generated from the
schema of the log, [`trefoil.proto`](../../launcher/flight/proto/trefoil.proto), which every log carries; a test compares.
Foxglove, PlotJuggler, Rerun and the Python package `mcap` read it.
";

/// A message or an enumeration of the schema.
struct Part {
    name: String,
    about: String,
    /// Cells of each field: name, type or number, meaning.
    fields: Vec<[String; 3]>,
}

/// Reads the comments at the top, the messages and the enumerations.
fn parts(schema: &str) -> (String, Vec<Part>) {
    let (mut about, mut intro, mut found): (Vec<&str>, String, Vec<Part>) = (vec![], String::new(), vec![]);
    for line in schema.lines().map(str::trim) {
        if let Some(comment) = line.strip_prefix("//") {
            about.push(comment.trim());
            continue;
        }
        let told = about.split(|line| line.is_empty()).map(|lines| lines.join(" ")).collect::<Vec<_>>().join("\n\n");
        about.clear();
        let words: Vec<&str> = line.split([' ', ';']).collect();
        match words[..] {
            ["syntax", ..] => intro = told,
            ["message" | "enum", name, "{", ..] => found.push(Part { name: name.into(), about: told, fields: vec![] }),
            [rule @ ("required" | "optional" | "repeated"), kind, name, "=", ..] => {
                let rule = if rule == "required" { String::new() } else { format!("{rule} ") };
                let fields = &mut found.last_mut().expect("a field is in a message").fields;
                fields.push([format!("`{name}`"), format!("{rule}{}", linked(kind)), told]);
            }
            [name, "=", number, ..] if name.chars().all(|c| c.is_ascii_uppercase() || c == '_') => {
                let fields = &mut found.last_mut().expect("a value is in an enumeration").fields;
                fields.push([format!("`{name}`"), number.into(), told]);
            }
            _ => {}
        }
    }
    (intro, found)
}

/// Returns the name of a type; the name of a type of this schema is a link to its section.
fn linked(kind: &str) -> String {
    if kind.starts_with(char::is_uppercase) { format!("[{kind}](#{})", kind.to_lowercase()) } else { kind.into() }
}

#[test]
fn the_page_of_the_log_is_generated() {
    let (intro, parts) = parts(SCHEMA);
    assert!(parts.len() > 15 && parts.iter().map(|part| part.fields.len()).sum::<usize>() > 80, "the schema is read");
    let mut page = format!("{PAGE}\n{intro}\n\n## Topics\n\n{}", head(&["topic", "message", "contents"]));
    for part in &parts {
        if let Some((topic, about)) = part.about.split_once(": ").filter(|(topic, _)| topic.starts_with('/')) {
            page += &row(&[&format!("`{topic}`"), &linked(&part.name), about]);
        }
    }
    for Part { name, about, fields } in &parts {
        page += &format!("\n## {name}\n\n{about}{}", if about.is_empty() { "" } else { "\n\n" });
        page += &head(&["field", "type", "meaning"]);
        fields.iter().for_each(|cells| page += &row(&cells.each_ref().map(String::as_str)));
    }
    is_generated("docs/reference/log.md", &page);
}
