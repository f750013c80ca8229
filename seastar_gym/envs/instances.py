"""Instances of a task: its numbered episodes, in splits that share none, and what is kept of the present ones.

What is drawn for an episode follows from its split and its number alone.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import as_array, shown

Split = Literal["train", "test"]
SIZES: dict[Split, int] = {"train": 2_000_000_000, "test": 1_000}
"""Number of episodes of each split. They share none."""


def generator_of(number: int, split: Split, spawn_key: tuple[int, ...] = ()) -> np.random.Generator:
    """Generator that draws the episode of a number in a split.

    spawn_key: Of the seed, see `numpy.random.SeedSequence`: no seed of a reset gives an episode with a key.
    """
    entropy = [list(SIZES).index(split), number]
    return np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=spawn_key))


def numbers_of(asked: object, split: Split, n_robots: int) -> NDArray[np.int64]:
    """Numbers of the robots' episodes, shape (n_robots,), of what a reset asks for. ValueError: it is none."""
    numbers = as_array("instance", asked)
    whole = numbers.dtype.kind in "iu" and numbers.shape in ((), (n_robots,))
    if not whole or not ((numbers >= 0) & (numbers < SIZES[split])).all():
        raise ValueError(
            f'instance must be a whole number from 0 to {SIZES[split] - 1} in the split "{split}", or one for each of '
            f"{n_robots} robot(s), not {shown(asked)}."
        )
    return np.broadcast_to(numbers.astype(np.int64), (n_robots,))


def keep(kept: dict[str, NDArray[Any]], robot: int, n_robots: int, drawn: dict[str, Any]) -> None:
    """Keep what was drawn for a robot. Rows of different lengths stand side by side, behind the shorter ones 0.

    Numbers are kept as floats, but for whole numbers of NumPy: a task may write fractions where it drew 0. ValueError
    for what is no number.

    kept: Arrays by name, whose first axis are the robots; it is changed in place.
    """
    for name, value in drawn.items():
        is_typed, value = isinstance(value, np.ndarray | np.generic), np.asarray(value)
        if value.dtype.kind not in "biuf":
            raise ValueError(f"A task draws numbers, and its {name} is {shown(drawn[name])}.")
        value = value if is_typed or value.dtype.kind in "bf" else value.astype(np.float64)
        if name not in kept:
            kept[name] = np.zeros((n_robots, *value.shape), value.dtype)
        kept[name] = kept[name].astype(np.result_type(kept[name], value), copy=False)
        if value.ndim == 0:
            kept[name][robot] = value
            continue
        if (missing := len(value) - kept[name].shape[1]) > 0:
            kept[name] = np.pad(kept[name], [(0, 0), (0, missing), *[(0, 0)] * (value.ndim - 1)])
        kept[name][robot, : len(value)], kept[name][robot, len(value) :] = value, 0
