//! Verdict on a replay: one sentence and one exit code, which depend on the messages compared.
//!
//! A flight is called the same only if its log is complete, every message of the log was computed again and compared,
//! and the hash of the states is that of run.json. The verdict names everything that was not compared.

use std::collections::BTreeSet;

use contract::{Topic, exit};
use settings::ProgramKind;

use crate::again::replay;
use crate::plan::{ComparedMessages, FirstDifference, ReplayPlan, Replayed};
use crate::recording::Recording;

use outcome::recorded::Recorded;
use outcome::summary::Summary;

/// Verdict on a replay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplayVerdict {
    /// Text for people; the first line is the verdict.
    pub text: String,
    pub exit_code: u8,
}

/// Facts on a replay that its verdict depends on.
pub struct Judged<'a> {
    pub recorded: &'a Recorded,
    pub recording: &'a Recording,
    pub plan: &'a ReplayPlan,
    pub replayed: &'a Replayed,
    /// Hash of the states of the replay.
    pub state_hash: Option<String>,
}

/// Flies a run again as `plan` says, and judges the result. Before that, hands the replay and its summary to `each`.
///
/// # Errors
/// The run cannot be flown again.
pub fn replay_and_judge(
    recorded: &Recorded,
    recording: &Recording,
    plan: &ReplayPlan,
    each: impl FnOnce(&Replayed, &Summary),
) -> anyhow::Result<ReplayVerdict> {
    let mut summary = Summary::new(&recording.scenario);
    let compared = plan.from..=plan.until.unwrap_or(u64::MAX);
    let replayed = replay(recording, plan, |record| {
        if compared.contains(&record.tick()) {
            summary.observe(record);
        } else {
            summary.pass(record);
        }
    })?;
    each(&replayed, &summary);
    let state_hash = summary.state_hash();
    Ok(Judged { recorded, recording, plan, replayed: &replayed, state_hash }.verdict())
}

