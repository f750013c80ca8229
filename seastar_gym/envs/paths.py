"""Waypoint paths: where the hub is asked to swim, and how far it strays.

A path is an array of waypoints [m], shape (n, 2), that the hub visits in order. It starts from the origin, where the
hub rests after a reset; the origin is the start, not a waypoint, so a path that closes on itself ends with the waypoint
(0, 0).

A path of one's own needs no name: environments take arrays of waypoints. With a name it can be asked for by text:

    @register_path("zigzag")
    def zigzag(rng):
        return np.array([[0.1, 0.1], [0.2, 0.0], [0.3, 0.1]])

    env = gym.make("SeastarSwim-v0", path="zigzag")
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.routes import length_of_routes, measured_routes
from seastar_gym.files import UNITS, read_numbers
from seastar_gym.scene.checks import require_callable, require_few, require_kind, require_unmasked, shown

Floats: TypeAlias = NDArray[np.float64]
Waypoints: TypeAlias = Floats
MakePath: TypeAlias = Callable[[np.random.Generator], Waypoints]

PATHS: dict[str, MakePath] = {}
"""Functions that make the waypoints [m], shape (n, 2), of the named paths, see `register_path`."""

WAYPOINT_RADIUS = 0.01
"""Distance from a waypoint at which it counts as reached, unless an environment is told another [m]."""
PENTAGON_SIDE = 0.1437
"""Side [m] of the pentagon that the scripted gait (13.15) traces: 45 strokes, then 5 at rest, per side.

It is 0.1437 m at "reference" with 10 and with 37 nodes per limb, and 0.1436 m at "balanced".
"""
LINE_LENGTH = 0.3
"""Length of the path "line" [m]."""

FIGURE_EIGHT_WIDTH = 0.4
"""Width of the path "figure-eight" [m]."""
FIGURE_EIGHT_WAYPOINTS = 16

MOST_WAYPOINTS = 100_000
"""Most waypoints of a path."""
FARTHEST = 1e6
"""Largest coordinate of a waypoint [m], and largest radius: beyond it a stroke's progress is lost in rounding."""

RANDOM_WAYPOINTS = 5
RANDOM_LEG = (0.1, 0.2)
"""Shortest and longest leg [m] of a random path."""
RANDOM_TURN = np.radians(120.0)
"""Largest turn [rad], to either side, from one leg of a random path to the next; the first leg is turned from +x."""


def register_path(name: str) -> Callable[[MakePath], MakePath]:
    """Decorator that gives a path a name.

    The decorated function gets the episode's random generator and returns the waypoints [m], shape (n, 2). ValueError:
    another path has the name. The same function of a module, of its copy or of a notebook's cell, that runs again is
    taken instead.
    """

    if not isinstance(name, str) or not name:
        raise ValueError(f"The name of a path must be a text, not {shown(name)}.")

    def register(make: MakePath) -> MakePath:
        require_callable("A path", make)
        known = PATHS.get(name, make)
        is_same = _place(known) == _place(make) or _is_copy(known, make)
        if known is not make and (not is_same or "<lambda>" in _place(make)):
            raise ValueError(f"There is a path of the name {name!r} already: give this one another name.")
        PATHS[name] = make
        return make

    return register


def _is_copy(function: MakePath, other: MakePath) -> bool:
    """Whether functions are of the same name in files of the same content."""
    names, files = ({getattr(each, name, None) for each in (function, other)} for name in ("__qualname__", "__code__"))
    if len(names) > 1 or None in files:
        return False
    found = [Path(code.co_filename) for code in files if code is not None]
    return all(file.is_file() for file in found) and len({file.read_bytes() for file in found}) == 1


def _place(function: MakePath) -> str:
    """Module and name of a function, which it keeps when its module is loaded again."""
    return f"{getattr(function, '__module__', '')}.{getattr(function, '__qualname__', function)}"


