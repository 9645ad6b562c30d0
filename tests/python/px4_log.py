"""Runs the navigation unit's filter over a public log of a flight, and prints how well both agree.

Usage: px4_log.py LOG [STATES]

`LOG` is `iris_gps.csv` of PX4's tests of EKF2, a simulated flight (`STATES`: the estimates of PX4's own filter), or
`quad122a.zip` of github.com/priseborough/InertialNav, a real flight with the attitude of its autopilot. The filter is
the one of `ekf.py`, aligned as by `alignment.rs`, with the noise of the preset `typical`.
"""

import sys

import ekf
import flight_logs
import numpy as np

G = 9.81
# Noise that plant/src/instruments.rs makes of the preset `typical`; for the gyros it is a density.
FORCE, GYROS, FORCE_WALK, RATES_WALK = 0.536, np.radians(0.0028), 0.00161, np.radians(0.005)
FORCE_BIAS, IRON, DECLINED = np.array([0.0455, 0.0455, 0.0316]), 0.02, np.radians(0.5)
DRIFT_WALK, DRIFT_S = np.array([0.184, 0.184, 0.368]), 100.0
HEIGHT, HEIGHT_WALK, BAROMETER_WALK, FLIGHT_S = 0.394, 0.1157, 0.02, 600.0
HEIGHT_S = 2 * (np.hypot(HEIGHT, BAROMETER_WALK * FLIGHT_S**0.5) / HEIGHT_WALK) ** 2
WHITE = {"position": [0.15, 0.15, 0.246], "velocity": [0.0492, 0.0492, 0.1006], "height": [0.1061], "field": [0.005]}


class Filter(ekf.Filter):
    """Filter that keeps the normalised innovations squared and leaves out measurements that are NaN."""

    def __init__(self):
        super().__init__()
        self.nis = {name: [] for name in ekf.GROUPS}

    def update(self, name, y, h, deviation):
        if not np.isnan(y).any():
            self.nis[name].append(y @ np.linalg.solve(h @ self.cov @ h.T + np.diag(deviation**2), y) / len(y))
            super().update(name, y, h, deviation)

    def check_heading(self, velocity):
        if not np.isnan(velocity).any():
            super().check_heading(velocity)


def configure(dt, site):
    """Gives the filter the noise of the preset, and the resolution of the position in the file."""
    ekf.NOISE = {name: np.array(white) for name, white in WHITE.items()}
    ekf.NOISE["position"] = np.hypot(WHITE["position"], np.array(site["steps"]) / 12**0.5)
    ekf.DT, ekf.G, ekf.DIP = dt, np.array([0.0, 0.0, G]), np.radians(site["map"][1])
    ekf.ANTENNA, ekf.CLOCK, ekf.WIND = 0.03, 0.01, 0.2
    walk = np.concatenate([np.zeros(15), DRIFT_WALK, [HEIGHT_WALK], np.zeros(4)])
    steps = [0.0, FORCE * dt, GYROS * (dt / 2) ** 0.5, FORCE_WALK * dt**0.5, RATES_WALK * dt**0.5, 0.0]
    ekf.LEFT = np.exp(-dt / np.repeat([np.inf, DRIFT_S, HEIGHT_S, np.inf], [15, 3, 1, 4]))
    ekf.PROCESS = np.repeat(steps, [3, 3, 3, 3, 3, 8]) ** 2 + walk**2 * dt


def aligned(samples, measured, site):
    """Aligns a filter that stands still; its north is true north."""
    force, turn = samples[:, 0:3].mean(0), np.radians(site["map"][0])
    given = {name: [now[name] for now in measured if name in now] for name in WHITE}
    white = {name: ekf.NOISE[name] ** 2 / len(values) for name, values in given.items()}
    field, down = np.mean(given["field"], 0), -force / np.linalg.norm(force)
    level = np.cross(down, field)
    horizontal = np.linalg.norm(level)
    east = level / horizontal
    north = np.cross(east, down)
    ours = Filter()
    ours.r = ekf.rotation(np.array([0.0, 0.0, turn])) @ np.array([north, east, down])
    ours.bg, ours.declination = samples[:, 3:6].mean(0), turn
    ours.drift, ours.baro = np.mean(given["position"], 0), float(np.mean(given["height"]))
    tilt = -ekf.cross(down) / G
    by_force = tilt + np.outer(down, north @ tilt * np.tan(ekf.DIP))
    by_field = np.outer(down, east) / np.cos(ekf.DIP)
    of_bias, of_white = np.diag(FORCE_BIAS**2), np.eye(3) * FORCE**2 / len(samples)
    rates_white = GYROS / (2 * ekf.DT * len(samples)) ** 0.5
    ours.cov = cov = np.diag(np.repeat([1e-3, 0.01, 0.0, 0.0, rates_white, 0.0], [3, 3, 3, 3, 3, 8]) ** 2)
    cov[6:9, 6:9] = by_force @ (of_bias + of_white) @ by_force.T + np.outer(down, down) * DECLINED**2
    cov[6:9, 6:9] += by_field @ by_field.T * (white["field"] + IRON**2)
    cov[6:9, 9:12], cov[6:9, 19:22], cov[6:9, 22] = by_force @ of_bias, by_field * IRON**2, down * DECLINED**2
    cov[9:23, 6:9] = cov[6:9, 9:23].T
    cov[9:12, 9:12], cov[19:22, 19:22], cov[22, 22] = of_bias, np.eye(3) * IRON**2, DECLINED**2
    cov[15:18, 15:18] = np.diag(white["position"] + DRIFT_WALK**2 * site["still"] / 3)
    cov[18, 18] = HEIGHT**2 + white["height"][0] + HEIGHT_WALK**2 * site["still"] / 3
    return ours


