/*
 * trefoil.h: the interface between the Trefoil launcher and a controller in another language. Generated; do not edit.
 *
 * A library exports one function:
 *
 *     const TrefoilNode *trefoil_node_v1(const char *node);
 *
 * Frames: north-east-down for the world, forward-right-down for the body. SI units and radians.
 */

#pragma once

#include <stddef.h>
#include <stdint.h>

// Number of this interface. A library of another number is refused.
#define TREFOIL_ABI 1

// Age of a message that has not come yet.
#define TREFOIL_NEVER UINT64_MAX

// Largest memory of a node that is continued by another process [byte].
#define TREFOIL_MEMORY_BYTES 1000

// Vehicle and settings, given when a node is created. The trim is the hover of this vehicle.
typedef struct {
  // `[node.NAME.settings]` of the scenario as a JSON object.
  const char *settings_json;
  // Time between two samples [s].
  double dt_s;
  // Acceleration of gravity [m/s2].
  double g_mps2;
  // Mass [kg].
  double mass_kg;
  // Moments of inertia about the body axes x, y, z [kg m2].
  double inertia_kgm2[3];
  // Arms: rotor 1 forward, rotors 2 and 3 back, rotors 2 and 3 sideways [m].
  double arms_m[3];
  // Thrust constant [N / rotor speed unit squared].
  double kf;
  // Torque constant [N m / rotor speed unit squared].
  double km;
  // Rotor speeds at trim [rotor speed unit].
  double trim_rotor_speed[3];
  // Tilt of rotor 1 at trim [rad].
  double trim_tilt_rad;
  // Roll angle at trim [rad]; pitch is 0.
  double trim_roll_rad;
  // Position at the start of the flight, north, east, down [m].
  double start_position_m[3];
  // Velocity at the start, u, v, w in the body frame [m/s].
  double start_velocity_mps[3];
  // Euler angles roll, pitch, yaw at the start [rad].
  double start_attitude_rad[3];
  // Body rates p, q, r at the start [rad/s].
  double start_rates_radps[3];
} TrefoilSetup;

// Newest sample of the sensors. Position and velocity are NaN while their sensor is off.
typedef struct {
  // Age of the sample in ticks: 0 = of this tick, `TREFOIL_NEVER` = none has come.
  uint64_t age_ticks;
  // Position north, east, down [m].
  double position_m[3];
  // Velocity u, v, w in the body frame [m/s].
  double velocity_mps[3];
  // Euler angles roll, pitch, yaw [rad].
  double attitude_rad[3];
  // Body rates p, q, r [rad/s].
  double rates_radps[3];
  // Rotor speeds of the command in force [rotor speed unit].
  double rotor_speed[3];
  // Tilt of rotor 1 of the command in force [rad].
  double tilt_rad;
} TrefoilSample;

// Input of a step of guidance.
typedef struct {
  // Number of the sample to answer to, from 0.
  uint64_t tick;
  // Time of that sample [s].
  double time_s;
  // Newest sample.
  TrefoilSample sample;
} TrefoilGuidanceInput;

// Answer of a step of guidance.
typedef struct {
  // Position on the trajectory, north, east, down [m].
  double position_m[3];
  // Velocity on the trajectory, north, east, down [m/s].
  double velocity_mps[3];
  // References of roll, pitch, yaw [rad].
  double attitude_rad[3];
  // References of the body rates p, q, r [rad/s].
  double rates_radps[3];
  // Reference of w, the velocity along the body z axis [m/s].
  double w_mps;
} TrefoilGuidanceAnswer;

// Newest answer of guidance.
typedef struct {
  // Age in ticks: 0 = of this tick, `TREFOIL_NEVER` = none has come.
  uint64_t age_ticks;
  // Position on the trajectory, north, east, down [m].
  double position_m[3];
  // Velocity on the trajectory, north, east, down [m/s].
  double velocity_mps[3];
  // References of roll, pitch, yaw [rad].
  double attitude_rad[3];
  // References of the body rates p, q, r [rad/s].
  double rates_radps[3];
  // Reference of w, the velocity along the body z axis [m/s].
  double w_mps;
  // Time from one element of `preview` to the next, and from the sample to the first [s]; 0 = no preview
  // (`guidance.preview_s`).
  double preview_step_s;
  // Changes of the references from the sample to each time of the preview: w [m/s] and roll, pitch, yaw [rad].
  double preview[8][4];
} TrefoilReference;

