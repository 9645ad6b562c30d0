"""Runs the error-state Kalman filter of the navigation unit a second time, over the inputs of a test.

Usage: ekf.py FOLDER

`FOLDER/inputs.csv` has a sample of the IMU a row, with what was measured at its end (empty = nothing);
`FOLDER/outputs.csv` what the filter made of it. Prints the largest difference of the estimates, of the covariance's
diagonal as a share of each element, and of the counts of accepted and refused measurements and of resets.
"""

import csv
import sys
from pathlib import Path

import numpy as np

DT, DELAY, G = 0.005, 20, np.array([0.0, 0.0, 9.81])
START = np.repeat([0.1, 0.05, 0.01, 0.03, 0.05, 0.01], [3, 3, 2, 1, 3, 3])
PROCESS = np.repeat([0.0, 0.3 * DT, 0.001 * DT, 0.002 * DT**0.5, 0.0002 * DT**0.5], 3) ** 2
SOURCES = {"position": 3, "velocity": 3, "height": 1, "field": 3, "flow": 2}
NOISE = {
    "position": np.array([0.15, 0.15, 0.25]),
    "velocity": np.array([0.05, 0.05, 0.1]),
    "height": np.array([0.1]),
    "field": np.array([0.02]),
    "flow": np.array([0.1, 0.1]),
}
GATES = {1: 10.828, 2: 13.816, 3: 16.266}  # chi-square quantiles of 0.999
SILENCE = 2.0


def cross(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def rotation(v):
    """Rodrigues' formula; for small angles its series."""
    angle = np.linalg.norm(v)
    k = cross(v)
    if angle < 1e-4:
        return np.eye(3) + (1 - angle**2 / 6) * k + (0.5 - angle**2 / 24) * k @ k
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k


class Filter:
    def __init__(self):
        self.p, self.v, self.r = np.zeros(3), np.zeros(3), np.eye(3)
        self.ba, self.bg = np.zeros(3), np.zeros(3)
        self.cov = np.diag(START**2)
        self.silent = dict.fromkeys(SOURCES, 0.0)
        self.counts = {name: [0, 0, 0] for name in SOURCES}

    def moved(self, p, v, r, force, rates):
        middle = r @ rotation((rates - self.bg) * DT / 2)
        a = middle @ (force - self.ba) + G
        return p + v * DT + a * DT**2 / 2, v + a * DT, r @ rotation((rates - self.bg) * DT)

    def predict(self, force, rates):
        half = rotation((rates - self.bg) * DT / 2)
        f = np.eye(15)
        f[0:3, 3:6] = np.eye(3) * DT
        f[3:6, 6:9] = -self.r @ cross(half @ (force - self.ba)) * DT
        f[3:6, 9:12] = -self.r @ half * DT
        f[6:9, 6:9] = (half @ half).T
        f[6:9, 12:15] = -np.eye(3) * DT
        self.cov = f @ self.cov @ f.T + np.diag(PROCESS)
        self.p, self.v, self.r = self.moved(self.p, self.v, self.r, force, rates)
        for name in SOURCES:
            self.silent[name] += DT

    def fuse(self, name, measured):
        h = np.zeros((len(NOISE[name]), 15))
        deviation = NOISE[name]
        if name == "position":
            y, h[:, 0:3] = measured - self.p, np.eye(3)
        elif name == "velocity":
            y, h[:, 3:6] = measured - self.v, np.eye(3)
        elif name == "height":
            y, h[0, 2] = -measured - self.p[2], 1.0
        elif name == "flow":
            body = self.r.T @ self.v
            y, h[:, 3:6], h[:, 6:9] = measured - body[:2], self.r.T[:2], cross(body)[:2]
        else:
            north, east, down = self.r @ measured
            level = np.hypot(north, east)
            if level < 0.1:
                return
            y = np.array([-np.arctan2(east, north)])
            h[0, 6:9] = np.array([-north * down / level**2, -east * down / level**2, 1.0]) @ self.r
            deviation = deviation / level
        noise = np.diag(deviation**2)
        expected = h @ self.cov @ h.T + noise
        if y @ np.linalg.solve(expected, y) > GATES[len(y)]:
            if self.silent[name] < SILENCE:
                self.counts[name][1] += 1
                return
            self.counts[name][2] += 1
            self.cov = self.cov + h.T @ np.diag(y**2) @ h
            expected = h @ self.cov @ h.T + noise
        self.counts[name][0] += 1
        self.silent[name] = 0.0
        gain = self.cov @ h.T @ np.linalg.inv(expected)
        self.cov = self.cov - gain @ expected @ gain.T
        error = gain @ y
        reset = np.eye(15)
        reset[6:9, 6:9] -= cross(error[6:9] / 2)
        self.cov = reset @ self.cov @ reset.T
        self.p, self.v, self.r = self.p + error[0:3], self.v + error[3:6], self.r @ rotation(error[6:9])
        self.ba, self.bg = self.ba + error[9:12], self.bg + error[12:15]


def rows(name):
    with open(Path(sys.argv[1]) / name, newline="") as file:
        yield from csv.reader(file)


ekf, frames = Filter(), []
apart, spread = 0.0, 0.0
counts = None
for given, told in zip(rows("inputs.csv"), rows("outputs.csv"), strict=True):
    force, rates = np.array(given[0:3], float), np.array(given[3:6], float)
    measured, at = {}, 6
    for name, count in SOURCES.items():
        if given[at]:
            measured[name] = np.array(given[at : at + count], float)
        at += count
    frames.append((force, rates, measured))
    if len(frames) > DELAY:
        force, rates, measured = frames.pop(0)
        ekf.predict(force, rates)
        for name, value in measured.items():
            ekf.fuse(name, value)
    p, v, r = ekf.p, ekf.v, ekf.r
    for force, rates, _ in frames:
        p, v, r = ekf.moved(p, v, r, force, rates)
    ours = np.concatenate([p, v, r.ravel(), ekf.ba, ekf.bg])
    told = np.array(told, float)
    apart = max(apart, np.abs(ours - told[:21]).max())
    spread = max(spread, np.abs(np.diag(ekf.cov) / told[21:36] - 1).max())
    counts = told[36:].reshape(5, 3)
missed = np.abs(counts - np.array(list(ekf.counts.values()))).max()
refused, resets = counts[:, 1].sum(), counts[:, 2].sum()
print(f"{apart:.1e} {spread:.1e} {missed:.0f} {refused:.0f} {resets:.0f}")
