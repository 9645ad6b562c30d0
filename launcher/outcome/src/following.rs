//! Command following: how far the true angles, rates and w were from the references that guidance gave for the same
//! sample.

use airframe::angle;
use contract::message::{Reference, Truth};
use flight::log::Record;

/// Number of compared quantities: phi, theta, psi \[rad\], p, q, r \[rad/s\], w \[m/s\].
const NUMBERS: usize = 7;
/// Largest number of messages that wait for the other one of their tick, so that holes in the log cost bounded memory.
const MOST_AWAITED: usize = 1000;

/// Sums the squared errors of a flight; the messages of the two topics may come in any order.
#[derive(Debug, Clone, Default)]
pub struct Following {
    /// Ticks of which one message has come, with its quantities.
    awaiting: Vec<(u64, Half)>,
    square_sums: [f64; NUMBERS],
    samples: u64,
}

#[derive(Debug, Clone, Copy)]
enum Half {
    True([f64; NUMBERS]),
    Wanted([f64; NUMBERS]),
}

impl Following {
    pub fn observe(&mut self, record: &Record) {
        let (tick, half) = match record {
            Record::Truth(of_plant) => (of_plant.tick, Half::True(truth(of_plant))),
            Record::Reference(reference) => (reference.stamp.tick, Half::Wanted(wanted(reference))),
            Record::State(_) | Record::Controls(_) | Record::Actuators(_) => return,
        };
        let there = self.awaiting.iter().rposition(|(of, _)| *of == tick);
        match (there.map(|i| self.awaiting.remove(i).1), half) {
            (Some(Half::True(truth)), Half::Wanted(wanted)) | (Some(Half::Wanted(wanted)), Half::True(truth)) => {
                self.add(&truth, &wanted);
            }
            _ => {
                if self.awaiting.len() == MOST_AWAITED {
                    self.awaiting.remove(0);
                }
                self.awaiting.push((tick, half));
            }
        }
    }

    fn add(&mut self, truth: &[f64; NUMBERS], wanted: &[f64; NUMBERS]) {
        for (i, sum) in self.square_sums.iter_mut().enumerate() {
            let error = if i < 3 { angle::difference(truth[i], wanted[i]) } else { truth[i] - wanted[i] };
            *sum += error * error;
        }
        self.samples += 1;
    }

    /// RMS of the errors of phi, theta, psi \[rad\], p, q, r \[rad/s\] and w \[m/s\]; NaN without a sample.
    pub fn rms(&self) -> [f64; NUMBERS] {
        self.square_sums.map(|sum| (sum / self.samples as f64).sqrt())
    }
}

fn truth(Truth { actual, .. }: &Truth) -> [f64; NUMBERS] {
    let [phi, theta, psi] = actual.attitude_rad;
    let [p, q, r] = actual.rates_radps;
    [phi, theta, psi, p, q, r, actual.velocity_mps[2]]
}

fn wanted(reference: &Reference) -> [f64; NUMBERS] {
    let [phi, theta, psi] = reference.attitude_rad;
    let [p, q, r] = reference.rates_radps;
    [phi, theta, psi, p, q, r, reference.w_mps]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(tick: u64, psi_rad: f64, w_mps: f64) -> Record {
        let mut truth = Truth { tick, ..Truth::default() };
        truth.actual.attitude_rad[2] = psi_rad;
        truth.actual.velocity_mps[2] = w_mps;
        Record::Truth(truth)
    }

    fn reference(tick: u64, psi_rad: f64, q_radps: f64) -> Record {
        let mut reference = Reference::default();
        reference.stamp.tick = tick;
        reference.attitude_rad[2] = psi_rad;
        reference.rates_radps[1] = q_radps;
        Record::Reference(reference)
    }

    fn rms(records: &[Record]) -> [f64; NUMBERS] {
        let mut following = Following::default();
        for record in records {
            following.observe(record);
        }
        following.rms()
    }

    #[test]
    fn a_heading_error_is_an_angle_across_the_full_turn() {
        let [_, _, psi, ..] = rms(&[truth(0, 3.1, 0.0), reference(0, -3.1, 0.0)]);
        assert!((psi - (std::f64::consts::TAU - 6.2)).abs() < 1e-12, "{psi}");
    }

    #[test]
    fn errors_are_those_of_one_sample_in_any_order_of_the_messages() {
        let (truths, wanted) =
            ([truth(0, 0.0, 3.0), truth(1, 0.0, 4.0)], [reference(0, 0.3, 0.0), reference(1, 0.4, 2.0)]);
        let in_turn = rms(&[truths[0], wanted[0], truths[1], wanted[1]]);
        assert_eq!(in_turn, rms(&[wanted[0], wanted[1], truths[0], truths[1]]));
        let half = |square: f64| (square / 2.0_f64).sqrt();
        for (i, expected) in [(2, half(0.25)), (4, half(4.0)), (6, half(25.0))] {
            assert!((in_turn[i] - expected).abs() < 1e-12, "{in_turn:?}");
        }
        assert_eq!(
            in_turn,
            rms(&[truths[0], wanted[0], truths[1], wanted[1], truth(2, 1.0, 1.0)]),
            "a half says nothing"
        );
    }

    #[test]
    fn without_a_sample_the_errors_are_nan() {
        assert!(rms(&[truth(0, 0.0, 0.0), reference(1, 0.0, 0.0)]).iter().all(|rms| rms.is_nan()));
    }
}
