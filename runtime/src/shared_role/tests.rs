use super::*;

fn role() -> Box<SharedRole> {
    Box::default()
}

#[test]
fn a_place_that_is_offered_goes_to_one_process() {
    let role = role();
    assert!(!role.claim(1, 71), "no place was offered");
    role.offer(1);
    assert!(!role.claim(2, 72), "it is that of another epoch");
    assert!(role.claim(1, 71));
    assert!(!role.claim(1, 72), "it is taken");
    assert!(role.port(1) == 71);
    assert!(role.knows(71) && !role.knows(72));
}

#[test]
fn the_pending_epoch_is_active_when_the_next_tick_begins() {
    let role = role();
    role.activate_pending(7);
    assert_eq!(role.assignment(), Assignment::default(), "no epoch is named");
    role.offer(1);
    role.offer(2);
    role.assign(0, |_| Assignment { active: 1, standby: 0 });
    role.set_pending(2);
    assert!(role.assignment().includes(1) && !role.assignment().includes(2) && !role.assignment().includes(0));
    role.activate_pending(8);
    assert_eq!(role.assignment(), Assignment { active: 2, standby: 0 });
    assert_eq!((role.since(2).get(), role.done(2).get(), role.packed().pending), (8, 8, 0));
}

#[test]
fn standby_and_active_change_places_and_back() {
    let role = role();
    role.offer(1);
    role.offer(2);
    role.assign(0, |_| Assignment { active: 1, standby: 0 });
    role.done(1).set(20);
    role.assign(20, |assignment| Assignment { standby: 2, ..assignment });
    role.set_pending(2);
    role.activate_pending(30);
    assert_eq!(role.assignment(), Assignment { active: 2, standby: 1 });
    assert_eq!((role.since(1).get(), role.since(2).get()), (0, 20), "one that worked before goes on where it is");
    role.set_pending(1);
    role.activate_pending(40);
    assert_eq!(role.assignment(), Assignment { active: 1, standby: 2 });
    role.assign(41, |assignment| assignment.without(2));
    assert_eq!(role.assignment().epochs().collect::<Vec<_>>(), [1]);
}

#[test]
fn simultaneous_changes_by_launcher_and_plant_are_serialised() {
    const ROUNDS: u32 = 5_000;
    let role = role();
    let mut lost = vec![];
    let (begun, done) = (AtomicU32::new(0), AtomicU32::new(0));
    let wait_for = |count: &AtomicU32, round| {
        let is_behind = |_| {
            std::hint::spin_loop();
            count.load(Ordering::Acquire) < round
        };
        while (0..10_000).all(is_behind) {
            std::thread::yield_now();
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for round in 1..=ROUNDS {
                wait_for(&begun, round);
                role.activate_pending(8);
                done.store(round, Ordering::Release);
            }
        });
        for round in 1..=ROUNDS {
            role.assign(0, |_| Assignment { active: 1, standby: 2 * (round % 2) });
            role.set_pending(2);
            begun.store(round, Ordering::Release);
            (0..round % 512).for_each(|_| std::hint::spin_loop());
            role.dismiss(2);
            wait_for(&done, round);
            let (assignment, pending) = (role.assignment(), role.packed().pending);
            let dismissed_is_gone = !assignment.includes(2) && pending != 2;
            let other_stays = round % 2 == 0 || assignment.active == 1 || pending == 1;
            if !(dismissed_is_gone && other_stays) {
                lost.push((round, assignment, pending));
            }
        }
    });
    assert_eq!(lost, []);
}

#[test]
fn an_epoch_that_is_dismissed_leaves_the_role_to_its_standby() {
    let role = role();
    role.assign(0, |_| Assignment { active: 1, standby: 0 });
    role.set_pending(2);
    role.dismiss(2);
    assert_eq!((role.assignment(), role.packed().pending), (Assignment { active: 1, standby: 0 }, 0));
    role.assign(0, |assignment| Assignment { standby: 2, ..assignment });
    role.dismiss(1);
    assert_eq!((role.assignment(), role.packed().pending), (Assignment { active: 0, standby: 2 }, 2));
    role.activate_pending(9);
    role.dismiss(2);
    assert_eq!((role.assignment(), role.packed().pending), (Assignment::default(), 0));
}

#[test]
fn a_snapshot_is_read_whole() {
    let cell = &role().memory;
    let origin = |i| Origin { epoch: i, done: i };
    assert_eq!(cell.read(), None, "nothing was written yet");
    std::thread::scope(|scope| {
        scope.spawn(|| (1..=200_000).for_each(|i| cell.write(origin(i), &[i; SNAPSHOT_WORDS])));
        for _ in 0..100_000 {
            if let Some((of, snapshot)) = cell.read() {
                assert!(of == origin(snapshot[0]), "torn: {of:?} and {snapshot:?}");
                assert!(snapshot.iter().all(|word| *word == snapshot[0]), "torn: {snapshot:?}");
            }
        }
    });
    assert_eq!(cell.read(), Some((origin(200_000), vec![200_000; SNAPSHOT_WORDS])));
}

#[test]
fn an_epoch_that_works_keeps_its_slot_whatever_is_offered() {
    let role = role();
    role.assign(0, |_| Assignment { active: 1, standby: 0 });
    role.offer(1);
    role.done(1).set(7);
    for epoch in 2..20 {
        role.offer(epoch);
        role.sent(epoch).count();
        assert_eq!((role.done(1).get(), role.sent(epoch).get(), role.done(epoch).get()), (7, 1, 0));
    }
    role.assign(9, |assignment| Assignment { standby: 19, ..assignment });
    role.set_pending(18);
    role.offer(20);
    role.offer(21);
    let counted = [1, 18, 19, 21].map(|epoch| (role.done(epoch).get(), role.sent(epoch).get()));
    assert_eq!(counted, [(7, 0), (0, 1), (9, 1), (0, 0)]);
}

#[test]
fn an_epoch_that_has_no_slot_any_more_changes_the_counts_of_no_other() {
    let role = role();
    (1..=6).for_each(|epoch| role.offer(epoch));
    role.done(1).set(99);
    role.sent(2).count();
    let counted = [3, 4, 5, 6].map(|epoch| (role.done(epoch).get(), role.sent(epoch).get()));
    assert_eq!(counted, [(0, 0); 4]);
}

proptest::proptest! {
    /// Checks that active, standby, pending and the newest offered epoch always have slots of their own.
    #[test]
    fn epochs_that_work_or_are_about_to_count_apart(steps in proptest::collection::vec((0..4_u8, 0..3_u32), 1..60)) {
        let role = role();
        let mut newest = 1_u32;
        role.offer(1);
        role.assign(0, |_| Assignment { active: 1, standby: 0 });
        for (step, back) in steps {
            let offered = newest.saturating_sub(back).max(1);
            let known = |epoch: u32| role.slots.iter().any(|slot| slot.epoch.get() == epoch);
            match step {
                0 => {
                    newest += 1;
                    role.offer(newest);
                }
                1 if known(offered) => role.assign(5, |assignment| Assignment { standby: offered, ..assignment }),
                2 if known(offered) => role.set_pending(offered),
                _ => role.activate_pending(6),
            }
            let PackedAssignment { assignment, pending } = role.packed();
            let working = assignment.epochs().chain([pending, newest].into_iter().filter(|epoch| *epoch != 0));
            for epoch in working {
                let slots = role.slots.iter().filter(|slot| slot.epoch.get() == epoch).count();
                proptest::prop_assert_eq!(slots, 1, "epoch {}", epoch);
            }
        }
    }
}
