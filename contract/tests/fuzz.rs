//! Fuzzing of the guard: no bytes make it panic; accepted messages are intact, plausible and from the active process.
//!
//! `PROPTEST_CASES=100000 cargo test -p contract --test fuzz` runs longer, in the dev profile, where overflow panics.

use contract::guard::Guard;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};
use proptest::prelude::*;

/// Change of a message's bytes before it arrives.
#[derive(Debug, Clone)]
enum Forgery {
    /// Replaces the whole message by these bytes.
    Bytes(Vec<u8>),
    /// Replaces all but the stamp by these bytes, and makes the checksum fit: only implausible numbers can be refused.
    Sealed(Vec<u8>),
    /// Replaces some words of a good message.
    Words(Vec<(usize, u64)>),
    /// Flips some bits of a good message.
    Bits(Vec<usize>),
    /// Replaces the end of a good message by the end of an older one.
    Torn(usize),
}

/// Generates enough bytes for any message, with many numbers that are not finite or far out of range.
fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e7, 0.0, 0.5, 5e-324].map(f64::to_bits);
    let any_word = prop_oneof![any::<u64>(), proptest::sample::select(odd.to_vec())].boxed();
    let mostly_good = prop_oneof![60 => Just(0.1_f64.to_bits()), 1 => any_word.clone()].boxed();
    let words = |word| proptest::collection::vec(word, size_of::<State>() / 8);
    prop_oneof![words(any_word), words(mostly_good)].prop_map(|words| bytemuck::cast_slice(&words).to_vec())
}

fn forgery() -> impl Strategy<Value = Forgery> {
    let words = size_of::<State>() / 8;
    prop_oneof![
        bytes().prop_map(Forgery::Bytes),
        bytes().prop_map(Forgery::Sealed),
        proptest::collection::vec((0..words, any::<u64>()), 1..4).prop_map(Forgery::Words),
        proptest::collection::vec(0..words * 64, 1..9).prop_map(Forgery::Bits),
        (0..words * 8).prop_map(Forgery::Torn),
    ]
}

impl Forgery {
    /// Returns the message that arrives in place of `good`.
    fn of<M: Message>(&self, good: &M, older: &M) -> M {
        let mut message = *good;
        let size = size_of::<M>();
        let bytes = bytemuck::bytes_of_mut(&mut message);
        match self {
            Self::Bytes(forged) => bytes.copy_from_slice(&forged[..size]),
            Self::Sealed(forged) => {
                bytes.copy_from_slice(&forged[..size]);
                *message.stamp_mut() = *good.stamp();
                return message.with_checksum();
            }
            Self::Words(words) => {
                for (place, word) in words {
                    let at = place * 8 % size;
                    bytes[at..at + 8].copy_from_slice(&word.to_ne_bytes());
                }
            }
            Self::Bits(places) => places.iter().for_each(|place| bytes[place / 8 % size] ^= 1 << (place % 8)),
            Self::Torn(at) => bytes[at % size..].copy_from_slice(&bytemuck::bytes_of(older)[at % size..]),
        }
        message
    }
}

/// Passes `forgeries` of a message to a guard, one by one. Receivers compute with the `numbers` of a message.
fn check<M: Message>(forgeries: &[Forgery], numbers: impl Fn(&M) -> Vec<f64>) {
    let at = |tick: u64| {
        let mut good = M::default();
        *good.stamp_mut() = Stamp { tick, sequence: tick + 1, epoch: 3, ..Stamp::default() };
        good.with_checksum()
    };
    let mut guard = Guard::default();
    for (tick, forgery) in (1..).zip(forgeries) {
        let (good, older, before) = (at(tick), at(tick - 1), *guard.newest());
        let message = forgery.of(&good, &older);
        let taken = guard.take(&message, 3, tick + 1).is_ok();
        let newest = if taken { message } else { before };
        assert_eq!(bytemuck::bytes_of(guard.newest()), bytemuck::bytes_of(&newest), "taken: {taken}");
        if taken {
            assert!(message.is_intact() && message.stamp().epoch == 3);
            assert!(numbers(&message).into_iter().all(|number| number.abs() <= 1e6), "{message:?}");
        }
        if !matches!(forgery, Forgery::Sealed(_)) {
            let is = |sent: &M| bytemuck::bytes_of(&message) == bytemuck::bytes_of(sent);
            assert!(taken || !is(&good), "{message:?}");
            assert!(!taken || is(&good) || is(&older), "{message:?}");
        }
        assert!(guard.take(&message, 0, tick + 1).is_err(), "no process is active");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn states(forgeries in proptest::collection::vec(forgery(), 1..6)) {
        check::<State>(&forgeries, |state| {
            let command = state.command_in_force;
            let places = [state.measured.position_m, state.measured.velocity_mps].concat();
            // A NaN position or velocity means that the sensor is off, which the nodes handle.
            let places = places.into_iter().filter(|number| !number.is_nan());
            let turned = [state.measured.attitude_rad, state.measured.rates_radps, command.rotor_speed].concat();
            places.chain(turned).chain([command.tilt_rad]).collect()
        });
    }

    #[test]
    fn references(forgeries in proptest::collection::vec(forgery(), 1..6)) {
        check::<Reference>(&forgeries, |reference| {
            [&reference.attitude_rad[..], &reference.rates_radps, &[reference.w_mps]].concat()
        });
    }

    #[test]
    fn controls(forgeries in proptest::collection::vec(forgery(), 1..6)) {
        check::<Controls>(&forgeries, |controls| controls.demand.to_vec());
    }

    #[test]
    fn actuators(forgeries in proptest::collection::vec(forgery(), 1..6)) {
        check::<Actuators>(&forgeries, |actuators| {
            [&actuators.command.rotor_speed[..], &[actuators.command.tilt_rad]].concat()
        });
    }
}
