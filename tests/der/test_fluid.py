"""Terms that a scene may have, all together, against the oracle: fluids and material damping."""

from dataclasses import replace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from currents import CURRENTS, velocity
from oracle import Star
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from stages import RandomStages, random_shape, robot_and_star

TERMS = [("uniform", 0.0), ("shear", 0.02), ("vortex", 0.1), ("grid", 1.3)]
OF_HUBS = [("rigid", *terms) for terms in TERMS] + [("opening", *terms) for terms in TERMS]
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


@pytest.mark.parametrize("hub, current, along", OF_HUBS)
def test_potential_and_newton_direction_in_a_fluid_are_those_of_the_oracle(hub, current, along):
    robot, water, star = robot_water_and_star(hub, current, along, nodes_per_limb=4)
    scene = Scene(robot, water)
    stages = RandomStages(star, 1e-2, bend=0.05)
    found = stages.run(make_rods(scene))
    for lane in range(N_LANES):
        data = stages.data(lane)
        gradient = oracle.incremental_gradient(star, stages.q[lane], *data)
        direction = np.linalg.solve(stages.hessian(lane), gradient.ravel()).reshape(-1, 2)
        assert found.phi[lane] == pytest.approx(oracle.incremental_potential(star, stages.q[lane], *data), rel=1e-12)
        assert found.decrement[lane] == pytest.approx(np.sum(gradient * direction), rel=1e-11)
        np.testing.assert_allclose(found.direction[lane], direction, rtol=0.0, atol=1e-11 * np.abs(direction).max())


@pytest.mark.parametrize("hub_hinge", ["opening", "turning"])
def test_the_oracles_damping_has_the_slopes_of_its_potential(hub_hinge):
    star, rng = Star(3, 3, hub_hinge=hub_hinge, relaxation_time=TAU), np.random.default_rng(4)
    q_hat = random_shape(star, 0.3, 0.02, rng)
    q = q_hat + 1e-3 * rng.standard_normal(q_hat.shape)
    _, gradient, hessian = oracle.damping_potential(star, q, q_hat, 0.01)
    for k in range(q.size):
        step = np.zeros(q.size)
        step[k] = 1e-8
        moved = (q + step.reshape(q.shape), q - step.reshape(q.shape))
        ahead, behind = (oracle.damping_potential(star, x, q_hat, 0.01) for x in moved)
        assert gradient[k] == pytest.approx((ahead[0] - behind[0]) / 2e-8, rel=1e-5, abs=1e-6 * np.abs(gradient).max())
        column = (ahead[1] - behind[1]) / 2e-8
        np.testing.assert_allclose(hessian[:, k], column, rtol=1e-5, atol=1e-6 * np.abs(hessian).max())


@pytest.mark.parametrize("hub, current, along", OF_HUBS)
def test_the_oracles_drag_in_a_fluid_is_the_slope_of_its_potential(hub, current, along):
    _, _, star = robot_water_and_star(hub, current, along, nodes_per_limb=3)
    rng = np.random.default_rng(2)
    frozen, v = random_shape(star, 0.3, 0.01, rng), rng.standard_normal((star.n_nodes, 2))
    force, jacobian = oracle.drag_force(star, v, frozen), oracle.drag_jacobian(star, v, frozen)
    for k in range(v.size):
        step = np.zeros(v.size)
        step[k] = 1e-6
        ahead, behind = v + step.reshape(v.shape), v - step.reshape(v.shape)
        slope = (oracle.drag_potential(star, ahead, frozen) - oracle.drag_potential(star, behind, frozen)) / 2e-6
        assert -force.ravel()[k] == pytest.approx(slope, rel=1e-7, abs=1e-9)
        column = (oracle.drag_force(star, ahead, frozen) - oracle.drag_force(star, behind, frozen)).ravel() / 2e-6
        np.testing.assert_allclose(jacobian[:, k], column, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("hub, current, along", OF_HUBS)
def test_a_step_in_a_fluid_is_the_oracles(hub, current, along):
    h = 0.01
    robot, water, star = robot_water_and_star(hub, current, along, nodes_per_limb=4)
    numerics = Numerics("implicit-euler", h, newton_tolerance=1e-13)
    simulator = Simulator(Scene(robot, water, SmaPulse(0.3, 2.0 * h, 2.0 * h), numerics))
    rng = np.random.default_rng(3)
    q, v = random_shape(star, 0.05, 1e-3, rng), 0.02 * rng.standard_normal((star.n_nodes, 2))
    command = rng.uniform(-1.0, 1.0, 5)
    simulator.set_state((q[None], v[None], np.zeros(1)))
    stroke = simulator.stroke_in_parts(command[None], 4)
    next(stroke)
    q, v = oracle.step(star, q, v, 0.0, h, command, "implicit-euler", peak_angle=0.3, heating_time=0.02)
    np.testing.assert_allclose(simulator.positions[0], q, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(simulator.velocities[0], v, rtol=0.0, atol=1e-10)
