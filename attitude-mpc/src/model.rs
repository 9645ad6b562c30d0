//! Prediction model of the next sample.
//!
//! ```text
//! x[k+1] = Ad x[k] + Bd u[k] + Ed d                                  (1)
//! y[k]   = x[k]                                                      (2)
//! ```
//!
//! `Ad` and `Bd` are the discretised linear model of [`airframe::linear`], with `x` = `(w, phi - phi_trim, theta, psi,
//! p, q, r)`.
//!
//! Departure: with the actuator lag in the model, `x` has four more states `z`: the conventional inputs that the
//! actuators produce, as deviations from trim. They are not measured: the controller simulates the actuators under the
//! command in force. Rotors and servo may have lags of their own ([`lag_rates`]). Tests
//! `a_command_moves_the_lag_states`, `each_actuator_has_its_own_lag`.
//!
//! Departure: `d` is a constant disturbance on the inputs. It acts behind the lag, as wind does: `Ed` is `Bd` of the
//! lag-free model, with zeros on the lag states. Test `the_disturbance_acts_behind_the_lag`.

use airframe::linear::{Continuous, INPUTS, LAGGED, STATES, lag_rates};
use airframe::{ActuatorLaw, MixingMatrix, Trim};
use contract::actuation::Actuation;
use contract::message::Kinematics;
use nalgebra::{DMatrix, DVector, Dyn, SMatrix, SVector, Storage, Vector, Vector4};
use settings::Scenario;

/// Bound on the first term that the series of [`PredictionModel::advance`] omits, as a share of the first term:
/// `2^-55`.
const LEAST_TERM: f64 = 1.0 / (1_u64 << 55) as f64;

/// Linear model with 7 states, or 11 with the actuator lag.
#[derive(Debug, Clone)]
pub struct PredictionModel {
    /// Matrix `Ad`, n x n.
    pub a: DMatrix<f64>,
    /// Matrix `Bd`, n x 4.
    pub b: DMatrix<f64>,
    /// Matrix `Ed` of a constant disturbance on the inputs, n x 4.
    pub e: DMatrix<f64>,
    /// Hover from which states and inputs are deviations.
    pub trim: Trim,
    /// Continuous-time `A`, `B` and `E`, with zeros in place of lag states that the model does not have.
    continuous: (SMatrix<f64, LAGGED, LAGGED>, [SMatrix<f64, LAGGED, INPUTS>; 2]),
    /// Map from actuator positions to conventional inputs.
    pub mixing: MixingMatrix,
    /// Model of rotors and servo.
    actuators: ActuatorLaw,
    /// Norm of the continuous-time `A`: the largest column sum, with the lag states as accelerations \[1/s\].
    norm: f64,
    /// Sample time \[s\].
    sample_s: f64,
}

