//! A step and a snapshot allocate nothing, also for a demand that is projected or not finite.

use contract::message::{Actuators, Controls, Stamp, State, mixer_flags};
use mixer::Mixer;
use runtime::node::Core;
use settings::{Profile, Scenario};

#[test]
fn a_step_allocates_nothing() {
    let mut mixer = Mixer::new(&Scenario::from(Profile::Robust));
    let cases = [
        ([0.1, 0.0, 0.0, 0.0], 0),
        ([-50.0, 1.0, -1.0, 5.0], mixer_flags::PROJECTED),
        ([0.0, 0.0, 5.0, 0.0], mixer_flags::PROJECTED),
        ([1e300, -1e300, 1e300, 0.0], mixer_flags::PROJECTED),
        ([f64::NAN, 0.0, 0.0, 0.0], mixer_flags::BAD_INPUT | mixer_flags::LEVELLED),
    ];
    for (tick, (demand, flags)) in (1..).map(|n| 10 * n).zip(cases) {
        let mut actuators = Actuators::default();
        let stamp = Stamp { tick, sequence: tick, ..Stamp::default() };
        let (controls, state) =
            (Controls { stamp, demand, ..Controls::default() }, State { stamp, ..State::default() });
        let count = allocation_counter::measure(|| actuators = mixer.step(tick, &controls, &state));
        assert_eq!((actuators.flags, count.count_total), (flags, 0), "{demand:?}");
        let count = allocation_counter::measure(|| {
            std::hint::black_box(mixer.snapshot());
        });
        assert_eq!(count.count_total, 0);
    }
}
