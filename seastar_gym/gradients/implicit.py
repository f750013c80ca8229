"""The step that makes the slopes of an implicit stage exact; for kernels on dual lanes alone.

A stage ends where the gradient g of Phi vanishes to Newton's tolerance. Slopes that were carried through Newton's steps
lag one step behind. So one more step is taken, with slopes alone, at the positions that Newton's method has found:

    slope of q  <-  slope of q - H^-1 (slope of g),    H the Hessian of Phi there,

which is the implicit function theorem. Positions keep their bits.
"""

from seastar_gym.der.body.body import place_roots
from seastar_gym.der.contact.contact import n_listed
from seastar_gym.der.contact.coupled import add_contact_product, dot
from seastar_gym.der.linear.star_solution import solve_again, substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.der.stepping.momentum import correct_momentum
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.dual_lanes import slope_of, with_slope
from seastar_gym.simd.lanes import add_product, any_lane, load, select, splat, store, subtract_product

ACCURACY = 1e-22  # of the square of what limbs in touch share, in the norm of H: what conjugate gradients leave of it
MOST_ITERATIONS = 200  # as in contact/coupled.py


@kernel
def correct_slopes(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Settle the momentum, see momentum.py, and then the slopes of the robots in the mask, after stage k of a step."""
    correct_momentum(rods, work, scheme, k, stage, q_0, v_0, h, robots)
    factorise(rods, work, stage, None)
    substitute_star(rods, work, work.step)
    for row in range(2 * rods.n_free):
        store(work.step, row, slope_of(load(work.step, row)))
    share_contact(rods, work)
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


@kernel
def share_contact(rods, work):
    """From H^-1 b of the star, in work.step, to the solution with contact's part of the Hessian, see coupled.py."""
    if work.contact is None or n_listed(work) == 0:
        return
    running = load(work.contact.touching, 0) > 0.0
    if not any_lane(running):
        return
    contact, zero = work.contact, splat(0.0)
    x, r, z, p, w = work.step, contact.r, contact.z, contact.p, contact.w
    rows = 2 * rods.n_free
    for row in range(rows):
        store(r, row, zero)
    add_contact_product(rods, work, x, -1.0, r)
    Hp = contact.Hp
    solve_again(rods, work, r, z)
    for row in range(rows):
        store(p, row, load(z, row))
        store(Hp, row, load(r, row))
    left = dot(rods, r, z)
    enough, iterations = ACCURACY * left, 0
    running = running & (left > 0.0)
    while any_lane(running) and iterations < MOST_ITERATIONS:
        for row in range(rows):
            store(w, row, load(Hp, row))
        add_contact_product(rods, work, p, 1.0, w)
        alpha = select(running, left / dot(rods, p, w), zero)
        for row in range(rows):
            store(x, row, select(running, add_product(load(x, row), alpha, load(p, row)), load(x, row)))
            store(r, row, subtract_product(load(r, row), alpha, load(w, row)))
        solve_again(rods, work, r, z)
        last, left = left, dot(rods, r, z)
        beta = select(running, left / last, zero)
        for row in range(rows):
            store(p, row, add_product(load(z, row), beta, load(p, row)))
            store(Hp, row, add_product(load(r, row), beta, load(Hp, row)))
        running = running & (left > enough)
        iterations += 1
