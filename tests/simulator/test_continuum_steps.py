"""Steps of the continuum's discretisation are those of its dense oracle, in every scene that it has terms for."""

from typing import Any

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum, ContinuumShaped
from currents import CURRENTS, velocity
from oracle import Array, Star
from seastar_gym import Contact, Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.model.rods import make_rods

H, PEAK = 0.01, 0.3
PULSE = {"peak_angle": PEAK, "heating_time": 2.0 * H, "cooling_time": 2.0 * H}
UNLIKE = [
    (0.0, 0.08, (2e-3, 1e-3), (1e6, 2e6)),
    (1.0, 0.1, (1.6e-3, 1.2e-3), (1e6, 1e6)),
    (2.9, 0.06, (1e-3, 1e-3), (8e5, 1e6)),
    (4.5, 0.12, (2e-3, 1.8e-3), (1e6, 5e5)),
]
"""(direction, length, radii, moduli) of limbs."""
ACROSS = {"drag_coefficient": 1.3, "tangential_drag_coefficient": 0.2}
MASS = {"added_mass_coefficient": 0.8}
TAU = 4e-3


def shaped(
    limbs: list[tuple], nodes_per_limb: int, curvatures: tuple[float, ...], **terms: Any
) -> tuple[Seastar, Star]:
    """A robot of unlike limbs for the kernels and for the oracle."""
    directions, lengths, radii, moduli = zip(*limbs, strict=True)
    star = ContinuumShaped(
        len(limbs), nodes_per_limb, directions=directions, lengths=lengths, radii=radii, moduli=moduli,
        curvatures=curvatures, **terms,
    )  # fmt: skip
    own = tuple(Limb(*limb, curvature) for limb, curvature in zip(limbs, curvatures, strict=True))
    return Seastar(len(limbs), nodes_per_limb, limbs=own, discretisation="continuum"), star


def alike(n_limbs: int, nodes_per_limb: int, **terms: Any) -> tuple[Seastar, Star]:
    """A robot of equal limbs for the kernels and for the oracle."""
    return Seastar(n_limbs, nodes_per_limb, discretisation="continuum"), Continuum(n_limbs, nodes_per_limb, **terms)


def make_scene(robot: Seastar, fluid: Water | None = Water(), scheme: str = "implicit-euler", **parts: Any) -> Scene:
    """The scene, with a short stroke of four steps and a tight tolerance."""
    pulse = SmaPulse(0.0 if robot.n_limbs == 1 else PEAK, 2.0 * H, 2.0 * H)
    return Scene(robot, fluid, pulse, Numerics(scheme, H, newton_tolerance=1e-13), **parts)


def moving(star: Star, seed: int = 3) -> tuple[Array, Array, Array]:
    """Positions and velocities of a bent robot that moves, and its command; held nodes are at rest."""
    rng = np.random.default_rng(seed)
    free = star.free.reshape(-1, 2)
    q = star.rest + 2e-5 * free * rng.standard_normal(star.rest.shape)
    return q, 0.02 * free * rng.standard_normal(q.shape), rng.uniform(-1.0, 1.0, star.n_limbs)


def assert_steps_agree(scene: Scene, star: Star, n_steps: int = 4) -> None:
    """The first steps of a stroke of four end where the oracle's do.

    Its second step on, a stage's first guess remembers accelerations; what is frozen there is then not the oracle's.
    """
    simulator, (q, v, command) = Simulator(scene), moving(star)
    simulator.set_state((q[None], v[None], np.zeros(1)))
    at_rest = oracle.elastic_energy(star, q, np.zeros(star.n_limbs))
    assert simulator.elastic_energy()[0] == pytest.approx(at_rest, rel=1e-10)
    assert simulator.kinetic_energy()[0] == pytest.approx(oracle.kinetic_energy(star, v), rel=1e-12)
    stroke = simulator.stroke_in_parts(command[None], 4)
    for k in range(n_steps):
        next(stroke)
        q, v = oracle.step(star, q, v, k * H, H, command, scene.numerics.scheme, **PULSE)
    np.testing.assert_allclose(simulator.positions[0], q, rtol=0.0, atol=1e-12 * star.limb_length)
    np.testing.assert_allclose(simulator.velocities[0], v, rtol=0.0, atol=1e-10 * np.abs(v).max())


