"""Symmetric linear systems on a star of chains, in O(N): each limb is eliminated from tip to root, then the root
nodes and the hub are solved as one dense system, then the limbs are substituted from root to tip.

A node i of a limb couples with nodes i - 1 and i - 2 only. Its two rows are

    [D_i  B_i  C_i | r_i],    D_i symmetric 2 x 2, B_i and C_i 2 x 2 with nodes i - 1 and i - 2,

and elimination by the pivots d_x = D_xx, d_y = D_yy - D_xy^2/d_x (L D L^T, no square roots) leaves eleven rows per
node: l = D_xy/d_x, the columns of L of both pivots (four each), and z = (r_x/d_x, r_y'/d_y).

The dense system orders root nodes 1..n_limbs, then the hub; its lower triangle is stored row by row.
"""

from seastar_gym.der.compilation import kernel
from seastar_gym.der.lanes import add_product, load, select, splat, store, subtract_product


@kernel
def smaller(a, b):
    """The smaller of two numbers, NaN if b is NaN: a pivot that is not a number must not pass for a good one."""
    return select(a < b, a, b)


@kernel
def eliminate_node(work, node, D, B, C, r):
    """Eliminate a node; returns what its Schur complement takes away from the nodes before it.

    Returns (D', B', D'', r', r'', decrement, pivot): D' (xx, xy, yy) and r' (x, y) of node i - 1, B' (row by row)
    between i - 1 and i - 2, D'' and r'' of node i - 2; the node's part r^T D^-1 r of the Newton decrement; and the
    smaller pivot.
    """
    Dxx, Dxy, Dyy = D
    Bxx, Bxy, Byx, Byy = B
    Cxx, Cxy, Cyx, Cyy = C
    rx, ry = r
    ix = 1.0 / Dxx
    l = Dxy * ix  # noqa: E741 - L's usual name
    dy = subtract_product(Dyy, l, Dxy)
    iy = 1.0 / dy
    # The second row after the first pivot.
    wa, wb = subtract_product(Byx, l, Bxx), subtract_product(Byy, l, Bxy)
    wc, wd = subtract_product(Cyx, l, Cxx), subtract_product(Cyy, l, Cxy)
    wr = subtract_product(ry, l, rx)
    xa, xb, xc, xd = Bxx * ix, Bxy * ix, Cxx * ix, Cxy * ix
    ya, yb, yc, yd = wa * iy, wb * iy, wc * iy, wd * iy
    row = 11 * node
    store(work.factors, row, l)
    store(work.factors, row + 1, xa)
    store(work.factors, row + 2, xb)
    store(work.factors, row + 3, xc)
    store(work.factors, row + 4, xd)
    store(work.factors, row + 5, ya)
    store(work.factors, row + 6, yb)
    store(work.factors, row + 7, yc)
    store(work.factors, row + 8, yd)
    zx, zy = rx * ix, wr * iy
    store(work.factors, row + 9, zx)
    store(work.factors, row + 10, zy)
    return (
        (
            add_product(ya * wa, xa, Bxx),
            add_product(ya * wb, xa, Bxy),
            add_product(yb * wb, xb, Bxy),
        ),
        (
            add_product(ya * wc, xa, Cxx),
            add_product(ya * wd, xa, Cxy),
            add_product(yb * wc, xb, Cxx),
            add_product(yb * wd, xb, Cxy),
        ),
        (
            add_product(yc * wc, xc, Cxx),
            add_product(yc * wd, xc, Cxy),
            add_product(yd * wd, xd, Cxy),
        ),
        (add_product(ya * wr, xa, rx), add_product(yb * wr, xb, rx)),
        (add_product(yc * wr, xc, rx), add_product(yd * wr, xd, rx)),
        add_product(zy * wr, zx, rx),
        smaller(Dxx, dy),
    )


