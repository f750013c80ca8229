"""Values in sentences are short and on one line, whatever they are; arrays are made of numbers."""

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Seastar
from seastar_gym.scene.checks import LONGEST_SHOWN, as_floats, shown


def nested(depth: int) -> list:
    return [nested(depth - 1)] if depth else []


@pytest.mark.parametrize("value", [0.1, -3, True, None, "text", (1, 2.0), [[1]], {"a": 1}], ids=repr)
def test_small_values_are_shown_as_python_writes_them(value):
    assert shown(value) == repr(value)


@pytest.mark.parametrize(
    "value",
    [
        "x" * 10_000,
        [0.1] * 10_000,
        nested(900),
        [10**5000],
        Seastar(limb_length=np.linspace(0.1, 0.2, 1000)),
        np.zeros((100, 100)),
        "two\nlines",
    ],
    ids=["text", "list", "nested", "large number", "part", "array", "lines"],
)
def test_large_values_are_cut_and_on_one_line(value):
    text = shown(value)
    assert 0 < len(text) <= LONGEST_SHOWN + 3
    assert "\n" not in text


@pytest.mark.parametrize("value", [10**400, -(10**5000)], ids=["400 digits", "5000 digits"])
def test_numbers_beyond_all_floats_are_not_written_out(value):
    assert shown(value) == "a number beyond all floats"


@pytest.mark.parametrize("value", [1, True, [1, 2], ((0.5,), (1.5,)), np.zeros((2, 3), np.float32)], ids=repr)
def test_numbers_become_floats_of_their_shape(value):
    array = as_floats("heading", value)
    assert array.dtype == np.float64 and array.shape == np.shape(value)


@pytest.mark.parametrize("value", ["abc", None, [[1], [2, 3]], [1j], {}], ids=repr)
def test_what_is_no_array_of_numbers_is_refused(value):
    with assert_refused("heading", "numbers"):
        as_floats("heading", value)
