//! Trajectory: position, velocity, acceleration and heading over time, from the [`MissionPlan`], which the check before
//! the flight builds too.

pub use curves::Setpoint;

use curves::MissionPlan;
use settings::{Scenario, plan};

/// Height above a standing vehicle from which on a reference asks for a take-off \[m\]. There a smooth mission already
/// climbs at some speed, so the vehicle that follows does not have to wait near the ground.
const HIGH_M: f64 = 0.1;
/// Depth below a standing vehicle from which on a reference at rest asks for a landing, and not for standing \[m\].
const LOW_M: f64 = 0.01;

/// Reference of a mission over time.
#[derive(Debug, Clone)]
pub struct Trajectory {
    plan: MissionPlan,
    /// Down position of a vehicle that stands \[m\]; infinite without a ground.
    standing_down_m: f64,
}

impl Trajectory {
    /// Builds the trajectory of the mission of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let ground = &scenario.plant.ground;
        let standing_down_m = if ground.present { ground.standing_down_m() } else { f64::INFINITY };
        Self { plan: plan::build(scenario), standing_down_m }
    }

    /// Reference at `t_s` of a vehicle whose measured down position is `down_m`. It is [`Self::at`], except if this
    /// reference rests below the ground, as after a landing, and `down_m` is below the ground too. The measured height
    /// is then wrong, and the reference is lowered by this error. So a vehicle that would hover above the ground sinks
    /// until it stands, and a standing vehicle whose height drifts is not asked to climb.
    pub fn for_vehicle_at(&self, down_m: f64, t_s: f64) -> Setpoint {
        let mut setpoint = self.at(t_s);
        let [_, _, rests_down_m] = setpoint.position_m;
        if setpoint.velocity_mps == [0.0; 3] && rests_down_m > self.standing_down_m + LOW_M {
            setpoint.position_m[2] += (down_m - self.standing_down_m).max(0.0);
        }
        setpoint
    }

    /// Returns whether the reference at `t_s` is above the ground.
    pub fn is_above_ground(&self, t_s: f64) -> bool {
        self.at(t_s).position_m[2] < self.standing_down_m - HIGH_M
    }

    /// Reference at `t_s`; at rest before and after the mission.
    pub fn at(&self, t_s: f64) -> Setpoint {
        self.plan.at(t_s)
    }

    /// Heading reference at `t_s`, in (-pi, pi] \[rad\].
    pub fn heading_at(&self, t_s: f64) -> f64 {
        self.plan.heading_at(t_s)
    }
}
