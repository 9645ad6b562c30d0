//! Words for a setting that varies: `plant.wind_ned_mps.0.1.1` is "wind east \[m/s\]".

use view::draw::escape;

use super::bins::split;

/// Names of vectors, by their start or by `_ned` in them, and the words for their elements.
const AXES: [(&str, [&str; 3]); 5] = [
    ("_ned", ["north", "east", "down"]),
    ("position", ["north", "east", "down"]),
    ("velocity", ["forward", "right", "down"]),
    ("attitude", ["roll", "pitch", "yaw"]),
    ("rates", ["roll", "pitch", "yaw"]),
];

/// Heading of a factor: its words, and the key beside them unless the two are equal.
pub fn heading(key: &str) -> String {
    let told = words(key);
    let beside = if told == key { String::new() } else { format!(" <small><code>{}</code></small>", escape(key)) };
    escape(&told) + &beside
}

/// Returns words and unit of an element of an array with a unit. Every other setting has a name that explains it, and
/// its key is returned.
fn words(key: &str) -> String {
    let names: Vec<&str> = key.split('.').collect();
    let element = names.last().and_then(|last| last.parse::<usize>().ok());
    let name = names.iter().rev().find(|name| name.parse::<usize>().is_err());
    let (Some(element), Some(name)) = (element, name) else { return key.to_owned() };
    // Wind is a list of times and vectors: only an element of a vector in it has an axis.
    let depth = names.iter().rev().take_while(|name| name.parse::<usize>().is_ok()).count();
    if depth != if *name == "wind_ned_mps" { 3 } else { 1 } {
        return key.to_owned();
    }
    let axes = AXES.iter().find(|(word, _)| name.starts_with(word) || word.starts_with('_') && name.contains(word));
    let (Some((_, name, unit)), Some((_, axes))) = (split(name), axes) else { return key.to_owned() };
    match axes.get(element) {
        Some(axis) => format!("{} {axis} [{unit}]", name.trim_end_matches("_ned").replace('_', " ")),
        None => key.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_element_of_a_vector_is_told_in_words() {
        for (key, expected) in [
            ("plant.wind_ned_mps.0.1.1", "wind east [m/s]"),
            ("initial.attitude_deg.0", "attitude roll [°]"),
            ("initial.position_m.2", "position down [m]"),
            ("plant.airframe.mass_kg", "plant.airframe.mass_kg"),
            ("attitude.mpc.q.4", "attitude.mpc.q.4"),
            ("plant.wind_ned_mps.1.0", "plant.wind_ned_mps.1.0"), // the time of a row
        ] {
            assert_eq!(words(key), expected);
        }
    }
}
