//! A library, or functions of a program, as the vehicle of the plant.

use bytemuck::{bytes_of, bytes_of_mut, cast_slice, cast_slice_mut};
use contract::actuation::Actuation;
use contract::message::{Kinematics, PlantStatus};
use contract::snapshot::MEMORY_BYTES;
use contract::topic::Topic;
use plant::memory::Tape;
use plant::vehicle::{Vehicle, divergence, start};
use runtime::error::SessionError;
use settings::Scenario;

use crate::abi::{TrefoilNode, TrefoilPlantAnswer, TrefoilPlantInput};
use crate::library::{Library, layout_of};
use crate::protocol::{PLANT_NAMES, PortLayout};

/// Layout of input and answer.
const LAYOUT: PortLayout =
    PortLayout { bytes: [size_of::<TrefoilPlantInput>(), size_of::<TrefoilPlantAnswer>()], names: PLANT_NAMES };

/// Vehicle of a library.
struct ForeignVehicle {
    library: Library,
    /// First word of the vehicle's memory, which no other library has.
    layout: u64,
    sample_ns: u64,
    /// Newest answer.
    answer: TrefoilPlantAnswer,
    diverged: Option<PlantStatus>,
}

/// Loads the library that `scenario` names for the plant, and asks it for its state at the start.
///
/// # Errors
/// The library cannot be loaded, or fails.
pub fn vehicle(scenario: &Scenario) -> Result<Box<dyn Vehicle>, SessionError> {
    Ok(Box::new(ForeignVehicle::load(scenario)?))
}

/// Creates the vehicle of the plant by `functions` of this program, and asks it for its state at the start.
///
/// # Errors
/// The functions have another interface, or fail.
pub fn vehicle_of_program(functions: &TrefoilNode, scenario: &Scenario) -> Result<Box<dyn Vehicle>, SessionError> {
    let library = Library::of_program(functions, scenario, Topic::State, &LAYOUT)?;
    Ok(Box::new(ForeignVehicle::begin(library, scenario)?))
}

/// Tries the library that `scenario` names for the plant: at the start, and over the first period.
///
/// # Errors
/// The library cannot be loaded, or fails.
pub fn try_out(scenario: &Scenario) -> Result<(), SessionError> {
    let (_, actuators) = start(scenario);
    let mut vehicle = ForeignVehicle::load(scenario)?;
    vehicle.advance(0, scenario.sample_ns(), &actuators)?;
    vehicle.library.destroy()
}

impl ForeignVehicle {
    fn load(scenario: &Scenario) -> Result<Self, SessionError> {
        Self::begin(Library::load(scenario, Topic::State, &LAYOUT)?, scenario)
    }

    fn begin(library: Library, scenario: &Scenario) -> Result<Self, SessionError> {
        let mut vehicle = Self {
            library,
            layout: layout_of(scenario, Topic::State),
            sample_ns: scenario.sample_ns(),
            answer: TrefoilPlantAnswer::default(),
            diverged: None,
        };
        let (_, actuators) = start(scenario);
        vehicle.step(0, 0, &actuators)?;
        Ok(vehicle)
    }

    /// Lets the library move for `advance_ns`; with 0 it only answers.
    fn step(&mut self, from_ns: u64, advance_ns: u64, command: &Actuation) -> Result<(), SessionError> {
        let Actuation { rotor_speed, tilt_rad } = *command;
        let seconds = |ns: u64| ns as f64 / 1e9;
        let (tick, time_s) = (from_ns / self.sample_ns, seconds(from_ns));
        let input = TrefoilPlantInput { tick, time_s, advance_s: seconds(advance_ns), rotor_speed, tilt_rad };
        let mut answer = TrefoilPlantAnswer { rotor_speed, tilt_rad, ..TrefoilPlantAnswer::default() };
        self.library.step(bytes_of(&input), bytes_of_mut(&mut answer))?;
        self.answer = answer;
        self.diverged = diverged(&answer);
        Ok(())
    }
}

/// Returns the bound of the simulation that an answer violates, if any.
fn diverged(answer: &TrefoilPlantAnswer) -> Option<PlantStatus> {
    divergence(cast_slice(bytes_of(answer)), &answer.position_m, &answer.rates_radps)
}

impl Vehicle for ForeignVehicle {
    fn advance(&mut self, from_ns: u64, until_ns: u64, command: &Actuation) -> Result<(), SessionError> {
        self.step(from_ns, until_ns - from_ns, command)
    }

    fn motion(&self) -> Kinematics {
        let TrefoilPlantAnswer { position_m, velocity_mps, attitude_rad, rates_radps, .. } = self.answer;
        Kinematics { position_m, velocity_mps, attitude_rad, rates_radps }
    }

    fn actuators(&self) -> Actuation {
        let TrefoilPlantAnswer { rotor_speed, tilt_rad, .. } = self.answer;
        Actuation { rotor_speed, tilt_rad }
    }

    fn diverged(&self) -> Option<PlantStatus> {
        self.diverged
    }

    /// Writes or reads the newest answer and the memory of the library. Refuses the tape if the library keeps no
    /// memory, or does not give back the memory that it has restored.
    fn remember(&mut self, tape: &mut Tape, _tick: u64) {
        let bytes = self.library.memory_bytes();
        let mut layout = self.layout;
        tape.value(&mut layout);
        tape.value(&mut self.answer);
        self.diverged = diverged(&self.answer);
        let mut words = [0_u64; MEMORY_BYTES / 8];
        let written = |library: &Library, words: &mut [u64]| {
            library.snapshot(&mut cast_slice_mut::<_, u8>(words)[..bytes]);
        };
        if !tape.reads() {
            written(&self.library, &mut words);
        }
        tape.words(&mut words[..bytes.div_ceil(8)]);
        if tape.reads() {
            self.library.restore(&cast_slice(&words)[..bytes]);
            let mut kept = [0_u64; MEMORY_BYTES / 8];
            written(&self.library, &mut kept);
            if kept != words {
                tape.refuse();
            }
        }
        if bytes == 0 || layout != self.layout {
            tape.refuse();
        }
    }
}
