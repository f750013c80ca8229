"""`Track`: points and orientations over time, as a tracker saw them, and as they are from a robot at rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.identify.measurement import LATEST, ORIENTATION, pointer
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_kind

Floats = NDArray[np.float64]

NOT_SEEN = ("", "nan", "none")
"""Fields of a file of what was not seen."""
FARTHEST = 1e6
"""Largest coordinate [m], [mm] or [pixel], and largest angle [rad], that can be."""
MISFIT = 0.2
"""Largest distance of a robot at rest from its shape, over the length of a limb."""


@dataclass(frozen=True)
class Track:
    """What a tracker saw in n pictures. NaN stands for what it did not see.

    time: [s], shape (n,).
    points: Positions by name, each of shape (n, 2), in the file's unit of length or in pixels.
    orientations: Orientations [rad] by name, anti-clockwise, each of shape (n,), of the points that have one.
    """

    time: Floats
    points: dict[str, Floats]
    orientations: dict[str, Floats]

    def __post_init__(self) -> None:
        require_possible("the time", self.time, LATEST)
        for name, places in self.points.items():
            require_possible(f"the place of {name}", places)
        for name, angles in self.orientations.items():
            require_possible(f"the orientation of {name}", angles)
            require_radians(name, angles)


def require_possible(what: str, numbers: Floats, largest: float = FARTHEST) -> None:
    """Refuse numbers of pictures, shape (n, ..), that are beyond anything. NaN was not seen."""
    beyond = (np.abs(numbers) > largest).reshape(len(numbers), -1).any(axis=1)
    if beyond.any():
        picture = int(beyond.argmax())
        raise ValueError(f"In picture {picture + 1}, {what} is {numbers[picture]}: nothing is beyond {largest:g}.")


def require_radians(name: str, angles: Floats) -> None:
    """Refuse orientations that begin beyond a full turn."""
    known = angles[np.isfinite(angles)]
    if known.size and abs(known[0]) > 2.0 * np.pi:
        raise ValueError(
            f"The orientation of {name} begins at {known[0]:.4g} rad, beyond a full turn: it may be in degrees."
        )


class Seen(NamedTuple):
    """Positions [m] of nodes, shape (n, n_nodes_seen, 2), and their numbers, as those of a `Measurement`."""

    positions: Floats
    nodes: tuple[int, ...]


def chosen_individual(file: str | Path, known: Sequence[str | None], individual: str | None) -> str | None:
    """One of the animals of a file: that of a name, or the only one."""
    require_kind("individual", individual, str | None, "a name, or None")
    if individual in known:
        return individual
    if individual is None and len(known) == 1:
        return known[0]
    if known == [None]:
        raise ValueError(f"{file} names no individuals: leave --individual out.")
    names = ", ".join(str(name) for name in known)
    raise ValueError(f"{file} has the individuals {names}: name one of them with --individual.")


def seen_nodes(track: Track, nodes: Mapping[str, int]) -> Seen:
    """Points of a track in metres as those of nodes, and the orientation of the hub's, if it has one.

    nodes: Nodes of points by their names. Others are left out.
    """
    missing = [name for name in nodes if name not in track.points]
    if missing:
        raise ValueError(f"There is no point {missing[0]}: the file has {', '.join(track.points)}.")
    if len(set(nodes.values())) < len(nodes):
        raise ValueError(f"Two points cannot be one node: {', '.join(f'{name}={k}' for name, k in nodes.items())}.")
    order = sorted(nodes, key=nodes.__getitem__)
    positions = [track.points[name] for name in order]
    numbers = [nodes[name] for name in order]
    if numbers[0] == 0 and order[0] in track.orientations:
        positions, numbers = [*positions, pointer(track.orientations[order[0]])], [*numbers, ORIENTATION]
    return Seen(np.stack(positions, axis=1), tuple(numbers))


def from_rest(seen: Seen, time: Floats, rest: float, scene: Scene) -> Seen:
    """What was seen in the frame in which the robot begins: its hub at the origin and limb 1 along +x.

    The robot is where its pictures within the first `rest` seconds fit its shape at rest best, at least the first.
    """
    still = seen.positions[time <= time[0] + rest]
    known = np.isfinite(still).all(axis=2).any(axis=0)
    places = np.array([np.nanmean(still[:, k], axis=0) for k in np.flatnonzero(known)])
    nodes = np.array(seen.nodes)[known]
    at_nodes = nodes != ORIENTATION
    if not at_nodes.any():
        raise ValueError(f"No node was seen while the robot was at rest, in the first {rest:g} s.")
    turn, shape = _turn(places, nodes, scene), scene.robot.nodes()
    c, s = np.cos(turn), np.sin(turn)
    back = np.array([[c, -s], [s, c]])  # a row times it is turned by -turn
    begin = places[at_nodes].mean(axis=0) - shape[nodes[at_nodes]].mean(axis=0) @ back.T
    origin = np.where(np.array(seen.nodes)[:, None] == ORIENTATION, 0.0, begin)
    return seen._replace(positions=(seen.positions - origin) @ back)


def misfit(seen: Seen, time: Floats, rest: float, scene: Scene) -> float:
    """Distance of the robot at rest from its shape, in the root mean square over its nodes [m].

    ValueError where it is no small share of a limb.
    """
    nodes = np.array(seen.nodes)
    still = seen.positions[time <= time[0] + rest][:, nodes != ORIENTATION]
    off = np.hypot(*(still - scene.robot.nodes()[nodes[nodes != ORIENTATION]]).T)
    found, length = float(np.sqrt(np.nanmean(off**2))), scene.robot.limb_length
    if found > MISFIT * length:
        raise ValueError(
            f"The robot at rest is {1e3 * found:.3g} mm from its shape, whose limbs are {1e3 * length:.3g} mm long: "
            "check which point is which node, the size of a pixel, and whether the picture is mirrored."
        )
    return found


def _turn(places: Floats, nodes: NDArray[np.intp], scene: Scene) -> float:
    """Heading of a robot at rest [rad], by its orientation where that was seen, or the rotation that fits best."""
    if ORIENTATION in nodes:
        x, y = places[list(nodes).index(ORIENTATION)]
        return float(np.arctan2(y, x))
    if len(nodes) < 2:
        raise ValueError(
            "One point at rest does not tell the direction of limb 1: track another node, or the orientation, or leave "
            "the track as it is, with --aligned, if it begins at the origin with limb 1 along +x."
        )
    shape = scene.robot.nodes()[nodes]
    (x, y), (a, b) = (places - places.mean(axis=0)).T, shape.T
    return float(np.arctan2(y @ a - x @ b, x @ a + y @ b))
