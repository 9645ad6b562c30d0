//! One case per way to break a rule, and the edges of the ranges.

use crate::load::{from_merged, to_toml};
use crate::tests::{check_refused, from_set};

#[test]
fn numbers_out_of_range_are_refused_with_the_range() {
    let cases = [
        ("run.duration_s=0", "at least 0.01, at most 86400"),
        ("run.duration_s=86401", "at least 0.01, at most 86400"),
        ("run.rate_hz=49", "at least 50, at most 2000"),
        ("run.command_delay_ms=-1", "at least 0, at most 1000"),
        ("run.command_jitter_ms=1001", "at least 0, at most 1000"),
        ("run.command_drop_probability=1.1", "at least 0, at most 1"),
        ("mission.ramp_s=-0.1", "at least 0, at most 1e9"),
        ("airframe.mass_kg=0", "at least 1e-4, at most 1e6"),
        ("airframe.km=-1", "at least 1e-12, at most 1000"),
        ("airframe.g_mps2=1e308", "at least 0.01, at most 1000"),
        ("airframe.ixx_kgm2=1e-300", "at least 1e-9, at most 1e6"),
        ("plant.substep_s=1e-300", "at least 1e-5, at most 0.01"),
        ("attitude.mpc.q=[1e300, 0, 0, 0, 0, 0, 0]", "at least 0, at most 1e12"),
        ("attitude.mpc.r=[1, 1e-30, 1, 1]", "at least 1e-12, at most 1e12"),
        ("guidance.kp_w=1e300", "at least -1e9, at most 1e9"),
        ("initial.velocity_mps=[1e300, 0, 0]", "at least -1e9, at most 1e9"),
        ("plant.substep_s=0", "at least 1e-5, at most 0.01"),
        ("plant.substep_s=0.02", "at least 1e-5, at most 0.01"),
        ("plant.rotor_lag_s=0", "at least 1e-9, at most 1e9"),
        ("plant.rotor_rate_limit=0", "at least 1e-9, at most 1e9"),
        ("plant.servo_rate_limit_radps=0", "at least 1e-9, at most 1e9"),
        ("plant.rotor_speed_min=-1", "at least 0, at most 1e9"),
        ("plant.rotor_speed_max_ratio=1", "at least 1.001, at most 1000"),
        ("plant.tilt_max_deg=90.1", "above 0, at most 90"),
        ("plant.drag_linear_nspm=[0, -1, 0]", "at least 0, at most 1e9"),
        ("plant.drag_quadratic_ns2pm2=-1", "at least 0, at most 1e9"),
        ("plant.rotor_effectiveness=[1, 2.1, 1]", "at least 0, at most 2"),
        ("plant.noise.position_m=-1", "at least 0, at most 1e9"),
        ("guidance.angle_limit_deg=81", "above 0, at most 80"),
        ("guidance.w_limit_mps=0", "at least 1e-9, at most 1e9"),
        ("guidance.integral_limit=-1", "at least 0, at most 1e9"),
        ("attitude.mpc.q=[-1, 0, 0, 0, 0, 0, 0]", "at least 0, at most 1e12"),
        ("attitude.mpc.r=[1, 1, 1, 0]", "at least 1e-12, at most 1e12"),
        ("attitude.actuator_lag_model_s=-1", "at least 0, at most 100"),
        ("attitude.servo_lag_model_s=0", "at least 0.001, at most 100"),
        ("attitude.disturbance_gain=1.1", "at least 0, at most 1"),
        ("attitude.mpc.max_iterations=0", "at least 1, at most 10000"),
        ("attitude.mpc.time_limit_ms=-1", "at least 0, at most 1e9"),
        ("attitude.mpc.attitude_limit_deg=[90, 0, 360]", "at least 1e-9, at most 1e9"),
        ("attitude.mpc.rates_limit_dps=[0, 360, 360]", "at least 1e-9, at most 1e9"),
        ("bounds.max_position_error_m=0", "above 0"),
        ("realtime.priority=96", "at least 1, at most 95"),
        ("node.mixer.priority=0", "at least 1, at most 95"),
        ("realtime.affinity=[1024]", "at least 0, at most 1023"),
        ("realtime.rttime_ms=-1", "at least 0, at most 1e9"),
        ("deadline.end_to_end_ms=0", "at least 1e-9, at most 1e9"),
        ("node.guidance.deadline_ms=0", "at least 1e-9, at most 1e9"),
    ];
    for (set, range) in cases {
        let key = set.split_once('=').unwrap().0;
        check_refused(set, &[&format!("`{key}` = "), "out of range", &format!("allowed: {range}\n")]);
    }
}

