//! Times as pictures: histograms and time lines.

use std::fmt::Write;

use hdrhistogram::Histogram;

use super::Svg;
use super::html::escape;

/// Bars per decade.
const BARS: i32 = 10;
/// Height of the tallest bar, and of the whole picture with the words below the axis \[px\].
const BAR_PX: f64 = 44.0;
const PICTURE_PX: f64 = 64.0;

/// One histogram \[ns\]: caption, style of the bars, values, and the deadline \[ns\] where there is one.
pub struct Bars {
    pub caption: String,
    pub style: &'static str,
    pub histogram: Histogram<u64>,
    pub deadline_ns: Option<u64>,
}

/// Draws histograms under their names, on one logarithmic axis of time that reaches at least to `at_least_ns`.
pub fn histograms(groups: &[(&str, Vec<Bars>)], at_least_ns: u64) -> String {
    let values = || groups.iter().flat_map(|(_, all)| all).map(|bars| &bars.histogram).filter(|h| !h.is_empty());
    let low_ns = values().map(Histogram::min).min().unwrap_or(1).max(100);
    let high_ns = values().map(Histogram::max).max().unwrap_or(1).max(at_least_ns);
    let decades = [(low_ns as f64).log10().floor() as i32, (high_ns as f64 * 1.1).log10().ceil() as i32];
    let mut html = String::from("<div class=\"histograms\">");
    for (name, all) in groups {
        let _ = write!(html, "<h4>{name}</h4>"); // writing to a String cannot fail
        html.extend(all.iter().map(|bars| draw(name, bars, decades)));
    }
    html + "</div>"
}

fn draw(name: &str, bars: &Bars, [low, high]: [i32; 2]) -> String {
    let percent = |bar: f64| 100.0 * (bar - f64::from(low * BARS)) / f64::from((high - low) * BARS);
    let edge_ns = |bar: i32| 10_f64.powf(f64::from(bar) / f64::from(BARS));
    let h = &bars.histogram;
    let counts: Vec<(i32, u64)> = (low * BARS..high * BARS)
        .map(|bar| (bar, h.count_between(edge_ns(bar).ceil() as u64, edge_ns(bar + 1).ceil() as u64 - 1)))
        .filter(|(_, count)| *count > 0)
        .collect();
    let most = counts.iter().map(|(_, count)| *count).max().unwrap_or(1);
    let height_px = |count: u64| BAR_PX * (2.0 * count as f64).ln() / (2.0 * most as f64).ln();

    let words = |ns: u64| number_us(ns as f64 / 1e3);
    let figures =
        format!("{} / {} / {}", words(h.value_at_quantile(0.5)), words(h.value_at_quantile(0.99)), words(h.max()));
    let caption = escape(&bars.caption);
    let mut svg = Svg::new(
        &format!("height=\"{PICTURE_PX}\""),
        &format!("{name}, {caption}: p50, p99, max {figures} µs of {} values", h.len()),
    );
    for decade in low..=high {
        let x = percent(f64::from(decade * BARS));
        svg.vertical("grid", x, BAR_PX);
        svg.tick(x, 59.0, &decade_words(decade));
    }
    for (bar, count) in counts {
        let (x, height) = (percent(f64::from(bar)), height_px(count));
        svg.add(format_args!(
            "<rect class=\"{}\" x=\"{x:.2}%\" width=\"{:.2}%\" y=\"{:.1}\" height=\"{height:.1}\"><title>{count} from {} \
             to {} µs</title></rect>",
            bars.style,
            percent(f64::from(bar + 1)) - x,
            BAR_PX - height,
            number_us(edge_ns(bar) / 1e3),
            number_us(edge_ns(bar + 1) / 1e3)
        ));
    }
    if let Some(deadline_ns) = bars.deadline_ns {
        svg.vertical("deadline", percent(f64::from(BARS) * (deadline_ns as f64).log10()), BAR_PX);
    }
    svg.add(format_args!("<line class=\"axis\" x1=\"0\" x2=\"100%\" y1=\"{BAR_PX}\" y2=\"{BAR_PX}\"/>"));
    format!("<div class=\"histogram\"><p>{caption} <small>{figures} µs</small></p>{}</div>", svg.finish())
}

/// Formats a time \[us\] with a decimal below 10 only, because a histogram has three digits.
fn number_us(us: f64) -> String {
    let decimals = usize::from(us < 10.0);
    format!("{us:.decimals$}")
}

