"""Newton's method on a stage: it ends where the potential is least, and leaves alone whom it was not asked for."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from oracle import Star
from seastar_gym import Scene, Seastar
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import Rods
from seastar_gym.rods.newton import minimise
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
