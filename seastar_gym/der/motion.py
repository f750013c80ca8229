"""How a node moves in an implicit stage."""

from typing import Any, NamedTuple

from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import load


class Motion(NamedTuple):
    """Motion of a node, by the iterate.

    dx, dy: d = v - v_hat, what its velocity changes by [m/s]. wx, wy: w = v - u, its velocity relative to the fluid.
    """

    dx: Any
    dy: Any
    wx: Any
    wy: Any


@kernel
def relative(work, node, vx, vy):
    """Velocity of a node relative to the fluid, which is at rest or has a current."""
    if work.current is None:
        return vx, vy
    return vx - load(work.current, 2 * node), vy - load(work.current, 2 * node + 1)


@kernel
def node_motion(work, stage, node):
    """The Motion of a node."""
    qx, qy = load(work.q, 2 * node), load(work.q, 2 * node + 1)
    vx = (qx - load(stage.q_hat, 2 * node)) * stage.inverse_gamma
    vy = (qy - load(stage.q_hat, 2 * node + 1)) * stage.inverse_gamma
    dx, dy = vx - load(stage.v_hat, 2 * node), vy - load(stage.v_hat, 2 * node + 1)
    wx, wy = relative(work, node, vx, vy)
    return Motion(dx, dy, wx, wy)
