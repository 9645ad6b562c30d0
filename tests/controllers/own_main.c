// Attitude controller for tests, as a program with its own main, or with STEPPED a flight stepped by its caller: the law
// of pd.c, one PD law per axis.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "trefoil_process.h"

static void law(const TrefoilSetup *setup, const TrefoilAttitudeInput *in, TrefoilAttitudeAnswer *out) {
  static const int AXIS[4] = {0, 1, 0, 2};
  const double *i_kgm2 = setup->inertia_kgm2;
  const double inertia[4] = {setup->mass_kg, i_kgm2[1], i_kgm2[0], i_kgm2[2]};
  out->demand[0] = inertia[0] * 4.0 * (in->reference.w_mps - in->sample.velocity_mps[2]);
  for (int i = 1; i < 4; i++) {
    double error_rad = in->reference.attitude_rad[AXIS[i]] - in->sample.attitude_rad[AXIS[i]];
    double error_radps = in->reference.rates_radps[AXIS[i]] - in->sample.rates_radps[AXIS[i]];
    out->demand[i] = 1.0 * inertia[i] * (36.0 * error_rad + 12.0 * error_radps);
  }
  out->status = 0;
}

#ifdef STEPPED
// Arguments: scenario, settings; prints run.json.
int main(int argc, char **argv) {
  char error[4096] = "";
  const char *const *settings = (const char *const *)argv + 2;
  TrefoilFlight *flight = trefoil_flight_open(argv[1], settings, (size_t)argc - 2, "attitude-mpc", error, sizeof error);
  if (!flight) {
    fprintf(stderr, "%s\n", error);
    return 2;
  }
  TrefoilAttitudeInput in;
  TrefoilAttitudeAnswer out;
  int result;
  while ((result = trefoil_flight_next(flight, &in, sizeof in)) == 1) {
    law(trefoil_flight_setup(flight), &in, &out);
    if ((result = trefoil_flight_answer(flight, &out, sizeof out)) < 0) break;
  }
  if (result < 0) fprintf(stderr, "%s\n", trefoil_flight_error(flight));
  else puts(trefoil_flight_record(flight));
  trefoil_flight_close(flight);
  return -result;
}
#else
int main(int argc, char **argv) {
  char error[1024] = "";
  TrefoilSession *session = trefoil_join("attitude-mpc", argc, (const char *const *)argv, error, sizeof error);
  if (!session) {
    fprintf(stderr, "%s\n", error);
    return 2;
  }
  uint64_t steps = 0;
  int left = trefoil_memory(session, &steps, sizeof steps);
  printf("left: %d byte, %llu steps; settings %s\n", left, (unsigned long long)steps,
         trefoil_setup(session)->settings_json);
  fflush(stdout);
  TrefoilAttitudeInput in;
  TrefoilAttitudeAnswer out;
  if (trefoil_send(session, &out, sizeof out) == 0 || trefoil_next(session, &in, sizeof in - 8) >= 0) return 9;
  int result;
#ifdef FORK
  uint64_t last_tick = 0;
#endif
  while ((result = trefoil_next(session, &in, sizeof in)) == 1) {
    law(trefoil_setup(session), &in, &out);
    steps++;
    trefoil_remember(session, &steps, sizeof steps);
#ifdef FORK
    if (last_tick > 0 && last_tick < FORK && in.tick >= FORK && fork() < 0) return 9;
    last_tick = in.tick;
#endif
    if ((result = trefoil_send(session, &out, sizeof out)) < 0) break;
  }
  if (result < 0) fprintf(stderr, "%s\n", trefoil_error(session));
  trefoil_leave(session);
  return -result;
}
#endif
