//! Estimate of a constant disturbance on the inputs, from the prediction error of the model.
//!
//! ```text
//! d <- d + K S (x - x_predicted) / Ts,   S = (m, Iyy, Ixx, Izz) from (w, q, p, r) to (col, lon, lat, ped)
//! K <- (K + q) / (K + q + 1),            q = L^2 / (1 - L)
//! ```
//!
//! `S / Ts` converts the velocity error of one sample to the force or moment that causes it, so `K` is the share of the
//! error that each sample adds to the estimate. `K` is the gain of a Kalman filter whose disturbance is a random walk.
//! At first little is known of `d`; then `K` falls from [`FIRST_GAIN`] to `L`, `attitude.disturbance_gain`, and stays
//! there. So a wrong mass is found in tenths of a second, and afterwards the estimate is too slow to cost delay margin
//! (docs/mpc.md). Because `d` is in the prediction and cancelled in the inputs' target
//! ([`condensed`](crate::law::mpc::condensed)), a constant disturbance leaves no offset: Pannocchia and Rawlings,
//! *Disturbance models for offset-free model-predictive control*, AICHE Journal 49 (2003).

use airframe::Parameters;
use nalgebra::{DVector, Vector4};

/// Indices of the states that the inputs col, lon, lat, ped drive: w, q, p, r.
pub const DRIVEN: [usize; 4] = [0, 5, 4, 6];

/// Gain of the first update, unless `L` is larger.
pub const FIRST_GAIN: f64 = 0.2;

/// Update law of the estimate. The controller stores the estimate and its gain.
#[derive(Debug, Clone)]
pub struct DisturbanceLaw {
    /// Inertia over sample time, `S / Ts` \[N per m/s, N m per rad/s\].
    scale: Vector4<f64>,
    /// Gain `L` to which `K` falls.
    last: f64,
    /// Variance `q` that the disturbance gains per sample, as a share of the variance of the prediction error.
    walk: f64,
}

impl DisturbanceLaw {
    /// Builds the law with the last gain `L` at a sample time \[s\]; `None` for the gain 0, which never changes the
    /// estimate.
    pub fn new(vehicle: &Parameters, last: f64, sample_s: f64) -> Option<Self> {
        let walk = last * last / (1.0 - last);
        (last > 0.0).then(|| Self { scale: vehicle.inertia() / sample_s, last, walk })
    }

    /// Returns the estimate that follows `d` if `x` was measured where `predicted` was expected, and lowers the `gain`.
    pub fn update(&self, d: &Vector4<f64>, gain: &mut f64, x: &DVector<f64>, predicted: &DVector<f64>) -> Vector4<f64> {
        let miss = Vector4::from(DRIVEN.map(|i| x[i] - predicted[i]));
        let share = gain.max(self.last);
        let variance = share + self.walk;
        *gain = (variance / (variance + 1.0)).min(1.0); // 1 also for `L` = 1, whose infinite variance makes a NaN
        d + self.scale.component_mul(&miss) * share
    }
}

#[cfg(test)]
mod tests {
    use settings::{Profile, Scenario};

    use super::*;
    use crate::model::PredictionModel;

    /// Asserts that the estimate converges to the disturbance of a simulated model.
    fn converges(profile: Profile) {
        let model = PredictionModel::new(&Scenario::from(profile));
        let law = DisturbanceLaw::new(&Scenario::default().airframe, 0.2, 0.01).unwrap();
        let truth = Vector4::new(1.0, -0.1, 0.2, 0.05);
        let u = Vector4::new(-0.5, 0.03, 0.0, 0.01);
        let (mut d, mut gain) = (Vector4::zeros(), FIRST_GAIN);
        let mut x = DVector::zeros(model.states());
        let (mut next, mut predicted) = (x.clone(), x.clone());
        for _ in 0..150 {
            model.predict(&x, &u, &truth, &mut next);
            model.predict(&x, &u, &d, &mut predicted);
            d = law.update(&d, &mut gain, &next, &predicted);
            x.copy_from(&next);
        }
        assert!((d - truth).amax() < 1e-9, "{d} is not {truth}");
    }

    #[test]
    fn the_estimate_finds_a_constant_disturbance_without_bias() {
        converges(Profile::Paper);
        converges(Profile::Robust);
    }

    #[test]
    fn the_gain_falls_to_the_last_one_and_stays() {
        let law = DisturbanceLaw::new(&Scenario::default().airframe, 0.02, 0.01).unwrap();
        let (x, mut gain, mut gains) = (DVector::zeros(7), FIRST_GAIN, vec![]);
        for _ in 0..1000 {
            law.update(&Vector4::zeros(), &mut gain, &x, &x);
            gains.push(gain);
        }
        assert!(gains.is_sorted_by(|before, after| after <= before), "{gains:?}");
        assert!(gains[10] < 0.1 && gains[10] > 0.05 && (gain - 0.02).abs() < 1e-12, "{} {gain}", gains[10]);
    }

    #[test]
    fn a_last_gain_of_one_is_reached_at_once() {
        let law = DisturbanceLaw::new(&Scenario::default().airframe, 1.0, 0.01).unwrap();
        let (x, mut gain) = (DVector::zeros(7), FIRST_GAIN);
        for _ in 0..3 {
            law.update(&Vector4::zeros(), &mut gain, &x, &x);
            assert_eq!(gain, 1.0);
        }
    }

    #[test]
    fn falling_faster_than_predicted_is_a_force_down() {
        let law = DisturbanceLaw::new(&Scenario::default().airframe, 0.5, 0.01).unwrap();
        let mut x = DVector::zeros(7);
        x[0] = 0.01; // 1.1 kg gained 0.01 m/s in 10 ms: 1.1 N, of which half enters the estimate
        let d = law.update(&Vector4::zeros(), &mut 0.2, &x, &DVector::zeros(7));
        assert!((d - Vector4::new(0.55, 0.0, 0.0, 0.0)).amax() < 1e-12);
        assert!(DisturbanceLaw::new(&Scenario::default().airframe, 0.0, 0.01).is_none());
    }
}
