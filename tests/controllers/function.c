// Attitude controller for tests in the form of a function that CasADi generates: one PD law per axis, whose answers are
// filtered by its memory. TRAP names what is wrong with its description.

#include <stddef.h>

#define UNKNOWN_NAME 1
#define SPARSE 2
#define WRONG_SHAPE 3
#define INT_32 4
#define NO_Z_NEXT 5
#define FAILS 6
#define NEGATIVE_INPUTS 7
#define NEGATIVE_OUTPUTS 8
#define NEGATIVE_SHAPE 9
#define LYING_PREVIEW 10 // 8 x 4: as many numbers as 4 x 8, in another order
#define SQUARE_VECTOR 11
#define SQUARE_MEMORY 12
#define TWICE 13
#define WRONG_ROWS 14
#define LYING_VECTORS 15 // accepted: vectors as rows
#define FULL_PATTERN 16  // accepted: offsets and rows instead of the mark for dense
#ifndef TRAP
#define TRAP 0
#endif

static const char *INPUTS[] = {"attitude", "rates", "velocity", TRAP == UNKNOWN_NAME ? "speed" : "attitude_ref",
                               TRAP == TWICE ? "attitude" : "rates_ref", "w_ref", "tick", "p", "z", "preview"};
static const char *OUTPUTS[] = {"demand", "status", "z_next"};
static const long long COUNT_IN[] = {3, 3, 3, TRAP == WRONG_SHAPE ? 2 : 3, 3, 1, 1, 4, 4};
static const long long COUNT_OUT[] = {4, 1, 4};

long long law_n_in(void) { return TRAP == NEGATIVE_INPUTS ? -1 : 10; }
long long law_n_out(void) { return TRAP == NEGATIVE_OUTPUTS ? -1 : TRAP == NO_Z_NEXT ? 2 : 3; }
const char *law_name_in(long long i) { return INPUTS[i]; }
const char *law_name_out(long long i) { return OUTPUTS[i]; }
int law_casadi_int_size(void) { return TRAP == INT_32 ? 4 : 8; }

// Writes the pattern of a dense matrix to `pattern`, and returns it.
static const long long *dense(long long *pattern, long long rows, long long columns) {
  pattern[0] = rows, pattern[1] = columns, pattern[2] = 1;
  if (TRAP == LYING_VECTORS && columns == 1) pattern[0] = 1, pattern[1] = rows;
  if (TRAP != FULL_PATTERN && TRAP != WRONG_ROWS) return pattern;
  for (long long column = 0; column <= columns; column++) pattern[2 + column] = column * rows;
  for (long long i = 0; i < rows * columns; i++) pattern[3 + columns + i] = TRAP == WRONG_ROWS ? 0 : i % rows;
  return pattern;
}

const long long *law_sparsity_in(long long i) {
  static const long long half[] = {3, 1, 0, 2, 0, 2}, negative[] = {-3, -1, 1};
  static long long patterns[10][64];
  if (TRAP == SPARSE && i == 0) return half;
  if (TRAP == NEGATIVE_SHAPE && i == 0) return negative;
  if (TRAP == SQUARE_MEMORY && i == 8) return dense(patterns[8], 2, 2);
  if (i == 9) return TRAP == LYING_PREVIEW ? dense(patterns[9], 8, 4) : dense(patterns[9], 4, 8);
  return dense(patterns[i], COUNT_IN[i], 1);
}
const long long *law_sparsity_out(long long i) {
  static long long patterns[3][16];
  return TRAP == SQUARE_VECTOR && i == 0 ? dense(patterns[0], 2, 2) : dense(patterns[i], COUNT_OUT[i], 1);
}

int law_work(long long *arg, long long *res, long long *iw, long long *w) {
  *arg = 10, *res = 3, *iw = 0, *w = 4;
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

#ifdef JACOBIAN
// Function beside the law, as CasADi generates it from `law.jacobian()`: its names end in those of the law's functions.
long long jac_law_n_in(void) { return 0; }
int jac_law(const double **arg, double **res, long long *iw, double *w, int mem) {
  (void)arg, (void)res, (void)iw, (void)w, (void)mem;
  return 1;
}
#endif
