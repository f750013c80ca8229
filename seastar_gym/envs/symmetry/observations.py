"""Observations under the symmetry group: sectors of waypoints, and what a turned or mirrored robot sees."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.observation import Layout, layout
from seastar_gym.envs.symmetry.group import (
    Elements,
    Group,
    axis_of,
    is_mirror,
    limb_order,
    n_limbs_of,
    n_turns_of,
    read_only,
    turns,
)
from seastar_gym.scene.actuators.heating import Mirror

BOUNDARY_WIDTH = 1e-6
"""Angle [rad] from a boundary between two sectors within which a waypoint lies on it. It is far above the rounding of
observations: not rounding, but the next waypoint chooses the sector of a robot that is aimed along a limb."""


def sectors(
    observations: NDArray[np.floating[Any]], group: Group, mirror: Mirror = (), with_headings: bool = False
) -> Elements:
    """Sectors of the current waypoints, 0 to 2 n_turns - 1, shape (...), in observations of shape (..., size).

    They begin at the mirror's line. A group of turns alone has even ones only, twice as wide, from the x axis on.

    A waypoint on a boundary belongs to the sector on the side of the next waypoint, and where that lies on the same
    line (or there is none) to the sector anti-clockwise of the boundary. A waypoint at the hub lies in sector 0.

    mirror: What a mirror does to the memory of a limb's actuator, see `memory_mirror`; () if actuators have none.
    with_headings: Whether headings are asked for.
    """
    at = _layout(observations, group, mirror, with_headings)
    current = np.asarray(observations[..., at.current_waypoint], np.float64)
    towards_next = np.asarray(observations[..., at.next_waypoint], np.float64)
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


def _layout(observations: NDArray[np.floating[Any]], group: Group, mirror: Mirror, with_headings: bool) -> Layout:
    """Layout of observations, shape (..., size); ValueError if they are of a robot of other limbs."""
    n_limbs = n_limbs_of(group)
    at, size = layout(n_limbs, len(mirror) * n_limbs, with_headings), observations.shape[-1]
    if size != at.size:
        raise ValueError(f"An observation of {size} numbers is not that of a robot of {n_limbs} limbs.")
    return at


@cache
def _vector_order(group: Group) -> NDArray[np.intp]:
    """Order of vectors, shape (2 n_turns, size/2): vector i after element g was vector order[g, i] before."""
    n_limbs, n_turns = n_limbs_of(group), n_turns_of(group)
    at = layout(n_limbs)
    n_stations = at.velocities.start // 2
    stations = np.arange(n_stations).reshape(n_limbs, -1)[limb_order(group)].reshape(-1, n_stations)
    others = np.tile(np.arange(at.hub_velocity.start // 2, at.size // 2), (2 * n_turns, 1))
    return read_only(np.concatenate([stations, n_stations + stations, others], axis=1))


def transform_observations(
    observations: NDArray[np.floating[Any]],
    elements: ArrayLike,
    group: Group,
    mirror: Mirror = (),
    with_headings: bool = False,
) -> NDArray[np.floating[Any]]:
    """Observations of the robots carried by the elements: a fresh array of the same shape and type.

    mirror: What a mirror does to the memory of a limb's actuator, see `memory_mirror`; () if actuators have none.
    with_headings: Whether headings are asked for.
    """
    observations, elements = np.asarray(observations), np.asarray(elements, dtype=np.intp)
    at = _layout(observations, group, mirror, with_headings)
    if not mirror and not with_headings:
        return _transform_vectors(observations, elements, group)
    hub = at.hub_velocity.stop
    vectors = np.concatenate([observations[..., at.stations_and_hub], observations[..., at.waypoints]], axis=-1)
    vectors = _transform_vectors(vectors, elements, group)
    remembered = _transform_memory(observations[..., at.actuators], elements, group, mirror)
    asked = _transform_headings(observations[..., at.headings], elements)
    return np.concatenate([vectors[..., :hub], remembered, asked, vectors[..., hub:]], axis=-1)


def _transform_headings(asked: NDArray[np.floating[Any]], elements: Elements) -> NDArray[np.floating[Any]]:
    """Cosines and sines of turns that are asked for, shape (..., 4): the same for all limbs, reversed by a mirror."""
    signs = np.where(is_mirror(elements)[..., None], np.tile([1, -1], asked.shape[-1] // 2), 1)
    return asked * signs.astype(asked.dtype)


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
    observations: NDArray[np.floating[Any]], elements: Elements, group: Group
) -> NDArray[np.floating[Any]]:
    """Pairs of numbers of observations without memory, turned, mirrored and moved with their limbs."""
    as_vectors = np.result_type(observations, np.complex64)  # pairs of numbers as x + iy
    vectors = np.ascontiguousarray(observations).view(as_vectors)
    vectors = np.take_along_axis(vectors, _vector_order(group)[elements], axis=-1)
    vectors *= turns(group)[elements][..., None].astype(as_vectors)
    np.conjugate(vectors, out=vectors, where=is_mirror(elements)[..., None])
    axis = axis_of(group)
    if axis:
        vectors *= np.where(is_mirror(elements), np.exp(2j * axis), 1.0)[..., None].astype(as_vectors)
    return vectors.view(observations.dtype)


def reduce_observations(
    observations: NDArray[np.floating[Any]], group: Group, mirror: Mirror = (), with_headings: bool = False
) -> tuple[NDArray[np.floating[Any]], Elements]:
    """Observations with the current waypoint brought into sector 0, and the elements that did it.

    mirror: What a mirror does to the memory of a limb's actuator, see `memory_mirror`; () if actuators have none.
    with_headings: Whether headings are asked for.
    """
    elements = sectors(observations, group, mirror, with_headings)
    return transform_observations(observations, elements, group, mirror, with_headings), elements
