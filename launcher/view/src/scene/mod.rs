//! Messages of a flight in Foxglove's well-known schemas, derived from those of the ring, so that viewers show a
//! vehicle that flies.
//!
//! | topic | schema | how often | holds |
//! |---|---|---|---|
//! | `/view/tf` | `FrameTransforms` | 20 Hz | `ned` to `body`, `body` to `rotor_1` (its tilt), `ned` to `reference` |
//! | `/view/arrows` | `SceneUpdate` | 10 Hz | the thrust of each rotor, and the mean wind |
//! | `/view/path` | `PosesInFrame` | 0.5 Hz | the last minute of the path flown |
//! | `/view/log` | `Log` | each event | the event in words |
//! | `/view/tf_static` | `FrameTransforms` | once | `map` (east, north, up) to `ned`, `body` to `rotor_2` and `rotor_3` |
//! | `/view/vehicle` | `SceneUpdate` | once | body, arms, rotors and the reference, in the frames above |
//! | `/view/course` | `PosesInFrame` | once | the course of the mission |
//!
//! `export --to foxglove` and the live server call the same [`Scene`]. Rates are lower than those of the ring, because
//! a picture needs no more: at 100 Hz, these messages add a tenth to a log (`docs/tools.md`). They show the true motion
//! and the true actuators, and leave out damaged messages and a REFERENCE that was not delivered. The thrust is `K_F
//! Omega^2`, without faults and effects of moving air. The wind is the mean wind at the vehicle, without turbulence.

mod parts;
mod shapes;

use std::collections::VecDeque;

use contract::message::{Message as _, Truth, quaternion};
use guidance::trajectory::Trajectory;
use plant::air::Air;
use prost::Message as _;
use settings::Scenario;

use self::parts::wire::foxglove::log::Level;
use self::parts::wire::foxglove::{FrameTransforms, Log, Pose, PosesInFrame, SceneEntity, SceneUpdate};
use self::parts::{BLUE, LEVEL, ORANGE, Timestamp, UP, along, arrow, entity, frame, pose, timestamp};
use flight::event::{Event, What, name};
use flight::log::{self, Record};

/// The schemas as logs carry them: a serialised `FileDescriptorSet`.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/foxglove.fds"));

/// Channel of derived messages, encoded as protobuf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SceneChannel {
    Frames,
    Arrows,
    Path,
    Log,
    FixedFrames,
    Vehicle,
    Course,
}

impl SceneChannel {
    pub const ALL: [Self; 7] =
        [Self::Frames, Self::Arrows, Self::Path, Self::Log, Self::FixedFrames, Self::Vehicle, Self::Course];

    /// Returns all channels of a scene as channels of a log.
    pub fn of_log() -> [log::Channel; Self::ALL.len()] {
        let channel = |channel: Self| log::Channel {
            topic: channel.topic().into(),
            schema: channel.schema(),
            descriptors: DESCRIPTORS,
            publisher: "launcher",
        };
        Self::ALL.map(channel)
    }

    pub const fn topic(self) -> &'static str {
        match self {
            Self::Frames => "/view/tf",
            Self::Arrows => "/view/arrows",
            Self::Path => "/view/path",
            Self::Log => "/view/log",
            Self::FixedFrames => "/view/tf_static",
            Self::Vehicle => "/view/vehicle",
            Self::Course => "/view/course",
        }
    }

    /// Full name of the schema of the channel's messages.
    pub const fn schema(self) -> &'static str {
        match self {
            Self::Frames | Self::FixedFrames => "foxglove.FrameTransforms",
            Self::Arrows | Self::Vehicle => "foxglove.SceneUpdate",
            Self::Path | Self::Course => "foxglove.PosesInFrame",
            Self::Log => "foxglove.Log",
        }
    }
}

/// One derived message.
#[derive(Debug, Clone, PartialEq)]
pub struct DerivedMessage {
    pub channel: SceneChannel,
    /// Simulated time \[ns\].
    pub time_ns: u64,
    /// The message as protobuf.
    pub bytes: Vec<u8>,
}

/// Time between two messages with the frames \[s\]: viewers interpolate between them.
const FRAMES_EVERY_S: f64 = 0.05;
/// Time between two messages with the arrows \[s\].
const ARROWS_EVERY_S: f64 = 0.1;
/// Time between two points of the path, and between two messages with the path \[s\].
const PATH_POINT_S: f64 = 0.5;
const PATH_EVERY_S: f64 = 2.0;
/// Number of points of the path, which last a minute.
const PATH_POINTS: usize = 120;
/// Largest number of points of the course, its time step \[s\], and the smallest distance between two points \[m\].
const COURSE_POINTS: usize = 500;
const COURSE_STEP_S: f64 = 0.25;
const COURSE_STEP_M: f64 = 0.1;

