//! CycleTiming on the terminal: a line per node, the age, the worst tick.

use std::fmt::Write;

use contract::topic::NODES;

use super::Timing;
use super::figures::{Percentiles, percentiles};
use crate::happenings::Happenings;

/// The table and the two lines below it, indented as the rest of the summary.
pub fn describe(timing: &Timing, happened: &Happenings) -> String {
    let mut text = String::new();
    let mut line = |words: &str| {
        let _ = writeln!(text, "  {}", words.trim_end()); // a String takes everything
    };
    let groups = ["jitter or hop", "execution", "response [us]"].map(|name| format!("{name:^24}"));
    line(&format!("{:<14}{}", "", groups.concat()));
    let columns = format!("{:>7}{:>7}{:>8}  ", "p50", "p99", "max").repeat(3);
    line(&format!("{:<14}{columns}{:>6}{:>5}", "", "misses", "run"));
    for (name, node) in NODES.iter().zip(&timing.nodes) {
        let cells = [&node.wake, &node.execution, &node.response].map(|histogram| cell(&percentiles(histogram)));
        line(&format!("{name:<14}{}{:>6}{:>5}", cells.concat(), node.misses, node.longest_run));
    }
    for contradiction in timing.clocks.describe() {
        line(&format!("{:<22}{contradiction}", "clocks differ"));
    }
    let [commands, slots] = [&timing.age.per_command, &timing.age.per_slot].map(percentiles);
    line(&format!("{:<22}{}", "age at the actuator", age(&commands, "commands applied")));
    line(&format!("{:<22}{}", "", age(&slots, "slots held")));
    if let Some((tick, culprit)) = timing.worst_ticks(happened).first() {
        let error = tick.position_error_m.map_or(String::new(), |m| format!("; position error {m:.3} m"));
        let late_ms = tick.late_ns() as f64 / 1e6;
        line(&format!("{:<22}{late_ms:.2} ms, tick {} at {:.2} s{error}", "worst tick", tick.number, tick.time_s()));
        line(&format!("{:<22}{}", "", culprit.describe()));
    }
    text
}

fn cell(p: &Percentiles) -> String {
    format!("{:>7.0}{:>7.0}{:>8.0}  ", p.p50_us, p.p99_us, p.max_us)
}

fn age(p: &Percentiles, of_what: &str) -> String {
    let [p50, p99, max] = [p.p50_us, p.p99_us, p.max_us].map(|us| us / 1e3);
    format!("p50 {p50:.2} ms, p99 {p99:.2} ms, max {max:.2} ms over {} {of_what}", p.n)
}