#[test]
fn settings_that_contradict_are_refused() {
    let cases = [
        ("name=\" \"", "`name` is empty"),
        ("guidance.kp_w=nan", "`guidance.kp_w` = NaN is not finite"),
        ("initial.position_m=[0, 0, -inf]", "`initial.position_m` = -inf is not finite"),
        ("guidance.disturbance_observer_radps=100", "at least 0, below 100"),
        ("run.rate_hz=300", "`run.rate_hz` = 300 has no sample time in whole nanoseconds"),
        ("plant.rotor_lag_s=0.0004", "`plant.rotor_lag_s` = 0.0004 is too short for `plant.substep_s` = 0.001"),
        ("plant.servo_lag_s=0.0004", "`plant.servo_lag_s` = 0.0004 is too short"),
        ("plant.rotor_speed_min=1339", "below the slowest rotor at trim, 1338.6"),
        ("plant.tilt_max_deg=30", "above the tilt at trim, 30.49"),
        ("plant.wind_ned_mps=[[2, [0, 0, 1]]]", "a wind that a vehicle without drag does not feel"),
        ("plant.turbulence.from_wind=true", "where no wind blows along the ground"),
        (
            "plant={drag_quadratic_ns2pm2=0.02, wind_ned_mps=[[0, [6, 0, 0]]], turbulence={from_wind=true, height_m=9}}",
            "has a wind, height, airspeed or direction of its own beside `from_wind`",
        ),
        ("plant.airframe.ixz_kgm2=0.02", "`plant.airframe` has moments of inertia that no body has"),
        (
            "airframe={ixx_kgm2=0.06, iyy_kgm2=0.01, izz_kgm2=0.01}",
            "`airframe` has moments of inertia that no body has",
        ),
        (
            "plant.airframe={ixx_kgm2=0.06, iyy_kgm2=0.01, izz_kgm2=0.01}",
            "no principal moment above the sum of the other two",
        ),
        ("plant.wind_ned_mps=[[2, [0, 0, 0]], [1, [0, 0, 0]]]", "`plant.wind_ned_mps` are out of order"),
        ("plant.disturbance=[[-1, [0, 0, 0], [0, 0, 0]]]", "`plant.disturbance` are out of order"),
        ("initial.position_m=[400, 400, 0]", "within 500 m"),
        ("initial.attitude_deg=[0, -88, 0]", "a pitch between -88 and 88"),
        ("mission.ramp_s=5.1", "`mission.ramp_s` = 5.1 does not fit the legs of 10.0 s"),
        (
            "attitude.mpc.control_horizon_s=0.21",
            "`attitude.mpc.control_horizon_s` = 0.21 is longer than `attitude.mpc.prediction_horizon_s` = 0.2: 21 and 20 \
             samples",
        ),
        (
            "attitude.mpc={prediction_horizon_s=0.04, control_horizon_s=0.05}",
            "`attitude.mpc.control_horizon_s` of 0.01 to 0.04, or `attitude.mpc.prediction_horizon_s` of 0.05 to 2",
        ),
        ("attitude.mpc.prediction_horizon_s=2.01", "0.01 to 2 at this rate, 1 to 200 samples"),
        ("attitude.mpc.control_horizon_s=0", "0.01 to 2 at this rate, 1 to 200 samples"),
        ("attitude.actuator_lag_model_s=0.0009", "0 for no lag, or at least 0.001"),
        ("attitude={actuator_lag_model_s=0, servo_lag_model_s=0.1}", "without a lag of the rotors"),
        ("guidance.preview_s=0.009", "0 for no preview, or at least 0.01"),
        ("deadline.late=hold", "`node.plant.late` cannot be hold"),
        ("node.guidance.late=degrade", "it has nothing cheaper to do"),
        ("deadline.late=late", "expected one of `send`, `skip`, `hold`, `degrade`, `stop`"),
        ("fault=[{at_s=1}]", "missing field `target`"),
        ("fault=[{at_s=1, target=\"mpc\", kind=\"nan\", for=1}]", "unknown field `for`"),
        ("fault=[{at_s=1, target=\"mpc\", kind=\"kill\"}]", "mpc cannot have kill"),
        ("fault=[{at_s=1, target=\"host\", kind=\"offset\"}]", "host cannot have offset"),
        ("fault=[{at_s=1, target=\"clock\", kind=\"offset\"}]", "offset without the name of a process"),
        (
            "fault=[{at_s=1, target=\"clock\", kind=\"offset\", process=\"tilt\"}]",
            "offset without the name of a process",
        ),
        ("fault=[{at_s=1, target=\"mixer\", kind=\"kill\", process=\"mixer\"}]", "kill with a `process`"),
        ("fault=[{at_s=1, for_s=1, target=\"host\", kind=\"disk-full\"}]", "disk-full with an end"),
        (
            "fault=[{at_s=1, target=\"mixer\", kind=\"slow\", ms=-1}]",
            "mixer slow with `ms` = -1.0, which is out of range",
        ),
        ("fault=[{at_s=1, target=\"mixer\", kind=\"slow\", ms=nan}]", "`ms` of 0 to 60000"),
        ("fault=[{at_s=1, target=\"state\", kind=\"corrupt\", count=1_000_000_000_000}]", "`count` of 1 to 10000"),
        ("fault=[{at_s=1, target=\"state\", kind=\"burst\", count=0}]", "`count` of 1 to 1000000"),
        ("fault=[{at_s=1, target=\"state\", kind=\"drop\", probability=1.1}]", "`probability` of 0 to 1"),
        ("fault=[{at_s=1, target=\"rates\", kind=\"wrong\", value=1e300}]", "`value` of -1000000 to 1000000"),
        ("fault=[{at_s=1, target=\"rates\", kind=\"noise\", value=-1}]", "`value` of 0 to 1000000"),
        ("fault=[{at_s=1, target=\"rotor1\", kind=\"wrong\", value=-0.1}]", "`value` of 0 to 2"),
        ("fault=[{at_s=1, target=\"tilt\", kind=\"wrong\", value=inf}]", "`value` of -180 to 180"),
        ("fault=[{at_s=1, target=\"tilt\", kind=\"saturated\", value=1.5}]", "`value` of 0 to 1"),
        ("fault=[{at_s=1, target=\"payload\", kind=\"mass\", value=-1}]", "`value` of 0 to 1000"),
        ("fault=[{at_s=1, target=\"wind\", kind=\"gust\", vector=[0, -201, 0]}]", "`vector` of -200 to 200"),
        ("fault=[{at_s=-1, target=\"mpc\", kind=\"nan\"}]", "a fault at -1.0 s for 0.0 s"),
        ("fault=[{at_s=nan, target=\"mpc\", kind=\"nan\"}]", "a fault at NaN s for 0.0 s"),
        ("fault=[{at_s=1, target=\"tilt\", kind=\"off\", ms=1}]", "`ms` that tilt off has no use for"),
        ("fault=[{at_s=1, target=\"tilt\", kind=\"off\", ms=1}]", "this one uses none of the sizes"),
        ("fault=[{at_s=1, target=\"tilt\", kind=\"wrong\", how=\"bias\"}]", "uses `value`"),
        ("fault=[{at_s=1, target=\"rates\", kind=\"wrong\", count=1}]", "uses `how` and `value`"),
        ("fault=[{at_s=1, target=\"state\", kind=\"drop\", vector=[1, 0, 0]}]", "uses `probability`"),
        ("fault=[{at_s=1, target=\"wind\", kind=\"step\"}]", "a wind that a vehicle without drag does not feel"),
        ("fault=[{at_s=1, target=\"wind\", kind=\"step\"}]", "`plant.drag_linear_nspm` = [0.2, 0.2, 0.1]"),
    ];
    for (set, expected) in cases {
        check_refused(set, &[expected, "--set ", "^"]);
    }
}

