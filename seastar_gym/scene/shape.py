"""Shape of a robot at rest: places of its nodes, what touches, and the turns and mirrors that leave it unchanged."""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.body import GIVEN_DRAG, GIVEN_FLUID, Body, Outline
from seastar_gym.scene.limb import LimbShape

Floats = NDArray[np.float64]


def rest_positions(limbs: Sequence[LimbShape], nodes_per_limb: int, tangent: bool) -> Floats:
    """Node positions of the undeformed robot [m], shape (n_nodes, 2): hub at the origin, limb after limb.

    Edges of a limb have equal lengths and turn by its natural curvature times that length, so its nodes lie on an arc.

    tangent: Whether a limb's direction is that of the arc at the hub, rather than that of its root edge.
    """
    i = np.arange(1, nodes_per_limb)
    nodes = [np.zeros((1, 2))]
    for limb in limbs:
        half_turn = 0.5 * turn_per_hinge(limb, nodes_per_limb)
        # Length of the sum of i unit vectors, each turned from the last by twice half_turn, over i.
        chord = np.sin(i * half_turn) / (i * np.sin(half_turn)) if half_turn else 1.0
        distance = limb.length * i / (nodes_per_limb - 1) * chord
        angle = limb.direction + (i if tangent else i - 1) * half_turn
        x, y = limb.root
        nodes.append(np.stack([x + distance * np.cos(angle), y + distance * np.sin(angle)], axis=1))
    return np.concatenate(nodes)


def turn_per_hinge(limb: LimbShape, nodes_per_limb: int) -> float:
    """Natural angle of the hinges within a limb [rad]."""
    return limb.natural_curvature * limb.length / (nodes_per_limb - 1)


def natural_hub_angle(gap: float, hub_hinge: str) -> float:
    """Natural angle of an unactuated hub hinge [rad], from -pi to pi.

    gap: Angle between the two limbs [rad]. hub_hinge: Measure of the hinge, see `Seastar`.
    """
    if hub_hinge == "turning":
        return gap - np.pi
    return gap if gap <= np.pi else gap - 2.0 * np.pi


def n_hub_hinges(n_limbs: int) -> int:
    """Number of hub hinges: one between neighbouring limbs, and one in all for two limbs."""
    return n_limbs if n_limbs > 2 else n_limbs - 1


def limbs_that_may_touch(gaps: Sequence[float], alike: bool) -> list[tuple[int, int]]:
    """Pairs of limbs (right, left) less than half a turn apart: neighbours, or all such pairs if lengths differ.

    gaps: Angle from every limb to the next [rad]. alike: Whether limbs have equal lengths, so that none can reach over
        another.
    """
    n_limbs = len(gaps)
    turns = {
        (first, (first + steps) % n_limbs): sum(gaps[(first + k) % n_limbs] for k in range(steps))
        for first, steps in itertools.product(range(n_limbs), range(1, 2 if alike else n_limbs))
    }
    return [pair for pair, turn in turns.items() if pair[0] != pair[1] and turn < np.pi * (1.0 - 1e-9)]


def cross_at_rest(nodes: Floats, n_limbs: int, pairs: Sequence[tuple[int, int]]) -> bool:
    """Whether limbs of any of the pairs cross. nodes: Node positions [m], shape (n_nodes, 2)."""
    limbs = [np.concatenate([nodes[:1], limb]) for limb in nodes[1:].reshape(n_limbs, -1, 2)]
    return any(lines_cross(limbs[right], limbs[left]) for right, left in pairs)


def lines_cross(line: Floats, other: Floats) -> bool:
    """Whether two lines of edges cross, each with its corners, shape (n, 2)."""

    def cross(a: Floats, b: Floats) -> Floats:
        return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

    f, tails = np.diff(other, axis=0), other[:-1]
    for tail, e in zip(line[:-1], np.diff(line, axis=0), strict=True):
        of_e, of_f = cross(e, f) * cross(tails - tail, f), cross(e, f) * cross(tails - tail, e)
        if ((of_e > 0.0) & (of_f > 0.0) & (np.maximum(of_e, of_f) < cross(e, f) ** 2)).any():
            return True
    return False


