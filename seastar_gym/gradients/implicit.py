"""Swims with slopes: `advance_slopes` is `advance` of der/stepping/stroke.py on dual lanes, to the same bits.

A stage ends where the gradient g of Phi vanishes to Newton's tolerance. Slopes that were carried through Newton's steps
lag one step behind. So one more step is taken, with slopes alone, at the positions that Newton's method has found:

    slope of q  <-  slope of q - H^-1 (slope of g),    H the Hessian of Phi there,

which is the implicit function theorem. Positions keep their bits.
"""

from collections.abc import Callable

from numba.core import config

from seastar_gym.der.body.body import place_roots
from seastar_gym.der.contact.coupled import solve_again_coupled
from seastar_gym.der.linear.star_solution import substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.der.stepping.momentum import correct_momentum
from seastar_gym.der.stepping.stroke import advance
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.dual_lanes import duals, slope_of, with_slope
from seastar_gym.simd.lanes import Form, load, select, store


@kernel
def correct_slopes(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Settle the momentum, see momentum.py, and then the slopes of the robots in the mask, after stage k of a step."""
    correct_momentum(rods, work, scheme, k, stage, q_0, v_0, h, robots)
    factorise(rods, work, stage, None)
    substitute_star(rods, work, work.step)
    for row in range(2 * rods.n_free):
        store(work.step, row, slope_of(load(work.step, row)))
    solve_again_coupled(rods, work, work.step)
    for row in range(2 * rods.n_nodes):
        move_slope(work, row, load(work.step, row), robots)
    if rods.body is not None:
        row = 2 * rods.n_nodes
        move_slope(work, row, load(rods.body.scale, 0) * load(work.step, row), robots)
    place_roots(rods, work.q)


@kernel
def move_slope(work, row, move, robots):
    """Take the value of a move from the slope of a coordinate of the robots in the mask."""
    q = load(work.q, row)
    store(work.q, row, select(robots, with_slope(q, slope_of(q) - move), q))


DUAL = Form("dual", duals, instead={correct_momentum: correct_slopes})
"""Rows of N_LANES numbers and as many slopes. Where stages correct their momentum they correct their slopes as well."""


def advance_slopes() -> Callable[..., None]:
    """The entry point; its arguments are those of `advance`, with rows of 2 N_LANES numbers."""
    if config.DISABLE_JIT:
        raise RuntimeError("With NUMBA_DISABLE_JIT=1 nothing is compiled, and swims have no derivatives.")
    entry: Callable[..., None] = advance.at(DUAL)
    return entry
