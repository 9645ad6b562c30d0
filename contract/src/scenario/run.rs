//! The scenario as a whole, `[run]` and `[bounds]`. Names and units are the file's.

use airframe::{ActuatorLaw, Limits, Parameters, Trim};
use serde::{Deserialize, Serialize};

use super::{
    Deadline, Fault, FlownAirframe, Guidance, Initial, Mission, Mixer, Mpc, NodeDeadline, Plant, Realtime, Supervision,
    Swap,
};

/// Everything that decides a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// What this run is called; its folder and report carry it.
    pub name: String,
    /// Which defaults it starts from.
    pub profile: Profile,
    /// How the ring is turned.
    pub run: Run,
    /// Where to fly.
    pub mission: Mission,
    /// Where to start, relative to hover trim.
    pub initial: Initial,
    /// Table I.
    pub airframe: Parameters,
    /// The vehicle as it really is.
    pub plant: Plant,
    /// The position controller.
    pub guidance: Guidance,
    /// The attitude controller.
    pub mpc: Mpc,
    /// The control allocation.
    pub mixer: Mixer,
    /// What the run must stay inside of to count as flown.
    pub bounds: Bounds,
    /// How the processes are scheduled.
    pub realtime: Realtime,
    /// When their work is due.
    pub deadline: Deadline,
    /// `[supervision]`
    pub supervision: Supervision,
    /// What goes wrong, and when.
    pub fault: Vec<Fault>,
    /// Who is replaced in flight, and when.
    pub swap: Vec<Swap>,
}

/// The two sets of defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// The paper's controller as verified: fragile, below 5 ms of delay.
    Paper,
    /// The stack's own: lag and delay in the model, exact constraints.
    Robust,
}

/// The three ways to turn the same ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Processes; the plant is released by the clock.
    Realtime,
    /// Processes; the plant is released by its own tick's ACTUATORS.
    Lockstep,
    /// One thread calls the four steps in order.
    Inprocess,
}

/// `[run]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Run {
    /// How the ring is turned.
    pub mode: Mode,
    /// Simulated time \[s\].
    pub duration_s: f64,
    /// Rate of the ring \[Hz\]: sampling, control and deadlines follow.
    pub rate_hz: u32,
    /// Seed of every random stream.
    pub seed: u64,
    /// Dead time between mixer output and actuators \[ms\]; the held command acts meanwhile.
    pub command_delay_ms: f64,
    /// Plus uniform 0..this \[ms\].
    pub command_jitter_ms: f64,
    /// A dropped command leaves the previous one in force.
    pub command_drop_probability: f64,
}

/// `[bounds]`: metrics of the run (see run.json) that must not be exceeded; `inf` = not judged. Position error and fallback
/// have defaults of profile and mission (`launcher/src/bounds.rs`), the others are not judged when absent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// \[m\]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_position_error_m: Option<f64>,
    /// Altitude error for t in \[10, 50\] s \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_altitude_error_horizontal_m: Option<f64>,
    /// Altitude error otherwise \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_altitude_error_vertical_m: Option<f64>,
    /// \[m\]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub final_position_error_m: Option<f64>,
    /// Time the mixer flew without a demand \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_fallback_s: Option<f64>,
}

/// Speed of idling rotors, as a share of that of rotor 1 at hover, where the scenario has them slower: a controller takes a
/// command of zero for a cut.
const IDLE_SHARE: f64 = 0.1;

/// Time between two memories in the log \[s\].
const REMEMBERED_S: u64 = 10;

impl Scenario {
    /// Sample time of the ring \[ns\]; scenario validation sees to it that this is a whole number.
    pub fn sample_ns(&self) -> u64 {
        1_000_000_000 / u64::from(self.run.rate_hz)
    }

    /// Sample time of the ring \[s\].
    pub fn sample_s(&self) -> f64 {
        1.0 / f64::from(self.run.rate_hz)
    }

    /// Number of periods in the run.
    pub fn ticks(&self) -> u64 {
        (self.run.duration_s * f64::from(self.run.rate_hz)).round().max(1.0) as u64
    }

    /// Whether what every node remembers stands in the log after sample `tick`: every ten seconds, from which a replay can begin.
    pub fn is_remembered(&self, tick: u64) -> bool {
        tick > 0 && tick.is_multiple_of(REMEMBERED_S * u64::from(self.run.rate_hz))
    }

    /// Integration step \[ns\]: the longest within `plant.substep_s` that divides the sample.
    pub fn substep_ns(&self) -> u64 {
        let sample_ns = self.sample_ns();
        let longest_ns = (self.plant.substep_s * 1e9).round().max(1.0) as u64;
        let steps = (sample_ns.div_ceil(longest_ns)..=sample_ns).find(|steps| sample_ns.is_multiple_of(*steps));
        sample_ns / steps.unwrap_or(sample_ns)
    }

    /// When the message of the node of this `rank` in the ring is due, 0 (plant) to 3 (mixer).
    pub fn deadline_of(&self, rank: usize) -> NodeDeadline {
        self.deadline.of(rank, self.sample_s())
    }

    /// The numbers of the vehicle that flies: `[airframe]`, with what `[plant.airframe]` changes.
    pub fn flown_airframe(&self) -> Parameters {
        let (known, flown) = (&self.airframe, &self.plant.airframe);
        Parameters {
            preset: known.preset,
            g_mps2: known.g_mps2,
            mass_kg: flown.mass_kg.unwrap_or(known.mass_kg),
            ixx_kgm2: flown.ixx_kgm2.unwrap_or(known.ixx_kgm2),
            iyy_kgm2: flown.iyy_kgm2.unwrap_or(known.iyy_kgm2),
            izz_kgm2: flown.izz_kgm2.unwrap_or(known.izz_kgm2),
            l1_m: flown.l1_m.unwrap_or(known.l1_m),
            l2_m: flown.l2_m.unwrap_or(known.l2_m),
            l3_m: flown.l3_m.unwrap_or(known.l3_m),
            kf: flown.kf.unwrap_or(known.kf),
            km: flown.km.unwrap_or(known.km),
        }
    }

    /// The inertia tensor of the vehicle that flies, row by row \[kg m2\]; it is symmetric.
    pub fn flown_inertia_kgm2(&self) -> [[f64; 3]; 3] {
        let Parameters { ixx_kgm2: ixx, iyy_kgm2: iyy, izz_kgm2: izz, .. } = self.flown_airframe();
        let FlownAirframe { ixy_kgm2: ixy, ixz_kgm2: ixz, iyz_kgm2: iyz, .. } = self.plant.airframe;
        [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]
    }

    /// Amplitude limits of the actuators.
    pub fn limits(&self) -> Limits {
        let p = &self.plant;
        Limits::new(&self.airframe, p.rotor_speed_min, p.rotor_speed_max_ratio, p.tilt_max_deg.to_radians())
    }

    /// The speed of rotors that idle, on the ground before the take-off and after the touchdown \[rotor speed unit\].
    pub fn idle_speed(&self) -> f64 {
        let trim = Trim::solve(&self.airframe, self.plant.tilt_reaction);
        self.plant.rotor_speed_min.max(IDLE_SHARE * trim.actuation.rotor_speed[0])
    }

    /// The actuators as they are.
    pub fn actuator_law(&self) -> ActuatorLaw {
        ActuatorLaw {
            limits: self.limits(),
            rotor_lag_s: self.plant.rotor_lag_s,
            servo_lag_s: self.plant.servo_lag_s,
            rotor_rate_limit: self.plant.rotor_rate_limit,
            servo_rate_limit_radps: self.plant.servo_rate_limit_radps,
        }
    }
}
