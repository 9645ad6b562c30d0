//! Settings and faults that each process of a flight flew with. The messages stay in the log.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use contract::Topic;
use flight::event::{Event, What};
use flight::log::{self, LogSpan, Memory};
use flight::programs;
use folder::files;
use outcome::recorded::Recorded;
use runtime::limits::HELD_MESSAGES;
use runtime::shared_role::Origin;
use settings::file::MAX_TEXT_BYTES;
use settings::{Fault, NodeSettings, ProgramKind, Scenario, candidate};

use crate::script::{LOOK_AHEAD, Script};

/// Largest number of samples of a script in memory: 16 minutes at 100 Hz take 260 MB.
const MOST_SAMPLES: u64 = 100_000;
/// Number of messages that are read before messages of computed processes are dropped.
const BATCH: u64 = 4096;

/// Flight as it was recorded, to be replayed.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Settings at the beginning of the flight, with the swaps that were ordered in flight.
    pub scenario: Scenario,
    /// Path of the log, or of its first file if several recorders wrote.
    pub(super) log: PathBuf,
    /// Faults given and changed in flight, in order, each with its number.
    pub(super) given: Vec<(usize, Fault)>,
    /// Messages in the log, by the topic of their node, including those that are not intact.
    pub(super) logged: [u64; Topic::COUNT],
    /// Last sample in the log.
    last_tick: u64,
    /// Processes of the nodes: topic and epoch.
    processes: Vec<(Topic, u64)>,
    /// Settings of candidates.
    pub(super) settings: HashMap<(Topic, u64), Scenario>,
    /// Libraries that the user has named, by topic and SHA-256, so that a replay may load them.
    trusted: Vec<(Topic, String)>,
}

impl Recording {
    /// Creates the recording of `run`.
    ///
    /// # Errors
    /// A process cannot be flown again, because its settings are missing.
    pub fn of(run: &Recorded) -> anyhow::Result<Self> {
        let settings = run.path.with_file_name("scenario.toml");
        let text = files::read_text(&settings, MAX_TEXT_BYTES).ok();
        let settled = text.and_then(|text| settings::from_merged(&text, &settings.display().to_string()).ok());
        let last_tick = run.summary.last.state.stamp.tick;
        Self::new(&run.path, &run.log.events, run.messages, last_tick, &run.scenario, settled.as_ref())
    }

    /// Creates the recording of a flight of `scenario` whose log at `path` has these `events`, numbers of messages by
    /// topic, and last sample. `settled` are the settings in the folder of the run, which have the swaps that were
    /// ordered in flight.
    ///
    /// # Errors
    /// The settings of a process are missing.
    pub fn new(
        path: &Path,
        events: &[Event],
        logged: [u64; Topic::COUNT],
        last_tick: u64,
        scenario: &Scenario,
        settled: Option<&Scenario>,
    ) -> anyhow::Result<Self> {
        let mut scenario = scenario.clone();
        let mut injected = events.iter().filter(|event| event.what == What::Injected);
        if let Some(first) = injected.find_map(|event| event.fault.as_ref()) {
            scenario.fault.truncate(first.0); // a joined log has these faults in its settings already
        }
        let given = events.iter().filter_map(|event| event.fault.as_deref().copied()).collect();
        scenario.swap = settled.map_or(scenario.swap, |settled| settled.swap.clone());
        let mut settings = HashMap::new();
        let mut processes = Topic::ALL.map(|topic| (topic, 1)).to_vec();
        for event in events.iter().filter(|event| event.what == What::Started) {
            let Event { node, epoch, origin, .. } = event;
            let Some(topic) = Topic::of_node(node) else { continue };
            let whose = (topic, u64::from(*epoch));
            processes.push(whose);
            let Some(swap) = origin else { continue };
            let lacks =
                || format!("the settings of {node} {epoch} are missing: scenario.toml of the run has no swap {swap}");
            let swap = scenario.swap.get(*swap).with_context(lacks)?;
            settings.insert(whose, candidate(&scenario, swap)?);
        }
        Ok(Self { scenario, log: path.into(), given, logged, last_tick, processes, settings, trusted: vec![] })
    }

    /// Returns the settings that a process of the flight had.
    pub fn settings_of(&self, topic: Topic, epoch: u64) -> &Scenario {
        self.settings.get(&(topic, epoch)).unwrap_or(&self.scenario)
    }

