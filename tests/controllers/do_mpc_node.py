"""Attitude MPC of do-mpc as a program of the node attitude-mpc, over a double integrator for each axis.

usage: named by `exec` and `args` of [node.attitude-mpc]; needs trefoil and do-mpc==5.1.0 casadi==3.7.2 sympy.
"""

import do_mpc
import numpy as np
import trefoil
from casadi import vertcat

SAMPLES = 6
STEP_S = 0.03


def controller_of(setup):
    """Returns the MPC: states w, roll, pitch, yaw, p, q, r; inputs the accelerations of w, p, q, r."""
    model = do_mpc.model.Model("discrete")
    x, u = model.set_variable("_x", "x", (7, 1)), model.set_variable("_u", "u", (4, 1))
    goal = model.set_variable("_tvp", "goal", (7, 1))
    rates = x[4:7] + STEP_S * u[1:4]
    following = [x[0] + STEP_S * u[0], *(x[1 + i] + STEP_S * rates[i] for i in range(3)), *(rates[i] for i in range(3))]
    model.set_rhs("x", vertcat(*following))
    model.setup()
    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.store_full_solution = SAMPLES, STEP_S, False
    mpc.settings.supress_ipopt_output()
    error = x - goal
    weights = [8, 60, 60, 60, 1, 1, 1]
    cost = sum(weight * error[i] ** 2 for i, weight in enumerate(weights))
    mpc.set_objective(mterm=cost, lterm=cost)
    mpc.set_rterm(u=2e-4)
    mpc.bounds["lower", "_u", "u"], mpc.bounds["upper", "_u", "u"] = -80, 80
    template = mpc.get_tvp_template()
    wanted = np.zeros((7, 1))

    def goal_at(_time):
        for sample in range(SAMPLES + 1):
            template["_tvp", sample, "goal"] = wanted
        return template

    mpc.set_tvp_fun(goal_at)
    mpc.setup()
    mpc.x0 = np.zeros((7, 1))
    mpc.set_initial_guess()
    scale = np.array([setup.mass_kg, *setup.inertia_kgm2])

    def step(sample, reference):
        state = [sample.velocity_mps[2], *sample.attitude_rad, *sample.rates_radps]
        wanted[:, 0] = [reference.w_mps, *reference.attitude_rad, *reference.rates_radps]
        force, roll, pitch, yaw = scale * mpc.make_step(np.array(state).reshape(7, 1)).ravel()
        return np.array([force, pitch, roll, yaw])

    return step


with trefoil.Node("attitude-mpc") as node:
    step = controller_of(node.setup)
    for sample, reference in node:
        if sample.age_ticks > 0 or reference.age_ticks > 0:
            node.answer(np.zeros(4), status=1)
        else:
            node.answer(step(sample, reference))
