//! Plots over the axes of a campaign's factors: shares with their intervals, values with their boxes.

use std::fmt::Write;

use super::axes::{Axis, AxisScale, BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, grid};
use super::charts::COLOURS;
use super::{Svg, escape};

/// Share and the ends of its interval, 0 to 1.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    pub share: f64,
    pub low: f64,
    pub high: f64,
}

impl Share {
    /// Formats the share as `95.0 % (90.1 to 98.2 %)`, or as `95.0 %` if the interval is a point.
    fn words(&self) -> String {
        let [share, low, high] = [self.share, self.low, self.high].map(|share| 100.0 * share);
        if low == high { format!("{share:.1} %") } else { format!("{share:.1} % ({low:.1} to {high:.1} %)") }
    }
}

/// Draws shares over an axis, in a colour for each of the `names`; `share` returns the share for the indices of a name
/// and an entry, or `None`.
pub fn shares(title: &str, axis: &Axis, names: &[&str], share: impl Fn(usize, usize) -> Option<Share>) -> String {
    let mut svg = Svg::sized(WIDTH, HEIGHT, &escape(&format!("{title} over {}", axis.title)));
    let y = |share: f64| BOTTOM - (BOTTOM - TOP) * share;
    for percent in [0, 25, 50, 75, 100] {
        grid(&mut svg, [LEFT, RIGHT], y(f64::from(percent) / 100.0), &format!("{percent} %"));
    }
    axis.draw(&mut svg, title);
    for (n, (name, colour)) in names.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let offset = (n as f64 + 0.5) / names.len() as f64 * 0.6 + 0.2;
        for (i, entry) in axis.entries.iter().enumerate() {
            let Some(share) = share(n, i) else { continue };
            let x = axis.x(i as f64 + offset);
            svg.add(format_args!(
                "<g style=\"stroke:{colour};fill:{colour}\"><title>{}, {}: {}</title>\
                 <path d=\"M{x:.1} {:.1}V{:.1}\"/><circle cx=\"{x:.1}\" cy=\"{:.1}\" r=\"3\"/></g>",
                escape(name),
                escape(entry),
                share.words(),
                y(share.low),
                y(share.high),
                y(share.share)
            ));
        }
    }
    svg.finish()
}

/// Draws a share with its interval on a line from 0 to 1, for the cell of a table.
pub fn interval(share: &Share) -> String {
    let (width, y) = (180.0, 8.0);
    let x = |share: f64| 4.0 + (width - 8.0) * share;
    let mut svg = Svg::sized(width, 2.0 * y, &share.words());
    svg.add(format_args!("<path d=\"M{} {y}H{}\" style=\"stroke:var(--rule)\"/>", x(0.0), x(1.0)));
    let [low, high, share] = [share.low, share.high, share.share].map(x);
    svg.add(format_args!(
        "<g style=\"stroke:var(--ink);fill:var(--ink)\"><path d=\"M{low:.1} {y}H{high:.1}\" style=\"stroke-width:2\"/>\
         <circle cx=\"{share:.1}\" cy=\"{y}\" r=\"3.5\"/></g>"
    ));
    svg.finish()
}

/// Makes a legend: the names of series in their colours.
pub fn legend(names: &[&str]) -> String {
    let one = |(name, colour): (&&str, &&str)| {
        format!("<span style=\"color:{colour}\">&#9632;</span> {} &nbsp; ", escape(name))
    };
    names.iter().zip(COLOURS.iter().cycle()).map(one).collect()
}

/// Quartiles of some values, and the ends of the whiskers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quartiles {
    /// Ends of the whiskers.
    pub reach: [f64; 2],
    /// First quartile, median, third quartile.
    pub quartiles: [f64; 3],
}

/// The values of one series.
#[derive(Debug, Clone)]
pub struct Dots {
    /// Points: entry of the axis, value, and `true` to draw a cross instead of a dot.
    pub points: Vec<(usize, f64, bool)>,
    /// A box for each entry that has enough values.
    pub boxes: Vec<Option<Quartiles>>,
}

