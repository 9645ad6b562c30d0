//! Who works in a flight through processes: what became of them, and what is done about it.

use contract::scenario::{newcomer, to_toml};
use contract::topic::Topic;
use rustix::process::Signal;

use super::Stack;
use super::archive::{Archive, RECORDER};
use super::children::{Birth, Process};
use super::end::{Departure, Ended};
use crate::event::{Event, What};
use crate::supervisor::{Order, plant_tick};

impl Stack {
    /// Sees to it that everybody is there who should be; how the flight has ended, if it has. In lockstep the plant's
    /// `question` is answered, once all who come with that tick are there.
    pub(super) fn supervise(&mut self, question: Option<u64>) -> Option<Ended> {
        let tick = question.unwrap_or_else(|| plant_tick(&self.board));
        while let Some((i, how)) = self.children.departed() {
            let Process { name, topic, epoch, .. } = self.children.all[i];
            match (topic, how) {
                (Some(Topic::State), Departure::Well) => return Some(Ended::Flown),
                (Some(topic), Departure::Late) if self.regime.is_alone(&self.board, topic, epoch) => {
                    return Some(Ended::Late(name.into()));
                }
                (Some(topic), how) => {
                    if !self.regime.died(&self.board, topic, epoch) {
                        return Some(Ended::Lost(how.tell(name)));
                    }
                }
                (None, how) => {
                    if let Some(archive) = &mut self.archive {
                        archive.take_word(&mut self.children.all[i]);
                    }
                    self.recorder_ended(epoch, matches!(how, Departure::Well), tick);
                }
            }
            self.children.bury(i);
        }
        for order in self.regime.orders(&self.board, &self.scenario, question) {
            self.obey(order);
        }
        self.swap_recorder(tick);
        if self.archive.as_ref().is_none_or(Archive::is_settled) {
            self.regime.answer(&self.board);
        }
        None
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
        let text = to_toml(&newcomer(&self.scenario, swap)?);
        let settings = self.hold.domain.write(&format!("{}.{epoch}.toml", birth.name), &text)?;
        self.children.spawn(&Birth { program: swap.exec.as_deref(), settings: Some(&settings), ..birth })
    }

    /// Starts the first recorder, or the next, which may come with a swap.
    pub(super) fn start_recorder(&mut self, swap: Option<usize>) -> anyhow::Result<()> {
        let Some(archive) = &mut self.archive else {
            self.board.recorded().raise(u32::MAX); // nobody records, so nobody is to be waited for
            return Ok(());
        };
        let (epoch, path) = archive.begin(swap);
        let program = archive.program(&self.scenario);
        self.children.spawn(&Birth { name: RECORDER, epoch, log: Some(&path), program, ..Birth::default() })
    }

    /// A recorder has ended, whether it was asked to or not.
    fn recorder_ended(&mut self, epoch: u32, well: bool, tick: u64) {
        let Some(archive) = &mut self.archive else { return };
        let happened = archive.ended(epoch, well);
        let (vacant, given_up) = (archive.is_vacant(), archive.given_up());
        for what in happened {
            self.tell_of_recorder(epoch, what, tick);
        }
        if given_up {
            self.board.recorded().raise(u32::MAX);
        }
        if vacant {
            self.begin_recorder(None, tick);
        }
    }

    /// Recorders that are ready to take over, and swaps of the recorder.
    fn swap_recorder(&mut self, tick: u64) {
        let Some(archive) = &mut self.archive else { return };
        let welcome = archive.welcome(&self.board).filter(|epoch| *epoch > 1);
        let due = archive.due(tick, &self.scenario);
        if let Some(epoch) = welcome {
            self.tell_of_recorder(epoch, What::TookOver, tick);
        }
        if due.is_some() {
            self.begin_recorder(due, tick);
        }
    }

    /// Starts one in flight. The flight is worth more than its log: one that cannot be started has died.
    fn begin_recorder(&mut self, swap: Option<usize>, tick: u64) {
        let begun = self.start_recorder(swap);
        let epoch = self.archive.as_ref().map_or(0, Archive::newest);
        self.tell_of_recorder(epoch, What::Started, tick);
        if let Err(error) = begun {
            eprintln!("error: {error:#}");
            self.recorder_ended(epoch, false, tick);
        }
    }

    fn tell_of_recorder(&mut self, epoch: u32, what: What, tick: u64) {
        self.regime.events().push(Event::new(tick, RECORDER, epoch, what));
    }
}
