//! Summary of a flight: the metrics of run.json and the hash over all states.
//!
//! The position error is the true position against the mission's trajectory at the same sample, not against the
//! reference that guidance sent.

use contract::Scenario;
use contract::message::{PlantStatus, State, mixer_flags};
use contract::scenario::Mode;
use guidance::Trajectory;
use ring::states::StateHash;

use crate::bounds::Outside;
use crate::cold_starts::ColdStarts;
use crate::faults::Faults;
use crate::following::Following;
use crate::metrics::Metrics;
use crate::solves::Solves;
use crate::ticks::{length_m, position_error_m};
use crate::timing::Timing;
use flight::inprocess;
use flight::log::{Count, Record};

/// Gathers a flight, message by message; the order between topics does not matter.
pub struct Summary {
    trajectory: Trajectory,
    sample_s: f64,
    metrics: Metrics,
    square_sum_m2: f64,
    samples: u64,
    following: Following,
    /// Ticks on which the mixer flew without a demand.
    fallback_ticks: u64,
    /// Weights of the demand in the cost (4).
    r: [f64; 4],
    /// Sum of u'Ru over the demands, and their number.
    effort: (f64, u64),
    outside: Outside,
    /// Hash over all states; `None` if it is not kept.
    hash: Option<StateHash>,
    count: Count,
    missed: u64,
    last: State,
    /// Time \[s\] and status of the plant, at the first state and at every change: take-off and landing.
    phases: Vec<(f64, PlantStatus)>,
    pub solves: Solves,
    pub faults: Faults,
    pub cold_starts: ColdStarts,
    pub timing: Option<Timing>,
}

impl Summary {
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            trajectory: Trajectory::new(scenario),
            sample_s: scenario.sample_s(),
            metrics: Metrics {
                max_altitude_error_horizontal_m: f64::NAN,
                max_altitude_error_vertical_m: f64::NAN,
                rotor_speed_min: f64::INFINITY,
                touchdown_s: f64::NAN,
                touchdown_sink_mps: f64::NAN,
                touchdown_drift_mps: f64::NAN,
                touchdown_tilt_deg: f64::NAN,
                ..Metrics::default()
            },
            square_sum_m2: 0.0,
            samples: 0,
            following: Following::default(),
            fallback_ticks: 0,
            r: scenario.mpc.r,
            effort: (0.0, 0),
            outside: Outside::new(scenario),
            hash: Some(StateHash::default()),
            count: Count::default(),
            missed: 0,
            last: State::default(),
            phases: vec![],
            solves: Solves::new(),
            faults: Faults::new(&scenario.fault, scenario.run.rate_hz),
            cold_starts: ColdStarts::default(),
            timing: (scenario.run.mode != Mode::Inprocess).then(|| Timing::new(scenario)),
        }
    }

    /// Makes the summary of a flight [of which no message is kept](inprocess::fly_unlogged): without the hash over all
    /// states, which takes a sixth of the time of a flight in process.
    pub fn unlogged(scenario: &Scenario) -> Self {
        let checked = inprocess::changes_messages(scenario);
        let count = if checked { Count::default() } else { Count::without_checksums() };
        Self { hash: None, count, ..Self::new(scenario) }
    }

    /// Notes the number of a message that is not summarized, so that a gap after it is found.
    pub fn pass(&mut self, record: &Record) {
        self.count.before(record);
    }

    /// Takes in the next message.
    pub fn observe(&mut self, record: &Record) {
        let Some(before) = self.count.before(record) else { return };
        self.missed = self.missed.saturating_add(record.stamp().sequence - before.sequence - 1);
        self.faults.observe(record);
        self.cold_starts.observe(record);
        self.following.observe(record);
        match record {
            Record::State(state) => self.state(state),
            Record::Controls(controls) => {
                self.solves.observe(controls);
                let effort = controls.demand.iter().zip(self.r).map(|(u, r)| u * u * r).sum::<f64>();
                self.effort = (self.effort.0 + effort, self.effort.1 + 1);
            }
            Record::Actuators(actuators) => {
                self.metrics.commands_saturated += u64::from(mixer_flags::saturated(actuators.flags));
                self.fallback_ticks += u64::from(mixer_flags::fallback(actuators.flags));
                self.metrics.negative_squares += u64::from(actuators.flags & mixer_flags::NEGATIVE_SQUARE != 0);
            }
            Record::Reference(_) => {}
        }
        if let Some(timing) = &mut self.timing {
            timing.observe(record, &before);
        }
    }

    fn state(&mut self, state: &State) {
        if let Some(hash) = &mut self.hash {
            hash.observe(state);
        }
        let t = state.stamp.tick as f64 * self.sample_s;
        let wanted = self.trajectory.at(t).position_m;
        let error = position_error_m(wanted, state);
        let distance = length_m(error);
        let m = &mut self.metrics;
        m.max_position_error_m = m.max_position_error_m.max(distance);
        m.final_position_error_m = distance;
        m.position_error_integral_ms += distance * self.sample_s;
        let leg = if (10.0..=50.0).contains(&t) {
            &mut m.max_altitude_error_horizontal_m
        } else {
            &mut m.max_altitude_error_vertical_m
        };
        *leg = leg.max(error[2].abs()); // NaN, the start, gives way to any number
        m.max_rate_radps = state.actual.rates_radps.iter().fold(m.max_rate_radps, |max, rate| max.max(rate.abs()));
        for omega in state.actuators.rotor_speed {
            m.rotor_speed_min = m.rotor_speed_min.min(omega);
            m.rotor_speed_max = m.rotor_speed_max.max(omega);
        }
        m.tilt_max_deg = m.tilt_max_deg.max(state.actuators.tilt_rad.abs().to_degrees());
        if m.touchdown_s.is_nan()
            && self.last.status == PlantStatus::Flying as u64
            && self.samples > 0
            && touches(state)
        {
            m.touchdown_s = t;
            m.touchdown_sink_mps = self.last.actual.sink_mps();
            let [north_mps, east_mps, _] = self.last.actual.velocity_ned_mps();
            m.touchdown_drift_mps = libm::hypot(north_mps, east_mps);
            m.touchdown_tilt_deg = state.actual.tilt_rad().to_degrees();
        }
        self.square_sum_m2 += distance * distance;
        self.samples += 1;
        self.last = *state;
        if self.phases.last().is_none_or(|(_, phase)| *phase != self.status()) {
            self.phases.push((t, self.status()));
        }
        self.metrics.fallback_s = self.fallback_ticks as f64 * self.sample_s;
        self.outside.observe(t, &self.metrics);
    }

    pub fn metrics(&self) -> Metrics {
        let rms_position_error_m = (self.square_sum_m2 / self.samples.max(1) as f64).sqrt();
        let [phi, theta, psi, p, q, r, w] = self.following.rms();
        Metrics {
            rms_position_error_m,
            fallback_s: self.fallback_ticks as f64 * self.sample_s,
            rms_attitude_error_deg: [phi, theta, psi].map(f64::to_degrees),
            rms_rates_error_dps: [p, q, r].map(f64::to_degrees),
            rms_w_error_mps: w,
            demand_effort: self.effort.0 / self.effort.1 as f64,
            ..self.metrics
        }
    }

    /// Time of the first sample outside a bound that is judged all the way \[s\]; `None` while there is none.
    pub fn outside_since_s(&self) -> Option<f64> {
        self.outside.since_s()
    }

    /// Time \[s\] and status of the plant, at the first state and at every change.
    pub fn phases(&self) -> &[(f64, PlantStatus)] {
        &self.phases
    }

    /// The newest state.
    pub fn last(&self) -> &State {
        &self.last
    }

    /// SHA-256 over every state's payload bits in order; `None` when a message was missed, none came, or it is not
    /// kept.
    pub fn state_hash(&self) -> Option<String> {
        self.hash.as_ref().filter(|_| self.missed == 0 && self.samples > 0).map(StateHash::text)
    }

    pub fn time_s(&self) -> f64 {
        self.last.stamp.tick as f64 * self.sample_s
    }

    pub fn status(&self) -> PlantStatus {
        PlantStatus::from_wire(self.last.status).unwrap_or(PlantStatus::NonFinite)
    }

    /// Messages the observer missed, by gaps in the sequence numbers.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

