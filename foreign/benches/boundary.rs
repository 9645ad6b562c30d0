//! Cost of the boundary to a library: the same state feedback as a core in Rust, as a library by `trefoil.h`, and as a
//! library in the form of CasADi, each answering to the same messages.
//!
//! `cargo bench --workspace --bench boundary` prints the time of a step, and the overhead of a library beyond the law.
//! The three laws, and CasADi's function alone, are timed in turn, in blocks of [`STEPS`]; each figure is the median
//! over the blocks.

#![expect(clippy::disallowed_macros, reason = "a benchmark prints its figures")]
#![expect(unsafe_code, reason = "the function of the law is called without the boundary")]

use std::ffi::c_int;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::Instant;

use contract::message::{Controls, Reference, SolveStatus, Stamp, State};
use contract::snapshot::{NO_MEMORY, Snapshot};
use contract::topic::Topic;
use foreign::{AttitudeMpcProtocol, Foreign};
use libloading::os::unix::Library;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::node::{Core, Inputs};
use runtime::output::Output;
use runtime::ports::{Ports, Transport};
use runtime::queue::Queues;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;
use settings::Scenario;

/// Number of steps in a block.
const STEPS: u32 = 2000;
/// Number of blocks of each law.
const BLOCKS: usize = 501;

type Newest = (Input<Reference>, Input<State>);
type Law = unsafe extern "C" fn(*const *const f64, *mut *mut f64, *mut i64, *mut f64, c_int) -> c_int;

/// State feedback of `lqr.c` in Rust.
struct Feedback([[f64; 7]; 4]);

impl Core for Feedback {
    type Inputs = Newest;
    type Answer = Controls;

    fn build(_: &Scenario) -> Result<Self, SessionError> {
        let gain = |row: usize, column: usize| (1.0 + row as f64) / (2.0 + column as f64);
        Ok(Self(std::array::from_fn(|row| std::array::from_fn(|column| gain(row, column)))))
    }

    fn step(&mut self, _: u64, (references, states): &Newest) -> Result<Controls, SessionError> {
        let (reference, measured) = (references.known(), &states.known().measured);
        let mut x = [measured.velocity_mps[2] - reference.w_mps, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for i in 0..3 {
            x[1 + i] = measured.attitude_rad[i] - reference.attitude_rad[i];
            x[4 + i] = measured.rates_radps[i] - reference.rates_radps[i];
        }
        let demand = self.0.map(|row| row.iter().zip(x).fold(0.0, |sum, (gain, x)| sum - gain * x));
        Ok(Controls { demand, status: SolveStatus::Explicit as u64, ..Controls::default() })
    }

    fn snapshot(&self) -> Snapshot {
        NO_MEMORY
    }

    fn restore(&mut self, _: &Snapshot) -> bool {
        false
    }
}

fn main() {
    let folder = tempfile::tempdir().expect("a folder");
    let [table, casadi] = [("table", &[][..]), ("casadi", &["-DCASADI"])].map(|(name, flags)| {
        let file = folder.path().join(name).with_extension("so");
        compile(&file, flags);
        file
    });
    let inputs = inputs();
    let mut ours = Feedback::build(&Scenario::default()).expect("a law");
    let mut by_table = Foreign::<AttitudeMpcProtocol>::build(&flying(&table)).expect("the library");
    let mut by_casadi = Foreign::<AttitudeMpcProtocol>::build(&flying(&casadi)).expect("the library");
    let answers = [
        ours.step(1, &inputs).expect("an answer"),
        by_table.step(1, &inputs).expect("an answer"),
        by_casadi.step(1, &inputs).expect("an answer"),
    ];
    assert!(answers.iter().all(|answer| answer.demand == answers[0].demand), "the same law: {answers:?}");

    // SAFETY: `lqr.c` has no code that runs when it is loaded, and its function has this type.
    let library = unsafe { Library::new(&casadi) }.expect("the library");
    // SAFETY: the function `law` of `lqr.c` has this type.
    let law = unsafe { library.get::<Law>(b"law") }.expect("the function");
    let values = [[0.1; 3]; 6];
    let arguments: Vec<*const f64> = values.iter().map(|value| value.as_ptr()).collect();
    let (mut demand, mut work) = ([0.0; 4], [0.0; 7]);
    let mut results = [demand.as_mut_ptr()];

    let mut times = [const { vec![] }; 4];
    for _ in 0..BLOCKS {
        times[0].push(block(|tick| drop(black_box(ours.step(tick, black_box(&inputs))))));
        times[1].push(block(|tick| drop(black_box(by_table.step(tick, black_box(&inputs))))));
        times[2].push(block(|tick| drop(black_box(by_casadi.step(tick, black_box(&inputs))))));
        // SAFETY: the arrays have the sizes that the function describes.
        times[3].push(block(|_| unsafe {
            law(black_box(arguments.as_ptr()), results.as_mut_ptr(), std::ptr::null_mut(), work.as_mut_ptr(), 0);
        }));
    }
    let [ours, table, casadi, function] = times.map(median);
    println!("a step in Rust           {ours:7.1} ns");
    println!("a step by trefoil.h      {table:7.1} ns, the boundary {:.1} ns", table - ours);
    println!("a step by CasADi's names {casadi:7.1} ns, beyond its function {:.1} ns", casadi - function);
}

/// Returns the mean time of a step of one block \[ns\].
fn block(mut step: impl FnMut(u64)) -> f64 {
    let begin = Instant::now();
    (0..STEPS).for_each(|tick| step(u64::from(tick)));
    begin.elapsed().as_nanos() as f64 / f64::from(STEPS)
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn flying(library: &Path) -> Scenario {
    let mut scenario = Scenario::default();
    scenario.node.attitude_mpc.exec = library.display().to_string();
    scenario
}

fn compile(file: &PathBuf, flags: &[&str]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut cc = Command::new("cc");
    cc.args(["-O2", "-fPIC", "-shared", "-o"]).arg(file).args(flags);
    cc.arg("-I").arg(folder.join("include")).arg(folder.join("benches/lqr.c"));
    assert!(cc.status().expect("a C compiler").success(), "lqr.c is compiled");
}

/// Returns the inputs of attitude-mpc after one message of each kind has come.
fn inputs() -> Newest {
    let run = Scenario::default();
    let page = Arc::new(ControlPage::private().expect("memory"));
    let queues = Queues::default();
    let member = |topic: Topic| {
        page.role(topic).offer(1);
        page.role(topic).assign(0, |_| Assignment { active: 1, standby: 0 });
        Member::in_process(page.clone(), topic, 1, &run, false)
    };
    let ports = || Ports::new(page.clone(), Transport::Queues(queues.clone()));
    let [plant, guidance, attitude] = [Topic::State, Topic::Reference, Topic::Controls].map(member);
    let mut inputs = Newest::open(&mut ports(), &attitude).expect("inputs");
    let mut states = Output::open(&mut ports(), &plant, &run).expect("an output");
    let mut references = Output::open(&mut ports(), &guidance, &run).expect("an output");
    let mut state = State::default();
    state.measured.attitude_rad = [0.1, -0.2, 0.3];
    states.send(state, Stamp::at(0, 0));
    page.role(Topic::State).done(1).set(1);
    references.send(Reference { w_mps: 0.5, ..Reference::default() }, Stamp::at(0, 0));
    inputs.look();
    assert_eq!((inputs.0.known().w_mps, inputs.1.known().measured.attitude_rad[2]), (0.5, 0.3), "both have come");
    inputs
}
