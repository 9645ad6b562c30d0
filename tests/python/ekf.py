"""Runs the error-state Kalman filter of the navigation unit a second time, over the inputs of a test.

Usage: ekf.py FOLDER

`FOLDER/inputs.csv` has one sample of the IMU per row, with the measurements at its end (empty = none);
`FOLDER/outputs.csv` has the filter's estimates. Prints the largest difference of the estimates, of the covariance's
diagonal as a share of each element, and of the counts of accepted and refused measurements and of resets.
"""

import csv
import sys
from pathlib import Path

import numpy as np

DT, DELAY, G = 0.005, 20, np.array([0.0, 0.0, 9.81])
START = np.repeat(
    [0.1, 0.05, 0.01, 0.03, 0.05, 0.02, 0.01, 0.5, 0.0, 0.2, 0.02, 0.01], [3, 3, 2, 1, 2, 1, 3, 2, 1, 1, 3, 1]
)
WALK = np.concatenate([np.zeros(15), [0.1, 0.1, 0.05, 0.05], np.full(3, 0.004), [0.0]])
TIME = np.concatenate([np.full(15, np.inf), [50.0, 50.0, np.inf, 30.0], np.full(3, 40.0), [np.inf]])
PROCESS = np.repeat([0.0, 0.3 * DT, 0.001 * DT, 0.002 * DT**0.5, 0.0002 * DT**0.5, 0.0], [3, 3, 3, 3, 3, 8]) ** 2
LEFT, PROCESS = np.exp(-DT / TIME), PROCESS + WALK**2 * DT
ANTENNA, CLOCK, DIP, WIND = 0.05, 0.01, 1.1383, 0.5
SOURCES = {"position": 3, "velocity": 3, "height": 1, "field": 3, "flow": 2}
NOISE = {
    "position": np.array([0.15, 0.15, 0.25]),
    "velocity": np.array([0.05, 0.05, 0.1]),
    "height": np.array([0.1]),
    "field": np.array([0.02]),
    "flow": np.array([0.1, 0.1]),
}
GATES = {1: 10.828, 2: 13.816}  # chi-square quantiles of 0.999
SPLIT = {"position": ("position", "depth"), "velocity": ("velocity", "sink")}  # level and vertical have gates of their own
GROUPS = ("position", "depth", "velocity", "sink", "height", "field", "flow")
FELLOWS = {"position": ("velocity", "flow"), "depth": ("sink", "height"), "height": ("sink", "depth")}
FELLOWS |= {"velocity": ("position", "flow"), "sink": ("depth", "height"), "flow": ("position", "velocity")}
FELLOWS |= {"field": ("velocity", "flow")}
STATES = {  # states of the motion, and of the sensor's own error
    "position": (range(0, 2), range(15, 17)),
    "depth": (range(2, 3), range(17, 18)),
    "velocity": (range(3, 5), None),
    "sink": (range(5, 6), None),
    "height": (range(2, 3), range(18, 19)),
    "field": (range(6, 9), range(19, 22)),
    "flow": (range(3, 6), None),
}
SILENCE, TOGETHER = 2.0, 1.0
UNKNOWN, WRONG, KNOWN = 0.8, 0.35, 0.2  # headings [rad]


