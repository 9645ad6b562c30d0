//! Sequences of problems: the controller's inputs on each tick of a flight.
//!
//! A flight log holds the scenario and every STATE and REFERENCE. A new controller with the same messages solves the
//! same problems in the same order. Without a log, four flights are flown first:
//!
//! | sequence | flight |
//! |---|---|
//! | `survey` | the paper's mission, nominal |
//! | `upset` | thrown at 60/-30/45 degrees of attitude and 3 rad/s |
//! | `yaw` | a turn by 90 degrees in one step |
//! | `weak` | a step of 10 m with a thrust-to-weight ratio of 1.37 |

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::bail;
use contract::message::{Reference, State};
use flight::guarded;
use flight::log::{LogWriter, Record};
use outcome::recorded::{Recorded, TimeSpan};
use runtime::console::eprint_line;
use settings::{Constraints, Law, Mode, Scenario, SolverName};

/// Flights that are measured if none is given: name, scenario file, duration \[s\]; an empty file is the default.
const SHIPPED: [(&str, &str, f64); 4] = [
    ("survey", "", 3.5),
    ("upset", include_str!("../../../../scenarios/aggressive/upset.toml"), 2.0),
    ("yaw", include_str!("../../../../scenarios/aggressive/yaw.toml"), 2.0),
    ("weak", include_str!("../../../../scenarios/aggressive/weak-step.toml"), 3.5),
];

/// Inputs of the controller, tick by tick.
#[derive(Debug, Clone)]
pub struct Sequence {
    pub name: String,
    pub scenario: Scenario,
    /// STATE and REFERENCE of each tick.
    pub samples: Vec<(State, Reference)>,
}

impl Sequence {
    /// Returns the flight's settings for `law` and, if it is the MPC, `solver`: in process (so without a time limit),
    /// and without faults.
    pub fn scenario_for(&self, law: Law, solver: SolverName) -> Scenario {
        let mut scenario = self.scenario.clone();
        scenario.run.mode = Mode::Inprocess;
        scenario.attitude.law = law;
        scenario.attitude.mpc.solver = solver;
        scenario.fault.clear();
        scenario
    }
}

/// Flies the flights of `SHIPPED`, with the exact limits in the plan; their logs stay in `folder`.
pub fn shipped(folder: &Path) -> anyhow::Result<Vec<Sequence>> {
    let fly = |(name, text, duration_s): (&str, &str, f64)| {
        let mut scenario = settings::from_merged(text, name)?;
        scenario.attitude.mpc.constraints = Constraints::Cone;
        (scenario.run.mode, scenario.run.duration_s) = (Mode::Inprocess, duration_s);
        let path = folder.join(name).with_extension("mcap");
        let mut log = LogWriter::create(&path, &settings::to_toml(&scenario), scenario.sample_ns())?;
        let mut written = Ok(());
        let watch = |record: &Record| {
            written = log.write(record);
            written.is_ok()
        };
        guarded::fly(&scenario, true, watch, |_| {})?;
        written?;
        log.finish()?;
        recorded(&path)
    };
    SHIPPED.into_iter().map(fly).collect()
}

/// Largest number of samples measured of a log: about 17 minutes at 100 Hz, and 130 MB.
const MOST_SAMPLES: usize = 100_000;
/// Number of states kept until their REFERENCE comes.
const KNOWN_STATES: usize = 1000;

/// Reads the flight in the log at `path`, or in the run's folder at `path`.
pub fn recorded(path: &Path) -> anyhow::Result<Sequence> {
    let (mut states, mut samples) = (BTreeMap::new(), vec![]);
    let Recorded { log, scenario, path: file, .. } =
        Recorded::read_each(path, TimeSpan::ALL, |_, record| match record {
            _ if samples.len() == MOST_SAMPLES => {}
            Record::State(state) => {
                states.insert(state.stamp.tick, *state);
                if states.len() > KNOWN_STATES {
                    states.pop_first();
                }
            }
            Record::Reference(reference) => {
                samples.extend(states.get(&reference.stamp.tick).map(|state| (*state, *reference)));
            }
            _ => {}
        })?;
    if samples.len() == MOST_SAMPLES {
        eprint_line(&format!("note: of {} the first {MOST_SAMPLES} samples are measured", file.display()));
    }
    if let Some(defect) = &log.defect {
        eprint_line(&format!("note: {} is not whole, what was read before is measured: {defect}", file.display()));
    }
    if samples.is_empty() {
        bail!("{} holds no tick with both STATE and REFERENCE", file.display());
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Sequence { name, scenario, samples })
}

#[cfg(test)]
mod tests {
    use attitude_mpc::AttitudeMpc;
    use attitude_mpc::law::mpc::condensed::Condensed;
    use attitude_mpc::law::mpc::constraints::PlanSet;
    use attitude_mpc::model::PredictionModel;
    use contract::message::SolveStatus;

    use super::*;

    #[test]
    fn a_step_is_explicit_if_the_plan_is_inside_the_set() {
        let folder = tempfile::tempdir().unwrap();
        let mut all_solved = 0;
        for sequence in shipped(folder.path()).unwrap() {
            let model = PredictionModel::new(&sequence.scenario);
            let Condensed { course, .. } = Condensed::new(&model, &sequence.scenario).unwrap();
            let set = PlanSet::new(&sequence.scenario, &course, model.trim.roll_rad).unwrap();
            let mut mpc = AttitudeMpc::new(&sequence.scenario_for(Law::Mpc, sequence.scenario.attitude.mpc.solver));
            let (mut explicit, mut solved) = (0, 0);
            for (state, reference) in &sequence.samples {
                let controls = mpc.step(state.stamp.tick, state, reference);
                let [unconstrained, _] = mpc.plans().expect("it plans ahead");
                let is_explicit = controls.status == SolveStatus::Explicit as u64;
                assert_eq!(set.violation(unconstrained) <= 0.0, is_explicit, "{}", sequence.name);
                *if is_explicit { &mut explicit } else { &mut solved } += 1;
            }
            assert!(explicit > 50 && (solved > 0 || sequence.name == "survey"), "{explicit} {solved}");
            all_solved += solved;
        }
        assert!(all_solved > 100, "{all_solved}");
    }
}
