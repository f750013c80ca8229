"""Cross sections of limbs: what a disc, a strip, a tube and a measured section weigh, resist and drag."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipe, ellipk, ellipkm1

from exact.solutions import let_pass, pause
from seastar_gym import (
    Disc,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Section,
    Simulator,
    SmaPulse,
    Strip,
    Tube,
    UniformCurrent,
    Water,
)
from seastar_gym.model import make_mesh, make_rods
from seastar_gym.scene.section import BROADSIDE, broadside
from unlike import robot_and_star

WIDTH, HEIGHT, E = 2e-3, 8e-3, 1e6
STRIP, TUBE = Strip(WIDTH, HEIGHT), Tube(2e-3, 1.2e-3)
MEASURED = Section(1.6e-5, None, 5e-3, added_area=3e-5, bending_stiffness=6e-6, mass_per_length=0.03, half_width=1.5e-3)
SECTIONS = {"strip": STRIP, "tube": TUBE, "measured": MEASURED}
WATER = Water(added_mass_coefficient=0.9, tangential_drag_coefficient=0.1, current=UniformCurrent())
"""With the machine code of every term."""
NUMERICS = Numerics("implicit-midpoint", 5e-3, newton_tolerance=1e-10)


def star(section, n_limbs=5, nodes=7, **others) -> Seastar:
    return Seastar(n_limbs, nodes, limbs=(Limb(section=section),) * n_limbs, **others)


def cut_of(section, density=1000.0):
    return star(section, density=density).limb_shapes()[0].cuts(density, np.array([0.5]))[0]


# Numbers of sections

FULL, HOLE = cut_of(Disc(TUBE.outer)), cut_of(Disc(TUBE.inner))
AREA = WIDTH * HEIGHT
CUTS = {
    "strip": (cut_of(STRIP), {
        "EI": E * HEIGHT * WIDTH**3 / 12.0, "area": AREA, "displaced": AREA, "inert": AREA, "width": HEIGHT,
        "reach": 0.5 * WIDTH, "added": 0.25 * np.pi * HEIGHT**2 * broadside(4.0),
    }),
    "tube": (cut_of(TUBE), {
        "EI": FULL.EI - HOLE.EI, "area": FULL.area - HOLE.area, "inert": FULL.area - HOLE.area,
        "displaced": FULL.area, "added": FULL.area, "width": FULL.width, "reach": FULL.reach,
    }),
    "measured": (cut_of(MEASURED, 1200.0), {
        "EI": 6e-6, "width": 5e-3, "added": 3e-5, "reach": 1.5e-3, "inert": 0.03 / 1200.0,
    }),
    "plain": (cut_of(Section(1.6e-5, 2e-11, 5e-3), 1200.0), {
        "EI": E * 2e-11, "inert": 1.6e-5, "area": 1.6e-5, "added": math.pi * 2.5e-3**2, "reach": 2.5e-3,
    }),
    "disc": (cut_of(Disc(1.6e-3)), {"thickness": 1.6e-3}),
}  # fmt: skip


@pytest.mark.parametrize("found, expected", CUTS.values(), ids=CUTS)
def test_sections_have_the_numbers_of_beam_theory_or_what_was_measured(found, expected):
    """And a thickness: the radius of the disc that bends as it stretches."""
    assert {name: getattr(found, name) for name in expected} == pytest.approx(expected)
    assert found.EI / (E * found.area) == pytest.approx(found.thickness**2 / 4.0)


def rectangle(alpha: float) -> tuple[float, float]:
    """Height over width of a rectangle, and its added mass along the width over that of the circle about its height.

    The outside of the unit circle becomes its outside by dz/dzeta = sqrt(1 - 2 cos(2 alpha)/zeta^2 + 1/zeta^4), so
    z = zeta + cos(2 alpha)/zeta + .., and added mass and displaced area are 2 pi (1 - cos(2 alpha)).
    """
    k, k_1 = math.sin(alpha) ** 2, math.cos(alpha) ** 2
    height = 4.0 * (ellipe(k) - k_1 * ellipk(k))
    width = 4.0 * (ellipe(k_1) - k * ellipkm1(k))
    return height / width, (4.0 * math.pi * k - height * width) / (0.25 * math.pi * height**2)


@pytest.mark.parametrize("alpha", [*np.geomspace(1e-3, 1.0, 20), 1.3, 1.5, 1.569])
def test_the_added_mass_of_strips_is_that_of_potential_flow(alpha):
    """In closed form, from a height of 1e-6 of the width to a thin plate broadside."""
    ratio, exact = rectangle(alpha)
    assert broadside(ratio) == pytest.approx(exact, rel=0.02)
    assert broadside(1e6) == pytest.approx(1.0, abs=1e-4)
    assert [broadside(one) for one, _ in BROADSIDE] == pytest.approx([value for _, value in BROADSIDE])


# Profiles, robots and data


def test_sections_may_be_profiles_and_differ_from_robot_to_robot():
    robot = star(Strip((2e-3, 1e-3), np.array([8e-3, 6e-3])))
    for k, height in enumerate((8e-3, 6e-3)):
        mesh = make_mesh(robot.limb_shapes(k), 7, 1000.0)
        np.testing.assert_allclose(mesh.at_nodes.area[0], np.linspace(2e-3, 1e-3, 7) * height)
        middles = 2e-3 - 1e-3 * (np.arange(6) + 0.5) / 6
        np.testing.assert_allclose(mesh.at_edges.reach[:6], 0.5 * middles)


# Swims


def swum(robot, water=WATER, strokes=2, **others):
    """Positions after some strokes [m]."""
    simulator = Simulator(Scene(replace(robot, relaxation_time=0.0), water, numerics=NUMERICS, **others))
    for command in ([1, 0, 0, -1, 0], [0, 1, -1, 0, 1])[:strokes]:
        assert not simulator.stroke([command]).status.any()
    return simulator.positions[0]


def test_a_disc_is_the_radius_to_the_last_bit():
    limbs = (Limb(radius=(2e-3, 1e-3)),) * 5
    sections = (Limb(section=Disc((2e-3, 1e-3))),) * 5
    np.testing.assert_array_equal(swum(Seastar(5, 7, limbs=limbs)), swum(Seastar(5, 7, limbs=sections)))


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_a_robot_swims_as_one_of_discs_with_the_same_numbers(section):
    """Discs of the section's thickness, whose material and water make up for the rest."""
    found = cut_of(section)
    disc = np.pi * found.thickness**2
    material = {"youngs_modulus": E * found.area / disc, "density": 1000.0 * found.inert / disc}
    robot = Seastar(5, 7, rod_radius=found.thickness, **material)
    ratio = found.width / (2.0 * found.thickness)
    water = replace(
        WATER, drag_coefficient=ratio * WATER.drag_coefficient,
        tangential_drag_coefficient=ratio * WATER.tangential_drag_coefficient,
        added_mass_coefficient=found.added / disc * WATER.added_mass_coefficient,
    )  # fmt: skip
    np.testing.assert_allclose(swum(star(section)), swum(robot, water), atol=1e-9)


