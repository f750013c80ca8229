"""The Newton step where limbs touch: the star's matrix H plus the Hessian C K C^T of contact, which couples limbs.

Conjugate gradients, with H, eliminated already, as preconditioner. Pairs in touch are few, H^-1 (H + C K C^T) differs
from 1 in as many directions, and about as many iterations solve it exactly. Robots that do not touch keep their step to
the last bit.

    x = H^-1 g,    r = -C K C^T x,    then conjugate gradients for the rest of the way.

As no gradient g is kept, the Newton decrement g x is that of the star's step, g H^-1 g, and what is added to x, times
H of the star's step.
"""

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.registers import add_product, any_lane, load, select, splat, store, subtract_product
from seastar_gym.rods.body import carry_roots, gather_roots
from seastar_gym.rods.contact.forces import PRESSED, SLOT_ROWS, add_gap_gradient, gap, n_listed
from seastar_gym.rods.linear import solve_again, substitute_star

ACCURACY = 1e-10  # of the decrement: what may be left of it, and about what rounding leaves at steps of 5 ms
TO_ROUNDING = 1e-22  # what conjugate gradients leave of derivatives: of what contact changes, squared, in the norm of H
MOST_ITERATIONS = 200  # two limbs that touch need some 3 to 8; beyond, the robot halves its step


@kernel
def add_contact_product(rods, work, p, sign, rows):
    """rows += sign C K C^T p. Both have the nodes' coordinates and, with a body, its angle; roots follow."""
    carry_roots(rods, work, p)
    for slot in range(n_listed(work)):
        k = load(work.contact.slots, SLOT_ROWS * slot + PRESSED)
        add_gap_gradient(rods, work, slot, sign * k * gap(rods, work, slot, p), rows)
    gather_roots(rods, work, rows)


@kernel
def dot(rods, a, b):
    total = splat(0.0)
    for row in range(2 * rods.n_free):
        total = add_product(total, load(a, row), load(b, row))
    return total


@kernel
def solver_iterations(work):
    """Iterations of the conjugate gradients in this stage, robot by robot; none in scenes without contact."""
    if work.contact is None:
        return splat(0.0)
    return load(work.contact.solves, 0)


@kernel
def solve_coupled(rods, work, robots, decrement):
    """The Newton step of the robots in the mask, node by node into work.contact.x [m], where pairs are listed.

    With a body the step of its angle follows [rad].

    Returns its decrement [J].
    """
    if work.contact is None or n_listed(work) == 0:
        return decrement
    contact = work.contact
    x, star = contact.x, contact.ends  # no longer needed for the list
    substitute_star(rods, work, x)
    running = robots & (load(contact.touching, 0) > 0.0)
    if not any_lane(running):
        return decrement
    for row in range(2 * rods.n_free):
        store(star, row, load(x, row))
    running, decrement, iterations = share_step(rods, work, x, star, running, decrement, ACCURACY)
    store(contact.solves, 0, load(contact.solves, 0) + iterations)
    store(contact.missed, 0, select(running, 1.0, load(contact.missed, 0)))
    return decrement


@kernel
def solve_again_coupled(rods, work, x):
    """From H^-1 b, rows x, to (H + C K C^T)^-1 b, to rounding; x stays as it is where limbs do not touch."""
    if work.contact is None or n_listed(work) == 0:
        return
    running = load(work.contact.touching, 0) > 0.0
    if any_lane(running):
        share_step(rods, work, x, None, running, splat(0.0), TO_ROUNDING)


@kernel
def share_step(rods, work, x, star, running, decrement, accuracy):
    """Conjugate gradients from the star's step, rows x, to that of the star and contact, in place.

    star: The star's step once more. decrement: That of the star's step [J]. None: there is none, and what is left at
    first stands in its place. accuracy: What may be left, of the decrement.

    Returns the mask of the robots among `running` that did not arrive, the decrement and the iterations.
    """
    contact = work.contact
    r, z, p, Hp, w = contact.r, contact.z, contact.p, contact.Hp, contact.w
    rows, zero = 2 * rods.n_free, splat(0.0)
    for row in range(rows):
        store(r, row, zero)
    add_contact_product(rods, work, x, -1.0, r)
    solve_again(rods, work, r, z)
    for row in range(rows):
        store(p, row, load(z, row))
        store(Hp, row, load(r, row))
    left, iterations, count = dot(rods, r, z), 0, zero
    if star is None:
        decrement = left
    running = running & (left > accuracy * decrement)
    while any_lane(running) and iterations < MOST_ITERATIONS:
        count += select(running, splat(1.0), zero)
        for row in range(rows):
            store(w, row, load(Hp, row))
        add_contact_product(rods, work, p, 1.0, w)
        alpha = select(running, left / dot(rods, p, w), zero)
        if star is not None:
            decrement = select(running, add_product(decrement, alpha, dot(rods, star, Hp)), decrement)
        for row in range(rows):
            store(x, row, select(running, add_product(load(x, row), alpha, load(p, row)), load(x, row)))
            store(r, row, subtract_product(load(r, row), alpha, load(w, row)))
        solve_again(rods, work, r, z)
        last, left = left, dot(rods, r, z)
        beta = select(running, left / last, zero)
        for row in range(rows):
            store(p, row, add_product(load(z, row), beta, load(p, row)))
            store(Hp, row, add_product(load(r, row), beta, load(Hp, row)))
        running = running & (left > accuracy * decrement)
        iterations += 1
    return running, decrement, count
