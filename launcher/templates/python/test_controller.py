"""Flies the controller on the linear model of model.json: from a tilted start to hover within five seconds."""

import numpy as np

from controller import A, B, TRIM, Controller

controller = Controller()
x, before = np.array([0.5, 0.2, -0.1, 0.3] + [0.0] * 7), np.zeros(4)
for _ in range(500):
    demand = controller.step(x[0], x[1:4] + TRIM, x[4:7], 0, TRIM, np.zeros(3))
    x, before = A @ x + B @ before, demand
assert np.abs(x[:7]).max() < 0.01, x
print("hovers after 5 s")