#[test]
fn faults_that_need_processes_are_refused_in_process() {
    let fault = "fault=[{at_s=1, target=\"clock\", kind=\"offset\", process=\"mixer\", ms=-5}]";
    from_set(&[fault, "run.mode=lockstep"]).unwrap_or_else(|error| panic!("{fault}: {error}"));
    let error = from_set(&[fault, "run.mode=inprocess"]).expect_err("there are no processes").to_string();
    assert!(error.contains("in mode inprocess"), "{error}");
}

#[test]
fn the_edges_of_the_ranges_are_allowed() {
    for set in [
        "run.command_drop_probability=1",
        "plant.substep_s=0.01",
        "plant.rotor_lag_s=0.0005",
        "plant.tilt_max_deg=90",
        "plant.rotor_effectiveness=[0, 1, 2]",
        "attitude.mpc={prediction_horizon_s=2, control_horizon_s=2}",
        "attitude.actuator_lag_model_s=0.001",
        "mission.ramp_s=5",
        "fault=[{at_s=1, target=\"rates\", kind=\"wrong\", how=\"scale\", value=2}]",
        "fault=[{at_s=1, target=\"state\", kind=\"corrupt\", count=1, probability=0.5}]",
    ] {
        from_set(&[set]).unwrap_or_else(|error| panic!("{set}: {error}"));
    }
}

