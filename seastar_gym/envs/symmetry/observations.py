"""Observations under the symmetry group: sectors of waypoints, and what a turned or mirrored robot sees."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.observation import layout
from seastar_gym.envs.own_numbers import HEADINGS, NO_MORE, OwnNumbers, Places, places_of
from seastar_gym.envs.symmetry.group import (
    Elements,
    Group,
    axis_of,
    is_mirror,
    limb_order,
    n_limbs_of,
    n_turns_of,
    read_only,
    require_group,
    require_mirror,
    turns,
)
from seastar_gym.scene.actuators.actuator import Mirror
from seastar_gym.scene.checks import as_array, require_flag, require_kind

BOUNDARY_WIDTH = 1e-6
"""Angle [rad] from a boundary between two sectors within which a waypoint lies on it. It is far above the rounding of
observations: not rounding, but the next waypoint chooses the sector of a robot that is aimed along a limb."""


def sectors(
    observations: NDArray[np.floating[Any]],
    group: Group,
    mirror: Mirror = (),
    with_headings: bool = False,
    own: OwnNumbers = NO_MORE,
) -> Elements:
    """Sectors of the current waypoints, 0 to 2 n_turns - 1, shape (...), in observations of shape (..., size).

    They begin at the mirror's line. A group of turns alone has even ones only, twice as wide, from the x axis on.

    A waypoint on a boundary belongs to the sector on the side of the next waypoint, and where that lies on the same
    line (or there is none) to the sector anti-clockwise of the boundary. A waypoint at the hub lies in sector 0.

    mirror: What a mirror does to the memory of a limb's actuator, see `memory_mirror`; () if actuators have none.
    with_headings: Whether headings are asked for. own: What the task shows of its own.
    """
    at = _places(observations, group, mirror, with_headings, own)
    waypoints = np.asarray(observations[..., at.waypoints], np.float64)
    current, towards_next = waypoints[..., :2], waypoints[..., 2:]
    axis, n_turns = axis_of(group), n_turns_of(group)
    per_sector = 2 if axis is None else 1
    width = per_sector * np.pi / n_turns
    current, towards_next = _from_axis(current, axis), _from_axis(towards_next, axis)
    angle = np.arctan2(current[..., 1], current[..., 0])
    boundary = np.rint(angle / width)  # the nearest one
    on_boundary = np.abs(angle - boundary * width) <= BOUNDARY_WIDTH
    c, s = np.cos(boundary * width), np.sin(boundary * width)
    aside = c * towards_next[..., 1] - s * towards_next[..., 0]
    next_is_right = aside < -BOUNDARY_WIDTH * np.hypot(towards_next[..., 0], towards_next[..., 1])
    sector = np.where(on_boundary, boundary - next_is_right, np.floor(angle / width))
    return per_sector * sector.astype(np.intp) % (2 * n_turns)


def _from_axis(vectors: NDArray[np.float64], axis: float | None) -> NDArray[np.float64]:
    """Vectors, shape (..., 2), in a frame whose x axis is the mirror's line."""
    if not axis:
        return vectors
    c, s = np.cos(axis), np.sin(axis)
    return np.asarray(vectors @ np.array([[c, -s], [s, c]]))


def _places(
    observations: NDArray[np.floating[Any]], group: Group, mirror: Mirror, with_headings: bool, own: OwnNumbers
) -> Places:
    """Places in observations, shape (..., size); ValueError if they are of a robot of other limbs."""
    n_limbs = n_limbs_of(group)
    at, size = places_of(n_limbs, len(mirror) * n_limbs, _all_own(with_headings, own)), observations.shape[-1]
    if size != at.size:
        raise ValueError(f"An observation of {size} numbers is not that of a robot of {n_limbs} limbs.")
    return at


def _all_own(with_headings: bool, own: OwnNumbers) -> OwnNumbers:
    """What a task shows of its own, asked headings first."""
    return own._replace(kinds=HEADINGS + own.kinds) if with_headings else own


@cache
def _vector_order(group: Group, with_stations: bool) -> NDArray[np.intp]:
    """Order of vectors, shape (2 n_turns, size/2): vector i after element g was vector order[g, i] before."""
    n_limbs, n_turns = n_limbs_of(group), n_turns_of(group)
    at = layout(n_limbs)
    n_others = (at.size - (at.hub_velocity.start if with_stations else at.waypoints.start)) // 2
    n_stations = at.velocities.start // 2 if with_stations else 0
    stations = np.arange(n_stations).reshape(n_limbs, -1)[limb_order(group)].reshape(2 * n_turns, n_stations)
    others = np.tile(2 * n_stations + np.arange(n_others), (2 * n_turns, 1))
    return read_only(np.concatenate([stations, n_stations + stations, others], axis=1))