impl PredictionModel {
    /// Builds the controller's model of a scenario's vehicle.
    pub fn new(scenario: &Scenario) -> Self {
        let trim = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction);
        Self::of(scenario, &trim, &Continuous::hover(&scenario.airframe, &trim))
    }

    /// Builds the model of the linearised motion `continuous`, in deviations from the hover `trim`.
    pub fn of(scenario: &Scenario, trim: &Trim, continuous: &Continuous) -> Self {
        let vehicle = &scenario.airframe;
        let lag_s = scenario.attitude.actuator_lag_model_s;
        let servo_lag_s = scenario.attitude.servo_lag_model_s.unwrap_or(lag_s);
        let sample_s = scenario.sample_s();
        let mixing = MixingMatrix::new(vehicle, scenario.mixer.tilt_reaction);
        let lag = (lag_s > 0.0).then(|| lag_rates([lag_s, servo_lag_s], &mixing, &trim.actuation));
        let direct = continuous.discretise(sample_s);
        let discrete = lag.map_or_else(|| direct.clone(), |rates| continuous.discretise_with_lag(&rates, sample_s));
        let n = discrete.a.nrows();
        let behind = continuous.b.fixed_resize(0.0);
        let (a, b) = match &lag {
            Some(rates) => continuous.with_lag(rates),
            None => (continuous.a.fixed_resize(0.0), behind),
        };
        let mut unit = SVector::<f64, LAGGED>::repeat(1.0);
        unit.fixed_rows_mut::<INPUTS>(STATES).copy_from(&vehicle.inertia());
        let scaled = SMatrix::<f64, LAGGED, LAGGED>::from_fn(|i, j| (a[(i, j)] * unit[j] / unit[i]).abs());
        let norm = scaled.row_sum().max();
        Self {
            a: discrete.a,
            b: discrete.b,
            e: direct.b.resize_vertically(n, 0.0),
            continuous: (a, [b, behind]),
            trim: *trim,
            mixing,
            actuators: ActuatorLaw { rotor_lag_s: lag_s, servo_lag_s, ..scenario.actuator_law() },
            norm,
            sample_s,
        }
    }

    /// Number of states n, 7 or 11.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    /// Returns whether the model has the lag states.
    pub fn has_lag(&self) -> bool {
        self.states() > STATES
    }

    /// Writes the state `x` of a measurement and the modelled positions of the actuators.
    pub fn observe(&self, measured: &Kinematics, actuation: &Actuation, x: &mut DVector<f64>) {
        let w = measured.velocity_mps[2];
        x.rows_mut(0, STATES).copy_from_slice(&self.deviation(w, &measured.attitude_rad, &measured.rates_radps));
        if self.has_lag() {
            x.rows_mut(STATES, INPUTS).copy_from(&self.mixing.deviation(actuation));
        }
    }

    /// Deviation `(w, phi - phi_trim, theta, psi, p, q, r)` of a measurement or a reference from trim.
    pub fn deviation(&self, w_mps: f64, attitude_rad: &[f64; 3], rates_radps: &[f64; 3]) -> [f64; STATES] {
        let [phi, theta, psi] = *attitude_rad;
        let [p, q, r] = *rates_radps;
        [w_mps, phi - self.trim.roll_rad, theta, psi, p, q, r] // (2)
    }

    /// Predicts the state `next`, one sample after `x`, under the inputs `u` and the disturbance `d`.
    pub fn predict<S: Storage<f64, Dyn>>(
        &self,
        x: &Vector<f64, Dyn, S>,
        u: &Vector4<f64>,
        d: &Vector4<f64>,
        next: &mut DVector<f64>,
    ) {
        next.gemv(1.0, &self.a, x, 0.0);
        next.gemv(1.0, &self.b, u, 1.0);
        next.gemv(1.0, &self.e, d, 1.0); // (1)
    }

    /// Moves the state `x` on by `time_s` under constant inputs `u` and a constant disturbance `d`:
    ///
    /// ```text
    /// x(t) = x + t v + t^2/2 A v + t^3/6 A^2 v + ...,      v = A x + B u + E d
    /// ```
    ///
    /// A long time is divided into steps in which the norm of `A t` is at most 1/2. The series ends where its terms are
    /// too small to count.
    pub fn advance(&self, x: &mut DVector<f64>, u: &Vector4<f64>, d: &Vector4<f64>, time_s: f64) {
        if time_s == 0.0 {
            return;
        }
        let (a, [b, e]) = &self.continuous;
        let n = self.states();
        let mut at = SVector::<f64, LAGGED>::zeros();
        at.rows_mut(0, n).copy_from(x);
        let push = b * u + e * d;
        let steps = libm::ceil(2.0 * self.norm * time_s).max(1.0);
        let step_s = time_s / steps;
        let reach = self.norm * step_s;
        for _ in 0..steps as usize {
            let mut term = (a * at + push) * step_s;
            let mut bound = 1.0; // on the ratio of `term` to the first term
            for power in 2_u32.. {
                at += term;
                bound *= reach / f64::from(power);
                if bound < LEAST_TERM {
                    break;
                }
                term = a * term * (step_s / f64::from(power));
            }
        }
        x.copy_from(&at.rows(0, n));
    }

    /// Positions of the actuators after following `command` for a number of samples.
    pub fn actuate(&self, actuation: &Actuation, command: &Actuation, samples: u64) -> Actuation {
        self.actuate_for(actuation, command, samples as f64 * self.sample_s)
    }

    /// Positions of the actuators after following `command` for `time_s`.
    pub fn actuate_for(&self, actuation: &Actuation, command: &Actuation, time_s: f64) -> Actuation {
        if time_s == 0.0 {
            return *actuation;
        }
        self.actuators.advance(actuation, command, time_s)
    }

    /// Inputs that a command produces in steady state, within the actuators' limits.
    pub fn inputs_of(&self, command: &Actuation) -> Vector4<f64> {
        self.mixing.deviation(&self.actuators.limits.clip(command))
    }
}

#[cfg(test)]
mod tests {
    use settings::Profile;

    use super::*;
    use crate::fixture;

    #[test]
    fn val_discretised_model() {
        let paper = PredictionModel::new(&Scenario::from(Profile::Paper));
        fixture::assert_matrix(&paper.a, &fixture::matrix("Ad"));
        fixture::assert_matrix(&paper.b, &fixture::matrix("Bd"));
        let with_lag = PredictionModel::new(&fixture::with_lag());
        fixture::assert_matrix(&with_lag.a, &fixture::matrix("Ad_lag30"));
        fixture::assert_matrix(&with_lag.b, &fixture::matrix("Bd_lag30"));
    }