#[test]
fn swaps_that_cannot_be_flown_are_refused() {
    let cases = [
        ("swap=[{at_s=1, node=\"plant\"}]", "it is the vehicle"),
        ("swap=[{at_s=-1, node=\"mixer\"}]", "allowed: at least 0, at most 86400"),
        ("swap=[{at_s=1, node=\"mixer\", bounds={ticks=0}}]", "`swap[0].bounds.ticks` = 0.0 is out of range"),
        ("swap=[{at_s=1, node=\"mixer\", bounds={similarity=-1.5}}]", "allowed: at least -1, at most 1"),
        ("swap=[{at_s=1, node=\"mixer\"}, {at_s=2, node=\"mixer\"}]", "one after the other"),
        ("swap=[{at_s=1, node=\"mixer\", set=[\"run.seed=3\"]}]", "everything but `run`"),
        (
            "swap=[{at_s=1, node=\"mixer\", set=[\"attitude.mpc.prediction_horizon_s=0\"]}]",
            "`swap.set`: `attitude.mpc.prediction_horizon_s` = 0.0 is 0 samples",
        ),
        ("swap=[{at_s=1, node=\"mixer\", set=[\"nonsense\"]}]", "`swap.set`: not TOML"),
        ("swap=[{at_s=1, node=\"mixer\"}, {at_s=5, node=\"mixer\"}]", "one after the other"),
        ("swap=[{at_s=1, node=\"recorder\"}]", "a recorder is not swapped; kill it"),
        (
            "swap=[{at_s=1, node=\"mixer\", set=[\"fault=[{at_s=0, target=\\\"payload\\\", kind=\\\"mass\\\"}]\"]}]",
            "of its topic",
        ),
    ];
    for (set, reason) in cases {
        check_refused(set, &[reason]);
    }
    from_set(&[
        "attitude.mpc.constraints=cone",
        "fault=[{at_s=9, target=\"mpc\", kind=\"nan\"}]",
        "swap=[{at_s=1, node=\"mixer\", set=[\"attitude.law=lqr\"]}]",
    ])
    .unwrap_or_else(|error| panic!("a fault of the run that the candidate cannot have: {error}"));
    let faulted = ["fault=[{at_s=2, target=\"mixer\", kind=\"kill\"}]", "swap=[{at_s=1, node=\"mixer\"}]"];
    for mode in ["run.mode=realtime", "run.mode=lockstep", "run.mode=inprocess"] {
        from_set(&[mode, faulted[0], faulted[1]]).unwrap();
    }
    let error =
        from_set(&["run.mode=inprocess", "swap=[{at_s=1, node=\"mixer\", exec=\"x\"}]"]).unwrap_err().to_string();
    assert!(error.contains("in process there is no"), "{error}");
}

