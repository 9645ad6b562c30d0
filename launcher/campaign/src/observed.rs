//! Value, as measured in a flight in real time, of the setting whose limit a campaign searches.

use std::path::Path;

use anyhow::{Context, bail, ensure};
use flight::event::name;
use outcome::run_record::RunRecord;
use outcome::timing::CycleCounts;
use settings::Mode;

/// Value of a setting as measured in a flight in real time.
#[derive(Debug, Clone, PartialEq)]
pub struct Observed {
    /// Value, in the unit of the setting.
    pub value: f64,
    /// Quantity that was measured.
    pub words: &'static str,
}

impl Observed {
    /// Reads the value of `key` from the run.json of the folder `run`.
    ///
    /// # Errors
    /// The run was not flown in real time, has no times, or does not measure this setting.
    pub fn read(run: &Path, key: &str) -> anyhow::Result<Self> {
        let path = run.join("run.json");
        let record = RunRecord::read(&path)?
            .with_context(|| format!("there is no {}; give the folder of a run with --observed", path.display()))?;
        ensure!(
            record.mode == Mode::Realtime,
            "{} is of a flight in mode {}, whose ages say nothing of the machine; give one flown with --mode realtime",
            path.display(),
            name(record.mode)
        );
        let timing = record.timing.as_ref().with_context(|| format!("{} holds no times", path.display()))?;
        let age = &timing.age_at_actuator;
        let (value, words) = match key {
            "run.command_delay_ms" => (age.p99_us / 1e3, "99th percentile of the age at the actuator"),
            "run.command_jitter_ms" => {
                ((age.p99_us - age.p50_us) / 1e3, "99th percentile less the median of the age at the actuator")
            }
            "run.command_drop_probability" => {
                let mixer = timing.nodes.get("mixer").context("no times of the mixer")?;
                let CycleCounts { misses, slips, .. } = mixer.counts;
                let sent = mixer.response.as_ref().map_or(0, |response| response.n);
                (misses as f64 / (sent + slips).max(1) as f64, "share of ticks on which the mixer missed its deadline")
            }
            _ => bail!(
                "--observed: a flight in real time shows nothing of `{key}`; it shows run.command_delay_ms, \
                 run.command_jitter_ms and run.command_drop_probability"
            ),
        };
        Ok(Self { value, words })
    }
}
