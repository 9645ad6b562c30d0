// Checks the direction of every reference: the vehicle is sent back to the course from each side.

#include <math.h>
#include <stdio.h>

#include "trefoil.h"

static const TrefoilNode *node;
static void *controller;

static TrefoilGuidanceAnswer answer_at(double north, double east, double down) {
  TrefoilGuidanceInput in = {.sample = {.position_m = {north, east, down}}};
  TrefoilGuidanceAnswer out;
  node->step(controller, &in, &out);
  return out;
}

int main(void) {
  static const char SETTINGS[] = "{\"leg_s\":5.0,\"waypoints_m\":[[0,0,0],[0,0,-4]]}";
  TrefoilSetup setup = {.settings_json = SETTINGS, .dt_s = 0.01, .g_mps2 = 9.81};
  char error[200] = "";
  node = trefoil_node_v1("guidance");
  controller = node->create(&setup, error, sizeof error);
  if (!controller) return fprintf(stderr, "create: %s\n", error), 1;
  int pitches_down = answer_at(-1, 0, 0).attitude_rad[1] < 0;
  int rolls_right = answer_at(0, -1, 0).attitude_rad[0] > 0;
  int climbs = answer_at(0, 0, 1).w_mps < 0;
  int is_level = isnan(answer_at(NAN, 0, 0).attitude_rad[1]) == 0;
  node->destroy(controller);
  if (!(pitches_down && rolls_right && climbs && is_level)) return fprintf(stderr, "a wrong direction\n"), 1;
  printf("flies back to the course\n");
  return 0;
}