def make_path(path: str | ArrayLike, rng: np.random.Generator) -> Waypoints:
    """Waypoints [m], shape (n, 2), a fresh array, of a path given by its name or as an array of waypoints [m].

    rng: Generator of paths that are drawn, such as "random". ValueError: the name is unknown, or the array is not one
    or more finite points of the plane.

    >>> make_path("square", np.random.default_rng(0))
    array([[0.2, 0. ],
           [0.2, 0.2],
           [0. , 0.2],
           [0. , 0. ]])
    """
    require_kind("rng", rng, np.random.Generator, "a numpy Generator")
    if not isinstance(path, str):
        return _checked_waypoints(path)
    if path not in PATHS:
        known = ", ".join(PATHS)
        raise ValueError(f"Unknown path {shown(path)}: choose one of {known}, or give an array of waypoints.")
    return _checked_waypoints(PATHS[path](rng))


@register_path("pentagon")
def pentagon(rng: np.random.Generator) -> Waypoints:
    """Regular pentagon, anti-clockwise; the path of the chapter's scripted gait (13.15)."""
    return _regular_polygon(5, PENTAGON_SIDE)


@register_path("square")
def square(rng: np.random.Generator) -> Waypoints:
    """Square with sides of 0.2 m, anti-clockwise."""
    return _regular_polygon(4, 0.2)


@register_path("triangle")
def triangle(rng: np.random.Generator) -> Waypoints:
    """Equilateral triangle with sides of 0.25 m, anti-clockwise."""
    return _regular_polygon(3, 0.25)


@register_path("line")
def line(rng: np.random.Generator) -> Waypoints:
    """One waypoint on the x axis."""
    return np.array([[LINE_LENGTH, 0.0]])


