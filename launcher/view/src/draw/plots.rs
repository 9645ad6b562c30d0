//! Plots with two axes: shares with their intervals, points, and lines over time.

use std::fmt::Write;

use super::charts::{COLOURS, marks};
use super::{Svg, escape};

/// Size of the plots, and the room for words at the left and below \[px\].
const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 48.0;
const BELOW: f64 = 36.0;
const TOP: f64 = 8.0;

/// A share of something, with the ends of its interval, 0 to 1.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    pub share: f64,
    pub low: f64,
    pub high: f64,
}

/// Shares over the entries of an axis, a colour for each series; an entry may lack a share.
pub fn shares(axis: &str, entries: &[String], series: &[(&str, Vec<Option<Share>>)]) -> String {
    let label = format!("share passed over {}", escape(axis));
    let mut svg = Svg::sized(WIDTH, HEIGHT, &label);
    let right = WIDTH - 8.0;
    let (bottom, slot) = (HEIGHT - BELOW, (right - LEFT) / entries.len().max(1) as f64);
    let y = |share: f64| bottom - (bottom - TOP) * share;
    for percent in [0, 25, 50, 75, 100] {
        grid(&mut svg, [LEFT, right], y(f64::from(percent) / 100.0), &format!("{percent} %"));
    }
    // As many words as find room.
    let every = (entries.iter().map(String::len).max().unwrap_or(1) as f64 * 7.0 / slot).ceil().max(1.0) as usize;
    for (i, entry) in entries.iter().enumerate().step_by(every) {
        svg.text(LEFT + slot * (i as f64 + 0.5), bottom + 15.0, "tick middle", &escape(entry));
    }
    svg.text(f64::midpoint(LEFT, right), HEIGHT - 4.0, "tick middle", &escape(axis));
    for (n, ((name, shares), colour)) in series.iter().zip(COLOURS.iter().cycle()).enumerate() {
        let offset = (n as f64 + 0.5) / series.len() as f64 * 0.6 + 0.2;
        for (i, (share, entry)) in shares.iter().zip(entries).enumerate() {
            let Some(Share { share, low, high }) = share else { continue };
            let x = LEFT + slot * (i as f64 + offset);
            svg.add(format_args!(
                "<g style=\"stroke:{colour};fill:{colour}\"><title>{}, {}: {:.1} % ({:.1} to {:.1} %)</title>\
                 <path d=\"M{x:.1} {:.1}V{:.1}\"/><circle cx=\"{x:.1}\" cy=\"{:.1}\" r=\"3\"/></g>",
                escape(name),
                escape(entry),
                100.0 * share,
                100.0 * low,
                100.0 * high,
                y(*low),
                y(*high),
                y(*share)
            ));
        }
    }
    svg.finish()
}

/// The names of series in their colours.
pub fn legend(names: &[&str]) -> String {
    let one = |(name, colour): (&&str, &&str)| {
        format!("<span style=\"color:{colour}\">&#9632;</span> {} &nbsp; ", escape(name))
    };
    format!("<p class=\"hint\">{}</p>", names.iter().zip(COLOURS.iter().cycle()).map(one).collect::<String>())
}

/// Points (x, y, marked), y on a logarithmic axis; the marked ones are drawn last, in the colour of what failed.
pub fn scatter(axes: [&str; 2], points: &[(f64, f64, bool)]) -> String {
    let [across, up] = axes.map(escape);
    let mut svg = Svg::sized(WIDTH, HEIGHT, &format!("{up} over {across}"));
    let (right, bottom) = (WIDTH - 8.0, HEIGHT - BELOW);
    let drawn = || points.iter().filter(|(x, y, _)| x.is_finite() && *y > 0.0);
    let ends = |of: fn(&(f64, f64, bool)) -> f64| {
        drawn().map(of).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
    };
    let ([x0, x1], [y0, y1]) = (ends(|point| point.0), ends(|point| point.1.log10()));
    if x0 > x1 {
        return String::new();
    }
    let x = |value: f64| LEFT + 4.0 + (right - LEFT - 8.0) * if x1 > x0 { (value - x0) / (x1 - x0) } else { 0.5 };
    let (low, high) = (y0.floor(), y1.ceil().max(y0.floor() + 1.0));
    let y = |log: f64| bottom - (bottom - TOP) * (log - low) / (high - low);
    for decade in low as i32..=high as i32 {
        grid(&mut svg, [LEFT, right], y(f64::from(decade)), &format!("{}", 10_f64.powi(decade)));
    }
    for mark in marks(x0, x1) {
        svg.text(x(mark), bottom + 15.0, "tick middle", &short(mark));
    }
    svg.text(f64::midpoint(LEFT, right), HEIGHT - 4.0, "tick middle", &format!("{across}; up: {up}"));
    for (is_marked, colour) in [(false, "var(--blue)"), (true, "var(--orange)")] {
        let mut of_kind = String::new();
        for (px, py, _) in drawn().filter(|(.., marked)| *marked == is_marked) {
            let _ = write!(of_kind, "M{:.1} {:.1}h0", x(*px), y(py.log10())); // a String takes everything
        }
        // A line without length, with round ends, is a dot.
        svg.add(format_args!(
            "<path d=\"{of_kind}\" style=\"stroke:{colour};stroke-width:3;stroke-linecap:round;opacity:0.6\"/>"
        ));
    }
    svg.finish()
}

