//! Vehicle and settings for a node in another language.

use std::ffi::CString;

use airframe::{Parameters, Trim};
use contract::topic::Topic;
use plant::vehicle::start;
use settings::Scenario;

use crate::abi::TrefoilSetup;

/// [`TrefoilSetup`] with the text that it points to.
pub struct Setup {
    given: TrefoilSetup,
    _settings: CString,
}

impl Setup {
    /// Makes the setup of the node that publishes `topic`.
    ///
    /// # Errors
    /// The settings of the node have no form in JSON.
    pub fn new(scenario: &Scenario, topic: Topic) -> Result<Self, String> {
        let settings = serde_json::to_string(&scenario.node.of(topic).settings).map_err(|error| error.to_string())?;
        let settings = CString::new(settings).map_err(|error| error.to_string())?;
        let Parameters { g_mps2, mass_kg, ixx_kgm2, iyy_kgm2, izz_kgm2, l1_m, l2_m, l3_m, kf, km, .. } =
            scenario.airframe;
        let trim = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction);
        let (start, _) = start(scenario);
        let given = TrefoilSetup {
            settings_json: settings.as_ptr(),
            dt_s: scenario.sample_s(),
            g_mps2,
            mass_kg,
            inertia_kgm2: [ixx_kgm2, iyy_kgm2, izz_kgm2],
            arms_m: [l1_m, l2_m, l3_m],
            kf,
            km,
            trim_rotor_speed: trim.actuation.rotor_speed,
            trim_tilt_rad: trim.actuation.tilt_rad,
            trim_roll_rad: trim.roll_rad,
            start_position_m: start.position_m,
            start_velocity_mps: start.velocity_mps,
            start_attitude_rad: start.attitude_rad,
            start_rates_radps: start.rates_radps,
        };
        Ok(Self { given, _settings: settings })
    }

    /// Returns the pointer to give to a library or program; valid as long as `self`.
    pub fn as_ptr(&self) -> *const TrefoilSetup {
        &raw const self.given
    }
}
