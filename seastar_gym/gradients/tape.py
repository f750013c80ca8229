"""Kernels whose numbers carry slopes: on a tape, by differences, and through Newton's solutions.

On a tape, kernels of time steps are replayed from what history.py has kept of them. Newton's solution of a stage is
read instead of found, and g alone is left of what would be eliminated, see replay.py.

What is computed before a swim, and costs nothing, has slopes by differences of fourth order. Coefficients of rods,
places at rest and rotations by actuators follow from numbers of a scene by short formulas. Four more points of them
give slopes to some 1e-11: formulas with powers up to the fourth have no error but rounding.

`advance_slopes` is `advance` of rods/interval.py on dual lanes, to the same bits. A stage ends where the gradient g of
Phi vanishes to Newton's tolerance. Slopes that were carried through Newton's steps lag one step behind. So one more
step is taken, with slopes alone, at the positions that Newton's method has found:

    slope of q  <-  slope of q - H^-1 (slope of g),    H the Hessian of Phi there,

which is the implicit function theorem. Positions keep their bits.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.core import config
from numpy.typing import NDArray

from seastar_gym.gradients.history import LIMIT, OF_STAGE, OF_STEP, PHI, RETRYING, SETBACKS, SIZE, START
from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.dual import duals, slope_of, with_slope
from seastar_gym.lanes.registers import N_LANES, Form, any_lane, load, load_number, select, splat, store, store_number
from seastar_gym.lanes.tape import ROW, at_place, end_of_tape, leave_places, recorded
from seastar_gym.rods.body import place_roots
from seastar_gym.rods.contact.coupled import solve_again_coupled
from seastar_gym.rods.guard import correct_momentum
from seastar_gym.rods.interval import advance
from seastar_gym.rods.linear import eliminate_node, load_pair, store_pair, store_root, substitute_star
from seastar_gym.rods.newton import minimise
from seastar_gym.rods.potential import factorise, solve_hub
from seastar_gym.rods.step import Step, try_step


class Replayed(NamedTuple):
    """What steps are replayed from, and what is left of their stages.

    step, stages: What was kept of the steps, as rows on a tape: the first OF_STEP numbers and, behind them, the length
    [s]; those of all stages. stage: Number of the stage at hand. first: Places of the stages' solutions begin here.
    residual: g of every stage, as rows on a tape. memory: All rows of `work`. lists: All that is in it and that robots
    share. of_stages, of_lists: The same when a stage was left, as rows of `Simulator`, in a slot for every stage.
    """

    step: NDArray[np.float64]
    stages: NDArray[np.float64]
    stage: NDArray[np.float64]
    first: NDArray[np.float64]
    residual: NDArray[np.float64]
    memory: NDArray[np.float64]
    lists: NDArray[np.float64]
    of_stages: NDArray[np.float64]
    of_lists: NDArray[np.float64]
    n_rows: int
    n_lists: int


@kernel
def row_of_stage(rods, work):
    return int(load_number(work.replayed.stage, 0)) * (OF_STAGE + 2 * rods.n_points)


@kernel
def read_minimum(rods, work, stage, active, tolerance, iteration_limit):
    """What minimise has found in the stage at hand, but for the solution."""
    stages, row = work.replayed.stages, row_of_stage(rods, work)
    return active, load(stages, row + PHI), splat(0.0), load(stages, row + SETBACKS), splat(0.0)


@kernel
def put_solution(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Put the solution of stage k of a step on the tape, and what else stands in work beside it."""
    replayed, n, row = work.replayed, 2 * rods.n_free, row_of_stage(rods, work) + OF_STAGE
    store_number(replayed.stage, 0, load_number(replayed.stage, 0) + 1.0)
    for coordinate in range(2 * rods.n_points):
        store(work.q, coordinate, load(replayed.stages, row + coordinate))
        store(work.q_hat, coordinate, load(stage.q_hat, coordinate))
        store(work.v_hat, coordinate, load(stage.v_hat, coordinate))
    place_roots(rods, work.q)
    leave_work(replayed, k)
    factorise(rods, work, stage, None)
    first = end_of_tape()
    leave_places(n)
    store_number(replayed.first, k, float(first))
    for coordinate in range(n):
        store(replayed.residual, k * n + coordinate, load(work.step, coordinate))
        store(work.q, coordinate, at_place(load(work.q, coordinate), first + coordinate))
    place_roots(rods, work.q)