// Input of a step of attitude-mpc.
typedef struct {
  // Number of the sample to answer to, from 0.
  uint64_t tick;
  // Time of that sample [s].
  double time_s;
  // Newest sample.
  TrefoilSample sample;
  // Newest reference.
  TrefoilReference reference;
} TrefoilAttitudeInput;

// Answer of a step of attitude-mpc.
typedef struct {
  // Deviations of col, lon, lat, ped from trim [N, N m, N m, N m]: force along body z, positive down, and moments
  // about body y, x and z, positive as pitch, roll and yaw.
  double demand[4];
  // 0 = the demand is valid; any other number = it is invalid, and the mixer treats it as late.
  uint64_t status;
} TrefoilAttitudeAnswer;

// Newest answer of attitude-mpc.
typedef struct {
  // Age in ticks: 0 = of this tick, `TREFOIL_NEVER` = none has come.
  uint64_t age_ticks;
  // Deviations of col, lon, lat, ped from trim [N, N m, N m, N m]: force along body z, positive down, and moments
  // about body y, x and z, positive as pitch, roll and yaw.
  double demand[4];
} TrefoilDemand;

// Input of a step of the mixer.
typedef struct {
  // Number of the sample to answer to, from 0.
  uint64_t tick;
  // Time of that sample [s].
  double time_s;
  // Newest sample.
  TrefoilSample sample;
  // Newest demand.
  TrefoilDemand demand;
} TrefoilMixerInput;

// Answer of a step of the mixer.
typedef struct {
  // Rotor speeds [rotor speed unit].
  double rotor_speed[3];
  // Tilt of rotor 1 [rad].
  double tilt_rad;
} TrefoilMixerAnswer;

// Input of a step of the plant: one command, and the time that it is in force.
typedef struct {
  // Number of the newest sample, from 0.
  uint64_t tick;
  // Time at which the step begins [s].
  double time_s;
  // Duration of the step [s]: a period, or less if the command changes in it. 0 at the start of the flight only:
  // the answer is then the state at the start.
  double advance_s;
  // Rotor speeds of the command [rotor speed unit]; all 0 = the motors are stopped.
  double rotor_speed[3];
  // Tilt of rotor 1 of the command [rad].
  double tilt_rad;
} TrefoilPlantInput;

// Answer of a step of the plant: the true state at its end.
typedef struct {
  // Position north, east, down [m].
  double position_m[3];
  // Velocity u, v, w in the body frame [m/s].
  double velocity_mps[3];
  // Euler angles roll, pitch, yaw [rad].
  double attitude_rad[3];
  // Body rates p, q, r [rad/s].
  double rates_radps[3];
  // Rotor speeds [rotor speed unit]. Before the call, the speeds of the command; a plant without lag leaves them.
  double rotor_speed[3];
  // Tilt of rotor 1 [rad]. Before the call, the tilt of the command; a plant without lag leaves it.
  double tilt_rad;
} TrefoilPlantAnswer;

// Functions of one node. The launcher calls them from one thread at a time for each node that it created.
typedef struct {
  // Number of the interface: `TREFOIL_ABI`.
  uint32_t abi;
  // Size of the node's input, for instance `sizeof(TrefoilAttitudeInput)` [byte].
  uint32_t input_bytes;
  // Size of the node's answer, for instance `sizeof(TrefoilAttitudeAnswer)` [byte].
  uint32_t answer_bytes;
  // Size of the memory that `snapshot` writes, at most `TREFOIL_MEMORY_BYTES`; 0 = none: the process that continues
  // after this one begins cold, and `snapshot` and `restore` may be NULL.
  uint32_t memory_bytes;
  // Creates a node. On an error writes its reason to `error`, of `error_bytes`, and returns NULL. `setup` and
  // its text are valid during the call only.
  void *(*create)(const TrefoilSetup *setup, char *error, size_t error_bytes);
  // Answers to one sample: reads `input` and writes all of `answer`. Any other result than 0 ends the process.
  int32_t (*step)(void *node, const void *input, void *answer);
  // Writes the memory of the node, `memory_bytes`.
  void (*snapshot)(const void *node, void *memory);
  // Continues from the memory of another process; on any other result than 0 the node begins cold.
  int32_t (*restore)(void *node, const void *memory);
  // Frees the node.
  void (*destroy)(void *node);
} TrefoilNode;

#ifdef __cplusplus
extern "C" {
#endif

// Returns the functions of `node` (`plant`, `guidance`, `attitude-mpc` or `mixer`), or NULL if it is not in this library.
const TrefoilNode *trefoil_node_v1(const char *node);

#ifdef __cplusplus
}
#endif
