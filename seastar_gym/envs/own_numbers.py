"""Numbers that a task shows of its own, and where they stand in an observation.

They stand after the numbers of the limbs and before the waypoints, in the place of asked headings. A task may also show
nothing of the limbs' shape: its observation then begins with the memory of the actuators.
"""

from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from seastar_gym.envs.observation import layout

Kind = Literal["scalar", "turn", "vector"]
"""Kind of a number: the same in every frame; reversed by a mirror; two numbers, x and y in the body frame."""
SIZES: dict[Kind, int] = {"scalar": 1, "turn": 1, "vector": 2}
"""Numbers of every kind."""
HEADINGS: tuple[Kind, ...] = ("scalar", "turn", "scalar", "turn")
"""Kinds of the numbers of asked headings."""


class OwnNumbers(NamedTuple):
    """What a task shows of its own."""

    kinds: tuple[Kind, ...] = ()
    """Kinds of the numbers, in their order."""
    with_stations: bool = True
    """Whether the stations of the limbs and the hub's velocity are shown."""

    @property
    def size(self) -> int:
        """Number of the numbers."""
        return sum(SIZES[kind] for kind in self.kinds)

    def places(self, kind: Kind) -> list[int]:
        """Where the numbers of a kind begin."""
        begins = np.cumsum([0, *(SIZES[each] for each in self.kinds)]).tolist()
        return [begin for begin, each in zip(begins, self.kinds, strict=False) if each == kind]


NO_MORE = OwnNumbers()


class Places(NamedTuple):
    """Places in an observation, as slices of its last axis."""

    stations_and_hub: slice
    actuators: slice
    own: slice
    waypoints: slice

    @property
    def size(self) -> int:
        """Length of the observation."""
        return int(self.waypoints.stop)


@cache
def places_of(n_limbs: int, n_remembered: int = 0, own: OwnNumbers = NO_MORE) -> Places:
    """Places for a robot of n_limbs limbs whose actuators remember n_remembered numbers in all."""
    at = layout(n_limbs)
    stations = at.stations_and_hub.stop if own.with_stations else 0
    ends = np.cumsum([stations, n_remembered, own.size, at.size - at.waypoints.start]).tolist()
    return Places(*map(slice, [0, *ends[:-1]], ends))
