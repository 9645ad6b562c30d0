// Attitude controller for tests: one PD law per axis. TRAP names what goes wrong in it.

#define _GNU_SOURCE
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "trefoil.h"

// Traps.
#define CRASH_IN_CREATE 1
#define CRASH_IN_STEP 2
#define HANG_IN_CREATE 3
#define HANG_IN_STEP 4
#define EXIT_IN_CREATE 5
#define EXIT_IN_STEP 6
#define ROUNDING_IN_STEP 7
#define NAN_IN_STEP 8
#define WRONG_SIZE 9
#define WRONG_ABI 10
#define NO_SUCH_NODE 11
#define CANNOT_CREATE 12
#define FAIL_IN_STEP 13
#define CRASH_WHEN_LOADED 14
#define MARK_WHEN_LOADED 15 // writes the file TREFOIL_MARK
#define REFUSE_MEMORY 16
#define FORK_IN_STEP 17   // both processes return, the copy first
#define DAEMON_IN_STEP 18 // the copy returns, and its parent has ended
#define STRAY_IN_STEP 19  // a copy in a session of its own sleeps for ever
#define LEAVE_VARIABLE 20 // an environment variable makes the next flight in this process fail
#define LEAVE_FOLDER 21   // the working directory makes the next flight in this process fail
#define LEAVE_LIMIT 22    // a resource limit makes the next flight in this process fail
#define LEAVE_MASK 23     // a blocked signal makes the next flight in this process fail
#define ROUNDING_IN_SNAPSHOT 24
#define ROUNDING_IN_RESTORE 25
#define ROUNDING_IN_DESTROY 26
#define NAN_FOR_EVER 27 // NaN in the warm start, which is part of the memory
#define CLEAR_VARIABLES 28
#define CLOSE_STDOUT 29
#define FORK_IN_SNAPSHOT 30
#define OVER_DESCRIPTORS 31 // puts the file TREFOIL_MARK over all descriptors but the first three
#ifndef TRAP
#define TRAP 0
#endif
// Sample at which a trap in `step` takes effect, or the first one behind it that this node gets, if it has had one
// before it: in real time a sample may be skipped. The trial before a flight has no later sample than 0.
#define TRAP_TICK 100
// Share of the flights in which the trap takes effect, chosen by the altitude at that sample.
#ifndef TRAP_SHARE
#define TRAP_SHARE 1
#endif

typedef struct {
  double inertia[4];
  double gain;
  struct {
    uint64_t steps;
    double warm_start;
  } memory;
  uint64_t last_tick;
  int is_left_over;
} Pd;

static void change_rounding(void) {
#ifdef __x86_64__
  __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8000);
#endif
}

// Returns whether this process has what the trap leaves behind; with `leave`, leaves it behind first.
static int left_over(int leave) {
  static const char FOLDER[] = "/";
  static char folder[4096];
  struct rlimit limit;
  sigset_t mask;
  switch (TRAP) {
  case LEAVE_VARIABLE:
    if (leave) setenv("TREFOIL_LEFT_OVER", "1", 1);
    return getenv("TREFOIL_LEFT_OVER") != NULL;
  case LEAVE_FOLDER:
    if (leave && chdir(FOLDER)) abort();
    return getcwd(folder, sizeof folder) && !strcmp(folder, FOLDER);
  case LEAVE_LIMIT:
    getrlimit(RLIMIT_STACK, &limit);
    if (leave) limit.rlim_cur = 1234567;
    if (leave && setrlimit(RLIMIT_STACK, &limit)) abort();
    return limit.rlim_cur == 1234567;
  case LEAVE_MASK:
    sigemptyset(&mask);
    sigaddset(&mask, SIGUSR2);
    sigprocmask(SIG_BLOCK, leave ? &mask : NULL, &mask);
    return sigismember(&mask, SIGUSR2);
  default:
    return 0;
  }
}

static void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  if (TRAP == CRASH_IN_CREATE) abort();
  while (TRAP == HANG_IN_CREATE) sleep(1);
  if (TRAP == EXIT_IN_CREATE) exit(0);
  if (TRAP == CANNOT_CREATE) {
    snprintf(error, error_bytes, "no gain in %s", setup->settings_json);
    return NULL;
  }
  Pd *pd = calloc(1, sizeof *pd);
  const double *inertia = setup->inertia_kgm2;
  *pd = (Pd){{setup->mass_kg, inertia[1], inertia[0], inertia[2]}, 1.0, {0, 0.0}, 0, left_over(0)};
  const char *gain = strstr(setup->settings_json, "\"gain\":");
  if (gain) pd->gain = atof(gain + 7);
  return pd;
}

