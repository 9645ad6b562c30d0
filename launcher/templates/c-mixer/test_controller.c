// Checks that the command produces the demand by the mixing matrix of model.h, and keeps the limits.

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model.h"
#include "trefoil.h"

// Writes col, lon, lat, ped that a command produces.
static void produced(const TrefoilMixerAnswer *command, double out[4]) {
  const double *speed = command->rotor_speed;
  double u[4] = {speed[0] * speed[0] * sin(command->tilt_rad), speed[0] * speed[0] * cos(command->tilt_rad),
                 speed[1] * speed[1], speed[2] * speed[2]};
  for (int i = 0; i < 4; i++) {
    out[i] = 0;
    for (int j = 0; j < 4; j++) out[i] += MODEL_MIXING[i][j] * u[j];
  }
}

int main(void) {
  const TrefoilNode *node = trefoil_node_v1("mixer");
  TrefoilSetup setup = {.settings_json = "{}", .dt_s = MODEL_SAMPLE_S, .mass_kg = MODEL_MASS_KG};
  setup.kf = MODEL_KF;
  setup.km = MODEL_KM;
  memcpy(setup.arms_m, MODEL_ARMS_M, sizeof setup.arms_m);
  memcpy(setup.trim_rotor_speed, MODEL_TRIM_ROTOR_SPEED, sizeof setup.trim_rotor_speed);
  setup.trim_tilt_rad = MODEL_TRIM_TILT_RAD;
  char error[200] = "";
  void *mixer = node->create(&setup, error, sizeof error);
  if (!mixer) return fprintf(stderr, "create: %s\n", error), 1;

  TrefoilMixerInput in = {.demand = {.demand = {0}}};
  TrefoilMixerAnswer hover, moved, huge;
  double before[4], after[4], demand[4] = {-1.0, 0.05, -0.04, 0.02};
  node->step(mixer, &in, &hover);
  memcpy(in.demand.demand, demand, sizeof demand);
  node->step(mixer, &in, &moved);
  produced(&hover, before);
  produced(&moved, after);
  for (int i = 0; i < 4; i++)
    if (fabs(after[i] - before[i] - demand[i]) > 1e-9) return fprintf(stderr, "demand %d is not produced\n", i), 1;
  in.demand.demand[0] = -1e9;
  node->step(mixer, &in, &huge);
  node->destroy(mixer);
  for (int i = 0; i < 3; i++)
    if (huge.rotor_speed[i] > MODEL_ROTOR_SPEED_MAX[i]) return fprintf(stderr, "rotor %d is above its limit\n", i), 1;
  printf("produces the demand\n");
  return 0;
}
