"""Keys mean the commands that the help says."""

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym.cli.keys import Steering, known_keys, typed
from seastar_gym.gaits import lagged_gait

STAR = 2.0 * np.pi / 5 * np.arange(5)
"""Headings of the limbs at rest [rad]."""


def command(keys, period=1.0, headings=STAR):
    return Steering(period, 5).command(keys, headings).tolist()


@pytest.mark.parametrize(
    "keys, expected",
    [
        ("", [0, 0, 0, 0, 0]),
        ("1", [1, 0, 0, 0, 0]),
        ("r", [0, 0, 0, -1, 0]),
        ("1r", [1, 0, 0, -1, 0]),
        ("1q", [0, 0, 0, 0, 0]),  # both wires of a limb cancel
        ("a", [0, 1, 0, 0, -1]),  # the straight gait along limb 1
        ("d", [0, -1, 0, 1, 0]),
        ("ad", [0, 0, 0, 1, -1]),
        ("6", [0, 0, 0, 0, 0]),  # no such limb
    ],
)
def test_a_key_means_a_command(keys, expected):
    assert command(set(keys)) == expected


@pytest.mark.parametrize("arrow, key", [("right", "a"), ("up", "s"), ("down", "g")])
def test_an_arrow_takes_the_limb_that_points_its_way(arrow, key):
    assert command({arrow}) == command({key})
    turned = command({arrow}, headings=STAR + 2.0 * np.pi / 5)  # the limb before it is there now
    assert turned == np.roll(command({arrow}), -1).tolist()


def test_a_key_that_is_held_swims_the_lagged_gait_from_its_beginning():
    steering, gait = Steering(0.2, 5), lagged_gait(0.2)
    held = [steering.command({"s"}, STAR).tolist() for _ in range(7)]
    assert held == [np.roll(gait[k % 5], 1).tolist() for k in range(7)]
    assert steering.command(set(), STAR).tolist() == [0] * 5
    assert steering.command({"s"}, STAR).tolist() == held[0]


def test_words_are_the_keys_of_decisions():
    assert list(typed("a*2 1w . up", 5)) == [{"a"}, {"a"}, {"1", "w"}, set(), {"up"}]


@pytest.mark.parametrize("text, words", [("a 9", "There is no key '9'"), ("6", "'6'"), ("a*b", "how often, 'a*b'")])
def test_words_that_mean_nothing_are_refused(text, words):
    with assert_refused(words):
        list(typed(text, 5))


def test_every_limb_of_eight_has_keys_and_no_key_two_meanings():
    assert len(known_keys(8)) == 3 * 8 + 4
    assert {"z", "f1", "escape"}.isdisjoint(known_keys(8))
