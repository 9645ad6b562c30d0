//! Battery: the voltage falls with the power drawn and with the energy used, and the speed that a command reaches falls
//! with the voltage.
//!
//! ```text
//! v = 1 - droop E / energy - sag P / P_hover        share of the full voltage
//! Omega_reached = v Omega_commanded
//! ```
//!
//! The controller of a brushless motor sets a voltage, and the speed follows the voltage (Quan, *Introduction to
//! Multicopter Design and Control*, 2017, chapter 4). `P = sum K_M Omega^3` is the power at the shafts, with the rotor
//! speed unit as rad/s (see [`airframe::parameters`]), and `E` its integral.

use airframe::Trim;
use contract::actuation::Actuation;
use settings::Scenario;

use crate::memory::Tape;

/// Battery of one flight.
#[derive(Debug, Clone)]
pub struct Battery {
    energy_j: f64,
    droop: f64,
    sag: f64,
    hover_w: f64,
    km: f64,
    used_j: f64,
}

impl Battery {
    /// Builds the full battery of `scenario`; `None` if the scenario has no battery.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let settings = &scenario.plant.battery;
        let km = scenario.flown_airframe().km;
        let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction).actuation;
        (settings.energy_wh > 0.0).then(|| Self {
            energy_j: settings.energy_wh * 3600.0,
            droop: settings.droop,
            sag: settings.sag,
            hover_w: power_w(km, &trim),
            km,
            used_j: 0.0,
        })
    }

    /// Writes or reads the used energy.
    pub fn remember(&mut self, tape: &mut Tape) {
        tape.value(&mut self.used_j);
    }

    /// Scales `command` by the voltage for the next `dt_s`, and draws the power of the rotor speeds in `position`.
    pub fn drive(&mut self, command: &Actuation, position: &Actuation, dt_s: f64) -> Actuation {
        let power_w = power_w(self.km, position);
        let used = (self.used_j / self.energy_j).min(1.0);
        let voltage = (1.0 - self.droop * used - self.sag * power_w / self.hover_w).max(0.0);
        self.used_j += power_w * dt_s;
        Actuation { rotor_speed: command.rotor_speed.map(|omega| voltage * omega), ..*command }
    }
}

/// Power at the shafts \[W\].
fn power_w(km: f64, position: &Actuation) -> f64 {
    position.rotor_speed.iter().map(|omega| km * omega * omega * omega).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_voltage_falls_with_the_load_and_with_what_was_used() {
        let mut scenario = Scenario::default();
        assert!(Battery::new(&scenario).is_none());
        scenario.plant.battery.energy_wh = 10.0;
        let hover = Trim::solve(&scenario.airframe, false).actuation;
        let mut battery = Battery::new(&scenario).unwrap();
        let reached =
            |battery: &mut Battery, dt_s| battery.drive(&hover, &hover, dt_s).rotor_speed[0] / hover.rotor_speed[0];
        let (droop, sag) = (scenario.plant.battery.droop, scenario.plant.battery.sag);
        assert!((reached(&mut battery, 1.0) - (1.0 - sag)).abs() < 1e-12, "full, at hover");
        let used = battery.hover_w / 36_000.0;
        assert!((reached(&mut battery, 1e9) - (1.0 - sag - droop * used)).abs() < 1e-12, "after a second");
        assert!((reached(&mut battery, 1.0) - (1.0 - sag - droop)).abs() < 1e-12, "empty");
        let still = Actuation { rotor_speed: [0.0; 3], ..hover };
        let idle = Battery::new(&scenario).unwrap().drive(&hover, &still, 1.0);
        assert_eq!(idle.rotor_speed, hover.rotor_speed, "without load");
    }
}
