//! The page: targets, tables, and histograms over a logarithmic axis, in one file that needs nothing else.

use flight::event::name;
use flight::provenance::host;
use view::draw::{self, STYLE, any, escape, list, outlines};
use view::percentiles::recorded;

use super::results::TimingResults;
use super::series::Series;
use crate::findings::{Target, Verdict};
use crate::table::Table;

/// One picture: a title and what it shows.
pub struct Figure<'a> {
    pub title: String,
    pub series: Vec<&'a Series>,
}

pub fn page(results: &TimingResults, targets: &[Target], tables: &[Table], figures: &[Figure]) -> String {
    let mut body = String::from("<h1>Timing of the stack</h1>");
    if let Some(why) = &results.canary.doubt {
        body.extend(["<p><strong>", &escape(why), "</strong></p>"]);
    }
    body += &section(
        "Targets",
        &draw::table(&["verdict", "figure", "measured", "target", "note"], targets.iter().map(target)),
    );
    for t in tables {
        let headings: Vec<&str> = t.headings.iter().map(String::as_str).collect();
        let rows = t.rows.iter().map(|row| row.iter().map(|cell| escape(cell)).collect());
        body += &section(&t.title, &draw::table(&headings, rows));
    }
    for figure in figures {
        body += &section(&figure.title, &histogram(&figure.series));
    }
    let host = host();
    let host = host.as_object().into_iter().flatten();
    body += &section("Machine", &list(host.map(|(name, value)| (escape(name), any(value)))));
    draw::page("Timing of the stack", STYLE, &body)
}

fn section(title: &str, content: &str) -> String {
    format!("<section><h2>{}</h2>{content}</section>", escape(title))
}

fn target(target: &Target) -> Vec<String> {
    let colour = match target.verdict {
        Verdict::Ok => "good",
        Verdict::Short => "bad",
        Verdict::Inconclusive => "warn",
    };
    vec![
        format!("<strong style=\"color:var(--{colour})\">{}</strong>", name(target.verdict)),
        escape(&target.figure),
        escape(&target.measured_text("–")),
        escape(&target.target),
        escape(&target.note),
    ]
}

fn histogram(series: &[&Series]) -> String {
    let times = |series: &Series| recorded(series.rounds.iter().flatten().copied());
    outlines(&series.iter().map(|series| (series.name.as_str(), times(series))).collect::<Vec<_>>())
}
