//! `run.json`: the record of a run, for programs and for the pages. It is made once, when the flight is over, and read
//! back by every command that is given the run.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use anyhow::{Context, ensure};
use contract::guard::Refusal;
use contract::message::PlantStatus;
use flight::event::TimedEvent;
use flight::hover::Hover;
use flight::log::LogOutcome;
use flight::provenance::{Provenance, SCHEMA_VERSION};
use folder::files;
use runtime::port::PortFailure;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use settings::file::MAX_RESULTS_BYTES;
use settings::{Mode, Profile, Scenario, SolverName, candidate, schema_of};

use crate::bounds::BoundCheck;
use crate::faults::FaultRecord;
use crate::happenings::{Happenings, Phase};
use crate::judge::{Circumstances, Verdict};
use crate::metrics::{Metrics, or_nan};
use crate::solves::SolverRecord;
use crate::summary::Summary;
use crate::timing::TimingRecord;

/// Record of a flight: its end, metrics, timing, faults, events and provenance. Times are in seconds of the flight
/// unless the name says another unit; null stands for a figure that the flight does not have.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
pub struct RunRecord {
    /// Name of the scenario.
    pub name: String,
    /// Mode of the flight.
    pub mode: Mode,
    /// Profile of defaults.
    pub profile: Profile,
    /// Duration that the scenario asks for \[s\].
    pub duration_s: f64,
    /// Time of the last sample \[s\].
    pub flown_s: f64,
    /// `true` if the vehicle left the limits of a flight: 500 m from the origin, 100 rad/s, or a number that is not
    /// finite.
    pub diverged: bool,
    /// Contact with the ground at the end, or "in the air"; null if there is no ground.
    pub ground: Option<String>,
    /// Phases of take-off and landing; null if there is no ground.
    pub phases: Option<Vec<Phase>>,
    /// End of the flight, for people.
    pub ended: String,
    /// Reservations: what was not as the settings ask, though the exit code may be 0.
    pub reservations: Vec<String>,
    /// Exit code of the flight.
    pub exit_code: u8,
    /// Metrics of the flight.
    pub metrics: Metrics,
    /// Work of the solver of attitude-mpc.
    pub solver: SolverRecord,
    /// SHA-256 over STATE and TRUTH of every sample in order, hexadecimal; null if one is missing.
    pub state_hash: Option<String>,
    /// `true` if a replay gives the same state hash; `false` if it may give another: a message is missing, or the clock
    /// may have stopped a solve.
    pub replays: bool,
    /// Bounds, each compared with the flight.
    pub bounds: Vec<BoundCheck>,
    /// Hover of the vehicle, and its control loops in small motions; null for a record that `fly` has not made, and
    /// without a log.
    pub hover: Option<Hover>,
    /// Speed of the flight against the clock.
    pub speed: Speed,
    /// Timing of the nodes; null for a flight in process, which has no times.
    pub timing: Option<TimingRecord>,
    /// Result of the recorder; null for a flight without a log.
    pub log: Option<LogOutcome>,
    /// Messages that the observer missed.
    pub unobserved: u64,
    /// Faults, of the scenario and given in flight.
    pub faults: Vec<FaultRecord>,
    /// Events, in order; they are on the topic `/events` of flight.mcap and in `trefoil status --json` too.
    pub events: Vec<TimedEvent>,
    /// Messages refused, by node and cause.
    pub refused: NodeCounts,
    /// Failures of ports, by node and cause.
    pub port_failures: NodeCounts,
    /// Origin of the run; null for a record made from a log alone.
    pub provenance: Option<Provenance>,
}

/// Returns the JSON Schema of run.json.
pub fn schema() -> Value {
    schema_of::<RunRecord>("run.json of Trefoil", schemars::generate::Contract::Serialize)
}

/// Counts of each node, by cause.
pub type NodeCounts = BTreeMap<String, BTreeMap<String, u32>>;

