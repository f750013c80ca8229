"""Contact between limbs: energy, forces and step are the oracle's; who touches whom, and who came to cross whom."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from hubs import HUBS
from oracle import Star
from seastar_gym import Contact, Scene, Seastar, SmaPulse
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.contact.coupled import add_contact_product, solve_again_coupled, solve_coupled, solver_iterations
from seastar_gym.rods.contact.forces import SLOT_ROWS, STIFFNESS, add_contact, members, n_listed
from seastar_gym.rods.contact.pairs import freeze_contact, without_new_crossings
from seastar_gym.rods.linear import solve_again, substitute_star
from seastar_gym.rods.potential import factorise
from seastar_gym.rods.step import Stage
from seastar_gym.rods.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.scene.robot import Discretisation
from slopes import nodes, plain, rotated, rows
from stages import EVERYONE, RandomStages, robot_and_star

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
        q[:, nodes] = q[:, :1] + rotated(q[:, nodes] - q[:, :1], angle)
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


# Contact between limbs: its forces are the slopes of its energy, cancel, and come from those alone that touch.


def energy(touching) -> np.ndarray:
    return plain(add_contact(touching.rods, touching.work, touching.stage, None, Lanes(0.0)))


def listed_stiffness(touching, q) -> np.ndarray:
    """Stiffness of all listed pairs of every node at positions q [N/m], shape (n_nodes, N_LANES)."""
    rods, work = touching.rods, touching.work
    work.q[:] = rows(q)
    freeze_contact(rods, work, touching.stage, rows(q))
    total = np.zeros((rods.n_nodes, N_LANES))
    for slot in range(n_listed(work)):
        total[members(rods, work, slot)[0]] += work.contact.slots[SLOT_ROWS * slot + STIFFNESS]
    return total


@pytest.mark.parametrize("shift", [0.0, 0.04, 0.2, 0.25, 0.5, 0.7, 0.75, 0.97])
def test_a_node_counts_once_wherever_along_a_limb_it_stands(shift):
    """Limb 2 lies beside limb 1, so many edges nearer to the hub; both of its nodes meet edges of limb 1."""
    touching = touching_limbs()
    q = nodes(touching.q_0)[0]
    length = 0.1 / 3.0
    q[1:4] = np.outer([1.0, 2.0, 3.0], [length, 0.0])
    q[4:7] = q[1:4] + [-shift * length, 3e-3]
    found = listed_stiffness(touching, q)
    whole = touching.rods.contact.stiffness
    np.testing.assert_allclose(found[5:7], np.broadcast_to(whole[5:7, None], (2, N_LANES)), rtol=1e-9)


# Limbs that came to cross: told from limbs that touch, that part, or that crossed before.


ROBOT = Seastar(5, 4)
RODS = make_rods(Scene(ROBOT, actuator=SmaPulse(0.1), contact=Contact()))
REST = ROBOT.nodes()
ODD = np.arange(N_LANES) % 2 == 1


def crossed(away: float = 0.0, limbs: tuple[int, int] = (0, 1)) -> np.ndarray:
    """The robot away from the origin, with the tip of one limb beyond the middle of the next."""
    turn = 0.4 * np.pi * limbs[0]
    q = rotated(REST, turn)  # the first of the two limbs lies along x
    q[3 * limbs[0] + 3] = 0.05 * np.array([np.cos(1.75), np.sin(1.75)])
    return rotated(q, -turn) + away


def found(q_1: np.ndarray, q_0: np.ndarray, ahead: bool = False, robots=None, missed=False) -> np.ndarray:
    """Who is uncrossed after a step from q_0 to q_1."""
    work = make_work(RODS, 1)
    work.q[:], work.q_hat[:] = rows(0.5 * (q_0 + q_1) if ahead else q_1), rows(q_0)
    work.contact.missed[:] = 1.0 * np.asarray(missed)
    stage = Stage(work.q_hat, work.v_hat, Lanes(1e-3), Lanes(1e3), ahead)
    asked = EVERYONE if robots is None else Mask(robots)
    return plain(without_new_crossings(RODS, work, stage, rows(q_0), asked))


@pytest.mark.parametrize("ahead", [False, True])
@pytest.mark.parametrize("limbs", [(0, 1), (2, 3), (4, 0)])
@pytest.mark.parametrize("away", [0.0, 0.3])
def test_limbs_that_came_to_cross_are_seen_in_their_own_robot_alone(limbs, away, ahead):
    q_1 = np.where(ODD[:, None, None], crossed(away, limbs), REST + away)
    np.testing.assert_array_equal(found(q_1, REST + away, ahead), ~ODD)
    assert not found(q_1, REST + away, ahead, robots=ODD).any()


def test_limbs_that_crossed_before_may_part_again_and_robots_whose_pairs_were_not_all_listed_are_left_out():
    assert found(crossed(), crossed()).all() and found(REST, crossed()).all()
    np.testing.assert_array_equal(found(REST, REST, missed=ODD), ~ODD)


# The Newton step where limbs touch solves the star's matrix plus that of contact.


def steps(touching, robots=EVERYONE):
    """(the star's step, the coupled one, their decrements) [m], [J]."""
    rods, work = touching.rods, touching.work
    _, alone, _ = factorise(rods, work, touching.stage, None)
    star = np.zeros_like(work.q)
    substitute_star(rods, work, star)
    together = solve_coupled(rods, work, robots, alone)
    return star, work.contact.x.copy(), plain(alone), plain(together)


@pytest.mark.parametrize("discretisation", ["chapter", "continuum"])
def test_the_step_solves_the_star_and_contact_together_and_derivatives_do_to_rounding(discretisation):
    """H x + C K C^T x = H x_star: what contact takes, solved by the star, is where the two differ."""
    touching = touching_limbs(discretisation=discretisation)
    rods, work = touching.rods, touching.work
    star, x, _, _ = steps(touching)
    iterations, derivatives = plain(solver_iterations(work)), star.copy()
    solve_again_coupled(rods, work, derivatives)
    assert np.abs(x - star).max() > 1e-2 * np.abs(star).max()
    for found, close in ((x, 1e-5), (derivatives, 1e-9)):
        taken, moved = np.zeros_like(x), np.zeros_like(x)
        add_contact_product(rods, work, found, -1.0, taken)
        solve_again(rods, work, taken, moved)
        np.testing.assert_allclose(found - star, moved, rtol=0.0, atol=close * np.abs(moved).max())
    assert not work.contact.missed.any()
    np.testing.assert_array_equal(plain(solver_iterations(work)), iterations)


# Touching limbs


GAMMA = 2e-4


def touching_limbs(discretisation: Discretisation = "continuum") -> SimpleNamespace:
    """Limbs 1 and 2 of five lie along each other."""
    robot, star = Seastar(5, 4, discretisation=discretisation), Star(5, 4)
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.1), contact=Contact()))
    q_0, rng = np.tile(star.rest, (N_LANES, 1, 1)), np.random.default_rng(0)
    q = q_0.copy()
    for limb, turn in ((0, 0.62), (1, -0.62)):
        own = slice(3 * limb + 1, 3 * limb + 4)
        q[:, own] = rotated(q[:, own], turn)
    q += 2e-4 * rng.standard_normal(q.shape)
    work = make_work(rods, 1)
    work.q[:], work.q_hat[:], work.v_hat[:] = rows(q), rows(q - 1e-4), 0.1 * rng.standard_normal(work.q.shape)
    still = np.zeros((5, N_LANES))
    set_natural_hub_angles(rods, work, Actuation(still, still), Lanes(1.0))
    stage = Stage(work.q_hat, work.v_hat, Lanes(GAMMA), Lanes(1.0 / GAMMA), False)
    freeze_contact(rods, work, stage, rows(q_0))
    return SimpleNamespace(rods=rods, work=work, stage=stage, q_0=rows(q_0))
