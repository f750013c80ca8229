"""`Track`: points and orientations over time, as a tracker saw them, and as they are from a robot at rest.

Pixels become metres on the plane in which the robot swims by a homography. With pixels (u, v), v down, and metres
(x, y), y up, the homography H is a matrix with

    (x, y, 1) w = H (u, v, 1),    w = third entry of the right side.

A camera that looks straight down is a scale with y flipped. Lenses that distort are to be corrected before.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.files import UNITS, read_numbers, read_table
from seastar_gym.identify.measurement import LATEST, ORIENTATION, Measurement, pointer, write_trajectory
from seastar_gym.identify.search import require_rest
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_finite, require_flag, require_kind, require_number, require_within, shown

Floats = NDArray[np.float64]

FARTHEST = 1e6
"""Largest coordinate [m] or [pixel], and largest angle [rad], that can be."""
SINGULAR = 1e-9
"""Smallest eighth singular value of normalised equations for a homography, over the largest."""
NOT_SEEN = ("", "nan", "none", "na", "n/a", "null", "inf", "-inf")
"""Fields of a file of what was not seen."""
NODE = re.compile(r"hub|tip([1-9][0-9]{0,2})|[0-9]{1,5}")
"""Name of a node: the hub, the tip of a limb, or a number."""


@dataclass(frozen=True)
class Track:
    """What a tracker saw in n pictures. NaN stands for what it did not see.

    time: [s], shape (n,), increasing.
    points: Positions by name, each of shape (n, 2) [m], or in pixels, whose y points down.
    orientations: Orientations [rad] by name, each of shape (n,), of the points that have one: from x to y.
    in_pixels: Whether positions are in pixels.
    """

    time: Floats
    points: dict[str, Floats]
    orientations: dict[str, Floats]
    in_pixels: bool = False

    def __post_init__(self) -> None:
        if not len(self.time):
            raise ValueError("There are no pictures.")
        require_possible("the time", self.time, LATEST)
        if (wrong := np.diff(self.time) <= 0.0).any():
            k = int(wrong.argmax())
            before, after = self.time[k : k + 2]
            what = "give one line for every picture, of one robot" if before == after else "the clock went back"
            raise ValueError(f"Picture {k + 1} is of {before:.10g} s and picture {k + 2} of {after:.10g} s: {what}.")
        for name, places in self.points.items():
            require_possible(f"the place of {name}", places)
        for name, angles in self.orientations.items():
            require_possible(f"the orientation of {name}", angles)
            require_radians(name, angles)

    @classmethod
    def from_movement(
        cls, dataset: Any, individual: str | None = None, likelihood: float = 0.6, in_pixels: bool = True
    ) -> "Track":
        """Track of a dataset of poses of the package `movement`, which reads the files of many trackers.

        dataset: With `position` of the dimensions time, space, keypoint and individual, `confidence` if that is known,
            and times in seconds.
        individual: Name of one of several. likelihood: Points of a lower confidence were not seen.
        """
        require_within("likelihood", likelihood, 0.0, 1.0)
        require_flag("in_pixels", in_pixels)
        try:
            places = dataset["position"]
            names = {str(name).removesuffix("s"): name for name in places.dims}  # plural before version 0.17
            order = [names[name] for name in ("individual", "keypoint", "time", "space")]
            known, parts = ([str(text) for text in np.asarray(places.coords[name])] for name in order[:2])
            time = np.asarray(places.coords[names["time"]], dtype=float)
            in_seconds = dataset.attrs.get("time_unit", "seconds") == "seconds"
            x = np.asarray(places.transpose(*order), dtype=float)
            sure = np.full(x.shape[:3], np.nan)
            if "confidence" in dataset:
                sure = np.asarray(dataset["confidence"].transpose(*order[:3]), dtype=float)
        except (AttributeError, LookupError, TypeError, ValueError):
            raise ValueError(f"dataset must be one of poses, as movement has them, not {shown(dataset)}.") from None
        if not in_seconds:
            raise ValueError("The dataset's times are numbers of frames: load it with fps.")
        k = known.index(str(chosen_individual("The dataset", known, individual)))
        points = {part: likely(x[k, j, :, :2], sure[k, j], likelihood) for j, part in enumerate(parts)}
        return cls(time, points, {}, in_pixels)

    def mapped(self, matrix: Floats) -> "Track":
        """Track in metres, of one in pixels, by a homography of shape (3, 3)."""
        points = {name: mapped(matrix, places) for name, places in self.points.items()}
        turns = {name: turned(matrix, self.points[name], angles) for name, angles in self.orientations.items()}
        return replace(self, points=points, orientations=turns, in_pixels=False)

    def in_metres(self, metres_per_pixel: float | None = None, homography: str | Path | None = None) -> "Track":
        """Track in metres, of one in pixels.

        metres_per_pixel: Of a camera that looks straight down. homography: File with u,v,x,y of four points or more.
        """
        if not self.in_pixels:
            raise ValueError("The track is in metres, not in pixels: --unit px would say otherwise.")
        if metres_per_pixel is not None and homography is None:
            return self.mapped(scaled(metres_per_pixel))
        if homography is not None and metres_per_pixel is None:
            return self.mapped(read_homography(homography))
        raise ValueError("Pixels become metres by --metres-per-pixel or by --homography, not both.")

    def since(self, begin: float) -> "Track":
        """Track without the pictures before a time [s], which becomes time 0."""
        require_finite("begin", begin, "s")
        late = self.time >= begin
        if not late.any():
            raise ValueError(f"All pictures are from before {begin:.10g} s: the last one is of {self.time[-1]:.10g} s.")
        points = {name: places[late] for name, places in self.points.items()}
        turns = {name: angles[late] for name, angles in self.orientations.items()}
        return replace(self, time=self.time[late] - begin, points=points, orientations=turns)

    def seen(
        self, scene: Scene, nodes: Mapping[str, str | int] | None = None, rest: float = 0.0, aligned: bool = False
    ) -> "Seen":
        """What was seen of a scene's robot, in the frame in which it began, without the orientation if it has no body.

        nodes: Nodes of points by name: "hub", "tip1", "tip2", .., or a number. None: the only point is the hub.
        rest: Time for which the robot is at rest at the beginning [s]. aligned: The track is in that frame.
        """
        require_kind("scene", scene, Scene, "a Scene")
        require_number("rest", rest, "s", zero_allowed=True)
        require_flag("aligned", aligned)
        if self.in_pixels:
            raise ValueError("The track is in pixels: give --metres-per-pixel or --homography.")
        found = seen_nodes(self, numbered(nodes, self, scene))
        if not aligned:
            found = from_rest(found, self.time, rest, scene)
        still = np.zeros((1, scene.robot.n_limbs))
        measured = Measurement(self.time, found.positions, found.nodes, still, self.time[:1] + rest)
        if not aligned:
            off = require_rest(measured, at_nodes(scene, found.nodes), scene.robot.limb_length)
            found = found._replace(off=off)
        if found.nodes[-1] == ORIENTATION and not scene.robot.has_body:
            found = found._replace(positions=found.positions[:, :-1], nodes=found.nodes[:-1])
        return found

    def to_csv(self, file: str | Path, scene: Scene, **seen: Any) -> None:
        """Write a trajectory that `seastar identify` reads. scene, and more: As of `seen`."""
        found = self.seen(scene, **seen)
        write_trajectory(file, self.time, found.positions, found.nodes)


def likely(places: Floats, scores: Floats, least: float) -> Floats:
    """Places, shape (n, 2), without those of a lower score, shape (n,). Those without a score were seen."""
    return np.where((scores < least)[:, None], np.nan, places)


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
    """Positions [m] of nodes, shape (n, n_nodes_seen, 2), and their numbers, as those of a `Measurement`.

    off: Distance of the robot at rest from its shape, in the root mean square [m].
    """

    positions: Floats
    nodes: tuple[int, ...]
    off: float = math.nan


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


def numbered(nodes: Mapping[str, str | int] | None, track: Track, scene: Scene) -> dict[str, int]:
    """Numbers of the nodes of points, see `Track.seen`."""
    require_kind("nodes", nodes, Mapping | None, "a dict of nodes by the names of points, or None")
    if nodes is None:
        if len(track.points) != 1:
            raise ValueError(f"Say which points are which nodes, with --nodes: there are {', '.join(track.points)}.")
        return dict.fromkeys(track.points, 0)
    robot, found = scene.robot, {}
    for point, name in nodes.items():
        match = NODE.fullmatch(str(name))
        if match is None:
            raise ValueError(f"Nodes must be such as nose=hub, left=tip1 or left=11, not {point}={name}.")
        node = int(match[1]) * (robot.nodes_per_limb - 1) if match[1] else 0 if name == "hub" else int(name)
        if node >= robot.n_nodes:
            raise ValueError(f"{point}={name}: the robot has {robot.n_limbs} limbs and {robot.n_nodes} nodes.")
        found[point] = node
    return found


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


def at_nodes(scene: Scene, nodes: Sequence[int]) -> Floats:
    """Positions of nodes of a scene's robot at rest [m], shape (n_nodes_seen, 2)."""
    return np.array([pointer(np.zeros(())) if node == ORIENTATION else scene.robot.nodes()[node] for node in nodes])


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


