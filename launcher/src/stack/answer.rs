//! What the launcher answers to those who ask it while it flies.

use contract::guard::Refusal;
use contract::realtime::now_ns;
use contract::topic::Topic;
use serde_json::{Value, json};

use super::Stack;
use crate::control::{Request, Response};
use crate::run_record::{events, refused};
use crate::supervisor::{Event, What};

/// Of the events the last so many are told.
const EVENTS: usize = 8;

impl Stack {
    /// Answers to everybody who has asked.
    pub(super) fn attend(&mut self) {
        while let Some((request, reply)) = self.control.request() {
            reply.send(&self.answer(&request));
        }
    }

    /// Does what `request` asks for.
    fn answer(&mut self, request: &Request) -> Response {
        let done = match request {
            Request::Status => Ok(self.view()),
            Request::Inject { fault } => self.inject(*fault),
            Request::Clear { target } => self.clear(*target),
        };
        done.map_or_else(Response::Error, Response::Ok)
    }

    /// How the nodes are, what is broken, and what happened last.
    fn view(&self) -> Value {
        let told = &self.supervisor.events;
        json!({
            "nodes": Topic::ALL.map(|topic| self.node(topic)),
            "faults": self.at_work().collect::<Vec<_>>(),
            "events": events(&self.scenario, &told[told.len().saturating_sub(EVENTS)..]),
        })
    }

    /// How one node is: ticks are those it has done, counted from the first of the run.
    fn node(&self, topic: Topic) -> Value {
        let office = self.board.office(topic);
        let epoch = office.holder.get();
        let sampled = self.board.office(Topic::State).done(1).get();
        let done = (epoch > 0).then(|| office.done(epoch).get());
        let sent_ns = self.newest_ns[topic as usize];
        let started = |event: &&Event| event.what == What::Started && event.node == topic.publisher();
        json!({
            "node": topic.publisher(),
            "epoch": epoch,
            "pid": self.children.all.iter().find(|p| p.topic == Some(topic) && p.epoch == epoch).map(|p| p.child.id()),
            "tick": done,
            "behind": done.map(|done| sampled.saturating_sub(done)),
            "age_ms": (sent_ns > 0).then(|| now_ns().saturating_sub(sent_ns) as f64 / 1e6),
            "restarts": self.supervisor.events.iter().filter(started).count(),
            "refused": refused(&Refusal::ALL.map(|r| office.refused[r as usize].get())),
        })
    }
}
