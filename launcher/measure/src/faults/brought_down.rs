//! Flights over ground that cannot continue, and how the vehicle comes down.
//!
//! Every flight is `scenarios/take-off-and-land.toml`, in process, with one fault at 20 s that stays: a node that is
//! not replaced, or a rotor that stands still. The vehicle is then 8 m high and moving. Without guidance or
//! attitude-mpc the next node continues and must land. Without the mixer there is no command, and with a dead rotor the
//! flight is terminated; in these cases nothing is promised.

use contract::Scenario;
use contract::message::{PlantStatus, State};
use contract::scenario::{Fault, FaultKind, FaultTarget, Mode, from_merged};
use flight::event::name;
use flight::log::Record;
use nalgebra::{Rotation3, Vector3};
use plant::ground::{Ground, Motion};
use serde::Serialize;

use crate::flights::in_process;
use outcome::target::Target;
use view::table::{Table, cell};

/// Time at which every fault begins \[s\].
const AT_S: f64 = 20.0;
/// Faults, with `true` if the flight must end in a landing.
const FAULTS: [(FaultTarget, FaultKind, bool); 6] = [
    (FaultTarget::Guidance, FaultKind::Kill, true),
    (FaultTarget::AttitudeMpc, FaultKind::Kill, true),
    (FaultTarget::Mixer, FaultKind::Kill, false),
    (FaultTarget::Rotor1, FaultKind::Off, false),
    (FaultTarget::Rotor2, FaultKind::Off, false),
    (FaultTarget::Rotor3, FaultKind::Off, false),
];

/// End of one flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BroughtDown {
    /// Target and kind.
    pub fault: String,
    /// `true` if the flight must end in a landing.
    pub must_land: bool,
    /// Value of `ground` in run.json.
    pub verdict: &'static str,
    /// Time from the fault to the first sample on the ground \[s\].
    pub down_after_s: Option<f64>,
    /// Angle between the body z axis and the vertical at that sample \[deg\].
    pub tilt_deg: Option<f64>,
    /// Sink rate of the vehicle one sample before \[m/s\].
    pub sink_mps: Option<f64>,
}

/// Returns the scenario that every fault is added to, compiled in so that the command works in any folder.
fn over_ground() -> anyhow::Result<Scenario> {
    let text = include_str!("../../../../scenarios/take-off-and-land.toml");
    Ok(from_merged(text, "scenarios/take-off-and-land.toml")?)
}

impl BroughtDown {
    pub fn fly_all() -> anyhow::Result<Vec<Self>> {
        let mut base = over_ground()?;
        base.run.mode = Mode::Inprocess;
        Ok(FAULTS.into_iter().map(|(target, kind, must_land)| Self::fly(&base, target, kind, must_land)).collect())
    }

    fn fly(base: &Scenario, target: FaultTarget, kind: FaultKind, must_land: bool) -> Self {
        // The fault lasts to the end, so that a killed process is not replaced.
        let fault = Fault::new(target, kind, AT_S, Some(base.run.duration_s - AT_S));
        let scenario = Scenario { fault: vec![fault], ..base.clone() };
        let mut watch = Watch::new(&scenario);
        let (summary, _) = in_process(&scenario, |record| watch.observe(record));
        Self {
            fault: format!("{} {}", name(target), name(kind)),
            must_land,
            verdict: outcome::run_record::touchdown(&scenario, summary.status()).unwrap_or("no ground"),
            down_after_s: watch.down.map(|down| down.at_s - AT_S),
            tilt_deg: watch.down.map(|down| down.tilt_deg),
            sink_mps: watch.down.map(|down| down.sink_mps),
        }
    }

    pub fn table(all: &[Self]) -> Table {
        let cells = |one: &Self| {
            let [down, tilt, sink] =
                [(one.down_after_s, 2), (one.tilt_deg, 1), (one.sink_mps, 2)].map(|(x, n)| cell(x, n));
            vec![one.fault.clone(), one.verdict.to_owned(), down, tilt, sink]
        };
        let title = format!(
            "Over ground, a fault at {AT_S} s that stays: until the vehicle is down [s], its tilt then [deg] and how fast it \
             sank [m/s]"
        );
        Table::new(&title, &["fault", "verdict", "down", "tilt", "sank"], all.iter().map(cells).collect())
    }

