/*
 * Stand-in for the code that Simulink Coder generates for a model with the name `controller`, in its documented form
 * (code interface packaging "Nonreusable function"). Put the generated files in the place of rtwtypes.h, controller.h
 * and controller.c; shim.c stays.
 */
#ifndef CONTROLLER_H
#define CONTROLLER_H
#include "rtwtypes.h"

/* Block states (default storage) */
typedef struct {
  real_T Lag_DSTATE[4];
  real_T Demand_DSTATE[4];
} DW_controller_T;

/* External inputs (root inport signals with default storage) */
typedef struct {
  real_T w;
  real_T attitude[3];
  real_T rates[3];
  real_T w_ref;
  real_T attitude_ref[3];
  real_T rates_ref[3];
} ExtU_controller_T;

/* External outputs (root outports fed by signals with default storage) */
typedef struct {
  real_T demand[4];
} ExtY_controller_T;

/* Parameters (default storage) */
typedef struct {
  real_T K_Gain[44]; /* 4 x 11, by columns */
} P_controller_T;

/* Real-time model data structure */
typedef struct {
  const char_T *errorStatus;
} RT_MODEL_controller_T;

#define rtmGetErrorStatus(rtm) ((rtm)->errorStatus)

extern P_controller_T controller_P;
extern DW_controller_T controller_DW;
extern ExtU_controller_T controller_U;
extern ExtY_controller_T controller_Y;
extern RT_MODEL_controller_T *const controller_M;

extern void controller_initialize(void);
extern void controller_step(void);
extern void controller_terminate(void);
#endif
