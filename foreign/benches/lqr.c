// State feedback as an attitude controller, for the benchmark of the boundary: with the function table of trefoil.h, or,
// with -DCASADI, in the form of a function that CasADi generates.

#include <stddef.h>
#include <string.h>

#include "trefoil.h"

// Gain on the deviations of w, attitude and rates from their references; `boundary.rs` has the same numbers.
static double gain(int row, int column) { return (double)(1 + row) / (double)(2 + column); }

static void feedback(const double *x, double *demand) {
  for (int row = 0; row < 4; row++) {
    demand[row] = 0.0;
    for (int column = 0; column < 7; column++) demand[row] -= gain(row, column) * x[column];
  }
}

static void deviation(double w, double w_ref, const double *attitude, const double *attitude_ref, const double *rates,
                      const double *rates_ref, double *x) {
  x[0] = w - w_ref;
  for (int i = 0; i < 3; i++) x[1 + i] = attitude[i] - attitude_ref[i];
  for (int i = 0; i < 3; i++) x[4 + i] = rates[i] - rates_ref[i];
}

#ifdef CASADI

static const char *INPUTS[] = {"velocity", "w_ref", "attitude", "attitude_ref", "rates", "rates_ref"};
static const long long DENSE[2][3] = {{3, 1, 1}, {1, 1, 1}}, DEMAND[] = {4, 1, 1};

long long law_n_in(void) { return 6; }
long long law_n_out(void) { return 1; }
const char *law_name_in(long long i) { return INPUTS[i]; }
const char *law_name_out(long long i) { return i == 0 ? "demand" : NULL; }
const long long *law_sparsity_in(long long i) { return DENSE[i == 1]; }
const long long *law_sparsity_out(long long i) { return i == 0 ? DEMAND : NULL; }

int law_work(long long *arg, long long *res, long long *iw, long long *w) {
  *arg = 6, *res = 1, *iw = 0, *w = 7;
  return 0;
}

int law(const double **arg, double **res, long long *iw, double *w, int mem) {
  (void)iw, (void)mem;
  deviation(arg[0][2], arg[1][0], arg[2], arg[3], arg[4], arg[5], w);
  feedback(w, res[0]);
  return 0;
}

#else

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  (void)setup, (void)error, (void)error_bytes;
  static char node;
  return &node;
}

static int32_t step(void *node, const void *input, void *answer) {
  (void)node;
  const TrefoilAttitudeInput *in = input;
  TrefoilAttitudeAnswer *out = answer;
  double x[7];
  deviation(in->sample.velocity_mps[2], in->reference.w_mps, in->sample.attitude_rad, in->reference.attitude_rad,
            in->sample.rates_radps, in->reference.rates_radps, x);
  feedback(x, out->demand);
  out->status = 0;
  return 0;
}

static void destroy(void *node) { (void)node; }

static const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilAttitudeInput), sizeof(TrefoilAttitudeAnswer), 0, create, step, NULL, NULL, destroy,
};

const TrefoilNode *trefoil_node_v1(const char *node) { return strcmp(node, "attitude-mpc") ? NULL : &NODE; }

#endif
