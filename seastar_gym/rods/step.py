"""One time step: schemes, the stages of a step, the guard's verdict, and what is counted of it.

`try_step` makes a step, or says for which robots it failed; `solve_stages` solves its stages one after the other, and
`end_guarded_step` refuses one that ends with too much energy. Schemes are diagonally implicit Runge-Kutta tableaux
whose stages are all solved by one kernel.

A stage i of a step h from (q_0, v_0) is implicit Euler with gamma = a_ii h, from
q_hat = q_0 + h sum_{j<i} a_ij V_j and v_hat = v_0 + h sum_{j<i} a_ij A_j.

The implicit midpoint rule keeps the amplitude of every oscillation, also of those that a step cannot resolve. With a
damping d its stage is at theta = (1 + d)/2 of the step, the theta method. An oscillation with the angular frequency w
then keeps, in every step, the share |R| of its amplitude,

    |R|^2 = (1 + (1 - theta)^2 x^2) / (1 + theta^2 x^2),    x = w h.

Those that a step resolves, x << 1, lose d x^2/2 per step, which is d x/2 per radian and below the midpoint rule's own
error of phase, x^2/12 per radian, from x = 6 d on. Those that it does not, x >> 1, lose 2 d per step. The method is
algebraically stable for d >= 0: two solutions of a dissipative problem never move apart.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.lanes.compile import inlined_kernel, kernel
from seastar_gym.lanes.registers import add_product, any_lane, load, load_number, select, splat, store
from seastar_gym.rods.body import freeze_body, move_roots, place_roots
from seastar_gym.rods.body_forces import add_work_on_body
from seastar_gym.rods.contact.coupled import solver_iterations
from seastar_gym.rods.contact.pairs import freeze_contact, without_new_crossings
from seastar_gym.rods.guard import (
    LARGEST_CUT,
    add_work_of_loads,
    allowed_energy,
    correct_momentum,
    frame_velocity,
    hold_to_energy,
    may_gain,
    restore,
    save,
    through_poles,
)
from seastar_gym.rods.newton import minimise
from seastar_gym.rods.terms.damping import freeze_strains
from seastar_gym.rods.terms.fluid import add_work_of_current, freeze_fluid
from seastar_gym.rods.terms.hub import set_natural_hub_angles


class Scheme(NamedTuple):
    """A tableau.

    a (row by row), b, c: Its coefficients.
    stiffly_accurate: b is the last row of a, so the last stage is the result.
    dissipative: A step whose elastic energy is convex takes energy from the robot, see guard.py.
    """

    n_stages: int
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    stiffly_accurate: bool
    dissipative: bool


def _scheme(a: list[list[float]], b: list[float] | None = None) -> Scheme:
    rows = np.array(a)
    return Scheme(
        n_stages=len(rows),
        a=rows.ravel(),
        b=rows[-1].copy() if b is None else np.array(b),
        c=rows.sum(axis=1),
        stiffly_accurate=b is None,
        dissipative=a == [[1.0]],
    )


CONSISTENT, GROWING = 1e-12, 1e-9  # rounding of b's sum, and of amplitudes
_G2 = 1.0 - 0.5 * np.sqrt(2.0)

SCHEMES = {
    "implicit-euler": _scheme([[1.0]]),  # (13.9), order 1, L-stable
    "sdirk2": _scheme([[_G2, 0.0], [1.0 - _G2, _G2]]),  # order 2, L-stable
    "implicit-midpoint": _scheme([[0.5]], [1.0]),  # order 2, keeps the amplitude of every oscillation
}

OWN_SCHEMES: dict[str, Scheme] = {}
"""Those that a user has registered."""


def tableau(A: ArrayLike, b: ArrayLike) -> Scheme:
    """Scheme of a Butcher tableau. ValueError for what the stages of stages.py cannot solve, or what would blow up."""
    rows, weights = np.asarray(A, dtype=float), np.asarray(b, dtype=float)
    n = len(weights) if weights.ndim == 1 else 0
    if not n or rows.shape != (n, n) or not np.isfinite([*rows.ravel(), *weights]).all():
        raise ValueError("A tableau is finite numbers A of shape (n, n) and b of shape (n,), a row for each stage.")
    if np.triu(rows, 1).any() or not (rows.diagonal() > 0.0).all():
        raise ValueError(
            "Stages are solved one after the other, each implicit: A must be zero above its diagonal, and positive on "
            "it; Gauss's, Radau's, Lobatto's and explicit first stages cannot be."
        )
    if abs(weights.sum() - 1.0) > CONSISTENT:
        raise ValueError(f"The numbers of b must add up to 1, or time runs at another speed, not {weights.sum():.6g}.")
    growth = largest_growth(rows, weights)
    if growth > 1.0 + GROWING:
        raise ValueError(
            f"This tableau is not A-stable: it multiplies the amplitude of some oscillation by {growth:.4g} in every "
            "step, and limbs have oscillations of all frequencies."
        )
    return _scheme(rows.tolist(), None if np.array_equal(rows[-1], weights) else weights.tolist())


def largest_growth(A: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Largest |R(i y)| of an undamped oscillation in a step, with R(z) = 1 + z b (1 - z A)^-1 1."""
    frequencies = np.geomspace(1e-2, 1e6, 2000)
    one = np.ones(len(b))
    return max(abs(1.0 + 1j * y * (b @ np.linalg.solve(np.eye(len(b)) - 1j * y * A, one))) for y in frequencies)


