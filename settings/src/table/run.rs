//! The scenario as a whole, `[run]` and `[bounds]`. Fields have the names and units of the file.

use airframe::{ActuatorLaw, ActuatorLimits, Parameters, Trim};
use contract::topic::{GRAPH, Topic};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::table::control::{Attitude, GuidanceSettings, MixerSettings};
use crate::table::fault::Fault;
use crate::table::mission::{Initial, Mission};
use crate::table::program::Nodes;
use crate::table::swap::Swap;
use crate::table::timing::{Deadline, NodeDeadline, Realtime, Scheduling, Supervision};
use crate::table::vehicle::{FlownAirframe, PlantSettings};

/// All settings that decide a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Name of the run, shown in its folder and report.
    pub name: String,
    /// Profile of defaults that the settings start from.
    pub profile: Profile,
    /// Mode, duration, rate and delays of the run.
    pub run: Run,
    /// Trajectory to fly.
    pub mission: Mission,
    /// Initial state, relative to hover trim.
    pub initial: Initial,
    /// Vehicle that the controllers know: Table I.
    pub airframe: Parameters,
    /// Simulated vehicle and its surroundings.
    pub plant: PlantSettings,
    /// The position controller.
    pub guidance: GuidanceSettings,
    /// The attitude controller.
    pub attitude: Attitude,
    /// The control allocation.
    pub mixer: MixerSettings,
    /// Bounds that the run must keep to count as flown.
    pub bounds: Bounds,
    /// Scheduling of all nodes.
    pub realtime: Realtime,
    /// Deadlines of all nodes.
    pub deadline: Deadline,
    /// Detection of failed processes, and their restart.
    pub supervision: Supervision,
    /// Settings of single nodes: program, scheduling, deadline.
    pub node: Nodes,
    /// Faults to inject.
    pub fault: Vec<Fault>,
    /// Processes to replace in flight.
    pub swap: Vec<Swap>,
}

/// The two sets of defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// The paper's controller as verified: fragile, it tolerates less than 5 ms of delay.
    Paper,
    /// The stack's own controller: lag and measured delay in the model, estimates, preview.
    Robust,
}

/// Mode of a run: how the nodes are run, and what releases the plant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Nodes are processes; the plant is released by the clock.
    Realtime,
    /// Nodes are processes; the plant is released when all of them are done with its last tick.
    Lockstep,
    /// One thread calls the steps of the four nodes in order.
    Inprocess,
}

/// Mode, duration, rate and delays of a run, `[run]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Run {
    /// Execution of the nodes: processes or one thread, and the release of the plant.
    pub mode: Mode,
    /// Simulated time \[s\].
    pub duration_s: f64,
    /// Rate of the ring \[Hz\], from which sampling, control and deadlines follow; its period is a whole number of
    /// nanoseconds.
    pub rate_hz: u32,
    /// Seed of every random stream; flights of equal settings and equal seed are equal.
    pub seed: u64,
    /// Delay between mixer output and actuators \[ms\]; the previous command acts meanwhile.
    pub command_delay_ms: f64,
    /// Upper end of a further random delay of each command, uniform from 0 \[ms\].
    pub command_jitter_ms: f64,
    /// Probability that a command is dropped, 0 to 1; the previous command then stays in force.
    pub command_drop_probability: f64,
}

/// Bounds on metrics of the run (see run.json), `[bounds]`; `inf` = not checked. Position error and fallback have
/// defaults of profile and mission; the other bounds are not checked when absent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// Largest position error \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_position_error_m: Option<f64>,
    /// Largest altitude error \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_altitude_error_m: Option<f64>,
    /// Largest position error at the end \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub final_position_error_m: Option<f64>,
    /// Longest time that the mixer may fly without a demand \[s\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_fallback_s: Option<f64>,
}

/// Time between two records of the nodes' memories in the log \[s\].
const REMEMBERED_S: u64 = 10;

impl Scenario {
    /// Sample time of the ring \[ns\]; the checks of a scenario ensure that it is a whole number.
    pub fn sample_ns(&self) -> u64 {
        1_000_000_000 / u64::from(self.run.rate_hz)
    }

    /// Sample time of the ring \[s\].
    pub fn sample_s(&self) -> f64 {
        1.0 / f64::from(self.run.rate_hz)
    }

    /// Prediction horizon Np \[samples\].
    pub fn np(&self) -> usize {
        self.nearest_samples(self.attitude.mpc.prediction_horizon_s)
    }

    /// Control horizon Nu \[samples\].
    pub fn nu(&self) -> usize {
        self.nearest_samples(self.attitude.mpc.control_horizon_s)
    }

    /// Rounds a time to samples, halves up; adding 1e-6 covers a product that floating point puts just below a half.
    fn nearest_samples(&self, time_s: f64) -> usize {
        libm::round(time_s * f64::from(self.run.rate_hz) + 1e-6) as usize
    }

    /// Number of periods in the run.
    pub fn ticks(&self) -> u64 {
        (self.run.duration_s * f64::from(self.run.rate_hz)).round().max(1.0) as u64
    }

