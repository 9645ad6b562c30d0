//! What the controller remembers from tick to tick. Everything else is fixed when it is built.

use contract::message::Reference;
use contract::snapshot::{Reader, Snapshot, Writer};
use nalgebra::Vector3;

use crate::observer::Observer;

/// Node and version of the snapshots.
const LAYOUT: [u8; 8] = *b"guidanc2";

/// The controller's whole memory: a controller that gets a copy of it continues the same flight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Memory {
    /// Tick of the newest state answered, if any.
    pub tick: Option<u64>,
    /// Whether the last step had no state to use.
    pub silent: bool,
    /// Tick of the first state after the last silence to come back from, if any.
    pub back: Option<u64>,
    /// Position error of that tick, NED \[m\].
    pub error_m: Vector3<f64>,
    /// Integral of the position error, NED \[m s\].
    pub integral_ms: Vector3<f64>,
    /// The disturbance observer.
    pub observer: Observer,
    /// The answer itself, without its stamp.
    pub reference: Reference,
}

impl Memory {
    /// Nothing seen yet: the answer is `hover`.
    pub fn new(hover: Reference) -> Self {
        Self { reference: hover, ..Self::default() }
    }

    /// As plain words.
    pub fn pack(&self) -> Snapshot {
        let mut writer = Writer::new(LAYOUT);
        writer.optional(self.tick);
        writer.word(u64::from(self.silent));
        writer.optional(self.back);
        writer.numbers(self.error_m.as_slice());
        writer.numbers(self.integral_ms.as_slice());
        writer.numbers(self.observer.velocity_ned_mps.as_slice());
        writer.numbers(self.observer.estimate_mps2.as_slice());
        let Reference { position_m, velocity_mps, w_mps, attitude_rad, rates_radps, disturbance_mps2, flags, .. } =
            self.reference;
        for vector in [position_m, velocity_mps, attitude_rad, rates_radps] {
            writer.numbers(&vector);
        }
        writer.numbers(&disturbance_mps2);
        writer.numbers(&[w_mps]);
        writer.word(flags);
        writer.seal()
    }

    /// From plain words; `None` where they are not those of [`pack`](Self::pack).
    pub fn unpack(snapshot: &Snapshot) -> Option<Self> {
        let mut reader = Reader::open(LAYOUT, snapshot)?;
        Some(Self {
            tick: reader.optional()?,
            silent: reader.word()? != 0,
            back: reader.optional()?,
            error_m: reader.numbers()?.into(),
            integral_ms: reader.numbers()?.into(),
            observer: Observer { velocity_ned_mps: reader.numbers()?.into(), estimate_mps2: reader.numbers()?.into() },
            reference: Reference {
                position_m: reader.numbers()?,
                velocity_mps: reader.numbers()?,
                attitude_rad: reader.numbers()?,
                rates_radps: reader.numbers()?,
                disturbance_mps2: reader.numbers()?,
                w_mps: reader.number()?,
                flags: reader.word()?,
                ..Reference::default()
            },
        })
    }
}