/// Label of a power of ten of nanoseconds: with the unit at 1 ns, 1 µs, 1 ms and 1 s, else 10 or 100.
fn decade_words(decade: i32) -> String {
    match decade {
        0 => "1 ns".into(),
        3 => "1 µs".into(),
        6 => "1 ms".into(),
        9 => "1 s".into(),
        _ => 10_u32.pow(decade.rem_euclid(3) as u32).to_string(),
    }
}

/// Colours of lines, in their order: those of [`super::STYLE`].
pub const COLOURS: [&str; 6] =
    ["var(--blue)", "var(--orange)", "var(--green)", "var(--pink)", "var(--olive)", "var(--muted)"];

/// Height of a lane, of its bar, and of the words below \[px\].
const LANE_PX: f64 = 17.0;
const LANE_BAR_PX: f64 = 11.0;
const WORDS_PX: f64 = 18.0;

/// One lane of a time line: a node waits, then runs; both spans are begin and end \[us\].
pub struct Lane {
    pub name: &'static str,
    pub waits: [f64; 2],
    pub runs: [f64; 2],
    /// `true` for the part in which the delay arose: the wait, the run.
    pub at_fault: [bool; 2],
}

/// Draws lanes over one axis of time \[ms\] that contains 0; empty if no lane runs.
pub fn time_line(lanes: &[Lane]) -> String {
    let from = lanes.iter().map(|lane| lane.waits[0]).fold(0.0, f64::min);
    let to = lanes.iter().map(|lane| lane.runs[1]).fold(0.0, f64::max);
    if to <= from {
        return String::new();
    }
    let percent = |us: f64| 100.0 * (us - from) / (to - from);
    let bottom = LANE_PX * lanes.len() as f64;
    let names = lanes.iter().flat_map(|lane| ["<span>", lane.name, "</span>"]).collect::<String>();
    let mut svg = Svg::new(&format!("height=\"{}\"", bottom + WORDS_PX), "time line");
    for us in marks(from, to) {
        svg.vertical("grid", percent(us), bottom);
        let ms = (us / 10.0).round() / 100.0;
        svg.tick(percent(us), bottom + 13.0, &ms.to_string().replace('-', "−"));
    }
    for (row, lane) in lanes.iter().enumerate() {
        let y = LANE_PX * row as f64 + (LANE_PX - LANE_BAR_PX) / 2.0;
        let bars = [("waits", lane.waits), ("runs", lane.runs)];
        for ((style, [from, to]), at_fault) in bars.into_iter().zip(lane.at_fault) {
            let (x, width) = (percent(from), percent(to) - percent(from));
            let fault = if at_fault { " fault" } else { "" };
            svg.add(format_args!(
                "<rect class=\"{style}{fault}\" x=\"{x:.2}%\" width=\"{width:.2}%\" y=\"{y}\" height=\"{LANE_BAR_PX}\"/>"
            ));
        }
    }
    format!("<div class=\"gantt\"><div>{names}</div>{}</div>", svg.finish())
}

/// Returns round numbers along an axis, in steps of 1, 2 or 5 times a power of ten: two to seven of them.
pub(super) fn marks(from: f64, to: f64) -> Vec<f64> {
    let rough = (to - from) / 6.0;
    let magnitude = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * magnitude).into_iter().find(|step| *step >= rough);
    let step = step.unwrap_or(rough);
    let first = (from / step).ceil() as i64;
    (first..).map(|i| i as f64 * step).take_while(|us| *us <= to).take(16).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_round_and_inside() {
        assert_eq!(marks(0.0, 1_325.0), [0.0, 500.0, 1000.0]);
        assert_eq!(marks(-30_000.0, 480.0)[..3], [-30_000.0, -20_000.0, -10_000.0]);
        for (from, to) in [(0.0, 1e-9), (-1e12, 3.0), (0.0, 7.0)] {
            let marks = marks(from, to);
            assert!((2..=8).contains(&marks.len()) && marks.iter().all(|us| (from..=to).contains(us)), "{marks:?}");
        }
    }

    #[test]
    fn a_lane_waits_and_then_runs() {
        let plant =
            Lane { name: "plant", waits: [-10_000.0, 5_000.0], runs: [5_000.0, 10_000.0], at_fault: [true, false] };
        let svg = time_line(&[plant]);
        assert!(svg.contains("<rect class=\"waits fault\" x=\"0.00%\" width=\"75.00%\""), "{svg}");
        assert!(svg.contains("<rect class=\"runs\" x=\"75.00%\" width=\"25.00%\""), "{svg}");
        assert!(svg.contains(">−10</text>"), "{svg}");
        assert_eq!(time_line(&[]), "");
    }
}
