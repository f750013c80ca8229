"""Terms that a scene may have, all together, against the oracle: fluids and material damping."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from currents import CURRENTS, velocity
from oracle import Star
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.der.terms.current import GRID, LINEAR, VORTEX, Current, current_velocity
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import gradient, plain
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


# Currents: velocities of the fluid at places, from the numbers of each kind.


PLACES = np.random.default_rng(0).uniform(-0.4, 0.4, (2, 80))
GRADIENT = np.array([[0.3, -0.5], [0.2, -0.3]])
SHEAR = Current(LINEAR, np.array([0.1, -0.2, *GRADIENT.ravel()]))
EDDY = Current(VORTEX, np.array([0.1, -0.05, 0.02, 0.06**2]))


def current_at(current: Current, places: np.ndarray) -> np.ndarray:
    return np.array(plain(current_velocity.plain(current, *map(Lanes, places))))


def grid(function, n_x: int = 9, n_y: int = 7, spacing: float = 0.125) -> Current:
    """Samples of a current on points from (-0.5, -0.375) on."""
    x, y = -0.5 + spacing * np.arange(n_x), -0.375 + spacing * np.arange(n_y)
    samples = np.stack(function(*np.meshgrid(x, y, indexing="ij")), axis=-1)
    return Current(GRID, np.array([-0.5, -0.375, 1.0 / spacing]), n_x, n_y, samples.ravel())


def bilinear(x, y):
    return 0.1 + 0.3 * x - 0.5 * y + 2.0 * x * y, 0.2 * x + 0.05 * y


def test_a_linear_current_is_its_velocity_at_the_origin_and_its_gradient():
    expected = np.array([[0.1], [-0.2]]) + GRADIENT @ PLACES
    np.testing.assert_allclose(current_at(SHEAR, PLACES), expected, rtol=0.0, atol=1e-15)


def test_water_of_a_vortex_neither_comes_nor_goes():
    slopes = gradient(lambda x: current_at(EDDY, x), PLACES, 1e-3)
    np.testing.assert_allclose(slopes[0, 0] + slopes[1, 1], 0.0, atol=1e-5)


def test_a_vortex_has_its_circulation_far_from_its_core_and_turns_rigidly_within():
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    directions = np.array([np.cos(angles), np.sin(angles)])
    for r, speed in ((600.0, 0.02 / 600.0), (6e-6, 0.02 * 6e-6 / 0.06**2)):
        u = current_at(EDDY, np.array([[0.1], [-0.05]]) + r * directions)
        np.testing.assert_allclose((u * directions).sum(axis=0), 0.0, atol=1e-8 * speed)
        np.testing.assert_allclose(directions[0] * u[1] - directions[1] * u[0], speed, rtol=1e-6)


def test_a_grid_has_its_samples_at_its_points_and_a_bilinear_current_everywhere():
    inside = PLACES[:, np.abs(PLACES[1]) < 0.375]
    np.testing.assert_allclose(current_at(grid(bilinear), inside), bilinear(*inside), rtol=0.0, atol=1e-14)


def test_a_grid_is_continuous_across_its_cells():
    rough = grid(lambda x, y: (np.sin(40.0 * x + y), np.cos(30.0 * y)))
    border = np.array([np.full(20, 0.125), np.linspace(-0.3, 0.3, 20)])
    beside = np.array([[1e-12], [0.0]])
    np.testing.assert_allclose(current_at(rough, border - beside), current_at(rough, border + beside), atol=1e-9)


def test_beyond_a_grid_the_current_is_that_of_the_nearest_edge_and_what_is_no_place_is_the_first_point():
    current = grid(bilinear)
    outside = np.array([[-9.0, 0.2, 9.0, np.nan], [0.1, 9.0, -9.0, np.nan]])
    nearest = np.array([[-0.5, 0.2, 0.5, -0.5], [0.1, 0.375, -0.375, -0.375]])
    np.testing.assert_allclose(current_at(current, outside), current_at(current, nearest), rtol=0.0, atol=1e-14)
