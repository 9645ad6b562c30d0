//! `[plant]`: the true vehicle, and the disturbances that act on it.

use airframe::Drag;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::table::sensors::SensorsSettings;

/// Settings of the simulated vehicle, `[plant]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlantSettings {
    /// Longest RK4 step \[s\]; a sample is divided into equal steps.
    pub substep_s: f64,
    /// Rotor time constant \[s\].
    pub rotor_lag_s: f64,
    /// Servo time constant \[s\].
    pub servo_lag_s: f64,
    /// Largest change of a rotor's speed \[rotor speed unit / s\].
    pub rotor_rate_limit: f64,
    /// Largest rate of the tilt servo \[rad/s\].
    pub servo_rate_limit_radps: f64,
    /// Lowest speed of a rotor \[rotor speed unit\]; below the slowest rotor at trim.
    pub rotor_speed_min: f64,
    /// Ratio of highest rotor speed to trim speed.
    pub rotor_speed_max_ratio: f64,
    /// Largest tilt of rotor 1, to either side \[deg\]; above the tilt at trim.
    pub tilt_max_deg: f64,
    /// Linear drag along the body axes x, y, z, on the velocity relative to the air \[N s/m\].
    pub drag_linear_nspm: [f64; 3],
    /// Quadratic drag, against the velocity relative to the air \[N s2/m2\].
    pub drag_quadratic_ns2pm2: f64,
    /// `true` if the torque of the tilted rotor has a pitching moment.
    pub tilt_reaction: bool,
    /// Factor on thrust and torque of the rotors 1, 2, 3; 1 = as modelled.
    pub rotor_effectiveness: [f64; 3],
    /// Wind steps `[[t_s, [north, east, down]], ...]`: start time \[s\], NED velocity of the air from then on \[m/s\].
    pub wind_ned_mps: Vec<(f64, [f64; 3])>,
    /// Disturbance steps `[[t_s, [north, east, down], [x, y, z]], ...]`: start time \[s\], NED force \[N\] and body
    /// moment \[N m\] from then on.
    pub disturbance: Vec<(f64, [f64; 3], [f64; 3])>,
    /// Standard deviations of the measurement noise.
    pub noise: Noise,
    /// Further errors of the sensors, and the filter behind them.
    pub sensors: SensorsSettings,
    /// Differences between the flown vehicle and the vehicle that the controllers know: any key of `[airframe]` but
    /// `g_mps2` and `preset`, and the keys below. Absent = as in `[airframe]`.
    pub airframe: FlownAirframe,
    /// Rotor effects that the paper neglects.
    pub rotor: Rotor,
    /// Battery; without effect by default.
    pub battery: BatterySettings,
    /// Ground; absent by default.
    pub ground: GroundSettings,
    /// Roughness of the ground \[m\]. The horizontal part of the wind steps is then the wind 6.096 m (20 ft) above the
    /// ground, with less wind below and more above; 0 = the same wind at every height.
    pub wind_roughness_m: f64,
    /// Continuous gusts.
    pub turbulence: TurbulenceSettings,
}

/// Gusts, `[plant.turbulence]`: Dryden form, MIL-F-8785C, low altitude, at fixed or present wind, height and airspeed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TurbulenceSettings {
    /// `true` if the gusts follow from `plant.wind_ned_mps` and the present height and airspeed, in place of the four
    /// settings below.
    pub from_wind: bool,
    /// Mean wind at 6.096 m (20 ft), which sets the strength of the gusts \[m/s\]; 0 = no gusts. It does not blow
    /// itself: the mean wind that blows is `plant.wind_ned_mps`.
    pub wind_at_6m_mps: f64,
    /// Height above the ground for which the gusts are computed \[m\].
    pub height_m: f64,
    /// Airspeed for which the gusts are computed \[m/s\].
    pub airspeed_mps: f64,
    /// Direction that the mean wind blows to, from north over east \[deg\].
    pub direction_deg: f64,
}

impl Default for TurbulenceSettings {
    fn default() -> Self {
        Self { from_wind: false, wind_at_6m_mps: 0.0, height_m: 8.0, airspeed_mps: 5.0, direction_deg: 0.0 }
    }
}

impl TurbulenceSettings {
    /// Returns whether there are gusts.
    pub fn is_on(&self) -> bool {
        self.from_wind || self.wind_at_6m_mps > 0.0
    }
}

impl PlantSettings {
    /// Returns the down coordinate of height zero \[m\]: that of the ground, or 0 without a ground.
    pub fn height_zero_m(&self) -> f64 {
        if self.ground.present { self.ground.down_m } else { 0.0 }
    }

