"""The rewarded route keeps to the aim of the weights, which are checked and have a plain form."""

import numpy as np
import pytest

from seastar_gym import RewardWeights
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.scene.serial import from_dict, to_dict

HUB, CORNER, FOLLOWING = np.array([[-0.1, 0.0], [0.0, 0.0], [0.0, 0.1]])


@pytest.mark.parametrize("aim", [0.0, 0.4, 0.7, 1.0])
def test_the_route_round_a_corner_is_reflected_at_the_aim(aim):
    """By symmetry it touches the circle on the diagonal of a right angle."""
    touch = aim * 0.01 * np.array([-1.0, 1.0]) / np.sqrt(2.0)
    length = 2.0 * np.linalg.norm(HUB - touch)
    assert RewardWeights(aim=aim).way_to_next(HUB, CORNER, FOLLOWING, 0.01) == pytest.approx(length, abs=1e-8)


@pytest.mark.parametrize("aim", [0.0, 0.7, 1.0])
def test_the_route_of_the_last_leg_ends_in_the_centre_of_the_waypoint(aim):
    hub, last = np.random.default_rng(0).normal(size=(2, 100, 2))
    ways = RewardWeights(aim=aim).way_to_next(hub, last, last, 0.01)
    np.testing.assert_array_equal(ways, np.hypot(*(last - hub).T))


def test_environments_reward_the_route_of_their_aim():
    def progress(aim: float) -> float:
        env = SeastarSwimEnv([[0.05, 0.0], [0.05, 0.1]], fidelity="fast", reward=RewardWeights(aim=aim))
        env.reset(seed=0)
        return env.step([0, 0, 1, 2, 0])[4]["reward_progress"]

    assert abs(progress(0.0) - progress(1.0)) > 1e-3


def test_weights_written_before_they_had_an_aim_are_read_with_the_default():
    data = to_dict(RewardWeights(progress=3.0))
    del data["aim"]
    assert from_dict(data, RewardWeights) == RewardWeights(progress=3.0)
