//! Flights seen by a ground station: pymavlink at the other end of the link.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Read};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use contract::message::State;
use flight::log;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::control::{status, tell};
use crate::harness::{Flight, PATIENT, fly, launcher, namespace, python_with, top, wait_until};
use crate::processes::{kill, niceness, processes_named};

/// A ground station in Python.
struct Station {
    child: Child,
    output: BufReader<std::process::ChildStdout>,
    port: u16,
}

impl Station {
    fn start(python: &Path) -> Self {
        let mut command = Command::new(python);
        command.arg(top().join("tests/mavlink/client.py")).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("Python starts");
        let mut output = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut port = String::new();
        output.read_line(&mut port).expect("it prints its port");
        Self { child, output, port: port.trim().parse().expect("a port") }
    }

    fn address(&self) -> String {
        format!("udpout:127.0.0.1:{}", self.port)
    }

    /// Returns all messages received until the vehicle was disarmed.
    fn finish(mut self) -> Vec<Value> {
        let mut text = String::new();
        self.output.read_to_string(&mut text).expect("it prints");
        assert!(self.child.wait().expect("it ends").success());
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }
}

impl Drop for Station {
    fn drop(&mut self) {
        let _ = self.child.kill(); // it has ended already, in tests that pass
        let _ = self.child.wait();
    }
}

/// Returns the messages of one kind.
fn of<'a>(came: &'a [Value], kind: &str) -> Vec<&'a Value> {
    came.iter().filter(|message| message["mavpackettype"] == kind).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn a_ground_station_sees_the_flight_that_the_log_has_and_changes_nothing() {
    let Some(python) = python_with(&["pymavlink==2.4.50"]) else { return };
    let (ns, station) = (namespace(), Station::start(&python));
    let settings = ["--set", "run.duration_s=15.0", "--set", PATIENT, "--set", "deadline.end_to_end_ms=9.0"];
    let started = Instant::now();
    let flight =
        Flight::start(&ns, &[&settings[..], &["--mavlink", &station.address(), "--home", "10,20,30"]].concat());
    wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(1.0));
    tell(&ns, &["inject", "payload", "mass", "--for", "0.2s"]).expect("it flies");
    let outcome = flight.finish();
    let took_s = started.elapsed().as_secs();
    assert_eq!(outcome.code(), Some(0), "{}", outcome.stderr);
    let came = station.finish();
    let log = log::read(&outcome.out.join("flight.mcap")).expect("the log reads");

    check_attitudes(&came, &log.states);
    check_parameters(&came);
    check_answers(&came);
    let heartbeats = of(&came, "HEARTBEAT");
    assert!(heartbeats.len() >= 5 && heartbeats.len() as u64 <= took_s + 3, "in {took_s} s: {heartbeats:?}");
    assert_eq!([&heartbeats[0]["type"], &heartbeats[0]["autopilot"]], [15, 0], "a tricopter, generic");
    let page = std::fs::read_to_string(top().join("docs/mavlink.md")).expect("it reads");
    let has_name = |of: &&Value| page.contains(&format!("\n| {} | ", of["custom_mode"]));
    assert!(heartbeats.iter().all(has_name), "docs/mavlink.md should name each mode: {heartbeats:?}");
    let texts: Vec<&str> = of(&came, "STATUSTEXT").iter().filter_map(|of| of["text"].as_str()).collect();
    assert!(texts.iter().any(|text| text.ends_with("s: payload injected mass for 0.2 s")), "{texts:?}");
    for kind in
        ["GLOBAL_POSITION_INT", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "SERVO_OUTPUT_RAW", "HOME_POSITION"]
    {
        assert!(!of(&came, kind).is_empty(), "{kind}");
    }
    let global = of(&came, "GLOBAL_POSITION_INT")[0];
    assert!((number(&global["lat"]) * 1e-7 - 10.0).abs() < 1e-3 && (number(&global["lon"]) * 1e-7 - 20.0).abs() < 1e-3);
}

/// Compares each attitude and position with the STATE of its time in the log, to the resolution of the message.
fn check_attitudes(came: &[Value], states: &[State]) {
    let states: BTreeMap<u64, &State> = states.iter().map(|state| (state.stamp.tick * 10, state)).collect();
    let attitudes = of(came, "ATTITUDE");
    assert!(attitudes.len() > 30, "{}", attitudes.len());
    for attitude in attitudes {
        let state = states[&attitude["time_boot_ms"].as_u64().expect("a time")];
        let measured = state.measured.attitude_rad.iter().chain(&state.measured.rates_radps);
        for (name, is) in ["roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"].iter().zip(measured) {
            assert!((number(&attitude[*name]) - is).abs() < 1e-6, "{name}: {attitude} against {is}");
        }
    }
    let positions = of(came, "LOCAL_POSITION_NED");
    assert!(!positions.is_empty());
    for position in positions {
        let state = states[&position["time_boot_ms"].as_u64().expect("a time")];
        for (name, is) in ["x", "y", "z"].iter().zip(state.measured.position_m) {
            assert!((number(&position[*name]) - is).abs() < 1e-5, "{name}: {position} against {is}");
        }
    }
}

