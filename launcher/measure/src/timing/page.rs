//! The page: targets, tables, and histograms over a logarithmic axis, in one file that needs nothing else.

use std::fmt::Write;

use super::results::Results;
use super::series::Series;
use super::table::Table;
use crate::{Target, Verdict, plain};
use view::report::html::{any, escape, list, table};

const STYLE: &str = include_str!("../../../view/assets/report/report.css");
const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 260.0;
/// Room for the labels below and at the left.
const MARGIN: f64 = 44.0;
/// The axis: from 1 us, so many decades, so many bins in each.
const FIRST_NS: f64 = 1e3;
const DECADES: f64 = 5.0;
const BINS_PER_DECADE: f64 = 20.0;
/// Shares of a bin that the other axis covers: decades below 1.
const SHARES: f64 = 4.0;
/// In the order of the lines; the style sheet's own, and two more that stay apart from them.
const COLOURS: [&str; 6] = ["var(--blue)", "var(--orange)", "var(--green)", "#cc79a7", "#8f7700", "var(--muted)"];

/// One picture: a title and what it shows.
pub struct Figure<'a> {
    /// What it shows.
    pub title: String,
    /// One line each.
    pub series: Vec<&'a Series>,
}

/// The whole page.
pub fn page(results: &Results, targets: &[Target], tables: &[Table], figures: &[Figure]) -> String {
    let mut body = String::from("<h1>Timing of the stack</h1>");
    if let Some(why) = &results.canary.doubt {
        let _ = write!(body, "<p><strong>{}</strong></p>", escape(why)); // a String takes everything
    }
    body +=
        &section("Targets", &table(&["verdict", "figure", "measured", "target", "note"], targets.iter().map(target)));
    for t in tables {
        let rows = t.rows.iter().map(|row| row.iter().map(|cell| escape(cell)).collect());
        body += &section(t.title, &table(&t.headings, rows));
    }
    for figure in figures {
        body += &section(&figure.title, &histogram(&figure.series));
    }
    let host = results.host.as_object().into_iter().flatten();
    body += &section("Machine", &list(host.map(|(name, value)| (escape(name), any(value)))));
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>Timing of the stack</title>\
         <style>{STYLE}</style></head><body><main>{body}</main></body></html>\n"
    )
}

fn section(title: &str, content: &str) -> String {
    format!("<section><h2>{}</h2>{content}</section>", escape(title))
}

fn target(target: &Target) -> Vec<String> {
    let (word, colour) = match target.verdict {
        Verdict::Ok => ("ok", "good"),
        Verdict::Short => ("short", "bad"),
        Verdict::Inconclusive => ("inconclusive", "warn"),
    };
    let measured = target.measured.map_or("–".to_owned(), |value| format!("{} {}", plain(value), target.unit));
    vec![
        format!("<strong style=\"color:var(--{colour})\">{word}</strong>"),
        escape(&target.figure),
        escape(measured.trim_end()),
        escape(&target.target),
        escape(&target.note),
    ]
}

/// Share of the times in each bin, both axes logarithmic, as an inline picture with a legend.
fn histogram(series: &[&Series]) -> String {
    let mut svg = format!("<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" style=\"width:100%;font-size:11px\">");
    // A String takes everything.
    for decade in 0..=DECADES as i32 {
        let x = x_of(f64::from(decade));
        let label = ["1 us", "10 us", "100 us", "1 ms", "10 ms", "100 ms"][decade as usize];
        let _ = write!(
            svg,
            "<path d=\"M{x:.1} 0V{:.1}\" stroke=\"var(--grid)\"/>\
             <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"var(--muted)\">{label}</text>",
            HEIGHT - MARGIN,
            HEIGHT - MARGIN + 16.0
        );
    }
    for decade in 0..=SHARES as i32 {
        let y = y_of(10_f64.powi(-decade));
        let label = ["100 %", "10 %", "1 %", "0.1 %", "0.01 %"][decade as usize];
        let _ = write!(
            svg,
            "<path d=\"M{MARGIN} {y:.1}H{WIDTH}\" stroke=\"var(--grid)\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"var(--muted)\">{label}</text>",
            MARGIN - 4.0,
            (y + 4.0).max(9.0)
        );
    }
    let mut legend = String::from("<p class=\"hint\">");
    for (series, colour) in series.iter().zip(COLOURS.iter().cycle()) {
        let _ = write!(svg, "<path d=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"/>", steps(series));
        let _ = write!(legend, "<span style=\"color:{colour}\">&#9632;</span> {} &nbsp; ", escape(&series.name));
    }
    svg + "</svg>" + &legend + "</p>"
}

/// The outline of the bins.
fn steps(series: &Series) -> String {
    let mut counts = vec![0_u64; (DECADES * BINS_PER_DECADE) as usize];
    let times = || series.rounds.iter().flatten();
    let last = counts.len() - 1;
    for time in times() {
        let bin = ((*time as f64 / FIRST_NS).log10() * BINS_PER_DECADE).max(0.0) as usize;
        counts[bin.min(last)] += 1;
    }
    let all = times().count().max(1) as f64;
    let mut path = format!("M{MARGIN} {:.1}", y_of(0.0));
    for (bin, count) in counts.into_iter().enumerate() {
        let right = x_of((bin + 1) as f64 / BINS_PER_DECADE);
        let _ = write!(path, "V{:.1}H{right:.1}", y_of(count as f64 / all)); // a String takes everything
    }
    path
}

fn x_of(decades: f64) -> f64 {
    MARGIN + (WIDTH - MARGIN - 20.0) * decades / DECADES
}

fn y_of(share: f64) -> f64 {
    (HEIGHT - MARGIN) * (-share.log10() / SHARES).clamp(0.0, 1.0)
}
