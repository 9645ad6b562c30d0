//! Axis of a factor: its values if they are few, else equal parts of their range.

use view::draw::{Axis, short};

use crate::table::FlightTable;

/// Largest number of distinct numbers that are shown one by one; more are divided into parts.
const FEW: usize = 10;
/// Largest number of distinct words; a factor with more has no axis.
const WORDS: usize = 30;
/// Largest and smallest number of parts of a range.
const PARTS: [usize; 2] = [8, 2];
/// Number of flights that a cell should have.
const PER_CELL: usize = 20;

/// Suffix of a key, and the unit that it stands for.
const UNITS: [(&str, &str); 18] = [
    ("m", "m"),
    ("s", "s"),
    ("ms", "ms"),
    ("us", "µs"),
    ("hz", "Hz"),
    ("deg", "°"),
    ("dps", "°/s"),
    ("mps", "m/s"),
    ("mps2", "m/s²"),
    ("rad", "rad"),
    ("radps", "rad/s"),
    ("kg", "kg"),
    ("kgm2", "kg m²"),
    ("n", "N"),
    ("nm", "N m"),
    ("nspm", "N s/m"),
    ("ns2pm2", "N s²/m²"),
    ("wh", "Wh"),
];

/// Factor with the entry of its axis that each flight is in.
pub struct Binned {
    pub key: String,
    pub axis: Axis,
    /// `true` if the values are numbers.
    pub is_number: bool,
    bins: Vec<Option<usize>>,
}

impl Binned {
    /// Bins the column of a key; `None` if it does not vary or has too many words. If it has many different numbers,
    /// `parts` gives the number of parts for a number of flights.
    pub fn of(flights: &FlightTable, key: &str, parts: impl Fn(usize) -> usize) -> Option<Self> {
        let column = flights.column(key)?;
        let rows = 0..flights.rows();
        let title = title(key);
        let is_number = column.is_number();
        let (axis, bins) = if is_number {
            let values: Vec<_> = rows.map(|row| column.number(row)).collect();
            by_number(&title, &values, parts(values.iter().flatten().count()))
        } else {
            let words: Vec<String> = rows.map(|row| column.word(row)).collect();
            let mut entries = words.clone();
            entries.sort();
            entries.dedup();
            let bins = words.iter().map(|word| entries.binary_search(word).ok()).collect();
            (Axis::of_values(&title, entries), bins)
        };
        let some = 2..=if is_number { FEW } else { WORDS };
        some.contains(&axis.entries.len()).then(|| Self { key: key.to_owned(), axis, is_number, bins })
    }

    /// Entry of the axis that a flight is in; `None` if it has no value.
    pub fn bin(&self, row: usize) -> Option<usize> {
        self.bins[row]
    }
}

/// Number of parts such that each has about [`PER_CELL`] flights, within [`PARTS`].
pub fn parts(flights: usize) -> usize {
    let [most, least] = PARTS;
    (flights / PER_CELL).clamp(least, most)
}

/// Number of parts of each of two factors such that a cell of both has about [`PER_CELL`] flights, within [`PARTS`].
pub fn parts_of_two(flights: usize) -> usize {
    let [most, least] = PARTS;
    (flights / PER_CELL).isqrt().clamp(least, most)
}

/// Formats a key with the unit of its suffix: `plant.airframe.mass [kg]`.
pub fn title(key: &str) -> String {
    match split(key) {
        Some((part, name, unit)) => format!("{} [{unit}]", key.replace(part, name)),
        None => key.to_owned(),
    }
}

/// Unit of a key by its suffix.
pub fn unit(key: &str) -> Option<&'static str> {
    split(key).map(|(_, _, unit)| unit)
}

/// Returns the part of a key that ends with a unit, the part without the unit, and the unit.
pub fn split(key: &str) -> Option<(&str, &str, &'static str)> {
    let of_unit = |name: &str| UNITS.iter().find(|(end, _)| *end == name).map(|(_, unit)| *unit);
    key.split('.').find_map(|part| {
        let (name, end) = part.rsplit_once('_')?;
        Some((part, name, of_unit(end)?))
    })
}

/// Returns the axis of some values, and the index of each value's entry.
fn by_number(title: &str, values: &[Option<f64>], parts: usize) -> (Axis, Vec<Option<usize>>) {
    let mut sorted: Vec<f64> = values.iter().flatten().copied().collect();
    sorted.sort_by(f64::total_cmp);
    let mut distinct = sorted.clone();
    distinct.dedup();
    if distinct.len() <= FEW {
        let bin = |value: f64| distinct.binary_search_by(|other| other.total_cmp(&value)).ok();
        let entries = distinct.iter().map(|value| short(*value)).collect();
        let bins = values.iter().map(|value| value.and_then(bin)).collect();
        return (Axis::of_values(title, entries), bins);
    }
    let (low, high, median) = (sorted[0], sorted[sorted.len() - 1], sorted[sorted.len() / 2]);
    // A log-uniform distribution has its median at the geometric mean of the ends.
    let is_log = low > 0.0 && high > 10.0 * low && median < 0.5 * ((low * high).sqrt() + f64::midpoint(low, high));
    let on_axis = |value: f64| if is_log { libm::log(value / low) } else { value - low };
    let equal = (low, on_axis(high) / parts as f64, parts);
    let (low, part, parts) = if is_log { equal } else { round_parts(low, high, parts).unwrap_or(equal) };
    let on_axis = |value: f64| if is_log { libm::log(value / low) } else { value - low };
    let edge = |i: usize| if is_log { low * libm::exp(part * i as f64) } else { low + part * i as f64 };
    let edges: Vec<f64> = (0..=parts).map(edge).collect();
    let edges = if is_log { edges.iter().map(|edge| short(*edge)).collect() } else { alike(&edges, part) };
    // The largest value lies at the end of the last part.
    let bin = |value: f64| ((on_axis(value) / part) as usize).min(parts - 1);
    let bins = values.iter().map(|value| value.map(bin)).collect();
    (Axis::of_parts(title, &edges), bins)
}

