"""Inputs of a node, as views of the buffer that the library writes: nothing is copied."""

import numpy as np


class Age:
    """Message with its age. Its arrays are views: the next sample overwrites them, so copy the arrays to keep."""

    def __init__(self, record: np.ndarray) -> None:
        self._record = record

    @property
    def age_ticks(self) -> int | None:
        """Age of the message in ticks: 0 = a message of this tick, ``None`` = no message has come."""
        age = int(self._record["age_ticks"])
        return None if age == 2**64 - 1 else age


class Sample(Age):
    """Newest sample of the sensors. Position and velocity are NaN while their sensor is off.

    Attributes:
        position_m: position north, east, down, shape (3,) [m].
        velocity_mps: velocity u, v, w in the body frame, shape (3,) [m/s].
        attitude_rad: Euler angles roll, pitch, yaw, shape (3,) [rad].
        rates_radps: body rates p, q, r, shape (3,) [rad/s].
        rotor_speed: rotor speeds of the command in force, shape (3,) [rotor speed unit].
    """

    def __init__(self, record: np.ndarray) -> None:
        super().__init__(record)
        self.position_m: np.ndarray = record["position_m"]
        self.velocity_mps: np.ndarray = record["velocity_mps"]
        self.attitude_rad: np.ndarray = record["attitude_rad"]
        self.rates_radps: np.ndarray = record["rates_radps"]
        self.rotor_speed: np.ndarray = record["rotor_speed"]
        self._tilt_rad = record["tilt_rad"]

    @property
    def tilt_rad(self) -> float:
        """Tilt of rotor 1 of the command in force [rad]."""
        return self._tilt_rad.item()


class Reference(Age):
    """Newest answer of guidance.

    Attributes:
        position_m: position on the trajectory, north, east, down, shape (3,) [m].
        velocity_mps: velocity on the trajectory, north, east, down, shape (3,) [m/s].
        attitude_rad: references of roll, pitch, yaw, shape (3,) [rad].
        rates_radps: references of the body rates p, q, r, shape (3,) [rad/s].
        preview: changes of the references of w [m/s] and of roll, pitch, yaw [rad] from now to eight later times,
            shape (8, 4); zero without ``guidance.preview_s``.
    """

    def __init__(self, record: np.ndarray) -> None:
        super().__init__(record)
        self.position_m: np.ndarray = record["position_m"]
        self.velocity_mps: np.ndarray = record["velocity_mps"]
        self.attitude_rad: np.ndarray = record["attitude_rad"]
        self.rates_radps: np.ndarray = record["rates_radps"]
        self.preview: np.ndarray = record["preview"]
        self._w_mps = record["w_mps"]
        self._preview_step_s = record["preview_step_s"]

    @property
    def w_mps(self) -> float:
        """Reference of w, the velocity along the body z axis [m/s]."""
        return self._w_mps.item()

    @property
    def preview_step_s(self) -> float:
        """Time from one row of ``preview`` to the next, and from the sample to the first row [s]; 0 = no preview."""
        return self._preview_step_s.item()


class Demand(Age):
    """Newest answer of attitude-mpc.

    Attributes:
        demand: deviations of col, lon, lat, ped from trim, shape (4,) [N, N m, N m, N m].
    """

    def __init__(self, record: np.ndarray) -> None:
        super().__init__(record)
        self.demand: np.ndarray = record["demand"]
