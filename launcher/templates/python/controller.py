"""Attitude controller: a linear-quadratic regulator of model.json. Its gain is computed at the start."""

import json
import pathlib

import numpy as np

Q = np.diag([1e2, 1e3, 1e3, 1e3, 0, 0, 0, 0, 0, 0, 0])  # w, roll, pitch, yaw, p, q, r, the four lag states
R = np.diag([0.4, 300, 85, 300])  # col, lon, lat, ped

MODEL = json.loads(pathlib.Path(__file__).with_name("model.json").read_text())
A, B = np.array(MODEL["a"]), np.array(MODEL["b"])
TRIM = np.array([MODEL["trim_roll_rad"], 0, 0])


def lqr():
    """Returns the gain K of u = -K x, by the Riccati iteration."""
    P = Q
    for _ in range(5000):
        K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    return K


class Controller:
    """Regulator with its memory: the lag states and the last demand."""

    def __init__(self):
        self.gain = lqr()
        self.lag = np.zeros(4)
        self.demand = np.zeros(4)

    def step(self, w, attitude, rates, w_ref, attitude_ref, rates_ref):
        """Returns the demand: deviations of col, lon, lat, ped from trim [N, N m, N m, N m]."""
        # The demand of this step acts from the next sample on, so the state is predicted by one sample.
        following = A @ np.concatenate([[w], attitude - TRIM, rates, self.lag]) + B @ self.demand
        error = following - np.concatenate([[w_ref], attitude_ref - TRIM, rates_ref, np.zeros(4)])
        error[3] = np.remainder(error[3] + np.pi, 2 * np.pi) - np.pi  # the short way round
        self.lag = following[7:]
        self.demand = -self.gain @ error
        return self.demand


def fly():
    """Flies as attitude-mpc until the flight ends."""
    import trefoil

    with trefoil.Node("attitude-mpc") as node:
        if abs(node.setup.dt_s - MODEL["sample_s"]) > 1e-9 or node.setup.mass_kg != MODEL["mass_kg"]:
            raise SystemExit("model.json is a model of another run.rate_hz or vehicle")
        controller = Controller()
        if left := node.memory():  # memory of the process before this one, after a kill or a swap
            controller.lag, controller.demand = np.frombuffer(left).reshape(2, 4)
        for sample, reference in node:
            w = sample.velocity_mps[2]
            if sample.age_ticks > 0 or reference.age_ticks > 0 or np.isnan(w):
                node.answer(controller.demand, status=1)
                continue
            goal = reference.w_mps, np.asarray(reference.attitude_rad), np.asarray(reference.rates_radps)
            node.answer(controller.step(w, np.asarray(sample.attitude_rad), np.asarray(sample.rates_radps), *goal))
            node.remember(np.concatenate([controller.lag, controller.demand]).tobytes())


if __name__ == "__main__":
    fly()
