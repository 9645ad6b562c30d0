/* Stand-in for generated code: a linear-quadratic regulator of model.h. See controller.h. */
#include "controller.h"

#include <math.h>
#include <string.h>

#include "model.h"

P_controller_T controller_P;
DW_controller_T controller_DW;
ExtU_controller_T controller_U;
ExtY_controller_T controller_Y;
static RT_MODEL_controller_T controller_M_;
RT_MODEL_controller_T *const controller_M = &controller_M_;

void controller_initialize(void) {
  memset(&controller_DW, 0, sizeof controller_DW);
  memset(&controller_U, 0, sizeof controller_U);
  memset(&controller_Y, 0, sizeof controller_Y);
  controller_M->errorStatus = NULL;
}

void controller_step(void) {
  /* The demand of this step acts from the next sample on, so the state is predicted by one sample. */
  const real_T *angles = controller_U.attitude, *rates = controller_U.rates;
  real_T x[11] = {controller_U.w, angles[0] - MODEL_TRIM_ROLL_RAD, angles[1], angles[2], rates[0], rates[1], rates[2]};
  real_T e[11] = {0};
  memcpy(&x[7], controller_DW.Lag_DSTATE, sizeof controller_DW.Lag_DSTATE);
  for (int i = 0; i < 11; i++) {
    for (int j = 0; j < 11; j++) e[i] += MODEL_A[i][j] * x[j];
    for (int j = 0; j < 4; j++) e[i] += MODEL_B[i][j] * controller_DW.Demand_DSTATE[j];
  }
  memcpy(controller_DW.Lag_DSTATE, &e[7], sizeof controller_DW.Lag_DSTATE);

  e[0] -= controller_U.w_ref;
  for (int i = 0; i < 3; i++) {
    e[1 + i] -= controller_U.attitude_ref[i] - (i == 0 ? MODEL_TRIM_ROLL_RAD : 0);
    e[4 + i] -= controller_U.rates_ref[i];
  }
  e[3] = remainder(e[3], 2 * acos(-1));
  for (int i = 0; i < 4; i++) {
    controller_Y.demand[i] = 0;
    for (int j = 0; j < 11; j++) controller_Y.demand[i] -= controller_P.K_Gain[i + 4 * j] * e[j];
  }
  memcpy(controller_DW.Demand_DSTATE, controller_Y.demand, sizeof controller_Y.demand);
}

void controller_terminate(void) {}
