//! What was flown: the recorded messages of a run, joined by the plant sample they descend from.

use contract::Scenario;
use contract::message::{Actuators, Controls, Message, Reference, State};
use guidance::Trajectory;

use crate::summary;
use flight::log::{Record, counted};

/// The recorded messages, one slice per topic. Any of them may have holes, be torn off, or be empty.
#[derive(Debug, Clone, Copy)]
pub struct Flight<'a> {
    /// From the plant.
    pub states: &'a [State],
    /// From guidance.
    pub references: &'a [Reference],
    /// From attitude-mpc.
    pub controls: &'a [Controls],
    /// From the mixer.
    pub actuators: &'a [Actuators],
}

/// What is known of one tick.
#[derive(Debug, Clone, Copy, Default)]
pub struct Row<'a> {
    /// Where the mission wants the vehicle, NED \[m\].
    pub wanted_m: [f64; 3],
    /// The sample itself.
    pub state: Option<&'a State>,
    /// What guidance made of it.
    pub reference: Option<&'a Reference>,
    /// What attitude-mpc made of that.
    pub controls: Option<&'a Controls>,
    /// What the mixer made of that.
    pub actuators: Option<&'a Actuators>,
}

impl<'a> Flight<'a> {
    /// One row for every tick from 0 to the last recorded one, holes included.
    ///
    /// Ticks beyond the last of the scenario are ignored: a corrupt stamp must not decide how much memory this takes. A row has what
    /// was said active, as it was meant: what a fault made of it on its way is not drawn. Of several messages with one
    /// tick the last counts.
    pub fn rows(&self, scenario: &Scenario) -> Vec<Row<'a>> {
        let last_tick = scenario.ticks();
        let ends = [
            end(self.states, last_tick),
            end(self.references, last_tick),
            end(self.controls, last_tick),
            end(self.actuators, last_tick),
        ];
        let trajectory = Trajectory::new(&scenario.mission);
        let wanted_m = |tick: usize| trajectory.at(tick as f64 * scenario.sample_s()).position_m;
        let empty = |tick| Row { wanted_m: wanted_m(tick), ..Row::default() };
        let mut rows: Vec<Row> = (0..ends.into_iter().max().unwrap_or(0)).map(empty).collect();
        place(&mut rows, self.states, |row, message| row.state = Some(message));
        place(&mut rows, self.references, |row, message| row.reference = Some(message));
        place(&mut rows, self.controls, |row, message| row.controls = Some(message));
        place(&mut rows, self.actuators, |row, message| row.actuators = Some(message));
        rows
    }
}

impl Row<'_> {
    /// Position error against the mission, as in run.json: no message of guidance, which may be old or missing, is in it.
    pub fn position_error_m(&self) -> Option<[f64; 3]> {
        Some(summary::position_error_m(self.wanted_m, self.state?))
    }
}

/// How many rows these messages need.
fn end<M: Message>(messages: &[M], last_tick: u64) -> usize
where
    Record: From<M>,
{
    let ticks = counted(messages).map(|(message, _)| message.stamp().tick);
    ticks.filter(|tick| *tick <= last_tick).max().map_or(0, |tick| tick as usize + 1)
}

/// Puts every message into the row of its tick.
fn place<'a, M: Message>(rows: &mut [Row<'a>], messages: &'a [M], put: impl Fn(&mut Row<'a>, &'a M))
where
    Record: From<M>,
{
    for (message, _) in counted(messages) {
        if let Some(row) = rows.get_mut(message.stamp().tick as usize) {
            put(row, message);
        }
    }
}
