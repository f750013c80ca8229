"""Gravity less buoyancy: free fall, terminal velocity, and what it leaves alone."""

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, Water

G = (1.5, -9.81)
STILL = np.zeros((1, 5))
MIDPOINT = Numerics("implicit-midpoint", 0.01, newton_tolerance=1e-10)


def test_a_robot_in_vacuum_falls_freely_with_whatever_density_and_taper():
    limbs = (Limb(radius=(2e-3, 1e-3)), Limb(), Limb(length=0.05), Limb(), Limb())
    robot = Seastar(nodes_per_limb=10, density=1300.0, limbs=limbs)
    simulator = Simulator(Scene(robot, None, numerics=MIDPOINT, gravity=G))
    at_rest = simulator.positions[0]
    simulator.stroke(STILL)
    np.testing.assert_allclose(simulator.velocities[0], np.tile(G, (46, 1)), rtol=1e-9)
    np.testing.assert_allclose(simulator.positions[0] - at_rest, np.tile(0.5 * np.array(G), (46, 1)), rtol=1e-9)


@pytest.mark.parametrize("density", [1100.0, 900.0])
def test_a_straight_limb_sinks_or_rises_broadside_with_its_terminal_velocity(density):
    radius, C_d = 1.6e-3, 1.2
    robot = Seastar(nodes_per_limb=10, n_limbs=1, density=density, rod_radius=radius)
    water = Water(drag_coefficient=C_d)
    simulator = Simulator(Scene(robot, water, SmaPulse(0.0), Numerics("sdirk2", 0.02), gravity=(0.0, -9.81)))
    for _ in range(5):
        simulator.stroke(np.zeros((1, 1)))
    # 1/2 rho_f C_d D v^2 = |rho_m - rho_f| A g, per length
    speed = np.sqrt(abs(density - 1000.0) * np.pi * radius**2 * 9.81 / (0.5 * 1000.0 * C_d * 2.0 * radius))
    sign = -1.0 if density > 1000.0 else 1.0
    np.testing.assert_allclose(simulator.velocities[0, :, 1], sign * speed, rtol=1e-6)
    np.testing.assert_allclose(simulator.velocities[0, :, 0], 0.0, atol=1e-9)


def test_limbs_as_dense_as_the_water_feel_no_gravity():
    simulator, floating = Simulator(Scene(TEN)), Simulator(Scene(TEN, gravity=G))
    for each in (simulator, floating):
        each.stroke([[0, 1, 0, 0, -1]])
    np.testing.assert_allclose(floating.positions, simulator.positions, rtol=0.0, atol=1e-15)


def test_weights_add_to_loads_and_differ_from_robot_to_robot():
    robots = Seastar(nodes_per_limb=10, density=np.array([1000.0, 2000.0]))
    scene = Scene(robots, None, numerics=MIDPOINT, gravity=(0.0, -1.0), loads=((0, 0.0, 1e-3),))
    simulator = Simulator(scene, 2)
    simulator.stroke(np.zeros((2, 5)))
    mass = 1000.0 * np.pi * 1.6e-3**2 * 0.5 * np.array([1.0, 2.0])
    centre = (simulator.velocities[..., 1] * simulator.coefficients.rods(0).mass[:, :2].T).sum(axis=1) / mass
    np.testing.assert_allclose(centre, 1e-3 / mass - 1.0, rtol=1e-6)
