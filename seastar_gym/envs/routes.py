"""Kernels that measure routes to waypoints, robot by robot, for paths.py: distances, and where a route bends.

They take roots and lengths only. Angles are numpy's, whose last bit another library's would not have.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import entry_point, kernel

Floats: TypeAlias = NDArray[np.float64]

TOUCH_BISECTIONS = 12
"""Bisections of the arc on which a route touches a waypoint's circle: its length errs by less than 1e-6 radii."""
DECIDED = 1e-12
"""Relative size of a slope from which on its sign is the same, whichever library computes the functions in it."""
STRAIGHT, UNDECIDED = -1.0, -2.0
"""In the place of the share of the arc at which a route bends: it does not, or only rounding decides where."""


@kernel
def distance_from_leg(x, y, start_x, start_y, end_x, end_y):
    """Distance of (x, y) from the segment between start and end, or from an end beyond it."""
    leg_x, leg_y, away_x, away_y = end_x - start_x, end_y - start_y, x - start_x, y - start_y
    leg_squared = leg_x * leg_x + leg_y * leg_y
    fraction = 0.0
    if leg_squared > 0.0:
        fraction = min(max((away_x * leg_x + away_y * leg_y) / leg_squared, 0.0), 1.0)
    return np.hypot(away_x - fraction * leg_x, away_y - fraction * leg_y)


@kernel
def share_of_arc(p_x, p_y, n_x, n_y, radius):
    """Share of the arc, from the direction of p to that of n, at which a route from p to n touches the circle.

    It is found by bisection, or is UNDECIDED.
    """
    if not radius > 0.0:  # the route bends at the centre
        return 0.5
    to_p, to_n = np.hypot(p_x, p_y), np.hypot(n_x, n_y)
    undecided = DECIDED * (to_p + radius) * (to_n + radius)
    # Directions that hold the touch between them, and the one that halves their angle.
    low_c, low_s, high_c, high_s = p_x / to_p, p_y / to_p, n_x / to_n, n_y / to_n
    turns = low_c * high_s - low_s * high_c
    share, half = 0.5, 0.25
    for _ in range(TOUCH_BISECTIONS - 1):
        c, s = low_c + high_c, low_s + high_s
        norm = np.sqrt(c * c + s * s)
        if not norm > 1e-3:  # p and n lie on opposite sides
            return UNDECIDED
        c, s = c / norm, s / norm
        x, y, next_x, next_y = p_x - radius * c, p_y - radius * s, n_x - radius * c, n_y - radius * s
        to_p, to_n = np.sqrt(x * x + y * y), np.sqrt(next_x * next_x + next_y * next_y)
        # Along the arc, the way from p grows by what that to n has to lose.
        grows = (p_x * s - p_y * c) * to_n + (n_x * s - n_y * c) * to_p
        if not abs(grows) > undecided:
            return UNDECIDED
        if (grows > 0.0) == (turns > 0.0):
            high_c, high_s = c, s
            share -= half
        else:
            low_c, low_s = c, s
            share += half
        half *= 0.5
    return share


@entry_point
def measure_routes(position, start, waypoint, after, radius, out):
    """Measure routes from positions past a waypoint to the one after it.

    position, start, waypoint, after: [m], shape (n, 2); the leg to the waypoint begins at `start`. radius: Of the
    circle about the waypoint that a route touches [m], shape (n,).
    out: Shape (8, n): x of position and of `after` from the waypoint [m], their y, the share of the arc at which the
    route bends, and lengths [m]: of the straight way to `after`, to the waypoint, and from the leg.
    """
    for k in range(len(radius)):
        x, y, w_x, w_y = position[k, 0], position[k, 1], waypoint[k, 0], waypoint[k, 1]
        after_x, after_y = after[k, 0], after[k, 1]
        p_x, p_y, n_x, n_y = x - w_x, y - w_y, after_x - w_x, after_y - w_y
        out[0, k], out[1, k], out[2, k], out[3, k] = p_x, n_x, p_y, n_y
        is_near = distance_from_leg(w_x, w_y, x, y, after_x, after_y) <= radius[k]
        out[4, k] = STRAIGHT if is_near else share_of_arc(p_x, p_y, n_x, n_y, radius[k])
        out[5, k] = np.hypot(n_x - p_x, n_y - p_y)
        out[6, k] = np.hypot(p_x, p_y)
        out[7, k] = distance_from_leg(x, y, start[k, 0], start[k, 1], w_x, w_y)


@entry_point
def find_bends(angles, measured, out):
    """Fill the angles at which routes touch their circles. angles: Directions of both ends, shape (2, n)."""
    for k in range(len(out)):
        begin, end = angles[0, k], angles[1, k]
        out[k] = begin + measured[4, k] * (np.remainder(end - begin + np.pi, 2.0 * np.pi) - np.pi)


@entry_point
def measure_bent(c, s, measured, radius, out):
    """Fill the lengths of the routes that touch their circles at these cosines and sines, and of the straight ones."""
    for k in range(len(out)):
        x, y = radius[k] * c[k], radius[k] * s[k]
        to_position = np.hypot(measured[0, k] - x, measured[2, k] - y)
        to_after = np.hypot(measured[1, k] - x, measured[3, k] - y)
        out[k] = measured[5, k] if measured[4, k] == STRAIGHT else to_position + to_after


def measured_routes(position: Floats, start: Floats, waypoint: Floats, after: Floats, radius: Floats) -> Floats:
    """What `measure_routes` finds, shape (8, n)."""
    out = np.empty((8, len(radius)))
    measure_routes(position, start, waypoint, after, radius, out)
    return out


def length_of_routes(measured: Floats, radius: Floats) -> Floats:
    """Lengths of routes [m], shape (n,). measured: As of `measured_routes`. radius: [m], shape (n,)."""
    share = measured[4]
    kinds = set(share.tolist())
    if kinds == {STRAIGHT}:
        return measured[5]
    angles, out = np.arctan2(measured[2:4], measured[:2]), np.empty(len(radius))
    if UNDECIDED in kinds:
        share[:] = np.where(share == UNDECIDED, _bisected(measured[:4], angles, radius), share)
    find_bends(angles, measured, out)
    measure_bent(np.cos(out), np.sin(out), measured, radius, out)
    return out


def _bisected(at: Floats, angles: Floats, radius: Floats) -> Floats:
    """Share of the arc at which a route touches the circle, where only rounding decides, as numpy rounds."""
    (p_x, n_x, p_y, n_y), (begin, end) = at, angles
    arc = np.remainder(end - begin + np.pi, 2.0 * np.pi) - np.pi
    lower, upper = np.zeros(len(arc)), np.ones(len(arc))
    for _ in range(TOUCH_BISECTIONS):
        middle = 0.5 * (lower + upper)
        c, s = np.cos(begin + middle * arc), np.sin(begin + middle * arc)
        to_p, to_n = np.hypot(p_x - radius * c, p_y - radius * s), np.hypot(n_x - radius * c, n_y - radius * s)
        slope = (p_x * s - p_y * c) * to_n * np.sign(arc) + (n_x * s - n_y * c) * to_p * np.sign(arc)
        lower, upper = np.where(slope > 0.0, lower, middle), np.where(slope > 0.0, middle, upper)
    return middle
