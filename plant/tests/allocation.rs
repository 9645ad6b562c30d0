//! Test that a flight allocates nothing, with any fault.

use contract::message::{Actuators, Stamp};
use plant::Plant;
use settings::{Fault, FaultTarget, Scenario, SensorPreset, SensorsSettings};

#[test]
fn a_flight_with_every_fault_allocates_nothing() {
    use FaultTarget as T;
    let targets = [
        T::Position,
        T::Velocity,
        T::Attitude,
        T::Rates,
        T::Acceleration,
        T::Height,
        T::Flow,
        T::Rotor1,
        T::Rotor2,
        T::Rotor3,
        T::Tilt,
        T::Wind,
        T::Payload,
    ];
    let fault = |target: &T, kind| Fault::new(*target, kind, 0.1, Some(0.3));
    let faults = targets.iter().flat_map(|t| t.kinds().iter().map(|kind| fault(t, *kind)));
    let mut scenario = Scenario { fault: faults.collect(), ..Scenario::default() };
    scenario.plant.noise.position_m = 0.01;
    scenario.run.command_delay_ms = 35.0;
    let given = std::mem::take(&mut scenario.fault);
    for (live, preset) in [(false, SensorPreset::Ideal), (true, SensorPreset::Ideal), (false, SensorPreset::Typical)] {
        scenario.fault = if live { vec![] } else { given.clone() };
        scenario.plant.sensors = SensorsSettings::from(preset);
        check_allocates_nothing(&scenario, if live { &given } else { &[] });
    }
}

/// Asserts that a flight of `scenario` with the faults `given` in flight allocates nothing.
fn check_allocates_nothing(scenario: &Scenario, given: &[Fault]) {
    let mut plant = Plant::new(scenario);
    let command = plant.sample().command_in_force;
    let count = allocation_counter::measure(|| {
        for sequence in 1..=50 {
            given.iter().enumerate().for_each(|(number, fault)| plant.apply_fault(number, fault));
            plant.command(&Actuators { stamp: Stamp { sequence, ..Stamp::default() }, command, flags: 0 }, 0);
            plant.advance(1).expect("the tricopter never fails");
            plant.sample();
        }
    });
    assert_eq!(count.count_total, 0);
    assert_eq!(plant.sample().stamp.tick, 50);
}
