use super::*;

fn role() -> Box<SharedRole> {
    let word = || Word(AtomicU32::new(0));
    Box::new(SharedRole {
        packed: AtomicU64::new(0),
        ready: word(),
        met: word(),
        since: [word(), word()],
        done: [word(), word()],
        sent: [word(), word()],
        received: std::array::from_fn(|_| std::array::from_fn(|_| word())),
        port_failures: [word(), word()],
        memory: Cell {
            written: AtomicU64::new(0),
            copies: std::array::from_fn(|_| std::array::from_fn(|_| AtomicU64::new(0))),
        },
        voices: std::array::from_fn(|_| AtomicU64::new(0)),
        refused: std::array::from_fn(|_| word()),
    })
}

#[test]
fn a_place_that_is_offered_goes_to_one_process() {
    let role = role();
    assert!(!role.claim(1, 71), "nobody was asked for");
    role.offer(1);
    assert!(!role.claim(2, 72), "it is another's");
    assert!(role.claim(1, 71));
    assert!(!role.claim(1, 72), "it is taken");
    assert!(role.port(1) == 71);
    assert!(role.knows(71) && !role.knows(72));
}

#[test]
fn an_heir_takes_over_when_a_tick_begins() {
    let role = role();
    role.activate_pending(7);
    assert_eq!(role.assignment(), Assignment::default(), "nobody is named");
    role.assign(0, |_| Assignment { active: 1, standby: 0 });
    role.set_pending(2);
    assert!(role.assignment().includes(1) && !role.assignment().includes(2) && !role.assignment().includes(0));
    role.activate_pending(8);
    assert_eq!(role.assignment(), Assignment { active: 2, standby: 0 });
    assert_eq!((role.since(2).get(), role.done(2).get(), role.packed().pending), (8, 8, 0));
}

#[test]
fn a_shadow_and_its_holder_change_places_and_back() {
    let role = role();
    role.assign(0, |_| Assignment { active: 1, standby: 0 });
    role.done(1).set(20);
    role.assign(20, |assignment| Assignment { standby: 2, ..assignment });
    role.set_pending(2);
    role.activate_pending(30);
    assert_eq!(role.assignment(), Assignment { active: 2, standby: 1 });
    assert_eq!((role.since(1).get(), role.since(2).get()), (0, 20), "who worked before goes on where it is");
    role.set_pending(1);
    role.activate_pending(40);
    assert_eq!(role.assignment(), Assignment { active: 1, standby: 2 });
    role.assign(41, |assignment| assignment.without(2));
    assert_eq!(role.assignment().epochs().collect::<Vec<_>>(), [1]);
}

#[test]
fn what_launcher_and_plant_do_at_the_same_time_is_done_one_after_the_other() {
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
            let who_is_gone_is_gone = !assignment.includes(2) && pending != 2;
            let who_stays_has_the_office = round % 2 == 0 || assignment.active == 1 || pending == 1;
            if !(who_is_gone_is_gone && who_stays_has_the_office) {
                lost.push((round, assignment, pending));
            }
        }
    });
    assert_eq!(lost, []);
}

#[test]
fn who_leaves_is_no_heir_and_leaves_the_office_to_a_shadow() {
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
    assert_eq!(cell.read(), None, "nothing was written yet");
    std::thread::scope(|scope| {
        scope.spawn(|| (1..=200_000).for_each(|i| cell.write(&[i; SNAPSHOT_WORDS])));
        for _ in 0..100_000 {
            if let Some(snapshot) = cell.read() {
                assert!(snapshot.iter().all(|word| *word == snapshot[0]), "torn: {snapshot:?}");
            }
        }
    });
    assert_eq!(cell.read(), Some([200_000; SNAPSHOT_WORDS]));
}
