"""``libtrefoil``, loaded by ctypes. A library with another interface is refused at import."""

import ctypes as c
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ._types import NODES

#: Number of the interface that this package was written for: ``TREFOIL_ABI`` of ``trefoil.h``.
ABI = 1
#: Size of the longest reason of an error [byte].
ERROR_BYTES = 16384

PACKAGE = Path(__file__).parent
#: Launcher, built with the package.
LAUNCHER = PACKAGE / "trefoil"


class Error(Exception):
    """Failure of libtrefoil or of the launcher, with its reason.

    Attributes:
        exit_code: exit code of the launcher for such a failure; docs/reference/commands.md has the table.
    """

    def __init__(self, why: str, exit_code: int = 2) -> None:
        super().__init__(why)
        self.exit_code = exit_code


class CSetup(c.Structure):
    """``TrefoilSetup``."""

    _fields_ = [
        ("settings_json", c.c_char_p),
        ("dt_s", c.c_double),
        ("g_mps2", c.c_double),
        ("mass_kg", c.c_double),
        ("inertia_kgm2", c.c_double * 3),
        ("arms_m", c.c_double * 3),
        ("kf", c.c_double),
        ("km", c.c_double),
        ("trim_rotor_speed", c.c_double * 3),
        ("trim_tilt_rad", c.c_double),
        ("trim_roll_rad", c.c_double),
        ("start_position_m", c.c_double * 3),
        ("start_velocity_mps", c.c_double * 3),
        ("start_attitude_rad", c.c_double * 3),
        ("start_rates_radps", c.c_double * 3),
    ]


@dataclass(frozen=True)
class Setup:
    """Vehicle and settings. The trim is the hover of this vehicle."""

    #: ``[node.NAME.settings]`` of the scenario.
    settings: dict[str, Any]
    #: Time between two samples [s].
    dt_s: float
    #: Acceleration of gravity [m/s2].
    g_mps2: float
    #: Mass [kg].
    mass_kg: float
    #: Moments of inertia about the body axes x, y, z, shape (3,) [kg m2].
    inertia_kgm2: np.ndarray
    #: Arms: rotor 1 forward, rotors 2 and 3 back, rotors 2 and 3 sideways, shape (3,) [m].
    arms_m: np.ndarray
    #: Thrust constant [N / rotor speed unit squared].
    kf: float
    #: Torque constant [N m / rotor speed unit squared].
    km: float
    #: Rotor speeds at trim, shape (3,) [rotor speed unit].
    trim_rotor_speed: np.ndarray
    #: Tilt of rotor 1 at trim [rad].
    trim_tilt_rad: float
    #: Roll angle at trim [rad]; pitch is 0.
    trim_roll_rad: float
    #: Position at the start of the flight, north, east, down, shape (3,) [m].
    start_position_m: np.ndarray
    #: Velocity at the start, u, v, w in the body frame, shape (3,) [m/s].
    start_velocity_mps: np.ndarray
    #: Euler angles roll, pitch, yaw at the start, shape (3,) [rad].
    start_attitude_rad: np.ndarray
    #: Body rates p, q, r at the start, shape (3,) [rad/s].
    start_rates_radps: np.ndarray

    @classmethod
    def of(cls, given: CSetup) -> "Setup":
        """Copies the setup that the library gives."""
        names = [name for name, _ in CSetup._fields_[1:]]
        values = {name: getattr(given, name) for name in names}
        vectors = {name: np.array(value) for name, value in values.items() if isinstance(value, c.Array)}
        return cls(settings=json.loads(given.settings_json), **{**values, **vectors})


def _load() -> c.CDLL:
    """Loads the library, and checks that its interface has the number and the sizes of this package."""
    path = PACKAGE / "libtrefoil.so"
    if not path.exists():
        raise ImportError(f"{path} is missing: install the package by `pip install ./python`, which builds it")
    lib = c.CDLL(str(path))
    text, pointer, size, number = c.c_char_p, c.c_void_p, c.c_size_t, c.c_int32
    texts = c.POINTER(text)
    for name, result, *arguments in [
        ("abi", c.c_uint32),
        ("input_bytes", size, text),
        ("answer_bytes", size, text),
        ("join", pointer, text, number, texts, text, size),
        ("setup", c.POINTER(CSetup), pointer),
        ("memory", number, pointer, pointer, size),
        ("next", number, pointer, pointer, size),
        ("remember", number, pointer, text, size),
        ("send", number, pointer, pointer, size),
        ("error", text, pointer),
        ("leave", None, pointer),
        ("plant_run", number, pointer, number, texts, text, size),
        ("flight_open", pointer, text, texts, size, text, text, size),
        ("flight_setup", c.POINTER(CSetup), pointer),
        ("flight_next", number, pointer, pointer, size),
        ("flight_answer", number, pointer, pointer, size),
        ("flight_record", text, pointer),
        ("flight_error", text, pointer),
        ("flight_close", None, pointer),
    ]:
        function = getattr(lib, f"trefoil_{name}")
        function.restype, function.argtypes = result, arguments
    if lib.trefoil_abi() != ABI:
        raise ImportError(f"{path} has interface {lib.trefoil_abi()}, and this package is for {ABI}: install it again")
    for node, (given, answer) in NODES.items():
        own = lib.trefoil_input_bytes(node.encode()), lib.trefoil_answer_bytes(node.encode())
        if own != (given.itemsize, answer.itemsize):
            raise ImportError(f"{path} has other types of {node} than this package: install it again")
    return lib


LIB = _load()


def texts(words: list[str]) -> c.Array:
    """Makes an array of texts for the library."""
    return (c.c_char_p * len(words))(*[word.encode() for word in words])


def opened(open_: Any, *arguments: Any) -> int:
    """Calls a function that returns a handle; raises :class:`Error` with the reason of a failure."""
    why = c.create_string_buffer(ERROR_BYTES)
    handle = open_(*arguments, why, ERROR_BYTES)
    if not handle:
        raise Error(why.value.decode())
    return handle
