"""Added mass: half an edge drags fluid along across itself, and none along itself."""

import numpy as np
import pytest

from seastar_gym import Scene, Seastar, Water
from seastar_gym.der.rods import make_work
from seastar_gym.der.terms.added_mass import add_fluid_energy, add_fluid_inertia, fluid_momentum, freeze_added_mass
from seastar_gym.der.terms.fluid import freeze_normals
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import NO_RODS, NO_WORK, gradient, plain, rotated, rows, symmetric

ROBOT = Seastar(nodes_per_limb=4)
WATER = Water(1000.0, added_mass_coefficient=0.7)
RODS = make_rods(Scene(ROBOT, WATER))
OF_AN_EDGE = 1000.0 * 0.7 * np.pi * ROBOT.rod_radius**2 * ROBOT.edge_length
NOTHING = (Lanes(0.0), (Lanes(0.0), Lanes(0.0)), (Lanes(0.0), Lanes(0.0), Lanes(0.0)))



def frozen(angle: float = 0.0):
    """Memory of the robot at rest, turned."""
    work = make_work(RODS, 1)
    freeze_normals.plain(RODS, work, rows(rotated(ROBOT.nodes(), angle)))
    freeze_added_mass.plain(RODS, work)
    return work


def energy(work, velocities: np.ndarray, frame=(0.0, 0.0)) -> float:
    """Kinetic energy of the fluid [J], as seen from a frame that moves with a velocity."""
    v = rows(np.broadcast_to(velocities, (ROBOT.n_nodes, 2)))
    return float(plain(add_fluid_energy.plain(RODS, work, v, frame, Lanes(0.0)))[0])


def test_all_edges_together_weigh_on_their_nodes_what_they_drag_along():
    mass = frozen().added_mass.reshape(-1, 3, N_LANES)
    np.testing.assert_allclose((mass[:, 0] + mass[:, 2]).sum(axis=0), 15 * OF_AN_EDGE, rtol=1e-12)


def test_a_limb_that_slides_along_itself_moves_no_fluid():
    """Limb 1 lies along x: its nodes have mass across, in y, alone."""
    np.testing.assert_allclose(frozen().added_mass[6:9, 0], [0.0, 0.0, OF_AN_EDGE], rtol=1e-12, atol=1e-20)
    assert plain(fluid_momentum.plain(frozen(), 2, Lanes(0.3), Lanes(0.0)))[0][0] == pytest.approx(0.0, abs=1e-20)


def test_a_star_of_five_limbs_moves_the_same_fluid_in_every_direction():
    directions = [np.array([np.cos(x), np.sin(x)]) for x in np.linspace(0.0, 2.0, 5)]
    np.testing.assert_allclose([energy(frozen(), d) for d in directions], 15 * OF_AN_EDGE / 4.0, rtol=1e-12)


def test_robot_and_motion_turned_together_have_the_same_energy():
    v = np.random.default_rng(0).standard_normal((ROBOT.n_nodes, 2))
    turned = energy(frozen(1.1), rotated(v, 1.1))
    assert turned == pytest.approx(energy(frozen(), v), rel=1e-12)


def test_seen_from_a_frame_that_moves_along_fluid_is_at_rest():
    assert energy(frozen(), np.array([0.3, -0.2]), (0.3, -0.2)) == 0.0


def test_inertia_has_the_derivatives_of_its_energy_and_a_mass_that_is_never_negative():
    gamma, node = 0.01, 7
    work = NO_WORK._replace(added_mass=frozen(0.4).added_mass[:, :1])
    q = gamma * np.random.default_rng(1).standard_normal((2, 20))

    def slopes(q):
        d = map(Lanes, q / gamma)
        found = add_fluid_inertia.plain(work, node, *d, Lanes(1.0 / gamma), NOTHING)
        return plain(found[0]), np.array(plain(found[1])), symmetric(found[2])

    _, force, hessian = slopes(q)
    np.testing.assert_allclose(force, gradient(lambda q: slopes(q)[0], q, 1e-4), rtol=1e-8, atol=1e-12)
    columns = gradient(lambda q: slopes(q)[1], q, 1e-4)
    np.testing.assert_allclose(columns, np.broadcast_to(hessian, columns.shape), rtol=1e-8, atol=1e-9)
    assert np.linalg.eigvalsh(hessian[..., 0])[0] > -1e-15


def test_without_added_mass_slopes_and_energy_stay_what_they_are():
    assert add_fluid_inertia.plain(NO_WORK, 1, None, None, None, NOTHING) is NOTHING
    assert add_fluid_energy.plain(NO_RODS, NO_WORK, None, None, 3.0) == 3.0