# Coefficients


@pytest.mark.parametrize("curvatures", [(0.0, 0.0, 0.0, 0.0), (2.0, -1.0, 3.0, -4.0)])
def test_rest_shape_and_coefficients_are_those_of_the_oracle(curvatures):
    robot, star = shaped(UNLIKE, 5, curvatures, fluid_density=900.0, **ACROSS, **MASS)
    rods = make_rods(make_scene(robot, Water(900.0, **ACROSS, **MASS)))
    np.testing.assert_allclose(robot.nodes(), star.rest, atol=1e-15)
    np.testing.assert_allclose(rods.mass, star.masses, rtol=1e-13)
    np.testing.assert_allclose(rods.edge_mass, star.edge_mass, rtol=1e-13)
    np.testing.assert_allclose(np.concatenate([rods.drag, 8.0 * rods.middle_drag]), star.drag_places[1], rtol=1e-13)
    np.testing.assert_allclose(8.0 * rods.middle_cross_drag, star.cross_drag * 4.0 / 3.0, rtol=1e-13)
    np.testing.assert_allclose(rods.edge_added_mass, star.added_mass_coupling, rtol=1e-13)
    hinges = rods.bending.EI_over_dl.reshape(4, -1)
    np.testing.assert_allclose(hinges[:, 0], [clamp.stiffness for clamp in star.clamps], rtol=1e-13)
    np.testing.assert_allclose(hinges[:, 1:].ravel(), star.hinge_EI / star.hinge_dl, rtol=1e-13)


# Steps of robots in water


@pytest.mark.parametrize("scheme", oracle.TABLEAUS)
def test_four_steps_of_the_plain_robot_are_those_of_the_oracle(scheme):
    robot, star = alike(5, 10)
    assert_steps_agree(make_scene(robot, scheme=scheme), star)


@pytest.mark.parametrize("n_limbs, nodes_per_limb", [(1, 5), (2, 4), (3, 2), (5, 3), (12, 4)])
def test_four_steps_with_other_numbers_of_limbs_and_nodes_are_those_of_the_oracle(n_limbs, nodes_per_limb):
    robot, star = alike(n_limbs, nodes_per_limb)
    assert_steps_agree(make_scene(robot, scheme="implicit-midpoint"), star)


@pytest.mark.parametrize("fluid", [None, Water()])
@pytest.mark.parametrize("n_limbs", [2, 4])
def test_four_steps_of_unlike_limbs_are_those_of_the_oracle(n_limbs, fluid):
    robot, star = shaped(UNLIKE[:n_limbs], 5, (0.0,) * n_limbs, drag_coefficient=1.0 if fluid else 0.0)
    # The energy guard cuts what the implicit midpoint lets an undamped robot gain, and the oracle has no guard.
    assert_steps_agree(make_scene(robot, fluid, "sdirk2"), star)


HELD = {"held_nodes": (0, 1, 2)}
PULLED = {"loads": ((4, 2e-4, -1e-4), (7, 0.0, 3e-4)), "gravity": (1.0, -9.81)}


@pytest.mark.parametrize("parts", [HELD, PULLED, HELD | PULLED], ids=["held", "pulled", "both"])
def test_four_steps_of_a_robot_held_or_pulled_are_those_of_the_oracle(parts):
    robot, star = alike(5, 4, fluid_density=900.0, **parts)
    assert_steps_agree(make_scene(robot, Water(900.0), "implicit-midpoint", **parts), star)


@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint"])
@pytest.mark.parametrize("current", CURRENTS)
def test_a_step_in_a_current_is_the_oracles(current, scheme):
    robot, star = alike(5, 4, current=lambda places: velocity(current, places))
    assert_steps_agree(make_scene(robot, Water(current=CURRENTS[current]), scheme), star, n_steps=1)


# Steps with the terms that a robot and its fluid may have


