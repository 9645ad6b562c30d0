//! The two profiles: the default of every setting.
//!
//! `paper` is the paper's Tables III and IV, with verified values for settings that the tables leave open; `robust` is
//! the best that the stack's own campaigns know (docs/tried.md): lag, delay and disturbance in the model, weights that
//! tolerate them, a preview, velocity feedback and feed-forward in guidance.

use airframe::{Parameters, Preset, projection};

use crate::table::control::{
    Attitude, BrokenVehicle, Constraints, DelayCompensation, DelayName, Derivative, GuidanceSettings, IndiGains, Law,
    MixerSettings, Model, MpcSettings, PidGains, RateReference, RollReference, SolverName, StateConstraints, Terminal,
};
use crate::table::mission::{Initial, Mission, Ramp, TrajectoryKind};
use crate::table::part::MissionLimits;
use crate::table::program::Nodes;
use crate::table::run::{Bounds, Mode, Profile, Run, Scenario};
use crate::table::sensors::SensorsSettings;
use crate::table::timing::{Deadline, Late, Realtime, SchedulingPolicy, Supervision};
use crate::table::vehicle::{
    BatterySettings, FlownAirframe, GroundSettings, Noise, PlantSettings, Rotor, TurbulenceSettings,
};

/// Returns all defaults of a profile.
impl From<Profile> for Scenario {
    fn from(profile: Profile) -> Self {
        match profile {
            Profile::Paper => paper(),
            Profile::Robust => robust(),
        }
    }
}

/// Smallest and largest weight of an input that a scenario may have.
const LEAST_WEIGHT: f64 = 1e-12;
const MOST_WEIGHT: f64 = 1e12;

/// Longest horizon of profile `robust` \[samples\], and most moves of a plan with constraints: a solve takes longer
/// with each move.
const MOST_SAMPLES: f64 = 200.0;
const MOST_MOVES: f64 = 20.0;
/// Share of a model error that the disturbance estimate takes in per second, after its gain has fallen to the last
/// value \[1/s\].
const DISTURBANCE_RATE: f64 = 2.0;

/// Returns the defaults of the profile of `chosen`, adapted to its other choices: the trajectory to its parts, the
/// actuators and parameters to its preset, and the weights of the inputs to mass and inertia, so that the same
/// acceleration costs the same, and the closed loop has the same poles.
///
/// In profile `robust` the control horizon ends where a solve would take too long, the disturbance estimate is as fast
/// at every rate, and settings that a law or a model does not use are off.
pub(crate) fn for_choice(chosen: &Scenario) -> Scenario {
    let (scenario, vehicle) = (Scenario::from(chosen.profile), &chosen.airframe);
    let ratios = scenario.airframe.inertia().component_div(&vehicle.inertia());
    let weights = scenario.attitude.mpc.r;
    let r = std::array::from_fn(|i| (weights[i] * ratios[i] * ratios[i]).clamp(LEAST_WEIGHT, MOST_WEIGHT));
    let mpc = MpcSettings { r, ..scenario.attitude.mpc };
    let plant = match vehicle.preset {
        Preset::Paper => scenario.plant,
        Preset::TenInch => PlantSettings {
            rotor_speed_min: 100.0,
            rotor_speed_max_ratio: 1.5,
            rotor_rate_limit: 5000.0,
            tilt_max_deg: 45.0,
            ..scenario.plant
        },
    };
    let trajectory = if chosen.mission.part.is_empty() { scenario.mission.trajectory } else { TrajectoryKind::Parts };
    let mission = Mission { trajectory, ..scenario.mission };
    let attitude = Attitude { mpc, ..scenario.attitude };
    let scenario = Scenario { airframe: vehicle.preset.into(), mission, plant, attitude, ..scenario };
    match scenario.profile {
        Profile::Paper => scenario,
        Profile::Robust => for_law(scenario, &chosen.attitude, f64::from(chosen.run.rate_hz)),
    }
}

