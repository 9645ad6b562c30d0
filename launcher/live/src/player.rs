//! Plays a recorded flight: at each time the page looks like a live page that has seen the flight up to that time.
//!
//! The log is read once, before it is played, through the same `Frames`. The player keeps the rows, the timing of every
//! second and the state of the nodes, and can show any time at once, forwards and backwards. The position belongs to
//! the server: all browsers see the same position, and each can change it.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context;
use flight::event::TimedEvent;
use flight::log::Record;
use outcome::happenings::Happenings;
use outcome::recorded::{Recorded, TimeSpan};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::frames::{Frames, PlotRow};
use crate::hub::{FrameKind, Hub, KEPT_ROWS};
use crate::nodes::NodeStates;
use crate::orders::OrderAnswer;

/// Time between two steps of the player.
const STEP: Duration = Duration::from_millis(40);
/// Time of the flight between two samples of the timing \[s\].
const TIMING_S: f64 = 1.0;
/// Speeds that an order may give, as multiples of real time.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.1..=20.0;

/// Order of the page of a recorded flight.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PlayOrder {
    /// Plays on; from the beginning if the flight is at its end.
    Play {},
    Pause {},
    Seek {
        time_s: f64,
    },
    Speed {
        speed: f64,
    },
}

/// Recorded flight, with the position that its page shows.
pub struct Player {
    recording: Recording,
    wish: Mutex<Wish>,
}

/// Position in the flight, and the speed that users have chosen.
#[derive(Debug, Clone, Copy)]
struct Wish {
    position_s: f64,
    speed: f64,
    is_playing: bool,
    /// `true` if the position has jumped since it was last shown.
    has_jumped: bool,
    /// `true` until the first browser comes, when the flight begins to play, or until the first order.
    is_new: bool,
}

/// Parts of the flight by time \[s\]. Each list is in the order of time.
struct Recording {
    flight: Value,
    rows: Vec<PlotRow>,
    timing: Vec<(f64, Value)>,
    status: Vec<(f64, Value)>,
    happened: Happenings,
    /// Times at which something happened \[s\].
    happened_s: Vec<f64>,
}

impl Player {
    /// Reads a part of the `run` whose flight had the `events`.
    ///
    /// # Errors
    /// The log cannot be read, or has no sample of the plant in that part.
    pub fn read(run: &Path, part: TimeSpan, events: &[TimedEvent]) -> anyhow::Result<Self> {
        let mut taken: Option<Taken> = None;
        Recorded::read_each(run, part, |scenario, record| {
            taken.get_or_insert_with(|| Taken::new(Frames::new(scenario), scenario.sample_s(), events)).observe(record);
        })?;
        let mut recording = taken.and_then(Taken::finish).with_context(|| {
            format!("{} has no sample of the plant to show; give another part by --from and --to", run.display())
        })?;
        let [begin_s, end_s] = recording.span_s();
        recording.flight["run"] = json!(run.display().to_string());
        recording.flight["begin_s"] = json!(begin_s);
        recording.flight["end_s"] = json!(end_s);
        let wish = Wish { position_s: begin_s, speed: 1.0, is_playing: false, has_jumped: true, is_new: true };
        Ok(Self { recording, wish: Mutex::new(wish) })
    }

    /// Carries out an order; the answer has the reason if the order failed.
    pub fn carry_out(&self, order: &PlayOrder) -> OrderAnswer {
        let done = self.change(order);
        let ok = done.is_ok();
        OrderAnswer { line: String::new(), ok, said: done.unwrap_or_else(|why| why) }
    }

    fn change(&self, order: &PlayOrder) -> Result<String, String> {
        let [begin_s, end_s] = self.recording.span_s();
        let mut wish = self.wish();
        match *order {
            PlayOrder::Play {} => {
                if wish.position_s >= end_s {
                    (wish.position_s, wish.has_jumped) = (begin_s, true);
                }
                wish.is_playing = true;
            }
            PlayOrder::Pause {} => wish.is_playing = false,
            PlayOrder::Seek { time_s } if (begin_s..=end_s).contains(&time_s) => {
                (wish.position_s, wish.has_jumped) = (time_s, true);
            }
            PlayOrder::Seek { time_s } => {
                return Err(format!("{time_s} s is not in what is played: it goes from {begin_s:.2} to {end_s:.2} s"));
            }
            PlayOrder::Speed { speed } if SPEEDS.contains(&speed) => wish.speed = speed,
            PlayOrder::Speed { speed } => {
                let (least, most) = (SPEEDS.start(), SPEEDS.end());
                return Err(format!("{speed} is no speed: it goes from {least} to {most} times real time"));
            }
        }
        wish.is_new = false;
        let Wish { position_s, speed, is_playing, .. } = *wish;
        let does = if is_playing { "plays" } else { "paused" };
        Ok(format!("{does} at {position_s:.2} s, {speed} times real time"))
    }

    /// Plays until an interrupt.
    pub fn run(&self, hub: &Hub, interrupts: &AtomicU32) {
        hub.send(FrameKind::Flight, self.recording.flight.clone());
        let (mut shown, mut last) = (Shown::default(), Instant::now());
        while interrupts.load(Ordering::Relaxed) == 0 {
            let passed_s = last.elapsed().as_secs_f64();
            last = Instant::now();
            let wish = self.advance(passed_s, hub.has_viewers());
            self.recording.show(wish, &mut shown, hub);
            std::thread::sleep(STEP);
        }
        hub.send(FrameKind::Phase, json!({ "phase": "ended", "why": "the page's server was stopped" }));
        hub.close();
    }