// Forks: the copy returns at once, and the parent returns when the copy has ended.
static void copy_returns(void) {
  pid_t copy = fork();
  if (copy < 0) abort();
  if (copy) waitpid(copy, NULL, 0);
}

static int32_t step(void *node, const void *input, void *answer) {
  Pd *pd = node;
  const TrefoilAttitudeInput *in = input;
  TrefoilAttitudeAnswer *out = answer;
  static const int AXIS[4] = {0, 1, 0, 2};
  out->demand[0] = pd->inertia[0] * 4.0 * (in->reference.w_mps - in->sample.velocity_mps[2]);
  for (int i = 1; i < 4; i++) {
    double error_rad = in->reference.attitude_rad[AXIS[i]] - in->sample.attitude_rad[AXIS[i]];
    double error_radps = in->reference.rates_radps[AXIS[i]] - in->sample.rates_radps[AXIS[i]];
    out->demand[i] = pd->gain * pd->inertia[i] * (36.0 * error_rad + 12.0 * error_radps);
  }
  pd->memory.steps++;
  if (pd->is_left_over) return 7;
  if (TRAP == NAN_FOR_EVER) out->demand[2] += pd->memory.warm_start;
  int is_due = pd->last_tick > 0 && pd->last_tick < TRAP_TICK && in->tick >= TRAP_TICK;
  pd->last_tick = in->tick;
  if (is_due && fmod(fabs(in->sample.position_m[2]) * 1e6, 1.0) < TRAP_SHARE) {
    if (TRAP == CRASH_IN_STEP) *(volatile int *)pd->memory.steps = 0;
    while (TRAP == HANG_IN_STEP) sleep(1);
    if (TRAP == EXIT_IN_STEP) exit(0);
    if (TRAP == NAN_IN_STEP) out->demand[2] = NAN;
    if (TRAP == FAIL_IN_STEP) return 7;
    if (TRAP == OVER_DESCRIPTORS) {
      int mark = open(getenv("TREFOIL_MARK"), O_RDONLY);
      for (int number = 3; number < 100; number++)
        if (fcntl(number, F_GETFD) >= 0) dup2(mark, number);
    }
    if (TRAP == ROUNDING_IN_STEP) change_rounding();
    if (TRAP == FORK_IN_STEP) copy_returns();
    if (TRAP == DAEMON_IN_STEP && daemon(1, 1)) abort();
    if (TRAP == STRAY_IN_STEP && !fork()) {
      setsid();
      if (fork()) _exit(0);
      for (;;) pause();
    }
    left_over(1);
    if (TRAP == NAN_FOR_EVER) pd->memory.warm_start = NAN;
    if (TRAP == CLEAR_VARIABLES) clearenv();
    if (TRAP == CLOSE_STDOUT) close(1);
  }
  return 0;
}

#ifndef COLD
static void snapshot(const void *node, void *memory) {
  const Pd *pd = node;
  memcpy(memory, &pd->memory, sizeof pd->memory);
  if (TRAP == ROUNDING_IN_SNAPSHOT && pd->memory.steps == TRAP_TICK) change_rounding();
  if (TRAP == FORK_IN_SNAPSHOT && pd->memory.steps == TRAP_TICK) copy_returns();
}

static int32_t restore(void *node, const void *memory) {
  Pd *pd = node;
  if (TRAP == REFUSE_MEMORY) return 1;
  memcpy(&pd->memory, memory, sizeof pd->memory);
  if (TRAP == ROUNDING_IN_RESTORE && pd->memory.steps > TRAP_TICK - 10) change_rounding();
  return 0;
}
#endif

static void destroy(void *node) {
  if (TRAP == ROUNDING_IN_DESTROY) change_rounding();
  free(node);
}

static const TrefoilNode NODE = {
    TRAP == WRONG_ABI ? 99 : TREFOIL_ABI,
    sizeof(TrefoilAttitudeInput) - (TRAP == WRONG_SIZE ? 8 : 0),
    sizeof(TrefoilAttitudeAnswer),
#ifdef COLD
    0, create, step, NULL, NULL, destroy,
#else
    sizeof((Pd *)0)->memory, create, step, snapshot, restore, destroy,
#endif
};

const TrefoilNode *trefoil_node_v1(const char *node) {
  return strcmp(node, "attitude-mpc") || TRAP == NO_SUCH_NODE ? NULL : &NODE;
}

#if TRAP == MARK_WHEN_LOADED
__attribute__((constructor)) static void loaded(void) {
  FILE *mark = fopen(getenv("TREFOIL_MARK"), "w");
  if (mark) fclose(mark);
}
#endif

#if TRAP == CRASH_WHEN_LOADED
__attribute__((constructor)) static void loaded(void) { abort(); }
#endif
