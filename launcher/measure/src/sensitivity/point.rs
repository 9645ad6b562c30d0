//! Operating point: the place of this machine's real-time flights on the map.

use std::path::Path;
use std::process::Stdio;

use anyhow::{Context, bail, ensure};
use contract::scenario::Mode;
use flight::event::name;
use flight::own_program;
use outcome::run_record::RunRecord;
use outcome::timing::Counts;
use serde::Serialize;

use crate::flights::namespace;

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
        let record = RunRecord::read(&path)?
            .with_context(|| format!("there is no {}; give the folder of a run with --run", path.display()))?;
        ensure!(
            record.mode == Mode::Realtime,
            "{} is of a flight in mode {}, whose ages say nothing of the machine; give one flown with --mode realtime",
            path.display(),
            name(record.mode)
        );
        Self::of(&record).with_context(|| format!("{} holds no age at the actuator", path.display()))
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

    fn of(run: &RunRecord) -> Option<Self> {
        let timing = run.timing.as_ref()?;
        let (age, mixer) = (&timing.age_at_actuator, timing.nodes.get("mixer")?);
        let (sent, Counts { misses, slips, .. }) = (mixer.response?.n, mixer.counts);
        Some(Self {
            age_p50_ms: age.p50_us / 1e3,
            age_p99_ms: age.p99_us / 1e3,
            miss_probability: misses as f64 / (sent + slips).max(1) as f64,
        })
    }
}
