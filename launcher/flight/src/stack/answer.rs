//! What the launcher answers to those who ask it while it flies.

use contract::guard::Refusal;
use contract::topic::Topic;
use runtime::realtime::now_ns;
use serde_json::{Value, json};

use super::Stack;
use super::end::refused;
use crate::control::{Request, Response};
use crate::event::events;
use crate::event::{Event, Sender, What};

/// Of the events the last so many are told.
const EVENTS: usize = 8;
/// No more are told at once, so that what is answered fits into the socket.
const MOST_EVENTS: usize = 100;

impl Stack {
    /// Answers one request, if there is any: the next has to wait until the processes have been looked at again.
    pub(super) fn attend(&mut self) {
        if let Some((request, reply)) = self.control.request() {
            let response = self.answer(&request, reply.sender());
            reply.send(&response);
        }
    }

    /// Does what `request` asks for, which came from `sender`.
    fn answer(&mut self, request: &Request, sender: Option<Sender>) -> Response {
        let done = match request {
            Request::Status => Ok(self.view()),
            Request::Events { since } => Ok(self.tale(*since)),
            Request::Inject { fault } => self.inject(*fault, sender),
            Request::Clear { target } => self.clear(*target, sender),
            Request::Swap(swap) => self.order_swap(swap.clone(), sender),
            Request::Stop => {
                self.stopped = true;
                Ok(Value::Null)
            }
        };
        done.map_or_else(Response::Error, Response::Ok)
    }

    /// The events from number `since` on, or the first of them.
    fn tale(&mut self, since: usize) -> Value {
        let all = &self.events;
        let since = since.min(all.len());
        events(&self.scenario, &all[since..all.len().min(since + MOST_EVENTS)])
    }

    /// How the nodes are, what is broken, and what happened last.
    fn view(&mut self) -> Value {
        let nodes = Topic::ALL.map(|topic| self.node(topic));
        let faults = json!(self.at_work().collect::<Vec<_>>());
        let told = &self.events;
        json!({
            "nodes": nodes,
            "faults": faults,
            "events": events(&self.scenario, &told[told.len().saturating_sub(EVENTS)..]),
        })
    }

    /// How one node is: ticks are those it has done, counted from the first of the run.
    fn node(&mut self, topic: Topic) -> Value {
        let role = self.page.role(topic);
        let epoch = role.active();
        let sampled = self.page.role(Topic::State).done(1).get();
        let done = (epoch > 0).then(|| role.done(epoch).get());
        let standby = role.assignment().standby;
        let sent_ns = self.newest_ns[topic as usize];
        let again = |event: &&Event| event.what == What::Started && event.swap.is_none();
        let restart = |event: &&Event| event.node == topic.publisher() && again(event);
        json!({
            "node": topic.publisher(),
            "epoch": epoch,
            "standby": (standby > 0).then_some(standby),
            "pid": self.children.all.iter().find(|p| p.topic == Some(topic) && p.epoch == epoch).map(|p| p.child.id()),
            "tick": done,
            "behind": done.map(|done| sampled.saturating_sub(done)),
            "age_ms": (sent_ns > 0).then(|| now_ns().saturating_sub(sent_ns) as f64 / 1e6),
            "restarts": self.events.iter().filter(restart).count(),
            "refused": refused(&Refusal::ALL.map(|r| role.refused[r as usize].get())),
        })
    }
}
