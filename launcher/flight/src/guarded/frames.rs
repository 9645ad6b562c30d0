//! Requests and answers as frames of words. The first word of a frame has the number of the flight, the kind, and the
//! number of words that follow it.

use bytemuck::{cast_slice, pod_read_unaligned};
use contract::message::{Actuators, Controls, Payload, Reference, State, Truth};
use contract::topic::Topic;
use ring::stepped::SteppedResult;
use runtime::shared_role::Origin;
use serde::{Deserialize, Serialize};
use settings::{Scenario, to_toml};

use crate::log::{Memory, Record};

/// Kind of a frame with a snapshot. The kind of a frame with a message is its [`Record::kind`].
const MEMORY: u64 = Record::KINDS as u64;
/// Kind of a frame with a text: a request, or the end of a flight.
const TEXT: u64 = MEMORY + 1;
/// Place of the kind in the first word \[bits\].
const KIND_SHIFT: u32 = 32;
/// Place of the number of the flight in the first word \[bits\].
const FLIGHT_SHIFT: u32 = 40;

/// Work of a child with the libraries of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ChildWork {
    Fly {
        with_checksums: bool,
    },
    /// Loads the library of `node`, or those of all nodes if it is `None`, and lets each answer a few samples.
    Try {
        node: Option<String>,
    },
}

/// Flight to be flown, or trial.
#[derive(Debug, Clone, PartialEq)]
pub struct ChildRequest {
    /// Number of the flight among the flights of the child; every answer repeats it.
    pub flight: u16,
    pub work: ChildWork,
    pub scenario: Scenario,
}

/// Answer of the child.
#[expect(
    clippy::large_enum_variant,
    reason = "an answer lives for a moment, and a box would cost an allocation for each message"
)]
pub enum ChildAnswer {
    Record(Record),
    Memory(Memory),
    /// End of the flight; `true` if the child is as it was at its start, and can fly another flight.
    End(End, bool),
}

/// End of a flight or trial, as it is sent to the parent.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum End {
    Flown(SteppedResult),
    /// The libraries have answered.
    Tried,
    /// The flight cannot be flown.
    Refused(String),
    /// The launcher's own code has panicked.
    Panicked(String),
}

impl ChildRequest {
    pub fn to_words(&self) -> Vec<u64> {
        let work = serde_json::to_string(&self.work).expect("a flag and text");
        text_frame(self.flight, &format!("{work}\n{}", to_toml(&self.scenario)))
    }

    /// Takes a request from the beginning of `words`; `None` if it is not complete.
    ///
    /// # Errors
    /// The words are no request.
    pub fn take(words: &mut Vec<u64>) -> Option<Result<Self, String>> {
        let (flight, kind, body, next) = frame(words)?;
        let text = text_of(body).filter(|_| kind == TEXT);
        words.drain(..next);
        let request = || -> Result<Self, String> {
            let text = text.ok_or("no request")?;
            let (work, settings) = text.split_once('\n').ok_or("a request without settings")?;
            let work = serde_json::from_str(work).map_err(|e| e.to_string())?;
            let scenario = settings::from_merged(settings, "settings of the flight").map_err(|e| e.to_string())?;
            Ok(Self { flight, work, scenario })
        };
        Some(request())
    }
}

impl ChildAnswer {
    /// Appends the frame of a message of `flight` to `words`.
    pub fn record(flight: u16, record: &Record, words: &mut Vec<u64>) {
        push_frame(flight, record.kind() as u64, record.words(), words);
    }

    /// Appends the frame of a snapshot of `flight` to `words`.
    pub fn memory(flight: u16, memory: &Memory, words: &mut Vec<u64>) {
        let Memory { tick, topic, origin, words: content } = memory;
        let body = [&[*tick, *topic as u64, origin.epoch, origin.done], &content[..]].concat();
        push_frame(flight, MEMORY, &body, words);
    }

    /// Appends the frame of the end of `flight` to `words`; `is_as_before` is the flag of [`Self::End`].
    pub fn end(flight: u16, end: &End, is_as_before: bool, words: &mut Vec<u64>) {
        let text = serde_json::to_string(&(end, is_as_before)).expect("numbers and text");
        words.extend(text_frame(flight, &text));
    }

    /// Takes an answer of `flight` that begins at index `at` of `words`, and moves `at` behind the answer; `Ok(None)`
    /// if the answer is not complete.
    ///
    /// # Errors
    /// The words are no answer of this flight: the child has damaged its memory.
    pub fn take(flight: u16, words: &[u64], at: &mut usize) -> Result<Option<Self>, String> {
        let Some((of, kind, body, next)) = frame(&words[*at..]) else { return Ok(None) };
        *at += next;
        let answer = match kind {
            _ if of != flight => None,
            MEMORY => memory_of(body).map(Self::Memory),
            TEXT => {
                text_of(body).and_then(|text| serde_json::from_str(&text).ok()).map(|(end, same)| Self::End(end, same))
            }
            kind => record_of(kind as usize, body).map(Self::Record),
        };
        answer.map(Some).ok_or_else(|| "has damaged the memory of its process".to_owned())
    }
}

