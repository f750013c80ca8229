"""Scenes that are known to be hard: no step that has not converged is accepted. Those with all terms: tests/fuzz."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import oracle
from continuum_oracle import Continuum
from hubs import HUBS, robot_with
from oracle import Star
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from simulator.test_conservation import rattled
from strokes import finished, ternary


def powers(smallest: float, largest: float) -> st.SearchStrategy[float]:
    """Powers of ten from 10^smallest to 10^largest."""
    return st.floats(smallest, largest).map(lambda exponent: 10.0**exponent)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Scenes far beyond those that anybody swims with, at steps from 10 microseconds to a second."""
    n_limbs, step = draw(st.integers(3, 5)), draw(powers(-5.0, 0.0))
    robot = robot_with(
        draw(st.sampled_from(HUBS)),
        n_limbs=n_limbs,
        nodes_per_limb=draw(st.integers(2, 5)),
        limb_length=draw(powers(-2.0, 0.0)),
        rod_radius=draw(powers(-5.0, -2.0)),
        youngs_modulus=draw(powers(2.0, 11.0)),
        density=draw(powers(2.0, 5.0)),
    )
    limit = 0.5 * (math.pi - robot.opening_angle)
    if robot.hub_hinge == "turning":
        limit = min(limit, 0.499 * robot.opening_angle)
    fluid = draw(st.none() | powers(-2.0, 4.0).map(lambda c: Water(drag_coefficient=c)))
    heating, cooling = (step * draw(st.integers(1, 2)) for _ in range(2))
    pulse = SmaPulse(draw(st.floats(0.0, 0.999)) * limit, heating, cooling)
    return Scene(robot, fluid, pulse, Numerics(step=step, max_iterations=draw(st.sampled_from([2, 5, 60]))))


HAIRS = Scene(
    Seastar(n_limbs=3, nodes_per_limb=2, limb_length=1.0, rod_radius=1e-5, density=100.0),
    Water(), SmaPulse(0.0, 1e-5, 1e-5), Numerics(step=1e-5, max_iterations=2),
)  # fmt: skip
"""Limbs of 100,000 radii, whose drag curves the potential so much that no Newton step foretells the next."""


@settings(derandomize=True, max_examples=200)
@example(HAIRS, 1.0, 24)
@given(scenes(), st.sampled_from([0.01, 1.0, 30.0]), st.integers(0, 1000))
def test_no_step_that_has_not_converged_is_accepted(scene, speed, seed):
    """The oracle's Newton step from where a time step ended is about the tolerance long."""
    simulator, robot, fluid = rattled(Simulator(scene, 2), speed, 0.1, seed=seed), scene.robot, scene.fluid
    kind = Continuum if robot.discretisation == "continuum" else Star
    star = kind(
        robot.n_limbs, robot.nodes_per_limb, robot.limb_length, robot.rod_radius, robot.youngs_modulus, robot.density,
        drag_coefficient=0.0 if fluid is None else fluid.drag_coefficient, hub_hinge=robot.hub_hinge,
    )  # fmt: skip
    commands, before = ternary(1, 2, seed, robot.n_limbs)[0], simulator.get_state()
    stroke = simulator.stroke_in_parts(commands, 4)
    time, after = next(stroke), simulator.get_state()
    _, report = finished(stroke)
    for k in np.flatnonzero((report.halvings == 0) & (report.energy_cuts == 0) & (after.time > 0.0)):
        h, delta_psi = scene.numerics.step, commands[k] * scene.actuator.delta_psi(time)
        assert time == pytest.approx(h)
        stage = (before.positions[k], before.velocities[k], h, delta_psi)
        gradient = oracle.incremental_gradient(star, after.positions[k], *stage)
        hessian = oracle.incremental_hessian(star, after.positions[k], before.positions[k], h, delta_psi)
        move = np.linalg.norm(oracle.descent(hessian, gradient), axis=1).max()
        assert move < 100.0 * scene.numerics.newton_tolerance * robot.limb_length
