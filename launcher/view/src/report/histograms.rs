//! Histograms of the stamps as small pictures, one per node and figure, all on one logarithmic axis of time.
//!
//! Lengths along the axis are percentages and heights are pixels, so a picture takes any width without a script.

use std::fmt::Write;

use contract::message::Message;
use contract::{Scenario, Topic};
use hdrhistogram::Histogram;

use super::Flight;
use super::html::escape;
use crate::timing::{Age, NodeTiming};
use flight::log::{Record, counted};

/// Bars per decade.
const BARS: i32 = 10;
/// Height of the tallest bar, and of the whole picture with the words below the axis \[px\].
const BAR_PX: f64 = 44.0;
const PICTURE_PX: f64 = 64.0;
/// The figures of a node that are drawn, with the style of their bars.
const DRAWN: [(&str, &str); 4] =
    [("jitter", "wake"), ("hop", "wake"), ("execution", "execution"), ("response", "response")];

/// One picture: caption, style of the bars, values, and the deadline \[ns\] where there is one.
struct Picture {
    caption: String,
    style: &'static str,
    histogram: Histogram<u64>,
    deadline_ns: Option<u64>,
}

/// A row of pictures for every node, and one for the whole ring.
pub fn grid(flight: &Flight, scenario: &Scenario) -> String {
    let period_ns = scenario.sample_ns();
    let mut rows = vec![
        node(Topic::State, flight.states, scenario),
        node(Topic::Reference, flight.references, scenario),
        node(Topic::Controls, flight.controls, scenario),
        node(Topic::Actuators, flight.actuators, scenario),
    ];
    let mut age = Age::new(period_ns);
    counted(flight.states).for_each(|(state, _)| age.observe(state));
    let aged =
        |caption: &str, histogram| Picture { caption: caption.into(), style: "age", histogram, deadline_ns: None };
    let ages = vec![aged("per command applied", age.per_command), aged("per slot held", age.per_slot)];
    rows.push(("age at the actuator", ages));

    let values = || rows.iter().flat_map(|(_, pictures)| pictures).filter(|p| !p.histogram.is_empty());
    let low_ns = values().map(|p| p.histogram.min()).min().unwrap_or(1).max(100);
    let high_ns = values().map(|p| p.histogram.max()).max().unwrap_or(1).max(period_ns);
    let decades = [(low_ns as f64).log10().floor() as i32, (high_ns as f64 * 1.1).log10().ceil() as i32];
    let mut html = String::from("<div class=\"histograms\">");
    for (name, pictures) in &rows {
        let _ = write!(html, "<h4>{name}</h4>"); // a String takes everything
        html.extend(pictures.iter().map(|picture| draw(name, picture, decades)));
    }
    html + "</div>"
}

fn node<M: Message>(topic: Topic, messages: &[M], scenario: &Scenario) -> (&'static str, Vec<Picture>)
where
    Record: From<M>,
{
    let mut timing = NodeTiming::new(topic, scenario);
    counted(messages).for_each(|(message, before)| _ = timing.observe(message.stamp(), &before));
    let picture = |(figure, histogram): (&str, &Histogram<u64>)| {
        let (_, style) = DRAWN.into_iter().find(|(name, _)| *name == figure)?;
        let caption = match (figure, topic) {
            ("jitter", _) => "release jitter".into(),
            ("hop", Topic::Actuators) => format!("hop from {}", Topic::Controls.publisher()),
            ("hop", Topic::Controls) => format!("hop from {}", Topic::Reference.publisher()),
            ("hop", _) => format!("hop from {}", Topic::State.publisher()),
            _ => figure.to_owned(),
        };
        let deadline_ns = (figure == "response").then_some(scenario.deadline_of(topic as usize).deadline_ns);
        Some(Picture { caption, style, histogram: histogram.clone(), deadline_ns })
    };
    (topic.publisher(), timing.figures().into_iter().filter_map(picture).collect())
}

fn draw(name: &str, picture: &Picture, [low, high]: [i32; 2]) -> String {
    let percent = |bar: f64| 100.0 * (bar - f64::from(low * BARS)) / f64::from((high - low) * BARS);
    let edge_ns = |bar: i32| 10_f64.powf(f64::from(bar) / f64::from(BARS));
    let h = &picture.histogram;
    let counts: Vec<(i32, u64)> = (low * BARS..high * BARS)
        .map(|bar| (bar, h.count_between(edge_ns(bar).ceil() as u64, edge_ns(bar + 1).ceil() as u64 - 1)))
        .filter(|(_, count)| *count > 0)
        .collect();
    let most = counts.iter().map(|(_, count)| *count).max().unwrap_or(1);
    let height_px = |count: u64| BAR_PX * (2.0 * count as f64).ln() / (2.0 * most as f64).ln();

    let words = |ns: u64| number_us(ns as f64 / 1e3);
    let figures =
        format!("{} / {} / {}", words(h.value_at_quantile(0.5)), words(h.value_at_quantile(0.99)), words(h.max()));
    let caption = escape(&picture.caption);
    let mut svg = format!(
        "<div class=\"histogram\"><p>{caption} <small>{figures} µs</small></p><svg height=\"{PICTURE_PX}\" role=\"img\" \
         aria-label=\"{name}, {caption}: p50, p99, max {figures} µs of {} values\">",
        h.len()
    );
    let mut element = |text: String| svg.push_str(&text);
    for decade in low..=high {
        let x = percent(f64::from(decade * BARS));
        element(format!("<line class=\"grid\" x1=\"{x:.2}%\" x2=\"{x:.2}%\" y1=\"0\" y2=\"{BAR_PX}\"/>"));
        let anchor = if decade == low {
            "start"
        } else if decade == high {
            "end"
        } else {
            "middle"
        };
        element(format!("<text x=\"{x:.2}%\" y=\"59\" text-anchor=\"{anchor}\">{}</text>", decade_words(decade)));
    }
    for (bar, count) in counts {
        let (x, y) = (percent(f64::from(bar)), height_px(count));
        let width = percent(f64::from(bar + 1)) - x;
        element(format!(
            "<rect class=\"{}\" x=\"{x:.2}%\" width=\"{width:.2}%\" y=\"{:.1}\" height=\"{y:.1}\"><title>{count} from {} \
             to {} µs</title></rect>",
            picture.style,
            BAR_PX - y,
            number_us(edge_ns(bar) / 1e3),
            number_us(edge_ns(bar + 1) / 1e3)
        ));
    }
    if let Some(deadline_ns) = picture.deadline_ns {
        let x = percent(f64::from(BARS) * (deadline_ns as f64).log10());
        element(format!("<line class=\"deadline\" x1=\"{x:.2}%\" x2=\"{x:.2}%\" y1=\"0\" y2=\"{BAR_PX}\"/>"));
    }
    element(format!("<line class=\"axis\" x1=\"0\" x2=\"100%\" y1=\"{BAR_PX}\" y2=\"{BAR_PX}\"/></svg></div>"));
    svg
}

/// Three digits are what a histogram knows.
fn number_us(us: f64) -> String {
    let decimals = usize::from(us < 10.0);
    format!("{us:.decimals$}")
}

/// A power of ten of nanoseconds; the unit where it begins, and bare tens and hundreds of it.
fn decade_words(decade: i32) -> String {
    match decade {
        0 => "1 ns".into(),
        3 => "1 µs".into(),
        6 => "1 ms".into(),
        9 => "1 s".into(),
        _ => 10_u32.pow(decade.rem_euclid(3) as u32).to_string(),
    }
}