/// Returns whether the vehicle touches the ground after a flight.
fn touches(state: &State) -> bool {
    use PlantStatus::{Crashed, Landed, Landing, NotLanded, Slid, TippedOver};
    let touching = [Landing, Landed, Crashed, TippedOver, Slid, NotLanded];
    PlantStatus::from_wire(state.status).is_some_and(|status| touching.contains(&status))
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Kinematics, Message};

    #[test]
    fn only_the_first_touchdown_after_a_flight_counts() {
        use PlantStatus::{Flying, Landing, Standing, TakingOff};
        let mut summary = Summary::new(&Scenario::default());
        let course = [(Standing, 0.0), (TakingOff, 0.0), (Flying, 0.5), (Landing, 0.1), (Flying, 0.2), (Landing, 0.0)];
        for (tick, (status, sink_mps)) in (0..).zip(course) {
            let actual = Kinematics {
                velocity_mps: [0.0, 0.0, sink_mps],
                attitude_rad: [0.1 * tick as f64, 0.0, 0.0],
                ..Kinematics::default()
            };
            let mut state = State { actual, status: status as u64, ..State::default() };
            (state.stamp.tick, state.stamp.sequence) = (tick, tick + 1);
            summary.observe(&Record::State(state.with_checksum()));
        }
        let Metrics { touchdown_s, touchdown_sink_mps, touchdown_drift_mps, touchdown_tilt_deg, .. } =
            summary.metrics();
        assert!((touchdown_s - 0.03).abs() < 1e-12, "{touchdown_s}");
        assert!((touchdown_sink_mps - 0.5 * libm::cos(0.2)).abs() < 1e-12, "one sample before");
        assert!((touchdown_drift_mps - 0.5 * libm::sin(0.2)).abs() < 1e-12);
        assert!((touchdown_tilt_deg - 0.3_f64.to_degrees()).abs() < 1e-9);
    }
}
