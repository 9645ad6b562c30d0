//! Heading commands: each turns the short way, at a limited rate.
//!
//! The paper's heading is constant. A step of 90 degrees would turn the vehicle at 8.4 rad/s, where (51) allows 6.28.
//! With `guidance.heading_rate_limit_dps` the reference turns at that rate instead of stepping.

use airframe::angle;
use contract::scenario::{Heading, Scenario};

/// Heading reference over time.
#[derive(Debug, Clone)]
pub struct HeadingCommand {
    turns: Vec<Turn>,
    /// Rate of all turns \[rad/s\]; 0 makes the heading step.
    rate_radps: f64,
}

/// Turn that begins at `from_s`, goes through the angle `by_rad` and ends at the heading `to_rad`.
#[derive(Debug, Clone, Copy)]
struct Turn {
    from_s: f64,
    by_rad: f64,
    to_rad: f64,
}

impl HeadingCommand {
    /// Builds the headings of `scenario`. The first turn begins at the vehicle's initial heading.
    pub fn new(scenario: &Scenario) -> Self {
        let steps = match &scenario.mission.heading_deg {
            Heading::Constant(deg) => vec![(0.0, *deg)],
            Heading::Steps(steps) => [&[(0.0, 0.0)], steps.as_slice()].concat(),
        };
        let start_rad = scenario.initial.attitude_deg[2].to_radians();
        let first = Turn { from_s: 0.0, by_rad: 0.0, to_rad: start_rad };
        let mut command =
            Self { turns: vec![first], rate_radps: scenario.guidance.heading_rate_limit_dps.to_radians() };
        for (from_s, deg) in steps {
            let to_rad = deg.to_radians();
            let by_rad = angle::difference(to_rad, command.at(from_s));
            command.turns.push(Turn { from_s, by_rad, to_rad });
        }
        command
    }

    /// Heading reference at `t_s`, in (-pi, pi] \[rad\].
    pub fn at(&self, t_s: f64) -> f64 {
        let begun = self.turns.iter().rev().find(|turn| turn.from_s <= t_s).unwrap_or(&self.turns[0]);
        let Turn { from_s, by_rad, to_rad } = *begun;
        let left_rad = by_rad.abs() - self.rate_radps * (t_s - from_s);
        let turning = self.rate_radps > 0.0 && left_rad > 0.0;
        angle::wrapped(if turning { to_rad - left_rad.copysign(by_rad) } else { to_rad })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(steps: &[(f64, f64)], limit_dps: f64) -> impl Fn(f64) -> f64 {
        let mut scenario = Scenario::default();
        scenario.mission.heading_deg = Heading::Steps(steps.to_vec());
        scenario.guidance.heading_rate_limit_dps = limit_dps;
        let command = HeadingCommand::new(&scenario);
        move |t_s| command.at(t_s).to_degrees()
    }

    #[test]
    fn without_a_limit_headings_step() {
        let at = command(&[(1.0, 90.0), (2.0, 180.0)], 0.0);
        let degrees = [0.0, 0.99, 1.0, 1.99, 2.0, 60.0].map(at);
        assert_eq!(degrees, [0.0, 0.0, 90.0, 90.0, 180.0, 180.0]);
    }

    #[test]
    fn with_a_limit_turns_have_that_rate_and_may_interrupt_one_another() {
        let at = command(&[(1.0, 90.0), (1.5, -90.0)], 90.0);
        for (t_s, deg) in [(0.9, 0.0), (1.2, 18.0), (1.5, 45.0), (2.0, 0.0), (2.5, -45.0), (3.0, -90.0), (9.0, -90.0)] {
            assert!((at(t_s) - deg).abs() < 1e-9, "{} and not {deg} at {t_s} s", at(t_s));
        }
    }

    #[test]
    fn from_170_to_minus_170_is_20_degrees() {
        let at = command(&[(0.0, 170.0), (20.0, -170.0)], 10.0);
        for (t_s, deg) in [(20.5, 175.0), (21.5, -175.0), (22.0, -170.0)] {
            assert!((at(t_s) - deg).abs() < 1e-9, "{} and not {deg} at {t_s} s", at(t_s));
        }
    }

    #[test]
    fn the_first_turn_begins_where_the_vehicle_stands() {
        let mut scenario = Scenario::default();
        scenario.initial.attitude_deg[2] = 180.0;
        scenario.mission.heading_deg = Heading::Constant(180.0);
        scenario.guidance.heading_rate_limit_dps = 90.0;
        let command = HeadingCommand::new(&scenario);
        assert!([0.0, 0.1, 5.0].iter().all(|t_s| (command.at(*t_s).to_degrees() - 180.0).abs() < 1e-9));
    }
}