    #[test]
    fn trim_is_the_origin() {
        let model = PredictionModel::new(&Scenario::default());
        let attitude_rad = [model.trim.roll_rad, 0.0, 0.0];
        let mut x = DVector::from_element(11, 1.0);
        model.observe(&Kinematics { attitude_rad, ..Kinematics::default() }, &model.trim.actuation, &mut x);
        assert!(x.amax() < 1e-12, "{x}");
        let (origin, mut next) = (DVector::zeros(11), DVector::from_element(11, f64::NAN));
        model.predict(&origin, &Vector4::zeros(), &Vector4::zeros(), &mut next);
        assert_eq!(next, origin);
    }

    #[test]
    fn a_command_moves_the_lag_states() {
        let scenario = Scenario::default();
        let model = PredictionModel::new(&scenario);
        let mut command = model.trim.actuation;
        command.rotor_speed = command.rotor_speed.map(|omega| 1.01 * omega); // more thrust: a more negative col
        let once = model.actuate(&model.trim.actuation, &command, 1);
        let mut x = DVector::zeros(11);
        model.observe(&Kinematics::default(), &once, &mut x);
        let goal = model.inputs_of(&command)[0];
        assert!(goal < x[STATES] && x[STATES] < 0.0, "{} between {goal} and 0", x[STATES]);
        // The lag of the inputs agrees with the lag of the rotor speeds to first order in the step.
        let share = 1.0 - (-0.01_f64 / scenario.attitude.actuator_lag_model_s).exp();
        assert!((x[STATES] / goal - share).abs() < 0.01);
        assert_eq!(model.actuate(&once, &command, 0), once);
    }

    #[test]
    fn each_actuator_has_its_own_lag() {
        let mut scenario = Scenario::default();
        scenario.attitude.servo_lag_model_s = Some(0.3);
        let model = PredictionModel::new(&scenario);
        let at = model.trim.actuation;
        let rotor = |i: usize| {
            let mut command = at;
            command.rotor_speed[i] *= 1.0 + 1e-6;
            command
        };
        let tilted = Actuation { tilt_rad: at.tilt_rad + 1e-6, ..at };
        for command in [rotor(0), rotor(1), rotor(2), tilted] {
            let (origin, mut next) = (DVector::zeros(11), DVector::zeros(11));
            model.predict(&origin, &model.inputs_of(&command), &Vector4::zeros(), &mut next);
            let moved = model.mixing.deviation(&model.actuate(&at, &command, 1));
            assert!((next.rows(STATES, INPUTS) - moved).amax() < 1e-4 * moved.amax(), "{next} is not {moved}");
        }
    }

    #[test]
    fn the_disturbance_acts_behind_the_lag() {
        let model = PredictionModel::new(&Scenario::default());
        let (origin, mut next) = (DVector::zeros(11), DVector::zeros(11));
        let push = Vector4::new(1.1, 0.0, 0.0, 0.0); // 1.1 N on 1.1 kg for 10 ms
        model.predict(&origin, &Vector4::zeros(), &push, &mut next);
        assert!((next[0] - 0.01).abs() < 1e-12);
        assert!(next.rows(STATES, INPUTS).iter().all(|z| *z == 0.0));
    }

    #[test]
    fn a_part_of_a_sample_and_the_rest_are_the_sample() {
        for (profile, lag_s, rate_hz) in
            [(Profile::Paper, 0.0, 100), (Profile::Robust, 0.03, 100), (Profile::Robust, 0.001, 50)]
        {
            let mut scenario = Scenario::from(profile);
            (scenario.attitude.actuator_lag_model_s, scenario.run.rate_hz) = (lag_s, rate_hz);
            let model = PredictionModel::new(&scenario);
            let n = model.states();
            let start = DVector::from_fn(n, |row, _| 0.1 * (row as f64 - 3.0));
            let (u, d) = (Vector4::new(-1.0, 0.1, 0.2, -0.05), Vector4::new(0.5, 0.02, -0.03, 0.01));
            let mut expected = start.clone();
            model.predict(&start, &u, &d, &mut expected);
            let sample_s = scenario.sample_s();
            for part in [0.0, 0.3, 1.0] {
                let mut x = start.clone();
                model.advance(&mut x, &u, &d, part * sample_s);
                model.advance(&mut x, &u, &d, (1.0 - part) * sample_s);
                assert!((&x - &expected).amax() < 1e-12 * expected.amax(), "{part} of {sample_s}: {x}, not {expected}");
            }
        }
    }

    #[test]
    fn no_time_changes_no_bit() {
        for profile in [Profile::Paper, Profile::Robust] {
            let model = PredictionModel::new(&Scenario::from(profile));
            let start = DVector::from_fn(model.states(), |row, _| if row == 0 { -0.0 } else { (row as f64).sin() });
            let mut x = start.clone();
            let (u, d) = (Vector4::new(-1.0, 0.1, 0.2, -0.05), Vector4::new(0.5, 0.02, -0.03, 0.01));
            model.advance(&mut x, &u, &d, 0.0);
            let bits = |x: &DVector<f64>| x.map(f64::to_bits);
            assert_eq!(bits(&x), bits(&start), "{profile:?}");
        }
    }
}
