//! Pages without the network: HTML text and tables, pictures as inline SVG, and time plots, which scripts in the
//! page draw.

#![allow(clippy::disallowed_methods, reason = "where a line is drawn reaches no message")]

mod axes;
mod charts;
mod html;
mod plots;
mod share_map;
mod time_plots;

use std::fmt::{Display, Write};

pub use axes::Axis;
pub use charts::{Bars, Lane, histograms, time_line};
pub use html::{DASH, any, breakable, escape, leaves, list, number, page, table, verdict};
pub use plots::{Dots, Quartiles, Share, dots, interval, legend, shares, short};
pub use share_map::{MapCell, map};
pub use time_plots::{
    FlightColumns, HAPPENED_HINT, Plot, SCRIPTS, Series, TimePlots, UPLOT_STYLE, column, happened, in_script,
};

/// The style of the report, which other pages may use.
pub const STYLE: &str = include_str!("../../assets/report/report.css");

/// SVG picture under construction. Lengths are px, or percentages of the picture's width, which then may be any.
struct Svg(String);

impl Svg {
    fn new(attributes: &str, label: &str) -> Self {
        Self(format!("<svg {attributes} role=\"img\" aria-label=\"{label}\">"))
    }

    /// Begins a picture of fixed size \[px\].
    fn sized(width: f64, height: f64, label: &str) -> Self {
        Self::new(&format!("viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\""), label)
    }

    fn add(&mut self, element: impl Display) {
        let _ = write!(self.0, "{element}"); // writing to a String cannot fail
    }

    fn vertical(&mut self, class: &str, percent: f64, height: f64) {
        self.add(format_args!(
            "<line class=\"{class}\" x1=\"{percent:.2}%\" x2=\"{percent:.2}%\" y1=\"0\" y2=\"{height}\"/>"
        ));
    }

    /// Adds a label under the axis, kept inside the picture at its edges.
    fn tick(&mut self, percent: f64, y: f64, word: &str) {
        let anchor = match percent {
            x if x < 4.0 => "start",
            x if x > 92.0 => "end",
            _ => "middle",
        };
        self.add(format_args!("<text x=\"{percent:.2}%\" y=\"{y}\" text-anchor=\"{anchor}\">{word}</text>"));
    }

    fn text(&mut self, x: f64, y: f64, class: &str, text: &str) {
        self.add(format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\">{text}</text>"));
    }

    fn finish(self) -> String {
        self.0 + "</svg>"
    }
}
