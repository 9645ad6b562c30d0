"""Types of ``trefoil.h`` as numpy types. Loading the library compares their sizes with the library's sizes."""

import numpy as np

VECTOR = (np.float64, 3)

SAMPLE = [
    ("age_ticks", np.uint64),
    ("position_m", *VECTOR),
    ("velocity_mps", *VECTOR),
    ("attitude_rad", *VECTOR),
    ("rates_radps", *VECTOR),
    ("rotor_speed", *VECTOR),
    ("tilt_rad", np.float64),
]

MOTION = [
    ("position_m", *VECTOR),
    ("velocity_mps", *VECTOR),
    ("attitude_rad", *VECTOR),
    ("rates_radps", *VECTOR),
    ("w_mps", np.float64),
]

REFERENCE = [("age_ticks", np.uint64), *MOTION, ("preview_step_s", np.float64), ("preview", np.float64, (8, 4))]

DEMAND = [("age_ticks", np.uint64), ("demand", np.float64, 4)]

HEAD = [("tick", np.uint64), ("time_s", np.float64), ("sample", SAMPLE)]

#: Input and answer of the plant.
PLANT = (
    np.dtype(
        [
            ("tick", np.uint64),
            ("time_s", np.float64),
            ("advance_s", np.float64),
            ("rotor_speed", *VECTOR),
            ("tilt_rad", np.float64),
        ]
    ),
    np.dtype([*MOTION[:4], ("rotor_speed", *VECTOR), ("tilt_rad", np.float64)]),
)

#: Input and answer of each node that answers.
NODES = {
    "guidance": (np.dtype(HEAD), np.dtype(MOTION)),
    "attitude-mpc": (
        np.dtype([*HEAD, ("reference", REFERENCE)]),
        np.dtype([("demand", np.float64, 4), ("status", np.uint64)]),
    ),
    "mixer": (
        np.dtype([*HEAD, ("demand", DEMAND)]),
        np.dtype([("rotor_speed", *VECTOR), ("tilt_rad", np.float64)]),
    ),
}
