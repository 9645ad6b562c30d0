//! The table of messages: each field once, with its type, its meaning and its mark. [`message`](super) generates the
//! types and their [`Field`](super::field::Field)s from the table, the flight log the conversion to protobuf.
//!
//! A field may have a mark: `as clock` if its value depends on the machine and not on the flight, so that a replay does
//! not compare it; `as demand` if the receiver acts on it, so that the fault `wrong` changes it. `= PlantStatus` names
//! the type that gives the numbers of a field their names. A change in this table is a new layout: raise the version
//! in the names of all messages, and change `launcher/flight/proto/trefoil.proto` too; the compiler compares both.

/// Calls the macro `$with` with the table of parts and messages.
#[macro_export]
macro_rules! messages {
    ($with:ident) => {
        $with! {
            parts {
                /// Provenance and timing of one message. Times are `CLOCK_MONOTONIC` nanoseconds, except in process.
                Stamp {
                    /// Number of the plant sample; its simulated time is `tick` times the sample time.
                    tick: u64,
                    /// Instant of the plant sample: the plant's release time; in lockstep, the moment at which the
                    /// tick began; in process, the simulated time.
                    sample_ns: u64 as clock,
                    /// Number of this message among those of its publisher, from 1; 0 = no message yet.
                    sequence: u64,
                    /// Number of the publisher's process among all processes of its node, from 1.
                    epoch: u64,
                    /// Sequence numbers of the messages that this one was computed from, by topic; 0 = none.
                    inputs: [u64; Topic::COUNT],
                    /// Epochs of the messages that this one was computed from, by topic; 0 = none.
                    input_epochs: [u64; Topic::COUNT],
                    /// Epoch of the process whose snapshot the publisher restored; 0 = it restored none.
                    restored_epoch: u64,
                    /// Number of ticks that the process of `restored_epoch` had done.
                    restored_ticks: u64,
                    /// Publication times along the chain, by topic, up to and including this message.
                    publish_ns: [u64; Topic::COUNT] as clock,
                    /// Time at which the publisher was due: the release for the plant; for the other nodes the time at
                    /// which their input was sent, or became late. In lockstep the time at which the publisher woke.
                    release_ns: u64 as clock,
                    /// Time at which the publisher began to work on this message.
                    start_ns: u64 as clock,
                    /// CPU time of the publisher's thread in its previous cycle, warm-up included
                    /// (`runtime::cycle_timing`) \[ns\].
                    cpu_ns: u64 as clock,
                    /// Number of deadlines that the publisher has missed so far.
                    misses: u64 as clock,
                    /// Number of periods that the publisher has skipped so far.
                    slips: u64 as clock,
                    /// Delay that faults added in all nodes of the chain from the sample to this message, in lockstep
                    /// and in process \[ns\].
                    held_ns: u64 as clock,
                    /// Number of entries and changes of the fault table (`runtime::fault_table`) that the publisher
                    /// knew of.
                    faults: u64,
                    /// Bits of [`delivery`](crate::stamp::delivery): 0 if receivers act on this message, else the
                    /// reason why not.
                    delivery: u64,
                    /// Checksum of the whole message, computed with this field 0: see [`Message::with_checksum`].
                    checksum: u64 as clock,
                }

                /// Position, velocity, attitude and rates.
                Kinematics {
                    /// Position X, Y, Z in NED \[m\].
                    position_m: [f64; 3],
                    /// Velocity u, v, w in the body frame \[m/s\].
                    velocity_mps: [f64; 3],
                    /// Euler angles phi, theta, psi \[rad\].
                    attitude_rad: [f64; 3],
                    /// Body rates p, q, r \[rad/s\].
                    rates_radps: [f64; 3],
                }

                /// Rotor speeds and tilt on the wire: the four numbers of [`Actuation`](crate::actuation::Actuation).
                ActuationMsg {
                    /// Rotor speeds `Omega_1..3` \[rotor speed unit\].
                    rotor_speed: [f64; 3],
                    /// Tilt mu of rotor 1 \[rad\].
                    tilt_rad: f64,
                }

                /// Errors that the navigation unit expects of its estimate, and the results of its gates; all zero
                /// without the EKF.
                Navigation {
                    /// Standard deviations of the measured position, NED \[m\].
                    position_m: [f64; 3],
                    /// Standard deviations of the measured velocity, NED \[m/s\].
                    velocity_mps: [f64; 3],
                    /// Standard deviations of the measured attitude, as turns about the body axes \[rad\].
                    attitude_rad: [f64; 3],
                    /// Normalised innovation squared of the last position, velocity, height, heading and flow, as a
                    /// share of its gate: above 1 the measurement was refused, or reset the estimate.
                    innovations: [f64; 5],
                    /// Number of measurements that the gates refused so far, in the order of `innovations`.
                    refused: [u64; 5],
                    /// Number of resets of the estimate so far.
                    resets: u64,
                    /// Number of the IMU whose filter flies, from 1.
                    imu: u64,
                    /// Number of sound IMUs: they send new readings, and no source contradicts their filter.
                    imus_sound: u64,
                }

                /// Change of the reference until a later time.
                Ahead {
                    /// Change of w \[m/s\].
                    w_mps: f64,
                    /// Changes of phi, theta, psi; that of psi in the direction in which the heading turns \[rad\].
                    attitude_rad: [f64; 3],
                }

                /// Command that the plant received, for replay.
                Arrival {
                    /// Sequence number of the message.
                    sequence: u64,
                    /// Epoch of the publisher.
                    epoch: u64,
                    /// Time from the previous sample to the arrival \[ns\].
                    after_ns: u64,
                }
            }
            messages {
                /// STATE: the measured motion and the command in force.
                State "trefoil.State.v10" 680 bytes {
                    /// Provenance and timing.
                    stamp: Stamp,
                    /// Sequence number of the ACTUATORS message in force up to this sample; 0 = none yet, the trim
                    /// command.
                    applied_sequence: u64,
                    /// Time from the sample that the command in force answers to the effect of the command \[ns\].
                    applied_age_ns: u64,
                    /// Measured motion.
                    measured: Kinematics,
                    /// Command that was in force up to this sample.
                    command_in_force: ActuationMsg,
                    /// Wire value of a [`PlantStatus`].
                    status: u64 = PlantStatus,
                    /// Commands received since the previous sample, in order of arrival; entries beyond `arrived` are
                    /// zero.
                    arrivals: [Arrival; MAX_ARRIVALS],
                    /// Number of valid entries in `arrivals`.
                    arrived: u64,
                    /// Errors that the navigation unit expects of `measured`.
                    navigation: Navigation,
                    /// Rotor speeds and tilt as the telemetry of the actuators gives them.
                    sensed: ActuationMsg,
                }

                /// REFERENCE: the attitude, rates and vertical velocity that the attitude loop shall follow.
                Reference "trefoil.Reference.v9" 608 bytes {
                    /// Provenance and timing.
                    stamp: Stamp,
                    /// Position on the trajectory, NED \[m\].
                    position_m: [f64; 3],
                    /// Velocity on the trajectory, NED \[m/s\].
                    velocity_mps: [f64; 3],
                    /// Reference of w, the body z velocity \[m/s\].
                    w_mps: f64 as demand,
                    /// References of phi, theta, psi \[rad\].
                    attitude_rad: [f64; 3] as demand,
                    /// References of p, q, r \[rad/s\].
                    rates_radps: [f64; 3] as demand,
                    /// Disturbance estimate of the position loop: acceleration x (ahead) and y (to the right) in the
                    /// heading frame, which is NED turned by the yaw psi, so not north and east \[m/s2\].
                    disturbance_mps2: [f64; 2],
                    /// Limits that were active, and repeated references: bits of [`guidance_flags`].
                    flags: u64,
                    /// Time from one element of `preview` to the next, and to the first \[ns\]; 0 = no preview.
                    preview_step_ns: u64,
                    /// Changes of the reference until the later times, as far as guidance knows them.
                    preview: [Ahead; PREVIEW],
                }

                /// CONTROLS: the demanded conventional inputs, as deviations from trim.
                Controls "trefoil.Controls.v9" 320 bytes {
                    /// Provenance and timing.
                    stamp: Stamp,
                    /// Demand of col, lon, lat, ped \[N, N m, N m, N m\].
                    demand: [f64; 4] as demand,
                    /// Estimate of the input disturbance, in the axes and units of `demand`.
                    disturbance: [f64; 4],
                    /// Wire value of a [`SolveStatus`].
                    status: u64 = SolveStatus,
                    /// Iterations of the constrained solver, 0 on the explicit path.
                    iterations: u64,
                    /// Time inside the constrained solver \[ns\], 0 on the explicit path.
                    solve_ns: u64 as clock,
                    /// Number of actuator constraints that are active in the published plan.
                    active_constraints: u64,
                    /// Number of ticks so far with the status `LimitReached` or `Fallback`.
                    fallbacks: u64,
                }

                /// ACTUATORS: the command for rotors and servo.
                Actuators "trefoil.Actuators.v9" 256 bytes {
                    /// Provenance and timing.
                    stamp: Stamp,
                    /// Command inside the actuators' limits.
                    command: ActuationMsg as demand,
                    /// Limits that the command reached, and fallbacks: bits of [`mixer_flags`].
                    flags: u64,
                }
            }
            truth {
                /// TRUTH: the true motion and actuator positions at a sample, for recorder and observers. The plant
                /// sends it after STATE, and no node receives it. It has no topic, and no fault changes it.
                Truth "trefoil.Truth.v1" 152 bytes {
                    /// Number of the plant sample.
                    tick: u64,
                    /// Sequence number of the newest STATE when this message was sent, from 1; 0 = a probe.
                    sequence: u64,
                    /// Checksum of the whole message, computed with this field 0.
                    checksum: u64 as clock,
                    /// True motion.
                    actual: Kinematics,
                    /// True actuator positions.
                    actuators: ActuationMsg,
                }
            }
        }
    };
}
