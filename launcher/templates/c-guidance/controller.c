// Position controller: PID with feed-forward along straight legs between waypoints.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "trefoil.h"

enum { MOST_WAYPOINTS = 100 };

// Gains on the errors of position [m], of its integral [m s] and of velocity [m/s]: ANGLE gives the angles [rad], CLIMB
// the vertical speed [m/s].
static const double ANGLE[3] = {0.2, 0.02, 0.2}, CLIMB[3] = {2.0, 0.1, 0.0};
static const double ANGLE_LIMIT_RAD = 0.5, CLIMB_LIMIT_MPS = 4.0, INTEGRAL_LIMIT = 2.0;

typedef struct {
  double dt_s, g_mps2, trim_roll_rad, leg_s;
  double waypoints_m[MOST_WAYPOINTS][3];
  int waypoints;
  double integral[3];  // memory [m s]
} Controller;

static double clamp(double value, double limit) { return fmax(-limit, fmin(limit, value)); }

// Returns the text behind `"key":` in a JSON object, or NULL.
static const char *value_of(const char *json, const char *key) {
  const char *found = strstr(json, key);
  return found ? strchr(found, ':') + 1 : NULL;
}

// Reads `[[x, y, z], ...]`; returns the number of waypoints.
static int read_waypoints(const char *text, double waypoints_m[][3]) {
  for (int count = 0; count < 3 * MOST_WAYPOINTS; count++) {
    char *end;
    text += strspn(text, "[], \n");
    waypoints_m[count / 3][count % 3] = strtod(text, &end);
    if (end == text) return count / 3;
    text = end;
  }
  return MOST_WAYPOINTS;
}

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  Controller *controller = calloc(1, sizeof *controller);
  if (!controller) return NULL;
  const char *leg = value_of(setup->settings_json, "\"leg_s\"");
  const char *all = value_of(setup->settings_json, "\"waypoints_m\"");
  controller->dt_s = setup->dt_s;
  controller->g_mps2 = setup->g_mps2;
  controller->trim_roll_rad = setup->trim_roll_rad;
  controller->leg_s = leg ? atof(leg) : 0;
  controller->waypoints = all ? read_waypoints(all, controller->waypoints_m) : 0;
  if (controller->leg_s > 0 && controller->waypoints > 0) return controller;
  snprintf(error, error_bytes, "give settings.leg_s and settings.waypoints_m, for instance [[0, 0, 0], [0, 0, -4]]");
  free(controller);
  return NULL;
}

// Writes position, velocity and acceleration of one axis at `time_s`: legs of least jerk, at rest at every waypoint.
static void course(const Controller *controller, double time_s, int axis, double out[3]) {
  int leg = (int)fmin(time_s / controller->leg_s, controller->waypoints - 1);
  int next = leg + 1 < controller->waypoints ? leg + 1 : leg;
  double from = controller->waypoints_m[leg][axis], way = controller->waypoints_m[next][axis] - from;
  double T = controller->leg_s, s = fmin(time_s / T - leg, 1);
  out[0] = from + way * s * s * s * (10 - 15 * s + 6 * s * s);
  out[1] = way * 30 * s * s * (1 - s) * (1 - s) / T;
  out[2] = way * 60 * s * (1 - s) * (1 - 2 * s) / (T * T);
}

// Rotates a vector from the body frame to the world frame, NED.
static void to_world(const double angles[3], const double body[3], double world[3]) {
  double sr = sin(angles[0]), cr = cos(angles[0]), sp = sin(angles[1]), cp = cos(angles[1]);
  double sy = sin(angles[2]), cy = cos(angles[2]);
  double ahead = cp * body[0] + sr * sp * body[1] + cr * sp * body[2], right = cr * body[1] - sr * body[2];
  world[0] = cy * ahead - sy * right;
  world[1] = sy * ahead + cy * right;
  world[2] = -sp * body[0] + sr * cp * body[1] + cr * cp * body[2];
}

static int32_t step(void *node, const void *input, void *answer) {
  Controller *controller = node;
  const TrefoilGuidanceInput *in = input;
  const TrefoilSample *sample = &in->sample;
  TrefoilGuidanceAnswer *out = memset(answer, 0, sizeof *out);
  double acceleration[3], error[3], rate[3], velocity[3];
  to_world(sample->attitude_rad, sample->velocity_mps, velocity);
  for (int i = 0; i < 3; i++) {
    double at[3];
    course(controller, in->time_s, i, at);
    out->position_m[i] = at[0];
    out->velocity_mps[i] = at[1];
    acceleration[i] = at[2];
    error[i] = at[0] - sample->position_m[i];
    rate[i] = at[1] - velocity[i];
  }
  out->attitude_rad[0] = controller->trim_roll_rad;
  if (sample->age_ticks > 0 || isnan(error[0]) || isnan(rate[0])) return 0;  // level, no vertical speed

  double wanted[3];
  for (int i = 0; i < 3; i++) {
    const double *gain = i < 2 ? ANGLE : CLIMB;
    double *integral = &controller->integral[i];
    *integral = clamp(*integral + error[i] * controller->dt_s, INTEGRAL_LIMIT);
    wanted[i] = gain[0] * error[i] + gain[1] * *integral + gain[2] * rate[i];
  }
  // Heading 0: north is ahead, east is right.
  out->attitude_rad[0] += clamp(wanted[1] + acceleration[1] / controller->g_mps2, ANGLE_LIMIT_RAD);
  out->attitude_rad[1] = -clamp(wanted[0] + acceleration[0] / controller->g_mps2, ANGLE_LIMIT_RAD);
  double climb = clamp(wanted[2] + out->velocity_mps[2], CLIMB_LIMIT_MPS);
  // The body velocity w at which the vertical speed is `climb`.
  const double *v = sample->velocity_mps, *angles = sample->attitude_rad;
  double level = fmax(cos(angles[0]) * cos(angles[1]), 0.1);
  out->w_mps = (climb + v[0] * sin(angles[1]) - v[1] * sin(angles[0]) * cos(angles[1])) / level;
  return 0;
}

static void snapshot(const void *node, void *memory) {
  memcpy(memory, ((const Controller *)node)->integral, sizeof(double[3]));
}

static int32_t restore(void *node, const void *memory) {
  memcpy(((Controller *)node)->integral, memory, sizeof(double[3]));
  return 0;
}

static const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilGuidanceInput), sizeof(TrefoilGuidanceAnswer), sizeof(double[3]),
    create,      step,                         snapshot,                      restore,           free,
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "guidance") ? NULL : &NODE; }
