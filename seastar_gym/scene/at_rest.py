"""What touches at rest, of limbs around a body: contact would push it apart for ever."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.body import Outline
from seastar_gym.scene.limb import LimbShape, lines_cross, rest_positions

Floats = NDArray[np.float64]

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
