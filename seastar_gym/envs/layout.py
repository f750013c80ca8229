"""Layout of an observation: what a robot sees, in which order and units.

A limb has nine stations, evenly spaced from hub to tip, whatever its nodes, see stations.py: observations, and policies
made for them, do not depend on the mesh. Stations of the chapter's robot are its nodes.

The body frame has its origin at the hub. Its x axis is the direction of limb 1 of the rest shape, after the rotation
that fits the rest shape best to the robot (least squares over all stations). Every number is of order one; lengths are
in units of the robot's own limb length:

index                 meaning                                           unit
0 .. 2m-1             station positions relative to the hub, x and y    limb lengths
2m .. 4m-1            station velocities relative to the hub, x and y   VELOCITY_SCALE
4m, 4m+1              hub velocity, x and y                             VELOCITY_SCALE
4m+2, 4m+3            current waypoint relative to the hub, x and y     limb lengths
4m+4, 4m+5            next waypoint relative to the hub, x and y        limb lengths

with m = 9 n_limbs stations in the order {1,1}..{1,9}, {2,1}.. (m = 45 for five limbs: 186 numbers). On the last leg the
next waypoint is the current one. Distances of waypoints are not clipped.

If actuators have a memory (`has_memory`), the numbers of its `observe` for limb 1, limb 2, .. stand before the
waypoints, which are always the last four numbers; an environment may leave the memory out. A task may add numbers to
those of every limb, such as its last command.

Further entries of a task stand after those of the limbs, before the waypoints. If headings are asked for
(`options.py`), they are cosine and sine of the turn to the heading at the current waypoint, and of that to the heading
at the next. A task may show nothing of the limbs' shape: its observation then begins with the numbers of the limbs.

With a `Sight`, fewer stations may be seen, or none, and further entries after those of the task say what follows from
the last two pictures, and the age of the last one, see `entries_of` in sight.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.base import Actuator, complete
from seastar_gym.scene.checks import require_count, require_flag, require_limbs, shown

OBSERVATION_LAYOUT = 2
"""Version of this table, which saved policies name. A change of order, unit or frame gives it another number."""
VELOCITY_SCALE = 0.025
"""Unit of velocities [m/s]: nodes and hub move at 12 to 24 mm/s root mean square after strokes of random commands."""
N_STATIONS = 9
"""Stations of a limb: the nodes {i,1}..{i,9} of the chapter's robot."""
MOST_REMEMBERED = 1_000_000
"""Most numbers that the actuators of a robot may remember."""

Entry = Literal["scalar", "pseudoscalar", "vector"]
"""The same in every frame; reversed by a mirror; two numbers, x and y in the body frame."""
SIZES: Mapping[Entry, int] = {"scalar": 1, "pseudoscalar": 1, "vector": 2}
"""Numbers of every entry."""
HEADINGS: tuple[Entry, ...] = ("scalar", "pseudoscalar", "scalar", "pseudoscalar")
"""Entries of asked headings, which come first."""


@dataclass(frozen=True)
class Layout:
    """What an observation consists of, and the places of all that, as slices of its last axis.

    n_limbs: Number of limbs. of_limb: Numbers of every limb besides its stations: the memory of its actuator, and what
    a task adds. entries: Further entries, asked headings first. shows_limbs: Whether the stations of the limbs and the
    hub's velocity are seen. stations: Number of stations that are seen of a limb, evenly spaced, the last at the tip.
    """

    n_limbs: int = 5
    of_limb: int = 0
    entries: tuple[Entry, ...] = ()
    shows_limbs: bool = True
    stations: int = N_STATIONS

    def __post_init__(self) -> None:
        require_limbs(self.n_limbs)
        require_count("of_limb", self.of_limb, 0, MOST_REMEMBERED)
        require_flag("shows_limbs", self.shows_limbs)
        require_count("stations", self.stations, 1, N_STATIONS)
        known = isinstance(self.entries, tuple) and all(isinstance(entry, str) for entry in self.entries)
        if not known or not set(self.entries) <= set(get_args(Entry)):
            raise ValueError(f"entries must be a tuple of {', '.join(get_args(Entry))}, not {shown(self.entries)}.")

    @classmethod
    def of(cls, scene: Scene, observe_actuators: bool = True, entries: tuple[Entry, ...] = ()) -> Layout:
        """Layout for the robot of a scene, with the memory of its actuators or without."""
        return cls(scene.robot.n_limbs, memory_size(scene.actuator) if observe_actuators else 0, entries)

    @cached_property
    def _places(self) -> tuple[slice, ...]:
        along_limbs, hub = (2 * self.stations * self.n_limbs, 2) if self.shows_limbs else (0, 0)
        further = sum(SIZES[entry] for entry in self.entries)
        ends = np.cumsum([along_limbs, along_limbs, hub, self.n_limbs * self.of_limb, further, 2, 2]).tolist()
        return tuple(map(slice, [0, *ends[:-1]], ends))

    @property
    def positions(self) -> slice:
        """Positions of the stations relative to the hub [limb lengths]."""
        return self._places[0]

    @property
    def velocities(self) -> slice:
        """Velocities of the stations relative to the hub [VELOCITY_SCALE]."""
        return self._places[1]

    @property
    def hub_velocity(self) -> slice:
        """Velocity of the hub [VELOCITY_SCALE]."""
        return self._places[2]

    @cached_property
    def stations_and_hub(self) -> slice:
        """The positions, the velocities and the hub's velocity."""
        return slice(0, self.hub_velocity.stop)

    @cached_property
    def actuators(self) -> slice:
        """Numbers of the limbs, limb after limb: the memory of its actuator, and what a task adds to it."""
        return self._places[3]

    @cached_property
    def further(self) -> slice:
        """Further entries."""
        return self._places[4]

    @property
    def headings(self) -> slice:
        """Asked headings; empty where none are asked for."""
        start = self.further.start
        return slice(start, start + (len(HEADINGS) if self.asks_headings else 0))

    @property
    def current_waypoint(self) -> slice:
        """Current waypoint relative to the hub [limb lengths]."""
        return self._places[5]

    @property
    def next_waypoint(self) -> slice:
        """Next waypoint relative to the hub [limb lengths]."""
        return self._places[6]

    @cached_property
    def waypoints(self) -> slice:
        """The current waypoint and the next."""
        return slice(self.current_waypoint.start, self.next_waypoint.stop)

    @cached_property
    def size(self) -> int:
        """Length of the observation."""
        return int(self.next_waypoint.stop)

    @property
    def asks_headings(self) -> bool:
        """Whether headings are asked for."""
        return self.entries[: len(HEADINGS)] == HEADINGS

    @property
    def tips(self) -> list[int]:
        """Places of the positions of the limbs' tips: x and y, limb after limb."""
        return [2 * self.stations * limb + k for limb in range(1, self.n_limbs + 1) for k in (-2, -1)]

    def begins(self, kind: Entry) -> NDArray[np.intp]:
        """Where the entries of a kind begin, among the numbers of the further entries."""
        ends = np.cumsum([0, *(SIZES[entry] for entry in self.entries)])[: len(self.entries)]
        return np.asarray(ends[[entry == kind for entry in self.entries]], np.intp)


def memory_size(actuator: Actuator) -> int:
    """Numbers that are observed of an actuator, 0 without memory."""
    known = complete(actuator)
    return known.observe(known.rest).shape[-1]