    /// Returns whether a process ran a program of its own, or a library that the user has not named to this replay. Its
    /// messages are then taken from the log: a folder from elsewhere may name any program, so none is started.
    pub fn is_foreign(&self, topic: Topic, epoch: u64) -> bool {
        let program = self.settings_of(topic, epoch).node.of(topic);
        let is_trusted = || self.trusted.iter().any(|(of, sha256)| *of == topic && sha256 == program.sha256());
        program.kind() == ProgramKind::Executable || program.kind() == ProgramKind::Library && !is_trusted()
    }

    /// Returns the processes that are [foreign](Self::is_foreign), by topic and epoch.
    pub fn foreign(&self) -> impl Iterator<Item = (Topic, u64)> {
        self.processes.iter().copied().filter(|(topic, epoch)| self.is_foreign(*topic, *epoch))
    }

    /// Lets a replay load the library at `file` for the node that publishes `topic`.
    ///
    /// # Errors
    /// No process of the node flew this file.
    pub fn trust(&mut self, topic: Topic, file: &str) -> anyhow::Result<()> {
        let name = topic.publisher();
        let mut found = NodeSettings { exec: file.into(), ..NodeSettings::default() };
        programs::pin(&mut found, name)?;
        let mut flown =
            self.settings.iter_mut().filter(|((of, _), _)| *of == topic).map(|(_, own)| own).collect::<Vec<_>>();
        flown.push(&mut self.scenario);
        let mut libraries: Vec<&mut NodeSettings> =
            flown.into_iter().map(|settings| settings.node.of_mut(topic)).collect();
        libraries.retain(|program| program.kind() == ProgramKind::Library);
        ensure!(!libraries.is_empty(), "{name} flew no library: leave out --program {name}={file}");
        let mut others = vec![];
        for program in &mut libraries {
            if program.sha256() == found.sha256() {
                program.move_to(found.exec.clone());
            } else {
                others.push(format!("{} (SHA-256 {})", program.exec, program.sha256()));
            }
        }
        let flew = others.join(" and ");
        ensure!(others.len() < libraries.len(), "{name} flew {flew}, and {file} is another file ({})", found.sha256());
        self.trusted.push((topic, found.sha256().into()));
        Ok(())
    }

    /// Creates a script, without messages, that begins at the newest memories of the nodes in the log before tick
    /// `from`; at tick 0 if there are none, or if a core keeps no memory. The script also takes in earlier messages,
    /// which may still be under way.
    ///
    /// # Errors
    /// The log cannot be read.
    pub(super) fn begin(&self, from: u64) -> anyhow::Result<Script> {
        if from == 0 {
            return Ok(Script::default());
        }
        let mut memories = log::memories(&self.log, self.log_time(from - 1))?;
        let of_vehicle = |memory: &Memory| memory.topic == Topic::State && memory.origin.done == memory.tick + 1;
        let keeps_none = |memory: &Memory| memory.origin == Origin::default();
        let unfit = |memory: &Memory| memory.tick >= from || keeps_none(memory);
        if !memories.iter().any(of_vehicle) || memories.iter().any(unfit) {
            memories.clear();
        }
        Ok(Script::beginning_with(memories, 2 * HELD_MESSAGES as u64))
    }

    /// Returns the log time of `tick` \[ns\].
    fn log_time(&self, tick: u64) -> u64 {
        tick.saturating_mul(self.scenario.sample_ns())
    }

    /// Returns the span of the log for a replay up to tick `until`. It ends later, because a process that slept may
    /// have read later messages.
    pub(super) fn span(&self, script: &Script, until: u64) -> LogSpan {
        self.log_time(script.begins)..=self.log_time(until.saturating_add((LOOK_AHEAD / Topic::COUNT) as u64))
    }

    /// Reads the script of the flight into memory, from the last place before tick `from` where a script can begin, up
    /// to tick `until`. Messages of processes that can be computed are left out.
    ///
    /// # Errors
    /// The flight is too long, or the log cannot be read.
    pub fn script(&self, from: u64, until: u64) -> anyhow::Result<Script> {
        let mut script = self.begin(from)?;
        let samples = until.min(self.last_tick).saturating_sub(script.begun_at());
        ensure!(
            samples <= MOST_SAMPLES,
            "a flight of {samples} samples is too long: at most {MOST_SAMPLES} are held in memory; take a part of it, with --from and --to"
        );
        let mut taken = 0_u64;
        log::stream(&self.log, self.span(&script, until), |_, record| {
            if record.tick() > until {
                return;
            }
            script.push(record);
            taken += 1;
            if taken.is_multiple_of(BATCH) {
                script.forget_messages(|topic, epoch| !self.is_foreign(topic, epoch));
            }
        })?;
        script.finish();
        Ok(script)
    }
}