def transform_observations(
    observations: NDArray[np.floating[Any]],
    elements: ArrayLike,
    group: Group,
    mirror: Mirror = (),
    with_headings: bool = False,
    own: OwnNumbers = NO_MORE,
) -> NDArray[np.floating[Any]]:
    """Observations of the robots carried by the elements: a fresh array of the same shape and type.

    mirror: What a mirror does to the memory of a limb's actuator, see `memory_mirror`; () if actuators have none.
    with_headings: Whether headings are asked for. own: What the task shows of its own.
    """
    observations, elements = np.asarray(observations), np.asarray(elements, dtype=np.intp)
    at = _places(observations, group, mirror, with_headings, own)
    own = _all_own(with_headings, own)
    order = _vector_order(group, own.with_stations)
    if not mirror and not own.kinds:
        return _transform_vectors(observations, elements, group, order)
    hub = at.stations_and_hub.stop
    vectors = np.concatenate([observations[..., at.stations_and_hub], observations[..., at.waypoints]], axis=-1)
    vectors = _transform_vectors(vectors, elements, group, order)
    remembered = _transform_memory(observations[..., at.actuators], elements, group, mirror)
    shown = _transform_own(observations[..., at.own], elements, group, own)
    return np.concatenate([vectors[..., :hub], remembered, shown, vectors[..., hub:]], axis=-1)


def _transform_own(
    numbers: NDArray[np.floating[Any]], elements: Elements, group: Group, own: OwnNumbers
) -> NDArray[np.floating[Any]]:
    """Numbers that the task shows of its own, shape (..., own.size)."""
    carried = numbers.copy()
    turns_at, at = own.places("turn"), np.array(own.places("vector"), np.intp)
    carried[..., turns_at] *= np.where(is_mirror(elements)[..., None], -1, 1).astype(numbers.dtype)
    if len(at):
        pairs = np.stack([numbers[..., at], numbers[..., at + 1]], axis=-1).reshape(*numbers.shape[:-1], -1)
        unmoved = np.tile(np.arange(len(at)), (2 * n_turns_of(group), 1))
        pairs = _transform_vectors(pairs, elements, group, unmoved)
        carried[..., at], carried[..., at + 1] = pairs[..., ::2], pairs[..., 1::2]
    return carried


def _transform_memory(
    remembered: NDArray[np.floating[Any]], elements: Elements, group: Group, mirror: Mirror
) -> NDArray[np.floating[Any]]:
    """Memory of actuators, shape (..., n_limbs len(mirror)), moved with the limbs and mirrored where the robots are."""
    if not mirror:
        return remembered
    of_limbs = remembered.reshape(*remembered.shape[:-1], n_limbs_of(group), len(mirror))
    of_limbs = np.take_along_axis(of_limbs, limb_order(group)[elements][..., None], axis=-2)
    index, sign = np.array(mirror, dtype=int).T
    swapped = of_limbs[..., index] * sign.astype(remembered.dtype)
    return np.where(is_mirror(elements)[..., None, None], swapped, of_limbs).reshape(remembered.shape)


def _transform_vectors(
    observations: NDArray[np.floating[Any]], elements: Elements, group: Group, order: NDArray[np.intp]
) -> NDArray[np.floating[Any]]:
    """Pairs of numbers, turned, mirrored and moved with their limbs by an `order` like that of `_vector_order`."""
    as_vectors = np.result_type(observations, np.complex64)  # pairs of numbers as x + iy
    vectors = np.ascontiguousarray(observations).view(as_vectors)
    vectors = np.take_along_axis(vectors, order[elements], axis=-1)
    vectors *= turns(group)[elements][..., None].astype(as_vectors)
    np.conjugate(vectors, out=vectors, where=is_mirror(elements)[..., None])
    axis = axis_of(group)
    if axis:
        vectors *= np.where(is_mirror(elements), np.exp(2j * axis), 1.0)[..., None].astype(as_vectors)
    return vectors.view(observations.dtype)


def reduce_observations(
    observations: NDArray[np.floating[Any]],
    group: Group,
    mirror: Mirror = (),
    with_headings: bool = False,
    own: OwnNumbers = NO_MORE,
) -> tuple[NDArray[np.floating[Any]], Elements]:
    """Observations with the current waypoint brought into sector 0, and the elements that did it.

    mirror: What a mirror does to the memory of a limb's actuator, see `memory_mirror`; () if actuators have none.
    with_headings: Whether headings are asked for. own: What the task shows of its own.
    """
    require_group(group)
    require_mirror(mirror)
    require_flag("with_headings", with_headings)
    require_kind("own", own, OwnNumbers, "OwnNumbers")
    observations = as_array("observations", observations)
    if observations.dtype.kind != "f" or not observations.ndim:
        raise ValueError(f"Observations must be floats, of shape (..., size), not {observations.dtype} values.")
    elements = sectors(observations, group, mirror, with_headings, own)
    return transform_observations(observations, elements, group, mirror, with_headings, own), elements
