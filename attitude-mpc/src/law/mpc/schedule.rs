//! Gain-scheduled MPC: one MPC for each flight condition, blended by the measured velocity: `attitude.mpc.model =
//! "scheduled"`.
//!
//! The conditions are trimmed level flights ([`LevelFlight`]) on a grid of velocities ahead and to the right, because
//! this vehicle flies in any direction without turning its nose. Each condition has its own model, terminal weight and
//! gain, all computed at construction. The plan is the mean of the plans of the four conditions around the measured
//! velocity, with the weights of bilinear interpolation. These weights are continuous in the velocity, so that a plan
//! does not jump between cells of the grid. Test `a_plan_has_no_bump_at_a_condition`.
//!
//! The schedule uses the drag of `[plant]`, because drag determines the attitude at each speed.

use airframe::linear::{INPUTS, STATES};
use airframe::{FlightPoint, LevelFlight};
use contract::message::Kinematics;
use nalgebra::{DVector, DVectorView, Rotation3, Vector3, Vector4};
use settings::{Scenario, ScenarioError};

use crate::law::mpc::at_speed::FlightModel;
use crate::law::mpc::condensed::{Condensed, Gain};

/// Number of grid velocities ahead, and to the right: from -15 to 15 m/s.
const PER_AXIS: usize = 7;
/// Spacing of the grid \[m/s\].
const SPACING_MPS: f64 = 5.0;

/// All conditions, and their present weights.
pub struct GainSchedule {
    /// Conditions row by row: conditions with the same velocity ahead are adjacent.
    conditions: Vec<Condition>,
    /// Indices of the four conditions around the measured velocity, with their weights, which add up to 1.
    around: [(usize, f64); 4],
    /// Given numbers `(x; r; d; v)`, converted to one condition.
    given: DVector<f64>,
    /// Changes of the reference, converted to one condition.
    changes: DVector<f64>,
}

/// Flight condition.
struct Condition {
    model: FlightModel,
    gain: Gain,
}

impl GainSchedule {
    /// Builds every condition of a scenario; an error if a condition has no level flight or a singular problem.
    pub fn new(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let velocity = |i: usize| SPACING_MPS * (i as f64 - (PER_AXIS / 2) as f64);
        let conditions = (0..PER_AXIS * PER_AXIS)
            .map(|i| Condition::new(scenario, [velocity(i / PER_AXIS), velocity(i % PER_AXIS)]))
            .collect::<Result<Vec<_>, _>>()?;
        let [given, changes] =
            [&conditions[0].gain.given, &conditions[0].gain.changes].map(|gain| DVector::zeros(gain.ncols()));
        let mut schedule = Self { conditions, around: [(0, 0.0); 4], given, changes };
        schedule.look_up([0.0; 2]);
        Ok(schedule)
    }

    /// Updates the weights for the measured velocity.
    pub fn observe(&mut self, measured: &Kinematics) {
        let [phi, theta, _] = measured.attitude_rad;
        let way = Rotation3::from_euler_angles(phi, theta, 0.0) * Vector3::from(measured.velocity_mps);
        self.look_up([way.x, way.y]);
    }

    fn look_up(&mut self, velocity_mps: [f64; 2]) {
        let last = (PER_AXIS - 1) as f64;
        let [(row, down), (column, right)] = velocity_mps.map(|v| {
            let place = (v / SPACING_MPS + last / 2.0).clamp(0.0, last);
            let cell = place.floor().min(last - 1.0);
            (cell as usize, place - cell)
        });
        let first = row * PER_AXIS + column;
        self.around = [
            (first, (1.0 - down) * (1.0 - right)),
            (first + 1, (1.0 - down) * right),
            (first + PER_AXIS, down * (1.0 - right)),
            (first + PER_AXIS + 1, down * right),
        ];
    }

    /// Predicts the state `next`, one sample after `x`, as the weighted mean of the conditions.
    pub fn predict(&self, x: &DVectorView<f64>, u: &Vector4<f64>, d: &Vector4<f64>, next: &mut DVector<f64>) {
        next.fill(0.0);
        for &(i, share) in &self.around {
            self.conditions[i].model.add_prediction(share, x, u, d, next);
        }
    }

    /// Writes the unconstrained `plan` for `given` = (x; r; d; v) and the `changes` of r; r was made at the measured
    /// `attitude_rad`.
    pub fn plan(
        &mut self,
        given: &DVector<f64>,
        changes: &DVector<f64>,
        attitude_rad: &[f64; 2],
        plan: &mut DVector<f64>,
    ) {
        let n = given.len() - STATES - 2 * INPUTS;
        plan.fill(0.0);
        for &(i, share) in &self.around {
            let Condition { model, gain } = &self.conditions[i];
            self.given.copy_from(given);
            model.put_into(&mut self.given, n, attitude_rad);
            self.changes.copy_from(changes);
            model.lean_on_changes(&mut self.changes);
            gain.add_plan(share, &self.given, &self.changes, plan.as_view_mut());
        }
    }
}

impl Condition {
    fn new(scenario: &Scenario, way_mps: [f64; 2]) -> Result<Self, ScenarioError> {
        let drag = scenario.plant.drag();
        let level = LevelFlight::solve(&scenario.airframe, scenario.mixer.tilt_reaction, &drag, way_mps);
        let level = level.ok_or_else(|| {
            let [ahead, right] = way_mps;
            ScenarioError::of(
                format!(
                    "`attitude.mpc.model` = \"scheduled\", and no level flight exists at {ahead} m/s ahead and {right} m/s to the \
                     right"
                ),
                "less drag in `[plant]`, or `attitude.mpc.model` = \"hover\"".into(),
            )
        })?;
        let model = FlightModel::new(scenario, &FlightPoint::from(&level));
        let gain = Condensed::at_speed(&model, scenario)?.gain;
        Ok(Self { model, gain })
    }
}
