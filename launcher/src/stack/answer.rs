//! What the launcher answers to those who ask it while it flies.

use contract::Scenario;
use contract::guard::Refusal;
use contract::realtime::{now_ns, phase};
use contract::scenario::{Swap, from_merged, to_toml};
use contract::topic::Topic;
use serde_json::{Value, json};

use super::Stack;
use crate::control::{Request, Response};
use crate::event::{Event, What};
use crate::run_record::{events, refused};
use crate::supervisor::plant_tick;

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
        match request {
            Request::Status => Response::Ok(self.view()),
            Request::Events => Response::Ok(events(&self.scenario, self.regime.events())),
            Request::Swap(swap) => match self.order_swap(swap.clone()) {
                Ok(told) => Response::Ok(told),
                Err(why) => Response::Error(why),
            },
        }
    }

    /// Begins a swap with the next sample, if it stands up to the rules of the scenario.
    fn order_swap(&mut self, swap: Swap) -> Result<Value, String> {
        if self.board.phase().count() != phase::GO {
            return Err("the stack is starting or ending".into());
        }
        self.regime.may_swap(&self.board, swap.node.topic())?;
        let at_s = (plant_tick(&self.board) + 1) as f64 * self.scenario.sample_s();
        let swap = Swap { at_s, ..swap };
        let alone = Scenario { swap: vec![swap.clone()], ..self.scenario.clone() };
        from_merged(&to_toml(&alone), "the swap").map_err(|error| error.to_string())?;
        let node = swap.node.name();
        self.scenario.swap.push(swap);
        Ok(json!({ "node": node, "at_s": at_s }))
    }

    /// How the nodes are, and what happened last.
    fn view(&mut self) -> Value {
        let nodes = Topic::ALL.map(|topic| self.node(topic));
        let told = self.regime.events();
        json!({
            "nodes": nodes,
            "events": events(&self.scenario, &told[told.len().saturating_sub(EVENTS)..]),
        })
    }

    /// How one node is: ticks are those it has done, counted from the first of the run.
    fn node(&mut self, topic: Topic) -> Value {
        let office = self.board.office(topic);
        let epoch = office.holder();
        let sampled = self.board.office(Topic::State).done(1).get();
        let done = (epoch > 0).then(|| office.done(epoch).get());
        let shadow = office.staff().shadow;
        let sent_ns = self.newest_ns[topic as usize];
        let started = |event: &&Event| event.what == What::Started && event.node == topic.publisher();
        json!({
            "node": topic.publisher(),
            "epoch": epoch,
            "shadow": (shadow > 0).then_some(shadow),
            "pid": self.children.all.iter().find(|p| p.topic == Some(topic) && p.epoch == epoch).map(|p| p.child.id()),
            "tick": done,
            "behind": done.map(|done| sampled.saturating_sub(done)),
            "age_ms": (sent_ns > 0).then(|| now_ns().saturating_sub(sent_ns) as f64 / 1e6),
            "restarts": self.regime.events().iter().filter(started).count(),
            "refused": refused(&Refusal::ALL.map(|r| office.refused[r as usize].get())),
        })
    }
}
