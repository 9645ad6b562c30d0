//! The parent's end of a child that flies with libraries.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use contract::guard::Refusal;
use contract::topic::Topic;
use ring::stepped::SteppedResult;
use runtime::error::SessionError;
use runtime::realtime::{SharedPipes, die_with_parent, now_ns};
use settings::Scenario;

use super::frames::{ChildAnswer, ChildRequest, ChildWork, End};
use crate::event::{Event, What};
use crate::log::{Memory, Record};
use crate::stack::Ended;
use crate::stack::children::kill;
use crate::strays::ChildMark;
use crate::{libraries, own_program};

/// Longest sleep between two looks at a child, so that its end is noticed.
const LOOK: Duration = Duration::from_millis(5);

/// Child that flies with libraries; dead if the last flight ended it.
pub struct ChildHost {
    child: Child,
    /// Mark of the child and of the processes that it starts.
    mark: ChildMark,
    pipes: SharedPipes,
    /// Number of the newest flight.
    flight: u16,
    /// Environment variables of all nodes, with which the child was started.
    env: BTreeMap<String, String>,
    /// Libraries that the child flies with, loaded in its first flight: the file of each, and its hash.
    libraries: BTreeSet<(String, String)>,
    /// Words of answers that were read; the first `taken` of them were decoded.
    words: Vec<u64>,
    taken: usize,
    /// `true` if the child waits for a flight.
    pub is_idle: bool,
}

/// End of a flight that its library has cut short.
struct Loss {
    what: What,
    why: String,
}

impl ChildHost {
    /// Starts a child for these `libraries`, with these environment variables. The output of the child goes to the
    /// launcher's stderr.
    pub fn start(env: BTreeMap<String, String>, libraries: BTreeSet<(String, String)>) -> Result<Self, SessionError> {
        let start = || -> io::Result<Self> {
            let (pipes, file) = SharedPipes::create()?;
            let mut command = own_program();
            command.arg("fly-guarded").envs(&env).process_group(0);
            command.stdin(file).stdout(io::stderr()).stderr(Stdio::inherit());
            die_with_parent(&mut command);
            let mark = ChildMark::on(&mut command);
            let child = command.spawn()?;
            Ok(Self { child, mark, pipes, flight: 0, env, libraries, words: vec![], taken: 0, is_idle: true })
        };
        start().map_err(|why| SessionError::Io { what: "a process to fly libraries in".into(), why })
    }

    /// Returns whether the child has exactly the libraries of `scenario`, and the environment variables that the
    /// scenario gives them.
    pub fn suits(&self, scenario: &Scenario) -> bool {
        self.env == libraries::env_of(scenario) && self.libraries == libraries::files(scenario)
    }

    /// Lets the child fly `scenario`. `watch` gets every message until it returns false, `remember` every snapshot.
    ///
    /// # Errors
    /// The flight cannot be flown.
    pub fn fly(
        &mut self,
        scenario: &Scenario,
        with_checksums: bool,
        mut watch: impl FnMut(&Record) -> bool,
        mut remember: impl FnMut(&Memory),
    ) -> Result<SteppedResult, SessionError> {
        self.is_idle = false;
        self.flight = self.flight.wrapping_add(1);
        let work = ChildWork::Fly { with_checksums };
        let request = ChildRequest { flight: self.flight, work, scenario: scenario.clone() };
        let limit_s = scenario.supervision.wall_limit_s;
        let limit = (limit_s > 0.0).then(|| Duration::from_secs_f64(limit_s));
        let mut tick = 0;
        let lost = match self.send(&request.to_words()) {
            Err(loss) => loss,
            Ok(()) => loop {
                match self.next(limit) {
                    Ok(ChildAnswer::Record(record)) => {
                        tick = record.tick();
                        if !watch(&record) {
                            return Ok(flown(Ended::Flown, vec![]));
                        }
                    }
                    Ok(ChildAnswer::Memory(memory)) => remember(&memory),
                    Ok(ChildAnswer::End(end, is_as_before)) => {
                        self.is_idle = is_as_before && self.taken == self.words.len();
                        return match end {
                            End::Flown(flown) => Ok(flown),
                            End::Refused(why) => Err(SessionError::InChild(why)),
                            End::Panicked(said) => panic!("{said}"),
                            End::Tried => Err(SessionError::InChild("it has damaged the memory of its process".into())),
                        };
                    }
                    Err(loss) => break loss,
                }
            },
        };
        Ok(lost_flight(scenario, tick, &lost))
    }

