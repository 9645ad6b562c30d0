//! `[plant]`: the vehicle as it really is, and what acts on it.

use airframe::Drag;
use serde::{Deserialize, Serialize};

/// `[plant]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plant {
    /// Longest RK4 step \[s\]; a sample is divided into equal ones.
    pub substep_s: f64,
    /// Rotor time constant \[s\].
    pub rotor_lag_s: f64,
    /// Servo time constant \[s\].
    pub servo_lag_s: f64,
    /// \[rotor speed unit / s\]
    pub rotor_rate_limit: f64,
    /// \[rad/s\]
    pub servo_rate_limit_radps: f64,
    /// Idle speed \[rotor speed unit\].
    pub rotor_speed_min: f64,
    /// Highest speed over trim speed.
    pub rotor_speed_max_ratio: f64,
    /// \[deg\]
    pub tilt_max_deg: f64,
    /// Linear drag on the air-relative body velocity \[N s/m\].
    pub drag_linear_nspm: [f64; 3],
    /// Quadratic drag \[N s2/m2\].
    pub drag_quadratic_ns2pm2: f64,
    /// Whether the vehicle has the pitching moment of the tilted rotor's torque.
    pub tilt_reaction: bool,
    /// Factor on thrust and torque of each rotor.
    pub rotor_effectiveness: [f64; 3],
    /// Wind steps: from \[s\], NED velocity of the air \[m/s\].
    pub wind_ned_mps: Vec<(f64, [f64; 3])>,
    /// Disturbance steps: from \[s\], force NED \[N\], moment body \[N m\].
    pub disturbance: Vec<(f64, [f64; 3], [f64; 3])>,
    /// Standard deviations of the measurement noise.
    pub noise: Noise,
    /// Further errors of the sensors, and the filter behind them.
    pub sensors: Sensors,
    /// In what the vehicle that flies differs from the one that the controllers know.
    pub airframe: FlownAirframe,
    /// What the paper neglects of the rotors.
    pub rotor: Rotor,
    /// The battery, where it is to matter.
    pub battery: Battery,
    /// The ground, where there is one.
    pub ground: Ground,
    /// Roughness of the ground \[m\]: the horizontal part of the wind steps then holds 6.096 m (20 ft) above it, and is less
    /// below; 0 = at every height.
    pub wind_roughness_m: f64,
    /// Gusts without end.
    pub turbulence: Turbulence,
}

/// `[plant.turbulence]`: Dryden form, MIL-F-8785C, low altitude; for one wind, height and airspeed, or those of the moment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Turbulence {
    /// Whether the gusts follow from `plant.wind_ned_mps`, the height above the ground and the airspeed of the moment, in the
    /// place of the four settings below.
    pub from_wind: bool,
    /// Mean wind at 6.096 m (20 ft), from which the strength of the gusts follows \[m/s\]; 0 = none. The mean wind itself is
    /// `plant.wind_ned_mps`.
    pub wind_at_6m_mps: f64,
    /// Height for which the gusts are taken \[m\].
    pub height_m: f64,
    /// Airspeed at which the vehicle meets them \[m/s\].
    pub airspeed_mps: f64,
    /// Where the mean wind blows to, from north over east \[deg\].
    pub direction_deg: f64,
}

impl Default for Turbulence {
    fn default() -> Self {
        Self { from_wind: false, wind_at_6m_mps: 0.0, height_m: 8.0, airspeed_mps: 5.0, direction_deg: 0.0 }
    }
}

impl Turbulence {
    /// Whether there are gusts.
    pub fn is_on(&self) -> bool {
        self.from_wind || self.wind_at_6m_mps > 0.0
    }
}

impl Plant {
    /// Down coordinate from which heights above the ground count \[m\]: that of the ground, or 0 without one.
    pub fn height_zero_m(&self) -> f64 {
        if self.ground.present { self.ground.down_m } else { 0.0 }
    }

    /// The drag of the vehicle.
    pub fn drag(&self) -> Drag {
        Drag { linear_nspm: self.drag_linear_nspm, quadratic_ns2pm2: self.drag_quadratic_ns2pm2 }
    }

    /// Whether moving air has an effect on it.
    pub fn feels_air(&self) -> bool {
        let has_drag = self.drag_quadratic_ns2pm2 > 0.0 || self.drag_linear_nspm != [0.0; 3];
        has_drag || self.rotor.inflow_ns2pm > 0.0 || self.rotor.h_force_ns2pm > 0.0
    }
}

/// `[plant.sensors]`: beside `plant.noise`. All zero is a sensor that tells the truth at once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensors {
    /// From which set of values these start.
    pub preset: SensorPreset,
    /// Position \[m\], NED.
    pub position: Sensor,
    /// Velocity \[m/s\], body.
    pub velocity: Sensor,
    /// Euler angles \[deg\].
    pub attitude: Sensor,
    /// Body rates \[deg/s\].
    pub rates: Sensor,
    /// What is made of the measurements.
    pub filter: Filter,
    /// Bandwidth of the filter \[rad/s\]: gyros above it, attitude and position measurements below.
    pub filter_radps: f64,
}

/// `plant.sensors.preset`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SensorPreset {
    /// No errors.
    #[default]
    Ideal,
    /// MEMS gyros and a satellite receiver with carrier phase: see [`Sensors::from`].
    Typical,
}

/// `plant.sensors.filter`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filter {
    /// The controllers get the measurements as they are.
    #[default]
    None,
    /// The controllers get the estimates of a complementary filter.
    Complementary,
}

