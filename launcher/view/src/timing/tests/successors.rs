//! Several processes of one node, after one another and side by side.

use contract::stamp::delivery;

use super::*;

#[test]
fn counters_begin_anew_with_another_incarnation() {
    let mut ring = Ring::new();
    ring.now_us = 3 * PERIOD_US;
    ring.cycle(Topic::Actuators, 3, 20, 100, 3);
    ring.send(Topic::Actuators, Stamp { tick: 4, epoch: 2, sequence: 1, misses: 1, slips: 1, ..Stamp::default() });
    assert_eq!((ring.node("mixer")["slips"].as_u64(), ring.timing.misses()), (Some(4), 4));
}

#[test]
fn what_is_missed_in_the_shadow_is_no_miss_of_the_flight() {
    let mut ring = Ring::new();
    let mut say = |tick: u64, epoch, delivery, slips| {
        let sample_ns = (EPOCH_US + tick * PERIOD_US) * US;
        let (start_ns, release_ns) = (sample_ns, sample_ns);
        let mut stamp = Stamp { tick, sample_ns, epoch, delivery, release_ns, start_ns, slips, ..Stamp::default() };
        (stamp.sequence, stamp.misses) = (tick + 1, slips);
        stamp.publish_ns[Topic::Actuators as usize] = sample_ns + 100 * US;
        ring.send(Topic::Actuators, stamp);
    };
    for tick in 0..4 {
        say(tick, 1, delivery::DELIVERED, 0);
        say(tick, 2, delivery::STANDBY, 3 * tick);
    }
    for tick in 4..8 {
        say(tick, 2, delivery::DELIVERED, 10); // one more than on standby
        say(tick, 1, delivery::STANDBY, tick);
    }
    say(8, 1, delivery::DELIVERED, 7); // has it back
    let mixer = ring.node("mixer");
    assert_eq!(["slips", "misses"].map(|key| mixer[key].as_u64().unwrap()), [1, 1]);
    assert_eq!((&mixer["response"]["n"], &mixer["response_per_slot"]["n"]), (&9.into(), &10.into()));
    assert_eq!(mixer["cpu"]["n"], 2 + 3, "of cycles active, but for the first and the last of each time");
    assert_eq!((&ring.worst()["tick"], &ring.worst()["late_us"]), (&4.into(), &10_100.0.into()));
}