fn push_frame(flight: u16, kind: u64, body: &[u64], words: &mut Vec<u64>) {
    words.push(u64::from(flight) << FLIGHT_SHIFT | kind << KIND_SHIFT | body.len() as u64);
    words.extend_from_slice(body);
}

/// Makes the frame of a text: its length \[byte\], and its bytes.
fn text_frame(flight: u16, text: &str) -> Vec<u64> {
    let word = |bytes: &[u8]| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        u64::from_ne_bytes(word)
    };
    let body: Vec<u64> = [text.len() as u64].into_iter().chain(text.as_bytes().chunks(8).map(word)).collect();
    let mut words = vec![];
    push_frame(flight, TEXT, &body, &mut words);
    words
}

/// Returns flight, kind, body and length of the frame at the beginning of `words`; `None` if it is not complete.
fn frame(words: &[u64]) -> Option<(u16, u64, &[u64], usize)> {
    let (head, rest) = words.split_first()?;
    let length = (head & u64::from(u32::MAX)) as usize;
    let kind = head >> KIND_SHIFT & 0xff;
    Some(((head >> FLIGHT_SHIFT) as u16, kind, rest.get(..length)?, 1 + length))
}

fn text_of(body: &[u64]) -> Option<String> {
    let (length, rest) = body.split_first()?;
    let bytes: &[u8] = cast_slice(rest);
    String::from_utf8(bytes.get(..*length as usize)?.to_vec()).ok()
}

fn memory_of(body: &[u64]) -> Option<Memory> {
    let (&[tick, topic, epoch, done], words) = body.split_first_chunk()?;
    Some(Memory {
        tick,
        topic: *Topic::ALL.get(topic as usize)?,
        origin: Origin { epoch, done },
        words: words.to_vec(),
    })
}

fn record_of(kind: usize, body: &[u64]) -> Option<Record> {
    fn message<M: Payload + Into<Record>>(body: &[u64]) -> Option<Record> {
        let bytes: &[u8] = cast_slice(body);
        (bytes.len() == size_of::<M>()).then(|| pod_read_unaligned::<M>(bytes).into())
    }
    match Topic::ALL.get(kind) {
        Some(Topic::State) => message::<State>(body),
        Some(Topic::Reference) => message::<Reference>(body),
        Some(Topic::Controls) => message::<Controls>(body),
        Some(Topic::Actuators) => message::<Actuators>(body),
        None => message::<Truth>(body),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_taken_when_it_is_complete() {
        let work = ChildWork::Try { node: Some("mixer".into()) };
        let request = ChildRequest { flight: u16::MAX, work, scenario: Scenario::default() };
        let words = request.to_words();
        let mut part = words[..words.len() - 1].to_vec();
        assert!(ChildRequest::take(&mut part).is_none());
        part.push(words[words.len() - 1]);
        assert_eq!(ChildRequest::take(&mut part).unwrap().unwrap(), request);
        assert!(part.is_empty());
    }

    #[test]
    fn answers_arrive_as_they_were_sent_and_other_words_are_refused() {
        let record = Record::from(State { status: 3, ..State::default() });
        let memory = Memory::new(7, Topic::Actuators, Origin { epoch: 2, done: 8 }, &[1, 2, 3]);
        let mut words = vec![];
        ChildAnswer::record(7, &record, &mut words);
        ChildAnswer::memory(7, &memory, &mut words);
        ChildAnswer::end(7, &End::Refused("no \u{3bc}".into()), true, &mut words);
        let mut at = 0;
        let mut take = || ChildAnswer::take(7, &words, &mut at);
        assert!(matches!(take(), Ok(Some(ChildAnswer::Record(got))) if got == record));
        assert!(matches!(take(), Ok(Some(ChildAnswer::Memory(got))) if got == memory));
        assert!(matches!(take(), Ok(Some(ChildAnswer::End(End::Refused(why), true))) if why == "no \u{3bc}"));
        assert!(matches!(take(), Ok(None)));
        assert!(ChildAnswer::take(8, &words, &mut 0).is_err(), "an answer of another flight");
        for damaged in
            [vec![9 << KIND_SHIFT], vec![1, 0], vec![MEMORY << KIND_SHIFT], vec![TEXT << KIND_SHIFT | 1, 900]]
        {
            assert!(ChildAnswer::take(0, &damaged, &mut 0).is_err(), "{damaged:?}");
        }
    }
}
