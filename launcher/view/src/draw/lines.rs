//! Curves in one picture.

use std::fmt::Write;

use super::Svg;
use super::charts::COLOURS;
use super::html::escape;
use crate::thinning::extremes;

/// Size of the picture, and the room for words at the left and below \[px\].
const PICTURE_PX: [f64; 2] = [860.0, 260.0];
const LEFT_PX: f64 = 64.0;
const BELOW_PX: f64 = 40.0;
/// Approximate number of grid lines on an axis.
const GRID: f64 = 5.0;
/// Styles of the curves that have the colours first, and of those that have them again.
const DASHES: [&str; 2] = ["none", "6 4"];

/// A curve with its name in the legend.
pub struct Line<'a> {
    pub name: &'a str,
    pub points: Vec<(f64, f64)>,
}

/// Several curves over one pair of linear axes; values that are not finite leave gaps. Of a curve with more points than
/// the picture can show, the extremes are drawn. Curves that share a colour with one before them are dashed.
pub fn lines(all: &[Line], x_title: &str, y_title: &str) -> String {
    let [width, height] = PICTURE_PX;
    let bottom = height - BELOW_PX;
    let finite = || all.iter().flat_map(|line| &line.points).filter(|(x, y)| x.is_finite() && y.is_finite());
    let range = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = finite().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low < high {
            (low, high)
        } else if low.is_finite() {
            (low - 0.5, low + 0.5)
        } else {
            (0.0, 1.0)
        }
    };
    let ((x_low, x_high), (y_low, y_high)) = (range(|point| point.0), range(|point| point.1));
    let x_px = |x: f64| LEFT_PX + (width - LEFT_PX - 16.0) * (x - x_low) / (x_high - x_low);
    let y_px = |y: f64| 8.0 + (bottom - 8.0) * (y_high - y) / (y_high - y_low);
    let mut svg = Svg::new(
        &format!("viewBox=\"0 0 {width} {height}\" style=\"width:100%;font-size:11px\""),
        &format!("{} over {}", escape(y_title), escape(x_title)),
    );
    let (grid, words) = ("stroke=\"var(--grid)\"", "fill=\"var(--muted)\"");
    for (x, word) in marks(x_low, x_high) {
        let x = x_px(x);
        svg.add(format_args!("<line {grid} x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"8\" y2=\"{bottom}\"/>"));
        svg.add(format_args!(
            "<text {words} x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{word}</text>",
            bottom + 14.0
        ));
    }
    for (y, word) in marks(y_low, y_high) {
        let y = y_px(y);
        svg.add(format_args!("<line {grid} x1=\"{LEFT_PX}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>", width - 16.0));
        svg.add(format_args!(
            "<text {words} x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{word}</text>",
            LEFT_PX - 6.0,
            y + 4.0
        ));
    }
    svg.add(format_args!(
        "<text {words} x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
        f64::midpoint(LEFT_PX, width),
        height - 8.0,
        escape(x_title)
    ));
    let mut legend = String::from("<p>");
    for (i, line) in all.iter().enumerate() {
        let (colour, dashes) = (COLOURS[i % COLOURS.len()], DASHES[i / COLOURS.len() % DASHES.len()]);
        let mut path = String::new();
        let mut pen = 'M';
        for (x, y) in drawn(&line.points) {
            if x.is_finite() && y.is_finite() {
                let _ = write!(path, "{pen}{:.1} {:.1}", x_px(x), y_px(y)); // writing to a String cannot fail
                pen = 'L';
            } else {
                pen = 'M';
            }
        }
        svg.add(format_args!(
            "<path fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\" stroke-dasharray=\"{dashes}\" d=\"{path}\"/>"
        ));
        let sign = if i < COLOURS.len() { "&#9632;" } else { "&#9633;" };
        let _ = write!(legend, "<span style=\"color:{colour}\">{sign}</span> {} &nbsp; ", escape(line.name));
    }
    format!("{legend}<small>{}</small></p>{}", escape(y_title), svg.finish())
}

/// The points that are drawn of a curve: every point of a short one, the extremes of each column of the picture of a
/// long one.
fn drawn(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let columns = PICTURE_PX[0] as usize;
    if points.len() <= 2 * columns {
        return points.to_vec();
    }
    let height = |(x, y): &(f64, f64)| if x.is_finite() && y.is_finite() { *y } else { f64::NAN };
    let extremes = extremes(points, points.len().div_ceil(columns), height);
    extremes.flat_map(|two| two.map_or([(f64::NAN, f64::NAN); 2], |two| two.map(|point| *point))).collect()
}

/// Round numbers in a range, with their labels.
fn marks(low: f64, high: f64) -> Vec<(f64, String)> {
    let rough = (high - low) / GRID;
    let power = 10_f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|times| times * power).find(|step| *step >= rough).unwrap_or(rough);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|i| (i as f64 * step, format!("{:.decimals$}", i as f64 * step))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_curve_is_drawn_and_values_that_are_not_finite_leave_a_gap() {
        let line = |name, points: &[(f64, f64)]| Line { name, points: points.to_vec() };
        let html =
            lines(&[line("a", &[(0.0, 0.0), (1.0, f64::NAN), (2.0, 3.0)]), line("<b>", &[(0.0, 1.0)])], "t", "y");
        assert_eq!((html.matches("<path").count(), html.matches('M').count(), html.contains("<b>")), (2, 3, false));
    }

    #[test]
    fn a_long_curve_keeps_its_extremes_and_its_gaps() {
        let value = |i: usize| match i {
            4_000..5_000 => f64::NAN,
            70_001 => 50.0,
            _ => (i % 7) as f64,
        };
        let points: Vec<_> = (0..100_000).map(|i| (i as f64, value(i))).collect();
        let drawn = drawn(&points);
        assert!(drawn.len() < 2_000 && drawn.contains(&(70_001.0, 50.0)), "{}", drawn.len());
        assert!(drawn.iter().any(|(_, y)| y.is_nan()), "the gap stays");
        assert_eq!(super::drawn(&points[..1_000]).len(), 1_000, "a short one is drawn as it is");
    }

    #[test]
    fn marks_are_round_numbers_inside_the_range() {
        let words = |low, high| marks(low, high).into_iter().map(|(_, word)| word).collect::<Vec<_>>();
        assert_eq!(words(0.0, 10.0), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(words(-0.011, 0.03), ["-0.01", "0.00", "0.01", "0.02", "0.03"]);
    }
}
