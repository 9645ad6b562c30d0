// Flies the controller on the linear model of model.h: from a tilted start to hover within five seconds.

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model.h"
#include "trefoil.h"

enum { N = MODEL_STATES, M = MODEL_INPUTS };

static TrefoilAttitudeInput input_of(uint64_t tick, const double x[N]) {
  TrefoilAttitudeInput in = {0};
  in.tick = tick;
  in.time_s = tick * MODEL_SAMPLE_S;
  in.sample.velocity_mps[2] = x[0];
  for (int i = 0; i < 3; i++) {
    in.sample.attitude_rad[i] = x[1 + i];
    in.sample.rates_radps[i] = x[4 + i];
    in.sample.rotor_speed[i] = MODEL_TRIM_ROTOR_SPEED[i];
  }
  in.sample.tilt_rad = MODEL_TRIM_TILT_RAD;
  in.sample.attitude_rad[0] += MODEL_TRIM_ROLL_RAD;
  in.reference.attitude_rad[0] = MODEL_TRIM_ROLL_RAD;
  return in;
}

int main(void) {
  const TrefoilNode *node = trefoil_node_v1("attitude-mpc");
  char error[200] = "";
  TrefoilSetup setup = {0};
  setup.settings_json = "{}";
  setup.dt_s = MODEL_SAMPLE_S;
  setup.g_mps2 = MODEL_G_MPS2;
  setup.mass_kg = MODEL_MASS_KG;
  setup.kf = MODEL_KF;
  setup.km = MODEL_KM;
  memcpy(setup.inertia_kgm2, MODEL_INERTIA_KGM2, sizeof setup.inertia_kgm2);
  memcpy(setup.arms_m, MODEL_ARMS_M, sizeof setup.arms_m);
  void *controller = node->create(&setup, error, sizeof error);
  if (!controller) return fprintf(stderr, "create: %s\n", error), 1;

  double x[N] = {0.5, 0.2, -0.1, 0.3};  // w, roll, pitch, yaw
  TrefoilAttitudeAnswer before = {0}, now = {0};
  for (int tick = 0; tick < (int)(5 / MODEL_SAMPLE_S); tick++) {
    TrefoilAttitudeInput in = input_of(tick, x);
    if (node->step(controller, &in, &now) || now.status) return fprintf(stderr, "no answer at tick %d\n", tick), 1;
    double next[N] = {0};
    for (int i = 0; i < N; i++) {
      for (int j = 0; j < N; j++) next[i] += MODEL_A[i][j] * x[j];
      for (int j = 0; j < M; j++) next[i] += MODEL_B[i][j] * before.demand[j];
    }
    memcpy(x, next, sizeof x);
    before = now;
  }
  node->destroy(controller);
  for (int i = 0; i < 7; i++)
    if (!(fabs(x[i]) < 0.01)) return fprintf(stderr, "state %d is %g after 5 s\n", i, x[i]), 1;
  printf("hovers after 5 s\n");
  return 0;
}