def scheme_of(name: str, damping: float) -> Scheme:
    """Scheme of this name; damping: Of the implicit midpoint rule, see above, 0 for other schemes."""
    if name in OWN_SCHEMES:
        return OWN_SCHEMES[name]
    return SCHEMES[name] if damping == 0.0 else _scheme([[0.5 * (1.0 + damping)]], [1.0])


class Stage(NamedTuple):
    """An implicit stage: q_hat [m] and v_hat [m/s], rows per coordinate, gamma [s] and its reciprocal, lanes.

    ahead: Whether the scheme asks in the middle of a step, so that contact has to look ahead, see contact/forces.py.
    """

    q_hat: Any
    v_hat: Any
    gamma: Any
    inverse_gamma: Any
    ahead: bool


@kernel
def share_of_body(rods, scheme, k):
    """Row of `a`, behind the accelerations and their shares, for the share of a body's own ones in stage k."""
    return (2 * rods.n_free + 1) * scheme.n_stages + k


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
    change = stage.gamma * load(a, share_of_body(rods, scheme, k))
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
    store_share(a, share_of_body(rods, scheme, k), along, squared, robots)


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


# Rows of a lane group's report, shape (len(REPORT_ROWS), N_LANES): what happened to its robots.
REPORT_ROWS = (
    "newton_iterations",
    "solver_iterations",  # of the conjugate gradients where limbs touch, see contact/coupled.py
    "regularised",  # Newton steps that needed the convex matrix
    "backtracks",  # halvings of a Newton step by the line search
    "steps",  # time steps taken
    "halvings",  # halvings of a time step that did not converge
    "energy_cuts",  # times that velocities were cut, see guard.py
    "covered",  # time [s]
    "smallest_hub_t",  # smallest tan(phi/2) of a hub hinge
    "largest_overlap",  # of limbs that touch each other or a body, see contact/pairs.py
)
(
    NEWTON_ITERATIONS, SOLVER_ITERATIONS, REGULARISED, BACKTRACKS, STEPS, HALVINGS, ENERGY_CUTS, COVERED,
    SMALLEST_HUB_T, LARGEST_OVERLAP,
) = range(len(REPORT_ROWS))  # fmt: skip

# Rows of a lane group's effort, if it is asked for: work of the actuators [J], the largest moment that resisted one
# [N m] and, limb after limb, the last moments [N m].
WORK, PEAK_MOMENT, MOMENTS = range(3)


@kernel
def add_to_report(report, row, amount):
    store(report, row, load(report, row) + amount)


@kernel
def iterations_spent(report):
    """Iterations that count towards a robot's bound on work: of Newton's method, and of the linear solver within it."""
    return load(report, NEWTON_ITERATIONS) + load(report, SOLVER_ITERATIONS)


MOST_HALVINGS = 12.0  # a robot whose step fails once more has failed
TURNABLE = 8.0  # after so many halvings, a choice, hinges may go through their poles, see guard.py
SMALLEST_FRACTION = 2.0**-12  # of an interval: there is no shorter step


class Step(NamedTuple):
    """A time step of every robot; lanes.

    start, size: Its beginning and its length, as shares of the interval. h: Its length [s].
    iteration_limit: Most Newton iterations of a stage.
    retrying: Mask of the robots that halved a step of this interval.
    """

    start: Any
    size: Any
    h: Any
    iteration_limit: Any
    retrying: Any


