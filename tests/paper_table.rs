//! The figures of docs/paper.md: every row of their tables of flights is flown and compared, to the
//! digits that are printed.
//!
//! A table is one of flights when its first heading is a command, `fly ...`; the first cell of each row has what is
//! added to it. The other headings say what the figures are. A lost flight (see [`is_lost`]) has no figures.

use airframe::{Parameters, Trim};
use settings::Scenario;

use crate::harness::{Outcome, fly, launcher, top};
use crate::paper::altitude_errors_m;

/// Headings of figures, and their metrics in run.json. `10-50 s` and `vertical` come from the log.
const FIGURES: [(&str, &str); 4] = [
    ("max error", "max_position_error_m"),
    ("RMS", "rms_position_error_m"),
    ("altitude", "max_altitude_error_m"),
    ("clipped", "commands_saturated"),
];
const HORIZONTAL: &str = "10-50 s";
const VERTICAL: &str = "vertical";
/// Farther off, a flight counts as lost \[m\].
const LOST_M: f64 = 10.0;

/// One line of a table of flights.
#[derive(Clone)]
struct Row {
    arguments: Vec<String>,
    headings: Vec<String>,
    cells: Vec<String>,
}

impl Row {
    /// Differences between the row and its flight.
    fn differences(&self) -> Vec<String> {
        let arguments: Vec<&str> = self.arguments.iter().map(String::as_str).collect();
        let outcome = fly(&arguments);
        let lost = is_lost(&outcome);
        let needs_log = |heading: &String| [HORIZONTAL, VERTICAL, "claims"].contains(&heading.as_str());
        let altitude_m =
            if !lost && self.headings.iter().any(needs_log) { altitude_errors_m(&outcome) } else { [f64::NAN; 2] };
        let figures = self.headings.iter().zip(&self.cells).filter_map(|(heading, printed)| {
            let flown = match (heading.as_str(), FIGURES.iter().find(|(figure, _)| figure == heading)) {
                ("claims", _) if lost => "lost".to_owned(),
                ("claims", _) => (if claims_hold(&outcome, altitude_m) { "hold" } else { "fail" }).to_owned(),
                ("solved", _) if !lost => outcome.run()["solver"]["solved"].to_string(),
                (_, Some((_, metric))) if !lost => format!("{:.*}", digits(printed), outcome.metric(metric)),
                (HORIZONTAL, _) if !lost => format!("{:.*}", digits(printed), altitude_m[0]),
                (VERTICAL, _) if !lost => format!("{:.*}", digits(printed), altitude_m[1]),
                ("solved" | HORIZONTAL | VERTICAL, _) | (_, Some(_)) => "-".to_owned(),
                (_, None) => return None,
            };
            (flown != *printed).then(|| format!("{}: {heading} is {flown}, not {printed}", arguments.join(" ")))
        });
        figures.collect()
    }
}

/// Digits after the point.
fn digits(printed: &str) -> usize {
    printed.split_once('.').map_or(0, |(_, digits)| digits.len())
}

/// Returns whether the vehicle was lost: the run counts as diverged, or the error is beyond all use.
fn is_lost(outcome: &Outcome) -> bool {
    outcome.run()["diverged"] == true || outcome.metric("max_position_error_m") > LOST_M
}

/// Section 5 of the paper: the errors; (51); and (52) and (53), by no command having been clipped.
fn claims_hold(outcome: &Outcome, [horizontal_m, vertical_m]: [f64; 2]) -> bool {
    outcome.metric("max_position_error_m") < 0.7
        && horizontal_m < 0.1
        && vertical_m <= 0.2
        && outcome.metric("max_rate_radps") < std::f64::consts::TAU
        && outcome.metric("commands_saturated") == 0.0
}

/// The rows of the tables of flights on a page.
fn rows(page: &str) -> Vec<Row> {
    let mut found = vec![];
    let mut headings: Option<Vec<String>> = None;
    for line in page.lines() {
        let Some(line) = line.strip_prefix('|') else {
            headings = None;
            continue;
        };
        let cells: Vec<String> = line.trim_end_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
        match &headings {
            None => headings = Some(cells),
            Some(headings) if headings[0].starts_with("`fly ") && !cells[0].starts_with("--") => {
                assert_eq!(headings.len(), cells.len(), "{line}");
                let arguments = [&headings[0], &cells[0]].map(|cell| words(cell)).concat();
                found.push(Row { arguments: arguments[1..].to_vec(), headings: headings.clone(), cells });
            }
            Some(_) => {}
        }
    }
    found
}

/// The words of a command in backticks, as a shell divides them: by spaces outside single quotes. `-` is no command.
fn words(cell: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quoted = false;
    for letter in cell.trim_matches('`').chars() {
        match letter {
            '\'' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            letter => words.last_mut().expect("at least one word").push(letter),
        }
    }
    words.retain(|word| word != "-");
    words
}

fn page(name: &str) -> String {
    std::fs::read_to_string(top().join("docs").join(name)).expect("a page that is readable")
}