def scaled(metres_per_pixel: float) -> Floats:
    """Homography of a camera that looks straight down, shape (3, 3)."""
    require_number("metres per pixel", metres_per_pixel, "m")
    return np.diag([metres_per_pixel, -metres_per_pixel, 1.0])


def homography(pixels: Floats, metres: Floats) -> Floats:
    """Homography that maps pixels to metres, both of shape (n, 2) with n of four or more; shape (3, 3).

    By the direct linear transformation with normalised coordinates (Hartley and Zisserman, Multiple View Geometry,
    algorithm 4.2); with more than four points it fits them in least squares of the equations.
    """
    if len(pixels) < 4:
        raise ValueError(f"A homography needs four points or more, not {len(pixels)}.")
    to_unit, from_unit = _normalised(pixels), np.linalg.inv(_normalised(metres))
    ones = np.ones((len(pixels), 1))
    p = np.hstack([pixels, ones]) @ to_unit.T
    x, y, _ = (np.hstack([metres, ones]) @ np.linalg.inv(from_unit).T).T
    none = np.zeros_like(p)
    equations = np.vstack([np.hstack([p, none, -x[:, None] * p]), np.hstack([none, p, -y[:, None] * p])])
    _, sizes, directions = np.linalg.svd(equations)
    if sizes[7] < SINGULAR * sizes[0]:
        raise ValueError("These points tell no homography: no three of four may be on one line.")
    found = from_unit @ directions[8].reshape(3, 3) @ to_unit
    return np.asarray(found / np.linalg.norm(found))


