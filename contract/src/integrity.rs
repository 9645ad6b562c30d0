//! What can be said of a message by itself: whether its numbers can be true, and whether its bits are those sent.

use bytemuck::Pod;

use crate::message::{Actuators, Controls, Kinematics, Reference, State};

/// Farther than anything flies here \[m\], \[m/s\].
const FAR: f64 = 1e4;
/// Euler angles and heading references are kept within a few turns \[rad\].
const TURNED: f64 = 100.0;
/// Faster than any body turns here \[rad/s\]: ten times the rate at which a flight counts as lost.
const FAST: f64 = 1e3;
/// Stronger than any actuator \[N, N m, rotor speed units\].
const STRONG: f64 = 1e6;

/// A message whose numbers can be judged without any other.
pub trait Plausible {
    /// Whether they can be true.
    fn plausible(&self) -> bool;
}

impl Plausible for State {
    /// Attitude and rates must be there, without them nobody can fly. A position or velocity that is not a number is a
    /// sensor that is off; who needs it sees that for itself.
    fn plausible(&self) -> bool {
        let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = &self.measured;
        let off = |value: &f64| value.is_nan() || within(&[*value], FAR);
        position_m.iter().chain(velocity_mps).all(off)
            && within(attitude_rad, TURNED)
            && within(rates_radps, FAST)
            && within(&self.command_in_force.rotor_speed, STRONG)
            && within(&[self.command_in_force.tilt_rad], TURNED)
    }
}

impl Plausible for Reference {
    fn plausible(&self) -> bool {
        within(&self.attitude_rad, TURNED) && within(&self.rates_radps, FAST) && within(&[self.w_mps], FAR)
    }
}

impl Plausible for Controls {
    fn plausible(&self) -> bool {
        within(&self.demand, STRONG)
    }
}

impl Plausible for Actuators {
    fn plausible(&self) -> bool {
        within(&self.command.rotor_speed, STRONG) && within(&[self.command.tilt_rad], TURNED)
    }
}

/// Whether all are finite and no larger than `bound` either way.
fn within(values: &[f64], bound: f64) -> bool {
    values.iter().all(|value| value.abs() <= bound) // false for NaN
}

/// A checksum over the words of `message`: two that differ in one word, or in two bits, never agree, and others hardly ever.
///
/// Each step is invertible in the word and in what came before, so a single wrong word always shows. The shift between
/// two multiplications spreads the upper bits too, which a multiplication alone would leave where one bit of the next
/// word takes them back. It guards against accidents, not against an enemy.
pub fn checksum<M: Pod>(message: &M) -> u64 {
    const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
    let words: &[u64] = bytemuck::cast_slice(bytemuck::bytes_of(message));
    words.iter().fold(ODD, |hash, word| {
        let mixed = (hash ^ word).wrapping_mul(ODD);
        (mixed ^ mixed >> 32).wrapping_mul(ODD)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_flipped_bits_go_unnoticed() {
        let good = [0.1_f64.to_bits(); 6];
        let flipped = |words: &[u64; 6], bit: usize| {
            let mut words = *words;
            words[bit / 64] ^= 1 << (bit % 64);
            words
        };
        for first in 0..6 * 64 {
            let one = flipped(&good, first);
            assert_ne!(checksum(&one), checksum(&good), "{first}");
            for second in 0..first {
                assert_ne!(checksum(&flipped(&one, second)), checksum(&good), "{second} and {first}");
            }
        }
    }
}
