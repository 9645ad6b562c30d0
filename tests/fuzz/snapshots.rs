//! Memories with wrong words are refused or accepted, and the next steps do not panic.

use attitude_mpc::AttitudeMpc;
use contract::integrity::checksum_of;
use contract::message::{Controls, Message, Reference, Stamp, State};
use contract::snapshot::{SNAPSHOT_WORDS, Snapshot};
use guidance::Guidance;
use mixer::Mixer;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use runtime::node::Core;
use settings::{Law, Profile, Scenario};

use super::cases;

/// The MPC without constraints and with them, and the laws `pid`, `geometric` and `indi`.
fn scenario() -> impl Strategy<Value = Scenario> {
    let of = |profile, law| {
        let mut scenario = Scenario::from(profile);
        scenario.attitude.law = law;
        scenario
    };
    let robust = [Law::Mpc, Law::Pid, Law::Geometric, Law::Indi].map(|law| of(Profile::Robust, law));
    select([&robust[..], &[of(Profile::Paper, Law::Mpc)]].concat())
}

/// Words and their places in a snapshot: any bits, small counts, numbers of any size.
fn words() -> impl Strategy<Value = Vec<(usize, u64)>> {
    let word = prop_oneof![any::<u64>(), 0..300_u64, any::<f64>().prop_map(f64::to_bits), Just(1e300_f64.to_bits())];
    vec((0..SNAPSHOT_WORDS, word), 0..20)
}

/// Returns `snapshot` with these words, and with a new checksum unless the checksum itself was forged.
fn forged(mut snapshot: Snapshot, words: &[(usize, u64)]) -> Snapshot {
    for (place, word) in words {
        snapshot[*place] = *word;
    }
    if words.iter().all(|(place, _)| *place != 1) {
        snapshot[1] = 0;
        snapshot[1] = checksum_of(&snapshot);
    }
    snapshot
}

/// Returns a valid message of `tick`.
fn at<M: Message>(tick: u64) -> M {
    let mut message = M::default();
    *message.stamp_mut() = Stamp { tick, sequence: 1, epoch: 1, ..Stamp::default() };
    message
}

proptest! {
    #![proptest_config(cases(48))]

    #[test]
    fn a_forged_memory_is_refused_or_flown_on(
        scenario in scenario(),
        words in words(),
        ticks in vec(prop_oneof![0..300_u64, any::<u64>()], 1..4),
    ) {
        let mut guidance = Guidance::new(&scenario);
        let mut mpc = AttitudeMpc::new(&scenario);
        let mut mixer = Mixer::new(&scenario);
        // Three steps give the nodes the memories of a vehicle under way.
        for tick in 0..3 {
            guidance.step(tick, &at(tick));
            mpc.step(tick, &at(tick), &at(tick));
            mixer.step(tick, &at(tick), &at(tick));
        }
        let _ = guidance.restore(&forged(guidance.snapshot(), &words));
        let _ = mpc.restore(&forged(mpc.snapshot(), &words));
        let _ = mixer.restore(&forged(mixer.snapshot(), &words));
        for tick in ticks {
            let (state, reference, controls): (State, Reference, Controls) = (at(tick), at(tick), at(tick));
            guidance.step(tick, &state);
            mpc.step(tick, &state, &reference);
            mixer.step(tick, &controls, &state);
            // Snapshots can be taken whatever the state.
            let _ = (guidance.snapshot(), mpc.snapshot(), mixer.snapshot());
        }
    }
}
