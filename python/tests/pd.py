"""PD law as a process of the ring. Setting ``fail_at``: tick at which the law raises an exception."""

import numpy as np

import trefoil
from trefoil.speed import pd_law

with trefoil.Node("attitude-mpc") as node:
    law, left = pd_law(node), node.memory()
    print("begins cold" if left is None else f"goes on from tick {int.from_bytes(left, 'little')}", flush=True)
    assert node.setup.dt_s == 0.01 and isinstance(node.setup.inertia_kgm2, np.ndarray)
    for sample, reference in node:
        assert node.time_s == node.tick * 0.01
        node.remember(node.tick.to_bytes(8, "little"))
        node.answer(law(sample, reference))
        if node.tick == node.settings.get("fail_at"):
            raise RuntimeError("this law has failed")
