//! What is run, at which rates and how long.

/// Rate of the rings that are compared \[Hz\].
pub const RING_HZ: u32 = 250;
/// Rate of the idle flights, and of the paper's \[Hz\].
pub const FLIGHT_HZ: u32 = 100;
/// Rate of the flights under load \[Hz\]: a delay that 100 Hz would forgive is a miss here, so that classes differ.
pub const LOADED_HZ: u32 = 500;
/// Rates at which the stack is flown until it misses \[Hz\].
pub const RATES_HZ: [u32; 5] = [100, 250, 500, 1000, 2000];
/// cyclictest's priority and that of the loop beside it.
pub const LOOP_PRIORITY: u32 = 80;

/// How long everything is run \[s\].
pub struct Plan {
    /// Rounds of what is compared.
    pub rounds: usize,
    /// The bare loop and cyclictest, each.
    pub loop_s: f64,
    /// The stack and the raw rings it is compared with, each.
    pub ring_s: f64,
    /// Rings of sockets and pipes.
    pub scale_s: f64,
    /// A flight of either scheduling class, idle.
    pub idle_s: f64,
    /// The same under load.
    pub load_s: f64,
    /// A flight at each rate.
    pub rate_s: f64,
    /// The paper's survey.
    pub paper_s: f64,
    /// Simulated in lockstep.
    pub lockstep_s: f64,
    /// Simulated in process.
    pub in_process_s: f64,
}

impl Plan {
    /// Long enough for figures, with that long a survey.
    pub fn full(rounds: usize, paper_s: f64) -> Self {
        Self {
            rounds,
            loop_s: 4.0,
            ring_s: 1.5,
            scale_s: 0.8,
            idle_s: 1.5,
            load_s: 3.0,
            rate_s: 3.0,
            paper_s,
            lockstep_s: 20.0,
            in_process_s: 60.0,
        }
    }

    /// Long enough to see that everything works.
    pub fn quick() -> Self {
        Self {
            rounds: 1,
            loop_s: 0.3,
            ring_s: 0.3,
            scale_s: 0.2,
            idle_s: 0.3,
            load_s: 0.3,
            rate_s: 0.5,
            paper_s: 1.0,
            lockstep_s: 1.0,
            in_process_s: 2.0,
        }
    }
}
