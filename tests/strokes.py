"""Strokes in parts, commands, and simulators that are to be the same, as several tests need them."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from seastar_gym import Simulator, State, StrokeReport
from seastar_gym.simulator.simulator import completed


def finished(stroke: Iterator[float], seen: Callable[[float], Any] = lambda time: time) -> tuple[list, StrokeReport]:
    """Run a stroke in parts to its end: (what was seen at every pause, its time [s] given; the report)."""
    found = []
    report = completed(stroke, lambda time: found.append(seen(time)))
    return found, report


def ternary(n_strokes: int, n_robots: int, seed: int = 0, n_limbs: int = 5) -> np.ndarray:
    """Commands of the chapter, shape (n_strokes, n_robots, n_limbs)."""
    return np.random.default_rng(seed).integers(-1, 2, (n_strokes, n_robots, n_limbs)).astype(float)


def assert_same_bits(one: State, other: State) -> None:
    for name, a, b in zip(State._fields, one, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


def assert_same(simulator: Simulator, other: Simulator) -> None:
    """To the last bit, with what the actuators do now, who has failed, and the estimates of errors."""
    assert_same_bits(simulator.get_state(), other.get_state())
    for name in ("failed", "error_estimate"):
        np.testing.assert_array_equal(getattr(simulator, name), getattr(other, name), err_msg=name)
    np.testing.assert_array_equal(simulator.elastic_energy(), other.elastic_energy())