@pytest.mark.parametrize("section", [*SECTIONS.values(), Disc(1.6e-3)], ids=[*SECTIONS, "disc"])
@pytest.mark.parametrize("density", [1300.0, 900.0])
def test_a_limb_sinks_or_rises_with_the_speed_at_which_drag_holds_its_weight(section, density):
    found, water = cut_of(section, density), Water(drag_coefficient=1.2)
    robot = star(section, n_limbs=1, nodes=10, density=density)
    simulator = Simulator(Scene(robot, water, SmaPulse(0.0), Numerics("sdirk2", 0.02), gravity=(0.0, -9.81)))
    for _ in range(4):
        simulator.stroke(np.zeros((1, 1)))
    weight = (density * found.inert - 1000.0 * found.displaced) * 9.81
    speed = -math.copysign(math.sqrt(abs(weight) / (0.5 * 1000.0 * water.drag_coefficient * found.width)), weight)
    np.testing.assert_allclose(simulator.velocities[0, :, 1], speed, rtol=1e-5)


# Robots of other shapes: one limb to twelve, uneven, tapered, curved; against the oracle and closed forms.


CLAMP = (0, 1)
"""Held nodes: the limb is then clamped in the middle of its root edge, see tests/exact/test_exact.py."""


def numbers(bundle) -> list:
    """All numbers and arrays of a bundle and of the bundles in it."""
    return [one for field in bundle for one in (numbers(field) if hasattr(field, "_fields") else [field])]


def test_limbs_with_nothing_of_their_own_are_the_robots_to_the_last_bit():
    plain, spelled_out = make_rods(Scene()), make_rods(Scene(Seastar(limbs=(Limb(),) * 5)))
    for one, other in zip(numbers(plain), numbers(spelled_out), strict=True):
        np.testing.assert_array_equal(one, other)
    evenly = tuple(Limb(2 * np.pi * j / 5, 0.1, 1.6e-3, (1e6, 1e6)) for j in range(5))
    for one, other in zip(numbers(plain), numbers(make_rods(Scene(Seastar(limbs=evenly)))), strict=True):
        np.testing.assert_allclose(np.asarray(one, float), np.asarray(other, float), rtol=1e-15)


@pytest.mark.parametrize("n_limbs", [1, 2])
def test_tapered_cantilevers_bend_as_cones_do(n_limbs):
    """A cone of root radius R and tip radius r under a tip load F: deflection F L^3/(3 E I_root) R/r, I of the root.

    One limb is the chapter's: a held edge clamps it in the middle. Two in line are clamped at their ends by a held
    rigid hub: both tips are loaded alike, so it does not turn.
    """
    load, errors = 1e-6, []
    for n in (6, 11, 21):
        taper = (Limb(radius=(2e-3, 1e-3)),) * n_limbs
        robot = Seastar(n_limbs, n, limbs=taper, discretisation="chapter" if n_limbs == 1 else "continuum")
        loads = tuple((tip, 0.0, load) for tip in (n - 1, 2 * n - 2)[:n_limbs])
        numerics, held = Numerics(step=0.5, newton_tolerance=1e-12), CLAMP if n_limbs == 1 else (0,)
        simulator = Simulator(Scene(robot, Water(), pause(8.0), numerics, held_nodes=held, loads=loads))
        let_pass(simulator)
        clamp = 0.5 / (n - 1) if n_limbs == 1 else 0.0  # of the length
        root, length = 2e-3 - 1e-3 * clamp, 0.1 * (1 - clamp)
        expected = load * length**3 / (3.0 * 1e6 * np.pi * root**4 / 4.0) * (root / 1e-3)
        errors.append(simulator.positions[0, -1, 1] / expected - 1.0)
    # Second order or better.
    assert abs(errors[0]) < 2e-3 and abs(errors[1]) < abs(errors[0]) / 4 and abs(errors[2]) < abs(errors[1]) / 4


def test_a_gap_wider_than_pi_is_never_the_smallest_opening_angle():
    robot, _ = robot_and_star("a gap wider than pi")
    report = Simulator(Scene(robot, actuator=SmaPulse(0.1), numerics=Numerics(step=0.01))).stroke(np.zeros((1, 3)))
    assert report.smallest_opening_angle[0] == pytest.approx(1.0)
