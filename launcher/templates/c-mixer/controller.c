// Mixer: the inverse of the mixing matrix, and the actuators' limits.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"
#include "trefoil.h"

// Age of a demand beyond which it is ignored, and the rotors turn as in hover [s].
static const double LOST_S = 0.1;

typedef struct {
  TrefoilSetup vehicle;
  double trim[4];  // (O1^2 sin tilt, O1^2 cos tilt, O2^2, O3^2) of the rotor speeds O in hover
} Controller;

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  const double *speed = setup->trim_rotor_speed;
  Controller *controller = calloc(1, sizeof *controller);
  if (!controller) return NULL;
  const char *reason = NULL;
  if (setup->mass_kg != MODEL_MASS_KG) reason = "model.h has the limits of another vehicle";
  if (strcmp(setup->settings_json, "{}")) reason = "this mixer has no settings";
  if (reason) {
    snprintf(error, error_bytes, "%s", reason);
    free(controller);
    return NULL;
  }
  controller->vehicle = *setup;
  controller->trim[0] = speed[0] * speed[0] * sin(setup->trim_tilt_rad);
  controller->trim[1] = speed[0] * speed[0] * cos(setup->trim_tilt_rad);
  controller->trim[2] = speed[1] * speed[1];
  controller->trim[3] = speed[2] * speed[2];
  return controller;
}

static double clamp(double value, double low, double high) { return fmax(low, fmin(high, value)); }

// Writes (O1^2 sin tilt, O1^2 cos tilt, O2^2, O3^2) that produce the deviations col, lon, lat, ped from hover.
static void invert(const Controller *controller, const double demand[4], double u[4]) {
  const TrefoilSetup *v = &controller->vehicle;
  double l1 = v->arms_m[0], l2 = v->arms_m[1], l3 = v->arms_m[2], kf = v->kf, km = v->km;
  double all = -demand[0] / kf;
  u[1] = (demand[1] / kf + l2 * all) / (l1 + l2);
  double back = all - u[1], difference = -demand[2] / (l3 * kf);
  u[2] = (back + difference) / 2;
  u[3] = (back - difference) / 2;
  u[0] = (demand[3] + km * (u[1] - u[2] + u[3])) / (l1 * kf);
  for (int i = 0; i < 4; i++) u[i] += controller->trim[i];
}

static int32_t step(void *node, const void *input, void *answer) {
  const Controller *controller = node;
  const TrefoilMixerInput *in = input;
  TrefoilMixerAnswer *out = answer;
  int is_lost = in->demand.age_ticks > LOST_S / controller->vehicle.dt_s;
  static const double NONE[4] = {0};
  double u[4];
  invert(controller, is_lost ? NONE : in->demand.demand, u);
  double square[3] = {hypot(u[0], u[1]), u[2], u[3]};
  for (int i = 0; i < 3; i++)
    out->rotor_speed[i] = clamp(sqrt(fmax(square[i], 0)), MODEL_ROTOR_SPEED_MIN, MODEL_ROTOR_SPEED_MAX[i]);
  out->tilt_rad = clamp(atan2(u[0], u[1]), -MODEL_TILT_MAX_RAD, MODEL_TILT_MAX_RAD);
  return 0;
}

// The mixer has no memory: the next process needs none to go on.
static const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilMixerInput), sizeof(TrefoilMixerAnswer), 0, create, step, NULL, NULL, free,
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "mixer") ? NULL : &NODE; }
