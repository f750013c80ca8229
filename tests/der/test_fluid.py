"""Terms that a scene may have, all together, against the oracle: fluids and material damping."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from currents import CURRENTS, velocity
from oracle import Star
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.model.rods import make_rods
from stages import RandomStages, random_shape, robot_and_star
from test_oracle import assert_derivative

TERMS = [("uniform", 0.0), ("shear", 0.02), ("vortex", 0.1), ("grid", 1.3)]
OF_HUBS = [("rigid", *terms) for terms in TERMS] + [("opening", *terms) for terms in TERMS]
SHAPES = [(5, 4), (2, 3), (3, 2)]  # n_limbs, nodes_per_limb
TAU = 4e-3


def robot_water_and_star(hub: str, current: str, along: float, **shape) -> tuple[Seastar, Water, Star]:
    """The same scene, with all terms, for the kernels and for the oracle."""
    star = (Continuum if hub == "rigid" else Star)(
        fluid_density=950.0, drag_coefficient=1.3, tangential_drag_coefficient=along, relaxation_time=TAU,
        added_mass_coefficient=0.8, current=lambda places: velocity(current, places), **shape,
    )  # fmt: skip
    robot = replace(robot_and_star(hub=hub, **shape)[0], relaxation_time=TAU)
    return robot, Water(950.0, 1.3, along, CURRENTS[current], 0.8), star


# Against the oracle


@pytest.mark.parametrize(
    "hub, current, along, n_limbs, nodes_per_limb",
    [(*terms, 5, 4) for terms in OF_HUBS]
    + [("rigid", *terms, *shape) for terms in (("shear", 0.02), ("vortex", 1.3)) for shape in SHAPES],
)
def test_potential_and_newton_direction_in_a_fluid_are_those_of_the_oracle(
    hub, current, along, n_limbs, nodes_per_limb
):
    robot, water, star = robot_water_and_star(hub, current, along, n_limbs=n_limbs, nodes_per_limb=nodes_per_limb)
    stages = RandomStages(star, 1e-2, bend=0.05)
    stages.assert_agree(stages.run(make_rods(Scene(robot, water, SmaPulse(0.1)))), 1e-11 if n_limbs > 3 else 1e-10)


@pytest.mark.parametrize("hub, current, along", OF_HUBS)
def test_the_oracles_drag_in_a_fluid_is_the_slope_of_its_potential(hub, current, along):
    _, _, star = robot_water_and_star(hub, current, along, nodes_per_limb=3)
    rng = np.random.default_rng(2)
    frozen, v = random_shape(star, 0.3, 0.01, rng), rng.standard_normal((star.n_nodes, 2))
    force, jacobian = oracle.drag_force(star, v, frozen), oracle.drag_jacobian(star, v, frozen)
    assert_derivative(lambda x: -oracle.drag_potential(star, x, frozen), force, v, 1e-6, 1e-7)
    assert_derivative(lambda x: oracle.drag_force(star, x, frozen), jacobian.T, v, 1e-6, 1e-7)
