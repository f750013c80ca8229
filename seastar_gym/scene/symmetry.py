"""Turns and mirrors that leave a robot unchanged, found from its limbs, its body and where they are attached."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.body import GIVEN_DRAG, GIVEN_FLUID, Body
from seastar_gym.scene.limb import LimbShape

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
