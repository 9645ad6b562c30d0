//! Summary of a flight: the metrics of run.json and the hash over all samples.
//!
//! The position error is the true position against the mission's trajectory at the same sample, not against the
//! reference that guidance sent.
//!
//! Errors, effort and counts of commands are those of the flight in the air. A vehicle that waits for its take-off, or
//! has landed, follows nothing, so the time that it stands changes none of them:
//!
//! ```text
//! standing    taking off, flying    landing                         standing
//! left out    counts                counts, unless it ends standing left out
//! ```

use contract::message::{PlantStatus, Sample, State, Truth};
use guidance::Trajectory;
use ring::samples::Samples;
use ring::states::StateHash;
use settings::{Mode, Scenario};

use crate::cold_starts::ColdStarts;
use crate::faults::Faults;
use crate::in_air::InAir;
use crate::metrics::Metrics;
use crate::solves::{SolverRecord, Solves};
use crate::ticks::position_error_m;
use crate::timing::Timing;
use flight::guarded;
use flight::log::{Count, Record};

/// Largest number of answers that wait for the state of their tick, so that holes in the log cost bounded memory.
const MOST_EARLY: usize = 1000;

/// Gathers a flight, message by message; the order between topics does not matter.
pub struct Summary {
    trajectory: Trajectory,
    sample_s: f64,
    in_air: InAir,
    /// Time of the touchdown \[s\] and what was gathered before it, while the vehicle is landing.
    before_touch: Option<(f64, Box<InAir>)>,
    /// Metrics of the whole recording: extremes of the true motion and actuators, first touchdown after a flight, and
    /// time on the ground. Its other fields are not used, because `in_air` has them.
    whole: Metrics,
    /// STATE and TRUTH, until both of a tick have come.
    joined: Samples,
    /// Answers that came before the sample of their tick, which says whether they count.
    early: Vec<Record>,
    samples: u64,
    /// Hash over all samples; `None` if it is not kept.
    hash: Option<StateHash>,
    count: Count,
    /// Messages that the observer missed, by gaps in the sequence numbers.
    pub missed: u64,
    /// Newest sample.
    pub last: Sample,
    /// Time \[s\] and status of the plant, at the first state and at every change: take-off and landing.
    pub phases: Vec<(f64, PlantStatus)>,
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
            in_air: InAir::new(scenario),
            before_touch: None,
            whole: Metrics {
                rotor_speed_min: f64::INFINITY,
                touchdown_s: f64::NAN,
                touchdown_sink_mps: f64::NAN,
                touchdown_drift_mps: f64::NAN,
                touchdown_tilt_deg: f64::NAN,
                ..Metrics::default()
            },
            joined: Samples::default(),
            early: vec![],
            samples: 0,
            hash: Some(StateHash::default()),
            count: Count::default(),
            missed: 0,
            last: Sample::default(),
            phases: vec![],
            solves: Solves::new(),
            faults: Faults::new(&scenario.fault, scenario.run.rate_hz),
            cold_starts: ColdStarts::default(),
            timing: (scenario.run.mode != Mode::Inprocess).then(|| Timing::new(scenario)),
        }
    }

    /// Makes the summary of a flight of which no message is kept: without the hash over all states.
    pub fn unlogged(scenario: &Scenario) -> Self {
        let checked = guarded::changes_messages(scenario);
        let count = if checked { Count::default() } else { Count::without_checksums() };
        Self { hash: None, count, ..Self::new(scenario) }
    }

    /// Notes the number of a message that is not summarized, so that a gap after it is found.
    pub fn pass(&mut self, record: &Record) {
        self.count.gap(record);
    }

    /// Takes in the next message.
    pub fn observe(&mut self, record: &Record) {
        if let Record::Truth(truth) = record {
            let Some(missed) = self.count.gap(record) else { return };
            self.missed = self.missed.saturating_add(missed);
            if let Some(timing) = &mut self.timing {
                timing.truth(truth);
            }
            return self.join(record);
        }
        let (Some(before), Some((_, stamp))) = (self.count.before(record), record.stamped()) else { return };
        self.missed = self.missed.saturating_add(stamp.sequence - before.sequence - 1);
        self.faults.observe(record);
        self.cold_starts.observe(record);
        match record {
            Record::State(_) => self.join(record),
            answer if self.samples > 0 && answer.tick() <= self.last.truth.tick => self.answer(answer),
            answer => {
                if self.early.len() == MOST_EARLY {
                    self.early.remove(0);
                }
                self.early.push(*answer);
            }
        }
        if let Some(timing) = &mut self.timing {
            timing.observe(record, &before);
        }
    }

    /// Takes in a STATE or TRUTH; if that completes a sample, also the answers to it that came before.
    fn join(&mut self, record: &Record) {
        let Some(sample) = self.joined.join(record) else { return };
        self.sample(&sample);
        let known: Vec<Record> = self.early.extract_if(.., |answer| answer.tick() <= sample.truth.tick).collect();
        for answer in &known {
            self.answer(answer);
        }
    }

    fn sample(&mut self, sample: &Sample) {
        if let Some(hash) = &mut self.hash {
            hash.observe(sample);
        }
        let truth = &sample.truth;
        let t = truth.tick as f64 * self.sample_s;
        self.touch(t, sample);
        self.reach(truth);
        self.last = *sample;
        self.samples += 1;
        let status = self.status();
        if self.phases.last().is_none_or(|(_, phase)| *phase != status) {
            self.phases.push((t, status));
            match (status, self.before_touch.take()) {
                (PlantStatus::Landing, None) => self.before_touch = Some((t, Box::new(self.in_air.clone()))),
                (_, Some((since_s, before))) if stands(status) => {
                    self.in_air = *before;
                    self.whole.on_ground_s += t - since_s;
                }
                _ => {} // flies again, or ends without having landed: the landing counts
            }
        }
        if stands(status) {
            self.whole.on_ground_s += self.sample_s;
        } else {
            let error = position_error_m(self.trajectory.at(t).position_m, truth);
            self.in_air.truth(t, truth, error);
        }
    }

    /// Takes in an answer to a sample that has come.
    fn answer(&mut self, record: &Record) {
        let t = record.tick() as f64 * self.sample_s;
        if let Record::Controls(controls) = record {
            self.solves.observe(controls);
        }
        if self.counts_at(t) {
            self.in_air.answer(record);
            if let Some((_, before)) = self.before_touch.as_mut().filter(|(since_s, _)| t < *since_s) {
                before.answer(record);
            }
        }
    }

    /// Returns whether the sample at `t` \[s\] counts, as far as is known.
    fn counts_at(&self, t: f64) -> bool {
        let next = self.phases.partition_point(|(since_s, _)| *since_s <= t);
        let phase = next.checked_sub(1).map(|i| self.phases[i].1);
        let has_landed = || self.phases.get(next).is_some_and(|(_, after)| stands(*after));
        !phase.is_some_and(|phase| stands(phase) || phase == PlantStatus::Landing && has_landed())
    }

    /// Notes the first touchdown after a flight, if `sample` at `t` \[s\] is it.
    fn touch(&mut self, t: f64, sample: &Sample) {
        let before = &self.last;
        let flew = self.samples > 0 && before.state.status == PlantStatus::Flying as u64;
        if self.whole.touchdown_s.is_nan() && flew && touches(&sample.state) {
            let [north_mps, east_mps, _] = before.truth.actual.velocity_ned_mps();
            self.whole.touchdown_s = t;
            self.whole.touchdown_sink_mps = before.truth.actual.sink_mps();
            self.whole.touchdown_drift_mps = libm::hypot(north_mps, east_mps);
            self.whole.touchdown_tilt_deg = sample.truth.actual.tilt_rad().to_degrees();
        }
    }

    /// Takes the extremes of the true motion and actuators in.
    fn reach(&mut self, Truth { actual, actuators, .. }: &Truth) {
        let largest = |before: f64, of: &[f64]| of.iter().fold(before, |max, value| max.max(value.abs()));
        let whole = &mut self.whole;
        whole.max_rate_radps = largest(whole.max_rate_radps, &actual.rates_radps);
        whole.rotor_speed_max = largest(whole.rotor_speed_max, &actuators.rotor_speed);
        whole.rotor_speed_min = actuators.rotor_speed.into_iter().fold(whole.rotor_speed_min, f64::min);
        whole.tilt_max_deg = largest(whole.tilt_max_deg, &[actuators.tilt_rad.to_degrees()]);
    }

    pub fn metrics(&self) -> Metrics {
        let whole = &self.whole;
        Metrics {
            max_rate_radps: whole.max_rate_radps,
            rotor_speed_min: whole.rotor_speed_min,
            rotor_speed_max: whole.rotor_speed_max,
            tilt_max_deg: whole.tilt_max_deg,
            touchdown_s: whole.touchdown_s,
            touchdown_sink_mps: whole.touchdown_sink_mps,
            touchdown_drift_mps: whole.touchdown_drift_mps,
            touchdown_tilt_deg: whole.touchdown_tilt_deg,
            on_ground_s: whole.on_ground_s,
            ..self.in_air.metrics()
        }
    }

    /// Returns the work of the solver; of the ticks without a reference only those in the air, because guidance gives
    /// none to a vehicle that stands.
    pub fn solver(&self) -> SolverRecord {
        SolverRecord { no_reference: self.in_air.without_reference, ..self.solves.record() }
    }

    /// Time of the first sample outside a bound that applies at every sample \[s\]; `None` while there is none.
    pub fn outside_since_s(&self) -> Option<f64> {
        self.in_air.outside.since_s
    }

    /// SHA-256 over every sample's payload bits in order; `None` if a message was missed, none came, or no hash is
    /// kept.
    pub fn state_hash(&self) -> Option<String> {
        self.hash.as_ref().filter(|_| self.missed == 0 && self.samples > 0).map(StateHash::text)
    }

    pub fn time_s(&self) -> f64 {
        self.last.truth.tick as f64 * self.sample_s
    }

    pub fn status(&self) -> PlantStatus {
        PlantStatus::from_wire(self.last.state.status).unwrap_or(PlantStatus::NonFinite)
    }
}

