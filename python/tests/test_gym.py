"""The Gymnasium environment."""

import numpy as np
import pytest
import trefoil
from conftest import SURVEY

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra `gym`")


def make(**settings: object):
    import trefoil.gym  # noqa: F401: registers the environment

    given = {"run.duration_s": 1.0, "mission.trajectory": "hover", **settings}
    return gymnasium.make("trefoil/Flight-v0", scenario=SURVEY, settings=given)


@pytest.mark.filterwarnings("error")
def test_the_checker_of_gymnasium_accepts_the_environment_without_a_warning() -> None:
    from gymnasium.utils.env_checker import check_env

    check_env(make().unwrapped, skip_render_check=True)


def test_an_episode_is_truncated_at_its_end_and_terminated_if_the_vehicle_is_lost() -> None:
    rewards, truncated, info = flown(make(), HOLD)
    assert (len(rewards), truncated, info["exit_code"]) == (101, True, 0)
    _, truncated, info = flown(make(**{"run.duration_s": 60.0}), CRASH)
    assert (truncated, info["diverged"]) == (False, True)


def test_staying_in_the_air_is_worth_more_than_a_crash_at_every_step() -> None:
    crash, truncated, _ = flown(make(**{"run.duration_s": 20.0}), CRASH)
    assert not truncated and crash[-1] == 0.0, "a loss pays nothing"
    drift, truncated, info = flown(make(**{"run.duration_s": 20.0}), DRIFT)
    assert truncated and len(drift) > len(crash) and info["metrics"]["max_position_error_m"] > 30.0
    hover, _, _ = flown(make(**{"run.duration_s": 20.0}), HOLD)
    assert all(0.0 < reward <= 1.0 for reward in crash[:-1] + drift + hover)
    assert sum(crash) < sum(drift) < sum(hover) <= len(hover)


@pytest.mark.parametrize("target", ["position", "velocity", "attitude", "rates", "reference"])
def test_observations_with_garbage_lie_within_their_space(target: str) -> None:
    fault = {"at_s": 0.0 if target == "position" else 1.0, "target": target, "kind": "garbage"}
    rewards, _, _ = flown(make(**{"run.duration_s": 4.0, "fault": [fault]}), DRIFT)
    assert min(rewards) > 0.0


def test_a_position_sensor_that_is_off_pays_no_more_than_its_last_value() -> None:
    off = {"at_s": 3.0, "target": "position", "kind": "off"}
    rewards, _, _ = flown(make(**{"run.duration_s": 4.0, "fault": [off]}), DRIFT)
    assert rewards[298] < 0.8, "it has drifted by the sample before the fault"
    assert set(rewards[299:]) == {rewards[298]}


def test_infinite_numbers_are_clipped_and_missing_ones_keep_the_last_value() -> None:
    from trefoil._inputs import Reference, Sample

    def observed(position_m: list[float], velocity_mps: list[float]) -> np.ndarray:
        zeros = {name: np.zeros(3) for name in ("position_m", "attitude_rad", "rates_radps", "rotor_speed")}
        at = {"position_m": np.array(position_m), "velocity_mps": np.array(velocity_mps), "tilt_rad": np.array(0.0)}
        reference = {"velocity_mps": None, "preview": None, "w_mps": np.array(-np.inf), "preview_step_s": None}
        return env._observe(Sample({**zeros, **at}), Reference({**zeros, **reference}))

    env = make().unwrapped
    env.reset(seed=1)
    env.observation = observed([1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    infinite = observed([np.inf, -np.inf, np.nan], [np.nan, 1e300, 7.0])
    assert env.observation_space.contains(infinite) and np.isfinite(env.observation_space.high).all()
    assert infinite[:6].tolist() == [1e4, -1e4, 3.0, 4.0, 1e4, 7.0] and infinite[18] == -1e4


def test_a_reset_after_a_loss_flies_as_the_first_episode_of_a_new_environment() -> None:
    env = make(**{"run.duration_s": 5.0})
    _, truncated, _ = flown(env, CRASH)
    assert not truncated
    with pytest.raises(trefoil.Error, match="no sample to answer"):
        env.unwrapped.step(HOLD)
    episodes = [flown(env, DRIFT), flown(make(**{"run.duration_s": 5.0}), DRIFT)]
    for rewards, truncated, info in episodes:
        assert (truncated, info["state_hash"]) == (True, episodes[0][2]["state_hash"])
        assert rewards == episodes[0][0]


HOLD, CRASH, DRIFT = np.zeros(4), np.array([0.0, 1.0, 0.0, 0.0]), np.array([0.05, 0.0, 0.0, 0.0])


def flown(env, action: np.ndarray) -> tuple[list[float], bool, dict]:
    """Flies one action to the end; returns the rewards, whether the episode was truncated, and the last info."""
    rewards = []
    observation, _ = env.reset(seed=1)
    for _ in range(10_000):
        assert env.observation_space.contains(observation), observation
        observation, reward, terminated, truncated, info = env.step(action)
        rewards.append(reward)
        if terminated or truncated:
            assert terminated != truncated
            return rewards, truncated, info
    raise AssertionError("the episode did not end")
