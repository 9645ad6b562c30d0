//! Values of the independent simulator, for tests.

use contract::message::{Reference, Stamp, State};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use settings::{
    Attitude, Constraints, DelayCompensation, Fault, FaultKind, FaultTarget, Model, MpcSettings, PlantSettings,
    Profile, Scenario, Terminal,
};

/// Reads the reference file.
pub fn reference() -> Value {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/reference.json"));
    serde_json::from_str(text).unwrap()
}

/// Reads the numbers of a JSON array.
pub fn vector(value: &Value) -> DVector<f64> {
    DVector::from_iterator(value.as_array().unwrap().len(), value.as_array().unwrap().iter().map(number))
}

/// Settings for which the simulator computed `K_B2`, `S_dare_B2`, `Ad_lag30` and `Bd_lag30`: a lag of 30 ms and a delay
/// of one sample in the model, and weights that tolerate both.
pub fn with_lag() -> Scenario {
    let paper = Scenario::from(Profile::Paper);
    Scenario {
        plant: PlantSettings { rotor_speed_min: 200.0, tilt_max_deg: 60.0, ..paper.plant },
        attitude: Attitude {
            actuator_lag_model_s: 0.03,
            delay_compensation: DelayCompensation::Sample(true),
            mpc: MpcSettings {
                q: [1e2, 1e3, 1e3, 1e3, 0.0, 0.0, 0.0],
                r: [0.4, 300.0, 85.0, 300.0],
                prediction_horizon_s: 0.2,
                control_horizon_s: 0.05,
                terminal: Terminal::Dare,
                constraints: Constraints::Cone,
                ..paper.attitude.mpc
            },
            ..paper.attitude
        },
        ..paper
    }
}

/// Profile `robust` with the exact limits in a plan of ten moves.
pub fn constrained() -> Scenario {
    let mut scenario = Scenario::default();
    (scenario.attitude.mpc.constraints, scenario.attitude.mpc.control_horizon_s) = (Constraints::Cone, 0.1);
    scenario
}

/// Settings of profile `robust` without an estimate of a disturbance.
pub fn without_estimate() -> Scenario {
    let mut scenario = Scenario::default();
    (scenario.attitude.mpc.model, scenario.attitude.disturbance_gain) = (Model::Hover, 0.0);
    scenario
}

/// Builds a fault of the solver.
pub fn fault(kind: FaultKind, at_s: f64, for_s: Option<f64>) -> Fault {
    Fault::new(FaultTarget::Mpc, kind, at_s, for_s)
}

/// Reads a reference matrix by name.
pub fn matrix(name: &str) -> DMatrix<f64> {
    let reference = reference();
    let rows = reference["reference"][name].as_array().unwrap();
    DMatrix::from_rows(&rows.iter().map(|row| vector(row).transpose()).collect::<Vec<_>>())
}

/// Asserts that `ours` is the matrix `theirs`, to 1e-9 relative to its largest element.
pub fn assert_matrix(ours: &DMatrix<f64>, theirs: &DMatrix<f64>) {
    let miss = (ours - theirs).amax() / theirs.amax();
    assert!(miss < 1e-9, "{miss:e} off: {ours} is not {theirs}");
}

/// Problem that the simulator solved, as settings and messages.
pub struct Case {
    /// Name of the case.
    pub name: String,
    /// Settings of the controller.
    pub scenario: Scenario,
    /// Measured state and command in force.
    pub state: State,
    /// Reference to follow.
    pub reference: Reference,
    /// Last demand, published one sample before.
    pub previous: [f64; 4],
    /// Plan of the simulator.
    pub plan: DVector<f64>,
    /// Objective of the simulator's plan.
    pub objective: f64,
    /// `true` if a constraint is active.
    pub active: bool,
    /// Largest accepted deviation.
    pub tolerance: Tolerance,
}

/// Largest deviation from the simulator's solution.
pub struct Tolerance {
    /// Deviation of the first move \[N, N m, N m, N m\].
    pub first_move: f64,
    /// Relative deviation of the objective.
    pub objective: f64,
}

/// Reads all cases.
pub fn cases() -> Vec<Case> {
    reference()["mpc_cases"].as_array().unwrap().iter().map(case).collect()
}

fn case(case: &Value) -> Case {
    let scenario = scenario(&case["cfg"]);
    let (x, r, act) = (vector(&case["x_abs"]), vector(&case["ref_abs"]), vector(&case["act"]));
    let stamp = Stamp { sequence: 1, ..Stamp::default() };
    let mut state = State { stamp, ..State::default() };
    state.measured.velocity_mps[2] = x[0];
    state.measured.attitude_rad = [x[1], x[2], x[3]];
    state.measured.rates_radps = [x[4], x[5], x[6]];
    state.command_in_force.rotor_speed = [act[0], act[1], act[2]];
    state.command_in_force.tilt_rad = act[3];
    let reference = Reference {
        stamp,
        w_mps: r[0],
        attitude_rad: [r[1], r[2], r[3]],
        rates_radps: [r[4], r[5], r[6]],
        ..Reference::default()
    };
    Case {
        name: case["name"].as_str().unwrap().into(),
        scenario,
        state,
        reference,
        previous: std::array::from_fn(|axis| number(&case["u_prev"][axis])),
        plan: vector(&case["U"]),
        objective: number(&case["objective"]),
        active: case["constrained_active"].as_bool().unwrap(),
        tolerance: Tolerance { first_move: number(&case["u0_tol"]), objective: number(&case["objective_rel_tol"]) },
    }
}

fn scenario(cfg: &Value) -> Scenario {
    let mut scenario = Scenario::from(Profile::Paper);
    let attitude = &mut scenario.attitude;
    attitude.actuator_lag_model_s = cfg["lag_model_tau"].as_f64().unwrap_or(0.0);
    attitude.delay_compensation = DelayCompensation::Sample(cfg["delay_comp_samples"] == 1);
    let mpc = &mut attitude.mpc;
    mpc.q = std::array::from_fn(|i| number(&cfg["Q"][i]));
    mpc.r = std::array::from_fn(|i| number(&cfg["R"][i]));
    mpc.prediction_horizon_s = number(&cfg["Np"]) * 0.01;
    mpc.control_horizon_s = number(&cfg["Nu"]) * 0.01;
    mpc.terminal = match cfg["P"].as_str().unwrap() {
        "dare" => Terminal::Dare,
        "0" => Terminal::Zero,
        other => panic!("terminal weight {other}"),
    };
    mpc.constraints = match cfg["constraints"].as_str().unwrap() {
        "soc" => Constraints::Cone,
        "none" => Constraints::None,
        other => panic!("constraints {other}"),
    };
    scenario.plant.rotor_speed_min = number(&cfg["om_min"]);
    scenario.plant.rotor_speed_max_ratio = number(&cfg["ommax_scale"]);
    scenario.plant.tilt_max_deg = number(&cfg["mu_max"]).to_degrees();
    scenario
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}
