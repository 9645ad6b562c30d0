//! The graph of the ring: its four nodes, in the order in which a sample travels, and the topic that each publishes.

/// One topic. The discriminant indexes [`GRAPH`] and every per-topic array, those of [`crate::message::Stamp`]
/// included; it is also the rank of the node that publishes the topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Topic {
    /// The measured motion.
    State = 0,
    /// The reference to follow.
    Reference = 1,
    /// The demanded force and moments.
    Controls = 2,
    /// The commanded rotor speeds and tilt.
    Actuators = 3,
}

/// Edge of the graph: one topic, from the node that publishes it to its listeners.
pub struct Edge {
    /// Name of the node that publishes the topic.
    pub publisher: &'static str,
    /// Description of the publisher.
    pub description: &'static str,
    /// Name of the topic on the wire, in the log and in scenario files.
    pub name: &'static str,
    /// Topics that the receivers of this topic publish.
    pub listeners: &'static [Topic],
    /// Share of the deadline of the whole chain at which the message is due.
    pub deadline_share: f64,
}

/// Edges of the ring, by topic.
pub const GRAPH: [Edge; Topic::COUNT] = [
    Edge {
        publisher: "plant",
        description: "The vehicle.",
        name: "state",
        listeners: &[Topic::Reference, Topic::Controls, Topic::Actuators],
        deadline_share: 0.2,
    },
    Edge {
        publisher: "guidance",
        description: "The position controller.",
        name: "reference",
        listeners: &[Topic::Controls],
        deadline_share: 0.4,
    },
    Edge {
        publisher: "attitude-mpc",
        description: "The attitude controller.",
        name: "controls",
        listeners: &[Topic::Actuators],
        deadline_share: 0.8,
    },
    Edge {
        publisher: "mixer",
        description: "The control allocation.",
        name: "actuators",
        listeners: &[Topic::State],
        deadline_share: 1.0,
    },
];

/// Names of the nodes, in the order of [`GRAPH`].
pub const NODES: [&str; Topic::COUNT] = {
    let (mut names, mut rank) = ([""; Topic::COUNT], 0);
    while rank < Topic::COUNT {
        names[rank] = GRAPH[rank].publisher;
        rank += 1;
    }
    names
};

impl Topic {
    /// Number of topics.
    pub const COUNT: usize = 4;
    /// All topics, in the order of the ring.
    pub const ALL: [Self; Self::COUNT] = [Self::State, Self::Reference, Self::Controls, Self::Actuators];
    /// Topics of the nodes that control the vehicle: all but the plant's.
    pub const OF_CONTROLLERS: [Self; Self::COUNT - 1] = [Self::Reference, Self::Controls, Self::Actuators];

    /// Topic that the node `name` publishes.
    pub fn of_node(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.publisher() == name)
    }

    /// Name on the wire, in the log and in scenario files.
    pub const fn name(self) -> &'static str {
        GRAPH[self as usize].name
    }

    /// Name of the node that publishes this topic.
    pub const fn publisher(self) -> &'static str {
        GRAPH[self as usize].publisher
    }

    /// Topics that the publisher of this topic receives, in the order of the ring.
    pub fn sources(self) -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(move |topic| topic.listeners().contains(&self))
    }

    /// Topic that wakes the publisher of this topic: its nearest [source](Self::sources) before it in the ring.
    #[must_use]
    pub fn upstream(self) -> Self {
        let mut before = (1..Self::COUNT).map(|back| Self::ALL[(self as usize + Self::COUNT - back) % Self::COUNT]);
        before.find(|topic| topic.listeners().contains(&self)).unwrap_or(Self::State)
    }

    /// Topics that the receivers of this topic publish.
    pub const fn listeners(self) -> &'static [Self] {
        GRAPH[self as usize].listeners
    }
}