impl Judged<'_> {
    pub fn verdict(&self) -> ReplayVerdict {
        let (outcome, exit_code) = self.outcome();
        let lines = [
            Some(outcome),
            self.differences(),
            Some(self.coverage()),
            self.begun(),
            self.not_computed(),
            self.lacking(),
        ];
        ReplayVerdict { text: lines.into_iter().flatten().map(|line| line + "\n").collect(), exit_code }
    }

    /// Returns the first line of the verdict, and the exit code.
    fn outcome(&self) -> (String, u8) {
        let first = self.replayed.first.as_ref().map(|first| self.describe(first));
        let is_whole = self.lacking().is_none();
        let hashes = [self.recorded.run.state_hash.as_deref(), self.state_hash.as_deref()];
        match (first, self.asks_for_other_answers()) {
            (Some(first), true) => (format!("other answers from {first}"), answered(is_whole)),
            (Some(first), false) => (format!("DIFFERENT from {first}"), exit::OUT_OF_BOUNDS),
            (None, _) if self.replayed.compared() == 0 => ("nothing was compared".into(), exit::OUT_OF_BOUNDS),
            (None, _) if !is_whole => {
                ("no difference in what was compared, which is not all that was asked for".into(), exit::OUT_OF_BOUNDS)
            }
            (None, true) if self.covers_all_time() => ("the same answers, bit for bit".into(), exit::FLOWN),
            (None, false) if self.flies_all_states() && (hashes[0] != hashes[1] || hashes[0].is_none()) => {
                let [flown, replayed] = hashes.map(|hash| hash.unwrap_or("none"));
                (format!("DIFFERENT state hash: {flown} in run.json, {replayed} in the replay"), exit::OUT_OF_BOUNDS)
            }
            (None, false) if self.compares_all() => {
                (format!("the same bits: state hash {}, as in run.json", hashes[1].unwrap_or_default()), exit::FLOWN)
            }
            (None, _) => ("no difference in what was compared".into(), exit::FLOWN),
        }
    }

    fn differences(&self) -> Option<String> {
        let Replayed { different, .. } = self.replayed;
        (*different > 0).then(|| format!("{different} of {} messages compared differ", self.replayed.compared()))
    }

    /// Says how many messages of the log, and which part of the flight, were compared.
    fn coverage(&self) -> String {
        let all = &self.replayed.messages;
        let logged: u64 = all.iter().map(|of_topic| of_topic.logged).sum();
        let of_node = |topic: Topic| {
            let ComparedMessages { logged, compared, .. } = all[topic as usize];
            format!("{} {compared} of {logged}", topic.publisher())
        };
        let nodes = Topic::ALL.map(of_node).join(", ");
        let sample_s = self.recording.scenario.sample_s();
        let seconds = |tick: u64| tick as f64 * sample_s;
        let until = self.plan.until.unwrap_or(u64::MAX).min(self.replayed.last_tick);
        let (from_s, until_s) = (seconds(self.plan.from), seconds(until));
        let span =
            if self.replayed.compared() == 0 { "no time".into() } else { format!("{from_s:.2} to {until_s:.2} s") };
        let flown_s = self.recorded.run.flown_s;
        let flipped: u64 = all.iter().map(|of_topic| of_topic.flipped).sum();
        let flipped = match flipped {
            0 => String::new(),
            some => format!("; {some} whose bits a fault flipped were sent again and not compared"),
        };
        format!(
            "compared: {} of {logged} messages ({nodes}), {span} of {flown_s:.2} s{flipped}",
            self.replayed.compared()
        )
    }

    /// Says where the replay began, if it began in the middle of the flight.
    fn begun(&self) -> Option<String> {
        let Replayed { begun_at, .. } = *self.replayed;
        let begun_s = begun_at as f64 * self.recording.scenario.sample_s();
        (begun_at > 0).then(|| format!("begun with the snapshots at {begun_s:.2} s"))
    }

    /// Returns the line on the processes that did not compute; `None` if all computed.
    fn not_computed(&self) -> Option<String> {
        let nodes = Topic::ALL.into_iter().filter(|topic| !self.plan.covers(*topic));
        let nodes = nodes.map(|topic| format!("{} (not asked for)", topic.publisher()));
        let foreign = self.recording.foreign().filter(|(topic, _)| self.plan.covers(*topic));
        let foreign = foreign.map(|(topic, epoch)| format!("{} {epoch} (another program)", topic.publisher()));
        let told: Vec<String> = nodes.chain(foreign.filter(|_| !self.asks_for_other_answers())).collect();
        let libraries = self
            .recording
            .foreign()
            .map(|(topic, _)| topic)
            .filter(|topic| self.recording.scenario.node.of(*topic).kind() == ProgramKind::Library);
        let named: BTreeSet<String> = libraries.map(|topic| format!(" --program {}=FILE", topic.publisher())).collect();
        let how = if named.is_empty() || self.asks_for_other_answers() {
            String::new()
        } else {
            format!("; with{} a library that you trust computes again", named.into_iter().collect::<String>())
        };
        (!told.is_empty()).then(|| format!("not computed: {}{how}", told.join(", ")))
    }

    /// Returns the reasons why less was compared than asked for; `None` if there are none.
    fn lacking(&self) -> Option<String> {
        let stopped = self.replayed.stopped.as_ref().map(|why| {
            format!(
                "the replay ends before the flight: {why}; with --from a replay can begin after this point, if the \
                     log holds the nodes' memory there"
            )
        });
        let told: Vec<String> = self.recorded.missing().into_iter().chain(stopped).chain(self.uncompared()).collect();
        (!told.is_empty()).then(|| told.join("\n"))
    }

    /// Returns the line on the first node whose messages in the log were not all compared, if there is one.
    fn uncompared(&self) -> Option<String> {
        if !self.covers_all_time() || self.replayed.stopped.is_some() {
            return None;
        }
        let lacks = |topic: &Topic| {
            let ComparedMessages { logged, compared, flipped, .. } = self.replayed.messages[*topic as usize];
            self.computes_all_of(*topic) && compared + flipped != logged
        };
        let topic = Topic::ALL.into_iter().find(lacks)?;
        let ComparedMessages { logged, computed, .. } = self.replayed.messages[topic as usize];
        let name = topic.publisher();
        Some(format!("{name} sent {computed} messages in the replay, and the log has {logged} of it"))
    }

    fn asks_for_other_answers(&self) -> bool {
        self.plan.settings.is_some()
    }

    fn computes_all_of(&self, topic: Topic) -> bool {
        self.plan.covers(topic) && !self.recording.foreign().any(|(foreign, _)| foreign == topic)
    }

    fn covers_all_time(&self) -> bool {
        self.plan.from == 0 && self.plan.until.is_none()
    }

    /// Returns whether every state of the flight was computed, so that their hash is known.
    fn flies_all_states(&self) -> bool {
        self.computes_all_of(Topic::State) && self.plan.only.is_none() && self.covers_all_time()
    }

    fn compares_all(&self) -> bool {
        let flips = self.replayed.messages.iter().any(|of_topic| of_topic.flipped > 0);
        self.covers_all_time() && !flips && Topic::ALL.into_iter().all(|topic| self.computes_all_of(topic))
    }

    /// Describes for people the first difference between flight and replay.
    fn describe(&self, first: &FirstDifference) -> String {
        let FirstDifference { tick, topic, epoch, differs } = first;
        let [flown, replayed] = &differs.values;
        let (name, time_s) = (topic.publisher(), *tick as f64 * self.recording.scenario.sample_s());
        format!(
            "tick {tick}, {time_s:.2} s, on: {name} {epoch}, {}: {flown} in the flight, {replayed} in the replay",
            differs.field
        )
    }
}

/// Returns the exit code of a replay that was asked for other answers and gave some: success only if nothing is
/// missing.
fn answered(is_whole: bool) -> u8 {
    if is_whole { exit::FLOWN } else { exit::OUT_OF_BOUNDS }
}
