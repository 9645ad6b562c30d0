"""Generates the solver of a nonlinear attitude MPC in generated/: rotors and tilt with their lag and limits."""

import json
import os
import pathlib

import acados
import casadi as ca
import numpy as np

# The package from PyPI has its files in another place than acados expects.
os.environ["ACADOS_SOURCE_DIR"], os.environ["TERA_PATH"] = acados.DIR, acados.TERA_PATH
os.chmod(acados.TERA_PATH, 0o755)
templates = pathlib.Path(acados.DIR, "interfaces/acados_template/acados_template")
if not templates.exists():
    templates.parent.mkdir(parents=True, exist_ok=True)
    templates.symlink_to(acados.TEMPLATE_DIR)

from acados.acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver  # noqa: E402

SAMPLES, STEP_S = 20, 0.02
STATE = [1e2, 1e3, 1e3, 1e3, 1e1, 1e1, 1e1]  # weights of w, roll, pitch, yaw, p, q, r
COMMAND = [2e2, 2e2, 2e2, 1e2]  # weights of the rotor speeds, as shares of the hover speeds, and of the tilt

model = json.loads(pathlib.Path("model.json").read_text())
ixx, iyy, izz = model["inertia_kgm2"]
hover = np.array([*model["trim_rotor_speed"], 1.0])  # unit of the actuators; the tilt is in rad

w, roll, pitch, yaw, p, q, r = ca.vertsplit(ca.SX.sym("motion", 7))
actuators, command, forward = ca.SX.sym("actuators", 4), ca.SX.sym("command", 4), ca.SX.sym("forward", 2)
speed, tilt = actuators[:3] * hover[:3], actuators[3]
squares = ca.vertcat(speed[0] ** 2 * ca.sin(tilt), speed[0] ** 2 * ca.cos(tilt), speed[1] ** 2, speed[2] ** 2)
col, lon, lat, ped = ca.vertsplit(ca.mtimes(ca.DM(model["mixing"]), squares))
turn = q * ca.sin(roll) + r * ca.cos(roll)
motion = ca.vertcat(w, roll, pitch, yaw, p, q, r)
change = ca.vertcat(
    model["g_mps2"] * ca.cos(roll) * ca.cos(pitch) + col / model["mass_kg"] + q * forward[0] - p * forward[1],
    p + turn * ca.tan(pitch),
    q * ca.cos(roll) - r * ca.sin(roll),
    turn / ca.cos(pitch),
    (lat + (iyy - izz) * q * r) / ixx,
    (lon + (izz - ixx) * p * r) / iyy,
    (ped + (ixx - iyy) * p * q) / izz,
    (command - actuators) / ca.DM(model["actuator_lag_s"]),
)

ocp = AcadosOcp()
ocp.model = AcadosModel()
ocp.model.name = "controller"
ocp.model.x, ocp.model.u, ocp.model.p = ca.vertcat(motion, actuators), command, forward
ocp.model.f_expl_expr = change
ocp.parameter_values = np.zeros(2)

ocp.cost.cost_type, ocp.cost.cost_type_e = "LINEAR_LS", "LINEAR_LS"
ocp.cost.Vx, ocp.cost.Vu = np.eye(11, 11), np.vstack([np.zeros((7, 4)), np.eye(4)])
ocp.cost.Vx[7:] = 0
ocp.cost.Vx_e = np.eye(7, 11)
ocp.cost.W, ocp.cost.W_e = np.diag(STATE + COMMAND), np.diag(STATE) * 0.2
ocp.cost.yref, ocp.cost.yref_e = np.zeros(11), np.zeros(7)

lowest, highest = model["rotor_speed_min"], np.array(model["rotor_speed_max"])
ocp.constraints.idxbu = np.arange(4)
ocp.constraints.lbu = np.append(lowest / hover[:3], -model["tilt_max_rad"])
ocp.constraints.ubu = np.append(highest / hover[:3], model["tilt_max_rad"])
ocp.constraints.x0 = np.zeros(11)

options = ocp.solver_options
options.nlp_solver_type, options.integrator_type = "SQP_RTI", "ERK"
options.qp_solver, options.hessian_approx = "PARTIAL_CONDENSING_HPIPM", "GAUSS_NEWTON"
# The command in force acts for one more sample; the plan begins after it.
ocp.dims.N = SAMPLES
options.time_steps = np.array([model["sample_s"]] + [STEP_S] * (SAMPLES - 1))
options.tf = options.time_steps.sum()
ocp.code_export_directory = "generated"
AcadosOcpSolver.generate(ocp, json_file="generated/ocp.json")
