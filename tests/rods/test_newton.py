"""Newton's method on a stage: it ends where the potential is least, and leaves alone whom it was not asked for."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from oracle import Star
from seastar_gym import Contact, Scene, Seastar, SmaPulse, Water
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import Rods, make_work
from seastar_gym.rods.contact.forces import SLOT_ROWS
from seastar_gym.rods.newton import CURVATURE, MOST_CURVED, minimise
from slopes import nodes, plain
from stages import EVERYONE, RandomStages, robot_and_star, rods_of

ROBOT, STAR = robot_and_star(5, 4)
RODS = rods_of(ROBOT)
MILD, WILD = {"gamma": 5e-3, "bend": 0.05, "speed": 0.05}, {"gamma": 0.05, "bend": 0.5, "speed": 1.0}


def minimised(active=EVERYONE, tolerance=1e-13, limit=500.0, rods: Rods = RODS, star: Star = STAR, **size):
    stages = RandomStages(star, **size)
    stages.frozen = stages.q
    work, stage = stages.begin(rods)
    found = minimise(rods, work, stage, active, Lanes(tolerance), Lanes(limit))
    converged, phi, iterations, regularised, backtracks = plain(found)
    return SimpleNamespace(
        stages=stages, q=nodes(work.q), converged=converged, phi=phi, iterations=iterations,
        helped=regularised + backtracks,
    )  # fmt: skip


@pytest.mark.parametrize("size", [MILD, WILD], ids=["mild", "wild"])
def test_it_ends_at_a_minimum_of_the_oracles_potential(size):
    """Wild robots are helped by convex matrices or shorter steps."""
    found = minimised(**size)
    assert found.converged.all() and np.all((found.helped > 0.0) == (size is WILD))
    for lane in range(N_LANES):
        q_hat, v_hat, gamma, delta_psi, _ = found.stages.data(lane)
        residual, before = (
            oracle.incremental_gradient(STAR, q, q_hat, v_hat, gamma, delta_psi)
            for q in (found.q[lane], found.stages.q[lane])
        )
        assert np.abs(residual).max() < 1e-9 * np.abs(before).max()
        assert np.linalg.eigvalsh(oracle.incremental_hessian(STAR, found.q[lane], q_hat, gamma, delta_psi))[0] > 0.0


def test_robots_that_are_not_active_keep_their_bits_and_cost_no_iteration():
    active = np.arange(N_LANES) % 2 == 0
    found, all_of_them = minimised(Mask(active), **MILD), minimised(**MILD)
    np.testing.assert_array_equal(found.q[active], all_of_them.q[active])
    np.testing.assert_array_equal(found.q[~active], found.stages.q[~active])
    assert not found.iterations[~active].any() and not found.converged[~active].any()


def test_nobody_takes_more_iterations_than_allowed():
    found = minimised(limit=2.0, **WILD)
    assert found.iterations.max() == 2.0 and not found.converged.all()


@pytest.mark.parametrize("lane", [0, N_LANES - 1])
def test_a_robot_whose_state_is_not_a_number_does_not_converge_and_stops_nobody(lane):
    stages = RandomStages(STAR, **MILD)
    work, stage = stages.begin(RODS)
    work.q[5, lane] = np.nan
    converged = plain(minimise(RODS, work, stage, EVERYONE, Lanes(1e-10), Lanes(60.0))[0])
    np.testing.assert_array_equal(converged, np.arange(N_LANES) != lane)


# The last step is left out where it can be foreseen to be small enough


@pytest.mark.parametrize("tolerance", [1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("radius", [1e-4, 1.6e-3, 8e-3], ids=["slender", "ordinary", "thick"])
@pytest.mark.parametrize("gamma", [1e-4, 5e-3])
def test_robots_end_as_near_to_the_minimum_as_asked_though_a_step_is_left_out(radius, gamma, tolerance):
    star = Continuum(5, 4, rod_radius=radius)
    rods, size = make_rods(Scene(Seastar(5, 4, rod_radius=radius))), {"gamma": gamma, "bend": 0.01, "stretch": 1e-4}
    loose, tight = (minimised(tolerance=x, rods=rods, star=star, speed=0.01, **size) for x in (tolerance, 1e-14))
    assert np.all(loose.iterations < tight.iterations + (tolerance < 1e-6))
    assert np.linalg.norm(loose.q - tight.q, axis=2).max() < tolerance


# Scales of a robot and sizes of its memory


def test_scales_are_those_of_drag_and_of_edges_over_inertia():
    """Drag of a limb that moves by its length over its inertia; edges are stiffest at the tips. In vacuum
    every step is looked at, and where drag curves the potential most, none is predictable.
    """
    robot = Seastar(4, 5, limb_length=0.08, rod_radius=2e-3, density=1200.0, youngs_modulus=5e5)
    water, thin, vacuum = (make_rods(Scene(robot, one)).scales for one in (Water(900.0, 1.5), Water(9.0, 1.5), None))
    share = 0.5 * 900.0 * 1.5 * 2.0 * 2e-3 * 0.08 / (1200.0 * np.pi * 2e-3**2)
    assert share > 1.0 and water.damped == pytest.approx(water.predictable)
    assert thin.damped == pytest.approx(float(water.predictable[0]) * 0.01 * share)
    assert water.stiffness_ratio == pytest.approx(5e5 / (1200.0 * 0.02**2) * 2.0 * 4**2)
    assert vacuum.stiffness_ratio == np.inf and vacuum.damped == 0.0
    assert not vacuum.held and make_rods(Scene(robot, held_nodes=(0,))).scales.held
    for over, predictable in ((0.9, True), (1.1, False)):
        drag = over * MOST_CURVED * CURVATURE * 1200.0 * np.pi * 2e-3**2 / (0.04 * 0.5 * 900.0 * 2.0 * 2e-3)
        found = make_rods(Scene(robot, Water(900.0, drag))).scales.predictable[0]
        assert np.isfinite(found) == predictable


@pytest.mark.parametrize("edges, near", [(23, 23), (24, 24), (25, 3)])
def test_every_node_has_room_for_all_edges_of_another_limb_or_for_three_where_they_are_many(edges, near):
    rods = make_rods(Scene(Seastar(5, edges + 1), actuator=SmaPulse(0.1), contact=Contact()))
    work, n_nodes = make_work(rods, 1).contact, 2 * rods.contact.n_pairs * edges
    assert work.share == n_nodes * near
    assert len(work.slots) == SLOT_ROWS * n_nodes * min(edges, near * N_LANES)
