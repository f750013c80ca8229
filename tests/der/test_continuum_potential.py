"""Potential, gradient and Hessian of the continuum's discretisation are those of its dense oracle.

Beside test_potential.py: few limbs, every term at once, limbs far from where the hub would have them.
"""

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from currents import CURRENTS, velocity
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.der.rods import Rods
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from stages import RandomStages

SHAPES = [(1, 4), (2, 3), (3, 2)]  # n_limbs, nodes_per_limb


def rods_and_stages(n_limbs: int, nodes_per_limb: int, gamma: float, **wildness) -> tuple[Rods, RandomStages]:
    robot = Seastar(n_limbs, nodes_per_limb)
    scene = Scene(robot, Water(), SmaPulse(0.0 if n_limbs == 1 else 0.1))
    return make_rods(scene), RandomStages(Continuum(n_limbs, nodes_per_limb), gamma, **wildness)


@pytest.mark.parametrize("gamma", [1e-3, 1e-2])
@pytest.mark.parametrize("n_limbs, nodes_per_limb", SHAPES)
def test_potential_and_newton_direction_are_those_of_the_oracle(n_limbs, nodes_per_limb, gamma):
    assert_agree(*rods_and_stages(n_limbs, nodes_per_limb, gamma, bend=0.05))


def assert_agree(rods: Rods, stages: RandomStages) -> None:
    """Potential, Newton's direction and its decrement in every lane."""
    found = stages.run(rods)
    for lane in range(N_LANES):
        gradient = oracle.incremental_gradient(stages.star, stages.q[lane], *stages.data(lane))
        direction = np.linalg.solve(stages.hessian(lane), gradient.ravel()).reshape(-1, 2)
        phi = oracle.incremental_potential(stages.star, stages.q[lane], *stages.data(lane))
        assert found.phi[lane] == pytest.approx(phi, rel=1e-12)
        assert found.decrement[lane] == pytest.approx(np.sum(gradient * direction), rel=1e-10)
        np.testing.assert_allclose(found.direction[lane], direction, rtol=0.0, atol=1e-10 * np.abs(direction).max())


@pytest.mark.parametrize("current, along", [("shear", 0.02), ("vortex", 1.3)])
@pytest.mark.parametrize("n_limbs, nodes_per_limb", [(5, 4), (2, 3), (3, 2)])
def test_potential_and_newton_direction_with_every_term_are_those_of_the_oracle(
    n_limbs, nodes_per_limb, current, along
):
    robot = Seastar(n_limbs, nodes_per_limb, relaxation_time=4e-3)
    star = Continuum(
        n_limbs, nodes_per_limb, fluid_density=950.0, drag_coefficient=1.3, tangential_drag_coefficient=along,
        added_mass_coefficient=0.8, relaxation_time=4e-3, current=lambda places: velocity(current, places),
    )  # fmt: skip
    rods = make_rods(Scene(robot, Water(950.0, 1.3, along, CURRENTS[current], 0.8), SmaPulse(0.1)))
    assert_agree(rods, RandomStages(star, 1e-2, bend=0.05))


def test_newton_direction_of_wildly_bent_robots_is_as_good_as_their_matrix_allows():
    """Limbs turned by more than a quarter from where the hub would have them, too."""
    rods, stages = rods_and_stages(5, 10, 1e-3, bend=0.8, stretch=0.1, speed=1.0)
    found, star, turned = stages.run(rods), stages.star, 0.0
    for lane in range(N_LANES):
        gradient = oracle.incremental_gradient(star, stages.q[lane], *stages.data(lane))
        hessian = stages.hessian(lane)
        direction = np.linalg.solve(hessian, gradient.ravel()).reshape(-1, 2)
        error = np.abs(found.direction[lane] - direction).max() / np.abs(direction).max()
        assert error < 1e-14 * np.linalg.cond(hessian)
        turned = max(turned, np.abs(oracle.clamp_turns(star, stages.q[lane], stages.delta_psi[lane])).max())
    assert turned > np.pi / 2.0
