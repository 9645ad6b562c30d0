//! The values of a factor on an axis: themselves where they are few, else equal parts of their range.

use view::draw::short;

use crate::table::{Cell, Column, Table};

/// As many values stand on an axis by themselves.
const FEW: usize = 10;
/// Parts of a range.
const PARTS: usize = 8;

/// A factor with the place of each flight on its axis.
pub struct Binned {
    pub name: String,
    pub labels: Vec<String>,
    bins: Vec<Option<usize>>,
}

impl Binned {
    /// The column of a name; `None` where it does not vary, or is text of too many kinds.
    pub fn of(flights: &Table, name: &str) -> Option<Self> {
        let column = flights.column(name)?;
        let rows = 0..flights.rows();
        let (labels, bins) = match column {
            Column::Int(_) | Column::Real(_) => {
                let values: Vec<Option<f64>> = rows.map(|row| column.number(row)).collect();
                by_number(&values)
            }
            Column::Bool(_) | Column::Text(_) => {
                let words: Vec<String> = rows
                    .map(|row| match column.cell(row) {
                        Cell::Bool(yes) => yes.to_string(),
                        _ => column.text(row).to_owned(),
                    })
                    .collect();
                let mut labels = words.clone();
                labels.sort();
                labels.dedup();
                let bins = words.iter().map(|word| labels.binary_search(word).ok()).collect();
                (labels, bins)
            }
        };
        let few = (2..=2 * FEW).contains(&labels.len());
        few.then(|| Self { name: name.to_owned(), labels, bins })
    }

    /// Where a flight lies on the axis.
    pub fn bin(&self, row: usize) -> Option<usize> {
        self.bins[row]
    }
}

fn by_number(values: &[Option<f64>]) -> (Vec<String>, Vec<Option<usize>>) {
    let mut distinct: Vec<f64> = values.iter().flatten().copied().collect();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup();
    if distinct.len() <= FEW {
        let place = |value: &Option<f64>| {
            value.and_then(|value| distinct.binary_search_by(|other| other.total_cmp(&value)).ok())
        };
        return (distinct.iter().map(|value| short(*value)).collect(), values.iter().map(place).collect());
    }
    let (low, high) = (distinct[0], distinct[distinct.len() - 1]);
    let part = (high - low) / PARTS as f64;
    let labels = (0..PARTS).map(|i| short_beside(low + part * (i as f64 + 0.5), part)).collect();
    let place = |value: &Option<f64>| value.map(|value| (((value - low) / part) as usize).min(PARTS - 1));
    (labels, values.iter().map(place).collect())
}

/// The middle of a part of this width, in a tenth of it.
fn short_beside(middle: f64, part: f64) -> String {
    let tenth = libm::pow(10.0, libm::log10(part / 10.0).ceil());
    short((middle / tenth).round() * tenth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Kind;

    fn binned(values: impl IntoIterator<Item = f64>) -> Option<Binned> {
        let mut table = Table::new(&[("x".to_owned(), Kind::Real)]);
        values.into_iter().for_each(|value| table.push(vec![Cell::Real(value)]));
        Binned::of(&table, "x")
    }

    #[test]
    fn few_values_are_themselves_and_many_are_parts_of_their_range() {
        let few = binned([3.0, 1.0, 3.0]).unwrap();
        assert_eq!((few.labels, few.bins), (vec!["1".into(), "3".into()], vec![Some(1), Some(0), Some(1)]));
        let many = binned((0..=80).map(f64::from)).unwrap();
        assert_eq!(many.labels, ["5", "15", "25", "35", "45", "55", "65", "75"]);
        assert_eq!([0, 9, 10, 80].map(|row| many.bin(row)), [Some(0), Some(0), Some(1), Some(7)]);
        assert!(binned([1.0, 1.0]).is_none(), "it does not vary");
    }
}
