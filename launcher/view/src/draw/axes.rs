//! The axes of plots: entries side by side, and the scale of their values.

use super::charts::marks;
use super::{Svg, escape};

/// Size of the plots, and ends of their axes \[px\].
pub(super) const WIDTH: f64 = 420.0;
pub(super) const HEIGHT: f64 = 206.0;
pub(super) const LEFT: f64 = 48.0;
pub(super) const RIGHT: f64 = WIDTH - 16.0;
pub(super) const TOP: f64 = 24.0;
pub(super) const BOTTOM: f64 = HEIGHT - 36.0;
/// Width of a letter of an axis \[px\].
pub(super) const LETTER: f64 = 6.2;

/// Largest number of letters of a label.
const LONGEST: usize = 32;

/// An axis of entries side by side, each 1 wide: single values, or parts of a range.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity of the axis, with its unit.
    pub title: String,
    pub entries: Vec<String>,
    /// Places and texts of the labels below the axis.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    /// Makes an axis with an entry for each value.
    pub fn of_values(title: &str, entries: Vec<String>) -> Self {
        let ticks = entries.iter().enumerate().map(|(i, entry)| (i as f64 + 0.5, clipped(entry))).collect();
        Self { title: title.to_owned(), entries, ticks }
    }

    /// Makes an axis with an entry between each two neighbouring edges.
    pub fn of_parts(title: &str, edges: &[String]) -> Self {
        let entries = edges.windows(2).map(|ends| format!("{} to {}", ends[0], ends[1])).collect();
        let ticks = edges.iter().enumerate().map(|(i, edge)| (i as f64, edge.clone())).collect();
        Self { title: title.to_owned(), entries, ticks }
    }

    /// Returns whether a plot has room for all labels below the axis.
    pub fn fits(&self) -> bool {
        (self.longest() as f64 + 1.0) * LETTER <= self.slot()
    }

    /// Number of letters of the longest label.
    pub(super) fn longest(&self) -> usize {
        self.ticks.iter().map(|(_, word)| word.chars().count()).max().unwrap_or(0)
    }

    /// Width of an entry \[px\].
    pub(super) fn slot(&self) -> f64 {
        (RIGHT - LEFT) / self.entries.len().max(1) as f64
    }

    /// Returns the place of a value on the axis \[px\].
    pub(super) fn x(&self, place: f64) -> f64 {
        LEFT + self.slot() * place
    }

    /// Draws the axis below a plot with as many labels as have room, and the title `values` above the plot.
    pub(super) fn draw(&self, svg: &mut Svg, values: &str) {
        svg.text(4.0, 12.0, "tick", &escape(values));
        let every = ((self.longest() as f64 + 1.0) * LETTER / self.slot()).ceil().max(1.0) as usize;
        for (place, word) in self.ticks.iter().step_by(every) {
            svg.text(self.x(*place), BOTTOM + 16.0, "tick middle", &escape(word));
            svg.add(format_args!("<path d=\"M{:.1} {BOTTOM}v4\" style=\"stroke:var(--muted)\"/>", self.x(*place)));
        }
        svg.text(f64::midpoint(LEFT, RIGHT), HEIGHT - 4.0, "tick middle", &escape(&self.title));
    }
}

/// Shortens a label to [`LONGEST`] letters.
fn clipped(word: &str) -> String {
    if word.chars().count() <= LONGEST {
        return word.to_owned();
    }
    word.chars().take(LONGEST - 1).chain(['…']).collect()
}

/// Scale of values above 0: linear, or logarithmic if they span a decade.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisScale {
    is_log: bool,
    /// Ends of the values, or of their logarithms to base 10.
    ends: [f64; 2],
}

