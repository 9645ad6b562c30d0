//! Who works in a flight through processes: what became of them, and what is done about it.

use contract::scenario::{newcomer, to_toml};
use contract::topic::Topic;
use rustix::process::Signal;

use super::Stack;
use super::archive::{RECORDER, is_due};
use super::children::{Birth, Process};
use super::end::{Departure, Ended};
use crate::event::{Event, What};
use crate::supervisor::{Order, plant_tick};

impl Stack {
    /// Sees to it that everybody is there who should be; how the flight has ended, if it has. In lockstep the plant's
    /// `question` is answered.
    pub(super) fn supervise(&mut self, question: Option<u64>) -> Option<Ended> {
        while let Some((i, how)) = self.children.departed() {
            let Process { name, topic, epoch, .. } = self.children.all[i];
            match (topic, how) {
                (Some(Topic::State), Departure::Well) => return Some(Ended::Flown),
                (_, Departure::Late) => return Some(Ended::Late(name.into())),
                (Some(topic), how) => {
                    if !self.regime.died(&self.board, topic, epoch) {
                        return Some(Ended::Lost(how.tell(name)));
                    }
                }
                (None, how) => {
                    if let Some(ended) = self.replace_recorder(i, matches!(how, Departure::Well)) {
                        return Some(ended);
                    }
                }
            }
            self.children.bury(i);
        }
        for order in self.regime.orders(&self.board, &self.scenario, question) {
            self.obey(order);
        }
        self.regime.answer(&self.board);
        self.swap_recorder()
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Start(topic, epoch, origin) => {
                if let Err(error) = self.start_node(topic, epoch, origin) {
                    eprintln!("error: {error:#}");
                    self.regime.died(&self.board, topic, epoch);
                }
            }
            Order::Kill(topic, epoch) => self.children.signal(topic, epoch, Signal::KILL),
            Order::Stop(topic, epoch) => self.children.signal(topic, epoch, Signal::STOP),
            Order::Continue(topic, epoch) => self.children.signal(topic, epoch, Signal::CONT),
        }
    }

    /// Starts a process of a node, with what the swap `origin` says of it, and keeps a place for it.
    pub(super) fn start_node(&mut self, topic: Topic, epoch: u32, origin: Option<usize>) -> anyhow::Result<()> {
        self.board.office(topic).offer(epoch);
        let birth = Birth { name: topic.publisher(), topic: Some(topic), epoch, ..Birth::default() };
        let Some(swap) = origin.and_then(|i| self.scenario.swap.get(i)) else { return self.children.spawn(&birth) };
        let settings = self.hold.domain.file(&format!("{}.{epoch}.toml", birth.name));
        std::fs::write(&settings, to_toml(&newcomer(&self.scenario, swap)?))?;
        self.children.spawn(&Birth { program: swap.exec.as_deref(), settings: Some(&settings), ..birth })
    }

    /// Starts the first recorder, or the next.
    pub(super) fn start_recorder(&mut self) -> anyhow::Result<()> {
        let Some(archive) = &mut self.archive else {
            self.board.recorded().raise(u32::MAX); // nobody records, so nobody is to be waited for
            return Ok(());
        };
        let (epoch, path) = archive.next();
        let program = archive.program(&self.scenario);
        self.children.spawn(&Birth { name: RECORDER, epoch, log: Some(&path), program, ..Birth::default() })
    }

    /// A recorder has ended, whether it was asked to or not.
    fn replace_recorder(&mut self, i: usize, well: bool) -> Option<Ended> {
        let archive = self.archive.as_mut()?;
        let process = &mut self.children.all[i];
        let epoch = process.epoch;
        let again = archive.ended(process, well);
        if !well {
            self.tell_of_recorder(epoch, What::Died);
        }
        if self.archive.as_ref()?.given_up() {
            self.tell_of_recorder(epoch, What::GivenUp);
            self.board.recorded().raise(u32::MAX);
        }
        again.then(|| self.begin_recorder(None)).flatten()
    }

    /// The scenario's swaps of the recorder, and recorders that are ready to take over.
    fn swap_recorder(&mut self) -> Option<Ended> {
        let tick = plant_tick(&self.board);
        let archive = self.archive.as_mut()?;
        if archive.welcome(&self.board) {
            let epoch = archive.newest();
            if epoch > 1 {
                self.tell_of_recorder(epoch, What::TookOver);
            }
        }
        let archive = self.archive.as_mut()?;
        let mut due = self.scenario.swap.iter().enumerate().filter(|(_, swap)| is_due(swap, tick, &self.scenario));
        if tick > 0
            && let Some((i, _)) = due.nth(archive.swaps)
        {
            archive.swaps += 1;
            return self.begin_recorder(Some(i));
        }
        None
    }

    fn begin_recorder(&mut self, swap: Option<usize>) -> Option<Ended> {
        if let Err(error) = self.start_recorder() {
            eprintln!("error: {error:#}");
            return None; // the flight is worth more than its log, whose loss is told at the end
        }
        let epoch = self.archive.as_ref()?.newest();
        let tick = plant_tick(&self.board);
        self.regime.events().push(Event::new(tick, RECORDER, epoch, What::Started).begins(swap));
        None
    }

    fn tell_of_recorder(&mut self, epoch: u32, what: What) {
        let tick = plant_tick(&self.board);
        self.regime.events().push(Event::new(tick, RECORDER, epoch, what));
    }
}