/// Adapts the defaults of profile `robust` to the law and the model of `chosen`, and to the rate.
fn for_law(scenario: Scenario, chosen: &Attitude, rate_hz: f64) -> Scenario {
    let (law, plan, attitude) = (chosen.law, &chosen.mpc, scenario.attitude);
    let has_gain = matches!(law, Law::Mpc | Law::Lqr);
    let most_moves = if plan.constraints == Constraints::None { MOST_SAMPLES } else { MOST_MOVES };
    let mpc = MpcSettings {
        model: if has_gain && chosen.disturbance_gain > 0.0 { Model::Coupled } else { Model::Hover },
        prediction_horizon_s: attitude.mpc.prediction_horizon_s.min(MOST_SAMPLES / rate_hz),
        control_horizon_s: plan.prediction_horizon_s.min(attitude.mpc.control_horizon_s).min(most_moves / rate_hz),
        ..attitude.mpc
    };
    let attitude = Attitude {
        delay_compensation: match plan.model {
            Model::Hover | Model::Coupled => attitude.delay_compensation,
            Model::Scheduled => DelayCompensation::Sample(true),
        },
        disturbance_gain: if law == Law::Indi { 0.0 } else { DISTURBANCE_RATE / rate_hz },
        mpc,
        ..attitude
    };
    let preview_s = if law == Law::Mpc { scenario.guidance.preview_s } else { 0.0 };
    Scenario { attitude, guidance: GuidanceSettings { preview_s, ..scenario.guidance }, ..scenario }
}

impl Default for Scenario {
    fn default() -> Self {
        robust()
    }
}

macro_rules! default_is_robust {
    ($($section:ident: $($field:ident).+),*) => {$(
        impl Default for $section {
            fn default() -> Self { robust()$(.$field)+ }
        }
    )*};
}
default_is_robust!(
    Run: run, Mission: mission, PlantSettings: plant, GuidanceSettings: guidance, Attitude: attitude,
    MpcSettings: attitude.mpc, MixerSettings: mixer
);

fn paper() -> Scenario {
    Scenario {
        name: "survey".into(),
        profile: Profile::Paper,
        run: Run {
            mode: Mode::Realtime,
            duration_s: 60.0,
            rate_hz: 100,
            seed: 0,
            command_delay_ms: 0.0,
            command_jitter_ms: 0.0,
            command_drop_probability: 0.0,
        },
        mission: survey(),
        initial: Initial::default(),
        airframe: Parameters::default(),
        plant: PlantSettings {
            substep_s: 0.001,
            rotor_lag_s: 0.03,
            servo_lag_s: 0.03,
            rotor_rate_limit: 20_000.0,
            servo_rate_limit_radps: 10.5,
            rotor_speed_min: 0.0,
            rotor_speed_max_ratio: 2.0,
            tilt_max_deg: 90.0,
            drag_linear_nspm: [0.0; 3],
            drag_quadratic_ns2pm2: 0.0,
            tilt_reaction: false,
            rotor_effectiveness: [1.0; 3],
            wind_ned_mps: vec![],
            disturbance: vec![],
            noise: Noise::default(),
            sensors: SensorsSettings::default(),
            airframe: FlownAirframe::default(),
            rotor: Rotor::default(),
            battery: BatterySettings::default(),
            ground: GroundSettings::default(),
            wind_roughness_m: 0.0,
            turbulence: TurbulenceSettings::default(),
        },
        guidance: GuidanceSettings {
            kp_phi: 0.5,
            ki_phi: 0.01,
            kd_phi: 0.1,
            kp_theta: -0.1,
            ki_theta: -0.01,
            kd_theta: -0.1,
            kp_w: 5.0,
            ki_w: 0.1,
            kd_w: 0.1,
            roll_reference: RollReference::Trim,
            derivative: Derivative::Error,
            rate_reference: RateReference::Difference,
            heading_frame: false,
            acceleration_feedforward: false,
            velocity_feedforward: false,
            exact_w: false,
            disturbance_observer_radps: 0.0,
            angle_limit_deg: 35.0,
            climb_limit_mps: 1e9,
            w_limit_mps: 1e9,
            heading_rate_limit_dps: 0.0,
            integral_limit: 1e9,
            lead_s: 0.0,
            preview_s: 0.0,
        },
        attitude: Attitude {
            law: Law::Mpc,
            actuator_lag_model_s: 0.0,
            servo_lag_model_s: None,
            delay_compensation: DelayCompensation::Sample(false),
            disturbance_gain: 0.0,
            mpc: horizon(),
            pid: PidGains::default(),
            geometric: PidGains::default(),
            indi: IndiGains::default(),
        },
        mixer: allocation(),
        bounds: Bounds::default(),
        fault: vec![],
        node: Nodes::default(),
        swap: vec![],
        realtime: Realtime::default(),
        deadline: Deadline::default(),
        supervision: Supervision::default(),
    }
}