impl AxisScale {
    /// Returns a scale for the values above 0 and for `limit`, if there is one; `None` without a value. The largest
    /// hundredth of the values lies beyond the upper end if it is far above the others; values below a thousandth of
    /// the median lie beyond the lower end.
    pub(super) fn of(values: impl Iterator<Item = f64>, limit: Option<f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite() && *value > 0.0).collect();
        values.sort_by(f64::total_cmp);
        let (low, last) = (values.first()?.max(1e-3 * values[(values.len() - 1) / 2]), *values.last()?);
        let most = values[(values.len() * 99).div_ceil(100) - 1];
        let high = if last > 3.0 * most { most } else { last };
        let [low, high] = limit.map_or([low, high], |limit| [low.min(limit), high.max(limit)]);
        let is_log = high >= 10.0 * low;
        let [low, high] = if is_log { [low, high].map(f64::log10) } else { [low, high] };
        let room = if high > low { 0.05 * (high - low) } else { 0.5 * high };
        Some(Self { is_log, ends: [low - room, high + room] })
    }

    /// Returns the place of a value between the ends, 0 to 1.
    pub(super) fn place(&self, value: f64) -> f64 {
        let [low, high] = self.ends;
        ((if self.is_log { value.log10() } else { value }) - low) / (high - low)
    }

    /// Round values on the scale.
    pub(super) fn marks(&self) -> Vec<f64> {
        let [low, high] = self.ends;
        if !self.is_log {
            return marks(low, high);
        }
        let decades = high - low;
        let steps: &[f64] = if decades < 2.5 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let every = (decades / 6.0).ceil() as usize;
        let of_decade = |decade: i32| steps.iter().map(move |step| step * 10_f64.powi(decade));
        let all = (low.floor() as i32..=high.ceil() as i32).step_by(every).flat_map(of_decade);
        all.filter(|value| (0.0..=1.0).contains(&self.place(*value))).collect()
    }
}

/// Draws a horizontal line of the grid, and its label.
pub(super) fn grid(svg: &mut Svg, [from, to]: [f64; 2], y: f64, word: &str) {
    svg.add(format_args!("<path d=\"M{from} {y:.1}H{to}\" style=\"stroke:var(--grid)\"/>"));
    svg.text(from - 4.0, y + 4.0, "tick end", word);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::short;

    #[test]
    fn parts_have_their_words_at_the_edges_and_values_in_the_middle() {
        let edges = ["0", "5", "10"].map(str::to_owned);
        let axis = Axis::of_parts("x", &edges);
        assert_eq!(axis.entries, ["0 to 5", "5 to 10"]);
        assert_eq!(axis.ticks.iter().map(|(place, _)| *place).collect::<Vec<_>>(), [0.0, 1.0, 2.0]);
        assert_eq!(Axis::of_values("x", edges.to_vec()).ticks[2], (2.5, "10".into()));
        assert!(axis.fits() && !Axis::of_values("x", vec!["a long word".into(); 8]).fits());
        let long = Axis::of_values("x", vec!["ä".repeat(40)]);
        assert_eq!(
            (long.longest(), long.entries[0].chars().count()),
            (LONGEST, 40),
            "the name of the entry stays whole"
        );
    }

    #[test]
    fn a_scale_is_logarithmic_from_a_decade_on() {
        let scale = |values: &[f64]| AxisScale::of(values.iter().copied(), None);
        assert_eq!(scale(&[0.0, f64::NAN]), None);
        let linear = scale(&[0.10, 0.16]).unwrap();
        assert_eq!(linear.marks().iter().map(|mark| short(*mark)).collect::<Vec<_>>(), ["0.1", "0.12", "0.14", "0.16"]);
        assert!((linear.place(0.13) - 0.5).abs() < 1e-12);
        assert_eq!(scale(&[0.1, 1.0]).unwrap().marks(), [0.1, 0.2, 0.5, 1.0]);
        assert_eq!(scale(&[0.1, 1e5]).unwrap().marks(), [1.0, 100.0, 1e4]);
        let mut far: Vec<f64> = (0..200).map(|i| 1.0 + 0.01 * f64::from(i)).collect();
        far.push(1e6);
        far.push(1e-9);
        let scale_of_far = scale(&far).unwrap();
        assert!(scale_of_far.place(1e6) > 1.0 && scale_of_far.place(1e-9) < 0.0, "beyond the others");
        assert_eq!(AxisScale::of([1.0, 2.0].into_iter(), Some(6.0)).unwrap().marks(), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(scale(&[3.0]).unwrap().place(3.0), 0.5, "one value has a place");
    }
}