/// Lengths of arrows: metres for a newton of thrust, and for a metre per second of wind.
const THRUST_M_PER_N: f64 = 0.08;
const WIND_M_PER_MPS: f64 = 0.2;
/// Wind that is too weak for an arrow \[m/s\].
const CALM_MPS: f64 = 0.01;
/// Height of the wind's arrow above the vehicle \[m\].
const WIND_ABOVE_M: f64 = 0.6;

/// Derives messages for viewers from the messages of one flight.
pub struct Scene {
    scenario: Scenario,
    sample_ns: u64,
    wind: Air,
    path: VecDeque<[f64; 3]>,
    /// Position and attitude of the newest reference.
    reference: ([f64; 3], [f64; 3]),
    /// Newest tick that was shown.
    shown: Option<u64>,
}

impl Scene {
    /// Begins the scene of a flight of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            sample_ns: scenario.sample_ns(),
            wind: Air::new(scenario),
            path: VecDeque::new(),
            reference: Default::default(),
            shown: None,
            scenario: scenario.clone(),
        }
    }

    /// Returns the messages that hold for the whole flight. A viewer needs them first, whenever it connects.
    pub fn fixed(&self) -> Vec<DerivedMessage> {
        let vehicle = self.scenario.flown_airframe();
        let time = Timestamp::default();
        let frames = FrameTransforms {
            transforms: vec![
                // Turns NED into the axes east, north, up: half a turn about the bisector of the first two axes.
                frame("map", "ned", [0.0; 3], [0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0], time),
                frame("body", "rotor_2", shapes::hub(&vehicle, 1), LEVEL, time),
                frame("body", "rotor_3", shapes::hub(&vehicle, 2), LEVEL, time),
            ],
        };
        let course = PosesInFrame { timestamp: Some(time), frame_id: "ned".into(), poses: self.course() };
        let vehicle = SceneUpdate { deletions: vec![], entities: shapes::vehicle(&vehicle) };
        let bytes = [
            (SceneChannel::FixedFrames, frames.encode_to_vec()),
            (SceneChannel::Vehicle, vehicle.encode_to_vec()),
            (SceneChannel::Course, course.encode_to_vec()),
        ];
        bytes.into_iter().map(|(channel, bytes)| DerivedMessage { channel, time_ns: 0, bytes }).collect()
    }

    /// Takes in a message of the ring, and returns the messages derived from it, mostly none.
    pub fn on_record(&mut self, record: &Record) -> Vec<DerivedMessage> {
        match record {
            Record::Truth(truth) => self.on_truth(truth),
            Record::Reference(reference) if reference.stamp.is_delivered() && reference.is_intact() => {
                self.reference = (reference.position_m, reference.attitude_rad);
                vec![]
            }
            _ => vec![],
        }
    }

    /// Takes in an event, and returns a log message that describes it.
    pub fn on_event(&mut self, event: &Event) -> DerivedMessage {
        if let Some(fault) = &event.fault {
            self.wind.apply_fault(fault.0, &fault.1);
        }
        let level = match event.what {
            What::Died | What::Hung | What::NotStarted | What::GivenUp => Level::Error,
            What::Started | What::TookOver | What::OnStandby | What::Kept | What::Cleared => Level::Info,
            _ => Level::Warning,
        };
        let why = event.why.as_ref().map_or(String::new(), |why| format!(": {why}"));
        let time_ns = event.tick.saturating_mul(self.sample_ns);
        let log = Log {
            timestamp: Some(timestamp(time_ns)),
            level: level.into(),
            message: format!("{} epoch {} {}{why}", event.node, event.epoch, name(event.what)),
            name: event.node.clone(),
            ..Log::default()
        };
        DerivedMessage { channel: SceneChannel::Log, time_ns, bytes: log.encode_to_vec() }
    }

    fn on_truth(&mut self, truth: &Truth) -> Vec<DerivedMessage> {
        let tick = truth.tick;
        let is_new = self.shown.is_none_or(|shown| shown < tick);
        let every = |seconds: f64| {
            let ticks = (seconds * f64::from(self.scenario.run.rate_hz)).round().max(1.0) as u64;
            is_new && tick.is_multiple_of(ticks)
        };
        let due = [FRAMES_EVERY_S, ARROWS_EVERY_S, PATH_POINT_S, PATH_EVERY_S].map(every);
        if !due.contains(&true) || !truth.is_intact() || !all_finite(truth) {
            return vec![];
        }
        let [frames, arrows, point, path] = due;
        self.shown = Some(tick);
        let time_ns = tick.saturating_mul(self.sample_ns);
        let mut derived = vec![];
        let mut add = |channel, bytes| derived.push(DerivedMessage { channel, time_ns, bytes });
        if frames {
            add(SceneChannel::Frames, self.frames(truth, timestamp(time_ns)).encode_to_vec());
        }
        if arrows {
            add(SceneChannel::Arrows, self.arrows(truth, time_ns).encode_to_vec());
        }
        if point {
            if self.path.len() == PATH_POINTS {
                self.path.pop_front();
            }
            self.path.push_back(truth.actual.position_m);
        }
        if path {
            let poses = self.path.iter().map(|position_m| pose(*position_m, LEVEL)).collect();
            let path = PosesInFrame { timestamp: Some(timestamp(time_ns)), frame_id: "ned".into(), poses };
            add(SceneChannel::Path, path.encode_to_vec());
        }
        derived
    }

    fn frames(&self, truth: &Truth, time: Timestamp) -> FrameTransforms {
        let Truth { actual, actuators, .. } = truth;
        let tilt = quaternion([actuators.tilt_rad, 0.0, 0.0]);
        let hub = shapes::hub(&self.scenario.flown_airframe(), 0);
        let (reference_m, reference_rad) = self.reference;
        FrameTransforms {
            transforms: vec![
                frame("ned", "body", actual.position_m, quaternion(actual.attitude_rad), time),
                frame("body", "rotor_1", hub, tilt, time),
                frame("ned", "reference", reference_m, quaternion(reference_rad), time),
            ],
        }
    }

    fn arrows(&self, truth: &Truth, time_ns: u64) -> SceneUpdate {
        let Truth { actual, actuators, .. } = truth;
        let kf = self.scenario.flown_airframe().kf;
        let speeds = actuators.rotor_speed.iter().zip(self.scenario.plant.rotor_effectiveness);
        let thrusts = speeds.zip(1..).map(|((speed, share), rotor)| {
            let length_m = kf * share * speed * speed * THRUST_M_PER_N;
            let up = arrow([0.0; 3], UP, length_m, ORANGE);
            SceneEntity { arrows: vec![up], ..entity(&format!("rotor_{rotor}"), &format!("thrust {rotor}"), time_ns) }
        });
        let [north, east, down] = self.wind.mean_wind_mps(time_ns, actual.position_m[2]);
        let speed_mps = (north * north + east * east + down * down).sqrt();
        let [x, y, z] = actual.position_m;
        let blows = (speed_mps > CALM_MPS).then(|| {
            let direction = along([north, east, down].map(|component| component / speed_mps));
            arrow([x, y, z - WIND_ABOVE_M], direction, speed_mps * WIND_M_PER_MPS, BLUE)
        });
        let wind = SceneEntity { arrows: blows.into_iter().collect(), ..entity("ned", "wind", time_ns) };
        SceneUpdate { deletions: vec![], entities: thrusts.chain([wind]).collect() }
    }

    /// Returns points of the mission's course, each at least [`COURSE_STEP_M`] from the one before along some axis.
    fn course(&self) -> Vec<Pose> {
        let trajectory = Trajectory::new(&self.scenario);
        let steps = (self.scenario.run.duration_s / COURSE_STEP_S).min(1e6) as u64;
        let mut points: Vec<[f64; 3]> = vec![];
        for step in 0..=steps {
            let point = trajectory.at(step as f64 * COURSE_STEP_S).position_m;
            let is_apart = |last: &[f64; 3]| (0..3).any(|i| (last[i] - point[i]).abs() >= COURSE_STEP_M);
            if points.last().is_none_or(is_apart) {
                points.push(point);
            }
            if points.len() == COURSE_POINTS {
                break;
            }
        }
        points.into_iter().map(|point_m| pose(point_m, LEVEL)).collect()
    }
}

/// Returns whether all drawn numbers of a TRUTH are finite.
fn all_finite(truth: &Truth) -> bool {
    let Truth { actual, actuators, .. } = truth;
    let numbers = [actual.position_m, actual.attitude_rad, actuators.rotor_speed];
    numbers.iter().flatten().chain([&actuators.tilt_rad]).all(|number| number.is_finite())
}

#[cfg(test)]
mod tests;
