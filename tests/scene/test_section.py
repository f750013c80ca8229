"""Cross sections of limbs: what a disc, a strip, a tube and a measured section weigh, resist and drag."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import (
    Body,
    Contact,
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
    Water,
)
from seastar_gym.accuracy import chapters_certificate
from seastar_gym.model.mesh import make_mesh
from seastar_gym.model.rods import make_rods
from seastar_gym.scene.per_robot import numbers_of, unit_of, with_numbers
from seastar_gym.scene.section import BROADSIDE, broadside
from studies.verification import exact

WIDTH, HEIGHT, E = 2e-3, 8e-3, 1e6
STRIP, TUBE = Strip(WIDTH, HEIGHT), Tube(2e-3, 1.2e-3)
MEASURED = Section(
    1.6e-5, None, 5e-3, added_area=3e-5, bending_stiffness=6e-6, mass_per_length=0.03, half_width=1.5e-3
)
SECTIONS = {"strip": STRIP, "tube": TUBE, "measured": MEASURED}
WATER = Water(added_mass_coefficient=0.9, tangential_drag_coefficient=0.1)
NUMERICS = Numerics("implicit-midpoint", 5e-3, newton_tolerance=1e-10)


def star(section, n_limbs=5, nodes=7, **others) -> Seastar:
    return Seastar(n_limbs, nodes, limbs=(Limb(section=section),) * n_limbs, **others)


def cut_of(section, density=1000.0):
    return star(section, density=density).limb_shapes()[0].cuts(density, np.array([0.5]))[0]


# Numbers of sections


def test_a_strip_has_the_numbers_of_beam_theory():
    found = cut_of(STRIP)
    assert pytest.approx(E * HEIGHT * WIDTH**3 / 12.0) == found.EI
    assert found.area == found.displaced == found.inert == WIDTH * HEIGHT
    assert found.width == HEIGHT and found.reach == 0.5 * WIDTH


def test_a_tube_is_what_is_left_of_a_disc():
    full, hole, found = cut_of(Disc(TUBE.outer)), cut_of(Disc(TUBE.inner)), cut_of(TUBE)
    assert found.area == found.inert == pytest.approx(full.area - hole.area)
    assert pytest.approx(full.EI - hole.EI) == found.EI
    assert found.displaced == pytest.approx(full.area) and found.added == pytest.approx(full.area)
    assert (found.width, found.reach) == (full.width, full.reach)


def test_a_measured_section_has_what_was_measured_and_the_rest_follows():
    found = cut_of(MEASURED, density=1200.0)
    assert (found.EI, found.width, found.added, found.reach) == (6e-6, 5e-3, 3e-5, 1.5e-3)
    assert 1200.0 * found.inert == pytest.approx(0.03)
    plain = cut_of(Section(1.6e-5, 2e-11, 5e-3), density=1200.0)
    assert pytest.approx(E * 2e-11) == plain.EI and plain.inert == plain.area
    assert plain.added == pytest.approx(math.pi * 2.5e-3**2) and plain.reach == 2.5e-3


@pytest.mark.parametrize("section", [Disc(1.6e-3), *SECTIONS.values()], ids=str)
def test_a_thickness_is_the_radius_of_the_disc_that_bends_as_it_stretches(section):
    found = cut_of(section)
    assert found.EI / (E * found.area) == pytest.approx(found.thickness**2 / 4.0)


def added_mass_of_a_rectangle(height_over_width: float, n: int = 240) -> float:
    """Added mass of a rectangle that moves along its width, over that of the circle about its height, by sources.

    Sources on the sides make the normal velocity of the fluid that of the side. phi n_x is summed over the sides. Sides
    are divided finer towards the corners.
    """
    a, b = 0.5 / height_over_width, 0.5
    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, n + 1))
    corners = np.array([[a, -b], [a, b], [-a, b], [-a, -b], [a, -b]])
    ends = np.concatenate([p + shares[:-1, None] * (q - p) for p, q in itertools.pairwise(corners)])
    edges = np.roll(ends, -1, axis=0) - ends
    middle, length = ends + 0.5 * edges, np.hypot(*edges.T)
    normal = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / length[:, None]
    away = middle[:, None] - middle
    squared = (away**2).sum(axis=-1)
    np.fill_diagonal(squared, 1.0)
    flow = (away * normal[:, None]).sum(axis=-1) / squared * length / (2.0 * np.pi)
    np.fill_diagonal(flow, 0.5)
    strength = np.linalg.solve(flow, normal[:, 0])
    potential = 0.5 * np.log(squared)
    np.fill_diagonal(potential, np.log(0.5 * length) - 1.0)
    phi = potential @ (strength * length) / (2.0 * np.pi)
    return float(-(phi * normal[:, 0] * length).sum() / (np.pi * b**2))


@pytest.mark.parametrize("ratio", [0.1, 0.35, 1.0, 3.0, 10.0, 30.0])
def test_the_added_mass_of_strips_is_that_of_potential_flow(ratio):
    assert broadside(ratio) == pytest.approx(added_mass_of_a_rectangle(ratio), rel=0.03)


def test_the_added_mass_of_strips_goes_through_its_table_and_tends_to_that_of_a_plate():
    assert [broadside(ratio) for ratio, _ in BROADSIDE] == pytest.approx([value for _, value in BROADSIDE])
    assert broadside(1e6) == pytest.approx(1.0, abs=1e-4)
    assert cut_of(STRIP).added == pytest.approx(0.25 * np.pi * HEIGHT**2 * broadside(4.0))


# Profiles, robots and data


def test_sections_may_be_profiles_and_differ_from_robot_to_robot():
    robot = star(Strip((2e-3, 1e-3), np.array([8e-3, 6e-3])))
    for k, height in enumerate((8e-3, 6e-3)):
        mesh = make_mesh(robot.limb_shapes(k), 7, 1000.0)
        np.testing.assert_allclose(mesh.at_nodes.area[0], np.linspace(2e-3, 1e-3, 7) * height)
        middles = 2e-3 - 1e-3 * (np.arange(6) + 0.5) / 6
        np.testing.assert_allclose(mesh.at_edges.reach[:6], 0.5 * middles)


def test_numbers_of_sections_have_names_units_and_a_plain_form():
    scene = Scene(star(STRIP))
    assert numbers_of(scene)["robot.limbs.0.section.width"] == WIDTH
    assert unit_of(scene, "robot.limbs.0.section.width") == "m"
    for section in (*SECTIONS.values(), Disc((2e-3, 1e-3))):
        scene = Scene(star(section))
        assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    wider = with_numbers(Scene(star(STRIP)), {"robot.limbs.0.section.width": 3e-3})
    assert wider.robot.limbs[0].section == Strip(3e-3, HEIGHT) and wider.robot.limbs[1].section == STRIP


@pytest.mark.parametrize("section", [Strip(1.0, 1), Tube(2, 1), Section(1, 1, 1), Disc(1)], ids=str)
def test_whole_numbers_are_floats(section):
    assert all(isinstance(number, float) for number in numbers_of(section).values() if number is not None)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Strip(0.0, 1e-3), "A strip's width must be a positive"),
        (lambda: Strip(1e-3, (1e-3, 0.0)), "A strip's height must be positive all along it"),
        (lambda: Disc(()), "A disc's radius must be positive all along it"),
        (lambda: Tube(1e-3, 1e-3), "inner radius must be smaller"),
        (lambda: Tube((2e-3, 1e-3), 1.5e-3), "inner radius must be smaller"),
        (lambda: Tube(np.array([2e-3, 1e-3]), np.array([1e-3, 1.5e-3])), "inner radius must be smaller"),
        (lambda: Section(1e-5, None, 1e-3), "either a second_moment"),
        (lambda: Section(1e-5, 1e-11, 1e-3, bending_stiffness=1e-6), "either a second_moment"),
        (lambda: Limb(radius=1e-3, section=STRIP), "either a radius or a section"),
        (lambda: Limb(section=1e-3), "must be a Disc, Strip, Tube or Section"),
        (lambda: Scene(star(Strip(1e-200, 1e-200))), "overflow or vanish"),
        (lambda: Scene(star(Strip(1e150, 1e-3), body=Body(radius=0.02)), contact=Contact()), "overflow or vanish"),
    ],
)
def test_what_is_no_section_is_refused(make, words):
    with assert_refused(words):
        make()


def test_a_robot_of_strips_is_promised_no_error_of_discs():
    with assert_refused("differs in more than numerics", "certify"):
        chapters_certificate().require_valid(Scene(star(STRIP, nodes=12)))


# Swims


def swum(robot, water=WATER, strokes=2, **others):
    """Positions after some strokes [m]."""
    simulator = Simulator(Scene(robot, water, numerics=NUMERICS, **others))
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
    robot = Seastar(
        5, 7, rod_radius=found.thickness, youngs_modulus=E * found.area / disc, density=1000.0 * found.inert / disc
    )
    ratio = found.width / (2.0 * found.thickness)
    water = replace(
        WATER, drag_coefficient=ratio * WATER.drag_coefficient,
        tangential_drag_coefficient=ratio * WATER.tangential_drag_coefficient,
        added_mass_coefficient=found.added / disc * WATER.added_mass_coefficient,
    )  # fmt: skip
    np.testing.assert_allclose(swum(star(section)), swum(robot, water), atol=1e-9)


@pytest.mark.parametrize("section", [STRIP, TUBE], ids=["strip", "tube"])
def test_a_clamped_limb_rings_with_the_frequency_of_the_beam(section):
    """In its first mode, and in vacuum."""
    found = cut_of(section)
    root = exact.CANTILEVER_ROOTS[0]
    omega = (root / 0.1) ** 2 * math.sqrt(found.EI / (1000.0 * found.inert))
    h = 2.0 * np.pi / omega / 200
    robot = star(section, n_limbs=2, nodes=20)
    pulse = SmaPulse(0.0, heating_time=50 * h, cooling_time=50 * h)
    simulator = Simulator(Scene(robot, None, pulse, Numerics("implicit-midpoint", h, 1e-12), held_nodes=(0,)))
    state = simulator.get_state()
    state.positions[0, 1:, 1] += 2e-5 * np.tile(exact.cantilever_shape(root, np.arange(1, 20) / 19), 2)
    simulator.set_state(state)
    simulator.stroke(np.zeros((1, 2)))  # half a period
    np.testing.assert_allclose(simulator.positions[0, 19, 1], -2e-5, rtol=2e-3)


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_a_limb_sinks_with_the_speed_at_which_drag_holds_its_weight(section):
    found, water = cut_of(section, 1300.0), Water()
    robot = star(section, n_limbs=1, nodes=10, density=1300.0)
    simulator = Simulator(
        Scene(robot, water, SmaPulse(0.0), Numerics("sdirk2", 0.02), gravity=(0.0, -9.81))
    )
    for _ in range(4):
        simulator.stroke(np.zeros((1, 1)))
    weight = (1300.0 * found.inert - 1000.0 * found.displaced) * 9.81
    speed = -math.copysign(math.sqrt(abs(weight) / (0.5 * 1000.0 * water.drag_coefficient * found.width)), weight)
    np.testing.assert_allclose(simulator.velocities[0, :, 1], speed, rtol=1e-5)


def test_strips_touch_at_half_their_width():
    rods = make_rods(Scene(star(STRIP), contact=Contact()))
    assert rods.contact.thickness.max() == 0.5 * WIDTH