/// Checks that the parameter list is complete, and that an attempt to set a parameter left its value.
fn check_parameters(came: &[Value]) {
    let values = of(came, "PARAM_VALUE");
    let count = values[0]["param_count"].as_u64().expect("a count");
    let listed: BTreeSet<u64> = values.iter().filter_map(|of| of["param_index"].as_u64()).collect();
    assert!(count > 50 && listed.iter().copied().eq(0..count), "{count}: {listed:?}");
    let of_name = |name: &str| -> Vec<f64> {
        values.iter().filter(|of| of["param_id"] == name).map(|of| number(&of["param_value"])).collect()
    };
    assert_eq!(of_name("MPC_NP_S"), [f64::from(0.2_f32); 3], "in the list, read, and not set");
    assert_eq!(of_name("DL_END_MS"), [9.0]);
    let texts = of(came, "STATUSTEXT");
    assert!(texts.iter().any(|of| of["text"].as_str().is_some_and(|text| text.starts_with("MPC_NP_S is read-only"))));
    let errors = of(came, "PARAM_ERROR").into_iter().map(|of| (of["param_id"].as_str(), of["error"].as_u64()));
    let expected = [("MPC_NP_S", READ_ONLY), ("SYSID_THISMAV", DOES_NOT_EXIST), ("SYSID_THISMAV", DOES_NOT_EXIST)];
    assert!(errors.eq(expected.map(|(name, error)| (Some(name), Some(error)))), "{:?}", of(came, "PARAM_ERROR"));
}

// Errors of parameters, MAV_PARAM_ERROR.
const DOES_NOT_EXIST: u64 = 1;
const READ_ONLY: u64 = 5;

// Results of commands, MAV_RESULT.
const ACCEPTED: u64 = 0;
const DENIED: u64 = 2;
const UNSUPPORTED: u64 = 3;

// Results of mission requests, MAV_MISSION_RESULT.
const INVALID_SEQUENCE: u64 = 13;
const MISSION_DENIED: u64 = 14;

/// Bits of `MAV_PROTOCOL_CAPABILITY`: `MISSION_ITEM_INT`, `COMMAND_INT`, MAVLink 2, parameter values cast to float.
const CAPABILITIES: u64 = 4 | 8 | 8192 | 131_072;

fn check_answers(came: &[Value]) {
    let results = |command: u64| -> Vec<u64> {
        let all = of(came, "COMMAND_ACK").into_iter().filter(|of| of["command"] == command);
        all.filter_map(|of| of["result"].as_u64()).collect()
    };
    assert_eq!(results(512), [ACCEPTED, UNSUPPORTED], "AUTOPILOT_VERSION, and a camera that is not there");
    assert_eq!(results(400), [DENIED], "it is not armed or disarmed from outside");
    assert_eq!(results(511), [ACCEPTED]);
    let versions = of(came, "AUTOPILOT_VERSION");
    assert_eq!((versions.len(), &versions[0]["capabilities"]), (1, &Value::from(CAPABILITIES)));
    assert_eq!(of(came, "MISSION_COUNT")[0]["count"], 0);
    let missions = of(came, "MISSION_ACK").into_iter().map(|of| of["type"].as_u64());
    assert!(missions.eq([INVALID_SEQUENCE, MISSION_DENIED, MISSION_DENIED].map(Some)), "an item, an upload, a clear");
}

#[test]
fn a_flight_can_be_watched_by_a_process_started_later() {
    let Some(python) = python_with(&["pymavlink==2.4.50"]) else { return };
    let (ns, station) = (namespace(), Station::start(&python));
    let flight = Flight::start(&ns, &["--no-log", "--set", "run.duration_s=15.0", "--set", PATIENT]);
    wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.2));
    let output = launcher().args(["mavlink", "--namespace", &ns, &station.address()]).output().expect("it runs");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(flight.finish().code(), Some(0));
    assert!(!of(&station.finish(), "ATTITUDE").is_empty());
}

