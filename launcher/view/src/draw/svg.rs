//! One picture in the making.

use std::fmt::{Display, Write};

/// Lengths are px, or percentages of the picture's width: then it takes any width.
pub struct Svg(String);

impl Svg {
    pub fn new(attributes: &str, label: &str) -> Self {
        Self(format!("<svg {attributes} role=\"img\" aria-label=\"{label}\">"))
    }

    /// A picture that knows its size.
    pub fn sized(width: f64, height: f64, label: &str) -> Self {
        Self::new(&format!("viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\""), label)
    }

    pub fn add(&mut self, element: impl Display) {
        let _ = write!(self.0, "{element}"); // a String takes everything
    }

    pub fn vertical(&mut self, class: &str, percent: f64, height: f64) {
        self.add(format_args!(
            "<line class=\"{class}\" x1=\"{percent:.2}%\" x2=\"{percent:.2}%\" y1=\"0\" y2=\"{height}\"/>"
        ));
    }

    /// A word under the axis, inside the picture at its edges.
    pub fn tick(&mut self, percent: f64, y: f64, word: &str) {
        let anchor = match percent {
            x if x < 4.0 => "start",
            x if x > 92.0 => "end",
            _ => "middle",
        };
        self.add(format_args!("<text x=\"{percent:.2}%\" y=\"{y}\" text-anchor=\"{anchor}\">{word}</text>"));
    }

    pub fn text(&mut self, x: f64, y: f64, class: &str, text: &str) {
        self.add(format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\">{text}</text>"));
    }

    pub fn finish(self) -> String {
        self.0 + "</svg>"
    }
}
