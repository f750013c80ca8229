"""Linear momentum, which no internal force changes, whatever the rounding of a linear solution.

Summed over all nodes, internal forces and contact cancel, so a full Newton step balances the momentum exactly, however
rough its other parts are. Its rounding does not: elimination subtracts stiffnesses EA/l from each other until the
inertia m/gamma^2 is left, and loses as many digits as EA/l over m/gamma^2, times the edges of a limb squared, has. The
move of the whole robot is then off by that share of the last Newton step, which is as long as the tolerance lets it be.

So where that can be seen, at any step in vacuum and in a fluid at very long ones, the whole robot takes one Newton step
of its own after the others: from the residual summed over the nodes, and its slope. In vacuum it is exact.

A body whose centre of mass is not the hub has the momentum b = omega J_S because it turns, too (body/). Stages take
its rate as d_theta J*_S - gamma omega*^2 A*_S from their first guess, which is off by the scheme's error. Here the rate
is B = (b - b_hat)/gamma, of the angle that the stage has found, with b_hat = b_0 + h sum_{j<i} a_ij B_j: b follows the
tableau as velocities do, and what nodes get is what b loses. The implicit midpoint rule, damped or not, ends with b of
the angle and velocity that it extrapolates to, so that its B is the difference of b over the whole step.
"""

from seastar_gym.der.body.body import place_roots, root_motion, tail_motion
from seastar_gym.der.body.forces import add_body, add_turning_rate, begin_turning, end_turning
from seastar_gym.der.motion import node_motion
from seastar_gym.der.potential import node_slopes
from seastar_gym.der.star import root_place
from seastar_gym.der.terms.drag import middle_slopes
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import any_lane, load, select, splat, store

LOST = 1e8  # of stiffness over inertia: rounding is some 1e-10 of a Newton step there, corrected in a fluid, too


@kernel
def correct_momentum(rods, work, scheme, k, stage, q_0, v_0, h, robots):
    """Move the robots in the mask whose momentum may be unbalanced to where it is balanced, after stage k of a step.

    q_0, v_0: State at the beginning of the step, of length h [s].
    """
    unsettled = robots & (load(rods.scales.stiffness_ratio, 0) * stage.gamma * stage.gamma > LOST)
    if any_lane(unsettled):
        begin_turning(rods, work, scheme, k, q_0, v_0, h)
        move_as_a_whole(rods, work, scheme, k, stage, unsettled)
        end_turning(rods, work, scheme, k, stage)


@kernel
def move_as_a_whole(rods, work, scheme, k, stage, robots):
    """Newton step of stage k in which all nodes of a robot move alike.

    Contact, which cancels but for its rounding, is left out: its forces are those of where Newton's last step began,
    or, as long as others in the lanes go on, of where it has ended.
    """
    zero = splat(0.0)
    fx, fy, xx, xy, yy = zero, zero, zero, zero, zero
    for node in range(rods.n_nodes):
        _, gradient, hessian = node_slopes(rods, work, stage, node, node_motion(work, stage, node), (zero, zero))
        fx, fy = fx + gradient[0], fy + gradient[1]
        xx, xy, yy = xx + hessian[0], xy + hessian[1], yy + hessian[2]
    fx, fy, xx, xy, yy = add_roots(rods, work, scheme, k, stage, fx, fy, xx, xy, yy)
    fx, fy, xx, xy, yy = add_middles(rods, work, stage, fx, fy, xx, xy, yy)
    determinant = xx * yy - xy * xy
    dx, dy = (yy * fx - xy * fy) / determinant, (xx * fy - xy * fx) / determinant
    for node in range(rods.n_nodes):
        x, y = load(work.q, 2 * node), load(work.q, 2 * node + 1)
        store(work.q, 2 * node, select(robots, x - dx, x))
        store(work.q, 2 * node + 1, select(robots, y - dy, y))
    place_roots(rods, work.q)


@kernel
def add_roots(rods, work, scheme, k, stage, fx, fy, xx, xy, yy):
    """Add a body, and the fluid at its limbs' roots, to the residual and slope of a move of the whole robot."""
    if rods.body is None:
        return fx, fy, xx, xy, yy
    of_hub, zero = node_motion(work, stage, 0), splat(0.0)
    _, (fx, fy), (xx, xy, yy) = add_body(rods, work, stage, None, of_hub, zero, (fx, fy), (xx, xy, yy))
    fx, fy = add_turning_rate(rods, work, scheme, k, stage, (fx, fy))
    for limb in range(rods.n_limbs):
        motion = root_motion(rods, work, stage, limb)
        _, g, h = node_slopes(rods, work, stage, root_place(rods, limb), motion, (zero, zero))
        fx, fy, xx, xy, yy = fx + g[0], fy + g[1], xx + h[0], xy + h[1], yy + h[2]
    return fx, fy, xx, xy, yy


@kernel
def add_middles(rods, work, stage, fx, fy, xx, xy, yy):
    """Add the drag in the middle of edges to the residual and slope of a move of the whole robot."""
    if rods.middle_drag is None:
        return fx, fy, xx, xy, yy
    for e in range(rods.n_edges):
        tail, head = tail_motion(rods, work, stage, e), node_motion(work, stage, e + 1)
        _, g, h = middle_slopes(rods, work, stage, e, tail, head)
        fx, fy = fx + 2.0 * g[0], fy + 2.0 * g[1]
        xx, xy, yy = xx + 4.0 * h[0], xy + 4.0 * h[1], yy + 4.0 * h[2]
    return fx, fy, xx, xy, yy