    /// Moves the position by the time that has passed, and returns the position and speed to show.
    fn advance(&self, passed_s: f64, has_viewers: bool) -> Wish {
        let end_s = self.recording.span_s()[1];
        let mut wish = self.wish();
        if wish.is_new && has_viewers {
            (wish.is_new, wish.is_playing) = (false, true);
        } else if wish.is_playing {
            wish.position_s = (wish.position_s + passed_s * wish.speed).min(end_s);
            wish.is_playing = wish.position_s < end_s;
        }
        let now = *wish;
        wish.has_jumped = false;
        now
    }

    fn wish(&self) -> MutexGuard<'_, Wish> {
        self.wish.lock().unwrap_or_else(PoisonError::into_inner) // a panic leaves no change half done
    }
}

/// State last sent to the hub: numbers of entries of the recording up to the position, and the position.
#[derive(Default)]
struct Shown {
    rows: usize,
    timing: usize,
    status: usize,
    /// Number of happenings; `None` until they were sent once.
    happened: Option<usize>,
    position: Value,
    phase: &'static str,
}

impl Recording {
    /// Returns the times of the first row and of the last \[s\].
    fn span_s(&self) -> [f64; 2] {
        [self.rows.first(), self.rows.last()].map(|row| row.map_or(0.0, |row| row.time_s))
    }

    /// Sends the parts that have changed since `shown`.
    fn show(&self, wish: Wish, shown: &mut Shown, hub: &Hub) {
        let Wish { position_s, speed, is_playing, has_jumped, .. } = wish;
        let [_, end_s] = self.span_s();
        let rows = self.rows.partition_point(|row| row.time_s <= position_s);
        let json = |from: usize| self.rows[from..rows].iter().map(|row| row.json.clone()).collect();
        if has_jumped {
            hub.send_rows(json(rows.saturating_sub(KEPT_ROWS)), true);
        } else if rows > shown.rows {
            hub.send_rows(json(shown.rows), false);
        }
        shown.rows = rows;
        for (kind, all, shown) in
            [(FrameKind::Status, &self.status, &mut shown.status), (FrameKind::Timing, &self.timing, &mut shown.timing)]
        {
            let count = all.partition_point(|(time_s, _)| *time_s <= position_s);
            if *shown != count && count > 0 {
                hub.send(kind, all[count - 1].1.clone());
            }
            *shown = count;
        }
        let happened = self.happened_s.partition_point(|time_s| *time_s <= position_s);
        if shown.happened.replace(happened) != Some(happened) {
            hub.send(FrameKind::Happened, json!(self.happened.until(position_s)));
        }
        let position = json!({ "position_s": position_s, "speed": speed, "playing": is_playing });
        if shown.position != position {
            hub.send(FrameKind::Position, position.clone());
            shown.position = position;
        }
        let phase = match is_playing {
            true => "playing",
            false if position_s >= end_s => "at the end",
            false => "paused",
        };
        if std::mem::replace(&mut shown.phase, phase) != phase {
            hub.send(FrameKind::Phase, json!({ "phase": phase }));
        }
    }
}

/// Log that is being read.
struct Taken<'a> {
    frames: Frames,
    nodes: NodeStates,
    sample_s: f64,
    /// Events that are still to come, the next one last.
    events: Vec<&'a TimedEvent>,
    rows: Vec<PlotRow>,
    timing: Vec<(f64, Value)>,
    status: Vec<(f64, Value)>,
    /// Time from which the next sample of the timing is due \[s\].
    due_s: f64,
}

impl<'a> Taken<'a> {
    fn new(frames: Frames, sample_s: f64, events: &'a [TimedEvent]) -> Self {
        let mut events: Vec<&TimedEvent> = events.iter().collect();
        events.sort_by(|a, b| b.at_s.total_cmp(&a.at_s)); // the next event is the last entry
        let (rows, timing, status) = Default::default();
        Self { frames, nodes: NodeStates::default(), sample_s, events, rows, timing, status, due_s: f64::NEG_INFINITY }
    }

    fn observe(&mut self, record: &Record) {
        let is_sample = matches!(record, Record::State(_)) && record.is_intact();
        let now_s = record.tick() as f64 * self.sample_s;
        if is_sample {
            while let Some(event) = self.events.pop_if(|event| event.at_s <= now_s) {
                self.frames.note(event);
                self.nodes.note(&event.event);
            }
        }
        self.frames.observe(record);
        self.nodes.observe(record);
        if is_sample {
            self.sample(now_s);
        }
    }

    /// Keeps the rows, the state of the nodes and the timing at a sample.
    fn sample(&mut self, now_s: f64) {
        self.rows.extend(self.frames.rows());
        let status = self.nodes.status();
        if self.status.last().is_none_or(|(_, last)| *last != status) {
            self.status.push((now_s, status));
        }
        if now_s >= self.due_s {
            self.timing.push((now_s, self.frames.timing(&self.frames.happenings())));
            self.due_s = now_s + TIMING_S;
        }
    }

    /// Returns the recording; `None` if it has no row.
    fn finish(mut self) -> Option<Recording> {
        self.frames.finish();
        self.rows.extend(self.frames.rows());
        let end_s = self.rows.last()?.time_s;
        let happened = self.frames.happenings();
        self.timing.push((end_s, self.frames.timing(&happened)));
        let (flight, happened_s) = (self.frames.flight(), happened.times_s());
        let Self { rows, timing, status, .. } = self;
        Some(Recording { flight, rows, timing, status, happened, happened_s })
    }
}
