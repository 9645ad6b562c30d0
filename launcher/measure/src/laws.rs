//! `measure laws`: the campaign `campaigns/aggressive.toml` as a table with a row for each controller.

use std::fmt::Write;
use std::path::PathBuf;

use campaign::OwnController;
use serde_json::json;
use toml::Value;
use view::table::Table;

use crate::findings::Findings;
use crate::shipped::{self, Flown};

#[derive(clap::Args)]
pub struct LawsArgs {
    /// Scenario files to fly besides the five aggressive ones
    pub scenario: Vec<PathBuf>,
    /// Fly this attitude controller too: a library of yours (repeatable)
    #[arg(long, value_name = "NAME=FILE")]
    pub controller: Vec<OwnController>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as table.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Returns the exit code.
pub fn measure(args: &LawsArgs) -> anyhow::Result<u8> {
    let flown = shipped::fly_with("aggressive", &args.controller, |text| with_cases(text, &args.scenario))?;
    let found = Findings::new(json!({ "flights": flown.flights.to_json() }), flown.targets(), false)?;
    found.conclude(args.out.as_deref(), "table.json", args.json, &table(&flown))
}

/// Adds scenario files to the text of a campaign, as cases with the names of the files.
fn with_cases(mut text: String, scenarios: &[PathBuf]) -> anyhow::Result<String> {
    for path in scenarios {
        let scenario = shipped::path_as_toml(path)?;
        let name = Value::from(&*path.file_stem().unwrap_or_default().to_string_lossy());
        write!(text, "\n[case.{name}]\nscenario = {scenario}\n")?;
    }
    Ok(text)
}

/// Makes the table: a row for each controller, a column for each case.
fn table(flown: &Flown) -> String {
    let campaign = &flown.plan.campaign;
    let row = |controller: &String| {
        let rows: Vec<usize> =
            (0..flown.flights.rows()).filter(|row| flown.text(*row, "controller") == controller).collect();
        let passed = rows.iter().filter(|row| flown.text(**row, "verdict") == "passed").count();
        let cells = rows.iter().map(|row| cell(flown, *row));
        [controller.clone()].into_iter().chain(cells).chain([format!("{passed}/{}", rows.len())]).collect()
    };
    let headings = [String::new()].into_iter().chain(campaign.cases().map(str::to_owned)).chain(["survived".into()]);
    Table {
        title: "ok: integral of the position error, commands clamped; survived: within 1 m of the reference in the end"
            .into(),
        headings: headings.collect(),
        rows: campaign.controllers.iter().map(|(name, _)| row(name)).collect(),
    }
    .text()
}

/// Describes a flight in a cell.
fn cell(flown: &Flown, row: usize) -> String {
    let number = |column| flown.number(row, column);
    match (flown.text(row, "verdict"), flown.text(row, "cause")) {
        ("passed", _) => {
            format!("ok {:.1} m s, {}", number("position_error_integral_ms"), number("commands_saturated"))
        }
        (_, "position error at the end") => format!("out of bounds, {:.1} m", number("final_position_error_m")),
        ("failed", _) => format!("diverged at {:.2} s", number("flown_s")),
        _ => "could not be flown".into(),
    }
}