/// `[plant.sensors.position]` and its likes. Per axis, in the unit of the sensor.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sensor {
    /// One-sided density of white noise \[unit / sqrt(Hz)\].
    pub noise_density: [f64; 3],
    /// Standard deviation of the bias at the start.
    pub bias: [f64; 3],
    /// Random walk of the bias \[unit / sqrt(s)\].
    pub bias_walk: [f64; 3],
    /// Step of the values; 0 = none.
    pub quantum: [f64; 3],
    /// Measurements per second, at most the rate of the ring; 0 = that rate.
    pub rate_hz: f64,
    /// How old a measurement is when it arrives \[ms\].
    pub latency_ms: f64,
}

impl From<SensorPreset> for Sensors {
    /// The values of a preset. `typical` are data sheet values, rounded: TDK ICM-42688-P (gyro noise 0.0028 deg/s per root Hz,
    /// bias after calibration 0.5 deg/s), the attitude of an estimator like PX4's EKF2 (0.3 deg of slow error, 0.02 deg
    /// per root Hz), u-blox ZED-F9P (position 10 mm and 15 mm up, velocity 0.05 m/s, 10 Hz, 60 ms old).
    fn from(preset: SensorPreset) -> Self {
        let ideal = Self {
            preset,
            position: Sensor::default(),
            velocity: Sensor::default(),
            attitude: Sensor::default(),
            rates: Sensor::default(),
            filter: Filter::None,
            filter_radps: 1.0,
        };
        match preset {
            SensorPreset::Ideal => ideal,
            SensorPreset::Typical => Self {
                position: Sensor {
                    noise_density: [0.0045, 0.0045, 0.0067],
                    quantum: [0.001; 3],
                    rate_hz: 10.0,
                    latency_ms: 60.0,
                    ..Sensor::default()
                },
                velocity: Sensor { noise_density: [0.022; 3], rate_hz: 10.0, latency_ms: 60.0, ..Sensor::default() },
                attitude: Sensor {
                    noise_density: [0.02; 3],
                    bias: [0.3, 0.3, 1.0],
                    bias_walk: [0.02, 0.02, 0.05],
                    ..Sensor::default()
                },
                rates: Sensor {
                    noise_density: [0.0028; 3],
                    bias: [0.5; 3],
                    bias_walk: [0.005; 3],
                    quantum: [1.0 / 16.4; 3],
                    ..Sensor::default()
                },
                filter: Filter::Complementary,
                ..ideal
            },
        }
    }
}

impl Default for Sensors {
    fn default() -> Self {
        Self::from(SensorPreset::Ideal)
    }
}

/// `[plant.airframe]`: what is not given is as in `[airframe]`, from which the controllers take their model.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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
    /// Element xz likewise \[kg m2\].
    pub ixz_kgm2: f64,
    /// Element yz likewise \[kg m2\].
    pub iyz_kgm2: f64,
    /// Centre of mass, body, from the point where the arms begin \[m\].
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

/// `[plant.battery]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Battery {
    /// Energy at the shafts from full to empty \[W h\]; 0 = commands are reached whatever is used.
    pub energy_wh: f64,
    /// Share of the voltage lost from full to empty.
    pub droop: f64,
    /// Share of the voltage lost at the load of a hover.
    pub sag: f64,
}

impl Default for Battery {
    /// A lithium polymer battery, when it is switched on: 4.2 V to 3.5 V per cell, and 5 % at hover.
    fn default() -> Self {
        Self { energy_wh: 0.0, droop: 0.17, sag: 0.05 }
    }
}

/// `[plant.ground]`: a level plane. The defaults let a vehicle at the origin stand on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ground {
    /// Whether there is one; without it the world goes on below.
    pub present: bool,
    /// Where it is, NED down \[m\].
    pub down_m: f64,
    /// Height of the rotors above the feet \[m\].
    pub leg_m: f64,
    /// Stiffness of one foot \[N/m\].
    pub stiffness_npm: f64,
    /// Damping of one foot \[N s/m\].
    pub damping_nspm: f64,
    /// Coefficient of friction.
    pub friction: f64,
    /// A touchdown that sinks faster is a crash \[m/s\].
    pub max_sink_mps: f64,
    /// One that drifts faster is a crash \[m/s\].
    pub max_drift_mps: f64,
    /// One that leans more is a crash \[deg\].
    pub max_tilt_deg: f64,
    /// A landing that slides farther is none \[m\].
    pub max_slide_m: f64,
}

impl Default for Ground {
    /// Feet that yield 5 mm under the vehicle of Table I and come to rest without a bounce.
    fn default() -> Self {
        Self {
            present: false,
            down_m: 0.15,
            leg_m: 0.15,
            stiffness_npm: 700.0,
            damping_nspm: 25.0,
            friction: 0.6,
            max_sink_mps: 1.5,
            max_drift_mps: 1.0,
            max_tilt_deg: 20.0,
            max_slide_m: 1.0,
        }
    }
}

/// `[plant.rotor]`: 0 = neglected.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Rotor {
    /// Moment of inertia of one rotor about its axis \[kg m2\]; the rotor speed unit counts as rad/s.
    pub inertia_kgm2: f64,
    /// Thrust lost for each m/s of climb along the axis and each rotor speed unit \[N s2/m\].
    pub inflow_ns2pm: f64,
    /// H-force for each m/s across the axis and each rotor speed unit \[N s2/m\].
    pub h_force_ns2pm: f64,
}

/// `plant.noise`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// \[m\]
    pub position_m: f64,
    /// \[m/s\]
    pub velocity_mps: f64,
    /// \[deg\]
    pub attitude_deg: f64,
    /// \[deg/s\]
    pub rates_dps: f64,
}
