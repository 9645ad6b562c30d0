//! Pages: HTML text and tables, and pictures as inline SVG, all without a script and without the network.

mod charts;
mod heat_map;
mod html;
mod svg;

pub use charts::{Bars, Lane, histograms, outlines, time_line};
pub use heat_map::{HeatCell, HeatMap};
pub use html::{DASH, any, escape, leaves, list, number, page, table, verdict};

/// The style of the report, which other pages may use.
pub const STYLE: &str = include_str!("../../assets/report/report.css");
