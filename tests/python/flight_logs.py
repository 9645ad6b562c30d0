"""Reads public logs of flights for `px4_log.py`: times in s, IMU in m/s2 and rad/s, velocities NED in m/s."""

import csv
import io
import zipfile

import numpy as np

RADIUS_M = 6371000.0
# End of the alignment, take-off, latency of the receiver [s]; declination and inclination of the map [deg];
# resolution of the position in the file [m].
SITES = {
    "csv": {"still": 10.0, "off": 20.0, "late": 0.11, "map": (3.0, 63.3), "steps": (0.0, 0.0, 0.0)},
    "zip": {"still": 4.0, "off": 4.8, "late": 0.22, "map": (11.8, -68.4), "steps": (0.11, 0.88, 0.01)},
}
LATE_S = {"NTUN": 0.35, "MAG": 0.03}  # barometer and magnetometer of the real flight, as in its own filter
SPACED_S = {"baro": 0.0396, "mag": 0.0198}  # shortest intervals, as in the preset


def simulated(path):
    """Reads the rows of each sensor, the time in seconds first."""
    log = {}
    with open(path, newline="") as file:
        for time, sensor, *numbers in csv.reader(file):
            log.setdefault(sensor, []).append([int(time) / 1e6, *map(float, filter(None, numbers))])
    return {sensor: np.array(rows) for sensor, rows in log.items()}


def real(path):
    """Reads such rows from the real flight. Its course is frozen below 0.5 m/s; the horizontal velocity is then NaN."""
    log = {}
    with zipfile.ZipFile(path) as file:
        for name in ("IMU", "GPS", "MAG", "NTUN", "ATT"):
            log[name] = np.loadtxt(io.BytesIO(file.read(name + ".txt")))
            log[name][:, 0] = log[name][:, 0] / 1e3 - LATE_S.get(name, 0.0)
    imu, gps = log["IMU"], log["GPS"]
    imu[1:, 2:8] = (imu[1:, 2:8] + imu[:-1, 2:8]) / 2  # means of a sample from values at its ends
    level = gps[:, 10] * np.exp(1j * np.radians(gps[:, 11]))
    level[np.diff(gps[:, 11], prepend=gps[0, 11]) == 0] = np.nan
    fixes = [gps[:, 0], gps[:, 9] * 1e3, gps[:, 7] * 1e7, gps[:, 6] * 1e7, level.real, level.imag, gps[:, 12]]
    log |= {"imu": imu[:, [0, 5, 6, 7, 2, 3, 4]], "gps": np.transpose(fixes), "other": log["ATT"][:, [0, 2, 3, 4]]}
    return log | {"mag": log["MAG"][:, [0, 2, 3, 4]], "baro": log["NTUN"][:, [0, 8]]}


def states(path):
    """Reads time, roll, pitch, heading [deg], velocity and position of PX4's filter."""
    told = np.loadtxt(path, delimiter=",", skiprows=1)
    w, x, y, z = told[:, 1:5].T
    level = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), np.arcsin(2 * (w * y - z * x))
    turns = np.degrees([*level, np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))])
    return np.c_[told[:, 0] / 1e6, turns.T, told[:, 5:11]]


def read(path):
    """Reads a log for `px4_log.py`; returns it with the constants of its flight."""
    return (real if path.endswith("zip") else simulated)(path), SITES[path[-3:]]


def frames_of(log, site):
    """Puts samples of the IMU on a grid, with the measurements at the end of each; a lost sample equals the next."""
    imu = log["imu"]
    dt = np.round(np.median(np.diff(imu[:, 0])), 4)
    times = np.arange(imu[0, 0], imu[-1, 0], dt)
    samples, measured = imu[np.searchsorted(imu[:, 0], times - dt / 10), 1:], [{} for _ in times]

    def put(name, time, value):
        at = int(np.ceil((time - times[0]) / dt - 0.1))
        if 0 <= at < len(times):
            measured[at][name] = value

    at_rest = {name: log[name][log[name][:, 0] < site["still"], 1:].mean(0) for name in ("baro", "mag")}
    strength = np.linalg.norm(at_rest["mag"])
    for sensor, name, zero, unit in (("baro", "height", at_rest["baro"], 1.0), ("mag", "field", 0.0, strength)):
        last, before = -np.inf, None
        for time, *value in log[sensor]:
            if value != before and time > last + SPACED_S[sensor]:
                put(name, time, (np.array(value) - zero) / unit)
                last, before = time, value
    _, height, east, north = log["gps"][0, :4]
    scale = np.radians(1e-7) * RADIUS_M * np.array([1.0, np.cos(np.radians(north * 1e-7))])
    for time, *fix in log["gps"]:
        level = np.array([fix[2] - north, fix[1] - east]) * scale
        put("position", time - site["late"], np.append(level, (height - fix[0]) / 1e3))
        put("velocity", time - site["late"], np.array(fix[3:]))
    return dt, times, samples, measured
