"""Steps are those of the dense oracles, in every scene that they have terms for."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import oracle
from continuum_oracle import Bent, Continuum, ContinuumShaped
from currents import CURRENTS, NONE, velocity
from oracle import Array, Star
from seastar_gym import (
    AlongLimb,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    Stiffening,
    Strip,
    UniformCurrent,
    Water,
)
from seastar_gym.scene.robot import HubHinge
from stages import random_shape
from unlike import DIFFERENT, robot_and_star

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
    return Seastar(len(limbs), nodes_per_limb, limbs=own, relaxation_time=terms.get("relaxation_time")), star


def alike(n_limbs: int, nodes_per_limb: int, **terms: Any) -> tuple[Seastar, Star]:
    """A robot of equal limbs for the kernels and for the oracle."""
    own = {name: terms[name] for name in ("relaxation_time",) if name in terms}
    return Seastar(n_limbs, nodes_per_limb, **own), Continuum(n_limbs, nodes_per_limb, **terms)


def stripped(n_limbs: int, nodes_per_limb: int, **terms: Any) -> tuple[Seastar, Star]:
    """A robot whose limbs are strips for the kernels and for the oracle."""
    limbs = (Limb(section=Strip(2e-3, 4e-3)),) * n_limbs
    added = 1.36 * np.pi * 2e-3**2  # twice as high as wide, see DNV-RP-C205
    star = Continuum(n_limbs, nodes_per_limb, strip=(2e-3, 4e-3, added), **terms)
    return Seastar(n_limbs, nodes_per_limb, limbs=limbs, relaxation_time=terms.get("relaxation_time")), star


def hinged(hub: HubHinge, n_limbs: int, nodes_per_limb: int, **terms: Any) -> tuple[Seastar, Star]:
    """A robot of the chapter's discretisation for the kernels and for the oracle."""
    own = {name: terms[name] for name in ("relaxation_time",) if name in terms}
    robot = Seastar(n_limbs, nodes_per_limb, hub_hinge=hub, discretisation="chapter", **own)
    return robot, Star(n_limbs, nodes_per_limb, hub_hinge=hub, **terms)


def make_scene(
    robot: Seastar, fluid: Water | None = Water(), scheme: str = "implicit-euler", damping: float = 0.0, **parts: Any
) -> Scene:
    """The scene, with a short stroke of four steps and a tight tolerance."""
    pulse = SmaPulse(0.0 if robot.n_limbs == 1 else PEAK, 2.0 * H, 2.0 * H)
    return Scene(robot, fluid, pulse, Numerics(scheme, H, newton_tolerance=1e-13, damping=damping), **parts)


def moving(star: Star, seed: int = 3) -> tuple[Array, Array, Array]:
    """Positions and velocities of a bent robot that moves, and its command; held nodes are at rest."""
    rng = np.random.default_rng(seed)
    free = star.free.reshape(-1, 2)
    bent = random_shape(star, 0.05, 1e-3, rng) if type(star) is Star else star.rest
    q = bent + 2e-5 * free * rng.standard_normal(star.rest.shape)
    return q, 0.02 * free * rng.standard_normal(q.shape), rng.uniform(-1.0, 1.0, star.n_limbs)


def assert_steps_agree(scene: Scene, star: Star, n_steps: int = 4) -> None:
    """The first steps of a stroke of four end where the oracle's do.

    Its second step on, a stage's first guess remembers accelerations; what is frozen there is then not the oracle's.
    """
    simulator, (q, v, command) = Simulator(scene), moving(star)
    simulator.set_state((q[None], v[None], np.zeros(1)))
    still, turns = star.turned(np.zeros(star.n_limbs))
    assert simulator.elastic_energy()[0] == pytest.approx(oracle.elastic_energy(still, q, turns), rel=1e-10)
    assert simulator.kinetic_energy()[0] == pytest.approx(oracle.kinetic_energy(star, v), rel=1e-12)
    stroke = simulator.stroke_in_parts(command[None], 4)
    for k in range(n_steps):
        next(stroke)
        numerics = scene.numerics
        q, v = oracle.step(star, q, v, k * H, H, command, numerics.scheme, numerics.damping, **PULSE)
    np.testing.assert_allclose(simulator.positions[0], q, rtol=0.0, atol=1e-12 * star.limb_length)
    np.testing.assert_allclose(simulator.velocities[0], v, rtol=0.0, atol=1e-10 * np.abs(v).max())


# Steps

BENT = Bent(
    3, 5, directions=(0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0), lengths=(0.1,) * 3, radii=((1.6e-3,) * 2,) * 3,
    moduli=((1e6,) * 2,) * 3, curvatures=(0.0,) * 3, share=0.8, ratio=2.5, peak=PEAK, relaxation_time=2e-3,
)  # fmt: skip
TWIN = Seastar(3, 5, along=AlongLimb(0.8), stiffening=Stiffening(2.5), relaxation_time=2e-3)
CURVED = (2.0, -1.0, 3.0, -4.0)
HELD = {"held_nodes": (0, 1, 2)}
PULLED = {"loads": ((4, 2e-4, -1e-4), (7, 0.0, 3e-4)), "gravity": (1.0, -9.81)}
EVERY = {**ACROSS, **MASS}


def flowing(current: str) -> dict[str, Any]:
    """The oracle's current."""
    return {"current": lambda places: velocity(current, places)}


