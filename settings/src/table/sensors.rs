//! `[plant.sensors]`: the sensors of the navigation unit and their errors, and the telemetry of the actuators.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Sensors of the navigation unit, `[plant.sensors]`; without a unit `plant.noise` is the only error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorsSettings {
    /// Preset that the other settings start from.
    pub preset: SensorPreset,
    /// Position of the satellite receiver: axes north, east, down; unit m.
    pub position: SensorSettings,
    /// Velocity of the satellite receiver: axes north, east, down; unit m/s.
    pub velocity: Velocity,
    /// Gyros: p, q, r; unit deg/s.
    pub rates: Gyros,
    /// Filter between the measurements and the controllers.
    pub filter: FilterName,
    /// Inertial measurement unit of the EKF; its gyros have the errors of `rates` too.
    pub imu: ImuSettings,
    /// Satellite receiver of the EKF, which measures `position` and `velocity`.
    pub receiver: Receiver,
    /// Barometer of the EKF.
    pub barometer: Barometer,
    /// Magnetometer of the EKF.
    pub magnetometer: Magnetometer,
    /// Sensor of the velocity over the ground, of the EKF.
    pub flow: Flow,
    /// Error of the EKF at the start.
    pub alignment: Alignment,
    /// Sensors of rotor speeds and tilt.
    pub telemetry: TelemetrySettings,
}

/// Preset of the sensors, `plant.sensors.preset`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum SensorPreset {
    /// No errors.
    #[default]
    Ideal,
    /// MEMS sensors, and a satellite receiver without corrections, behind an EKF (docs/navigation.md).
    Typical,
    /// Sensors of `typical`, but with carrier phase in the receiver (RTK), and a calibrated IMU.
    Good,
}

/// Filter of the measurements, `plant.sensors.filter`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FilterName {
    /// No unit: the controllers get the true motion with `plant.noise`.
    #[default]
    None,
    /// Error-state Kalman filter over IMU, satellite receiver, barometer and magnetometer.
    Ekf,
}

/// Position of the satellite receiver, `[plant.sensors.position]`: errors per axis, in the unit of the sensor.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorSettings {
    /// One-sided density of white noise \[unit / sqrt(Hz)\].
    pub noise_density: [f64; 3],
    /// Standard deviation of the bias at the start \[unit\].
    pub bias: [f64; 3],
    /// Random walk of the bias \[unit / sqrt(s)\].
    pub bias_walk: [f64; 3],
    /// Time constant \[s\] with which the bias returns to 0 (first-order Gauss-Markov); 0 = the bias does not return.
    /// The bias is stationary if `bias_walk` is `bias` times the root of 2 / `bias_s`.
    pub bias_s: f64,
    /// Quantisation step of the values \[unit\]; 0 = none.
    pub quantum: [f64; 3],
    /// Measurements per second \[Hz\], at most the rate of the IMU; 0 = that rate.
    pub rate_hz: f64,
}

/// Velocity of the satellite receiver, `[plant.sensors.velocity]`: errors per axis \[m/s\].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Velocity {
    /// One-sided density of white noise \[m/s / sqrt(Hz)\].
    pub noise_density: [f64; 3],
    /// Quantisation step of the values \[m/s\]; 0 = none.
    pub quantum: [f64; 3],
    /// Measurements per second \[Hz\], at most the rate of the IMU; 0 = that rate.
    pub rate_hz: f64,
}

impl From<&Velocity> for SensorSettings {
    fn from(velocity: &Velocity) -> Self {
        let Velocity { noise_density, quantum, rate_hz } = *velocity;
        Self { noise_density, quantum, rate_hz, ..Self::default() }
    }
}

/// Gyros, `[plant.sensors.rates]`: errors per axis \[deg/s\].
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Gyros {
    /// One-sided density of white noise \[deg/s / sqrt(Hz)\].
    pub noise_density: [f64; 3],
    /// Standard deviation of the bias at the start \[deg/s\].
    pub bias: [f64; 3],
    /// Random walk of the bias \[deg/s / sqrt(s)\].
    pub bias_walk: [f64; 3],
    /// Quantisation step of the values \[deg/s\]; 0 = none.
    pub quantum: [f64; 3],
}

