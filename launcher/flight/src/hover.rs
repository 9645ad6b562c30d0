//! Hover of a scenario, and its control loops in small motions about the hover.
//!
//! The loops have no model of their own: the ring flies in process, as in every flight, with the control law, gains,
//! vehicle and rate of the scenario, and the numbers are read from how the vehicle moves. So one mechanism serves every
//! law. These flights hover far from every limit: without mission, wind, ground, battery, sensor errors and faults.
//! Together they take some 300 s of flight, 0.2 s of wall time at 100 Hz, and are not flown for a flight of a campaign.
//!
//! | module | holds |
//! |---|---|
//! | `small` | these flights |
//! | `held` | a node in the place of guidance that holds the references of the attitude loop |
//! | `decay` | the decay of a perturbation, and with it the margins of delay and lag |
//! | `response` | the response to a small step of a reference, and its bandwidth |

mod decay;
mod held;
mod response;
mod small;

use airframe::Trim;
use contract::Topic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{ProgramKind, Scenario};

pub use decay::Margin;
use decay::{attitude_decays, decays};
pub use response::{AttitudeBandwidths, PositionBandwidths};
use response::{attitude_bandwidths, position_bandwidths};

/// Largest delay that is tried for the delay margin \[ms\].
const MAX_DELAY_MS: f64 = 400.0;
/// Largest lag that is tried for the lag margin \[ms\].
const MAX_LAG_MS: f64 = 250.0;

/// Hover of the vehicle that flies, and the control loops in small motions about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Hover {
    /// Speeds of the rotors 1, 2, 3 \[rotor speed unit\], which is rad/s if the vehicle's constants are in rad/s.
    pub rotor_speed: [f64; 3],
    /// Tilt of rotor 1 \[deg\].
    pub tilt_deg: f64,
    /// Roll \[deg\].
    pub roll_deg: f64,
    /// Largest thrust over weight at which the moments vanish: a rotor has reached its largest speed.
    pub thrust_over_weight: f64,
    /// Control loops; null if a node is not the launcher's own (`node.*.exec`): then they are not computed.
    pub loops: Option<Loops>,
}

/// Control loops in small motions about the hover.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Loops {
    /// Bandwidths of the attitude loop; null if the loop is unstable.
    pub attitude: Option<AttitudeBandwidths>,
    /// Bandwidths of the position loop, which is around the attitude loop; null if the position loop is unstable.
    pub position: Option<PositionBandwidths>,
    /// Largest delay of the commands, `run.command_delay_ms`, at which the position loop is stable, to 1 ms; null if
    /// the loop is unstable as set.
    pub delay_margin: Option<Margin>,
    /// Largest lag of the rotors, `plant.rotor_lag_s`, at which the position loop is stable, to 1 ms: the model of the
    /// controller and the delay stay as they are set. Null if the loop is unstable as set.
    pub lag_margin: Option<Margin>,
}

impl Hover {
    /// Computes the hover of a scenario that was checked.
    pub fn of(scenario: &Scenario) -> Self {
        let Trim { roll_rad, actuation } = Trim::solve(&scenario.flown_airframe(), scenario.plant.tilt_reaction);
        let [_, thrust_over_weight] = scenario.limits().thrust_range(&actuation);
        let is_own = Topic::ALL.into_iter().all(|topic| scenario.node.of(topic).kind() == ProgramKind::Own);
        Self {
            rotor_speed: actuation.rotor_speed,
            tilt_deg: actuation.tilt_rad.to_degrees(),
            roll_deg: roll_rad.to_degrees(),
            thrust_over_weight,
            loops: is_own.then(|| Loops::of(&small::scenario(scenario))),
        }
    }

    /// Describes the hover for people: names and values.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let [one, two, three] = self.rotor_speed;
        let mut rows = vec![
            ("rotor speeds at hover", format!("{one:.1}, {two:.1}, {three:.1} rotor speed unit")),
            ("tilt at hover", format!("{:.2} deg", self.tilt_deg)),
            ("roll at hover", format!("{:.2} deg", self.roll_deg)),
            ("largest thrust over weight", format!("{:.2}", self.thrust_over_weight)),
        ];
        let loops = self.loops.as_ref().map_or(NOT_COMPUTED.map(str::to_owned), Loops::words);
        let names =
            ["attitude loop, bandwidths", "position loop, bandwidths", "delay margin", "lag margin of the rotors"];
        rows.extend(names.into_iter().zip(loops));
        rows
    }
}

/// Words in place of loops that were not computed.
const NOT_COMPUTED: [&str; 4] = ["not computed: a node is not the launcher's own (`node.*.exec`)"; 4];
/// Words in place of the numbers of an unstable loop.
const UNSTABLE: &str = "unstable";

impl Loops {
    /// Computes the loops of a scenario for [small motions](small::scenario).
    fn of(scenario: &Scenario) -> Self {
        let own_ms = [scenario.run.command_delay_ms, scenario.plant.rotor_lag_s * 1e3];
        let delayed = |ms| {
            let mut delayed = scenario.clone();
            delayed.run.command_delay_ms = ms;
            decays(&delayed, &delayed)
        };
        let lagging = |ms: f64| {
            let mut vehicle = scenario.clone();
            vehicle.plant.rotor_lag_s = ms * 1e-3;
            decays(scenario, &vehicle)
        };
        let is_stable = decays(scenario, scenario);
        Self {
            attitude: attitude_decays(scenario).then(|| attitude_bandwidths(scenario)),
            position: is_stable.then(|| position_bandwidths(scenario)),
            delay_margin: is_stable.then(|| Margin::search(own_ms[0], MAX_DELAY_MS, delayed)),
            lag_margin: is_stable.then(|| Margin::search(own_ms[1], MAX_LAG_MS, lagging)),
        }
    }

    /// Describes bandwidths and margins for people.
    fn words(&self) -> [String; 4] {
        let unstable = || UNSTABLE.to_owned();
        let bandwidths = |all: &[(&str, Option<f64>)]| {
            let one = |(name, radps): &(&str, Option<f64>)| match radps {
                Some(radps) => format!("{name} {radps:.2}"),
                None => format!("{name} none"),
            };
            all.iter().map(one).collect::<Vec<_>>().join(", ") + " rad/s"
        };
        let attitude = self.attitude.as_ref().map_or_else(unstable, |of| {
            bandwidths(&[("w", of.w_radps), ("phi", of.phi_radps), ("theta", of.theta_radps), ("psi", of.psi_radps)])
        });
        let position = self.position.as_ref().map_or_else(unstable, |of| {
            bandwidths(&[("north", of.north_radps), ("east", of.east_radps), ("down", of.down_radps)])
        });
        let margin = |of: &Option<Margin>| of.as_ref().map_or_else(unstable, Margin::words);
        [attitude, position, margin(&self.delay_margin), margin(&self.lag_margin)]
    }
}
