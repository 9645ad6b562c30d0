//! All laws, by their names in a scenario: `attitude.law`.

use settings::{Law, Scenario, ScenarioError};

use super::attitude_law::AttitudeLaw;
use super::geometric::Geometric;
use super::indi::Indi;
use super::level::RigidBody;
use super::lqr::Lqr;
use super::mpc::controller::Mpc;
use super::pid::Pid;
use crate::model::PredictionModel;

/// Builds the law of `scenario` for the controller's `model` of the vehicle.
///
/// # Errors
/// Settings for which the problem of the law is singular or infeasible.
pub fn build(scenario: &Scenario, model: &PredictionModel) -> Result<Box<dyn AttitudeLaw>, ScenarioError> {
    let (settings, sample_s) = (&scenario.attitude, scenario.sample_s());
    let level = || RigidBody::new(&scenario.airframe, &model.trim, &model.mixing);
    Ok(match settings.law {
        Law::Mpc => Box::new(Mpc::new(scenario, model)?),
        Law::Lqr => Box::new(Lqr::new(scenario, model)?),
        Law::Pid => Box::new(Pid::new(&scenario.airframe, &settings.pid, sample_s)),
        Law::Geometric => Box::new(Geometric::new(level(), &settings.geometric, sample_s)),
        Law::Indi => Box::new(Indi::new(level(), &settings.indi, sample_s)),
    })
}