/// Speed of the flight against the clock; NaN, which is null in JSON, if it is not known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Speed {
    /// Wall time of the flight, without start and report \[s\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub wall_s: f64,
    /// Time of the flight as a multiple of its wall time.
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub times_realtime: f64,
}

/// Everything known of a flight that is over.
pub struct Account<'a> {
    pub summary: &'a Summary,
    pub scenario: &'a Scenario,
    pub how: &'a Circumstances,
    pub verdict: &'a Verdict,
    /// Wall time of the flight \[s\], without start and report.
    pub wall_s: f64,
    pub provenance: Option<Provenance>,
}

impl RunRecord {
    /// Makes the record of a flight, without its hover.
    pub fn of(account: Account) -> Self {
        let Account { summary, scenario, how, verdict, wall_s, provenance } = account;
        let flown_s = summary.time_s();
        let faults = summary.faults.records(&how.events);
        let mut events = TimedEvent::all(&how.events, scenario.run.rate_hz);
        summary.cold_starts.mark(&mut events);
        let happened = Happenings::new(&faults, &events);
        Self {
            name: scenario.name.clone(),
            mode: scenario.run.mode,
            profile: scenario.profile,
            duration_s: scenario.run.duration_s,
            flown_s,
            diverged: summary.status().diverged(),
            ground: touchdown(scenario, summary.status()).map(str::to_owned),
            phases: phases(scenario, summary),
            ended: verdict.end.clone(),
            reservations: verdict.reservations.clone(),
            exit_code: verdict.exit_code,
            metrics: summary.metrics(),
            solver: summary.solver(),
            state_hash: summary.state_hash(),
            replays: replays(summary, how, scenario),
            bounds: verdict.bounds.clone(),
            hover: None,
            speed: Speed { wall_s, times_realtime: flown_s / wall_s },
            timing: summary.timing.as_ref().map(|timing| timing.record(&happened)),
            log: how.log.clone(),
            unobserved: summary.missed,
            faults,
            events,
            refused: by_node(&how.refused, Refusal::ALL.map(Refusal::name)),
            port_failures: by_node(&how.port_failures, PortFailure::ALL.map(PortFailure::name)),
            provenance,
        }
    }

    /// Reads run.json; `None` if there is no such file.
    ///
    /// # Errors
    /// The file cannot be read, is not JSON, or is of another version of this program.
    pub fn read(path: &Path) -> anyhow::Result<Option<Self>> {
        let file = path.display();
        let text = match files::read_text(path, MAX_RESULTS_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| format!("cannot read {file}")),
        };
        let json: Value = serde_json::from_str(&text).with_context(|| format!("{file} is not JSON"))?;
        let host = &json["provenance"];
        let by = host["git"]["commit"].as_str().map_or("another commit".into(), |commit| format!("commit {commit}"));
        let version = host["schema_version"].as_u64().unwrap_or(SCHEMA_VERSION.into());
        ensure!(
            version == u64::from(SCHEMA_VERSION),
            "{file} has version {version} of run.json and this program reads version {SCHEMA_VERSION}: \
             use the program of {by}, which wrote it"
        );
        let record = serde_json::from_value(json);
        record.map(Some).with_context(|| {
            format!("{file} is no run.json of this program: use the program of {by}, which wrote it, or mend the file")
        })
    }

    /// Returns faults, events and absences on the time axis.
    pub fn happenings(&self) -> Happenings {
        Happenings::new(&self.faults, &self.events).with_phases(self.phases.as_deref().unwrap_or_default())
    }

    /// Returns the settings of the run, with the orders given in flight; `None` if run.json has none, or none that
    /// can be read.
    pub fn scenario(&self) -> Option<Scenario> {
        settings::from_merged(&self.provenance.as_ref()?.scenario, "run.json").ok()
    }
}

