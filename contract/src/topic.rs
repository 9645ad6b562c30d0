//! The four topics of the ring, in the order in which a sample travels.

/// One topic. The discriminant indexes every per-topic array, those of [`crate::message::Stamp`] included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Topic {
    /// Plant to all other nodes: the measured motion.
    State = 0,
    /// Guidance to attitude-mpc: the reference to follow.
    Reference = 1,
    /// attitude-mpc to mixer: the demanded force and moments.
    Controls = 2,
    /// Mixer to plant: the commanded rotor speeds and tilt.
    Actuators = 3,
}

impl Topic {
    /// Number of topics.
    pub const COUNT: usize = 4;
    /// All topics, in the order of the ring.
    pub const ALL: [Self; Self::COUNT] = [Self::State, Self::Reference, Self::Controls, Self::Actuators];

    /// Name on the wire, in the log and in scenario files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::State => "state",
            Self::Reference => "reference",
            Self::Controls => "controls",
            Self::Actuators => "actuators",
        }
    }

    /// Name of the node that publishes this topic.
    pub const fn publisher(self) -> &'static str {
        match self {
            Self::State => "plant",
            Self::Reference => "guidance",
            Self::Controls => "attitude-mpc",
            Self::Actuators => "mixer",
        }
    }

    /// Topics that the receivers of this one publish.
    pub const fn listeners(self) -> &'static [Self] {
        match self {
            Self::State => &[Self::Reference, Self::Controls, Self::Actuators],
            Self::Reference => &[Self::Controls],
            Self::Controls => &[Self::Actuators],
            Self::Actuators => &[Self::State],
        }
    }
}

/// Nodes of the ring, in the order in which a sample travels: node `i` publishes topic `i`.
pub const NODES: [&str; Topic::COUNT] =
    [Topic::State.publisher(), Topic::Reference.publisher(), Topic::Controls.publisher(), Topic::Actuators.publisher()];