def _normalised(points: Floats) -> Floats:
    """Similarity that brings points, shape (n, 2), to mean zero and mean distance sqrt(2); shape (3, 3)."""
    middle = points.mean(axis=0)
    distance = np.hypot(*(points - middle).T).mean()
    if distance == 0.0:
        raise ValueError("These points tell no homography: they are all the same.")
    scale = np.sqrt(2.0) / distance
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])


def read_homography(file: str | Path) -> Floats:
    """Homography from a file of points, one line `u,v,x,y` for each [pixel, pixel, m, m]."""
    lengths = [{}, {}, UNITS["length"], UNITS["length"]]
    names = [name.split()[0].lower() for name in read_table(file)[0] if name.strip()]
    if sorted(names) == sorted("uvxy") and names != [*"uvxy"]:
        raise ValueError(f"{file}: columns must be u,v,x,y, in this order, not {','.join(names)}.")
    numbers = np.array(read_numbers(file, "a pixel u,v and its place x,y [m]", 4, units=lengths))
    try:
        if np.abs(numbers).max() > FARTHEST:
            raise ValueError(f"no pixel and no place is beyond {FARTHEST:g}.")
        return homography(numbers[:, :2], numbers[:, 2:])
    except ValueError as unfit:
        raise ValueError(f"{file}: {unfit}") from None


def mapped(matrix: Floats, points: Floats) -> Floats:
    """Points by a homography, shape (n, 2)."""
    found = np.hstack([points, np.ones((len(points), 1))]) @ matrix.T
    with np.errstate(all="ignore"):  # on the horizon a place is infinite, which no track takes
        return np.asarray(found[:, :2] / found[:, 2:])


def turned(matrix: Floats, points: Floats, angles: Floats) -> Floats:
    """Directions at points, shape (n, 2), by a homography; angles of shape (n,), before and after [rad].

    Before, angles are those of the axes u and v, after those of x and y: (cos, sin) is mapped by the derivative.
    """
    along = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1) @ matrix.T
    at = np.hstack([points, np.ones((len(points), 1))]) @ matrix.T
    direction = along[:, :2] * at[:, 2:] - at[:, :2] * along[:, 2:]  # times w^2
    return np.asarray(np.arctan2(direction[:, 1], direction[:, 0]))
