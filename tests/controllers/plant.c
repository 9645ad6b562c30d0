// Vehicle for tests: a rigid body whose actuators follow at once. TRAP names what goes wrong in it.

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "trefoil.h"

// Traps.
#define EXIT_IN_CREATE 1
#define EXIT_AT_START 2
#define HANG_IN_FIRST_PERIOD 3
#define WRONG_SIZE 4
#define FAIL_IN_STEP 5
#define CRASH_IN_STEP 6
#define NAN_IN_STEP 7
#define ROUNDING_IN_STEP 8
#define EXIT_IN_STEP 9
#ifndef TRAP
#define TRAP 0
#endif
#define TRAP_TICK 100
// Longest integration step [s].
#define STEP_S 1e-3

typedef struct {
  TrefoilSetup vehicle;
  double drag_nspm;
  // Position, velocity, Euler angles, rates.
  double x[12];
} Vehicle;

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  if (TRAP == EXIT_IN_CREATE) exit(0);
  Vehicle *vehicle = calloc(1, sizeof *vehicle);
  vehicle->vehicle = *setup;
  const char *drag = strstr(setup->settings_json, "\"drag_nspm\":");
  if (drag) vehicle->drag_nspm = atof(drag + 12);
  if (vehicle->drag_nspm < 0.0) {
    snprintf(error, error_bytes, "a drag below 0");
    free(vehicle);
    return NULL;
  }
  memcpy(vehicle->x, setup->start_position_m, 12 * sizeof(double));
  return vehicle;
}

// Writes the rate of change of `x` with these rotor speeds and this tilt, equations (7)-(22) of the paper.
static void derivative(const Vehicle *vehicle, const double *x, const double *speed, double tilt, double *dx) {
  const TrefoilSetup *v = &vehicle->vehicle;
  const double *arm = v->arms_m, *inertia = v->inertia_kgm2, *u = x + 3, *w = x + 9;
  double f[3], m[3];
  for (int i = 0; i < 3; i++) f[i] = v->kf * speed[i] * speed[i], m[i] = v->km * speed[i] * speed[i];
  double st = sin(tilt), ct = cos(tilt);
  double force[3] = {0.0, f[0] * st, -(f[0] * ct + f[1] + f[2])};
  double moment[3] = {-arm[2] * (f[1] - f[2]), -arm[1] * (f[1] + f[2]) + arm[0] * f[0] * ct,
                      arm[0] * f[0] * st - m[0] * ct + m[1] - m[2]};
  double sr = sin(x[6]), cr = cos(x[6]), sp = sin(x[7]), cp = cos(x[7]), sy = sin(x[8]), cy = cos(x[8]);
  double gravity[3] = {-sp, sr * cp, cr * cp};
  double r[3][3] = {{cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy},
                    {cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy},
                    {-sp, sr * cp, cr * cp}};
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    dx[i] = r[i][0] * u[0] + r[i][1] * u[1] + r[i][2] * u[2];
    dx[3 + i] = u[j] * w[k] - u[k] * w[j] + v->g_mps2 * gravity[i] + (force[i] - vehicle->drag_nspm * u[i]) / v->mass_kg;
    dx[9 + i] = (moment[i] + (inertia[j] - inertia[k]) * w[j] * w[k]) / inertia[i];
  }
  dx[6] = w[0] + (w[1] * sr + w[2] * cr) * sp / cp;
  dx[7] = w[1] * cr - w[2] * sr;
  dx[8] = (w[1] * sr + w[2] * cr) / cp;
}

// Integrates over `dt_s` by the midpoint rule.
static void move(Vehicle *vehicle, const double *speed, double tilt, double dt_s) {
  double dx[12], middle[12];
  derivative(vehicle, vehicle->x, speed, tilt, dx);
  for (int i = 0; i < 12; i++) middle[i] = vehicle->x[i] + 0.5 * dt_s * dx[i];
  derivative(vehicle, middle, speed, tilt, dx);
  for (int i = 0; i < 12; i++) vehicle->x[i] += dt_s * dx[i];
}

static int32_t step(void *node, const void *input, void *answer) {
  Vehicle *vehicle = node;
  const TrefoilPlantInput *in = input;
  TrefoilPlantAnswer *out = answer;
  if (TRAP == EXIT_AT_START && in->advance_s == 0.0) exit(0);
  while (TRAP == HANG_IN_FIRST_PERIOD && in->advance_s > 0.0) sleep(1);
  int steps = (int)ceil(in->advance_s / STEP_S);
  for (int i = 0; i < steps; i++) move(vehicle, in->rotor_speed, in->tilt_rad, in->advance_s / steps);
  memcpy(out->position_m, vehicle->x, 12 * sizeof(double)); // the actuators are where the command wants them
  if (in->tick == TRAP_TICK) {
    if (TRAP == FAIL_IN_STEP) return 7;
    if (TRAP == CRASH_IN_STEP) abort();
    if (TRAP == EXIT_IN_STEP) exit(0);
    if (TRAP == NAN_IN_STEP) out->rates_radps[1] = NAN;
#if TRAP == ROUNDING_IN_STEP
    __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8000);
#endif
  }
  return 0;
}

#ifndef COLD
static void snapshot(const void *node, void *memory) { memcpy(memory, ((const Vehicle *)node)->x, sizeof(double[12])); }

static int32_t restore(void *node, const void *memory) {
  memcpy(((Vehicle *)node)->x, memory, sizeof(double[12]));
  return 0;
}
#endif

static const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilPlantInput) - (TRAP == WRONG_SIZE ? 8 : 0), sizeof(TrefoilPlantAnswer),
#ifdef COLD
    0, create, step, NULL, NULL, free,
#else
    sizeof(double[12]), create, step, snapshot, restore, free,
#endif
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "plant") ? NULL : &NODE; }

#ifdef OWN_MAIN
#include "trefoil_process.h"

int main(int argc, char **argv) {
  char error[1024] = "";
  int32_t result = trefoil_plant_run(&NODE, argc, (const char *const *)argv, error, sizeof error);
  if (result < 0) fprintf(stderr, "%s\n", error);
  return -result;
}
#endif