/// Returns whether a vehicle of this status stands on the ground without thrust.
fn stands(status: PlantStatus) -> bool {
    matches!(status, PlantStatus::Standing | PlantStatus::Landed)
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
    use contract::message::{Controls, Kinematics, Message, Stamp};

    fn truth(tick: u64, actual: Kinematics) -> Record {
        Truth { tick, sequence: tick + 1, actual, ..Truth::default() }.with_checksum().into()
    }

    /// Gathers states of these phases, one a tick, each `error_m` north of the start, with a demand in each.
    fn gathered(course: &[(PlantStatus, f64)], answers_first: bool) -> Metrics {
        let mut summary = Summary::new(&Scenario::default());
        for (tick, (status, error_m)) in (0..).zip(course) {
            let actual = Kinematics { position_m: [*error_m, 0.0, 0.0], ..Kinematics::default() };
            let mut state = State { status: *status as u64, ..State::default() };
            let mut controls = Controls { demand: [*error_m, 0.0, 0.0, 0.0], ..Controls::default() };
            for stamp in [&mut state.stamp, &mut controls.stamp] {
                (stamp.tick, stamp.sequence) = (tick, tick + 1);
            }
            let [state, controls] = [Record::State(state.with_checksum()), Record::Controls(controls.with_checksum())];
            let mut all = [truth(tick, actual), state, controls];
            if answers_first {
                all.reverse();
            }
            for record in &all {
                summary.observe(record);
            }
        }
        summary.metrics()
    }

    #[test]
    fn time_on_the_ground_changes_no_metric_of_the_flight() {
        use PlantStatus::{Flying, Landed, Landing, NotLanded, Standing, TakingOff};
        let flight = [(Standing, 9.0), (TakingOff, 0.1), (Flying, 0.5), (Landing, 0.7), (Standing, 0.8)];
        for answers_first in [false, true] {
            let short = gathered(&[&flight[..], &[(Landed, 0.8)]].concat(), answers_first);
            let long = gathered(&[&flight[..], &[(Standing, 3.0); 500], &[(Landed, 3.0)]].concat(), answers_first);
            for metrics in [short, long] {
                for error_m in [metrics.max_position_error_m, metrics.final_position_error_m] {
                    assert!((error_m - 0.5).abs() < 1e-6, "{error_m}");
                }
                let effort = f64::midpoint(0.01, 0.25) * Scenario::default().attitude.mpc.r[0];
                assert!((metrics.demand_effort - effort).abs() < 1e-12, "{}", metrics.demand_effort);
            }
            assert!((short.on_ground_s - 0.04).abs() < 1e-9 && (long.on_ground_s - 5.04).abs() < 1e-9);
            let stuck = gathered(&[&flight[..4], &[(Landing, 7.0), (NotLanded, 8.0)]].concat(), answers_first);
            assert!((stuck.max_position_error_m - 8.0).abs() < 1e-6, "it is on the ground, and has not landed");
            let bounced = gathered(&[&flight[..4], &[(Flying, 0.2)]].concat(), answers_first);
            assert!((bounced.max_position_error_m - 0.7).abs() < 1e-6, "a bounce");
        }
    }

    #[test]
    fn a_lost_truth_is_a_missed_message_and_the_flight_has_no_hash() {
        let missed = |lost: Option<u64>| {
            let mut summary = Summary::new(&Scenario::default());
            for tick in 0..5 {
                let stamp = Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() };
                summary.observe(&State { stamp, ..State::default() }.with_checksum().into());
                if lost != Some(tick) {
                    summary.observe(&truth(tick, Kinematics::default()));
                }
            }
            (summary.missed, summary.state_hash().is_some(), summary.last.state.stamp.tick)
        };
        assert_eq!([missed(None), missed(Some(2))], [(0, true, 4), (1, false, 4)]);
    }

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
            let mut state = State { status: status as u64, ..State::default() };
            (state.stamp.tick, state.stamp.sequence) = (tick, tick + 1);
            summary.observe(&Record::State(state.with_checksum()));
            summary.observe(&truth(tick, actual));
        }
        let Metrics { touchdown_s, touchdown_sink_mps, touchdown_drift_mps, touchdown_tilt_deg, .. } =
            summary.metrics();
        assert!((touchdown_s - 0.03).abs() < 1e-12, "{touchdown_s}");
        assert!((touchdown_sink_mps - 0.5 * libm::cos(0.2)).abs() < 1e-12, "one sample before");
        assert!((touchdown_drift_mps - 0.5 * libm::sin(0.2)).abs() < 1e-12);
        assert!((touchdown_tilt_deg - 0.3_f64.to_degrees()).abs() < 1e-9);
    }
}