/// Divides a range into as many parts with round edges as possible, at most `most`; returns the first edge, the width
/// and the number of the parts. `None` if every such division is more than 15 % longer than the range.
fn round_parts(low: f64, high: f64, most: usize) -> Option<(f64, f64, usize)> {
    let magnitude = libm::pow(10.0, libm::log10((high - low) / most as f64).floor());
    let widths = [1.0, 2.0, 2.5, 4.0, 5.0, 10.0, 20.0].map(|digits| digits * magnitude);
    let fit = widths.into_iter().filter_map(|width| {
        let (from, to) = ((low / width + 1e-9).floor(), (high / width - 1e-9).ceil());
        let fits = to - from <= most as f64 && (to - from) * width <= 1.15 * (high - low);
        fits.then_some((from * width, width, (to - from) as usize))
    });
    fit.max_by(|one, other| one.2.cmp(&other.2).then(other.1.total_cmp(&one.1)))
}

/// Formats edges with equal numbers of decimals: the fewest for which no edge is rounded by more than `part / 40`.
fn alike(edges: &[f64], part: f64) -> Vec<String> {
    let words = |decimals: usize| edges.iter().map(move |edge| format!("{:.decimals$}", edge + 0.0));
    let is_near = |decimals: &usize| {
        words(*decimals)
            .zip(edges)
            .all(|(word, edge)| word.parse().is_ok_and(|near: f64| (near - edge).abs() <= part / 40.0))
    };
    let decimals = (0..12).find(is_near).unwrap_or(12);
    words(decimals).map(|word| if word.parse() == Ok(0.0) { "0".to_owned() } else { word }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{Cell, ColumnType};

    fn binned(values: impl IntoIterator<Item = f64>) -> Option<Binned> {
        let mut table = FlightTable::new(&[("x".to_owned(), ColumnType::Real)]);
        values.into_iter().for_each(|value| table.push(vec![Cell::Real(value)]));
        Binned::of(&table, "x", |_| 8)
    }

    fn ticks(binned: &Binned) -> Vec<&str> {
        binned.axis.ticks.iter().map(|(_, word)| word.as_str()).collect()
    }

    #[test]
    fn few_values_are_shown_one_by_one_and_many_as_parts_of_their_range() {
        let few = binned([3.0, 1.0, 3.0]).unwrap();
        assert_eq!((ticks(&few), few.bins.clone()), (vec!["1", "3"], vec![Some(1), Some(0), Some(1)]));
        let many = binned((0..=80).map(f64::from)).unwrap();
        assert_eq!(ticks(&many), ["0", "10", "20", "30", "40", "50", "60", "70", "80"]);
        assert_eq!(many.axis.entries[1], "10 to 20");
        assert_eq!([0, 9, 10, 80].map(|row| many.bin(row)), [Some(0), Some(0), Some(1), Some(7)]);
        assert!(binned([1.0, 1.0]).is_none(), "it does not vary");
    }

    #[test]
    fn edges_have_equal_numbers_of_decimals() {
        let even = binned((0..100).map(|i| -7.998 + 15.997 * f64::from(i) / 99.0)).unwrap();
        assert_eq!(ticks(&even), ["-8", "-6", "-4", "-2", "0", "2", "4", "6", "8"]);
        let odd = binned((0..100).map(|i| 0.9 + 0.5 * f64::from(i) / 99.0)).unwrap();
        assert_eq!(ticks(&odd), ["0.9", "1.0", "1.1", "1.2", "1.3", "1.4"]);
        assert_eq!(round_parts(0.99, 1.32, 2), None, "0.8 to 1.4 is too wide");
        assert_eq!(alike(&[0.99, 1.155, 1.32], 0.165), ["0.990", "1.155", "1.320"]);
        let log = binned((0..=80).map(|i| libm::pow(10.0, f64::from(i) / 20.0 - 2.0))).unwrap();
        assert_eq!([ticks(&log)[0], ticks(&log)[2], ticks(&log)[8]], ["0.01", "0.1", "100"], "by its logarithm");
    }

    #[test]
    fn a_cell_has_enough_flights() {
        assert_eq!([10, 100, 10_000].map(parts), [2, 5, 8]);
        assert_eq!([10, 200, 1000, 10_000].map(parts_of_two), [2, 3, 7, 8]);
    }

    #[test]
    fn words_and_none_are_entries() {
        let mut table = FlightTable::new(&[("x".to_owned(), ColumnType::Text)]);
        for cell in [Cell::Text("kill".into()), Cell::None, Cell::Text("drop".into())] {
            table.push(vec![cell]);
        }
        let binned = Binned::of(&table, "x", |_| 8).unwrap();
        assert_eq!((ticks(&binned), binned.bin(1)), (vec!["drop", "kill", "none"], Some(2)));
    }

    #[test]
    fn a_title_has_the_unit_of_its_key() {
        for (key, expected) in [
            ("plant.airframe.mass_kg", "plant.airframe.mass [kg]"),
            ("plant.wind_ned_mps.0.1.0", "plant.wind_ned.0.1.0 [m/s]"),
            ("attitude.law", "attitude.law"),
            ("random_fault.0.for_s", "random_fault.0.for [s]"),
        ] {
            assert_eq!(title(key), expected);
        }
    }
}