#[test]
fn two_swaps_of_a_node_may_not_share_a_tick() {
    for rate_hz in [50, 1000] {
        let sample_s = 1.0 / f64::from(rate_hz);
        let pair = |apart: f64| {
            let second = format!("{{at_s={}, node=\"mixer\"}}", 1.0 + apart * sample_s);
            let first = "{at_s=1, node=\"mixer\", standby_s=0.0, watch_s=0.0}"; // one tick on standby
            from_set(&[&format!("run.rate_hz={rate_hz}"), &format!("swap=[{first}, {second}]")])
        };
        assert!(pair(1.0).is_err() && pair(1.1).is_ok(), "{rate_hz} Hz");
    }
}

#[test]
fn a_candidate_has_its_own_settings_on_top_of_the_run_s() {
    let scenario = from_set(&["swap=[{at_s=1, node=\"attitude-mpc\", set=[\"attitude.law=lqr\"]}]"]).unwrap();
    let own = crate::candidate(&scenario, &scenario.swap[0]).unwrap();
    assert_eq!(own.attitude.law, crate::Law::Lqr);
    assert_eq!(own.attitude.mpc.q, scenario.attitude.mpc.q);
    assert!(own.swap.is_empty());
}

#[test]
fn a_model_where_it_would_have_no_effect_is_refused() {
    for others in [
        "attitude.law=pid",
        "attitude.law=lqr",
        "attitude.law=geometric",
        "attitude.law=indi",
        "attitude.mpc={constraints=\"cone\", state_constraints=\"soft\"}",
    ] {
        let refused = from_set(&[others, "attitude.mpc.model=scheduled"]).expect_err(others).to_string();
        assert!(refused.contains("`attitude.mpc.model`"), "{refused}");
        from_set(&[others, "attitude.mpc.model=hover"]).unwrap();
    }
    from_set(&["attitude.mpc.model=scheduled"]).unwrap();
    let coupled = ["attitude.mpc.model=coupled", "attitude.disturbance_gain=0.1"];
    for others in
        ["attitude.law=mpc", "attitude.law=lqr", "attitude.mpc={constraints=\"cone\", state_constraints=\"soft\"}"]
    {
        from_set(&[&coupled[..], &[others]].concat()).unwrap();
    }
    from_set(&coupled[..1]).expect("there is an estimate by default");
    for refused in [&[coupled[0], "attitude.disturbance_gain=0"][..], &["attitude.law=pid", coupled[0], coupled[1]]] {
        let refused = from_set(refused).expect_err("without effect").to_string();
        assert!(refused.contains("`attitude.mpc.model`"), "{refused}");
    }
}

