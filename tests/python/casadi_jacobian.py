"""Generates a PD law `law` and its Jacobian `jac_law` in C.

All vectors but `velocity` are rows; the preview has ROWS and COLUMNS.

usage: casadi_jacobian.py FILE.c ROWS COLUMNS    then: cc -O2 -fPIC -shared -o FILE.so FILE.c -lm
"""

import pathlib
import sys

import casadi as ca

path, rows, columns = pathlib.Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
shapes = {"attitude": (1, 3), "rates": (1, 3), "velocity": (3, 1), "attitude_ref": (1, 3), "w_ref": (1, 1)}
shapes |= {"p": (1, 4), "preview": (rows, columns)}
inputs = {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}
attitude, rates, velocity, attitude_ref, w_ref, p, preview = inputs.values()
angles = 36 * (attitude_ref + 0.1 * preview[1:4, 0].T - attitude) - 12 * rates
heave = 4 * (w_ref - velocity[2])
demand = p * ca.horzcat(heave, angles[1], angles[0], angles[2])
law = ca.Function("law", list(inputs.values()), [demand], list(inputs), ["demand"])
generator = ca.CodeGenerator(path.name)
generator.add(law)
generator.add(law.jacobian())
pathlib.Path(generator.generate()).replace(path)
