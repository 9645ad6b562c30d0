"""A process that is the plant of the ring."""

import ctypes as c
import sys
import traceback
from collections.abc import Callable
from typing import Protocol

import numpy as np

from ._native import ABI, ERROR_BYTES, LIB, CSetup, Setup, texts
from ._types import PLANT

CREATE = c.CFUNCTYPE(c.c_void_p, c.POINTER(CSetup), c.c_void_p, c.c_size_t)
STEP = c.CFUNCTYPE(c.c_int32, c.c_void_p, c.c_void_p, c.c_void_p)
DESTROY = c.CFUNCTYPE(None, c.c_void_p)
#: Handle of the one vehicle of a process.
HANDLE = 1


class CNode(c.Structure):
    """``TrefoilNode``, without a memory."""

    _fields_ = [
        ("abi", c.c_uint32),
        ("input_bytes", c.c_uint32),
        ("answer_bytes", c.c_uint32),
        ("memory_bytes", c.c_uint32),
        ("create", CREATE),
        ("step", STEP),
        ("snapshot", c.c_void_p),
        ("restore", c.c_void_p),
        ("destroy", DESTROY),
    ]


class Vehicle(Protocol):
    """Vehicle that :func:`fly_plant` flies."""

    def step(self, given: np.ndarray, state: np.ndarray) -> None:
        """Integrates over one step, and writes the true state at its end.

        Args:
            given: record with ``tick``, ``time_s`` at the beginning of the step [s], ``advance_s``, its duration [s] (0
                at the start of the flight only), and the command: ``rotor_speed``, shape (3,) [rotor speed unit], and
                ``tilt_rad`` [rad].
            state: record to be written: ``position_m`` north, east, down [m], ``velocity_mps`` u, v, w in the body
                frame [m/s], ``attitude_rad`` roll, pitch, yaw [rad], ``rates_radps`` p, q, r [rad/s], each of shape
                (3,); ``rotor_speed`` and ``tilt_rad`` of the actuators, which hold the command before the call.
        """


def fly_plant(create: Callable[[Setup], Vehicle]) -> None:
    """Flies the plant in this program, the ``exec`` of ``[node.plant]`` in a scenario; returns after the run.

    An exception of the vehicle ends the process with a traceback, and ends the flight, because a plant is not replaced.

    Args:
        create: makes the vehicle from a setup, which has the start of the flight, ``start_position_m`` and so on.
    """
    vehicles: list[Vehicle] = []

    def create_one(setup: "c._Pointer[CSetup]", error: int, error_bytes: int) -> int | None:
        try:
            vehicles.append(create(Setup.of(setup.contents)))
        except Exception as failure:
            traceback.print_exc()
            why = str(failure).encode()[: error_bytes - 1] + b"\0"
            c.memmove(error, why, len(why))
            return None
        return HANDLE

    def step(_: int, given: int, state: int) -> int:
        try:
            vehicles[0].step(_record(given, PLANT[0]), _record(state, PLANT[1]))
        except Exception:
            traceback.print_exc()
            return 1
        return 0

    sizes = (kind.itemsize for kind in PLANT)
    functions = CNode(ABI, *sizes, 0, CREATE(create_one), STEP(step), None, None, DESTROY(lambda _: None))
    why = c.create_string_buffer(ERROR_BYTES)
    code = LIB.trefoil_plant_run(c.byref(functions), len(sys.argv), texts(sys.argv), why, ERROR_BYTES)
    if code < 0:
        print(f"plant: {why.value.decode()}", file=sys.stderr)
        raise SystemExit(-code)


def _record(address: int, kind: np.dtype) -> np.ndarray:
    """Returns the record at an address, as a view."""
    return np.frombuffer((c.c_char * kind.itemsize).from_address(address), kind)[0]
