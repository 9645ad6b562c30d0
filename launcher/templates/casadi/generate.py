"""Generates controller.c: an attitude MPC, a quadratic program over the linear model of model.json, solved by qrqp."""

import json
import pathlib

import casadi as ca
import numpy as np

SAMPLES, MOVES = 20, 4
Q = np.diag([1e2, 1e3, 1e3, 1e3, 0, 0, 0, 0, 0, 0, 0])  # w, roll, pitch, yaw, p, q, r, the four lag states
R = np.diag([0.4, 300, 85, 300])  # col, lon, lat, ped
LIMITS = np.array([6.0, 0.6, 0.6, 0.2])  # largest demands [N, N m, N m, N m]

model = json.loads(pathlib.Path("model.json").read_text())
A, B = np.array(model["a"]), np.array(model["b"])

# Weight of the last state: the cost of all later samples without limits, by the Riccati iteration.
P = Q
for _ in range(5000):
    K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
    P = Q + A.T @ P @ (A - B @ K)

# The moves follow one another, and the last one is held. `x` and `u` are deviations from the goal.
moves, x0 = ca.SX.sym("moves", 4, MOVES), ca.SX.sym("x0", 11)
cost, x = 0, x0
for k in range(SAMPLES):
    u = moves[:, min(k, MOVES - 1)]
    x = A @ x + B @ u
    cost += x.T @ (P if k == SAMPLES - 1 else Q) @ x + u.T @ R @ u
quiet = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
solver = ca.qpsol("solver", "qrqp", {"x": ca.vec(moves), "f": cost, "p": x0}, quiet)

# Inputs by the names that the launcher knows. `z` is the memory: the lag states and the last demand.
names = {"velocity": 3, "attitude": 3, "rates": 3, "w_ref": 1, "attitude_ref": 3, "rates_ref": 3, "dt": 1, "z": 8}
inputs = {name: ca.MX.sym(name, size) for name, size in names.items()}
velocity, attitude, rates, w_ref, attitude_ref, rates_ref, dt, z = inputs.values()
trim = [model["trim_roll_rad"], 0, 0]
w = ca.if_else(ca.fabs(velocity[2]) < 1e3, velocity[2], w_ref)  # the velocity is NaN while its sensor is off
# The demand of this step acts from the next sample on, so the state is predicted by one sample.
following = A @ ca.vertcat(w, attitude - trim, rates, z[:4]) + B @ z[4:]
error = following - ca.vertcat(w_ref, attitude_ref - trim, rates_ref, np.zeros(4))
error[3] = ca.remainder(error[3], 2 * np.pi)  # the short way round
demand = solver(p=error, lbx=-np.tile(LIMITS, MOVES), ubx=np.tile(LIMITS, MOVES))["x"][:4]
status = ca.fabs(dt - model["sample_s"]) > 1e-9  # at another sample time there is no answer
outputs = {"demand": demand, "z_next": ca.vertcat(following[7:], demand), "status": status}
function = ca.Function("controller", [*inputs.values()], [*outputs.values()], [*inputs], [*outputs])
function.generate("controller.c")
