//! One tick as horizontal bars: every process from its release to its publication.

use std::fmt::Write;

use contract::Topic;
use serde_json::Value;

use crate::timing::Part;

/// Height of one process, of its bar, and of the words below \[px\].
const ROW_PX: f64 = 17.0;
const BAR_PX: f64 = 11.0;
const WORDS_PX: f64 = 18.0;

/// One process: when it was due, began and sent, and since when it had been silent \[us from the sample\].
struct Lane {
    node: &'static str,
    silent_from: f64,
    release: f64,
    start: f64,
    publish: f64,
}

/// The picture of a tick as it stands in run.json; nothing when no process is known.
pub fn draw(tick: &Value, period_us: f64) -> String {
    let lanes: Vec<Lane> = Topic::ALL.into_iter().filter_map(|topic| lane(tick, topic, period_us)).collect();
    let from = lanes.iter().map(|lane| lane.silent_from).fold(0.0, f64::min);
    let to = lanes.iter().map(|lane| lane.publish).fold(0.0, f64::max);
    if to <= from {
        return String::new();
    }
    let percent = |us: f64| 100.0 * (us - from) / (to - from);
    let bottom = ROW_PX * lanes.len() as f64;
    let names = lanes.iter().flat_map(|lane| ["<span>", lane.node, "</span>"]).collect::<String>();
    let mut svg = format!(
        "<div class=\"gantt\"><div>{names}</div><svg height=\"{}\" role=\"img\" aria-label=\"time line\">",
        bottom + WORDS_PX
    );
    for us in marks(from, to) {
        let x = percent(us);
        let anchor = if x < 4.0 {
            "start"
        } else if x > 92.0 {
            "end"
        } else {
            "middle"
        };
        let ms = (us / 10.0).round() / 100.0;
        let _ = write!(
            svg,
            "<line class=\"grid\" x1=\"{x:.2}%\" x2=\"{x:.2}%\" y1=\"0\" y2=\"{bottom}\"/>\
             <text x=\"{x:.2}%\" y=\"{}\" text-anchor=\"{anchor}\">{}</text>",
            bottom + 13.0,
            ms.to_string().replace('-', "−")
        );
    }
    for (row, lane) in lanes.iter().enumerate() {
        let y = ROW_PX * row as f64 + (ROW_PX - BAR_PX) / 2.0;
        let here = tick["node"] == lane.node;
        let running = tick["part"] == "execution";
        let mut bar = |style: &str, at_fault: bool, [from, to]: [f64; 2]| {
            let (x, width) = (percent(from), percent(to) - percent(from));
            let fault = if at_fault { " fault" } else { "" };
            let _ = write!(
                svg,
                "<rect class=\"{style}{fault}\" x=\"{x:.2}%\" width=\"{width:.2}%\" y=\"{y}\" height=\"{BAR_PX}\"/>"
            );
        };
        bar("waits", here && !running, [lane.silent_from.min(lane.release), lane.start]);
        bar("runs", here && running, [lane.start, lane.publish]);
    }
    svg + "</svg></div>"
}

fn lane(tick: &Value, topic: Topic, period_us: f64) -> Option<Lane> {
    let node = topic.publisher();
    let cycle = &tick["nodes"][node];
    let [release, start, publish] = ["release_us", "start_us", "publish_us"].map(|key| cycle[key].as_f64());
    let release = release?;
    let waited_for_input = tick["node"] == node && tick["part"] == Part::Input.name();
    let waited_us = match cycle["silent"].as_f64() {
        _ if waited_for_input => tick["part_us"].as_f64().unwrap_or(0.0),
        silent => silent.unwrap_or(0.0) * period_us,
    };
    Some(Lane { node, silent_from: release - waited_us, release, start: start?, publish: publish? })
}

/// Round numbers \[us\] along the axis: steps of 1, 2 or 5, three to seven of them.
fn marks(from: f64, to: f64) -> Vec<f64> {
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
    use serde_json::json;

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
    fn a_process_waits_from_the_slots_it_skipped_to_its_start_and_then_runs() {
        let plant = json!({ "release_us": 0.0, "start_us": 5_000.0, "publish_us": 10_000.0, "silent": 1 });
        let svg = draw(&json!({ "node": "plant", "part": "jitter", "nodes": { "plant": plant } }), 10_000.0);
        assert!(svg.contains("<rect class=\"waits fault\" x=\"0.00%\" width=\"75.00%\""), "{svg}");
        assert!(svg.contains("<rect class=\"runs\" x=\"75.00%\" width=\"25.00%\""), "{svg}");
        assert!(svg.contains(">−10</text>"), "{svg}");
        assert_eq!(draw(&json!({ "nodes": { "plant": { "release_us": 1.0 } } }), 10_000.0), "");
    }
}
