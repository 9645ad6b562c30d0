// Attitude controller: a linear-quadratic regulator of model.h. Its gain is computed when the node is created.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lqr.h"
#include "trefoil.h"

// Weights of w, roll, pitch, yaw, p, q, r and of the four lag states, and of col, lon, lat, ped.
static const double Q[N] = {1e2, 1e3, 1e3, 1e3};
static const double R[M] = {0.4, 300, 85, 300};

// Part of a node from which the next process goes on after a kill or a swap.
typedef struct {
  double lag[M];     // demand that the lagging actuators have reached
  double demand[M];  // last demand
} Memory;

typedef struct {
  double K[M][N];
  Memory memory;
} Controller;

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  Controller *controller = calloc(1, sizeof *controller);
  if (!controller) return NULL;
  const char *reason = NULL;
  if (fabs(setup->dt_s - MODEL_SAMPLE_S) > 1e-9) reason = "model.h is a model of another run.rate_hz";
  if (setup->mass_kg != MODEL_MASS_KG) reason = "model.h is a model of another vehicle";
  if (strcmp(setup->settings_json, "{}")) reason = "this controller has no settings";
  if (lqr(Q, R, controller->K)) reason = "there is no gain for these weights";
  if (!reason) return controller;
  snprintf(error, error_bytes, "%s", reason);
  free(controller);
  return NULL;
}

static int32_t step(void *node, const void *input, void *answer) {
  Controller *controller = node;
  Memory *memory = &controller->memory;
  const TrefoilAttitudeInput *in = input;
  TrefoilAttitudeAnswer *out = answer;
  const double *angles = in->sample.attitude_rad, *rates = in->sample.rates_radps, w = in->sample.velocity_mps[2];
  const double *goal_angles = in->reference.attitude_rad, *goal_rates = in->reference.rates_radps;

  // Without a sample or a reference of this tick there is no answer.
  out->status = in->sample.age_ticks > 0 || in->reference.age_ticks > 0 || isnan(w);
  if (out->status) return 0;

  // The demand of this step acts from the next sample on, so the state is predicted by one sample.
  double x[N] = {w, angles[0] - MODEL_TRIM_ROLL_RAD, angles[1], angles[2], rates[0], rates[1], rates[2]};
  memcpy(&x[N - M], memory->lag, sizeof memory->lag);
  double next[N] = {0};
  for (int i = 0; i < N; i++) {
    for (int j = 0; j < N; j++) next[i] += MODEL_A[i][j] * x[j];
    for (int j = 0; j < M; j++) next[i] += MODEL_B[i][j] * memory->demand[j];
  }
  memcpy(memory->lag, &next[N - M], sizeof memory->lag);

  const double goal[N] = {in->reference.w_mps, goal_angles[0] - MODEL_TRIM_ROLL_RAD, goal_angles[1], goal_angles[2],
                          goal_rates[0], goal_rates[1], goal_rates[2]};
  for (int i = 0; i < N; i++) next[i] -= goal[i];
  next[3] = remainder(next[3], 2 * acos(-1));  // the short way round
  for (int i = 0; i < M; i++) {
    memory->demand[i] = 0;
    for (int j = 0; j < N; j++) memory->demand[i] -= controller->K[i][j] * next[j];
  }
  memcpy(out->demand, memory->demand, sizeof out->demand);
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
    create,      step,                         snapshot,                      restore,        free,
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "attitude-mpc") ? NULL : &NODE; }
