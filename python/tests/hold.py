"""Mixer that stays at trim, or guidance that holds the position; the argument names the node."""

import sys

import trefoil

name = sys.argv[1]
with trefoil.Node(name) as node:
    setup = node.setup
    for given in node:
        if name == "guidance":
            at_rest = dict.fromkeys(("velocity_mps", "rates_radps"), [0.0] * 3)
            roll = [setup.trim_roll_rad, 0.0, 0.0]
            node.answer(position_m=given.position_m, attitude_rad=roll, w_mps=0.0, **at_rest)
        else:
            sample, demand = given
            assert demand.demand.shape == (4,) and sample.rotor_speed.shape == (3,)
            node.answer(rotor_speed=setup.trim_rotor_speed, tilt_rad=setup.trim_tilt_rad)
