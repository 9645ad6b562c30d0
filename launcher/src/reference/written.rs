//! docs/reference/run-json.md: the fields of run.json.

use super::is_generated;
use super::page::{Object, SchemaField, head, meanings, objects, row, text, type_of};

const RUN: &str = "# run.json

This page is for users who read the record of a flight by a program. It is generated from
[`run_record.rs`](../../launcher/outcome/src/run_record.rs); a test compares. `trefoil schema run` prints the JSON Schema
([`run.json`](../schema/run.json)). `[]` stands for each element of a list, `*` for each name, such as that of a node. Fields
may be added within a version (`provenance.schema_version`); a reader ignores those that it does not know.
";

const HEADS: [&str; 3] = ["field", "type", "meaning"];

fn rows(fields: &[SchemaField], told: &mut Vec<String>) -> String {
    let name = |field: &SchemaField| field.key.rsplit('.').next().unwrap_or_default().to_owned();
    let line = |field: &SchemaField| row(&[&format!("`{}`", name(field)), &type_of(field.schema), text(field.schema)]);
    head(&HEADS) + &fields.iter().map(line).collect::<String>() + &meanings(fields, told)
}

/// Returns names and descriptions of the fields of an object, which are equal for objects of one type.
fn form(object: &Object) -> Vec<(String, String)> {
    let of = |field: &SchemaField| (field.key.replacen(&object.key, "", 1), text(field.schema).to_owned());
    object.fields.iter().map(of).collect()
}

#[test]
fn the_page_of_run_json_is_generated() {
    let schema = outcome::run_record::schema();
    let (mut run, mut seen, mut told) = (RUN.to_owned(), vec![], vec![]);
    for object in objects(&schema).iter().filter(|object| !object.fields.is_empty()) {
        let title = if object.key.is_empty() { "Top of the file".to_owned() } else { format!("`{}`", object.key) };
        run += &format!("\n## {title}\n\n{}\n\n", object.about);
        let form = form(object);
        if let Some((_, first)) = seen.iter().find(|(other, _)| *other == form) {
            run += &format!("The fields are those of `{first}`.\n");
        } else {
            run += &rows(&object.fields, &mut told);
            seen.push((form, object.key.clone()));
        }
    }
    is_generated("docs/reference/run-json.md", &run);
}

#[test]
fn every_field_of_run_json_is_described() {
    let schema = outcome::run_record::schema();
    let all = objects(&schema);
    let bare = all.iter().flat_map(|object| &object.fields).filter(|field| text(field.schema).is_empty());
    assert_eq!(bare.map(|field| field.key.as_str()).collect::<Vec<_>>(), [""; 0]);
}
