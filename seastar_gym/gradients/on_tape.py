"""Kernels of time steps on a tape, replayed from what history.py has kept of them.

Newton's solution of a stage is read instead of found, and g alone is left of what would be eliminated, see replay.py.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.body.body import place_roots
from seastar_gym.der.linear.star_matrix import eliminate_node, load_pair, store_pair, store_root
from seastar_gym.der.potential import factorise, solve_hub
from seastar_gym.der.stepping.momentum import correct_momentum
from seastar_gym.der.stepping.newton import minimise
from seastar_gym.der.stepping.steps import Step, try_step
from seastar_gym.gradients.history import LIMIT, OF_STAGE, OF_STEP, PHI, RETRYING, SETBACKS, SIZE, START
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import N_LANES, Form, any_lane, load, load_number, splat, store, store_number
from seastar_gym.simd.tape_lanes import ROW, at_place, end_of_tape, leave_places, recorded


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
    _, accepted, _ = try_step(rods, work, scheme, actuation, q, v, a, again, everybody, limits, report)
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
        store_pair(work.step, 2 * (limb * rods.edges_per_limb + 1), load_pair(work.ring, 2 * limb))
    if rods.body is not None:
        store_pair(work.step, 2 * rods.n_nodes, (load(work.body.system, 3), splat(0.0)))
    return splat(0.0), splat(0.0)


@kernel
def leave_right_hand_side_of_root(work, limb, D, H, r):
    """In place of store_root: nothing but the right-hand side."""
    store_pair(work.ring, 2 * limb, r)


TAPED = Form("taped", recorded, instead={
    minimise: read_minimum, correct_momentum: put_solution, eliminate_node: leave_right_hand_side,
    store_root: leave_right_hand_side_of_root, solve_hub: leave_right_hand_sides_of_hub,
})  # fmt: skip
"""Rows on a tape. Stages read what Newton's method has found, and put their solution on the tape."""
