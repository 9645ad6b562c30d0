// Guidance and attitude controller for tests, whose gain comes from a library beside it. Built with GAIN, this file is
// that library.

#ifdef GAIN

double dependency_gain(void) { return GAIN; }

#else

#include <math.h>
#include <string.h>

#include "trefoil.h"

double dependency_gain(void);

static TrefoilSetup vehicle;

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  (void)error, (void)error_bytes;
  vehicle = *setup;
  return &vehicle;
}

static void destroy(void *node) { (void)node; }

// Holds the position of the start; the gain of the library acts on the altitude error.
static int32_t guide(void *node, const void *input, void *answer) {
  const TrefoilSetup *setup = node;
  const TrefoilGuidanceInput *in = input;
  TrefoilGuidanceAnswer *out = answer;
  memset(out, 0, sizeof *out);
  memcpy(out->position_m, setup->start_position_m, sizeof out->position_m);
  out->attitude_rad[0] = setup->trim_roll_rad;
  double error_m = setup->start_position_m[2] - in->sample.position_m[2];
  out->w_mps = isfinite(error_m) ? dependency_gain() * error_m : 0;
  return 0;
}

static int32_t control(void *node, const void *input, void *answer) {
  const TrefoilSetup *setup = node;
  const TrefoilAttitudeInput *in = input;
  TrefoilAttitudeAnswer *out = answer;
  static const int AXIS[4] = {0, 1, 0, 2};
  out->demand[0] = setup->mass_kg * 4.0 * (in->reference.w_mps - in->sample.velocity_mps[2]);
  for (int i = 1; i < 4; i++) {
    double error_rad = in->reference.attitude_rad[AXIS[i]] - in->sample.attitude_rad[AXIS[i]];
    double error_radps = in->reference.rates_radps[AXIS[i]] - in->sample.rates_radps[AXIS[i]];
    out->demand[i] = dependency_gain() * setup->inertia_kgm2[AXIS[i]] * (36.0 * error_rad + 12.0 * error_radps);
  }
  out->status = 0;
  return 0;
}

const TrefoilNode *trefoil_node_v1(const char *node) {
  static const TrefoilNode guidance = {
      TREFOIL_ABI, sizeof(TrefoilGuidanceInput), sizeof(TrefoilGuidanceAnswer), 0, create, guide, NULL, NULL, destroy,
  };
  static const TrefoilNode attitude = {
      TREFOIL_ABI, sizeof(TrefoilAttitudeInput), sizeof(TrefoilAttitudeAnswer), 0, create, control, NULL, NULL, destroy,
  };
  return !strcmp(node, "guidance") ? &guidance : !strcmp(node, "attitude-mpc") ? &attitude : NULL;
}

#endif
