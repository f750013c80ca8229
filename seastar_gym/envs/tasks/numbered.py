"""Numbered episodes: what an episode is about follows from its split and its number alone.

The splits share no episode: training draws one of two thousand million, testing one of a thousand. A reset draws the
number by the environment's own generator, or takes that of `options={"instance": number}`.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.swimming import Flags, Floats, Swimming
from seastar_gym.scene.checks import as_array, require_choice, shown

Split = Literal["train", "test"]
SIZES: dict[Split, int] = {"train": 2_000_000_000, "test": 1_000}
"""Number of episodes of each split."""


class Numbered(Swimming):
    """Task whose episodes are numbered."""

    def _number(self, split: Split) -> None:
        """Take a split, before the first reset."""
        require_choice("split", split, get_args(Split))
        self.split = split
        self.instance = np.zeros(self.n_robots, np.int64)

    def reset(self, robots: Flags, generators: list[np.random.Generator], asked: Any = None) -> None:
        """Begin episodes of the robots in a mask. asked: Number of the episode, or one for each robot, shape (n,)."""
        wanted = None if asked is None else self._checked_numbers(asked)
        drawn = list(generators)
        for robot in np.flatnonzero(robots):
            number = generators[robot].integers(SIZES[self.split]) if wanted is None else wanted[robot]
            self.instance[robot] = number
            drawn[robot] = np.random.default_rng([list(SIZES).index(self.split), int(number)])
        super().reset(robots, drawn)

    def _checked_numbers(self, asked: object) -> NDArray[np.int64]:
        numbers = as_array("instance", asked)
        whole = numbers.dtype.kind in "iu" and numbers.shape in ((), (self.n_robots,))
        if not whole or not ((numbers >= 0) & (numbers < SIZES[self.split])).all():
            raise ValueError(
                f'instance must be a whole number from 0 to {SIZES[self.split] - 1} in the split "{self.split}", or '
                f"one for each of {self.n_robots} robot(s), not {shown(asked)}."
            )
        return np.broadcast_to(numbers.astype(np.int64), (self.n_robots,))

    def facts(self, hub: Floats | None = None) -> dict[str, NDArray[Any]]:
        """What is known of every robot now, and the number of its episode."""
        return {**super().facts(hub), "instance": self.instance.copy()}
