// Flies the code that Simulink Coder generates for the model `controller` as attitude-mpc.
//
// Generated code keeps its state in globals. Several nodes of one process may share these globals: in a flight in
// process, or in a replay. The shim therefore keeps the state of each node (DW), and puts it into the globals for each
// step.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"
#include "lqr.h"
#include "trefoil.h"

// Weights of w, roll, pitch, yaw, p, q, r and of the four lag states, and of col, lon, lat, ped.
static const double Q[N] = {1e2, 1e3, 1e3, 1e3};
static const double R[M] = {0.4, 300, 85, 300};

typedef struct {
  P_controller_T parameters;
  DW_controller_T state;
} Controller;

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  Controller *controller = calloc(1, sizeof *controller);
  if (!controller) return NULL;
  double K[M][N];
  const char *reason = NULL;
  if (fabs(setup->dt_s - MODEL_SAMPLE_S) > 1e-9) reason = "the model has another sample time than run.rate_hz";
  if (setup->mass_kg != MODEL_MASS_KG) reason = "model.h is a model of another vehicle";
  if (strcmp(setup->settings_json, "{}")) reason = "this controller has no settings";
  if (lqr(Q, R, K)) reason = "there is no gain for these weights";
  controller_initialize();
  if (rtmGetErrorStatus(controller_M)) reason = rtmGetErrorStatus(controller_M);
  if (reason) {
    snprintf(error, error_bytes, "%s", reason);
    free(controller);
    return NULL;
  }
  for (int i = 0; i < M; i++)
    for (int j = 0; j < N; j++) controller->parameters.K_Gain[i + M * j] = K[i][j];
  controller->state = controller_DW;
  return controller;
}

static int32_t step(void *node, const void *input, void *answer) {
  Controller *controller = node;
  const TrefoilAttitudeInput *in = input;
  TrefoilAttitudeAnswer *out = answer;
  out->status = in->sample.age_ticks > 0 || in->reference.age_ticks > 0 || isnan(in->sample.velocity_mps[2]);
  if (out->status) return 0;

  controller_P = controller->parameters;
  controller_DW = controller->state;
  controller_U.w = in->sample.velocity_mps[2];
  controller_U.w_ref = in->reference.w_mps;
  memcpy(controller_U.attitude, in->sample.attitude_rad, sizeof controller_U.attitude);
  memcpy(controller_U.rates, in->sample.rates_radps, sizeof controller_U.rates);
  memcpy(controller_U.attitude_ref, in->reference.attitude_rad, sizeof controller_U.attitude_ref);
  memcpy(controller_U.rates_ref, in->reference.rates_radps, sizeof controller_U.rates_ref);
  controller_step();
  controller->state = controller_DW;
  memcpy(out->demand, controller_Y.demand, sizeof out->demand);
  return rtmGetErrorStatus(controller_M) != NULL;
}

static void snapshot(const void *node, void *memory) {
  memcpy(memory, &((const Controller *)node)->state, sizeof(DW_controller_T));
}

static int32_t restore(void *node, const void *memory) {
  memcpy(&((Controller *)node)->state, memory, sizeof(DW_controller_T));
  return 0;
}

static void destroy(void *node) {
  controller_terminate();
  free(node);
}

static const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilAttitudeInput), sizeof(TrefoilAttitudeAnswer), sizeof(DW_controller_T),
    create,      step,                         snapshot,                      restore,
    destroy,
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "attitude-mpc") ? NULL : &NODE; }