/// Inertial measurement unit, `[plant.sensors.imu]`: measures means over a sample, with equal errors on every axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImuSettings {
    /// Number of IMUs, 1 or 2, with errors of their own: one EKF runs for each IMU, and the controllers get the
    /// estimate that fits the other sensors.
    pub count: usize,
    /// Samples per second \[Hz\]: the vehicle is integrated up to each, also between two samples of the run.
    pub rate_hz: f64,
    /// One-sided density of the white noise of the specific force \[m/s2 / sqrt(Hz)\].
    pub acceleration_noise_density: f64,
    /// Standard deviation of the accelerometer's bias at the start \[m/s2\].
    pub acceleration_bias_mps2: f64,
    /// Random walk of the accelerometer's bias \[m/s2 / sqrt(s)\].
    pub acceleration_bias_walk: f64,
    /// Standard deviation of the scale error of each accelerometer and gyro.
    pub scale: f64,
    /// Standard deviation of the misalignment of accelerometers and gyros, about each axis \[deg\].
    pub misalignment_deg: f64,
    /// Standard deviation of the vibration in a sample of the specific force, with rotors at trim speed; it is
    /// proportional to the mean rotor speed, and white because sampling folds it down \[m/s2\].
    pub vibration_mps2: f64,
    /// Amplitude of the vibration at the speed of each rotor at trim, in a direction that is drawn; it is proportional
    /// to the square of the speed \[m/s2\]. The mean over a sample contains an alias of this vibration.
    pub vibration_line_mps2: f64,
}

impl Default for ImuSettings {
    fn default() -> Self {
        Self {
            count: 1,
            rate_hz: 250.0,
            acceleration_noise_density: 0.0,
            acceleration_bias_mps2: 0.0,
            acceleration_bias_walk: 0.0,
            scale: 0.0,
            misalignment_deg: 0.0,
            vibration_mps2: 0.0,
            vibration_line_mps2: 0.0,
        }
    }
}

/// Satellite receiver, `[plant.sensors.receiver]`: errors and latency that its position and velocity share.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Receiver {
    /// Standard deviation of the place of the antenna, on each body axis \[m\].
    pub antenna_m: f64,
    /// Standard deviation of the time at which a measurement was made \[ms\].
    pub clock_ms: f64,
    /// Age of a measurement when it arrives \[ms\].
    pub latency_ms: f64,
}

/// Barometer, `[plant.sensors.barometer]`: the height above the origin.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Barometer {
    /// Measurements per second \[Hz\]; 0 = no barometer.
    pub rate_hz: f64,
    /// One-sided density of white noise \[m / sqrt(Hz)\].
    pub noise_density: f64,
    /// Random walk of the bias, which is 0 at the start \[m / sqrt(s)\].
    pub bias_walk: f64,
    /// Standard deviation of the share of the dynamic pressure of the mean wind over the vehicle that the sensor takes
    /// for static pressure, up to a share of 1.
    pub wind_pressure: f64,
    /// Standard deviation of the error by the pressure of the rotors at trim; it is proportional to the square of their
    /// speed \[m\].
    pub rotor_pressure_m: f64,
}

/// Magnetometer, `[plant.sensors.magnetometer]`, in shares of the strength of the earth's field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Magnetometer {
    /// Measurements per second \[Hz\]; 0 = no magnetometer.
    pub rate_hz: f64,
    /// One-sided density of white noise \[share / sqrt(Hz)\].
    pub noise_density: f64,
    /// Standard deviation of the vehicle's own field, on each body axis.
    pub disturbance: f64,
    /// Standard deviation of the error of the map of the declination \[deg\].
    pub declination_error_deg: f64,
    /// Angle of the field below the horizon \[deg\].
    pub inclination_deg: f64,
}

impl Default for Magnetometer {
    fn default() -> Self {
        Self { rate_hz: 50.0, noise_density: 0.0, disturbance: 0.0, declination_error_deg: 0.0, inclination_deg: 65.0 }
    }
}

/// Sensor of the velocity over the ground, as of optical flow, `[plant.sensors.flow]`: body axes x and y.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Flow {
    /// Measurements per second \[Hz\]; 0 = no such sensor.
    pub rate_hz: f64,
    /// One-sided density of white noise \[m/s / sqrt(Hz)\].
    pub noise_density: f64,
}

/// Start of the EKF, `[plant.sensors.alignment]`: with an error of these standard deviations, or after standing still.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Alignment {
    /// Position, on each axis \[m\].
    pub position_m: f64,
    /// Velocity, on each axis \[m/s\].
    pub velocity_mps: f64,
    /// Roll and pitch \[deg\].
    pub tilt_deg: f64,
    /// Heading \[deg\].
    pub heading_deg: f64,
    /// Time that the vehicle stands still before the flight, while the unit aligns itself by its own sensors \[s\], 0
    /// to 60; 0 = the unit starts with an error of the deviations above.
    pub standing_s: f64,
}