    /// Lets the child try the library of `node`, or all libraries of `scenario`; returns why they cannot be flown.
    pub fn try_out(mut self, scenario: &Scenario, node: Option<Topic>, limit: Duration) -> Result<(), String> {
        let work = ChildWork::Try { node: node.map(|topic| topic.publisher().to_owned()) };
        let request = ChildRequest { flight: self.flight, work, scenario: scenario.clone() };
        match self.send(&request.to_words()).and_then(|()| self.next(Some(limit))) {
            Ok(ChildAnswer::End(End::Tried, _)) => Ok(()),
            Ok(ChildAnswer::End(End::Refused(why), _)) => Err(why),
            Err(Loss { what: What::Hung, .. }) => {
                Err(format!("it did not load and answer within {} s", limit.as_secs()))
            }
            Err(Loss { why, .. }) | Ok(ChildAnswer::End(End::Panicked(why), _)) => {
                Err(format!("it ended the process that tried it ({why})"))
            }
            Ok(_) => Err("it has damaged the memory of its process".into()),
        }
    }

    fn send(&mut self, mut words: &[u64]) -> Result<(), Loss> {
        while !words.is_empty() {
            let count = self.pipes.requests.write(words);
            words = &words[count..];
            self.pipes.requests.wake_reader();
            if count == 0 {
                self.pipes.requests.wait_for_room(now_ns() + LOOK.as_nanos() as u64);
                self.exit().map_or(Ok(()), Err)?;
            }
        }
        Ok(())
    }

    /// Waits for the next answer, at most `limit`.
    fn next(&mut self, limit: Option<Duration>) -> Result<ChildAnswer, Loss> {
        let began = Instant::now();
        loop {
            if let Some(answer) = self.take()? {
                return Ok(answer);
            }
            let gone = self.exit(); // seen before the last read, so that no answer is overlooked
            if self.pipes.answers.read(&mut self.words) > 0 {
                continue;
            }
            if let Some(loss) = gone {
                return Err(loss);
            }
            if let Some(limit) = limit.filter(|limit| began.elapsed() > *limit) {
                let why = format!("has not answered for {} s, `supervision.wall_limit_s`", limit.as_secs_f64());
                return Err(Loss { what: What::Hung, why });
            }
            self.pipes.answers.wait_for_words(now_ns() + LOOK.as_nanos() as u64);
        }
    }

    /// Takes the next answer from the words that were read; `None` if no complete answer is there.
    fn take(&mut self) -> Result<Option<ChildAnswer>, Loss> {
        let taken = ChildAnswer::take(self.flight, &self.words, &mut self.taken);
        let taken = taken.map_err(|why| Loss { what: What::Died, why })?;
        if taken.is_none() {
            self.words.drain(..self.taken);
            self.taken = 0;
        }
        Ok(taken)
    }

    /// Returns how the child has ended, if it has.
    fn exit(&mut self) -> Option<Loss> {
        let status = self.child.try_wait().ok().flatten()?;
        Some(Loss { what: What::Died, why: in_words(status) })
    }
}

impl Drop for ChildHost {
    fn drop(&mut self) {
        kill(&mut self.child);
        self.mark.kill_all();
    }
}

/// Describes the end of a child in words that follow "library".
pub(super) fn in_words(status: ExitStatus) -> String {
    let name = |signal: i32| match signal {
        4 => "SIGILL".to_owned(),
        6 => "SIGABRT".to_owned(),
        7 => "SIGBUS".to_owned(),
        8 => "SIGFPE".to_owned(),
        9 => "SIGKILL".to_owned(),
        11 => "SIGSEGV".to_owned(),
        other => format!("signal {other}"),
    };
    match status.signal() {
        Some(signal) => format!("crashed: {}", name(signal)),
        None => format!("ended its process with exit code {}", status.code().unwrap_or_default()),
    }
}

/// Makes the result of a flight that its library has ended after `tick`.
fn lost_flight(scenario: &Scenario, tick: u64, Loss { what, why }: &Loss) -> SteppedResult {
    let names: Vec<&str> = scenario.node.libraries().map(Topic::publisher).collect();
    let name = if names.is_empty() { "a candidate".to_owned() } else { names.join(" or ") };
    let events = names.first().map(|node| Event::new(tick, node, 1, *what).because(format!("its library {why}")));
    flown(Ended::Lost(format!("{name} (its library {why})")), events.into_iter().collect())
}

/// Makes the result of a flight whose end the child has not reported.
fn flown(ended: Ended, events: Vec<Event>) -> SteppedResult {
    let refused = Topic::ALL.map(|topic| (topic.publisher().into(), [0; Refusal::ALL.len()])).into();
    SteppedResult { ended, events, refused, failures: vec![] }
}
