"""Generates an attitude MPC in C: a quadratic program over ten samples, solved by qrqp, which becomes part of the file.

usage: casadi_mpc.py FILE.c    then: cc -O2 -fPIC -shared -o FILE.so FILE.c -lm
"""

import pathlib
import sys

import casadi as ca

HORIZON = 10

rates, attitude, velocity = ca.SX.sym("rates", 3), ca.SX.sym("attitude", 3), ca.SX.sym("velocity", 3)
attitude_ref, rates_ref, w_ref = ca.SX.sym("attitude_ref", 3), ca.SX.sym("rates_ref", 3), ca.SX.sym("w_ref")
dt, p, z = ca.SX.sym("dt"), ca.SX.sym("p", 4), ca.SX.sym("z", 4)

# Accelerations of w, theta, phi, psi over the horizon; the mass and the moments of inertia are p.
moves = ca.SX.sym("moves", 4, HORIZON)
w = velocity[2]
angles = ca.vertcat(attitude[1], attitude[0], attitude[2])
speeds = ca.vertcat(rates[1], rates[0], rates[2])
wanted_angles = ca.vertcat(attitude_ref[1], attitude_ref[0], attitude_ref[2])
wanted_speeds = ca.vertcat(rates_ref[1], rates_ref[0], rates_ref[2])
cost = 0
before = z
for k in range(HORIZON):
    acceleration = moves[:, k]
    angles, speeds = angles + 2 * dt * speeds, speeds + 2 * dt * acceleration[1:]
    w = w + 2 * dt * acceleration[0]
    cost += 8 * ca.sumsqr(w - w_ref) + 60 * ca.sumsqr(angles - wanted_angles) + ca.sumsqr(speeds - wanted_speeds)
    cost += 2e-4 * ca.sumsqr(acceleration) + 2e-4 * ca.sumsqr(acceleration - before)
    before = acceleration
given = ca.vertcat(rates, attitude, velocity, attitude_ref, rates_ref, w_ref, dt, z)
problem = {"x": ca.vec(moves), "f": cost, "p": given}
options = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False}
solver = ca.qpsol("solver", "qrqp", problem, options)

names = ["rates", "attitude", "velocity", "attitude_ref", "rates_ref", "w_ref", "dt", "p", "z"]
sizes = [3, 3, 3, 3, 3, 1, 1, 4, 4]
inputs = [ca.MX.sym(name, size) for name, size in zip(names, sizes)]
by_name = dict(zip(names, inputs))
given = ca.vertcat(*[by_name[name] for name in names if name != "p"])
solution = solver(p=given, lbx=-80, ubx=80)
first = solution["x"][:4]
function = ca.Function("mpc", inputs, [by_name["p"] * first, first], names, ["demand", "z_next"])
path = pathlib.Path(sys.argv[1])
generated = function.generate(path.name)
if path.resolve() != pathlib.Path(generated).resolve():
    pathlib.Path(generated).replace(path)
