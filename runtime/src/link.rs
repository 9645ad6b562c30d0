//! The link: applies faults to the messages of one topic on their way.
//!
//! The link stands before the sending port, so that every subscriber gets the same messages, the recorder included. A
//! message that is lost or changed is sent too, marked, so that an observer sees both the original and the result. Time
//! is counted in whole ticks, and every draw is a function of seed, fault and tick alone. So a flight repeats, also
//! across a restart of the publisher. Only messages that the link held back are lost with the publisher.
//!
//! ```text
//! message with checksum -> drop? burst? rate? -> garbage, wrong, stale (with a new checksum)
//!                       -> corrupt (with the old checksum) -> late, twice, reordered
//! ```

use crate::limits::HELD_MESSAGES;
use contract::message::field::{FieldMark, HasShape};
use contract::message::{Message, Stamp};
use contract::stamp::delivery;
use settings::fault_schedule::{Entry, FaultSchedule};
use settings::{Fault, FaultKind, Mode, Scenario, Wrong};

/// Link of one topic, with the messages that its faults hold back.
pub struct Link<M> {
    seed: u64,
    /// Sample time \[s\].
    sample_s: f64,
    /// Late messages, each with the tick on which it arrives.
    held: Vec<(u64, M)>,
    /// Message held back by `reorder` until the next one was sent.
    overtaken: Option<M>,
}

impl<M: Message> Link<M> {
    /// Makes the link of `M`'s topic in `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let may_have_faults = scenario.run.mode == Mode::Realtime || !scenario.fault.is_empty();
        let held = Vec::with_capacity(if may_have_faults { HELD_MESSAGES } else { 0 });
        Self { seed: scenario.run.seed, sample_s: scenario.sample_s(), held, overtaken: None }
    }

    /// Applies `faults` to `message`, which answers to sample `tick`. Calls `deliver` with every message that arrives
    /// on this tick, late ones and the marked original of a changed one included.
    pub fn pass(&mut self, tick: u64, message: &M, faults: &FaultSchedule<Fault>, mut deliver: impl FnMut(&M)) {
        if faults.all().is_empty() {
            return deliver(message);
        }
        while let Some(i) = self.held.iter().position(|(due, _)| *due <= tick) {
            deliver(&self.held.remove(i).1);
        }
        let passed = self.apply_faults(tick, message, faults);
        let unharmed =
            |passed: &Passed<M>| passed.ticks_late == 0 && !passed.overtaken && bits(&passed.message) == bits(message);
        if !passed.as_ref().is_some_and(unharmed) {
            let mut meant = *message;
            meant.stamp_mut().delivery |= delivery::FAULT;
            deliver(&meant.with_checksum());
        }
        let Some(Passed { message, ticks_late, twice, overtaken }) = passed else { return };
        if ticks_late > 0 {
            if self.held.len() == HELD_MESSAGES {
                self.held.remove(0);
            }
            self.held.push((tick + ticks_late, message));
        } else if overtaken && self.overtaken.is_none() {
            self.overtaken = Some(message);
        } else {
            deliver(&message);
            if twice {
                deliver(&message);
            }
            self.overtaken.take().iter().for_each(deliver);
        }
    }

    /// Applies the faults of `tick` to one message; `None` if it is lost.
    fn apply_faults(&self, tick: u64, message: &M, faults: &FaultSchedule<Fault>) -> Option<Passed<M>> {
        let mut passed = Passed { message: *message, ticks_late: 0, twice: false, overtaken: false };
        let of_topic = |entry: &&Entry<Fault>| entry.effect.target.topic() == Some(M::TOPIC);
        for Entry { number, ticks, effect: fault, .. } in faults.on(tick).filter(of_topic) {
            let random = |salt| draw(self.seed, *number as u64, tick, salt);
            let happens = |usual: f64| share(random(0)) < fault.probability.unwrap_or(usual);
            let since = tick - ticks.start;
            let ticks = |usual_ms: f64| (fault.ms.unwrap_or(usual_ms) / 1e3 / self.sample_s - 1e-6).ceil() as u64;
            match fault.kind {
                FaultKind::Drop if happens(0.5) => return None,
                FaultKind::Burst if since < fault.count.unwrap_or(10) => return None,
                FaultKind::Rate if !since.is_multiple_of(fault.count.unwrap_or(5)) => return None,
                FaultKind::Garbage if happens(1.0) => garble(&mut passed.message, random),
                FaultKind::Wrong => demand_otherwise(&mut passed.message, fault),
                FaultKind::Stale => grow_old(&mut passed.message, ticks(100.0)),
                FaultKind::Corrupt if happens(1.0) => flip(&mut passed.message, fault.count.unwrap_or(3), random),
                FaultKind::Delay => passed.ticks_late += ticks(20.0),
                FaultKind::Duplicate => passed.twice |= happens(1.0),
                FaultKind::Reorder => passed.overtaken |= happens(0.5),
                _ => {}
            }
        }
        Some(passed)
    }
}

