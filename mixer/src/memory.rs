//! What the mixer remembers from tick to tick. Everything else is fixed when it is built.

use airframe::Actuation;
use contract::message::Kinematics;
use contract::snapshot::{Reader, Snapshot, Writer};
use nalgebra::{Matrix4x3, Vector4};

use crate::rotors::Evidence;

/// Node and version of the snapshots.
const LAYOUT: [u8; 8] = *b"mixer  2";

/// The mixer's whole memory: a mixer that gets a copy of it continues the same flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Memory {
    /// Tick of the newest usable demand; `None` before the first.
    pub demand_tick: Option<u64>,
    /// That demand \[N, N m, N m, N m\].
    pub demand: Vector4<f64>,
    /// The disturbance estimate that came with it.
    pub disturbance: Vector4<f64>,
    /// Tick of the newest usable state; `None` before the first.
    pub state_tick: Option<u64>,
    /// What was measured then.
    pub measured: Kinematics,
    /// Whether the rotors follow.
    pub evidence: Evidence,
    /// The flight is over: no thrust any more.
    pub terminated: bool,
}

impl Memory {
    /// Nothing seen yet.
    pub fn new(evidence: Evidence) -> Self {
        Self {
            demand_tick: None,
            demand: Vector4::zeros(),
            disturbance: Vector4::zeros(),
            state_tick: None,
            measured: Kinematics::default(),
            evidence,
            terminated: false,
        }
    }

    /// As plain words.
    pub fn pack(&self) -> Snapshot {
        let mut writer = Writer::new(LAYOUT);
        writer.optional(self.demand_tick);
        writer.numbers(self.demand.as_slice());
        writer.numbers(self.disturbance.as_slice());
        writer.optional(self.state_tick);
        let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = self.measured;
        for vector in [position_m, velocity_mps, attitude_rad, rates_radps] {
            writer.numbers(&vector);
        }
        let Evidence { actuation, unexplained, expected, dead_s } = &self.evidence;
        writer.numbers(&actuation.rotor_speed);
        writer.numbers(&[actuation.tilt_rad]);
        writer.numbers(unexplained.as_slice());
        writer.numbers(expected.as_slice());
        writer.numbers(dead_s.as_slice());
        writer.word(u64::from(self.terminated));
        writer.seal()
    }

    /// From plain words; `None` where they are not those of [`pack`](Self::pack).
    pub fn unpack(snapshot: &Snapshot) -> Option<Self> {
        let mut reader = Reader::open(LAYOUT, snapshot)?;
        Some(Self {
            demand_tick: reader.optional()?,
            demand: reader.numbers()?.into(),
            disturbance: reader.numbers()?.into(),
            state_tick: reader.optional()?,
            measured: Kinematics {
                position_m: reader.numbers()?,
                velocity_mps: reader.numbers()?,
                attitude_rad: reader.numbers()?,
                rates_radps: reader.numbers()?,
            },
            evidence: Evidence {
                actuation: Actuation { rotor_speed: reader.numbers()?, tilt_rad: reader.number()? },
                unexplained: reader.numbers()?.into(),
                expected: Matrix4x3::from_column_slice(&reader.numbers::<12>()?),
                dead_s: reader.numbers()?.into(),
            },
            terminated: reader.word()? != 0,
        })
    }
}
