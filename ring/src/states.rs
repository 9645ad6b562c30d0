//! Measures of the samples of a flight: the hash over all of them, and the position error of one.

use std::fmt::Write;

use contract::message::{Sample, Truth};
use sha2::{Digest, Sha256};

/// SHA-256 over the payload bits of all samples, in order: two flights with the same hash are the same flight.
#[derive(Clone, Default)]
pub struct StateHash(Sha256);

impl StateHash {
    /// Adds the next sample to the hash.
    pub fn observe(&mut self, sample: &Sample) {
        sample.payload(|bytes| self.0.update(bytes));
    }

    /// Returns the hash of the samples so far, in hexadecimal digits.
    pub fn text(&self) -> String {
        hex(&self.0.clone().finalize())
    }
}

/// Formats bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut digits, byte| {
        let _ = write!(digits, "{byte:02x}"); // writing to a String cannot fail
        digits
    })
}

/// Position of the mission minus the true position, NED \[m\].
pub fn position_error_m(wanted_m: [f64; 3], truth: &Truth) -> [f64; 3] {
    std::array::from_fn(|axis| wanted_m[axis] - truth.actual.position_m[axis])
}

pub fn length_m(vector_m: [f64; 3]) -> f64 {
    vector_m.iter().map(|x| x * x).sum::<f64>().sqrt()
}
