// Geometric attitude controller on SO(3): Lee, Leok and McClamroch, CDC 2010, with the vertical velocity beside it.

#include <array>
#include <cmath>
#include <cstring>
#include <new>

#include "trefoil.h"

namespace {

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;

// Returns the rotation from the body to the world frame for roll, pitch, yaw.
Matrix rotation(const double angles[3]) {
  const double sr = std::sin(angles[0]), cr = std::cos(angles[0]), sp = std::sin(angles[1]), cp = std::cos(angles[1]);
  const double sy = std::sin(angles[2]), cy = std::cos(angles[2]);
  return {{{cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr},
           {sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr},
           {-sp, cp * sr, cp * cr}}};
}

// Returns A'B.
Matrix between(const Matrix &a, const Matrix &b) {
  Matrix out{};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int k = 0; k < 3; k++) out[i][j] += a[k][i] * b[k][j];
  return out;
}

class Geometric {
 public:
  explicit Geometric(const TrefoilSetup &setup) : mass(setup.mass_kg) {
    std::copy(setup.inertia_kgm2, setup.inertia_kgm2 + 3, inertia.begin());
  }

  void step(const TrefoilAttitudeInput &in, TrefoilAttitudeAnswer &out) const {
    out.status = in.sample.age_ticks > 0 || in.reference.age_ticks > 0;
    // e_R = (R_d'R - R'R_d)^v / 2
    const Matrix turn = between(rotation(in.reference.attitude_rad), rotation(in.sample.attitude_rad));
    const Vector error = {(turn[2][1] - turn[1][2]) / 2, (turn[0][2] - turn[2][0]) / 2, (turn[1][0] - turn[0][1]) / 2};
    const double *rates = in.sample.rates_radps;
    const Vector momentum = {inertia[0] * rates[0], inertia[1] * rates[1], inertia[2] * rates[2]};
    Vector moment;
    for (int i = 0; i < 3; i++) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      const double spin = rates[j] * momentum[k] - rates[k] * momentum[j];
      moment[i] = -inertia[i] * (36 * error[i] + 12 * (rates[i] - in.reference.rates_radps[i])) + spin;
    }
    out.demand[0] = 4 * mass * (in.reference.w_mps - in.sample.velocity_mps[2]);
    out.demand[1] = moment[1];
    out.demand[2] = moment[0];
    out.demand[3] = moment[2];
  }

 private:
  double mass;
  Vector inertia;
};

void *create(const TrefoilSetup *setup, char *, size_t) { return new (std::nothrow) Geometric(*setup); }

int32_t step(void *node, const void *input, void *answer) {
  static_cast<const Geometric *>(node)->step(*static_cast<const TrefoilAttitudeInput *>(input),
                                             *static_cast<TrefoilAttitudeAnswer *>(answer));
  return 0;
}

void destroy(void *node) { delete static_cast<Geometric *>(node); }

const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilAttitudeInput), sizeof(TrefoilAttitudeAnswer), 0, create, step, nullptr, nullptr,
    destroy,
};

}  // namespace

const TrefoilNode *trefoil_node_v1(const char *node) { return std::strcmp(node, "attitude-mpc") ? nullptr : &NODE; }
