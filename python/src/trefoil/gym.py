"""Gymnasium environment on :class:`trefoil.Flight`: needs the extra ``gym``.

::

    import gymnasium
    import trefoil.gym

    env = gymnasium.make("trefoil/Flight-v0", scenario="scenarios/survey.toml")
"""

from collections.abc import Mapping
from os import PathLike
from typing import Any

import gymnasium
import numpy as np

from ._flight import Flight
from ._inputs import Reference, Sample

#: Largest deviation of col, lon, lat, ped from trim in one action [N, N m, N m, N m].
MAX_DEMAND = np.array([5.0, 0.5, 0.5, 0.5])

#: Largest magnitudes of an observation: beyond them, nodes refuse a message (``contract/src/message.rs``).
MAX_OBSERVATION = np.repeat([1e4, 100.0, 1e3, 100.0, 1e3, 1e4, 1e6], [6, 3, 3, 3, 3, 1, 3])


class FlightEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Attitude controller as an agent, in place of attitude-mpc.

    Observation, shape (22,): position error, north, east, down [m]; velocity u, v, w [m/s]; attitude [rad]; body rates
    [rad/s]; references of attitude [rad], body rates [rad/s] and w [m/s]; rotor speeds of the command in force minus
    the speeds at trim [rotor speed unit]. A number beyond :data:`MAX_OBSERVATION`, also an infinite number, is clipped
    to it. A NaN, as of a sensor that is off, is replaced by the last value, or by 0 before the first value.

    Action, shape (4,), from -1 to 1: share of :data:`MAX_DEMAND`.

    Reward: 1 / (1 + e) for each step, with the length e of the observed position error [m], and 0 for the step that
    loses the vehicle. So a return lies between 0 and the number of steps, and at any moment, with any discount, each
    way to stay in the air is worth more than a loss. Rewards before a loss are kept.

    An episode is terminated if the vehicle is lost, and truncated at ``run.duration_s``: after at most
    ``run.duration_s * run.rate_hz + 1`` steps. A step after the end raises :class:`trefoil.Error` until ``reset``.

    Args:
        scenario: scenario file; ``None`` = the defaults.
        settings: settings by key, as for ``trefoil fly --set``. Each ``reset`` draws ``run.seed``, from the ``seed``
            of ``reset``.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        scenario: str | PathLike[str] | None = None,
        settings: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.scenario, self.given, self.render_mode = scenario, dict(settings or {}), render_mode
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float64)
        self.observation_space = gymnasium.spaces.Box(-MAX_OBSERVATION, MAX_OBSERVATION, dtype=np.float64)
        self.flight: Flight | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        self.close()
        run_seed = int(self.np_random.integers(2**31))
        self.flight = Flight(self.scenario, settings={**self.given, "run.seed": run_seed})
        self.samples = iter(self.flight)
        self.observation = np.zeros(self.observation_space.shape)
        self.observation = self._observe(*next(self.samples))
        return self.observation, {"run.seed": run_seed}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        assert self.flight is not None, "reset comes before step"
        self.flight.answer(np.asarray(action, np.float64) * MAX_DEMAND)
        given = next(self.samples, None)
        if given is not None:
            self.observation = self._observe(*given)
        lost = given is None and self.flight.record["diverged"]
        info = self.flight.record if given is None else {}
        reward = 0.0 if lost else 1.0 / (1.0 + float(np.linalg.norm(self.observation[:3])))
        return self.observation, reward, lost, given is None and not lost, info

    def close(self) -> None:
        if self.flight is not None:
            self.flight.close()
            self.flight = None

    def _observe(self, sample: Sample, reference: Reference) -> np.ndarray:
        error_m = sample.position_m - reference.position_m
        motion = [sample.velocity_mps, sample.attitude_rad, sample.rates_radps]
        wanted = [reference.attitude_rad, reference.rates_radps, [reference.w_mps]]
        trim = self.flight.setup.trim_rotor_speed if self.flight else 0.0
        observed = np.concatenate([error_m, *motion, *wanted, sample.rotor_speed - trim])
        known = np.where(np.isnan(observed), self.observation, observed)
        return np.clip(known, self.observation_space.low, self.observation_space.high)


gymnasium.register("trefoil/Flight-v0", FlightEnv)