fn horizon() -> MpcSettings {
    MpcSettings {
        model: Model::Hover,
        q: [1e2, 1e3, 1e3, 1e3, 1e4, 1e4, 1e4],
        r: [0.1, 0.1, 0.001, 0.001],
        r_rate: [0.0; 4],
        prediction_horizon_s: 0.1,
        control_horizon_s: 0.05,
        terminal: Terminal::Zero,
        constraints: Constraints::None,
        solver: SolverName::Clarabel,
        max_iterations: 100,
        time_limit_ms: 5.0,
        state_constraints: StateConstraints::None,
        attitude_limit_deg: [90.0, 90.0, 360.0],
        rates_limit_dps: [360.0, 360.0, 360.0],
    }
}

fn allocation() -> MixerSettings {
    MixerSettings {
        tilt_reaction: false,
        projection: false,
        projection_weights: projection::WEIGHTS,
        broken_vehicle: BrokenVehicle::Cut,
    }
}

fn survey() -> Mission {
    Mission {
        trajectory: TrajectoryKind::Survey,
        ramp_s: Ramp::Seconds(1.5),
        heading_deg: 0.0,
        limits: MissionLimits::default(),
        part: vec![],
    }
}

fn robust() -> Scenario {
    let paper = paper();
    Scenario {
        profile: Profile::Robust,
        plant: PlantSettings { rotor_speed_min: 200.0, tilt_max_deg: 60.0, ..paper.plant },
        guidance: GuidanceSettings {
            kp_phi: 0.55,
            ki_phi: 0.1,
            kd_phi: 0.45,
            kp_theta: -0.55,
            ki_theta: -0.1,
            kd_theta: -0.45,
            kp_w: 3.0,
            ki_w: 0.15,
            kd_w: 0.0,
            derivative: Derivative::Velocity,
            rate_reference: RateReference::Zero,
            heading_frame: true,
            acceleration_feedforward: true,
            velocity_feedforward: true,
            exact_w: true,
            angle_limit_deg: 30.0,
            climb_limit_mps: 4.0,
            heading_rate_limit_dps: 180.0,
            integral_limit: 2.0,
            disturbance_observer_radps: 1.0,
            preview_s: 0.4,
            ..paper.guidance
        },
        attitude: Attitude {
            actuator_lag_model_s: 0.035,
            delay_compensation: DelayCompensation::Named(DelayName::Measured),
            disturbance_gain: 0.02,
            mpc: MpcSettings {
                model: Model::Coupled,
                q: [1e2, 1e3, 1e3, 1e3, 5.0, 5.0, 0.0],
                r: [0.3, 70.0, 20.0, 1200.0],
                prediction_horizon_s: 0.2,
                control_horizon_s: 0.2,
                terminal: Terminal::Dare,
                solver: SolverName::ActiveSet,
                ..paper.attitude.mpc
            },
            ..paper.attitude
        },
        mixer: MixerSettings { projection: true, ..paper.mixer },
        ..paper
    }
}

impl Default for Realtime {
    fn default() -> Self {
        Self { policy: SchedulingPolicy::Fifo, priority: 70, affinity: vec![], lock_memory: true, rttime_ms: 500.0 }
    }
}

impl Default for Deadline {
    fn default() -> Self {
        Self { end_to_end_ms: None, late: Late::Send }
    }
}
