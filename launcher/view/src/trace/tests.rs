//! Which ticks are traced, and when commands acted. The trace itself is read back in the integration tests.

use super::*;
use contract::Topic;
use contract::message::{Actuators, Message, Stamp, State};

fn command(tick: u64, sequence: u64) -> Actuators {
    let stamp = Stamp { tick, sample_ns: tick * 1_000, sequence, epoch: 1, ..Stamp::default() };
    Actuators { stamp: stamp.published(Topic::Actuators, sequence, tick * 1_000 + 100), ..Actuators::default() }
        .with_checksum()
}

fn state(tick: u64, applied_sequence: u64, applied_age_ns: u64) -> State {
    let stamp = Stamp { tick, sample_ns: tick * 1_000, sequence: tick + 1, epoch: 1, ..Stamp::default() };
    State { stamp, applied_sequence, applied_age_ns, ..State::default() }.with_checksum()
}

#[test]
fn a_command_acts_until_the_next_one() {
    let log = Log {
        states: vec![state(0, 0, 0), state(1, 1, 300), state(2, 1, 300), state(3, 3, 400)],
        actuators: (0..3).map(|tick| command(tick, tick + 1)).collect(),
        ..Log::default()
    };
    let spans = |mode| -> Vec<(u64, u64, u64)> {
        let commands = in_force(&logged(&log, &Scenario::default()), mode);
        commands.iter().map(|command| (command.tick, command.from_ns, command.until_ns)).collect()
    };
    assert_eq!(spans(Mode::Realtime), [(0, 300, 2_400), (2, 2_400, 3_000)]);
    assert_eq!(spans(Mode::Lockstep), [(0, 100, 2_100), (2, 2_100, 3_000)], "on the wall clock");
}

fn window(from_s: f64, for_s: f64) -> Window {
    Window::new(from_s, for_s, 0.01)
}

#[test]
fn a_window_takes_the_ticks_that_begin_in_it() {
    assert_eq!(window(0.5, 0.1).ticks(1_000), 50..60);
    assert_eq!(window(0.501, 0.1).ticks(1_000), 51..61);
    assert_eq!(window(-1.0, 1.05).ticks(1_000), 0..5);
    assert_eq!(window(9.95, 1.0).ticks(1_000), 995..1_000);
    for (from_s, for_s) in [(70.0, 1.0), (1.0, 0.0), (1.0, -5.0), (f64::NAN, 1.0), (f64::INFINITY, 1.0)] {
        assert!(window(from_s, for_s).ticks(1_000).is_empty(), "{from_s} {for_s}");
    }
}

#[test]
fn the_worst_tick_is_that_of_the_summary() {
    let run =
        |tick: u64| json!({ "timing": { "worst_ticks": [{ "tick": tick, "late_us": 9_830.0, "in_words": "why" }] } });
    let window = Window::around_worst(&run(300), 1.0, 0.01);
    assert_eq!(window.ticks(500), 250..350);
    assert!(window.why.contains("the worst tick, 300: 9.83 ms late; why"), "{}", window.why);
    assert_eq!(Window::around_worst(&run(30), 1.0, 0.01).ticks(500), 0..100, "no window begins before the flight");
    assert_eq!(Window::around_worst(&Value::Null, 2.0, 0.01).ticks(500), 0..200);
}