/// Values over time \[s\] as lines, in the order of the colours, in a small picture.
pub fn course(title: &str, end_s: f64, series: &[Vec<(f64, f64)>]) -> String {
    let (width, height, bottom) = (230.0, 92.0, 62.0);
    let mut svg = Svg::sized(width, height, title);
    let values = || series.iter().flatten().map(|(_, value)| *value).filter(|value| value.is_finite());
    let low = values().fold(0.0, f64::min);
    let high = values().fold(low + 1e-9, f64::max);
    let x = |time_s: f64| LEFT + (width - LEFT - 8.0) * time_s / end_s.max(1e-9);
    let y = |value: f64| bottom - (bottom - 18.0) * (value - low) / (high - low);
    svg.text(LEFT, 11.0, "tick", &escape(title));
    for value in [low, high] {
        grid(&mut svg, [LEFT, width - 8.0], y(value), &short(value));
    }
    for (time_s, class) in [(0.0, "tick"), (end_s, "tick end")] {
        svg.text(x(time_s), bottom + 15.0, class, &format!("{} s", short(time_s)));
    }
    for (line, colour) in series.iter().zip(COLOURS) {
        let mut points = String::new();
        for (time_s, value) in line.iter().filter(|(_, value)| value.is_finite()) {
            let pen = if points.is_empty() { 'M' } else { 'L' };
            let _ = write!(points, "{pen}{:.1} {:.1}", x(*time_s), y(*value)); // a String takes everything
        }
        svg.add(format_args!("<path d=\"{points}\" style=\"fill:none;stroke:{colour};stroke-width:1.2\"/>"));
    }
    svg.finish()
}

/// A line of the grid from left to right, and its word.
fn grid(svg: &mut Svg, [from, to]: [f64; 2], y: f64, word: &str) {
    svg.add(format_args!("<path d=\"M{from} {y:.1}H{to}\" style=\"stroke:var(--grid)\"/>"));
    svg.text(from - 4.0, y + 4.0, "tick end", word);
}

/// A number in few characters.
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
    fn numbers_are_short_and_still_themselves() {
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

    #[test]
    fn a_share_stands_at_its_height_with_its_interval() {
        let share = Share { share: 0.5, low: 0.0, high: 1.0 };
        let svg = shares("mass", &["1".into(), "2".into()], &[("cone", vec![None, Some(share)])]);
        assert!(svg.contains("V8.0\"/><circle cx=\"321.0\" cy=\"81.0\""), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 1, "an entry without flights has none");
    }

    #[test]
    fn points_that_have_no_place_are_left_out() {
        let svg =
            scatter(["x", "y"], &[(0.0, 1.0, false), (1.0, 10.0, true), (f64::NAN, 1.0, false), (1.0, 0.0, false)]);
        assert_eq!(svg.matches("h0").count(), 2, "{svg}");
        assert_eq!(scatter(["x", "y"], &[]), "");
    }

    #[test]
    fn lines_reach_from_their_lowest_to_their_highest_value() {
        let svg = course("error", 2.0, &[vec![(0.0, 0.0), (1.0, f64::NAN), (2.0, 4.0)]]);
        assert!(svg.contains("d=\"M48.0 62.0L222.0 18.0\""), "{svg}");
    }
}
