//! Settings of the flight that differ from the defaults of its profile. Those set by a `preset` are
//! folded away.

use flight::event::name;
use settings::{Scenario, load};

use crate::differing_settings::differences as differing;
use crate::draw::{escape, table};

/// Returns the section with the settings that differ. Faults and swaps are listed one by one.
pub fn section(flown: &Scenario) -> String {
    let profile = format!("{:?}", flown.profile).to_lowercase();
    let (presets, rows): (Vec<_>, Vec<_>) = {
        let own = differing(&[&with_presets(flown), flown]);
        let is_own = |row: &Vec<String>| row[0].ends_with(".preset") || own.iter().any(|own| own[0] == row[0]);
        differences(flown).into_iter().partition(|row| !is_own(row))
    };
    let heading = format!("default of {profile}");
    let shown = |rows: Vec<Vec<String>>| {
        let cells = |row: Vec<String>| {
            let mut cells: Vec<String> = row.iter().map(|words| escape(words)).collect();
            cells[0] = format!("<code>{}</code>", cells[0]);
            cells
        };
        table(&["setting", &heading, "this flight"], rows.into_iter().map(cells))
    };
    let mut told = if rows.is_empty() {
        format!("<p>Every setting is the default of profile <b>{profile}</b>.</p>")
    } else {
        shown(rows)
    };
    if !presets.is_empty() {
        let number = presets.len();
        let folded = format!("<details><summary>{number} settings by preset</summary>{}</details>", shown(presets));
        told.push_str(&folded);
    }
    format!("<section id=\"differences\"><h2>What differs from the defaults</h2>{told}</section>")
}

/// Returns the defaults of the profile and the presets that `flown` has.
fn with_presets(flown: &Scenario) -> Scenario {
    let presets = [
        format!("profile={}", name(flown.profile)),
        format!("airframe.preset={}", name(flown.airframe.preset)),
        format!("plant.sensors.preset={}", name(flown.plant.sensors.preset)),
    ];
    load(None, &presets).unwrap_or_else(|_| flown.profile.into())
}

/// Key, default and value of every setting that differs.
fn differences(flown: &Scenario) -> Vec<Vec<String>> {
    differing(&[&Scenario::from(flown.profile), flown])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::DASH;
    use settings::{Fault, FaultKind, FaultTarget, Profile};

    #[test]
    fn only_settings_that_differ_are_told_with_their_default() {
        let mut flown = Scenario::from(Profile::Paper);
        flown.name = "another name".into();
        assert!(differences(&flown).is_empty());
        assert!(section(&flown).contains("Every setting is the default of profile <b>paper</b>"));
        flown.run.duration_s = 12.5;
        flown.bounds.max_position_error_m = Some(0.3);
        flown.node.mixer.deadline_ms = Some(9.0);
        flown.fault = vec![Fault::new(FaultTarget::Mixer, FaultKind::Kill, 2.0, Some(0.3)); 2];
        let kill = "mixer kill, at_s 2.0, for_s 0.3";
        let expected = [
            ["bounds.max_position_error_m", DASH, "0.3"],
            ["fault 1", DASH, kill],
            ["fault 2", DASH, kill],
            ["node.mixer", DASH, "deadline_ms 9.0"],
            ["run.duration_s", "60.0", "12.5"],
        ];
        assert_eq!(differences(&flown), expected);
        assert!(section(&flown).contains(kill));
    }

    #[test]
    fn what_a_preset_sets_is_folded_away_below_its_line() {
        let given = [
            "plant.sensors.preset='typical'",
            "run.duration_s=5.0",
            "plant.sensors.rates.noise_density=[0.1, 0.1, 0.1]",
        ];
        let flown = settings::load(None, &given.map(str::to_owned)).unwrap();
        let page = section(&flown);
        let (shown, folded) = page.split_once("<details>").expect("a folded table");
        assert_eq!(shown.matches("<tr>").count(), 1 + given.len(), "{shown}");
        for key in ["plant.sensors.preset", "run.duration_s", "plant.sensors.rates.noise_density"] {
            assert!(shown.contains(key) && !folded.contains(&format!("<code>{key}</code>")), "{key}: {page}");
        }
        assert!(folded.contains("settings by preset</summary>") && folded.matches("<tr>").count() > 10, "{folded}");
    }
}