@kernel
def try_step(rods, work, scheme, actuation, q, v, a, step, active, limits, report):
    """One step for the robots in the mask `active`.

    a: Memory from one step to the next, see `advance` in interval.py; read at the beginning and written at the end.

    Returns the mask of the robots whose stages all converged and created no energy, whose state has moved.
    """
    good, guarded, stage = solve_stages(rods, work, scheme, actuation, q, v, a, step, active, limits, report)
    guarded = good & guarded
    if not any_lane(guarded):
        end_step(rods, work, scheme, stage, q, v, a, step.h, good)
        return good
    refused = end_guarded_step(rods, work, scheme, actuation, q, v, a, step, stage, good, guarded, limits, report)
    return good & ~refused


@inlined_kernel
def solve_stages(rods, work, scheme, actuation, q, v, a, step, active, limits, report):
    """Solve the stages of a step for the robots in the mask `active`.

    Returns (good, guarded, stage): the masks of the robots whose stages all converged, and of those whose energy has to
    be looked at; the last stage.
    """
    good, guarded = active, step.retrying
    tolerance = load(limits.tolerance, 0)
    for k in range(scheme.n_stages):
        stage = begin_stage(rods, work, scheme, k, q, v, a, step.h)
        freeze_contact(rods, work, stage, q)
        freeze_body(rods, work, stage, guessed_motion(rods, scheme, k, stage, a))
        if any_lane(step.retrying):
            start_at_rest(rods, work, stage, frame_velocity(rods, q, v), step.retrying)
        freeze_fluid(rods, work)
        set_natural_hub_angles(rods, work, actuation, step.start + load_number(scheme.c, k) * step.size)
        freeze_strains(rods, work, stage.q_hat)
        left = limits.most_iterations - iterations_spent(report)
        most, good = select(left < step.iteration_limit, left, step.iteration_limit), good & (left > 0.0)
        good, phi, iterations, regularised, backtracks = minimise(rods, work, stage, good, tolerance, most)
        correct_momentum(rods, work, scheme, k, stage, q, v, step.h, good)
        good = without_new_crossings(rods, work, stage, q, good)
        guarded = guarded | (regularised + backtracks > 0.0)
        if scheme.dissipative:
            guarded = guarded | those_that_may_gain(rods, work, stage, phi, good & ~guarded)
        add_to_report(report, NEWTON_ITERATIONS, iterations)
        add_to_report(report, SOLVER_ITERATIONS, solver_iterations(work))
        add_to_report(report, REGULARISED, regularised)
        add_to_report(report, BACKTRACKS, backtracks)
        if k < scheme.n_stages - 1:
            end_stage(rods, work, scheme, k, stage, a, active)
    return good, guarded, stage


@inlined_kernel
def those_that_may_gain(rods, work, stage, phi, robots):
    """Mask of robots with so much energy that drag may not take what a step of implicit Euler creates.

    robots: Mask of those that Newton's method has nothing to say about; of the predictable ones among them only those
    are meant whose potential leaves room for it.
    """
    energetic = phi > load(rods.scales.damped, 0)
    predictable = robots & energetic & (phi <= load(rods.scales.predictable, 0))
    if any_lane(predictable):
        gaining = may_gain(rods, work, stage, phi, predictable)
        energetic = (energetic & ~predictable) | gaining
    return energetic


@kernel
def end_guarded_step(rods, work, scheme, actuation, q, v, a, step, stage, accepted, guarded, limits, report):
    """End a step of the robots in the mask `accepted`, and hold those in `guarded` to their energy.

    Returns the mask of the robots whose step was refused and undone.
    """
    save(rods, work, scheme, q, v)
    frame = frame_velocity(rods, q, v)
    allowed = allowed_energy(rods, work, scheme, actuation, step.start, step.start + step.size, q, v, frame)
    end_step(rods, work, scheme, stage, q, v, a, step.h, accepted)
    largest_cut = select(step.iteration_limit > MOST_HALVINGS * limits.max_iterations, splat(1.0), LARGEST_CUT)
    allowed = add_work_of_current(rods, work, v, step.h, frame, allowed)
    allowed = add_work_of_loads(rods, work, q, step.h, frame, allowed)
    allowed = add_work_on_body(rods, work, work.step, q, v, step.h, frame, allowed)
    refused, cut = hold_to_energy(rods, work, scheme, q, v, step.h, frame, guarded, allowed, largest_cut)
    turnable = guarded & (step.iteration_limit <= TURNABLE * limits.max_iterations)
    refused = refused | through_poles(rods, work, q, turnable)
    if any_lane(refused):
        restore(rods, work, scheme, q, v, refused)
    add_to_report(report, ENERGY_CUTS, select(cut, splat(1.0), splat(0.0)))
    return refused