FEW, MANY = 12, 60
"""Nodes of a limb that are looked at: limbs at rest are arcs."""
WEIGHTLESS = 1.0
"""Density of limbs [kg/m^3], which says nothing of where they touch."""
CLOSE = 1e-3, 1e-2, 0.1
"""Shares of the first edge that are looked at, too: an edge may begin within a flat body and end beyond it."""


def touching_at_rest(
    limbs: Sequence[LimbShape],
    nodes_per_limb: int,
    pairs: Sequence[tuple[int, int]],
    outline: Outline,
    opening_angle: float,
) -> str | None:
    """What touches at rest, in words, or None.

    limbs: Limbs on a body. pairs: Those that may touch each other. outline: Of the body. opening_angle: Of the cones
    in which limbs begin, see `Contact` [rad]; they are looked at, so that no touch at rest is missed.
    """
    n = min(max(nodes_per_limb, FEW), MANY)
    share = np.arange(n) / (n - 1)
    nodes = rest_positions(limbs, n, tangent=True)[1:].reshape(len(limbs), n - 1, 2)
    places = [np.concatenate([[limb.root], own]) for limb, own in zip(limbs, nodes, strict=True)]
    thickness = [
        np.minimum([cut.reach for cut in limb.cuts(WEIGHTLESS, share)], 0.5 * opening_angle * limb.length * share)
        for limb in limbs
    ]
    for limb, (own, thick) in enumerate(zip(places, thickness, strict=True)):
        near = np.array(CLOSE)[:, None]
        close, thin = own[0] + near * (own[1] - own[0]), near[:, 0] * thick[1]
        heights = outline.height_over(np.concatenate([close, own[1:]])) if outline.reach else np.full(1, np.inf)
        if (heights < np.concatenate([thin, thick[1:]])).any():
            return f"limb {limb + 1} touches the body"
    for one, other in pairs:
        near_each_other = any(
            _too_near(places[i][1:], thickness[i][1:], places[j], thickness[j]) for i, j in ((one, other), (other, one))
        )
        if near_each_other or lines_cross(places[one], places[other]):
            return f"limbs {one + 1} and {other + 1} touch each other"
    return None


def _too_near(points: Floats, thick: Floats, line: Floats, line_thick: Floats) -> bool:
    """Whether points are nearer to a line of edges than both are thick."""
    edges = np.diff(line, axis=0)
    from_tails = points[:, None] - line[:-1]
    s = np.clip((from_tails * edges).sum(axis=-1) / (edges * edges).sum(axis=-1), 0.0, 1.0)
    distance = np.linalg.norm(from_tails - s[..., None] * edges, axis=-1)
    return bool((distance < thick[:, None] + (1.0 - s) * line_thick[:-1] + s * line_thick[1:]).any())


Complexes = NDArray[np.complex128]

SAME = 1e-9
"""Distance of places, in metres, and of unit vectors that are taken for one."""


class PointGroup(NamedTuple):
    """Turns and mirrors that leave a robot unchanged.

    Element 2k turns by -2 pi k/n_turns; element 2k - 1 does so, too, and then mirrors at the axis; k = 1..n_turns.

    n_turns: Number of turns, with that by nothing. axis: Direction of the mirror's line [rad], from 0 to below
    pi/n_turns; None without mirrors, and there are even elements only.
    orders: Row g, entry j: which limb the limb j of a robot carried by element g was; 2 n_turns rows.
    """

    n_turns: int
    axis: float | None
    orders: tuple[tuple[int, ...], ...]

    @property
    def is_trivial(self) -> bool:
        """Whether nothing but the turn by nothing leaves the robot unchanged."""
        return self.n_turns == 1 and self.axis is None

    @property
    def is_whole(self) -> bool:
        """Whether turns by one limb and a mirror at limb 1 leave the robot unchanged."""
        n = len(self.orders[0])
        in_order = tuple((j - 1) % n for j in range(n)), tuple(-j % n for j in range(n))
        return self.n_turns == n and self.axis == 0.0 and self.orders[-2:] == in_order


class _Map(NamedTuple):
    """A turn z -> factor z, or a mirror z -> factor conj(z), of places x + iy."""

    factor: complex
    mirrors: bool

    def of(self, z: Complexes) -> Complexes:
        return np.asarray(self.factor * (z.conj() if self.mirrors else z))


