//! A step allocates nothing, whatever becomes of the demand.

use contract::Scenario;
use contract::message::{Actuators, Controls, mixer_flags};
use contract::scenario::Profile;
use mixer::Mixer;

#[test]
fn a_step_allocates_nothing() {
    let mut mixer = Mixer::new(&Scenario::of(Profile::Robust));
    let cases = [
        ([0.1, 0.0, 0.0, 0.0], 0),
        ([-50.0, 1.0, -1.0, 5.0], mixer_flags::PROJECTED),
        ([0.0, 0.0, 5.0, 0.0], mixer_flags::PROJECTED),
        ([1e300, -1e300, 1e300, 0.0], mixer_flags::PROJECTED),
        ([f64::NAN, 0.0, 0.0, 0.0], mixer_flags::BAD_INPUT),
    ];
    for (demand, flags) in cases {
        let mut actuators = Actuators::default();
        let controls = Controls { demand, ..Controls::default() };
        let count = allocation_counter::measure(|| actuators = mixer.step(&controls));
        assert_eq!((actuators.flags, count.count_total), (flags, 0), "{demand:?}");
    }
}