def cross(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def rotation(v):
    """Returns the rotation matrix by Rodrigues' formula, or by its series for small angles."""
    angle = np.linalg.norm(v)
    k = cross(v)
    if angle < 1e-4:
        return np.eye(3) + (1 - angle**2 / 6) * k + (0.5 - angle**2 / 24) * k @ k
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k


class YawCheck:
    """Turn from the changes of velocity by the IMU to the changes by the receiver, as complex numbers."""

    def __init__(self, last=None):
        self.change, self.since, self.last = 0j, 0.0, last
        self.product, self.imu, self.receiver, self.count = 0j, 0.0, 0.0, 0.0

    def moved(self, change):
        self.change += complex(*change[:2])
        self.since += DT

    def fix(self, velocity):
        now = complex(*velocity[:2])
        if self.last is not None and self.since < 1.0:
            a, b = self.change, now - self.last
            left = np.exp(-self.since / 10.0)
            self.product = self.product * left + a.conjugate() * b
            self.imu, self.receiver = self.imu * left + abs(a) ** 2, self.receiver * left + abs(b) ** 2
            self.count = self.count * left + 1
        self.change, self.since, self.last = 0j, 0.0, now

    def turn(self, noise):
        if self.count < 10:
            return None
        residual = max(self.receiver - abs(self.product) ** 2 / self.imu, 0.0)
        deviation = np.sqrt(max(residual / (2 * self.count - 1), 2 * noise**2) / self.imu)
        return (np.angle(self.product), deviation) if deviation < KNOWN else None


class Filter:
    def __init__(self):
        self.p, self.v, self.r = np.zeros(3), np.zeros(3), np.eye(3)
        self.ba, self.bg, self.drift = np.zeros(3), np.zeros(3), np.zeros(3)
        self.baro, self.iron, self.declination = 0.0, np.zeros(3), 0.0
        self.pace = (0.0, 0.0)
        self.yaw = YawCheck()
        self.cov = np.diag(START**2)
        self.silent = dict.fromkeys(GROUPS, 0.0)
        self.outage = dict.fromkeys(GROUPS)  # None while the source agrees
        self.counts = {name: [0, 0, 0] for name in GROUPS}

    def moved(self, p, v, r, force, rates):
        middle = r @ rotation((rates - self.bg) * DT / 2)
        a = middle @ (force - self.ba) + G
        return p + v * DT + a * DT**2 / 2, v + a * DT, r @ rotation((rates - self.bg) * DT)

    def predict(self, force, rates):
        half = rotation((rates - self.bg) * DT / 2)
        f = np.diag(LEFT)
        f[0:3, 3:6] = np.eye(3) * DT
        f[3:6, 6:9] = -self.r @ cross(half @ (force - self.ba)) * DT
        f[3:6, 9:12] = -self.r @ half * DT
        f[6:9, 6:9] = (half @ half).T
        f[6:9, 12:15] = -np.eye(3) * DT
        self.cov = f @ self.cov @ f.T + np.diag(PROCESS)
        before = self.v
        self.p, self.v, self.r = self.moved(self.p, self.v, self.r, force, rates)
        self.pace = np.linalg.norm(rates - self.bg), np.linalg.norm(self.v - before) / DT
        self.yaw.moved(self.v - before)
        self.drift, self.baro, self.iron = self.drift * LEFT[15:18], self.baro * LEFT[18], self.iron * LEFT[19:22]
        for name in GROUPS:
            self.silent[name] += DT

    def disputed(self, name):
        return 0.0 if self.outage[name] is None else self.silent[name] - self.outage[name]

    def outvoted(self, name):
        return any(self.counts[fellow][0] > 0 and self.silent[fellow] < TOGETHER for fellow in FELLOWS[name])

    def heading_error(self):
        down = self.r[2]
        return down, down @ self.cov[6:9, 6:9] @ down

    def check_heading(self, velocity):
        self.yaw.fix(velocity)
        found = self.yaw.turn(NOISE["velocity"][0])
        if found is None:
            return
        angle, deviation = found
        down, variance = self.heading_error()
        wrong = abs(angle) > max(WRONG, 3 * deviation) and self.disputed("velocity") >= SILENCE
        if not wrong and variance < UNKNOWN**2:
            return
        self.r = rotation(np.array([0, 0, angle])) @ self.r
        along = self.cov[:, 6:9] @ down / variance
        self.cov = self.cov + np.outer(along, along) * (deviation**2 - variance)
        self.cov[3:5, 3:5] += np.diag((velocity[:2] - self.v[:2]) ** 2)
        self.counts["velocity"][2] += 1
        self.yaw = YawCheck(self.yaw.last)

    def fuse(self, name, measured):
        h = np.zeros((len(NOISE[name]), 23))
        deviation = NOISE[name]
        if name == "position":
            y, h[:, 0:3], h[:, 15:18] = measured - self.p - self.drift, np.eye(3), np.eye(3)
            deviation = np.sqrt(
                deviation**2 + (ANTENNA * min(self.pace[0], 1.0)) ** 2 + (CLOCK * np.linalg.norm(self.v)) ** 2
            )
        elif name == "velocity":
            self.check_heading(measured)
            y, h[:, 3:6] = measured - self.v, np.eye(3)
            deviation = np.sqrt(deviation**2 + (ANTENNA * self.pace[0]) ** 2 + (CLOCK * self.pace[1]) ** 2)
        elif name == "height":
            y, h[0, 2], h[0, 18] = self.baro - measured - self.p[2], 1.0, -1.0
            deviation = np.hypot(deviation, WIND * self.v @ self.v / (2 * G[2]))
        elif name == "flow":
            body = self.r.T @ self.v
            y, h[:, 3:6], h[:, 6:9] = measured - body[:2], self.r.T[:2], cross(body)[:2]
        else:
            north, east, down = self.r @ (measured - self.iron)
            level = np.hypot(north, east)
            if level < 0.1 or self.heading_error()[1] >= UNKNOWN**2:
                return
            y = self.declination - np.arctan2(east, north)
            y = np.array([(y + np.pi) % (2 * np.pi) - np.pi])
            north, east = np.cos(self.declination), np.sin(self.declination)  # direction of the map's field
            h[0, 6:9] = np.array([-north * np.tan(DIP), -east * np.tan(DIP), 1.0]) @ self.r
            h[0, 19:22] = np.array([east, -north, 0.0]) / np.cos(DIP) @ self.r
            h[0, 22] = -1.0
            deviation = deviation / np.cos(DIP)
        if name not in SPLIT:
            self.update(name, y, h, deviation)
            return
        level, vertical = SPLIT[name]
        self.update(level, y[:2], h[:2], deviation[:2])
        # The first update has moved the states that the second one measures.
        now = measured - (self.p + self.drift if name == "position" else self.v)
        self.update(vertical, now[2:], h[2:], deviation[2:])

    def update(self, name, y, h, deviation):
        noise = np.diag(deviation**2)
        expected = h @ self.cov @ h.T + noise
        if y @ np.linalg.solve(expected, y) > GATES[len(y)]:
            if self.outage[name] is None:
                self.outage[name] = self.silent[name]
            if self.disputed(name) < SILENCE or STATES[name][1] is None and self.outvoted(name):
                self.counts[name][1] += 1
                return
            self.counts[name][2] += 1
            motion, own = STATES[name]
            alone = all(self.disputed(fellow) < TOGETHER for fellow in FELLOWS[name])
            states = own if own and alone and self.outage[name] <= SILENCE else motion
            part = np.zeros_like(h)
            part[:, list(states)] = h[:, list(states)]
            part = np.linalg.solve(part @ part.T, part)
            self.cov = self.cov + part.T @ np.diag(y**2) @ part
            if name in ("velocity", "flow") and self.outage[name] <= SILENCE:
                self.cov[6:9, 6:9] += np.eye(3) * (np.linalg.norm(y) / (G[2] * SILENCE)) ** 2
            expected = h @ self.cov @ h.T + noise
        self.counts[name][0] += 1
        self.silent[name], self.outage[name] = 0.0, None
        gain = self.cov @ h.T @ np.linalg.inv(expected)
        down, variance = self.heading_error()
        if variance > UNKNOWN**2:
            gain[6:9] -= np.outer(down, down @ gain[6:9])
            gain[19:] = 0.0
        kept = np.eye(23) - gain @ h
        self.cov = kept @ self.cov @ kept.T + gain @ noise @ gain.T
        error = gain @ y
        reset = np.eye(23)
        reset[6:9, 6:9] -= cross(error[6:9] / 2)
        self.cov = reset @ self.cov @ reset.T
        self.cov = (self.cov + self.cov.T) / 2
        self.p, self.v, self.r = self.p + error[0:3], self.v + error[3:6], self.r @ rotation(error[6:9])
        self.ba, self.bg, self.drift = self.ba + error[9:12], self.bg + error[12:15], self.drift + error[15:18]
        self.baro, self.iron = self.baro + error[18], self.iron + error[19:22]
        self.declination += error[22]


def rows(name):
    with open(Path(sys.argv[1]) / name, newline="") as file:
        yield from csv.reader(file)


def main():
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
        ours = np.concatenate([p, v, r.ravel(), ekf.ba, ekf.bg, ekf.drift, [ekf.baro], ekf.iron, [ekf.declination]])
        told = np.array(told, float)
        apart = max(apart, np.abs(ours - told[:29]).max())
        spread = max(spread, np.abs(np.diag(ekf.cov) / told[29:52] - 1).max())
        counts = told[52:].reshape(7, 3)
    missed = np.abs(counts - np.array(list(ekf.counts.values()))).max()
    refused, resets = counts[:, 1].sum(), counts[:, 2].sum()
    print(f"{apart:.1e} {spread:.1e} {missed:.0f} {refused:.0f} {resets:.0f}")


if __name__ == "__main__":
    main()