def point_group(robots: Sequence[Sequence[LimbShape]], body: Body | None, directed: bool = False) -> PointGroup:
    """Turns and mirrors that leave all robots of a batch unchanged.

    robots: Limbs of every robot, whose directions and roots are the same. directed: Whether the body feels flow along
    x and along y differently, whatever its outline is.
    """
    limbs = _limbs(robots)
    angles = np.array([limb.direction for limb in robots[0]])
    turns = [_Map(complex(np.exp(1j * (angle - angles[0]))), False) for angle in angles]
    mirrors = [_Map(complex(np.exp(1j * (angle + angles[0]))), True) for angle in angles]
    kept = [element for element in _distinct(turns) if _limb_order(limbs, body, directed, element) is not None]
    axes = [
        0.5 * np.angle(element.factor) for element in mirrors if _limb_order(limbs, body, directed, element) is not None
    ]
    n_turns = len(kept)
    width = np.pi / n_turns
    axis = min((float((one + SAME) % width) - SAME for one in axes), default=None)
    if axis is not None and axis < 2.0 * SAME:
        axis = 0.0
    orders = [_limb_order(limbs, body, directed, _element(g, n_turns, axis)) for g in range(2 * n_turns)]
    assert None not in orders
    return PointGroup(n_turns, axis, tuple(order for order in orders if order is not None))


def _element(g: int, n_turns: int, axis: float | None) -> _Map:
    """Element g of a group; that by nothing where an odd one would have to mirror and there are no mirrors."""
    turn = complex(np.exp(-2j * np.pi * ((g + 1) // 2) / n_turns))
    if g % 2 == 0:
        return _Map(turn, False)
    return _Map(1.0, False) if axis is None else _Map(complex(np.exp(2j * axis)) * turn.conjugate(), True)


def _distinct(maps: Sequence[_Map]) -> list[_Map]:
    found: list[_Map] = []
    for one in maps:
        if all(abs(one.factor - other.factor) > SAME for other in found):
            found.append(one)
    return found


class _Limbs(NamedTuple):
    """Limbs of all robots: roots and directions as x + iy, natural curvatures robot by robot, and all else likewise."""

    roots: Complexes
    directions: Complexes
    bends: list[tuple[float, ...]]
    others: list[tuple[LimbShape, ...]]


def _limbs(robots: Sequence[Sequence[LimbShape]]) -> _Limbs:
    nowhere = {"direction": 0.0, "gap": 0.0, "root": (0.0, 0.0), "natural_curvature": 0.0}
    alike = list(zip(*robots, strict=True))
    return _Limbs(
        np.array([complex(*limb.root) for limb in robots[0]]),
        np.exp(1j * np.array([limb.direction for limb in robots[0]])),
        [tuple(limb.natural_curvature for limb in limbs) for limbs in alike],
        [tuple(limb._replace(**nowhere) for limb in limbs) for limbs in alike],
    )


def _limb_order(limbs: _Limbs, body: Body | None, directed: bool, element: _Map) -> tuple[int, ...] | None:
    """Which limb stands where each limb was once all are carried; None if that is not the robot as it was."""
    if body is not None and not _keeps_body(body, directed, element):
        return None
    carried, turned = element.of(limbs.roots), element.of(limbs.directions)
    bends = [tuple(-bend for bend in one) for one in limbs.bends] if element.mirrors else limbs.bends
    order: list[int] = []
    for j, (root, direction) in enumerate(zip(limbs.roots, limbs.directions, strict=True)):
        here = (np.abs(carried - root) < SAME) & (np.abs(turned - direction) < SAME)
        alike = [
            i
            for i in np.flatnonzero(here).tolist()
            if i not in order and bends[i] == limbs.bends[j] and limbs.others[i] == limbs.others[j]
        ]
        if not alike:
            return None
        order.append(alike[0])
    return tuple(order)


def _keeps_body(body: Body, directed: bool, element: _Map) -> bool:
    directed |= any(getattr(body, name) is not None for name in GIVEN_FLUID[:2] + GIVEN_DRAG[:2])
    if directed and abs(element.factor.imag) > SAME:
        return False
    centre = np.array([complex(*body.centre)])
    if np.abs(element.of(centre) - centre).max() > SAME:
        return False
    outline = np.array([complex(*point) for point in body.outline])
    distances = np.abs(element.of(outline)[:, None] - outline[None, :])
    return bool((distances.min(axis=1, initial=0.0 if not len(outline) else np.inf) < SAME).all())
