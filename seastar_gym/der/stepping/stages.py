"""The implicit stages of a time step: their beginning, their result, and the error of a step."""

from typing import Any, NamedTuple

from seastar_gym.der.body.body import move_roots, place_roots
from seastar_gym.simd.compilation import inlined_kernel, kernel
from seastar_gym.simd.lanes import add_product, load, load_number, select, splat, sqrt, store


class Stage(NamedTuple):
    """An implicit stage: q_hat [m] and v_hat [m/s], rows per coordinate, gamma [s] and its reciprocal, lanes.

    ahead: Whether the scheme asks in the middle of a step, so that contact has to look ahead, see contact/contact.py.
    """

    q_hat: Any
    v_hat: Any
    gamma: Any
    inverse_gamma: Any
    ahead: bool


# Rows of `a` behind the accelerations and their shares, where steps are adapted: the length of the last step [s], and
# the next step's share of its interval; then, with a body, the shares of its own accelerations, stage by stage.
LAST_STEP, SIZE, OF_BODY = 0, 1, 2


@kernel
def memory_row(rods, scheme, which):
    """Row of `a` where a step leaves LAST_STEP or SIZE for the next."""
    return (2 * rods.n_free + 1) * scheme.n_stages + which


@inlined_kernel
def begin_stage(rods, work, scheme, k, q_0, v_0, a, h):
    """Stage k of a step; the iterate starts at (13.10) plus a share of what the last acceleration adds."""
    gamma = load_number(scheme.a, k * scheme.n_stages + k) * h
    rows = 2 * rods.n_free
    share = gamma * load(a, scheme.n_stages * rows + k)
    for row in range(rows):
        q_hat, v_hat = load(q_0, row), load(v_0, row)
        for other in range(k):
            weight = load_number(scheme.a, k * scheme.n_stages + other) * h
            q_hat = add_product(q_hat, weight, load(work.stage_v, other * rows + row))
            v_hat = add_product(v_hat, weight, load(a, other * rows + row))
        if k > 0:
            store(work.q_hat, row, q_hat)
            store(work.v_hat, row, v_hat)
        velocity = add_product(v_hat, share, load(a, k * rows + row))
        store(work.q, row, add_product(q_hat, gamma, velocity))
    place_roots(rods, work.q)
    if k > 0:
        place_roots(rods, work.q_hat)
        return Stage(work.q_hat, work.v_hat, gamma, 1.0 / gamma, not scheme.stiffly_accurate)
    return Stage(q_0, v_0, gamma, 1.0 / gamma, not scheme.stiffly_accurate)


@kernel
def stage_motion(work, stage, row):
    """(V, A) of a coordinate: V = (Q - q_hat)/gamma and A = (V - v_hat)/gamma."""
    velocity = (load(work.q, row) - load(stage.q_hat, row)) * stage.inverse_gamma
    return velocity, (velocity - load(stage.v_hat, row)) * stage.inverse_gamma


@kernel
def store_share(a, row, along, squared, robots):
    """The share, from 0 to 1, of a stage's last acceleration that would have fit its new one best (least squares).

    The next step's first guess uses it. Ringing that a step does not resolve changes its sign, and has the share 0.
    """
    share = select(along > 0.0, along / squared, 0.0)
    store(a, row, select(robots, select(share < 1.0, share, 1.0), load(a, row)))


@kernel
def guessed_motion(rods, scheme, k, stage, a):
    """(v_x, v_y, omega): first guess of the hub's velocity [m/s] and of a body's angular velocity [rad/s] in a stage.

    As begin_stage guesses it, but with a share that the ringing of limbs does not spoil; zeros without a body.
    """
    if rods.body is None:
        return splat(0.0), splat(0.0), splat(0.0)
    rows, row = 2 * rods.n_free, 2 * rods.n_nodes
    change = stage.gamma * load(a, memory_row(rods, scheme, OF_BODY + k))
    vx = add_product(load(stage.v_hat, 0), change, load(a, k * rows))
    vy = add_product(load(stage.v_hat, 1), change, load(a, k * rows + 1))
    arc = add_product(load(stage.v_hat, row), change, load(a, k * rows + row))
    return vx, vy, arc * load(rods.body.inverse_scale, 0)


