"""Currents: velocities of the fluid at places, from the numbers of each kind."""

import numpy as np

from seastar_gym.der.terms.current import GRID, LINEAR, VORTEX, Current, current_velocity
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import gradient, plain

PLACES = np.random.default_rng(0).uniform(-0.4, 0.4, (2, 80))
GRADIENT = np.array([[0.3, -0.5], [0.2, -0.3]])
SHEAR = Current(LINEAR, np.array([0.1, -0.2, *GRADIENT.ravel()]))
EDDY = Current(VORTEX, np.array([0.1, -0.05, 0.02, 0.06**2]))


def velocity(current: Current, places: np.ndarray) -> np.ndarray:
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
    np.testing.assert_allclose(velocity(SHEAR, PLACES), expected, rtol=0.0, atol=1e-15)


def test_water_of_a_vortex_neither_comes_nor_goes():
    slopes = gradient(lambda x: velocity(EDDY, x), PLACES, 1e-3)
    np.testing.assert_allclose(slopes[0, 0] + slopes[1, 1], 0.0, atol=1e-5)


def test_a_vortex_has_its_circulation_far_from_its_core_and_turns_rigidly_within():
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    directions = np.array([np.cos(angles), np.sin(angles)])
    for r, speed in ((600.0, 0.02 / 600.0), (6e-6, 0.02 * 6e-6 / 0.06**2)):
        u = velocity(EDDY, np.array([[0.1], [-0.05]]) + r * directions)
        np.testing.assert_allclose((u * directions).sum(axis=0), 0.0, atol=1e-8 * speed)
        np.testing.assert_allclose(directions[0] * u[1] - directions[1] * u[0], speed, rtol=1e-6)


def test_a_grid_has_its_samples_at_its_points_and_a_bilinear_current_everywhere():
    inside = PLACES[:, np.abs(PLACES[1]) < 0.375]
    np.testing.assert_allclose(velocity(grid(bilinear), inside), bilinear(*inside), rtol=0.0, atol=1e-14)


def test_a_grid_is_continuous_across_its_cells():
    rough = grid(lambda x, y: (np.sin(40.0 * x + y), np.cos(30.0 * y)))
    border = np.array([np.full(20, 0.125), np.linspace(-0.3, 0.3, 20)])
    beside = np.array([[1e-12], [0.0]])
    np.testing.assert_allclose(velocity(rough, border - beside), velocity(rough, border + beside), atol=1e-9)


def test_beyond_a_grid_the_current_is_that_of_the_nearest_edge_and_what_is_no_place_is_the_first_point():
    current = grid(bilinear)
    outside = np.array([[-9.0, 0.2, 9.0, np.nan], [0.1, 9.0, -9.0, np.nan]])
    nearest = np.array([[-0.5, 0.2, 0.5, -0.5], [0.1, 0.375, -0.375, -0.375]])
    np.testing.assert_allclose(velocity(current, outside), velocity(current, nearest), rtol=0.0, atol=1e-14)