@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint"])
@pytest.mark.parametrize("n_limbs", [1, 4])
def test_four_steps_of_curved_limbs_are_those_of_the_oracle(n_limbs, scheme):
    robot, star = shaped(UNLIKE[:n_limbs], 5, (2.0, -1.0, 3.0, -4.0)[:n_limbs])
    assert_steps_agree(make_scene(robot, scheme=scheme), star)


@pytest.mark.parametrize("terms", [ACROSS, MASS, ACROSS | MASS], ids=["drag", "mass", "both"])
@pytest.mark.parametrize("unlike", [False, True])
def test_a_step_with_drag_and_mass_across_limbs_is_the_oracles(unlike, terms):
    robot, star = shaped(UNLIKE, 4, (0.0,) * 4, **terms) if unlike else alike(5, 4, **terms)
    assert_steps_agree(make_scene(robot, Water(**terms)), star, n_steps=1)


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk2", "implicit-midpoint"])
@pytest.mark.parametrize("n_limbs, nodes_per_limb", [(1, 5), (2, 4), (5, 2), (5, 5)])
def test_four_steps_with_damping_are_those_of_the_oracle(n_limbs, nodes_per_limb, scheme):
    star = Continuum(n_limbs, nodes_per_limb, relaxation_time=TAU)
    robot = Seastar(n_limbs, nodes_per_limb, relaxation_time=TAU, discretisation="continuum")
    assert_steps_agree(make_scene(robot, scheme=scheme), star)


@pytest.mark.parametrize("current", ["shear", "vortex"])
def test_a_step_with_every_term_is_the_oracles(current):
    limbs, curvatures, parts = UNLIKE, (2.0, -1.0, 3.0, -4.0), {"loads": PULLED["loads"], "gravity": (1.0, -9.81)}
    fluid = {**ACROSS, **MASS}
    _, star = shaped(
        limbs, 5, curvatures, fluid_density=900.0, current=lambda places: velocity(current, places),
        relaxation_time=TAU, **fluid, **parts,
    )  # fmt: skip
    own = tuple(Limb(*limb, curvature) for limb, curvature in zip(limbs, curvatures, strict=True))
    robot = Seastar(4, 5, limbs=own, relaxation_time=TAU, discretisation="continuum")
    assert_steps_agree(make_scene(robot, Water(900.0, **fluid, current=CURRENTS[current]), **parts), star, n_steps=1)


def test_limbs_that_touch_push_each_other_as_the_oracle_says():
    """Limbs 1 and 2 folded onto each other: the stage ends where all forces and those of the touches balance."""
    h, opening = 2e-4, 0.3
    robot, star = alike(5, 4)
    numerics = Numerics("implicit-euler", h, newton_tolerance=1e-13)
    simulator = Simulator(
        Scene(robot, Water(), SmaPulse(0.0, 2.0 * h, 2.0 * h), numerics, contact=Contact(opening_angle=opening))
    )
    rng, q_0 = np.random.default_rng(0), star.rest.copy()
    for limb, angle in ((0, 0.588), (1, -0.588)):
        own, (c, s) = [star.node(limb, i) for i in range(1, 4)], (np.cos(angle), np.sin(angle))
        q_0[own] = q_0[own] @ np.array([[c, s], [-s, c]])
    q_0 += 2e-5 * rng.standard_normal(q_0.shape)
    v_0 = 1e-3 * rng.standard_normal(q_0.shape)
    simulator.set_state((q_0[None], v_0[None], np.zeros(1)))
    stroke = simulator.stroke_in_parts(np.zeros((1, 5)), 4)
    next(stroke)
    q = simulator.positions[0]
    found = oracle.touches(star, q_0 + h * v_0, q_0, opening)
    pushes = np.array([touch.stiffness * touch.depth(q) * touch.gradient for touch in found])
    assert np.count_nonzero(pushes.any(axis=1)) > 3
    residual = oracle.incremental_gradient(star, q, q_0, v_0, h, np.zeros(5)).ravel() - pushes.sum(axis=0)
    np.testing.assert_allclose(residual, 0.0, atol=1e-11 * np.abs(pushes).max())
