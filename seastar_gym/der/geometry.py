"""Edges of a planar rod and the angles between them."""

from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, select, sqrt, subtract_product

EDGE_ROWS = 7  # what edge_geometry returns


@kernel
def larger(a, b):
    return select(a > b, a, b)


@kernel
def edge_vector(q, tail, head):
    """e = x_head - x_tail [m]."""
    return load(q, 2 * head) - load(q, 2 * tail), load(q, 2 * head + 1) - load(q, 2 * tail + 1)


@kernel
def edge_geometry(q, tail, head):
    """(e_x, e_y, |e|, |e|^2, |u|^2, u_x, u_y) with u = e/|e|^2 [1/m], so that |u|^2 = 1/|e|^2.

    The gradient of the edge's direction angle theta is (-u_y, u_x), its Hessian
    [[2 u_x u_y, u_y^2 - u_x^2], [u_y^2 - u_x^2, -2 u_x u_y]].
    """
    ex, ey = edge_vector(q, tail, head)
    squared = add_product(ex * ex, ey, ey)
    inverse = 1.0 / squared
    return ex, ey, sqrt(squared), squared, inverse, ex * inverse, ey * inverse


@kernel
def half_angle(a, b, side):
    """t = tan(phi/2) of the angle phi from edge a to edge b (geometries), from (13.4) without trigonometry.

    side = -1 turns edge a round: the angle is then the interior turning angle at a hub whose edges both point out.
    """
    cross = subtract_product(a[0] * b[1], a[1], b[0])
    dot = add_product(a[0] * b[0], a[1], b[1])
    return side * cross / add_product(side * dot, a[2], b[2])


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
