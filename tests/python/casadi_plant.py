"""Generates the vehicle of the paper, equations (7)-(22), with actuators that follow at once, as a function in C.

usage: casadi_plant.py FILE.c    then: cc -O2 -fPIC -shared -o FILE.so FILE.c -lm
"""

import pathlib
import sys

import casadi as ca

STEPS = 10

shapes = {"time": 1, "advance": 1, "rotor_speed": 3, "tilt": 1, "start": 12, "p": 10, "z": 12}
inputs = {name: ca.SX.sym(name, size) for name, size in shapes.items()}
time, advance, speed, tilt, start, p, z = inputs.values()
mass, g, kf, km = ca.vertsplit(p[:4])
arm, inertia = p[4:7], p[7:10]

f, m = kf * speed**2, km * speed**2
lift = f[0] * ca.cos(tilt)
force = ca.vertcat(0, f[0] * ca.sin(tilt), -(lift + f[1] + f[2]))
moment = ca.vertcat(
    -arm[2] * (f[1] - f[2]),
    -arm[1] * (f[1] + f[2]) + arm[0] * lift,
    arm[0] * f[0] * ca.sin(tilt) - m[0] * ca.cos(tilt) + m[1] - m[2],
)


def rotation(axis, angle):
    """Returns the rotation matrix about a coordinate axis."""
    c, s = ca.cos(angle), ca.sin(angle)
    rows = [[[1, 0, 0], [0, c, -s], [0, s, c]], [[c, 0, s], [0, 1, 0], [-s, 0, c]], [[c, -s, 0], [s, c, 0], [0, 0, 1]]]
    return ca.vertcat(*[ca.horzcat(*row) for row in rows[axis]])


def derivative(x):
    """Returns the rate of change of position, velocity, Euler angles and rates."""
    u, (phi, theta, psi), w = x[3:6], ca.vertsplit(x[6:9]), x[9:12]
    body = rotation(2, psi) @ rotation(1, theta) @ rotation(0, phi)
    tangent = ca.tan(theta)
    spun = w[1] * ca.sin(phi) + w[2] * ca.cos(phi)
    angles = ca.vertcat(w[0] + spun * tangent, w[1] * ca.cos(phi) - w[2] * ca.sin(phi), spun / ca.cos(theta))
    speeds = force / mass + body.T @ ca.vertcat(0, 0, g) - ca.cross(w, u)
    return ca.vertcat(body @ u, speeds, angles, (moment - ca.cross(w, inertia * w)) / inertia)


x = ca.if_else(ca.logic_and(time == 0, advance == 0), start, z)
for _ in range(STEPS):
    middle = x + 0.5 * advance / STEPS * derivative(x)
    x = x + advance / STEPS * derivative(middle)
answers = {"position": x[:3], "velocity": x[3:6], "attitude": x[6:9], "rates": x[9:], "z_next": x}
function = ca.Function("vehicle", list(inputs.values()), list(answers.values()), list(inputs), list(answers))
path = pathlib.Path(sys.argv[1])
pathlib.Path(function.generate(path.name)).replace(path)