/// Returns whether a replay of the flight gives the same state hash: the log has every message, and no solve was
/// stopped if the clock may have stopped it. A limit of iterations stops the solve of a replay at the same iteration.
fn replays(summary: &Summary, how: &Circumstances, scenario: &Scenario) -> bool {
    let is_whole = how.log.as_ref().is_some_and(|log| log.dropped == 0 && log.error.is_none());
    let swapped = scenario.swap.iter().filter_map(|swap| candidate(scenario, swap).ok());
    let has_clock = |own: &Scenario| {
        own.run.mode == Mode::Realtime
            && own.attitude.mpc.solver == SolverName::Clarabel
            && own.attitude.mpc.time_limit_ms > 0.0
    };
    let may_stop = has_clock(scenario) || swapped.into_iter().any(|own| has_clock(&own));
    is_whole && summary.state_hash().is_some() && (summary.solves.stopped() == 0 || !may_stop)
}

fn by_node<const N: usize>(counts: &[(impl ToString, [u32; N])], causes: [&str; N]) -> NodeCounts {
    let by_cause = |counts: &[u32; N]| causes.iter().map(|&cause| cause.to_owned()).zip(*counts).collect();
    counts.iter().map(|(node, counts)| (node.to_string(), by_cause(counts))).collect()
}

/// Says how the flight met the ground at its end, or "in the air"; `None` where there is no ground.
pub fn touchdown(scenario: &Scenario, status: PlantStatus) -> Option<&'static str> {
    use PlantStatus as P;
    scenario.plant.ground.present.then_some(match status {
        P::Landed | P::Crashed | P::TippedOver | P::Slid | P::NotLanded | P::Standing | P::TakingOff | P::Landing => {
            status.describe()
        }
        P::Flying | P::Finished | P::NonFinite | P::TooFar | P::TooFast => "in the air",
    })
}

/// Returns the phases of take-off, flight and landing; `None` without a ground.
pub fn phases(scenario: &Scenario, summary: &Summary) -> Option<Vec<Phase>> {
    let in_flight = summary.phases.iter().filter(|(_, phase)| !phase.is_last());
    let all = in_flight.map(|(at_s, phase)| Phase { at_s: *at_s, phase: phase.describe().into() });
    scenario.plant.ground.present.then(|| all.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use flight::guarded;
    use flight::log::Record;

    /// Flies a tenth of a second in process.
    fn flown() -> RunRecord {
        let set = ["run.mode=inprocess", "run.duration_s=0.1"].map(str::to_owned);
        let scenario = &settings::load(None, &set).unwrap();
        let mut summary = Summary::new(scenario);
        let watch = |record: &Record| {
            summary.observe(record);
            true
        };
        let flown = guarded::fly(scenario, true, watch, |_| {}).unwrap();
        let how = Circumstances::from(flown);
        let verdict = Verdict::of(&summary, scenario, &how);
        let provenance = Some(flight::provenance::provenance(scenario, &[]));
        RunRecord::of(Account { summary: &summary, scenario, how: &how, verdict: &verdict, wall_s: 1.0, provenance })
    }

    fn read(json: &Value) -> anyhow::Result<Option<RunRecord>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.json");
        std::fs::write(&path, json.to_string()).unwrap();
        RunRecord::read(&path)
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let written = serde_json::to_value(flown()).unwrap();
        assert!(written["metrics"]["touchdown_s"].is_null(), "it did not land");
        let read = read(&written).unwrap().unwrap();
        assert!(read.metrics.touchdown_s.is_nan());
        assert_eq!(serde_json::to_value(read).unwrap(), written);
    }

    #[test]
    fn a_record_of_another_version_is_refused_with_the_commit_that_wrote_it() {
        let refused = |change: fn(&mut Value)| {
            let mut json = serde_json::to_value(flown()).unwrap();
            json["provenance"]["git"] = serde_json::json!({ "commit": "0123abcd", "changed": false });
            change(&mut json);
            format!("{:#}", read(&json).unwrap_err())
        };
        let older = refused(|json| json["provenance"]["schema_version"] = 1.into());
        assert!(older.contains("has version 1") && older.contains("commit 0123abcd"), "{older}");
        let other = refused(|json| json["flown_s"] = "long".into());
        assert!(other.contains("invalid type: string \"long\"") && other.contains("commit 0123abcd"), "{other}");
    }
}
