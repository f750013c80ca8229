"""Contact between limbs against the dense oracle: who touches whom, energy, forces, and the step with the Hessian."""

import numpy as np
import pytest

import oracle
from hubs import HUBS
from oracle import Star
from seastar_gym import Contact, Scene, SmaPulse
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from stages import RandomStages, robot_and_star

ANGLE = 0.3


def scene(robot):
    return Scene(robot=robot, actuator=SmaPulse(peak_angle=0.1), contact=Contact(opening_angle=ANGLE))


def folded(star: Star, stages: RandomStages, turn: float) -> np.ndarray:
    """The stages' positions with every limb turned about the hub by `turn`, alternating in sign: neighbours meet."""
    q = stages.q.copy()
    for limb in range(star.n_limbs):
        nodes = [star.node(limb, i) for i in range(1, star.nodes_per_limb)]
        # Of an odd number the last limb meets the first, in the order of elimination the ends of the ring.
        angle = turn if (limb + star.n_limbs % 2) % star.n_limbs % 2 == 0 else -turn
        rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        q[:, nodes] = q[:, :1] + (q[:, nodes] - q[:, :1]) @ rotation.T
    return q


def touching_stages(n_limbs: int, nodes_per_limb: int, hub: str, seed: int = 0, turn_share: float = 0.9):
    robot, star = robot_and_star(n_limbs, nodes_per_limb, hub)
    stages = RandomStages(star, 2e-4, bend=0.05, speed=0.05, seed=seed)
    stages.q = folded(star, stages, turn_share * np.pi / n_limbs)
    stages.q_hat = folded(star, stages, 0.0) - 1e-4 * np.random.default_rng(seed).standard_normal(stages.q.shape)
    stages.frozen = stages.q + 2e-4 * np.random.default_rng(seed + 1).standard_normal(stages.q.shape)
    return robot, star, stages


def of_lane(star, stages, lane, ahead):
    """(depths, gradients, stiffnesses) of the touches of a lane at its q, as the oracle has them."""
    q_hat, v_hat = stages.q_hat[lane], stages.v_hat[lane]

    def looked_at(q):
        return q_hat + 4.0 * (q - q_hat) - stages.gamma * v_hat if ahead else q

    found = oracle.touches(star, looked_at(stages.frozen[lane]), stages.q[lane], ANGLE)
    depths = np.array([touch.depth(looked_at(stages.q[lane])) for touch in found])
    return depths, np.array([touch.gradient for touch in found]), np.array([touch.stiffness for touch in found])


@pytest.mark.parametrize("hub", HUBS[:2])
@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize(("n_limbs", "nodes_per_limb"), [(5, 10), (5, 4), (3, 9), (6, 6), (8, 7)])
def test_energy_forces_and_step_are_the_oracles(n_limbs, nodes_per_limb, ahead, hub):
    robot, star, stages = touching_stages(n_limbs, nodes_per_limb, hub)
    found = stages.run(make_rods(scene(robot)), ahead=ahead)
    touched, lead = 0, 4.0 if ahead else 1.0
    for lane in range(N_LANES):
        depths, gradients, stiffnesses = of_lane(star, stages, lane, ahead)
        touched += int((depths > 0.0).sum())
        phi = stages.phi(lane) + 0.5 / lead * stiffnesses @ depths**2
        gradient = stages.gradient(lane).ravel() - (stiffnesses * depths) @ gradients
        active = gradients[depths > 0.0]
        hessian = stages.hessian(lane) + lead * (active.T * stiffnesses[depths > 0.0]) @ active
        np.testing.assert_allclose(found.phi[lane], phi, rtol=1e-9)
        if found.pivot[lane] > 0.0:
            step = np.linalg.solve(hessian, gradient)
            np.testing.assert_allclose(found.direction[lane].ravel(), step, atol=3e-4 * np.abs(step).max())
            np.testing.assert_allclose(found.decrement[lane], gradient @ step, rtol=1e-5)
    assert touched > 6
    assert (found.pivot > 0.0).sum() >= N_LANES // 2


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("nodes_per_limb", [3, 4])
def test_a_tip_at_a_root_edge_of_its_neighbour_is_met(nodes_per_limb, side):
    """However far from it the nodes of either limb are that end the root edges."""
    robot, star = robot_and_star(5, nodes_per_limb)
    stages = RandomStages(star, 2e-4, bend=0.01, speed=0.01)
    limb, other = (1, 2) if side < 0.0 else (2, 1)
    hub, root = stages.q[:, 0], stages.q[:, star.node(other, 1)] - stages.q[:, 0]
    normal = side * np.stack([-root[:, 1], root[:, 0]], axis=1) / star.edge_length
    tip = star.node(limb, nodes_per_limb - 1)
    stages.q[:, tip] = hub + 0.3 * root + 1.2e-3 * normal
    stages.q_hat, stages.frozen = stages.q - 1e-5, stages.q.copy()
    found = stages.run(make_rods(scene(robot)))
    for lane in range(N_LANES):
        depths, gradients, stiffnesses = of_lane(star, stages, lane, False)
        at_tip = gradients.reshape(len(gradients), -1, 2)[:, tip].any(axis=1)
        assert (depths[at_tip] > 1e-4).any()
        np.testing.assert_allclose(found.phi[lane], stages.phi(lane) + 0.5 * stiffnesses @ depths**2, rtol=1e-9)
