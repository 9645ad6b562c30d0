//! Recorders that come and go, without processes.

use super::*;
use contract::scenario::Swap;

/// A flight at its tick 100.
struct Flight {
    page: ControlPage,
    scenario: Scenario,
    recorders: Recorders,
    now: Instant,
    events: Vec<Event>,
}

impl Flight {
    fn with_swaps(at_s: &[f64]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let page = ControlPage::create(&folder.path().join("page")).unwrap();
        page.archive().assign(0, |_| Assignment { active: 1, standby: 0 });
        let swap = at_s.iter().map(|at_s| Swap::new(SwapNode::Recorder, *at_s)).collect();
        let scenario = Scenario { swap, ..Scenario::default() };
        Self { page, scenario, recorders: Recorders::new(), now: Instant::now(), events: vec![] }
    }

    fn at(&self) -> At {
        At { tick: 100, now: self.now }
    }

    fn look(&mut self) -> Option<Order> {
        let at = self.at();
        self.recorders.look(&self.page, &self.scenario, at, &mut self.events)
    }

    fn ended(&mut self, epoch: u32, well: bool) {
        let at = self.at();
        self.recorders.ended(&self.page, epoch, well, at, &mut self.events);
    }

    /// What has happened since the last time.
    fn told(&mut self) -> Vec<(u32, What)> {
        self.events.drain(..).map(|event| (event.epoch, event.what)).collect()
    }

    fn may_swap(&self) -> bool {
        self.recorders.may_swap(&self.page).is_ok()
    }

    /// `epoch` is ready, and takes over.
    fn succeeds(&mut self, epoch: u32) {
        self.page.archive().ready.set(epoch);
        let at = self.at();
        self.recorders.welcome(&self.page, at, &mut self.events);
        assert_eq!(self.page.archive().active(), epoch);
    }
}

#[test]
fn who_dies_before_it_is_ready_is_rejected_and_the_old_one_stays() {
    let mut flight = Flight::with_swaps(&[0.5; 5]);
    for epoch in 2..=6 {
        assert_eq!(flight.look(), Some(Order::Start(epoch, Some(epoch as usize - 2))));
        assert!(!flight.may_swap() && flight.recorders.awaits(epoch));
        flight.ended(epoch, epoch % 2 == 0); // some find that they have done well
        assert_eq!(flight.told(), [(epoch, What::Started), (epoch, What::Died), (epoch, What::Rejected)]);
    }
    assert_eq!((flight.look(), flight.page.archive().active()), (None, 1));
    assert!(flight.may_swap());
    flight.ended(1, false);
    assert_eq!(flight.look(), Some(Order::Start(7, None)), "the one active is replaced as ever");
}

#[test]
fn who_is_not_ready_in_time_is_killed() {
    let mut flight = Flight::with_swaps(&[0.5]);
    assert_eq!(flight.look(), Some(Order::Start(2, Some(0))));
    flight.now += START_LIMIT;
    assert_eq!(flight.look(), None);
    flight.now += Duration::from_millis(1);
    assert_eq!(flight.look(), Some(Order::Kill(2)));
    assert_eq!(flight.look(), None);
    flight.ended(2, false);
    let hung = [(2, What::Started), (2, What::Hung), (2, What::Died), (2, What::Rejected)];
    assert_eq!(flight.told(), hung);
}

#[test]
fn who_dies_in_office_is_followed_by_the_program_before() {
    let mut flight = Flight::with_swaps(&[0.9, 0.5]);
    for (epoch, swap) in [(2, 1), (3, 0)] {
        assert_eq!(flight.look(), Some(Order::Start(epoch, Some(swap))), "in the order of their times");
        flight.succeeds(epoch);
        flight.ended(epoch - 1, true);
        assert_eq!(flight.told(), [(epoch, What::Started), (epoch, What::TookOver)]);
    }
    flight.ended(3, true);
    assert_eq!(flight.look(), Some(Order::Start(4, Some(1))));
    flight.succeeds(4);
    flight.ended(4, false);
    assert_eq!(flight.look(), Some(Order::Start(5, None)));
    let told = [(3, What::Died), (4, What::Started), (4, What::TookOver), (4, What::Died), (5, What::Started)];
    assert_eq!(flight.told(), told);
}

#[test]
fn too_many_deaths_and_nobody_records() {
    let mut flight = Flight::with_swaps(&[]);
    for epoch in 1..=4 {
        flight.ended(epoch, false);
        let again = (epoch < 4).then_some(Order::Start(epoch + 1, None));
        assert_eq!(flight.look(), again);
    }
    assert!(flight.recorders.given_up && !flight.may_swap());
    assert_eq!(flight.told().last(), Some(&(4, What::GivenUp)));
    assert_eq!(flight.page.recorded().count(), u32::MAX, "nobody is waited for");
}

#[test]
fn who_stands_still_is_killed_and_nobody_waits_for_what_it_missed() {
    let mut flight = Flight::with_swaps(&[]);
    flight.page.recorded().raise(80);
    flight.now += 2 * HANG;
    assert_eq!(flight.look(), None, "there was nothing to record");
    flight.page.watched().raise(90);
    flight.now += HANG;
    assert_eq!(flight.look(), None);
    flight.now += Duration::from_millis(1);
    assert_eq!(flight.look(), Some(Order::Kill(1)));
    flight.ended(1, false);
    assert_eq!(flight.look(), Some(Order::Start(2, None)));
    flight.succeeds(2);
    assert_eq!(flight.page.recorded().count(), 90);
}
