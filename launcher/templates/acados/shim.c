// Flies the solver that acados generates for the model `controller` as attitude-mpc.
//
// Every step begins from the same guess, the present state throughout. The solver then remembers nothing, and the next
// process goes on with the same bits.

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "acados_c/ocp_nlp_interface.h"
#include "acados_solver_controller.h"
#include "model.h"
#include "trefoil.h"

enum { STATES = CONTROLLER_NX, COMMANDS = CONTROLLER_NU, SAMPLES = CONTROLLER_N };
enum { WEIGHTS = CONTROLLER_NY, MOTION = CONTROLLER_NYN };

// Rotor speeds as shares of the hover speeds, and the tilt [rad].
typedef struct {
  double actuators[COMMANDS];  // positions, which follow the commands with a lag
  double command[COMMANDS];    // last command
} Memory;

typedef struct {
  controller_solver_capsule *solver;
  Memory memory;
} Controller;

static const double HOVER[COMMANDS] = {1, 1, 1, MODEL_TRIM_TILT_RAD};

static void destroy(void *node) {
  Controller *controller = node;
  controller_acados_free(controller->solver);
  controller_acados_free_capsule(controller->solver);
  free(controller);
}

// Reads {"weights":[...]}: the weights of w, roll, pitch, yaw, p, q, r and of the commands. Returns false unless all
// are there and positive.
static bool read_weights(const char *json, double weights[WEIGHTS]) {
  static const char KEY[] = "{\"weights\":[";
  if (strncmp(json, KEY, strlen(KEY))) return false;
  char *at = (char *)json + strlen(KEY);
  for (int i = 0; i < WEIGHTS; i++) {
    if (i > 0 && *at++ != ',') return false;
    weights[i] = strtod(at, &at);
    if (!(weights[i] > 0)) return false;
  }
  return !strcmp(at, "]}");
}

// Replaces the weights of generate.py.
static void set_weights(controller_solver_capsule *solver, const double weights[WEIGHTS]) {
  ocp_nlp_config *config = controller_acados_get_nlp_config(solver);
  ocp_nlp_dims *dims = controller_acados_get_nlp_dims(solver);
  ocp_nlp_in *in = controller_acados_get_nlp_in(solver);
  double stage[WEIGHTS * WEIGHTS] = {0}, last[MOTION * MOTION] = {0};
  for (int i = 0; i < WEIGHTS; i++) stage[i * WEIGHTS + i] = weights[i];
  for (int i = 0; i < MOTION; i++) last[i * MOTION + i] = 0.2 * weights[i];  // as in generate.py
  for (int k = 0; k < SAMPLES; k++) ocp_nlp_cost_model_set(config, dims, in, k, "W", stage);
  ocp_nlp_cost_model_set(config, dims, in, SAMPLES, "W", last);
}

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  const char *reason = NULL;
  if (fabs(setup->dt_s - MODEL_SAMPLE_S) > 1e-9) reason = "model.h is a model of another run.rate_hz";
  if (setup->mass_kg != MODEL_MASS_KG) reason = "model.h is a model of another vehicle";
  double weights[WEIGHTS];
  bool is_tuned = strcmp(setup->settings_json, "{}");
  if (is_tuned && !read_weights(setup->settings_json, weights))
    reason = "give settings.weights: 11 positive numbers, as STATE and COMMAND of generate.py";
  Controller *controller = reason ? NULL : calloc(1, sizeof *controller);
  if (controller) {
    controller->solver = controller_acados_create_capsule();
    memcpy(controller->memory.actuators, HOVER, sizeof HOVER);
    memcpy(controller->memory.command, HOVER, sizeof HOVER);
    if (controller_acados_create(controller->solver) == 0) {
      if (is_tuned) set_weights(controller->solver, weights);
      return controller;
    }
    reason = "acados cannot create its solver";
    free(controller);
  }
  snprintf(error, error_bytes, "%s", reason ? reason : "no memory");
  return NULL;
}

// Writes the state of the model: motion and actuators.
static void state_of(const TrefoilSample *sample, const Memory *memory, double x[STATES]) {
  x[0] = sample->velocity_mps[2];
  memcpy(&x[1], sample->attitude_rad, sizeof sample->attitude_rad);
  memcpy(&x[4], sample->rates_radps, sizeof sample->rates_radps);
  memcpy(&x[7], memory->actuators, sizeof memory->actuators);
}