@kernel
def leave_work(replayed, k):
    """Copy what is in work to the slot of stage k."""
    for row in range(replayed.n_rows):
        for lane in range(N_LANES):
            to = (k * replayed.n_rows + row) * N_LANES + lane
            store_number(replayed.of_stages, to, load_number(replayed.memory, row * ROW + lane))
    for number in range(replayed.n_lists):
        store_number(replayed.of_lists, k * replayed.n_lists + number, load_number(replayed.lists, number))


@kernel
def replay_steps(rods, work, scheme, actuation, q, v, a, limits, report):
    """Take the steps in work.replayed again; returns whether all were accepted, as they were then."""
    step, everybody = work.replayed.step, splat(0.0) < 1.0
    again = Step(
        load(step, START), load(step, SIZE), load(step, OF_STEP), load(step, LIMIT), load(step, RETRYING) > 0.0
    )
    accepted = try_step(rods, work, scheme, actuation, q, v, a, again, everybody, limits, report)
    return not any_lane(~accepted)


@kernel
def leave_right_hand_side(work, node, D, B, C, r, D_1, B_1, D_2, r_1, r_2):
    """In place of eliminate_node: the right-hand side goes to work.step, nothing is eliminated, the matrix is gone."""
    zero = splat(0.0)
    block, coupling = (zero, zero, zero), (zero, zero, zero, zero)
    store_pair(work.step, 2 * node, r)
    return block, coupling, block, r_1, r_2, zero, zero


@kernel
def leave_right_hand_sides_of_hub(rods, work, D_hub, r_hub):
    """In place of solve_hub: right-hand sides of it and of root nodes go to work.step."""
    store_pair(work.step, 0, r_hub)
    for limb in range(rods.n_limbs):
        store_pair(work.step, 2 * (limb * rods.edges_per_limb + 1), load_pair(work.system.ring, 2 * limb))
    if rods.body is not None:
        store_pair(work.step, 2 * rods.n_nodes, (load(work.body.system, 3), splat(0.0)))
    return splat(0.0), splat(0.0)


@kernel
def leave_right_hand_side_of_root(work, limb, D, H, r):
    """In place of store_root: nothing but the right-hand side."""
    store_pair(work.system.ring, 2 * limb, r)


TAPED = Form("taped", recorded, instead={
    minimise: read_minimum, correct_momentum: put_solution, eliminate_node: leave_right_hand_side,
    store_root: leave_right_hand_side_of_root, solve_hub: leave_right_hand_sides_of_hub,
})  # fmt: skip
"""Rows on a tape. Stages read what Newton's method has found, and put their solution on the tape."""


Floats = NDArray[np.float64]


class Stencil(NamedTuple):
    """Places beside a number, in steps, and what the changes there weigh in the slope times the step."""

    places: tuple[float, ...]
    weights: tuple[float, ...]

    def slope(self, value: Floats, beside: Floats, step: float) -> Floats:
        """Slope from the value and from those at the places, shape (4, ...); exactly zero for constants."""
        return np.asarray(np.tensordot(self.weights, beside - value, axes=1) / step)


CENTRAL = Stencil((-2.0, -1.0, 1.0, 2.0), (1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0))
UPWARDS = Stencil((1.0, 2.0, 3.0, 4.0), (4.0, -3.0, 4.0 / 3.0, -0.25))
DOWNWARDS = Stencil((-1.0, -2.0, -3.0, -4.0), (-4.0, 3.0, -4.0 / 3.0, 0.25))
OF_COMMANDS, OF_NUMBERS = 1e-4, 3e-4
"""Steps: of commands, and of numbers as a share of each; for a number that is zero it is the step."""


def of_command(command: float) -> Stencil:
    """Stencil of a command: at the ends of [-1, 1] it looks inwards."""
    room = 2.0 * OF_COMMANDS
    return DOWNWARDS if command > 1.0 - room else UPWARDS if command < room - 1.0 else CENTRAL


def step_of(number: float) -> float:
    return OF_NUMBERS * (abs(number) or 1.0)


def arrays_of(bundle: Any) -> list[Floats]:
    """Arrays of a bundle of coefficients, and of the bundles in it, in the order of fields."""
    if isinstance(bundle, np.ndarray):
        return [bundle]
    return [array for field in bundle for array in arrays_of(field)] if hasattr(bundle, "_fields") else []


@kernel
def correct_slopes(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Settle the momentum, see guard.py, and then the slopes of the robots in the mask, after stage k of a step."""
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
