"""Edges of a planar rod and the angles between them."""

from typing import Any, NamedTuple

from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, floor, load, select, sqrt, subtract_product

TWO_PI = 6.283185307179586


class Edge(NamedTuple):
    """Geometry of an edge e: its components and length |e| [m], |e|^2 [m^2], 1/|e|^2, and u = e/|e|^2 [1/m].

    The gradient of the edge's direction angle theta is (-u_y, u_x), its Hessian
    [[2 u_x u_y, u_y^2 - u_x^2], [u_y^2 - u_x^2, -2 u_x u_y]].
    """

    x: Any
    y: Any
    length: Any
    squared: Any
    inverse: Any
    ux: Any
    uy: Any


EDGE_ROWS = 7  # numbers of an Edge


@kernel
def larger(a, b):
    """The larger of two numbers."""
    return select(a > b, a, b)


@kernel
def positive_part(x):
    """x where it is positive, else 0."""
    return select(x > 0.0, x, 0.0)


@kernel
def convex_part(convex, x):
    """A second slope, of which robots in the mask `convex` (None for none) take the positive part."""
    return select(convex, positive_part(x), x)


@kernel
def edge_vector(q, tail, head):
    """e = x_head - x_tail [m]."""
    return load(q, 2 * head) - load(q, 2 * tail), load(q, 2 * head + 1) - load(q, 2 * tail + 1)


@kernel
def edge_geometry(q, tail, head):
    """The Edge from node `tail` to node `head`."""
    ex, ey = edge_vector(q, tail, head)
    squared = add_product(ex * ex, ey, ey)
    inverse = 1.0 / squared
    return Edge(ex, ey, sqrt(squared), squared, inverse, ex * inverse, ey * inverse)


@kernel
def half_angle(a, b, side):
    """t = tan(phi/2) of the angle phi from edge a to edge b, from (13.4) without trigonometry.

    side = -1 turns edge a round: the angle is then the interior turning angle at a hub whose edges both point out.
    """
    cross = subtract_product(a.x * b.y, a.y, b.x)
    dot = add_product(a.x * b.x, a.y, b.y)
    return side * cross / add_product(side * dot, a.length, b.length)


@kernel
def tangent(x):
    """tan(x) for |x| < pi/2, to a few units in the last place: the rational approximation of Cephes at x/2."""
    u = 0.5 * x
    z = u * u
    p = (-1.30936939181383734205e4 * z + 1.15351664838587416140e6) * z - 1.79565251976484877988e7
    q = (z + 1.36812963470692954678e4) * z - 1.32089234440210967447e6
    q = (q * z + 2.50083801823357915839e7) * z - 5.38695755929454629881e7
    t = u + u * z * p / q
    return 2.0 * t / (1.0 - t * t)


@kernel
def rotation(angle):
    """(cos, sin) of any angle [rad]."""
    turns = floor(add_product(0.5, angle, 1.0 / TWO_PI))
    t = tangent(0.25 * subtract_product(angle, TWO_PI, turns))
    scale = 1.0 / add_product(1.0, t, t)
    c, s = subtract_product(1.0, t, t) * scale, 2.0 * t * scale
    return subtract_product(c * c, s, s), 2.0 * s * c
