"""What a robot in vacuum keeps."""

import numpy as np

from seastar_gym import Simulator
from seastar_gym.rods.bundles import Rods
from seastar_gym.simulator.state import root_places


def momenta(rods: Rods, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s] of robots at q, v, shape (n_robots, n_nodes, 2).

    The linear one is that of lumped masses. With consistent masses, limbs that turn have edges whose differences in
    velocity count less, see inertia.py.
    """
    spin = cross(q, v) @ rods.inertia.node
    if rods.inertia.edge is not None:
        tails = np.arange(len(rods.inertia.edge))
        tails[:: rods.edges_per_limb] = 0
        spin -= cross(q[:, 1:] - q[:, tails], v[:, 1:] - v[:, tails]) @ rods.inertia.edge
    return np.einsum("n,rnd->rd", rods.inertia.node, v), spin


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def bodied_momenta(simulator: Simulator) -> tuple[np.ndarray, float]:
    """Momentum [kg m/s] and angular momentum about the origin [kg m^2/s] of a robot with a body."""
    rods, q, v = simulator.coefficients.rods(0), simulator.positions[0], simulator.velocities[0]
    mass, omega, n = rods.inertia.node[: len(q)], simulator.spin()[0], rods.edges_per_limb
    S_x, S_y = turned(rods.body.moment, simulator.orientation()[0])
    turning = omega * np.array([-S_y, S_x])
    roots = q[0] + root_places(simulator.scene.robot, simulator.orientation())[0]
    arms = roots - q[0]
    moving_roots = v[0] + omega * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
    tails_q = np.concatenate([np.vstack([roots[k], q[1 + k * n : (k + 1) * n]]) for k in range(rods.n_limbs)])
    tails_v = np.concatenate([np.vstack([moving_roots[k], v[1 + k * n : (k + 1) * n]]) for k in range(rods.n_limbs)])
    spin = cross(q, v) @ mass + rods.body.inertia[0] * omega + cross(q[0], turning) + S_x * v[0, 1] - S_y * v[0, 0]
    return mass @ v + turning, spin - cross(q[1:] - tails_q, v[1:] - tails_v) @ rods.inertia.edge


def turned(moment: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """A moment of mass [kg m], (x, y), on a body turned by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * moment[0] - s * moment[1], s * moment[0] + c * moment[1]])