/// Sensors of rotor speeds and tilt, as of speed controllers and servo, `[plant.sensors.telemetry]`. Only the law
/// `indi` uses them, with `attitude.indi.actuators` = "sensed".
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TelemetrySettings {
    /// Standard deviation of each rotor speed, as a share of its trim speed.
    pub rotor_speed_noise: f64,
    /// Standard deviation of the tilt \[deg\].
    pub tilt_noise_deg: f64,
    /// Age of a measurement when it arrives \[ms\], rounded up to whole samples.
    pub latency_ms: f64,
}

impl From<SensorPreset> for SensorsSettings {
    /// Returns a preset. The errors of `typical` and `good` are as large as those of the parts in docs/navigation.md.
    fn from(preset: SensorPreset) -> Self {
        let sensors = match preset {
            SensorPreset::Ideal => Self::ideal(),
            SensorPreset::Good => Self::good(),
            SensorPreset::Typical => Self::typical(),
        };
        Self { preset, ..sensors }
    }
}

impl SensorsSettings {
    fn ideal() -> Self {
        Self {
            preset: SensorPreset::Ideal,
            position: SensorSettings::default(),
            velocity: Velocity::default(),
            rates: Gyros::default(),
            filter: FilterName::None,
            imu: ImuSettings::default(),
            receiver: Receiver::default(),
            barometer: Barometer::default(),
            magnetometer: Magnetometer::default(),
            flow: Flow::default(),
            alignment: Alignment::default(),
            telemetry: TelemetrySettings::default(),
        }
    }

    fn good() -> Self {
        Self {
            position: SensorSettings {
                noise_density: [0.0045, 0.0045, 0.0067],
                bias: [0.01, 0.01, 0.015],
                bias_walk: [0.0014, 0.0014, 0.0021],
                bias_s: 100.0,
                quantum: [0.001; 3],
                rate_hz: 10.0,
            },
            velocity: Velocity { noise_density: [0.022; 3], rate_hz: 10.0, ..Velocity::default() },
            rates: Gyros {
                noise_density: [0.0028; 3],
                bias: [0.1; 3],
                bias_walk: [0.002; 3],
                quantum: [1.0 / 131.0; 3],
            },
            filter: FilterName::Ekf,
            imu: ImuSettings {
                count: 2,
                acceleration_noise_density: 0.0007,
                acceleration_bias_mps2: 0.01,
                acceleration_bias_walk: 0.0005,
                scale: 0.0005,
                misalignment_deg: 0.05,
                vibration_mps2: 0.3,
                vibration_line_mps2: 3.0,
                ..ImuSettings::default()
            },
            receiver: Receiver { antenna_m: 0.01, clock_ms: 2.0, latency_ms: 60.0 },
            barometer: Barometer {
                rate_hz: 25.0,
                noise_density: 0.03,
                bias_walk: 0.02,
                wind_pressure: 0.1,
                rotor_pressure_m: 0.15,
            },
            magnetometer: Magnetometer {
                noise_density: 0.001,
                disturbance: 0.005,
                declination_error_deg: 0.3,
                ..Magnetometer::default()
            },
            alignment: Alignment {
                position_m: 0.02,
                velocity_mps: 0.05,
                tilt_deg: 0.3,
                heading_deg: 1.0,
                standing_s: 0.0,
            },
            telemetry: TelemetrySettings { rotor_speed_noise: 0.005, tilt_noise_deg: 0.3, latency_ms: 0.0 },
            ..Self::ideal()
        }
    }

    fn typical() -> Self {
        let good = Self::good();
        Self {
            position: SensorSettings {
                noise_density: [0.067, 0.067, 0.11],
                bias: [1.3, 1.3, 2.6],
                bias_walk: [0.184, 0.184, 0.368],
                ..good.position
            },
            velocity: Velocity { noise_density: [0.022, 0.022, 0.045], ..good.velocity },
            rates: Gyros { bias: [0.5; 3], bias_walk: [0.005; 3], ..good.rates },
            imu: ImuSettings {
                acceleration_bias_mps2: 0.03,
                scale: 0.001,
                misalignment_deg: 0.2,
                vibration_mps2: 0.5,
                vibration_line_mps2: 5.0,
                ..good.imu
            },
            receiver: Receiver { antenna_m: 0.03, clock_ms: 10.0, latency_ms: 100.0 },
            barometer: Barometer { wind_pressure: 0.2, rotor_pressure_m: 0.3, ..good.barometer },
            magnetometer: Magnetometer { disturbance: 0.02, declination_error_deg: 0.5, ..good.magnetometer },
            alignment: Alignment {
                position_m: 0.1,
                velocity_mps: 0.05,
                tilt_deg: 0.5,
                heading_deg: 2.0,
                standing_s: 0.0,
            },
            ..good
        }
    }
}

impl Default for SensorsSettings {
    fn default() -> Self {
        Self::from(SensorPreset::Ideal)
    }
}
