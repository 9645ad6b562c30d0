// Gain of the linear-quadratic regulator: u = -K x minimises the sum of x'Qx + u'Ru for the model of model.h.

#pragma once

#include <math.h>
#include <string.h>

#include "model.h"

enum { N = MODEL_STATES, M = MODEL_INPUTS };

// Solves S X = Y and leaves X in Y; S is symmetric and positive definite.
static inline void solve(double S[M][M], double Y[M][N]) {
  for (int i = 0; i < M; i++) {
    for (int row = 0; row < M; row++) {
      double factor = S[row][i] / S[i][i];
      if (row == i) continue;
      for (int k = 0; k < M; k++) S[row][k] -= factor * S[i][k];
      for (int k = 0; k < N; k++) Y[row][k] -= factor * Y[i][k];
    }
  }
  for (int i = 0; i < M; i++)
    for (int k = 0; k < N; k++) Y[i][k] /= S[i][i];
}

// One step of the Riccati iteration: K = (R + B'PB)^-1 B'PA, then P = Q + A'P(A - BK). Returns the change of P.
static inline double riccati_step(const double q[N], const double r[M], double P[N][N], double K[M][N]) {
  double S[M][M], PB[N][M], closed[N][N], next[N][N], change = 0;
  for (int i = 0; i < N; i++)
    for (int j = 0; j < M; j++) {
      PB[i][j] = 0;
      for (int k = 0; k < N; k++) PB[i][j] += P[i][k] * MODEL_B[k][j];
    }
  for (int i = 0; i < M; i++) {
    for (int j = 0; j < M; j++) {
      S[i][j] = i == j ? r[i] : 0;
      for (int k = 0; k < N; k++) S[i][j] += MODEL_B[k][i] * PB[k][j];
    }
    for (int j = 0; j < N; j++) {
      K[i][j] = 0;
      for (int k = 0; k < N; k++) K[i][j] += PB[k][i] * MODEL_A[k][j];
    }
  }
  solve(S, K);
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      closed[i][j] = MODEL_A[i][j];
      for (int k = 0; k < M; k++) closed[i][j] -= MODEL_B[i][k] * K[k][j];
    }
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      next[i][j] = i == j ? q[i] : 0;
      for (int k = 0; k < N; k++)
        for (int l = 0; l < N; l++) next[i][j] += MODEL_A[k][i] * P[k][l] * closed[l][j];
      change = fmax(change, fabs(next[i][j] - P[i][j]));
    }
  memcpy(P, next, sizeof next);
  return change;
}

// Computes K for the weights on the diagonals of Q and R. Returns 0, or -1 if the iteration does not converge.
static inline int lqr(const double q[N], const double r[M], double K[M][N]) {
  double P[N][N] = {{0}};
  for (int i = 0; i < N; i++) P[i][i] = q[i];
  for (int i = 0; i < 5000; i++)
    if (riccati_step(q, r, P, K) < 1e-9 * P[0][0]) return 0;
  return -1;
}
