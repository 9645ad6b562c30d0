// Attitude controller for tests in the form of a function that CasADi generates: one PD law per axis, whose answers are
// filtered by its memory. TRAP names what is wrong with its description.

#include <stddef.h>

#define UNKNOWN_NAME 1
#define SPARSE 2
#define WRONG_SHAPE 3
#define INT_32 4
#define NO_Z_NEXT 5
#define FAILS 6
#ifndef TRAP
#define TRAP 0
#endif

static const char *INPUTS[] = {"attitude", "rates", "velocity", TRAP == UNKNOWN_NAME ? "speed" : "attitude_ref",
                               "rates_ref", "w_ref", "tick", "p", "z"};
static const char *OUTPUTS[] = {"demand", "status", TRAP == NO_Z_NEXT ? "status" : "z_next"};
static const long long COUNT_IN[] = {3, 3, 3, TRAP == WRONG_SHAPE ? 2 : 3, 3, 1, 1, 4, 4};
static const long long COUNT_OUT[] = {4, 1, TRAP == NO_Z_NEXT ? 1 : 4};

long long law_n_in(void) { return 9; }
long long law_n_out(void) { return 3; }
const char *law_name_in(long long i) { return INPUTS[i]; }
const char *law_name_out(long long i) { return OUTPUTS[i]; }
int law_casadi_int_size(void) { return TRAP == INT_32 ? 4 : 8; }

static const long long *dense(long long rows) {
  static long long patterns[5][3];
  long long *pattern = patterns[rows];
  pattern[0] = rows, pattern[1] = 1, pattern[2] = 1;
  return pattern;
}

const long long *law_sparsity_in(long long i) {
  static const long long half[] = {3, 1, 0, 2, 0, 2};
  return TRAP == SPARSE && i == 0 ? half : dense(COUNT_IN[i]);
}
const long long *law_sparsity_out(long long i) { return dense(COUNT_OUT[i]); }

int law_work(long long *arg, long long *res, long long *iw, long long *w) {
  *arg = 9, *res = 3, *iw = 0, *w = 4;
  return 0;
}

int law(const double **arg, double **res, long long *iw, double *w, int mem) {
  (void)iw, (void)mem;
  static const int AXIS[4] = {0, 1, 0, 2};
  const double *p = arg[7], *z = arg[8];
  if (TRAP == FAILS && arg[6][0] == 100) return 3;
  w[0] = p[0] * 4.0 * (arg[5][0] - arg[2][2]);
  for (int i = 1; i < 4; i++) {
    int axis = AXIS[i];
    w[i] = p[i] * (36.0 * (arg[3][axis] - arg[0][axis]) + 12.0 * (arg[4][axis] - arg[1][axis]));
  }
  for (int i = 0; i < 4; i++) res[0][i] = 0.9 * w[i] + 0.1 * z[i];
  res[1][0] = 0.0;
  if (TRAP != NO_Z_NEXT)
    for (int i = 0; i < 4; i++) res[2][i] = w[i];
  return 0;
}
