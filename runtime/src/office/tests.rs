use super::*;

fn office() -> Box<Office> {
    let word = || Word(AtomicU32::new(0));
    Box::new(Office {
        roster: AtomicU64::new(0),
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
    let office = office();
    assert!(!office.claim(1, 71), "nobody was asked for");
    office.offer(1);
    assert!(!office.claim(2, 72), "it is another's");
    assert!(office.claim(1, 71));
    assert!(!office.claim(1, 72), "it is taken");
    assert!(office.port(1) == 71);
    assert!(office.knows(71) && !office.knows(72));
}

#[test]
fn an_heir_takes_over_when_a_tick_begins() {
    let office = office();
    office.turn_over(7);
    assert_eq!(office.staff(), Staff::default(), "nobody is named");
    office.appoint(0, |_| Staff { holder: 1, shadow: 0 });
    office.name_heir(2);
    assert!(office.staff().employs(1) && !office.staff().employs(2) && !office.staff().employs(0));
    office.turn_over(8);
    assert_eq!(office.staff(), Staff { holder: 2, shadow: 0 });
    assert_eq!((office.since(2).get(), office.done(2).get(), office.roster().heir), (8, 8, 0));
}

#[test]
fn a_shadow_and_its_holder_change_places_and_back() {
    let office = office();
    office.appoint(0, |_| Staff { holder: 1, shadow: 0 });
    office.done(1).set(20);
    office.appoint(20, |staff| Staff { shadow: 2, ..staff });
    office.name_heir(2);
    office.turn_over(30);
    assert_eq!(office.staff(), Staff { holder: 2, shadow: 1 });
    assert_eq!((office.since(1).get(), office.since(2).get()), (0, 20), "who worked before goes on where it is");
    office.name_heir(1);
    office.turn_over(40);
    assert_eq!(office.staff(), Staff { holder: 1, shadow: 2 });
    office.appoint(41, |staff| staff.without(2));
    assert_eq!(office.staff().epochs().collect::<Vec<_>>(), [1]);
}

#[test]
fn what_launcher_and_plant_do_at_the_same_time_is_done_one_after_the_other() {
    const ROUNDS: u32 = 5_000;
    let office = office();
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
                office.turn_over(8);
                done.store(round, Ordering::Release);
            }
        });
        for round in 1..=ROUNDS {
            office.appoint(0, |_| Staff { holder: 1, shadow: 2 * (round % 2) });
            office.name_heir(2);
            begun.store(round, Ordering::Release);
            (0..round % 512).for_each(|_| std::hint::spin_loop());
            office.dismiss(2);
            wait_for(&done, round);
            let (staff, heir) = (office.staff(), office.roster().heir);
            let who_is_gone_is_gone = !staff.employs(2) && heir != 2;
            let who_stays_has_the_office = round % 2 == 0 || staff.holder == 1 || heir == 1;
            if !(who_is_gone_is_gone && who_stays_has_the_office) {
                lost.push((round, staff, heir));
            }
        }
    });
    assert_eq!(lost, []);
}

#[test]
fn who_leaves_is_no_heir_and_leaves_the_office_to_a_shadow() {
    let office = office();
    office.appoint(0, |_| Staff { holder: 1, shadow: 0 });
    office.name_heir(2);
    office.dismiss(2);
    assert_eq!((office.staff(), office.roster().heir), (Staff { holder: 1, shadow: 0 }, 0));
    office.appoint(0, |staff| Staff { shadow: 2, ..staff });
    office.dismiss(1);
    assert_eq!((office.staff(), office.roster().heir), (Staff { holder: 0, shadow: 2 }, 2));
    office.turn_over(9);
    office.dismiss(2);
    assert_eq!((office.staff(), office.roster().heir), (Staff::default(), 0));
}

#[test]
fn a_snapshot_is_read_whole() {
    let cell = &office().memory;
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
