"""The Gymnasium environment."""

import numpy as np
import pytest
from conftest import SURVEY

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra `gym`")


def make(**settings: object):
    import trefoil.gym  # noqa: F401: registers the environment

    given = {"run.duration_s": 1.0, "mission.trajectory": "hover", **settings}
    return gymnasium.make("trefoil/Flight-v0", scenario=SURVEY, settings=given)


@pytest.mark.filterwarnings("ignore:.*Box.*infinity")
def test_the_checker_of_gymnasium_accepts_the_environment() -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(make().unwrapped, skip_render_check=True)


def test_an_episode_is_truncated_at_its_end_and_terminated_if_the_vehicle_is_lost() -> None:
    steps, truncated, info = flown(make(), np.zeros(4))
    assert (steps, truncated, info["exit_code"]) == (101, True, 0)
    steps, truncated, info = flown(make(**{"run.duration_s": 60.0}), np.array([0.0, 1.0, 0.0, 0.0]))
    assert (truncated, info["diverged"]) == (False, True)


def flown(env, action: np.ndarray) -> tuple[int, bool, dict]:
    """Flies one action to the end; returns the number of steps, whether the episode was truncated, and the last info."""
    env.reset(seed=1)
    for step in range(1, 10_000):
        _, reward, terminated, truncated, info = env.step(action)
        assert reward <= 0.0
        if terminated or truncated:
            assert terminated != truncated
            return step, truncated, info
    raise AssertionError("the episode did not end")
