"""Plant in Python: a rigid body whose actuators follow the command at once."""

import sys
from math import ceil, cos, sin

import numpy as np

import trefoil

#: Longest integration step [s].
STEP_S = 2e-3


class RigidBody:
    def __init__(self, setup: trefoil.Setup) -> None:
        if "drag_nspm" in setup.settings:
            raise ValueError("this body has no drag")
        self.setup = setup
        parts = setup.start_position_m, setup.start_velocity_mps, setup.start_attitude_rad, setup.start_rates_radps
        self.x = np.concatenate(parts)
        self.fail_at = setup.settings.get("fail_at")

    def derivative(self, x: np.ndarray, rotor_speed: np.ndarray, tilt_rad: float) -> np.ndarray:
        """Returns the rate of change of the state, equations (7)-(22) of the paper."""
        v, (u, w) = self.setup, (x[3:6], x[9:])
        thrust, torque = v.kf * rotor_speed**2, v.km * rotor_speed**2
        st, ct = sin(tilt_rad), cos(tilt_rad)
        force = np.array([0, thrust[0] * st, -thrust[0] * ct - thrust[1] - thrust[2]])
        front, back, side = v.arms_m
        moment = np.array(
            [
                -side * (thrust[1] - thrust[2]),
                -back * (thrust[1] + thrust[2]) + front * thrust[0] * ct,
                front * thrust[0] * st - torque[0] * ct + torque[1] - torque[2],
            ]
        )
        (sr, sp, sy), (cr, cp, cy) = np.sin(x[6:9]), np.cos(x[6:9])
        to_world = np.array(
            [
                [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
                [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
                [-sp, sr * cp, cr * cp],
            ]
        )
        turn = (w[1] * sr + w[2] * cr) / cp
        return np.concatenate(
            [
                to_world @ u,
                force / v.mass_kg + v.g_mps2 * to_world[2] - np.cross(w, u),
                [w[0] + turn * sp, w[1] * cr - w[2] * sr, turn],
                (moment - np.cross(w, v.inertia_kgm2 * w)) / v.inertia_kgm2,
            ]
        )

    def step(self, given: np.ndarray, state: np.ndarray) -> None:
        if given["tick"] == self.fail_at:
            raise RuntimeError("this vehicle has failed")
        steps = ceil(given["advance_s"] / STEP_S)
        for _ in range(steps):
            dt_s, command = given["advance_s"] / steps, (given["rotor_speed"], given["tilt_rad"])
            middle = self.x + 0.5 * dt_s * self.derivative(self.x, *command)
            self.x = self.x + dt_s * self.derivative(middle, *command)
        state["position_m"], state["velocity_mps"], state["attitude_rad"], state["rates_radps"] = self.x.reshape(4, 3)


if __name__ == "__main__":
    trefoil.fly_plant(RigidBody)
    print("the run is over", file=sys.stderr)
