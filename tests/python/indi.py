"""Computes the demands of the law `indi` a second time, from the log of a flight without delay compensation.

Usage: indi.py FOLDER    FOLDER of `export --to csv`; the flight has the default vehicle and gains

Prints the largest difference of a demand and of a disturbance, each as a share of the largest one of its axis.
"""

import csv
import sys
from pathlib import Path

import numpy as np

G, MASS, INERTIA = 9.81, 1.1, np.array([0.0239, 0.01271, 0.01273])
L1, L2, L3, KF, KM = 0.2483, 0.1241, 0.215, 1.97e-6, 2.88e-7
KP, KD, FILTER = np.array([4.0, 36.0, 36.0, 36.0]), np.array([12.0, 12.0, 12.0]), 30.0
SAMPLE, LAG, RATES = 0.01, 0.03, np.array([20_000.0, 20_000.0, 20_000.0, 10.5])

# Mixing matrix (33)-(36), and the trim (25)-(30).
MIX = KF * np.array([[0, -1, -1, -1], [0, L1, -L2, -L2], [0, 0, -L3, L3], [L1, 0, 0, 0]])
MIX[3, 1:] = [-KM, KM, -KM]
tan_mu = KM / (L1 * KF)
share = L2 / L1
ROLL = np.arctan(-tan_mu * share / (1 + share))
lift = MASS * G * np.cos(ROLL) / KF
front, rear = np.sqrt(lift * share / (1 + share) / np.cos(np.arctan(tan_mu))), np.sqrt(lift / (1 + share) / 2)
TRIM = np.array([front, rear, rear, np.arctan(tan_mu)])
HIGHEST, TILT = 2 * TRIM[:3], np.radians(60.0)


def table(folder, name, *columns):
    with open(Path(folder) / name, newline="") as file:
        rows = list(csv.DictReader(file))
    return [np.array([[float(row[key]) for key in keys.split()] for row in rows]) for keys in columns]


def squares(position):
    tilt = position[3]
    return np.array([position[0] ** 2 * np.sin(tilt), position[0] ** 2 * np.cos(tilt), position[1] ** 2, position[2] ** 2])


def follow(position, command):
    """Moves the actuators on by a sample: at the limit of their rates, then exponentially."""
    command = np.append(np.clip(command[:3], 200.0, HIGHEST), np.clip(command[3], -TILT, TILT))
    away = command - position
    limited = np.clip((np.abs(away) - RATES * LAG) / RATES, 0.0, SAMPLE)
    position = position + np.sign(away) * RATES * limited
    return command + (position - command) * np.exp(-(SAMPLE - limited) / LAG)


def turn(roll, pitch, yaw):
    """Returns the rotation matrix from body to world for Euler angles."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    return np.array([
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ])  # fmt: skip


LEVEL = turn(ROLL, 0.0, 0.0)  # from the body axes to the axes of the level frame


def attitude_error(rotation):
    """Returns the tilt about x and y, and the turn about z before the tilt: twice the sine of half of each angle."""
    tilt_to = rotation[:, 2]
    sine, cosine = np.hypot(tilt_to[0], tilt_to[1]), tilt_to[2]
    tilt = np.arctan2(sine, cosine)
    axis = np.array([-tilt_to[1], tilt_to[0], 0.0]) / sine if sine > 0 else np.array([1.0, 0.0, 0.0])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    tilting = np.eye(3) + np.sin(tilt) * cross + (1 - np.cos(tilt)) * cross @ cross
    about_z = tilting.T @ rotation
    heading = np.arctan2(about_z[1, 0], about_z[0, 0])
    return np.append(2 * np.sin(tilt / 2) * axis[:2], 2 * np.sin(heading / 2))


def inverse(c):
    return c / max(c * c, 0.25)


folder = sys.argv[1]
velocity, attitude, rates, commands = table(
    folder,
    "state.csv",
    "measured.velocity_mps.u measured.velocity_mps.v measured.velocity_mps.w",
    "measured.attitude_rad.roll measured.attitude_rad.pitch measured.attitude_rad.yaw",
    "measured.rates_radps.p measured.rates_radps.q measured.rates_radps.r",
    "command_in_force.rotor_speed.rotor_1 command_in_force.rotor_speed.rotor_2 command_in_force.rotor_speed.rotor_3 "
    "command_in_force.tilt_rad",
)
w_ref, attitude_ref, rates_ref = table(
    folder,
    "reference.csv",
    "w_mps",
    "attitude_rad.roll attitude_rad.pitch attitude_rad.yaw",
    "rates_radps.p rates_radps.q rates_radps.r",
)
demands, disturbances = table(
    folder, "controls.csv", "demand.col demand.lon demand.lat demand.ped",
    "disturbance.col disturbance.lon disturbance.lat disturbance.ped",
)  # fmt: skip

axes = [1, 0, 2]  # lon, lat, ped are about y, x, z
side = KF * np.linalg.inv(MIX)[0]  # side force of the tilted rotor, for col, lon, lat, ped
side_trim = KF * squares(TRIM)[0]
position, stage, d, before = TRIM, np.zeros(4), np.zeros(4), None
worst = np.zeros((2, 4))
for k in range(len(demands)):
    position = follow(position, commands[k])
    down = turn(*attitude[k])[2]
    vertical = lambda u: down[1] * (side_trim + side @ u) + down[2] * (u[0] - MASS * G * np.cos(ROLL))  # noqa: E731
    gain = down[2] + down[1] * side[0]
    produced = MIX @ (squares(position) - squares(TRIM))
    now = np.concatenate([[G + vertical(produced) / MASS], produced[1:] / INERTIA[axes]])
    sink = down @ velocity[k]
    if before is not None:
        last_sink, last_rates, last = before
        gained = np.concatenate([[sink - last_sink], (rates[k] - last_rates)[axes]]) / SAMPLE
        beyond = (gained - (last + now) / 2) * np.concatenate([[MASS * inverse(gain)], INERTIA[axes]])
        keep = np.exp(-FILTER * SAMPLE)
        stage = keep * stage + (1 - keep) * beyond
        d = keep * d + (1 - keep) * stage
    before = (sink, rates[k], now)

    # The level frame has the body's angles less the roll of trim.
    level = turn(attitude[k][0] - ROLL, *attitude[k][1:])
    wanted = turn(attitude_ref[k][0] - ROLL, *attitude_ref[k][1:])
    rotation = level.T @ wanted
    error, slower = attitude_error(rotation), rotation @ LEVEL @ rates_ref[k] - LEVEL @ rates[k]
    falls = KP[0] * down[2] * (w_ref[k][0] - velocity[k][2])
    accelerations = KP[[2, 1, 3]] * error + KD[[1, 0, 2]] * slower
    moments = np.concatenate([[0.0], (INERTIA * (LEVEL.T @ accelerations))[axes] - d[1:]])
    col = (MASS * (falls - G) - vertical(moments)) * inverse(gain) - d[0]
    demand = moments + [col, 0.0, 0.0, 0.0]
    worst = np.maximum(worst, np.abs([demand - demands[k], d - disturbances[k]]))

largest = np.array([np.abs(demands).max(axis=0), np.abs(disturbances).max(axis=0)])
print("demand %.1e disturbance %.1e" % tuple((worst / largest).max(axis=1)))