    pub fn target(all: &[Self]) -> Target {
        let short = || all.iter().filter(|one| one.must_land && one.verdict != "landed");
        let must = all.iter().filter(|one| one.must_land).count();
        let names: Vec<&str> = short().map(|one| one.fault.as_str()).collect();
        Target::none(format!("over ground, {must} nodes gone for good: not landed"), short().count())
            .noting(names.join(", "))
    }
}

/// First sample on the ground after the fault.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Down {
    at_s: f64,
    tilt_deg: f64,
    sink_mps: f64,
}

struct Watch {
    ground: Option<Ground>,
    sample_s: f64,
    /// Sink rate at the newest sample \[m/s\].
    sink_mps: f64,
    down: Option<Down>,
}

impl Watch {
    fn new(scenario: &Scenario) -> Self {
        Self { ground: Ground::new(scenario), sample_s: scenario.sample_s(), sink_mps: 0.0, down: None }
    }

    fn observe(&mut self, record: &Record) {
        let (Record::State(state), Some(ground), None) = (record, &self.ground, self.down) else { return };
        let at_s = state.stamp.tick as f64 * self.sample_s;
        let motion = motion(state);
        let is_down =
            ground.carries(&motion) || PlantStatus::from_wire(state.status).is_some_and(PlantStatus::diverged);
        if at_s >= AT_S && is_down {
            let tilt_deg = libm::acos(motion.cnb[(2, 2)].clamp(-1.0, 1.0)).to_degrees();
            self.down = Some(Down { at_s, tilt_deg, sink_mps: self.sink_mps });
        }
        self.sink_mps = (motion.cnb * motion.velocity_mps).z;
    }
}

fn motion(state: &State) -> Motion {
    let [roll, pitch, yaw] = state.actual.attitude_rad;
    Motion {
        down_m: state.actual.position_m[2],
        velocity_mps: Vector3::from(state.actual.velocity_mps),
        rates_radps: Vector3::from(state.actual.rates_radps),
        cnb: *Rotation3::from_euler_angles(roll, pitch, yaw).matrix(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use outcome::target::Verdict;

    #[test]
    fn only_the_first_sample_on_the_ground_after_the_fault_counts() {
        let scenario = over_ground().expect("a scenario");
        let mut watch = Watch::new(&scenario);
        let mut at = |time_s: f64, height_m: f64, sink_mps: f64, roll_rad: f64| {
            let mut state = State::default();
            state.stamp.tick = (time_s / scenario.sample_s()).round() as u64;
            state.actual.position_m[2] = -height_m;
            state.actual.velocity_mps[2] = sink_mps;
            state.actual.attitude_rad[0] = roll_rad;
            watch.observe(&Record::State(state));
            watch.down
        };
        assert_eq!(at(1.0, -0.001, 0.0, 0.0), None, "it stands on the ground before it takes off");
        assert_eq!(at(25.0, 0.1, 0.5, 0.0), None);
        let down = at(26.0, -0.01, 0.1, 0.1).expect("a foot touches");
        assert!((down.at_s - 26.0).abs() < 1e-9 && down.sink_mps == 0.5, "{down:?}");
        assert!((down.tilt_deg - 0.1_f64.to_degrees()).abs() < 1e-9);
        assert_eq!(at(27.0, -0.01, 0.0, 0.0), Some(down), "the first counts");
    }

    #[test]
    fn the_vehicle_lands_without_a_controller_and_falls_without_a_mixer_or_a_rotor() {
        for one in BroughtDown::fly_all().expect("it flies") {
            assert_eq!(one.verdict, if one.must_land { "landed" } else { "crashed" }, "{one:?}");
            assert!(one.down_after_s.is_some_and(|s| if one.must_land { s > 2.0 } else { s < 2.5 }), "{one:?}");
        }
    }

    #[test]
    fn a_flight_that_must_land_and_does_not_makes_the_target_short() {
        let one = |verdict, must_land| BroughtDown {
            fault: "mixer kill".into(),
            must_land,
            verdict,
            down_after_s: None,
            tilt_deg: None,
            sink_mps: None,
        };
        let verdict = |all: &[BroughtDown]| BroughtDown::target(all).verdict;
        assert_eq!(verdict(&[one("landed", true), one("crashed", false)]), Verdict::Ok);
        assert_eq!(verdict(&[one("crashed", true)]), Verdict::Short);
        assert_eq!(verdict(&[one("in the air", true)]), Verdict::Short);
    }
}
