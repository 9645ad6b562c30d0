"""Flies the controller on the linear model of model.json: from a tilted start to hover within five seconds."""

import json
import pathlib

import casadi as ca
import numpy as np

model = json.loads(pathlib.Path("model.json").read_text())
A, B = np.array(model["a"]), np.array(model["b"])
controller = ca.external("controller", "./controller.so")
trim = np.array([model["trim_roll_rad"], 0, 0])
x, z = np.array([0.5, 0.2, -0.1, 0.3] + [0.0] * 7), np.zeros(8)
for _ in range(500):
    demand = z[4:]
    answer = controller([0, 0, x[0]], x[1:4] + trim, x[4:7], 0, trim, [0, 0, 0], model["sample_s"], z)
    assert answer[2] == 0
    z = answer[1].full().ravel()
    x = A @ x + B @ demand
assert np.abs(x[:7]).max() < 0.01, x
print("hovers after 5 s")
