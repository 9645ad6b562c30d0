//! Operating point: the place of this machine's real-time flights on the map.

use std::path::Path;
use std::process::Stdio;

use anyhow::{Context, bail, ensure};
use contract::scenario::file::{self, MAX_RESULTS_BYTES};
use serde::Serialize;
use serde_json::Value;

use crate::flights::namespace;
use flight::own_program;

/// Age at the actuator and misses of a real-time flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Point {
    /// Median age at the actuator \[ms\].
    pub age_p50_ms: f64,
    /// 99th percentile of the age at the actuator \[ms\].
    pub age_p99_ms: f64,
    /// Share of all ticks on which the mixer missed its deadline.
    pub miss_probability: f64,
}

impl Point {
    /// Reads the point of the run in the folder `run` from its run.json.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        let path = run.join("run.json");
        let text = file::read_text(&path, MAX_RESULTS_BYTES)
            .with_context(|| format!("cannot read {}; give the folder of a run with --run", path.display()))?;
        let json: Value = serde_json::from_str(&text).with_context(|| format!("{} is not JSON", path.display()))?;
        let mode = json["mode"].as_str().unwrap_or("no mode");
        ensure!(
            mode == "realtime",
            "{} is of a flight in mode {mode}, whose ages say nothing of the machine; \
             give one flown with --mode realtime",
            path.display()
        );
        Self::of(&json).with_context(|| format!("{} holds no age at the actuator", path.display()))
    }

    /// Flies five seconds in real time and returns their point; `out` becomes the folder of the run.
    pub fn fly(out: &Path) -> anyhow::Result<Self> {
        let fly = ["fly", "--mode", "realtime", "--no-log", "--json", "--set", "run.duration_s=5.0", "--namespace"];
        let flown = own_program()
            .args(fly)
            .arg(namespace())
            .arg("--out")
            .arg(out)
            .stdin(Stdio::null())
            .output()
            .context("cannot start a flight")?;
        if !flown.status.success() {
            bail!("the flight failed: {}", String::from_utf8_lossy(&flown.stderr).trim_end());
        }
        Self::read(out)
    }

    pub fn describe(&self) -> String {
        format!(
            "This machine: age at the actuator p50 {:.2} ms, p99 {:.2} ms, {:.2} % missed",
            self.age_p50_ms,
            self.age_p99_ms,
            self.miss_probability * 100.0
        )
    }

    fn of(run: &Value) -> Option<Self> {
        let timing = &run["timing"];
        let (age, mixer) = (&timing["age_at_actuator"], &timing["nodes"]["mixer"]);
        let (sent, missed) = (mixer["response"]["n"].as_f64()?, mixer["misses"].as_f64()?);
        Some(Self {
            age_p50_ms: age["p50_us"].as_f64()? / 1e3,
            age_p99_ms: age["p99_us"].as_f64()? / 1e3,
            miss_probability: missed / (sent + mixer["slips"].as_f64()?).max(1.0),
        })
    }
}