    /// Returns linear and quadratic drag together.
    pub fn drag(&self) -> Drag {
        Drag { linear_nspm: self.drag_linear_nspm, quadratic_ns2pm2: self.drag_quadratic_ns2pm2 }
    }

    /// Returns whether the velocity of the air has an effect on the vehicle.
    pub fn feels_air(&self) -> bool {
        let has_drag = self.drag_quadratic_ns2pm2 > 0.0 || self.drag_linear_nspm != [0.0; 3];
        has_drag || self.rotor.inflow_ns2pm > 0.0 || self.rotor.h_force_ns2pm > 0.0
    }
}

/// Vehicle that flies, `[plant.airframe]`. Absent values are those of `[airframe]`, which the controllers model.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FlownAirframe {
    /// Mass \[kg\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Moment of inertia about the body x axis \[kg m2\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ixx_kgm2: Option<f64>,
    /// Moment of inertia about the body y axis \[kg m2\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iyy_kgm2: Option<f64>,
    /// Moment of inertia about the body z axis \[kg m2\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub izz_kgm2: Option<f64>,
    /// Element xy of the inertia tensor, minus the integral of x y dm \[kg m2\].
    pub ixy_kgm2: f64,
    /// Element xz of the inertia tensor, minus the integral of x z dm \[kg m2\].
    pub ixz_kgm2: f64,
    /// Element yz of the inertia tensor, minus the integral of y z dm \[kg m2\].
    pub iyz_kgm2: f64,
    /// Centre of mass relative to the point where the arms begin, body \[m\].
    pub centre_of_mass_m: [f64; 3],
    /// Arm of rotor 1 \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub l1_m: Option<f64>,
    /// Arm from the centre back to the line of rotors 2 and 3 \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub l2_m: Option<f64>,
    /// Arm sideways to rotors 2 and 3 \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub l3_m: Option<f64>,
    /// Thrust constant \[N / rotor speed unit squared\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kf: Option<f64>,
    /// Torque constant \[N m / rotor speed unit squared\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub km: Option<f64>,
}

/// Battery, `[plant.battery]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BatterySettings {
    /// Energy at the shafts from full to empty \[W h\]; 0 = no effect of the battery on the rotors.
    pub energy_wh: f64,
    /// Share of the voltage lost from full to empty.
    pub droop: f64,
    /// Share of the voltage lost at the load of a hover.
    pub sag: f64,
}

impl Default for BatterySettings {
    /// Returns a lithium polymer battery, switched off: 4.2 V to 3.5 V per cell, and 5 % lost at hover.
    fn default() -> Self {
        Self { energy_wh: 0.0, droop: 0.17, sag: 0.05 }
    }
}

/// Ground as a level plane, `[plant.ground]`. With the defaults a vehicle at the origin stands on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GroundSettings {
    /// `true` if there is a ground; without it the vehicle can fly at any altitude.
    pub present: bool,
    /// Down coordinate of the plane, NED \[m\].
    pub down_m: f64,
    /// Height of the rotors above the feet \[m\].
    pub leg_m: f64,
    /// Coefficient of friction between feet and ground.
    pub friction: f64,
    /// Largest vertical speed of a touchdown \[m/s\]; a faster one is a crash.
    pub max_sink_mps: f64,
}

impl GroundSettings {
    /// Down coordinate of a vehicle that stands on the ground \[m\].
    pub fn standing_down_m(&self) -> f64 {
        self.down_m - self.leg_m
    }
}

impl Default for GroundSettings {
    fn default() -> Self {
        Self { present: false, down_m: 0.15, leg_m: 0.15, friction: 0.6, max_sink_mps: 1.5 }
    }
}

/// Rotor effects that the paper neglects, `[plant.rotor]`; 0 = neglected here too.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Rotor {
    /// Moment of inertia of one rotor about its axis \[kg m2\], with the rotor speed unit taken as rad/s.
    pub inertia_kgm2: f64,
    /// Thrust loss per m/s of climb along the axis and per rotor speed unit \[N s2/m\].
    pub inflow_ns2pm: f64,
    /// H-force per m/s across the axis and per rotor speed unit \[N s2/m\].
    pub h_force_ns2pm: f64,
}

/// Standard deviations of the measurement noise, `plant.noise`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// Noise of each NED position \[m\].
    pub position_m: f64,
    /// Noise of each body velocity \[m/s\].
    pub velocity_mps: f64,
    /// Noise of each Euler angle \[deg\].
    pub attitude_deg: f64,
    /// Noise of each body rate \[deg/s\].
    pub rates_dps: f64,
}
