//! The flights of the map: every profile under every delay, jitter and probability of a miss.

use std::fmt::Write;
use std::path::Path;

use contract::Scenario;
use contract::scenario::{Profile, ScenarioError};
use rayon::prelude::*;
use serde::Serialize;

use super::SensitivityArgs;
use super::cell::{PROFILES, name};
use crate::survival::failed_at_s;
use flight::inprocess;
use flight::settings;
use view::summary::Summary;

/// Delays of the map \[ms\]: finer where the paper's controller has its limit.
const PAPER_DELAYS_MS: [f64; 10] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0];
/// Delays of the map \[ms\]: likewise, ten times as far out.
const ROBUST_DELAYS_MS: [f64; 14] = [0.0, 5.0, 10.0, 20.0, 30.0, 40.0, 45.0, 50.0, 52.0, 54.0, 56.0, 58.0, 60.0, 64.0];

/// All flights of a map, not yet flown.
pub struct Grid {
    pub name: String,
    pub scenarios: Vec<Scenario>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GridFlight {
    pub profile: Profile,
    pub delay_ms: f64,
    /// Jitter on top of it \[ms\].
    pub jitter_ms: f64,
    pub miss_probability: f64,
    pub seed: u64,
    /// When the vehicle diverged \[s\]: see [`failed_at_s`].
    pub diverged_at_s: Option<f64>,
    /// Largest position error \[m\], up to the loss.
    pub max_position_error_m: f64,
    pub rms_position_error_m: f64,
}

impl Grid {
    /// The flights that the arguments ask for. A setting that no scenario may have is an error.
    pub fn new(args: &SensitivityArgs) -> Result<Self, ScenarioError> {
        let mut grid = Self { name: String::new(), scenarios: vec![] };
        for profile in PROFILES {
            let delays = match profile {
                _ if !args.delays.is_empty() => args.delays.as_slice(),
                Profile::Paper => &PAPER_DELAYS_MS,
                Profile::Robust => &ROBUST_DELAYS_MS,
            };
            for miss in sorted(&args.misses) {
                for jitter in sorted(&args.jitters) {
                    for delay in sorted(delays) {
                        grid.add(args.scenario.as_deref(), args.seeds, profile, [delay, jitter, miss])?;
                    }
                }
            }
        }
        Ok(grid)
    }

    /// The flights of one cell: one where nothing is random, else one for each seed.
    fn add(
        &mut self,
        file: Option<&Path>,
        seeds: u64,
        profile: Profile,
        [delay, jitter, miss]: [f64; 3],
    ) -> Result<(), ScenarioError> {
        let mut first = settings::load(
            file,
            &[
                format!("profile={}", name(profile)),
                "run.mode=inprocess".into(),
                format!("run.command_delay_ms={delay:?}"),
                format!("run.command_jitter_ms={jitter:?}"),
                format!("run.command_drop_probability={miss:?}"),
            ],
        )?;
        self.name.clone_from(&first.name);
        let seeds = if jitter == 0.0 && miss == 0.0 { 1 } else { seeds };
        for _ in 0..seeds {
            self.scenarios.push(first.clone());
            first.run.seed = first.run.seed.wrapping_add(1);
        }
        Ok(())
    }

    /// Flies all, on as many cores as there are; in the order of the scenarios.
    pub fn fly(&self) -> Vec<GridFlight> {
        self.scenarios.par_iter().map(fly).collect()
    }
}

fn fly(scenario: &Scenario) -> GridFlight {
    let mut summary = Summary::new(scenario);
    inprocess::fly(scenario, |record| {
        summary.observe(&record);
        true
    });
    let (run, metrics) = (&scenario.run, summary.metrics());
    GridFlight {
        profile: scenario.profile,
        delay_ms: run.command_delay_ms,
        jitter_ms: run.command_jitter_ms,
        miss_probability: run.command_drop_probability,
        seed: run.seed,
        diverged_at_s: failed_at_s(&summary),
        max_position_error_m: metrics.max_position_error_m,
        rms_position_error_m: metrics.rms_position_error_m,
    }
}

pub fn to_csv(flights: &[GridFlight]) -> String {
    let mut text = String::from("profile,delay_ms,jitter_ms,miss_probability,seed,diverged_at_s,max_m,rms_m\n");
    for f in flights {
        let (lost, profile) = (f.diverged_at_s.map(|t| t.to_string()).unwrap_or_default(), name(f.profile));
        let GridFlight { delay_ms, jitter_ms, miss_probability, seed, .. } = f;
        let (max, rms) = (f.max_position_error_m, f.rms_position_error_m);
        // A String takes everything.
        let _ = writeln!(text, "{profile},{delay_ms},{jitter_ms},{miss_probability},{seed},{lost},{max},{rms}");
    }
    text
}

/// Rising, each value once.
fn sorted(values: &[f64]) -> Vec<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