// Writes the goal: motion and command.
static void goal_of(const TrefoilReference *reference, double yaw_rad, double goal[STATES]) {
  goal[0] = reference->w_mps;
  memcpy(&goal[1], reference->attitude_rad, sizeof reference->attitude_rad);
  goal[3] = yaw_rad + remainder(goal[3] - yaw_rad, 2 * acos(-1));  // the short way round
  memcpy(&goal[4], reference->rates_radps, sizeof reference->rates_radps);
  memcpy(&goal[7], HOVER, sizeof HOVER);
}

// Solves for the command that acts from the next sample on. Returns the status of acados, 0 if it is solved.
static int solve(Controller *controller, double x[STATES], double goal[STATES], double forward[2]) {
  controller_solver_capsule *solver = controller->solver;
  ocp_nlp_config *config = controller_acados_get_nlp_config(solver);
  ocp_nlp_dims *dims = controller_acados_get_nlp_dims(solver);
  ocp_nlp_in *in = controller_acados_get_nlp_in(solver);
  ocp_nlp_out *out = controller_acados_get_nlp_out(solver);
  double *command = controller->memory.command;
  for (int stage = 0; stage <= SAMPLES; stage++) {
    controller_acados_update_params(solver, stage, forward, 2);
    ocp_nlp_cost_model_set(config, dims, in, stage, "yref", goal);
    ocp_nlp_out_set(config, dims, out, stage, "x", x);
    if (stage < SAMPLES) ocp_nlp_out_set(config, dims, out, stage, "u", command);
  }
  ocp_nlp_constraints_model_set(config, dims, in, 0, "lbx", x);
  ocp_nlp_constraints_model_set(config, dims, in, 0, "ubx", x);
  ocp_nlp_constraints_model_set(config, dims, in, 0, "lbu", command);
  ocp_nlp_constraints_model_set(config, dims, in, 0, "ubu", command);
  int status = controller_acados_solve(solver);
  if (status == 0) ocp_nlp_out_get(config, dims, out, 1, "u", command);
  return status;
}

// Writes col, lon, lat, ped that a command produces, as deviations from hover.
static void demand_of(const double command[COMMANDS], double demand[4]) {
  const double *of[2] = {command, HOVER};
  double squares[2][4];
  for (int i = 0; i < 2; i++) {
    double front = of[i][0] * MODEL_TRIM_ROTOR_SPEED[0];
    squares[i][0] = front * front * sin(of[i][3]);
    squares[i][1] = front * front * cos(of[i][3]);
    squares[i][2] = pow(of[i][1] * MODEL_TRIM_ROTOR_SPEED[1], 2);
    squares[i][3] = pow(of[i][2] * MODEL_TRIM_ROTOR_SPEED[2], 2);
  }
  for (int i = 0; i < 4; i++) {
    demand[i] = 0;
    for (int j = 0; j < 4; j++) demand[i] += MODEL_MIXING[i][j] * (squares[0][j] - squares[1][j]);
  }
}

static int32_t step(void *node, const void *input, void *answer) {
  Controller *controller = node;
  Memory *memory = &controller->memory;
  const TrefoilAttitudeInput *in = input;
  TrefoilAttitudeAnswer *out = answer;
  const TrefoilSample *sample = &in->sample;
  double x[STATES], goal[STATES], forward[2] = {sample->velocity_mps[0], sample->velocity_mps[1]};

  // Without a sample or a reference of this tick there is no answer.
  out->status = sample->age_ticks > 0 || in->reference.age_ticks > 0 || isnan(sample->velocity_mps[2]);
  if (out->status) return 0;

  // While the last command acts, the actuators follow it until the next sample.
  state_of(sample, memory, x);
  goal_of(&in->reference, x[3], goal);
  for (int i = 0; i < COMMANDS; i++) {
    double share = 1 - exp(-MODEL_SAMPLE_S / MODEL_ACTUATOR_LAG_S[i]);
    memory->actuators[i] += share * (memory->command[i] - memory->actuators[i]);
  }
  out->status = solve(controller, x, goal, forward);
  demand_of(memory->command, out->demand);
  return 0;
}

static void snapshot(const void *node, void *memory) {
  memcpy(memory, &((const Controller *)node)->memory, sizeof(Memory));
}

static int32_t restore(void *node, const void *memory) {
  memcpy(&((Controller *)node)->memory, memory, sizeof(Memory));
  return 0;
}

static const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilAttitudeInput), sizeof(TrefoilAttitudeAnswer), sizeof(Memory),
    create,      step,                         snapshot,                      restore,        destroy,
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "attitude-mpc") ? NULL : &NODE; }
