"""Every task is measured by what it asks for, over episodes that end with success or without."""

import gymnasium as gym
import numpy as np
import pytest

from seastar_gym import TASKS
from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.evaluation.measures import MEASURES, SECONDS, measure_of, measure_of_challenge
from seastar_gym.evaluation.rollout import Episodes


@pytest.mark.parametrize("id", TASKS)
def test_every_task_is_measured_by_what_it_asks_for(id):
    """Prey that is caught, worth of prizes, the distance from the station, otherwise the time until all is done."""
    challenge = TASKS[id][0].removeprefix("fast-")
    wanted = {each.__name__.lower(): measure for each, measure in MEASURES.items()}.get(challenge, SECONDS)
    assert measure_of(gym.make(id, fidelity="fast").unwrapped) is wanted


def measured(challenge, **changes):
    """Measures of an episode of three decisions without success, and of one with success that ends with the first."""
    time = np.array([[10.0, 10.0], [20.0, 20.0], [40.0, 40.0]])
    entries = {"time": time, "distance": 0.001 * time, "catches": time / 10.0, "taken": time / 5.0} | changes
    of_reset = {name: np.concatenate([np.zeros((1, 2)), values]) for name, values in entries.items()}
    lengths = np.array([3, 1]) if not changes else np.array([3, 3])
    episodes = Episodes(of_reset, np.array([False, True]), np.zeros(2), lengths, (), limit=400.0)
    return measure_of_challenge(CHALLENGES[challenge]).of(episodes).tolist()


def test_measures_are_those_of_finished_and_unfinished_episodes():
    assert measured("miswired") == [400.0, 10.0]
    assert measured("prey") == [4.0, 1.0]
    assert measured("prizes") == [8.0, 2.0]
    assert measured("station", distance=0.001 * np.array([[9.0, 1], [8, 1], [2, 3]])) == pytest.approx([2.0, 3.0])