def cases() -> Iterator[Any]:
    """Robot and star, scheme, steps, and the fluid and other parts of the scene."""

    def case(name: str, twins: tuple[Seastar, Star], scheme: str, n_steps: int = 4, **parts: Any) -> Any:
        return pytest.param(twins, scheme, n_steps, parts, id=f"{name}-{scheme}")

    for scheme in oracle.TABLEAUS:
        yield case("plain", alike(5, 10), scheme)
        for hub, *shape in (("opening", 5, 10), ("turning", 5, 3), ("opening", 3, 2)):
            yield case(f"{hub}-{shape}", hinged(hub, *shape), scheme)
        yield case("opening-vacuum", hinged("opening", 4, 4, drag_coefficient=0.0), scheme, fluid=None)
    for name in DIFFERENT:
        for scheme in ("implicit-euler", "implicit-midpoint"):
            yield case(name, robot_and_star(name), scheme)
        fluid = Water(**EVERY, current=UniformCurrent())
        robot, star = robot_and_star(name, **EVERY)
        twins = replace(robot, relaxation_time=0.0), star  # with the machine code of every term
        yield case(f"{name} in a fluid", twins, "implicit-euler", 1, fluid=fluid)
    for shape in ((1, 5), (2, 4), (3, 2), (5, 3), (12, 4)):
        yield case(f"{shape}", alike(*shape), "implicit-midpoint")
    for n in (2, 4):
        # The energy guard cuts what the implicit midpoint lets an undamped robot gain, and the oracle has no guard.
        yield case(f"{n} unlike", shaped(UNLIKE[:n], 5, (0.0,) * n), "sdirk2")
        yield case(f"{n} unlike-vacuum", shaped(UNLIKE[:n], 5, (0.0,) * n, drag_coefficient=0.0), "sdirk2", fluid=None)
    for name, parts in {"held": HELD, "pulled": PULLED, "both": HELD | PULLED}.items():
        twins = alike(5, 4, fluid_density=900.0, **parts)
        yield case(name, twins, "implicit-midpoint", fluid=Water(900.0), **parts)
    for scheme in ("implicit-euler", "implicit-midpoint"):
        for n in (1, 4):
            yield case(f"{n} curved", shaped(UNLIKE[:n], 5, CURVED[:n]), scheme)
        for name, current in CURRENTS.items():
            yield case(name, alike(5, 4, **flowing(name)), scheme, 1, fluid=Water(current=current))
    yield case("strips", stripped(5, 10), "implicit-midpoint")
    terms = {"fluid_density": 900.0, "relaxation_time": TAU, **EVERY, **flowing("shear")}
    fluid = Water(900.0, **EVERY, current=CURRENTS["shear"])
    yield case("every term-strips", stripped(4, 5, **terms), "implicit-euler", 1, fluid=fluid)
    for scheme, *shape in (("implicit-euler", 1, 5), ("sdirk2", 2, 4), ("implicit-midpoint", 5, 2), ("sdirk2", 5, 5)):
        yield case(f"damped-{shape}", alike(*shape, relaxation_time=TAU), scheme, fluid=NONE)
    for name, along in (("uniform", 0.0), ("shear", 0.02), ("vortex", 0.1), ("grid", 1.3)):
        terms = {"drag_coefficient": 1.3, "tangential_drag_coefficient": along, **MASS}
        fluid, more = Water(950.0, **terms, current=CURRENTS[name]), {"fluid_density": 950.0, "relaxation_time": TAU}
        for make in (alike, partial(hinged, "opening")):
            twins = make(5, 4, **terms, **more, **flowing(name))
            yield case(f"every term-{name}-{type(twins[1]).__name__}", twins, "implicit-euler", 1, fluid=fluid)
    for name in ("shear", "vortex"):
        twins = shaped(UNLIKE, 5, CURVED, fluid_density=900.0, relaxation_time=TAU, **EVERY, **flowing(name))
        fluid = Water(900.0, **EVERY, current=CURRENTS[name])
        yield case(f"every term-{name}-unlike", twins, "implicit-euler", 1, fluid=fluid)
    for scheme in ("implicit-euler", "implicit-midpoint"):
        yield case("bent along and stiffer", (TWIN, BENT), scheme, 3)
    pulled = HELD | PULLED
    for name, twins, parts in (
        ("plain", alike(5, 10), {}),
        ("vacuum", hinged("opening", 4, 4, drag_coefficient=0.0), {"fluid": None}),
        ("damped", alike(5, 5, relaxation_time=TAU), {"fluid": NONE}),
        ("unlike and curved", shaped(UNLIKE[:3], 5, CURVED[:3]), {}),
        ("held and pulled", alike(5, 4, fluid_density=900.0, **pulled), {"fluid": Water(900.0), **pulled}),
    ):
        for damping in (0.002, 0.3):
            yield case(f"{name}-damping {damping}", twins, "implicit-midpoint", damping=damping, **parts)


@pytest.mark.parametrize("twins, scheme, n_steps, parts", [*cases()])
def test_steps_are_those_of_the_oracle(twins, scheme, n_steps, parts):
    robot, star = twins
    assert_steps_agree(make_scene(robot, scheme=scheme, **parts), star, n_steps)


def test_limbs_that_touch_push_each_other_as_the_oracle_says():
    """Limbs 1 and 2 folded onto each other: the stage ends where all forces and those of the touches balance."""
    h, opening = 2e-4, 0.3
    robot, star = alike(5, 4)
    numerics, contact = Numerics("implicit-euler", h, newton_tolerance=1e-13), Contact(opening_angle=opening)
    simulator = Simulator(Scene(robot, Water(), SmaPulse(0.0, 2.0 * h, 2.0 * h), numerics, contact=contact))
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
