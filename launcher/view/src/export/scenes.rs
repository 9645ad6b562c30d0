//! A run as one MCAP file with pictures: its messages and events as they are, and the scenes of [`crate::scene`].

use std::path::Path;

use contract::message::Truth;
use flight::event::Event;
use flight::log::{self, LogWriter, Record};
use folder::dir::{Dir, NewFile};
use settings::{Scenario, to_toml};

use super::sink::Sink;
use crate::scene::{DerivedMessage, Scene, SceneChannel};

pub struct Scenes<'a> {
    file: NewFile<'a>,
    log: LogWriter,
    /// Number of each channel of the scene.
    channels: [u16; SceneChannel::ALL.len()],
    scene: Scene,
}

impl<'a> Scenes<'a> {
    /// Begins the file `name` in `folder` for a run of `scenario` whose log is at `path`.
    pub fn begin(folder: &'a Dir, name: &str, scenario: &Scenario, path: &Path) -> anyhow::Result<Self> {
        // No message lies in this span, so only the events are read.
        let log::Log { events, written_by, .. } = log::stream(path, u64::MAX..=u64::MAX, |_, _| {})?;
        let run = format!("{}-scenes", written_by.run);
        let file = folder.begin(name)?;
        let (settings, sample_ns) = (to_toml(scenario), scenario.sample_ns());
        let mut log = LogWriter::begin(file.handle()?, &folder.at(name), &settings, sample_ns, &run)?;
        let mut channels = [0; SceneChannel::ALL.len()];
        for (number, channel) in channels.iter_mut().zip(SceneChannel::of_log()) {
            *number = log.add_channel(&channel)?;
        }
        let mut scene = Scene::new(scenario);
        for event in &events {
            scene.on_event(event); // applies faults of the wind, each with its time
        }
        let fixed = scene.fixed();
        let mut scenes = Self { file, log, channels, scene };
        scenes.derived(fixed)?;
        Ok(scenes)
    }

    fn derived(&mut self, derived: Vec<DerivedMessage>) -> anyhow::Result<()> {
        derived.into_iter().try_for_each(|DerivedMessage { channel, time_ns, bytes }| {
            self.log.write_encoded(self.channels[channel as usize], time_ns, &bytes)
        })
    }
}

impl Sink for Scenes<'_> {
    fn message(&mut self, record: &Record, _: Option<&Truth>) -> anyhow::Result<()> {
        self.log.write(record)?;
        let derived = self.scene.on_record(record);
        self.derived(derived)
    }

    fn event(&mut self, event: &Event) -> anyhow::Result<()> {
        self.log.write_event(event)?;
        let derived = self.scene.on_event(event);
        self.derived(vec![derived])
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<String>> {
        self.log.finish()?;
        self.file.finish()?;
        Ok(None)
    }
}