#[test]
fn every_flight_on_these_pages_gives_the_figures_printed() {
    let rows = rows(&page("paper.md"));
    assert!(rows.len() > 60, "{} rows are flights", rows.len());
    for row in &rows {
        let known = |heading: &&String| {
            FIGURES.iter().any(|(figure, _)| figure == heading)
                || ["claims", "solved", HORIZONTAL, VERTICAL, "what it is"].contains(&heading.as_str())
        };
        let unknown: Vec<_> = row.headings[1..].iter().filter(|heading| !known(heading)).collect();
        assert!(unknown.is_empty(), "headings without a meaning here: {unknown:?}");
    }
    let halves = rows.split_at(rows.len() / 2);
    let differences: Vec<String> = std::thread::scope(|scope| {
        let halves = [halves.0, halves.1]
            .map(|half| scope.spawn(move || half.iter().flat_map(Row::differences).collect::<Vec<_>>()));
        halves.into_iter().flat_map(|half| half.join().expect("flights end")).collect()
    });
    assert!(differences.is_empty(), "the pages say otherwise:\n{}", differences.join("\n"));
}

/// The rows of the table whose first heading is the command of the campaign: name, passed, of, share, interval.
fn joint_rows(page: &str) -> Vec<Vec<String>> {
    let table = page.lines().skip_while(|line| !line.starts_with("| `campaign ")).skip(2);
    let rows = table.take_while(|line| line.starts_with('|'));
    rows.map(|row| row.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()).collect()
}

#[test]
fn all_openings_at_once_give_the_shares_printed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let campaign = top().join("campaigns/paper-openings.toml");
    let output = launcher().arg("campaign").arg(campaign).arg("--out").arg(folder.path()).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let rows = joint_rows(&page("paper.md"));
    assert_eq!(rows.len(), 2);
    for row in rows {
        let printed = row.iter().map(|cell| cell.trim_matches('`')).collect::<Vec<_>>().join(" ");
        let flown = said.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "));
        assert!(flown.into_iter().any(|line| line == printed), "docs/paper.md has \"{printed}\", flown is:\n{said}");
    }
}

#[test]
fn a_row_is_its_heading_and_its_first_cell() {
    let page = "| `fly a.toml` | max error |\n|---|---|\n| `--set 'x=[1, 2]' --set y=z` | 0.5 |\n| - | 1 |\n\n| other |\n|---|\n| `b` |";
    let arguments: Vec<_> = rows(page).into_iter().map(|row| row.arguments).collect();
    assert_eq!(arguments, [&["a.toml", "--set", "x=[1, 2]", "--set", "y=z"][..], &["a.toml"]]);
}

/// Computes the figure of a row of the page on the airframe.
fn of_the_airframe(row: &str, scenario: &Scenario) -> f64 {
    let vehicle = &scenario.airframe;
    let Parameters { g_mps2, mass_kg, iyy_kgm2, kf, km, .. } = *vehicle;
    let trim = Trim::solve(vehicle, false);
    let [omega_1, omega_2, _] = trim.actuation.rotor_speed;
    let moment_nm = km * omega_1 * omega_1 * trim.actuation.tilt_rad.sin();
    let full_thrust_n: f64 = scenario.limits().rotor_speed_max.iter().map(|omega| kf * omega * omega).sum();
    match row {
        "mass, kg" => mass_kg,
        "Ixx, kg m2" => vehicle.ixx_kgm2,
        "Iyy, kg m2" => iyy_kgm2,
        "Izz, kg m2" => vehicle.izz_kgm2,
        "K_M / K_F, m" => km / kf,
        "Omega_1 at trim" => omega_1,
        "Omega_2 at trim" => omega_2,
        "roll at trim, degrees" => trim.roll_rad.to_degrees(),
        "tilt at trim, degrees" => trim.actuation.tilt_rad.to_degrees(),
        "thrust over weight at full speed" => full_thrust_n / (mass_kg * g_mps2),
        "power at the shafts in hover, W" => trim.actuation.rotor_speed.iter().map(|omega| km * omega.powi(3)).sum(),
        "neglected moment K_M Omega_1^2 sin mu, N m" => moment_nm,
        "the same over Iyy, rad/s2" => moment_nm / iyy_kgm2,
        row => panic!("no such row of an airframe: {row}"),
    }
}

#[test]
fn the_airframes_have_the_numbers_of_the_page() {
    let [paper, ten_inch] = ["airframe.preset=\"paper\"", "airframe.preset=\"ten-inch\""]
        .map(|preset| settings::load(None, &["profile=\"paper\"".into(), preset.into()]).expect("settings"));
    let page = page("paper.md");
    let table = page.lines().skip_while(|line| !line.starts_with("| of the airframe")).skip(2);
    let rows: Vec<&str> = table.take_while(|line| line.starts_with('|')).collect();
    assert_eq!(rows.len(), 13);
    for row in rows {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        for (scenario, printed) in [&paper, &ten_inch].into_iter().zip(&cells[1..]) {
            assert_eq!(
                format!("{:.*}", digits(printed), of_the_airframe(cells[0], scenario)),
                **printed,
                "{}",
                cells[0]
            );
        }
    }
}
