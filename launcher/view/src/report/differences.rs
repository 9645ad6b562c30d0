//! Settings of the flight that differ from the defaults of its profile: the table that the page opens with.

use contract::Scenario;

use crate::draw::{escape, table};
use crate::settings;

/// Returns the section with the settings that differ. Faults and swaps are listed one by one.
pub fn section(flown: &Scenario) -> String {
    let profile = format!("{:?}", flown.profile).to_lowercase();
    let rows = differences(flown);
    let told = if rows.is_empty() {
        format!("<p>Every setting is the default of profile <b>{profile}</b>.</p>")
    } else {
        let heading = format!("default of {profile}");
        let cells = |row: Vec<String>| {
            let mut cells: Vec<String> = row.iter().map(|words| escape(words)).collect();
            cells[0] = format!("<code>{}</code>", cells[0]);
            cells
        };
        table(&["setting", &heading, "this flight"], rows.into_iter().map(cells))
    };
    format!("<section id=\"differences\"><h2>What differs from the defaults</h2>{told}</section>")
}

/// Key, default and value of every setting that differs.
fn differences(flown: &Scenario) -> Vec<Vec<String>> {
    settings::differences(&[&Scenario::from(flown.profile), flown])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::DASH;
    use contract::scenario::{Fault, FaultKind, FaultTarget, Profile};

    #[test]
    fn only_settings_that_differ_are_told_with_their_default() {
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
        assert!(section(&flown).contains(kill));
    }
}