/// Draws values above 0 over an axis, in a colour for each series, with a broken line at `limit`; empty without a
/// value. A value far above all others is drawn as an arrow at the upper end.
pub fn dots(title: &str, axis: &Axis, limit: Option<f64>, series: &[Dots]) -> String {
    let values = || series.iter().flat_map(|dots| &dots.points).map(|(_, value, _)| *value);
    let Some(scale) = AxisScale::of(values(), limit) else { return String::new() };
    let mut svg = Svg::sized(WIDTH, HEIGHT, &escape(&format!("{title} over {}", axis.title)));
    let y = |value: f64| BOTTOM - (BOTTOM - TOP) * scale.place(value).clamp(0.0, 1.0);
    for mark in scale.marks() {
        grid(&mut svg, [LEFT, RIGHT], y(mark), &short(mark));
    }
    axis.draw(&mut svg, title);
    // Each series has a part of the entry's width: the box at its left, the dots at its right.
    let part = 0.84 / series.len().max(1) as f64;
    let left = |n: usize, entry: usize| entry as f64 + 0.08 + part * n as f64;
    for (n, (dots, colour)) in series.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let (mut round, mut crosses) = (String::new(), String::new());
        let points = dots.points.iter().filter(|(_, value, _)| value.is_finite() && *value > 0.0);
        for (i, (entry, value, is_cross)) in points.enumerate() {
            // Multiples of the golden ratio spread evenly.
            let place = left(n, *entry) + part * (0.5 + 0.42 * (i as f64 * 0.618_034).fract());
            let (x, y) = (axis.x(place), y(*value));
            // A line without length, with round ends, is a dot.
            let _ = match is_cross {
                _ if scale.place(*value) > 1.0 => write!(crosses, "M{:.1} {:.1}l3 -4l3 4", x - 3.0, y + 4.0),
                true => write!(crosses, "M{:.1} {:.1}l4 4m-4 0l4 -4", x - 2.0, y - 2.0),
                false => write!(round, "M{x:.1} {y:.1}h0"),
            }; // writing to a String cannot fail
        }
        svg.add(format_args!(
            "<g style=\"stroke:{colour};fill:none\">\
             <path d=\"{round}\" style=\"stroke-width:3;stroke-linecap:round;opacity:0.4\"/>\
             <path d=\"{crosses}\" style=\"opacity:0.6\"/></g>"
        ));
    }
    let width = (axis.slot() * part * 0.42).min(36.0);
    for (n, (dots, colour)) in series.iter().zip(COLOURS.iter().cycle()).enumerate() {
        svg.add(format_args!("<g style=\"stroke:{colour};fill:none\">"));
        for (entry, quartiles) in dots.boxes.iter().enumerate() {
            let end = axis.x(left(n, entry) + 0.46 * part);
            if let Some(quartiles) = quartiles {
                svg.add(quartiles.drawn([end - width, end], y));
            }
        }
        svg.add("</g>");
    }
    if let Some(limit) = limit {
        let y = y(limit);
        svg.add(format_args!("<path d=\"M{LEFT} {y:.1}H{RIGHT}\" style=\"stroke:var(--ink);stroke-dasharray:5 4\"/>"));
        svg.text(RIGHT, 12.0, "tick end", &format!("- - bound {}", short(limit)));
    }
    svg.finish()
}

impl Quartiles {
    /// Draws the box between two edges, its whiskers, and the thick line of the median.
    fn drawn(&self, [left, right]: [f64; 2], y: impl Fn(f64) -> f64) -> String {
        let ([low, high], [first, median, third]) = (self.reach.map(&y), self.quartiles.map(&y));
        let (middle, width, height) = (f64::midpoint(left, right), right - left, first - third);
        let [low_word, first_word, median_word, third_word, high_word] =
            [self.reach[0], self.quartiles[0], self.quartiles[1], self.quartiles[2], self.reach[1]].map(short);
        format!(
            "<g><title>median {median_word}, quartiles {first_word} and {third_word}, whiskers {low_word} and {high_word}</title>\
             <path d=\"M{middle:.1} {low:.1}V{first:.1}M{middle:.1} {third:.1}V{high:.1}\"/>\
             <rect x=\"{left:.1}\" y=\"{third:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" style=\"fill:var(--page)\"/>\
             <path d=\"M{left:.1} {median:.1}H{right:.1}\" style=\"stroke-width:3\"/></g>"
        )
    }
}

/// Formats a number in few characters.
pub fn short(value: f64) -> String {
    let decimals = match value.abs() {
        0.0 => 0,
        size if !(1e-3..1e5).contains(&size) => return format!("{value:.1e}"),
        size => (2 - size.log10().floor() as i32).clamp(0, 4),
    };
    let text = format!("{value:.*}", decimals as usize);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    text.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_formatted_in_few_characters() {
        let cases = [
            (0.0, "0"),
            (1.25, "1.25"),
            (0.05, "0.05"),
            (123.4, "123"),
            (-2.0, "-2"),
            (1e-6, "1.0e-6"),
            (100.0, "100"),
        ];
        for (value, expected) in cases {
            assert_eq!(short(value), expected);
        }
    }

    fn axis() -> Axis {
        Axis::of_values("mass", vec!["1".into(), "2".into()])
    }

    #[test]
    fn a_share_stands_at_its_height_with_its_interval() {
        let share = Share { share: 0.5, low: 0.0, high: 1.0 };
        let svg = shares("passed", &axis(), &["cone"], |_, entry| [None, Some(share)][entry]);
        assert!(svg.contains("M315.0 170.0V24.0\"/><circle cx=\"315.0\" cy=\"97.0\""), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 1, "an entry without flights has none");
    }

    #[test]
    fn points_without_a_place_are_left_out_and_marked_points_are_crosses() {
        let points = vec![(0, 1.0, false), (1, 2.0, true), (1, f64::NAN, false), (1, 0.0, false)];
        let quartiles = Quartiles { reach: [1.0, 2.0], quartiles: [1.0, 1.5, 2.0] };
        let values = Dots { points, boxes: vec![Some(quartiles), None] };
        let svg = dots("y", &axis(), Some(3.0), &[values]);
        assert_eq!((svg.matches("h0").count(), svg.matches("l4 4m").count()), (1, 1), "{svg}");
        assert!(svg.contains("bound 3</text>") && svg.matches("<rect").count() == 1, "{svg}");
        assert_eq!(dots("y", &axis(), Some(3.0), &[]), "");
    }

    #[test]
    fn a_box_has_its_median_between_its_quartiles() {
        let quartiles = Quartiles { reach: [1.0, 5.0], quartiles: [2.0, 3.0, 4.0] };
        let drawn = quartiles.drawn([10.0, 20.0], |value| -10.0 * value);
        assert!(drawn.contains("M15.0 -10.0V-20.0M15.0 -40.0V-50.0") && drawn.contains("M10.0 -30.0H20.0"), "{drawn}");
        assert!(drawn.contains("y=\"-40.0\" width=\"10.0\" height=\"20.0\""), "{drawn}");
    }
}