def angles(r):
    """Returns roll, pitch and heading [deg]."""
    return np.degrees([np.arctan2(r[2, 1], r[2, 2]), -np.arcsin(r[2, 0]), np.arctan2(r[1, 0], r[0, 0])])


def tell(what, values):
    """Prints root mean square and largest magnitude of each column."""
    print(f"{what:55}{np.sqrt(np.nanmean(np.square(values), 0)).round(2)} {np.nanmax(np.abs(values), 0).round(1)}")


def asked(headings, pushes, fixes):
    """Returns the turn of headings that fits the receiver's changes of velocity, and its deviation; as in yaw.rs."""
    moved = np.cumsum(pushes * np.exp(1j * np.radians(headings))) * ekf.DT
    steps, velocity = np.array(list(fixes), int), np.array(list(fixes.values()))
    ours, its = np.diff(moved[steps]), np.diff(velocity)
    told = ~np.isnan(its)
    product, size = ours[told].conj() @ its[told], (abs(ours[told]) ** 2).sum()
    left = ((abs(its[told]) ** 2).sum() - abs(product) ** 2 / size) / (2 * told.sum() - 1)
    return f"{np.degrees(np.angle(product)):.1f} +- {np.degrees((left / size) ** 0.5):.1f}"


def main():
    log, site = flight_logs.read(sys.argv[1])
    dt, times, samples, measured = flight_logs.frames_of(log, site)
    configure(dt, site)
    first = int(site["still"] / dt)
    ours, rows, fixes, heights = aligned(samples[:first], measured[:first], site), [], [], []
    pushes, velocities = [], {}
    for time, sample, now in zip(times[first:], samples[first:], measured[first:], strict=True):
        ours.predict(sample[0:3], sample[3:6])
        if "position" in now:
            fixes.append(np.concatenate([now["position"] - ours.p, now["velocity"] - ours.v]))
            velocities[len(rows)] = complex(*now["velocity"][:2])
        if "height" in now:
            heights.append(now["height"] + ours.p[2])
        for name in (name for name in WHITE if name in now):
            ours.fuse(name, now[name])
        rows.append(np.concatenate([[time], angles(ours.r), ours.v, ours.p]))
        pushes.append(complex(*(ours.r @ sample[0:3])[:2]) * np.exp(-1j * np.radians(rows[-1][3])))
    rows = np.array(rows)
    print(f"{'source':10}{'fused':>7}{'refused':>9}{'resets':>8}{'NIS, 1 is right':>17}")
    for name in ekf.GROUPS[:-1]:
        print("{:10}{:7}{:9}{:8}".format(name, *ours.counts[name]), f"{np.mean(ours.nis[name]):16.3f}")
    rest = rows[:, 0] < site["off"]
    force = -samples[first : first + rest.sum(), 0:3].mean(0)
    tilt = np.degrees([np.arctan2(force[1], force[2]), -np.arcsin(force[0] / np.linalg.norm(force))])
    print("roll and pitch at rest, less those of gravity [deg]:", (rows[rest, 1:3].mean(0) - tilt).round(2))
    print("heading aligned, at take-off, at the end [deg]:", rows[[0, rest.sum(), -1], 3].round(1), end=", ")
    print("deviation:", np.degrees(np.sqrt(ours.r[2] @ ours.cov[6:9, 6:9] @ ours.r[2])).round(1))
    print("turn of the heading by the receiver's velocity [deg]:", asked(rows[:, 3], pushes, velocities))
    tell("rms and largest from the receiver [m, m/s]:", fixes)
    tell("from the barometer [m]:", heights)
    other = flight_logs.states(sys.argv[2]) if len(sys.argv) > 2 else log.get("other", np.empty((0, 4)))
    other = other[(other[:, 0] > site["off"]) & (other[:, 0] < rows[-1, 0])]
    if len(other):
        ahead = np.unwrap(rows[:, : other.shape[1]], period=360, axis=0)
        apart = np.transpose([np.interp(other[:, 0], rows[:, 0], column) for column in ahead.T]) - other
        tell("from the other filter, roll, pitch, heading [deg]:", (apart[:, 1:4] + 180) % 360 - 180)
        its = np.interp(rows[:, 0], other[:, 0], np.unwrap(other[:, 3], period=360))
        print("turn of its heading by the receiver's velocity [deg]:", asked(its, pushes, velocities))
        if apart.shape[1] > 4:
            tell("from the other filter, velocity, position [m/s, m]:", apart[:, 4:])


if __name__ == "__main__":
    main()