#[test]
fn bad_addresses_homes_and_modes_are_refused_with_what_to_write() {
    for (words, told) in [
        (&["fly", "--mavlink", "127.0.0.1:14550"][..], "udpout:127.0.0.1:14550"),
        (&["fly", "--mavlink", "udpout:127.0.0.1:1", "--mode", "inprocess"], "--mode realtime or lockstep"),
        (&["fly", "--home", "1,2,3"], "--mavlink"),
        (&["fly", "--mavlink", "udpout:127.0.0.1:1", "--home", "1,2"], "LATITUDE,LONGITUDE,HEIGHT"),
        (&["mavlink", "udpout:127.0.0.1:1", "--namespace", "nothing-flies-here"], "no stack runs"),
    ] {
        let output = launcher().args(words).output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{words:?}: {said}");
        assert!(said.contains(told), "{words:?}: {said}");
    }
}

#[test]
fn a_station_that_is_not_there_costs_the_flight_nothing() {
    let settings = ["--no-log", "--mode", "lockstep", "--set", "run.duration_s=2.0"];
    let outcome = fly(&[&settings[..], &["--mavlink", "udpout:127.0.0.1:9"]].concat());
    assert_eq!((outcome.code(), outcome.stderr.as_str()), (Some(0), ""));
}

/// `PARAM_REQUEST_LIST` of a ground station to the vehicle: the request with the most answers.
const LIST: [u8; 14] = [0xfd, 2, 0, 0, 0, 0xff, 0xbe, 21, 0, 0, 1, 1, 0x88, 0xc0];
/// Largest number of datagrams of a flood to one port.
const FLOOD: usize = 20_000_000;

/// Sends `datagram` to each of the `ports`, again and again, until `is_over`.
fn flood(ports: [u16; 2], datagram: &[u8], is_over: &AtomicBool) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    for _ in 0..FLOOD {
        for port in ports {
            let _ = socket.send_to(datagram, ("127.0.0.1", port)); // fails once the port's process has ended
        }
        if is_over.load(Ordering::Relaxed) {
            return;
        }
    }
    panic!("the flood has ended before the flight");
}

#[test]
fn a_flood_of_requests_neither_holds_up_the_end_of_a_flight_nor_an_interrupt() {
    for datagram in [&LIST[..], b"no MAVLink"] {
        let ns = namespace();
        let ports =
            [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").and_then(|of| of.local_addr()).expect("a port").port());
        let [beside, later] = ports.map(|port| format!("udpin:127.0.0.1:{port}"));
        let settings = ["--no-log", "--set", "run.duration_s=15.0", "--set", PATIENT];
        let flight = Flight::start(&ns, &[&settings[..], &["--mavlink", &beside]].concat());
        wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.2));
        let is_over = AtomicBool::new(false);
        let outcome = std::thread::scope(|scope| {
            scope.spawn(|| flood(ports, datagram, &is_over));
            let _over = Over(&is_over); // sets the flag after a failure too
            let mut command = launcher();
            command.args(["mavlink", "--namespace", &ns, &later]).stdout(Stdio::piped());
            let mut watching = command.spawn().expect("it starts");
            let mut line = String::new();
            BufReader::new(watching.stdout.take().expect("it is piped")).read_line(&mut line).expect("it has joined");
            kill_process(Pid::from_child(&watching), Signal::INT).expect("it runs");
            let mut ended = None;
            wait_until("it ends while the flood goes on", || {
                ended = watching.try_wait().expect("it can be waited for");
                ended.is_some()
            });
            assert_eq!(ended.and_then(|status| status.code()), Some(0), "{line}");
            flight.finish()
        });
        let run = outcome.run();
        assert_eq!((outcome.code(), &run["exit_code"]), (Some(0), &Value::from(0)), "{}", outcome.stderr);
        assert!(!run["reservations"].to_string().contains("--mavlink"), "{}", run["reservations"]);
    }
}

/// Sets its flag when it is dropped.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_mavlink_process_that_is_stopped_or_killed_is_a_reservation_and_no_verdict() {
    for (signal, told) in [("-STOP", "did not end and was killed"), ("-KILL", "failed (signal: 9")] {
        let ns = namespace();
        let settings = ["--no-log", "--set", "run.duration_s=15.0", "--set", PATIENT];
        let flight = Flight::start(&ns, &[&settings[..], &["--mavlink", "udpout:127.0.0.1:9"]].concat());
        wait_until("the stack flies", || status(&ns)["time_s"].as_f64() > Some(0.2));
        let beside = processes_named(&ns, "mavlink");
        assert!(beside.len() == 1 && niceness(beside[0]) == 10, "{beside:?}");
        kill(signal, &beside);
        let outcome = flight.finish();
        let run = outcome.run();
        assert_eq!((outcome.code(), &run["exit_code"]), (Some(0), &Value::from(0)), "{}", outcome.stderr);
        let expected = format!("the process of --mavlink {told}");
        assert!(run["reservations"].to_string().contains(&expected), "{}", run["reservations"]);
    }
}