@register_path("figure-eight")
def figure_eight(rng: np.random.Generator) -> Waypoints:
    """Gerono's lemniscate, from its crossing at the origin through both loops and back."""
    n = FIGURE_EIGHT_WAYPOINTS
    t = 2.0 * np.pi * np.arange(1, n + 1) / n
    waypoints = FIGURE_EIGHT_WIDTH / 2.0 * np.column_stack([np.sin(t), np.sin(t) * np.cos(t)])
    waypoints[[n // 2 - 1, -1]] = 0.0  # the crossing, exactly
    return waypoints


@register_path("random")
def random(rng: np.random.Generator) -> Waypoints:
    """Walk of RANDOM_WAYPOINTS legs, with lengths and turns drawn anew for every episode."""
    legs = rng.uniform(*RANDOM_LEG, size=RANDOM_WAYPOINTS)
    turns = rng.uniform(-RANDOM_TURN, RANDOM_TURN, size=RANDOM_WAYPOINTS)
    return _walk(legs, np.cumsum(turns))


def cross_track_error(position: ArrayLike, start: ArrayLike, end: ArrayLike) -> NDArray[np.float64]:
    """Distance [m], shape (...), of a position from the segment between start and end [m], each of shape (..., 2).

    Beyond an end of the segment, or where the segment is a single point, it is the distance from that end.

    >>> float(cross_track_error([0.1, 0.03], [0.0, 0.0], [0.2, 0.0]))
    0.03
    """
    shape, measured, _ = _measured(position, start, end, end, np.inf)
    return measured[7].reshape(shape)


def path_length(start: ArrayLike, waypoints: ArrayLike) -> NDArray[np.float64]:
    """Length [m], shape (...), of the path from start [m], shape (..., 2), through waypoints [m], shape (..., n, 2).

    >>> round(float(path_length([0.0, 0.0], make_path("square", np.random.default_rng(0)))), 3)
    0.8
    """
    start, waypoints = np.asarray(start, dtype=np.float64), np.asarray(waypoints, dtype=np.float64)
    first_leg = waypoints[..., 0, :] - start
    later_legs = np.diff(waypoints, axis=-2)
    lengths: NDArray[np.float64] = np.hypot(first_leg[..., 0], first_leg[..., 1])
    lengths = lengths + np.hypot(later_legs[..., 0], later_legs[..., 1]).sum(axis=-1)
    return lengths


def shortest_way(position: ArrayLike, waypoint: ArrayLike, after: ArrayLike, radius: ArrayLike) -> NDArray[np.float64]:
    """Length [m], shape (...), of the shortest route from position to `after` that comes within `radius` of waypoint.

    position, waypoint, after: Points [m], shape (..., 2). radius: [m], shape (...), or one number. The route
    is straight where a straight line comes near enough, and so wherever `after` equals waypoint. Otherwise it touches
    the circle where it is reflected, at an angle between those of position and `after` that is found by bisection.
    """
    shape, measured, radii = _measured(position, waypoint, waypoint, after, radius)
    return length_of_routes(measured, radii).reshape(shape)


def _measured(*points_and_radius: ArrayLike) -> tuple[tuple[int, ...], Floats, Floats]:
    """The shape (...) of four points (..., 2) and a radius, what `measured_routes` finds of them, and all radii."""
    *points, radius = (np.asarray(each, dtype=np.float64) for each in points_and_radius)
    if any(each.shape != points[0].shape for each in points):
        points = list(np.broadcast_arrays(*points))
    shape = points[0].shape[:-1]
    rows = [np.ascontiguousarray(point).reshape(-1, 2) for point in points]
    radii = (np.zeros(shape) + radius).reshape(-1)
    return shape, measured_routes(rows[0], rows[1], rows[2], rows[3], radii), radii


def _checked_waypoints(path: ArrayLike) -> NDArray[np.float64]:
    require_few("A path", path, MOST_WAYPOINTS)
    require_unmasked("A path", path)
    try:
        waypoints = np.asarray(path)
    except ValueError as ragged:
        raise ValueError("A path must have shape (n, 2): one x and one y [m] for every waypoint.") from ragged
    if waypoints.size == 0:
        raise ValueError("A path needs at least one waypoint.")
    if waypoints.dtype.kind not in "iuf":
        raise ValueError(f"A path must be a name or an array of numbers [m], not {waypoints.dtype} values.")
    if waypoints.ndim != 2 or waypoints.shape[1] != 2:
        raise ValueError(f"A path must have shape (n, 2), x and y [m] of every waypoint, not {waypoints.shape}.")
    if not np.isfinite(waypoints).all():
        raise ValueError("Every waypoint of a path must be finite: this one has NaN or infinite coordinates.")
    waypoints = waypoints.astype(np.float64)
    if np.abs(waypoints).max() > FARTHEST:
        raise ValueError(f"Every waypoint of a path must be within {FARTHEST:g} m of the start.")
    if not waypoints.any():
        raise ValueError("A path must lead away from the origin, where the robot starts: this one stays there.")
    if len(waypoints) > 1 and (waypoints == waypoints[0]).all():
        raise ValueError(f"All {len(waypoints)} waypoints of this path are the same point: give it once, or others.")
    return waypoints


def _regular_polygon(n_sides: int, side: float) -> Waypoints:
    """Corners [m], shape (n_sides, 2), from the second one to the origin again; the first side [m] lies along +x."""
    headings = 2.0 * np.pi / n_sides * np.arange(n_sides, dtype=np.float64)
    waypoints = _walk(np.full(n_sides, side), headings)
    waypoints[-1] = 0.0  # closes exactly, not to rounding
    return waypoints


def _walk(legs: NDArray[np.float64], headings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners [m], shape (n, 2), of a walk from the origin with legs [m] along headings [rad], shape (n,) each."""
    return np.cumsum(legs[:, None] * np.column_stack([np.cos(headings), np.sin(headings)]), axis=0)


# Paths that command lines ask for

PATHS_OF_PACKAGE = tuple(PATHS)
"""Names that need no code of somebody's."""
PATH_HELP = (
    f"Name of a path ({', '.join(PATHS)}), or a text file with x and y of one waypoint per line "
    "[m, unless the first line names a unit: x (mm)]."
)


def load_path(name: str) -> Any:
    """Name of a path, or waypoints [m], shape (n, 2), of a text file."""
    if name in PATHS or not Path(name).is_file():
        if Path(name).suffix and name not in PATHS:
            raise FileNotFoundError(f"There is no file {name}, nor a path of that name.")
        make_path(name, np.random.default_rng(0))
        return name
    waypoints = read_numbers(name, "x and y [m] of a waypoint", 2, MOST_WAYPOINTS, [UNITS["length"]] * 2)
    try:
        return make_path(waypoints, np.random.default_rng(0))
    except ValueError as bad:
        raise ValueError(f"{name}: {bad}") from bad
