//! Plant that a tool advances period by period.

use std::path::PathBuf;

use bytemuck::{bytes_of, cast_slice, pod_read_unaligned};
use contract::message::{ActuationMsg, Actuators, PlantStatus, Sample, Stamp, State};
use contract::snapshot::PLANT_WORDS;
use plant::Plant;
use plant::vehicle::start;
use settings::Scenario;

use crate::description::{SCENARIO_FILE, check};
use crate::variables::{SETTINGS, TIME, input, output};

/// Largest difference between a time or step and a whole number of periods, in periods.
const MOST_OFF: f64 = 1e-6;

/// Size of a state as bytes: command, STATE, memory of the plant.
pub const STATE_BYTES: usize = size_of::<ActuationMsg>() + size_of::<State>() + 8 * PLANT_WORDS;

/// State of an instance that a tool can store and set again: the plant, its newest sample, and the command.
#[derive(Clone)]
pub struct Saved {
    command: ActuationMsg,
    flown: Option<Flown>,
}

/// Plant that is initialised.
#[derive(Clone)]
struct Flown {
    plant: Plant,
    sample: Sample,
}

/// Instance of the FMU.
pub struct Instance {
    resources: PathBuf,
    /// Settings of the resources; from the initialisation on, with the parameter `settings` on top.
    scenario: Scenario,
    /// Lines of the parameter `settings`.
    pub settings: String,
    start_s: f64,
    saved: Saved,
}

impl Instance {
    /// Creates the instance of an FMU whose resources are in the folder `resources`.
    pub fn new(resources: PathBuf) -> Result<Self, String> {
        let scenario = load(&resources, "")?;
        let (_, trim) = start(&scenario);
        let saved = Saved { command: trim.into(), flown: None };
        Ok(Self { resources, scenario, settings: String::new(), start_s: 0.0, saved })
    }

    /// Starts the plant at `start_s`.
    pub fn initialise(&mut self, start_s: f64) -> Result<(), String> {
        self.scenario = load(&self.resources, &self.settings)?;
        let mut plant = Plant::new(&self.scenario);
        let sample = Sample { state: plant.sample(), truth: plant.truth() };
        self.saved.flown = Some(Flown { plant, sample });
        self.start_s = start_s;
        Ok(())
    }

    /// Returns to the state after [`new`](Self::new).
    pub fn reset(&mut self) -> Result<(), String> {
        *self = Self::new(self.resources.clone())?;
        Ok(())
    }

    /// Moves by a step from `time_s`; returns `false` if the vehicle has diverged.
    pub fn step(&mut self, time_s: f64, step_s: f64) -> Result<bool, String> {
        let sample_s = self.scenario.sample_s();
        let whole = |time_s: f64| {
            let periods = time_s / sample_s;
            let near = periods.round();
            ((periods - near).abs() < MOST_OFF && near >= 0.0).then_some(near as u64)
        };
        let Flown { plant, sample } = self.saved.flown.as_mut().ok_or("the FMU is not initialised")?;
        if whole(time_s - self.start_s) != Some(sample.truth.tick) {
            let now_s = self.start_s + sample.truth.tick as f64 * sample_s;
            return Err(format!("the step begins at {time_s:?} s, and the plant is at {now_s:?} s"));
        }
        let periods = whole(step_s).filter(|periods| *periods > 0);
        let periods = periods.ok_or_else(|| format!("a step of {step_s:?} s is no multiple of {sample_s:?} s"))?;
        for _ in 0..periods {
            let tick = sample.truth.tick;
            let stamp = Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() };
            plant.command(&Actuators { stamp, command: self.saved.command, ..Actuators::default() }, 0);
            plant.advance(1).map_err(|error| error.to_string())?;
            *sample = Sample { state: plant.sample(), truth: plant.truth() };
        }
        Ok(!PlantStatus::from_wire(sample.state.status).is_some_and(PlantStatus::diverged))
    }

    /// Returns the values of the variable `reference`; `None` if it is unknown, or known only after the initialisation.
    pub fn get(&mut self, reference: u32) -> Option<Vec<f64>> {
        let flown = self.saved.flown.as_ref();
        if reference == TIME {
            let ticks = flown.map_or(0, |flown| flown.sample.truth.tick);
            return Some(vec![self.start_s + ticks as f64 * self.scenario.sample_s()]);
        }
        let outputs = flown.and_then(|flown| output(&flown.sample, reference)).map(<[f64]>::to_vec);
        outputs.or_else(|| input(&mut self.saved.command, reference).map(|values| values.to_vec()))
    }

    /// Returns the numbers of the input `reference`; `None` if there is no such input.
    pub fn input(&mut self, reference: u32) -> Option<&mut [f64]> {
        input(&mut self.saved.command, reference)
    }

    /// Sets the parameter `reference`.
    pub fn set_text(&mut self, reference: u32, text: &str) -> Result<(), String> {
        if reference != SETTINGS || self.saved.flown.is_some() {
            return Err(format!(
                "no text can be set as variable {reference} now: `settings` can be before initialisation"
            ));
        }
        text.clone_into(&mut self.settings);
        load(&self.resources, text).map(drop)
    }

    /// Returns the state.
    pub fn state(&self) -> Saved {
        self.saved.clone()
    }

    /// Sets a state of this FMU.
    pub fn set_state(&mut self, saved: &Saved) {
        self.saved = saved.clone();
    }

    /// Reads a state that [`serialise`](Saved::serialise) has written with the same settings.
    pub fn deserialise(&self, bytes: &[u8]) -> Result<Saved, String> {
        if bytes.len() != STATE_BYTES || self.saved.flown.is_none() {
            return Err(format!("a state has {STATE_BYTES} byte, and is read after initialisation"));
        }
        let (command, rest) = bytes.split_at(size_of::<ActuationMsg>());
        let (state, words) = rest.split_at(size_of::<State>());
        let state: State = pod_read_unaligned(state);
        let words: Vec<u64> = words.chunks_exact(8).map(pod_read_unaligned).collect();
        let mut plant = Plant::new(&self.scenario);
        if !plant.restore(state.stamp.tick, &words) {
            return Err("the bytes are no state of this FMU with these settings".into());
        }
        let sample = Sample { state, truth: plant.truth() };
        Ok(Saved { command: pod_read_unaligned(command), flown: Some(Flown { plant, sample }) })
    }
}

impl Saved {
    /// Writes the state to `bytes`, of which there must be [`STATE_BYTES`].
    pub fn serialise(&self, bytes: &mut [u8]) -> Result<(), String> {
        let mut flown = self.flown.clone().ok_or("a state before initialisation cannot be serialised")?;
        let mut words = vec![0; PLANT_WORDS];
        flown.plant.memory(&mut words).ok_or("the state cannot be serialised: the vehicle has diverged")?;
        let parts = [bytes_of(&self.command), bytes_of(&flown.sample.state), cast_slice(&words)].concat();
        if parts.len() != bytes.len() {
            return Err(format!("a state has {STATE_BYTES} byte"));
        }
        bytes.copy_from_slice(&parts);
        Ok(())
    }
}

/// Loads the settings of the resources, with the lines of `settings` on top.
fn load(resources: &std::path::Path, settings: &str) -> Result<Scenario, String> {
    let overrides: Vec<String> = settings.lines().filter(|line| !line.trim().is_empty()).map(str::to_owned).collect();
    let scenario = settings::load(Some(&resources.join(SCENARIO_FILE)), &overrides);
    let scenario = scenario.map_err(|error| error.to_string())?;
    check(&scenario)?;
    Ok(scenario)
}
