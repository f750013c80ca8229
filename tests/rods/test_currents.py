"""Currents: velocities of the fluid at places, from the numbers of each kind."""

import numpy as np

from seastar_gym.lanes.plain import Lanes
from seastar_gym.rods.terms.current import GRID, VORTEX, Current, current_velocity
from slopes import plain

PLACES = np.random.default_rng(0).uniform(-0.4, 0.4, (2, 80))


def current_at(current: Current, places: np.ndarray) -> np.ndarray:
    return np.array(plain(current_velocity(current, *map(Lanes, places))))


def grid(function, n_x: int = 9, n_y: int = 7, spacing: float = 0.125) -> Current:
    """Samples of a current on points from (-0.5, -0.375) on."""
    x, y = -0.5 + spacing * np.arange(n_x), -0.375 + spacing * np.arange(n_y)
    samples = np.stack(function(*np.meshgrid(x, y, indexing="ij")), axis=-1)
    return Current(GRID, np.array([-0.5, -0.375, 1.0 / spacing]), n_x, n_y, samples.ravel())


def bilinear(x, y):
    return 0.1 + 0.3 * x - 0.5 * y + 2.0 * x * y, 0.2 * x + 0.05 * y


def test_a_vortex_has_its_circulation_far_from_its_core_and_turns_rigidly_within():
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    directions = np.array([np.cos(angles), np.sin(angles)])
    eddy = Current(VORTEX, np.array([0.1, -0.05, 0.02, 0.06**2]))
    for r, speed in ((600.0, 0.02 / 600.0), (6e-6, 0.02 * 6e-6 / 0.06**2)):
        u = current_at(eddy, np.array([[0.1], [-0.05]]) + r * directions)
        np.testing.assert_allclose((u * directions).sum(axis=0), 0.0, atol=1e-8 * speed)
        np.testing.assert_allclose(directions[0] * u[1] - directions[1] * u[0], speed, rtol=1e-6)


def test_a_grid_is_bilinear_between_its_samples_and_that_of_the_nearest_edge_beyond():
    """It is continuous across its cells, and what is no place is the first point."""
    current, inside = grid(bilinear), PLACES[:, np.abs(PLACES[1]) < 0.375]
    np.testing.assert_allclose(current_at(current, inside), bilinear(*inside), rtol=0.0, atol=1e-14)
    outside = np.array([[-9.0, 0.2, 9.0, np.nan], [0.1, 9.0, -9.0, np.nan]])
    nearest = np.array([[-0.5, 0.2, 0.5, -0.5], [0.1, 0.375, -0.375, -0.375]])
    np.testing.assert_allclose(current_at(current, outside), bilinear(*nearest), rtol=0.0, atol=1e-14)

    def rough(x, y):
        return np.sin(40.0 * x + y), np.cos(30.0 * y)

    border = np.array([np.full(7, 0.125), np.linspace(-0.375, 0.375, 7)])
    beside = np.array([[1e-12], [0.0]])
    for side in (border - beside, border, border + beside):
        np.testing.assert_allclose(current_at(grid(rough), side), rough(*border), atol=1e-9)
