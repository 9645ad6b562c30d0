//! Observers: processes that read a flying stack and never delay it.

use flight::event::What;
use flight::log::Record;
use flight::observer::{Look, OBSERVERS, Observer, Seen};

use crate::control::{flying, status, tell};
use crate::harness::{Flight, PATIENT, namespace, shared_memory_of, wait_until};

/// Joins as soon as the stack can be joined.
fn join(namespace: &str) -> Observer {
    let mut joined = None;
    wait_until("an observer joins", || {
        joined = Observer::join(namespace).ok();
        joined.is_some()
    });
    joined.expect("it has joined")
}

#[test]
fn an_observer_sees_every_message_every_event_and_the_end() {
    let ns = namespace();
    let flight = Flight::start(&ns, &["--no-log", "--set", "run.duration_s=15.0", "--set", PATIENT]);
    let mut observer = join(&ns);
    assert_eq!(observer.scenario().run.duration_s, 15.0);
    let (mut ticks, mut states, mut events) = ([const { vec![] }; Record::KINDS], vec![], vec![]);
    let (mut is_injected, mut end) = (false, Look::Flying(0));
    wait_until("the flight ends", || {
        end = observer.look(|seen| match seen {
            Seen::Message(record) => {
                ticks[record.kind()].push(record.tick());
                if let Record::State(state) = record {
                    states.push(state.stamp.sequence);
                }
            }
            Seen::Event(event) => events.push(event.clone()),
        });
        if !is_injected && ticks[0].len() > 20 {
            tell(&ns, &["inject", "payload", "mass", "--for", "0.2s"]).expect("it flies");
            is_injected = true;
        }
        !matches!(end, Look::Flying(_))
    });
    assert_eq!(end, Look::Ended);
    drop(observer);
    assert_eq!(flight.finish().code(), Some(0));
    let first = states[0]; // the first of the flight, unless the machine was busy
    assert!(first < 1250 && states == (first..first + states.len() as u64).collect::<Vec<u64>>(), "{states:?}");
    assert!(ticks[0].last() >= Some(&1500), "{:?}", ticks[0]);
    for of_topic in &ticks {
        assert!(!of_topic.is_empty() && of_topic.is_sorted(), "{of_topic:?}");
    }
    let injected: Vec<_> = events.iter().filter(|event| event.event.what == What::Injected).collect();
    assert!(injected.len() == 1 && injected[0].event.node == "payload" && injected[0].at_s > 0.1, "{events:?}");
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn an_observer_that_does_not_look_costs_the_flight_nothing_and_is_told_of_the_end() {
    let ns = namespace();
    let flight = flying(&ns, &["--mode", "lockstep", "--set", "run.duration_s=86400.0"]);
    let mut observer = join(&ns);
    let begun_s = status(&ns)["time_s"].as_f64().expect("it flies");
    wait_until("a minute has passed", || status(&ns)["time_s"].as_f64() > Some(begun_s + 60.0));
    tell(&ns, &["stop"]).expect("it ends");
    let outcome = flight.finish();
    assert_eq!(outcome.code(), Some(130), "{}", outcome.stderr);
    let mut seen = vec![];
    while let Look::Flying(_) = observer.look(|message| {
        if let Seen::Message(record) = message {
            seen.push(record.tick());
        }
    }) {}
    assert!(!seen.is_empty() && seen.len() < Record::KINDS * 6000, "the newest are left: {}", seen.len());
    drop(observer);
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new(), "what it left after the flight is gone with it");
}

#[test]
fn a_flight_takes_a_few_observers_and_a_place_is_free_when_one_leaves() {
    let ns = namespace();
    assert!(Observer::join(&ns).is_err(), "nothing flies");
    let flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let mut all: Vec<Observer> = (0..OBSERVERS).map(|_| join(&ns)).collect();
    let refused = Observer::join(&ns).err().expect("one too many").to_string();
    assert!(refused.contains("has 4 observers already"), "{refused}");
    all.pop();
    all.push(join(&ns));
    // A node can be replaced while observers look.
    tell(&ns, &["inject", "mixer", "kill"]).expect("it flies");
    let mut epochs = vec![];
    wait_until("the next mixer is heard", || {
        all[0].look(|seen| {
            if let Seen::Message(Record::Actuators(actuators)) = seen {
                epochs.push(actuators.stamp.epoch);
            }
        });
        epochs.iter().any(|epoch| *epoch > 1)
    });
    drop(all);
    tell(&ns, &["stop"]).expect("it ends");
    assert_eq!(flight.finish().code(), Some(130));
    assert_eq!(shared_memory_of(&ns), Vec::<String>::new());
}

#[test]
fn the_death_of_the_launcher_is_an_end_too() {
    let ns = namespace();
    let mut flight = flying(&ns, &["--set", "run.duration_s=3600.0"]);
    let mut observer = join(&ns);
    flight.child.kill().expect("it runs");
    flight.child.wait().expect("it has ended");
    wait_until("the observer notices", || observer.look(|_| ()) == Look::Lost);
    drop(observer);
    wait_until("the run's folder is gone", || shared_memory_of(&ns).is_empty());
}
