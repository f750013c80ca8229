"""Means over seeds and tasks, their intervals, and performance profiles."""

import numpy as np
import pytest
from scipy.stats import trim_mean

from seastar_gym.evaluation import statistics


def test_an_interval_is_of_other_seeds_on_the_same_paths():
    paths = np.linspace(150.0, 200.0, 16)
    shifted = paths + np.array([[-1.0], [0.0], [1.0], [0.5]])
    found = statistics.estimate(shifted)
    assert found.mean == pytest.approx(trim_mean(shifted.ravel(), 0.25))
    assert found.low < found.mean < found.high
    assert found.high - found.low < 1.5  # the paths differ by 50
    assert statistics.estimate(np.tile(paths, (3, 1))) == (found := statistics.interquartile_mean(paths), found, found)
    assert np.isnan(statistics.estimate(paths[None]).low)


def test_policies_that_keep_their_order_have_rank_correlation_1():
    assert statistics.rank_correlation([1.0, 2.0, 3.0], [10.0, 11.0, 30.0]) == pytest.approx(1.0)
    assert statistics.rank_correlation([1.0, 2.0, 3.0], [5.0, 4.0, 1.0]) == pytest.approx(-1.0)
    assert np.isnan(statistics.rank_correlation([1.0, 2.0], [5.0, 5.0]))


def test_a_profile_is_the_share_of_scores_that_reach_a_level():
    scores = np.array([[0.2, 0.9], [0.4, 0.9], [0.6, 0.9], [0.8, 0.9]])
    share, low, high = statistics.profile(scores, [0.0, 0.5, 0.85, 1.0])
    assert share.tolist() == [1.0, 0.75, 0.5, 0.0]
    assert (low <= share).all() and (share <= high).all()
    assert low[1] < 0.6 and high[1] > 0.9 and low[0] == high[0] == 1.0  # the second task does not vary
    assert low[2] == high[2] == 0.5