@kernel
def keep_share_of_body(rods, work, scheme, k, stage, a, robots):
    """Keep the share of a body's last accelerations that would have fit its new ones, before they are kept."""
    if rods.body is None:
        return
    rows, angle = 2 * rods.n_free, 2 * rods.n_nodes
    along, squared = splat(0.0), splat(0.0)
    for row in (0, 1, angle):
        _, acceleration = stage_motion(work, stage, row)
        last = load(a, k * rows + row)
        along, squared = add_product(along, last, acceleration), add_product(squared, last, last)
    store_share(a, memory_row(rods, scheme, OF_BODY + k), along, squared, robots)


@kernel
def end_stage(rods, work, scheme, k, stage, a, robots):
    """Keep velocity and acceleration of a solved stage that is not the last, for the robots in the mask `robots`."""
    rows = 2 * rods.n_free
    keep_share_of_body(rods, work, scheme, k, stage, a, robots)
    along, squared = splat(0.0), splat(0.0)
    for row in range(rows):
        velocity, acceleration = stage_motion(work, stage, row)
        last = load(a, k * rows + row)
        along = add_product(along, last, acceleration)
        squared = add_product(squared, last, last)
        store(work.stage_v, k * rows + row, velocity)
        store(a, k * rows + row, select(robots, acceleration, last))
    store_share(a, scheme.n_stages * rows + k, along, squared, robots)


@inlined_kernel
def end_step(rods, work, scheme, stage, q_0, v_0, a, h, accepted):
    """After the last stage: write the step's result over the state (q_0, v_0) of the robots in the mask `accepted`."""
    rows, k = 2 * rods.n_free, scheme.n_stages - 1
    keep_share_of_body(rods, work, scheme, k, stage, a, accepted)
    along, squared = splat(0.0), splat(0.0)
    for row in range(rows):
        velocity, acceleration = stage_motion(work, stage, row)
        last = load(a, k * rows + row)
        along = add_product(along, last, acceleration)
        squared = add_product(squared, last, last)
        q, v = load(q_0, row), load(v_0, row)
        if scheme.stiffly_accurate:
            q_1, v_1 = load(work.q, row), velocity
        else:
            weight = load_number(scheme.b, k) * h
            q_1, v_1 = add_product(q, weight, velocity), add_product(v, weight, acceleration)
            for other in range(k):
                weight = load_number(scheme.b, other) * h
                q_1 = add_product(q_1, weight, load(work.stage_v, other * rows + row))
                v_1 = add_product(v_1, weight, load(a, other * rows + row))
        store(a, k * rows + row, select(accepted, acceleration, last))
        store(q_0, row, select(accepted, q_1, q))
        store(v_0, row, select(accepted, v_1, v))
    move_roots(rods, q_0, v_0)
    store_share(a, scheme.n_stages * rows + k, along, squared, accepted)


@kernel
def forget_accelerations(rods, scheme, a, robots):
    """Robots whose step did not converge start the next one without a prediction, which may be far off or infinite."""
    for row in range((2 * rods.n_free + 1) * scheme.n_stages):
        store(a, row, select(robots, 0.0, load(a, row)))


@kernel
def step_error(rods, work, stage, a, h, last_h):
    """Position error of a step of the implicit midpoint rule [m], largest over the nodes.

    The rule takes the acceleration in the middle for the whole step, so it errs by h^3/12 times its rate of change, and
    that is the difference to the last step's over the time between the two middles.
    """
    largest = splat(0.0)
    for node in range(rods.n_free):
        squared = splat(0.0)
        for row in range(2 * node, 2 * node + 2):
            _, acceleration = stage_motion(work, stage, row)
            change = acceleration - load(a, row)
            squared = add_product(squared, change, change)
        largest = select(squared > largest, squared, largest)
    return h * h * h * sqrt(largest) / (6.0 * (h + last_h))


@kernel
def start_at_rest(rods, work, stage, frame, robots):
    """Start the iterate of the robots in the mask at q_hat, carried on by the frame: Phi is finite there, and no
    velocity about it leads it astray.
    """
    for node in range(rods.n_nodes):
        x = add_product(load(stage.q_hat, 2 * node), stage.gamma, frame[0])
        y = add_product(load(stage.q_hat, 2 * node + 1), stage.gamma, frame[1])
        store(work.q, 2 * node, select(robots, x, load(work.q, 2 * node)))
        store(work.q, 2 * node + 1, select(robots, y, load(work.q, 2 * node + 1)))
    if rods.body is not None:
        row = 2 * rods.n_nodes
        store(work.q, row, select(robots, load(stage.q_hat, row), load(work.q, row)))
        place_roots(rods, work.q)
