// Attitude controller: a linear-quadratic regulator of model.h. Its gain is computed when the node is created.

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>

#include "lqr.h"
#include "trefoil.h"

namespace {

// Weights of w, roll, pitch, yaw, p, q, r and of the four lag states, and of col, lon, lat, ped.
constexpr double Q[N] = {1e2, 1e3, 1e3, 1e3};
constexpr double R[M] = {0.4, 300, 85, 300};

// Part of a node from which the next process goes on after a kill or a swap.
struct Memory {
  std::array<double, M> lag;     // demand that the lagging actuators have reached
  std::array<double, M> demand;  // last demand
};

class Controller {
 public:
  explicit Controller(const TrefoilSetup &setup) {
    if (std::abs(setup.dt_s - MODEL_SAMPLE_S) > 1e-9)
      throw std::runtime_error("model.h is a model of another run.rate_hz");
    if (setup.mass_kg != MODEL_MASS_KG) throw std::runtime_error("model.h is a model of another vehicle");
    if (std::string(setup.settings_json) != "{}") throw std::runtime_error("this controller has no settings");
    if (lqr(Q, R, gain)) throw std::runtime_error("there is no gain for these weights");
  }

  void step(const TrefoilAttitudeInput &in, TrefoilAttitudeAnswer &out) {
    // Without a sample or a reference of this tick there is no answer.
    const double w = in.sample.velocity_mps[2];
    out.status = in.sample.age_ticks > 0 || in.reference.age_ticks > 0 || std::isnan(w);
    if (out.status) return;

    // The demand of this step acts from the next sample on, so the state is predicted by one sample.
    State error = predict(deviation(w, in.sample.attitude_rad, in.sample.rates_radps, memory.lag));
    std::copy(error.end() - M, error.end(), memory.lag.begin());
    const State goal = deviation(in.reference.w_mps, in.reference.attitude_rad, in.reference.rates_radps, {});
    for (int i = 0; i < N; i++) error[i] -= goal[i];
    error[3] = std::remainder(error[3], 2 * std::acos(-1.0));  // the short way round
    for (int i = 0; i < M; i++) {
      memory.demand[i] = 0;
      for (int j = 0; j < N; j++) memory.demand[i] -= gain[i][j] * error[j];
    }
    std::copy(memory.demand.begin(), memory.demand.end(), out.demand);
  }

  Memory memory{};

 private:
  using State = std::array<double, N>;

  static State deviation(double w, const double angles[3], const double rates[3], const std::array<double, M> &lag) {
    const double roll = angles[0] - MODEL_TRIM_ROLL_RAD;
    return {w, roll, angles[1], angles[2], rates[0], rates[1], rates[2], lag[0], lag[1], lag[2], lag[3]};
  }

  State predict(const State &x) const {
    State next{};
    for (int i = 0; i < N; i++) {
      for (int j = 0; j < N; j++) next[i] += MODEL_A[i][j] * x[j];
      for (int j = 0; j < M; j++) next[i] += MODEL_B[i][j] * memory.demand[j];
    }
    return next;
  }

  double gain[M][N];
};

// Functions of the table. No exception may leave them.
void *create(const TrefoilSetup *setup, char *error, size_t error_bytes) {
  try {
    return new Controller(*setup);
  } catch (const std::exception &reason) {
    std::snprintf(error, error_bytes, "%s", reason.what());
    return nullptr;
  }
}

int32_t step(void *node, const void *input, void *answer) {
  try {
    static_cast<Controller *>(node)->step(*static_cast<const TrefoilAttitudeInput *>(input),
                                          *static_cast<TrefoilAttitudeAnswer *>(answer));
    return 0;
  } catch (const std::exception &reason) {
    std::fprintf(stderr, "%s\n", reason.what());
    return 1;
  }
}

void snapshot(const void *node, void *memory) {
  std::memcpy(memory, &static_cast<const Controller *>(node)->memory, sizeof(Memory));
}

int32_t restore(void *node, const void *memory) {
  std::memcpy(&static_cast<Controller *>(node)->memory, memory, sizeof(Memory));
  return 0;
}

void destroy(void *node) { delete static_cast<Controller *>(node); }

const TrefoilNode NODE = {
    TREFOIL_ABI, sizeof(TrefoilAttitudeInput), sizeof(TrefoilAttitudeAnswer), sizeof(Memory),
    create,      step,                         snapshot,                      restore,        destroy,
};

}  // namespace

const TrefoilNode *trefoil_node_v1(const char *node) {
  return std::strcmp(node, "attitude-mpc") ? nullptr : &NODE;
}