@kernel
def substitute_limb(work, first, nodes_per_limb):
    """Solution of the nodes 2.. of a limb from those of its root node and the hub."""
    ax, ay = load(work.solution, 0), load(work.solution, 1)  # node i - 2
    bx, by = load(work.solution, 2 * (first + 1)), load(work.solution, 2 * (first + 1) + 1)  # node i - 1
    for i in range(2, nodes_per_limb):
        node = first + i
        row = 11 * node
        y = subtract_product(load(work.factors, row + 10), load(work.factors, row + 5), bx)
        y = subtract_product(y, load(work.factors, row + 6), by)
        y = subtract_product(y, load(work.factors, row + 7), ax)
        y = subtract_product(y, load(work.factors, row + 8), ay)
        x = subtract_product(load(work.factors, row + 9), load(work.factors, row + 1), bx)
        x = subtract_product(x, load(work.factors, row + 2), by)
        x = subtract_product(x, load(work.factors, row + 3), ax)
        x = subtract_product(x, load(work.factors, row + 4), ay)
        x = subtract_product(x, load(work.factors, row), y)
        store(work.solution, 2 * node, x)
        store(work.solution, 2 * node + 1, y)
        ax, ay, bx, by = bx, by, x, y


@kernel
def triangle_row(row, column):
    """Where the dense system keeps its entry (row, column), row >= column."""
    return row * (row + 1) // 2 + column


@kernel
def clear_roots(work, n):
    """Set the dense system of n rows to zero."""
    for k in range(triangle_row(n, 0)):
        store(work.roots, k, 0.0)
    for k in range(n):
        store(work.roots_rhs, k, 0.0)


@kernel
def add_to_rhs(work, block, rx, ry):
    """Add to the right-hand side of root node `block` (the hub: n_limbs)."""
    store(work.roots_rhs, 2 * block, load(work.roots_rhs, 2 * block) + rx)
    store(work.roots_rhs, 2 * block + 1, load(work.roots_rhs, 2 * block + 1) + ry)


@kernel
def _add(work, row, column, value):
    k = triangle_row(row, column)
    store(work.roots, k, load(work.roots, k) + value)


@kernel
def add_diagonal(work, block, D):
    """Add a symmetric 2 x 2 block (xx, xy, yy) to the diagonal of the dense system."""
    xx, xy, yy = D
    _add(work, 2 * block, 2 * block, xx)
    _add(work, 2 * block + 1, 2 * block, xy)
    _add(work, 2 * block + 1, 2 * block + 1, yy)


@kernel
def add_coupling(work, block, other, B):
    """Add a 2 x 2 block (xx, xy, yx, yy) that couples the rows of `block` with the columns of `other`."""
    xx, xy, yx, yy = B
    if block > other:
        _add(work, 2 * block, 2 * other, xx)
        _add(work, 2 * block, 2 * other + 1, xy)
        _add(work, 2 * block + 1, 2 * other, yx)
        _add(work, 2 * block + 1, 2 * other + 1, yy)
    else:
        _add(work, 2 * other, 2 * block, xx)
        _add(work, 2 * other + 1, 2 * block, xy)
        _add(work, 2 * other, 2 * block + 1, yx)
        _add(work, 2 * other + 1, 2 * block + 1, yy)


@kernel
def solve_roots(work, n):
    """Solve the dense system of n rows by L D L^T in place; the solution replaces roots_rhs.

    Returns its part of the Newton decrement and the smallest pivot.
    """
    decrement = splat(0.0)
    pivot = load(work.roots, 0)
    for k in range(n):
        d = load(work.roots, triangle_row(k, k))
        pivot = smaller(pivot, d)
        inverse = 1.0 / d
        z = load(work.roots_rhs, k)
        decrement = add_product(decrement, z * z, inverse)
        for row in range(k + 1, n):
            w = load(work.roots, triangle_row(row, k))
            factor = w * inverse
            for column in range(k + 1, row + 1):
                at = triangle_row(row, column)
                store(
                    work.roots,
                    at,
                    subtract_product(load(work.roots, at), factor, load(work.roots, triangle_row(column, k))),
                )
            store(work.roots_rhs, row, subtract_product(load(work.roots_rhs, row), factor, z))
        store(work.roots_rhs, k, z * inverse)
        store(work.roots, triangle_row(k, k), inverse)
    for k in range(n - 1, -1, -1):
        x = load(work.roots_rhs, k)
        total = splat(0.0)
        for row in range(k + 1, n):
            total = add_product(total, load(work.roots, triangle_row(row, k)), load(work.roots_rhs, row))
        store(work.roots_rhs, k, subtract_product(x, total, load(work.roots, triangle_row(k, k))))
    return decrement, pivot