/// Message that is not lost, and how it is delivered.
struct Passed<M> {
    message: M,
    ticks_late: u64,
    twice: bool,
    overtaken: bool,
}

/// Replaces every number of the payload by NaN, infinity or random bits; the checksum fits, as for a faulty publisher.
fn garble<M: Message>(message: &mut M, random: impl Fn(u64) -> u64) {
    for (i, word) in words(message)[Stamp::SHAPE.len()..].iter_mut().enumerate() {
        let bits = random(1 + i as u64);
        *word = match bits % 3 {
            0 => f64::NAN.to_bits(),
            1 => f64::INFINITY.to_bits(),
            _ => bits,
        };
    }
    *message = message.with_checksum();
}

/// Changes the numbers that the receiver acts on, as the fault's `how` and `value` say; the checksum fits.
fn demand_otherwise<M: Message>(message: &mut M, fault: &Fault) {
    for demanded in M::FIELDS.iter().filter(|field| field.mark == Some(FieldMark::Demand)) {
        for word in &mut words(message)[demanded.words.clone()] {
            let value = f64::from_bits(*word);
            let wrong = match fault.wrong() {
                Wrong::Sign => -value,
                Wrong::Scale => value * fault.value.unwrap_or(1.5),
                Wrong::Bias => value + fault.value.unwrap_or(0.2),
            };
            *word = wrong.to_bits();
        }
    }
    *message = message.with_checksum();
}

/// Sets the stamp to a sample `ticks` earlier; the checksum fits.
fn grow_old<M: Message>(message: &mut M, ticks: u64) {
    let stamp = message.stamp_mut();
    stamp.tick = stamp.tick.saturating_sub(ticks);
    *message = message.with_checksum();
}

/// Flips `bits` random bits of the whole message; the checksum stays as it was.
fn flip<M: Message>(message: &mut M, bits: u64, random: impl Fn(u64) -> u64) {
    let bytes = bytemuck::bytes_of_mut(message);
    for i in 0..bits {
        let bit = random(1 + i) as usize % (bytes.len() * 8);
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

fn bits<M: Message>(message: &M) -> &[u8] {
    bytemuck::bytes_of(message)
}

fn words<M: Message>(message: &mut M) -> &mut [u64] {
    bytemuck::cast_slice_mut(bytemuck::bytes_of_mut(message))
}

/// Random bits for one fault on one tick: `SplitMix64` (Steele, Lea, Flood 2014) over seed, fault, tick and `salt`.
fn draw(seed: u64, fault: u64, tick: u64, salt: u64) -> u64 {
    [fault, tick, salt].into_iter().fold(mix(seed), |state, word| mix(state ^ mix(word)))
}

fn mix(word: u64) -> u64 {
    let z = word.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Converts random bits to a number from 0 to below 1.
fn share(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests;