#[test]
fn a_setting_that_its_switch_leaves_unread_is_refused() {
    let cases = [
        ("mission={trajectory=\"hover\", ramp_s=60}", "`mission.ramp_s` has no effect here"),
        ("attitude={mpc.r_rate=[1, 1, 1, 1], law=\"lqr\"}", "`attitude.law` = \"mpc\" with it"),
        ("attitude={law=\"indi\", disturbance_gain=0.1}", "`attitude.law` = a law other than \"indi\" with it"),
        ("attitude.mpc.rates_limit_dps=[90, 90, 90]", "`attitude.mpc.state_constraints` = \"soft\" with it"),
        ("attitude.mpc.state_constraints=\"soft\"", "`attitude.mpc.constraints` = \"box\" or \"cone\" with it"),
        ("plant.ground.friction=0.1", "`plant.ground.friction` has no effect here"),
        ("plant.turbulence.height_m=20", "`plant.turbulence.wind_at_6m_mps` = a wind above 0 with it"),
        ("plant.battery.sag=0.2", "`plant.battery.energy_wh` = an energy above 0 with it"),
        ("plant.wind_roughness_m=0.1", "`plant.wind_ned_mps` = a wind with it"),
        ("plant.sensors.imu.rate_hz=500", "`plant.sensors.filter` = \"ekf\" with it"),
        ("plant.sensors.alignment.tilt_deg=1", "`plant.sensors.filter` = \"ekf\" with it"),
        ("plant.sensors.receiver.latency_ms=20", "`plant.sensors.filter` = \"ekf\" with it"),
        ("fault=[{at_s=60.1, target=\"mixer\", kind=\"kill\"}]", "a fault at 60.1 s in a flight that ends at 60.0 s"),
        ("swap=[{at_s=61, node=\"mixer\"}]", "a swap at 61.0 s in a flight that ends at 60.0 s"),
    ];
    for (set, expected) in cases {
        check_refused(set, &[expected, "--set ", "^"]);
    }
    let paper =
        from_set(&["profile=paper", "attitude.mpc.solver=active-set"]).expect_err("nothing is solved").to_string();
    assert!(paper.contains("`attitude.mpc.constraints` = \"box\" or \"cone\" with it"), "{paper}");
    let led = ["profile=paper", "guidance.lead_s=0.1"];
    let nothing = from_set(&led).expect_err("no feed-forward leads").to_string();
    assert!(nothing.contains("`guidance.acceleration_feedforward` = true, or"), "{nothing}");
    from_set(&[&led[..], &["mission.part=[{kind='loiter', duration_s=9, heading_deg=90}]"]].concat())
        .expect("the heading leads");
    let pid = ["attitude.law=pid", "attitude.mpc.constraints=none", "guidance.preview_s=0.2"];
    let unseen = from_set(&pid).expect_err("only the MPC plans ahead").to_string();
    assert!(unseen.contains("`attitude.law` = \"mpc\" with it"), "{unseen}");
    let own = [&pid[..], &["node.attitude-mpc.exec=own.so"]].concat();
    from_set(&own).expect("a controller of another language may plan ahead");
}

#[test]
fn a_switch_that_is_turned_off_by_name_leaves_the_others_as_they_are() {
    for settings in [
        ["plant.turbulence.height_m=20", "plant.turbulence.wind_at_6m_mps=0"],
        ["plant.ground.friction=0.1", "plant.ground.present=false"],
        ["attitude.mpc.rates_limit_dps=[90, 90, 90]", "attitude.mpc.state_constraints=none"],
        ["plant.battery.sag=0.2", "plant.battery.energy_wh=0.0"],
        ["plant.wind_roughness_m=0.1", "plant.wind_ned_mps=[]"],
        ["fault=[{at_s=60, target=\"mixer\", kind=\"kill\"}]", "run.duration_s=60"],
        ["mission.part=[{kind='takeoff', height_m=5}]", "mission.trajectory=survey"], // the default, written out
    ] {
        let scenario = from_set(&settings).unwrap_or_else(|error| panic!("{settings:?}: {error}"));
        from_merged(&to_toml(&scenario), "scenario.toml").unwrap();
    }
}

#[test]
fn a_measured_delay_needs_the_model_at_hover() {
    let measured = "attitude.delay_compensation=measured";
    let refused = from_set(&[measured, "attitude.mpc.model=scheduled"]).expect_err("a model at speed").to_string();
    assert!(refused.contains("`attitude.delay_compensation` = \"measured\" with a model at speed"), "{refused}");
    from_set(&["attitude.delay_compensation=true", "attitude.mpc.model=scheduled"]).unwrap();
    for law in ["mpc", "lqr", "pid"] {
        let kept = from_set(&[measured, &format!("attitude.law={law}"), "attitude.mpc.constraints=none"]).unwrap();
        assert!(kept.attitude.delay_compensation.is_measured());
        assert_eq!(from_merged(&to_toml(&kept), "written").unwrap(), kept);
    }
    for refused in ["2", "guessed"] {
        let refused = from_set(&[&format!("attitude.delay_compensation={refused}")]).expect_err(refused).to_string();
        assert!(refused.contains("expected true, false or \"measured\""), "{refused}");
    }
}