    /// Returns whether the log gets the nodes' memories after sample `tick`, from which a replay can begin: every ten
    /// seconds.
    pub fn is_remembered(&self, tick: u64) -> bool {
        tick > 0 && tick.is_multiple_of(REMEMBERED_S * u64::from(self.run.rate_hz))
    }

    /// Integration step \[ns\]: the longest step of at most `plant.substep_s` that divides the sample time.
    pub fn substep_ns(&self) -> u64 {
        let sample_ns = self.sample_ns();
        let longest_ns = (self.plant.substep_s * 1e9).round().max(1.0) as u64;
        let steps = (sample_ns.div_ceil(longest_ns)..=sample_ns).find(|steps| sample_ns.is_multiple_of(*steps));
        sample_ns / steps.unwrap_or(sample_ns)
    }

    /// Scheduling of the node at place `rank` in the ring, 0 (plant) to 3 (mixer).
    pub fn scheduling_of(&self, rank: usize) -> Scheduling {
        let (common, own) = (&self.realtime, self.node.of(Topic::ALL[rank]));
        Scheduling {
            policy: own.policy.unwrap_or(common.policy),
            priority: own.priority.unwrap_or(common.priority + rank as u32),
            affinity: own.affinity.clone().unwrap_or_else(|| common.affinity.clone()),
            lock_memory: common.lock_memory,
            rttime_ms: common.rttime_ms,
        }
    }

    /// Deadline of the node at place `rank` in the ring, 0 (plant) to 3 (mixer).
    pub fn deadline_of(&self, rank: usize) -> NodeDeadline {
        let (common, own) = (&self.deadline, self.node.of(Topic::ALL[rank]));
        let whole_ms = common.end_to_end_ms.unwrap_or(self.sample_s() * 1e3);
        let due_ms = own.deadline_ms.unwrap_or(whole_ms * GRAPH[rank].deadline_share);
        NodeDeadline { deadline_ns: (due_ms * 1e6).round() as u64, late: own.late.unwrap_or(common.late) }
    }

    /// Parameters of the vehicle that flies: `[airframe]`, with the changes of `[plant.airframe]`.
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

    /// Inertia tensor of the vehicle that flies, row by row \[kg m2\]; it is symmetric.
    pub fn flown_inertia_kgm2(&self) -> [[f64; 3]; 3] {
        let Parameters { ixx_kgm2: ixx, iyy_kgm2: iyy, izz_kgm2: izz, .. } = self.flown_airframe();
        let FlownAirframe { ixy_kgm2: ixy, ixz_kgm2: ixz, iyz_kgm2: iyz, .. } = self.plant.airframe;
        [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]
    }

    /// Amplitude limits of the actuators.
    pub fn limits(&self) -> ActuatorLimits {
        let p = &self.plant;
        ActuatorLimits::new(&self.airframe, p.rotor_speed_min, p.rotor_speed_max_ratio, p.tilt_max_deg.to_radians())
    }

    /// Idle speed of the rotors, on the ground before the take-off and after the touchdown \[rotor speed unit\].
    pub fn idle_speed(&self) -> f64 {
        Trim::solve(&self.airframe, self.plant.tilt_reaction).idle_speed(self.plant.rotor_speed_min)
    }

    /// Limits, lags and rate limits of the true actuators.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::program::NodeSettings;
    use crate::table::timing::{Late, SchedulingPolicy};

    #[test]
    fn priorities_rise_downstream_and_a_node_s_own_table_overrides() {
        let mut scenario = Scenario::default();
        assert_eq!([0, 1, 2, 3].map(|rank| scenario.scheduling_of(rank).priority), [70, 71, 72, 73]);
        let own = NodeSettings { priority: Some(40), affinity: Some(vec![1]), ..NodeSettings::default() };
        scenario.node.mixer = own;
        scenario.realtime.affinity = vec![0];
        let [guidance, mixer] = [1, 3].map(|rank| scenario.scheduling_of(rank));
        assert_eq!((guidance.priority, guidance.affinity), (71, vec![0]));
        assert_eq!((mixer.priority, mixer.affinity, mixer.policy), (40, vec![1], SchedulingPolicy::Fifo));
    }

    #[test]
    fn deadlines_default_to_shares_of_the_chain_and_the_chain_to_the_period() {
        let mut scenario = Scenario::default();
        let due = |scenario: &Scenario| [0, 1, 2, 3].map(|rank| scenario.deadline_of(rank).deadline_ns);
        assert_eq!(due(&scenario), [2_000_000, 4_000_000, 8_000_000, 10_000_000]);
        scenario.run.rate_hz = 1000;
        assert_eq!(due(&scenario), [200_000, 400_000, 800_000, 1_000_000]);
        scenario.deadline.end_to_end_ms = Some(5.0);
        scenario.node.guidance.deadline_ms = Some(1.5);
        assert_eq!(due(&scenario), [1_000_000, 1_500_000, 4_000_000, 5_000_000]);
        scenario.node.attitude_mpc.late = Some(Late::Degrade);
        assert_eq!([1, 2].map(|rank| scenario.deadline_of(rank).late), [Late::Send, Late::Degrade]);
    }
}
