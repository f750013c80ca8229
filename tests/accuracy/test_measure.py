"""The measurer of errors: commands, swims, errors of space and of time, and speeds."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from currents import CURRENTS
from seastar_gym import Body, Numerics, Scene, Seastar, Simulator, SmaWires, UniformCurrent
from seastar_gym.accuracy import commands, measure, resonance
from seastar_gym.accuracy.certificate import at, resolved
from seastar_gym.scene.numerics import Resolution
from seastar_gym.scene.robot import SILICONE

SCENE = Scene(Seastar(limb_length=0.08))


@pytest.mark.parametrize("n_limbs", [1, 2, 3, 5, 12])
def test_classes_are_drawn_for_any_number_of_limbs(n_limbs):
    drawn = commands.draw_batch(4, n_limbs, 0).joined
    assert drawn.shape == (commands.STROKES, 4 * len(commands.CLASSES), n_limbs)
    assert np.abs(drawn).max() <= 1.0
    np.testing.assert_array_equal(drawn, commands.draw_batch(4, n_limbs, 0).joined)
    classes = dict(zip(commands.CLASSES, np.split(drawn, len(commands.CLASSES), axis=1), strict=True))
    assert np.isin(classes["random ternary"], (-1, 0, 1)).all()
    assert classes["random ternary"].any(axis=-1).all()
    for kind in ("ternary", "continuous"):
        assert (classes[f"repeated {kind}"] == classes[f"repeated {kind}"][0]).all()
        assert (classes[f"alternating {kind}"] == classes[f"alternating {kind}"][[0, 1] * 5]).all()
    assert (np.count_nonzero(classes["opposed neighbours"], axis=-1) == min(2, n_limbs)).all()
    assert np.abs(classes["small"]).max() <= 0.1


@pytest.mark.parametrize("period", [0.1, 0.15, 0.3, 0.5])
@pytest.mark.parametrize("n_limbs", [1, 2, 3, 5])
def test_decisions_are_what_their_classes_say(n_limbs, period):
    batch = commands.draw_batch(8, n_limbs, 0, period)
    drawn, n, a_second = batch.commands, round(commands.SECONDS / period), round(1.0 / period)
    assert all(each.shape == (n, 8, n_limbs) for each in drawn.values()) and np.abs(batch.joined).max() <= 1.0
    two = [-1.0, *[0.0] * (n_limbs - 2), 1.0] if n_limbs > 1 else [1.0]
    assert (np.sort(drawn["pairs"], axis=-1) == two).all()
    np.testing.assert_array_equal(drawn["repeated second"][a_second:], drawn["repeated second"][:-a_second])
    changes = (np.diff(drawn["held"], axis=0) != 0.0).any(axis=-1).sum(axis=0).reshape(len(commands.HELD), 2)
    most = np.array([math.ceil(commands.SECONDS / each) - 1 for each in commands.HELD])
    assert (changes <= most[:, None]).all() and (changes[0] == 0).all()
    assert (drawn["on-off"] == 0.0).all(axis=(1, 2)).mean() == pytest.approx(0.5, abs=0.05)
    for name in ("repeated command", "repeated share"):
        assert (drawn[name] == drawn[name][0]).all()
    alike = np.sort(np.abs(drawn["repeated share"][0, ::2]), axis=-1)
    assert ((alike == 0.0) | (alike == alike[:, -1:])).all() and 0.0 < alike[:, -1].min() < alike[:, -1].max() < 1.0
    numbers = batch.of_classes(np.arange(8 * len(drawn)))
    assert list(numbers) == list(drawn) and numbers["pairs"].tolist() == [*range(8, 16)]


def test_swims_of_many_groups_are_those_of_one_batch(monkeypatch):
    monkeypatch.setattr(measure, "GROUP", 5)
    drawn, scene = commands.draw_batch(2, 5, 1).joined, resolved(SCENE, 5, Numerics("sdirk2", 2e-2, 1e-6))
    shares = []
    (swum,) = measure.swim_all([scene], drawn, shares.append)
    alone = measure.swim(scene, drawn)
    np.testing.assert_array_equal(swum.hub, alone.hub)
    for each, other in zip(swum, alone, strict=True):
        np.testing.assert_allclose(each, other, rtol=1e-9, atol=1e-12)
    assert shares[-1] == pytest.approx(1.0)


def swims(hub, heading=None):
    """Swims with these hubs [m], shape (strokes, n, 2), and headings [rad]."""
    hub = np.asarray(hub, float)
    zeros = np.zeros(hub.shape[:2])
    return measure.Swims(hub, zeros if heading is None else np.asarray(heading, float), *[zeros] * 4)


def test_errors_of_paths_and_ends_are_over_the_length_of_the_converged_path_and_those_of_headings_are_turns():
    """And infinite of the robots whose solver failed."""
    exact = swims([[[3.0, 4.0]], [[3.0, 9.0]]], [[0.0], [-3.1]])
    lengths = measure.path_lengths(SCENE, exact.hub)
    assert lengths == pytest.approx([10.0])
    off = measure.errors(swims([[[3.0, 4.5]], [[3.0, 9.1]]], [[0.0], [3.1]]), exact, lengths)
    assert off.path == pytest.approx([0.05]) and off.end == pytest.approx([0.01])
    assert off.heading == pytest.approx([2.0 * np.pi - 6.2])
    limit = np.cumsum(np.full((10, 2, 2), [0.003, 0.004]), axis=0)
    hub = limit + [0.0, 0.001]
    hub[3, 1] = np.nan
    found = measure.errors(swims(hub), swims(limit), measure.path_lengths(SCENE, limit))
    np.testing.assert_allclose(found.path, [0.02, np.inf])
    assert np.isinf([found.end[1], found.heading[1]]).all()
    assert [measure.rounded_up(error) for error in (np.inf, 0.0123, 0.012)] == [np.inf, 0.013, 0.012]


def test_space_and_time_are_errors_against_many_nodes_and_short_steps():
    """Settings with one mesh have one error of space; that of the limit is what half its edges tell, and is in all."""
    short, coarse = Numerics("implicit-midpoint", 5e-3, 1e-8), Numerics("sdirk2", 2e-2, 1e-6)
    some = [Resolution("continuum", n, each) for n, each in ((5, coarse), (9, coarse), (5, short))]
    drawn = commands.draw_batch(1, 5, 3).joined
    found = measure.measure(SCENE, some, Resolution("continuum", 9, short), lambda *_: short, drawn)
    np.testing.assert_array_equal(found.space[0].path, found.space[2].path)
    lengths = measure.path_lengths(SCENE, found.limit.hub)
    half = measure.swim(at(SCENE, some[2]), drawn)
    np.testing.assert_allclose(found.of_limit, measure.errors(half, found.limit, lengths).path / 3.0)
    np.testing.assert_array_equal(found.space[1].path, found.of_limit)
    assert not found.time[2].path.any()
    whole = measure.errors(found.swims[0], found.limit, lengths).path
    assert (whole <= found.space[0].path + found.time[0].path + 1e-12).all() and whole.max() > 1e-3


def test_decisions_are_told_one_by_one_and_paths_at_whole_seconds():
    scene = at(replace(SCENE, actuator=SmaWires()), Resolution("continuum", 5, Numerics("sdirk2", 2e-2, 1e-6)))
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 2, 5))
    (swum,) = measure.swim_all([scene], drawn, period=0.5)
    np.testing.assert_array_equal(swum.hub, measure.swim(scene, drawn, 0.5).hub)
    for period, n, seen in (
        (None, 3, [0, 1, 2]),
        (0.5, 4, [1, 3]),
        (0.3, 33, [*range(2, 33, 3)]),
        (0.13, 17, [0, 8, 16]),
    ):
        assert [*range(n)][measure.whole_seconds(period, n)] == seen
    simulator = Simulator(scene, 2)
    simulator.advance(0.5, drawn[0])
    simulator.advance(0.5, drawn[1])
    np.testing.assert_array_equal(swum.hub[1], simulator.hub_position())


@pytest.mark.parametrize("n_limbs", [5, 3])
def test_natural_frequencies_of_limbs_on_a_heavy_body_are_those_of_cantilevers(n_limbs):
    """f = beta^2 / (2 pi L^2) sqrt(E I / (rho A)) with cos(beta) cosh(beta) = -1."""
    robot = Seastar(n_limbs, 25, body=Body(radius=0.02, mass=1e3))
    stiffness = np.sqrt(robot.youngs_modulus / robot.density) * robot.rod_radius / 2.0
    exact = np.array([1.8751041, 4.6940911, 7.8547574]) ** 2 / (2.0 * np.pi * robot.limb_length**2) * stiffness
    np.testing.assert_allclose(resonance.natural_frequencies(Scene(robot))[:3], exact, rtol=0.01)


def test_modes_near_a_multiple_of_the_decisions_frequency_are_named_where_nothing_damps_them():
    modes = resonance.natural_frequencies(Scene())
    assert min(abs(each - 24.65) for each in modes) < 0.1  # docs/numerics.md, "Resonance"
    found = resonance.resonances(Scene(), 0.2)
    assert {"frequency": pytest.approx(24.65, abs=0.1), "multiple": 5} in found
    for each in found:
        assert any(mode == pytest.approx(each["frequency"], rel=1e-3) for mode in modes)
        assert each["frequency"] == pytest.approx(each["multiple"] / 0.2, rel=resonance.NEAR)
    assert "24.6" in resonance.told(found, 0.2) and "(near 25 Hz)" in resonance.told(found, 0.2)
    damped = Scene(Seastar(relaxation_time=SILICONE))
    assert resonance.resonances(damped, 0.2) == [] and resonance.told([], 0.2) == ""


# Long swims: which settings gather energy, told apart from noise, and in any current.


EULER = Numerics("implicit-euler", 1e-2, 1e-6)


def in_water(current, scene=SCENE):
    return replace(scene, fluid=replace(scene.fluid, current=current))


@pytest.mark.parametrize("n_limbs", [3, 4, 6])
def test_equal_limbs_that_turn_alike_and_end_at_rest_gather_no_energy(n_limbs):
    """Their energies are rounding, early and late, and no ratio of these counts."""
    scene = resolved(Scene(Seastar(n_limbs=n_limbs)), 5, EULER)
    simulator = Simulator(scene)
    simulator.stroke(-np.ones((1, n_limbs)))
    assert simulator.kinetic_energy()[0] < 1e-20
    assert measure.energy_growth(scene) <= 1.01


def test_the_energy_of_a_swim_that_fails_grows_without_bound(monkeypatch):
    monkeypatch.setattr(Simulator, "stroke", lambda *_: SimpleNamespace(status=np.array([1] + [0] * 16)))
    assert measure.energy_growth(SCENE) == np.inf


@pytest.mark.parametrize("body", [None, pytest.param(Body(radius=0.02, mass=0.02), marks=pytest.mark.slow)])
def test_a_uniform_current_is_a_translation(body):
    """Ways and errors are those in still water."""
    current = UniformCurrent(0.05, -0.02)
    still = Scene(Seastar(nodes_per_limb=5, discretisation="continuum", body=body), numerics=EULER)
    moving = in_water(current, still)
    drawn = commands.draw_batch(1, 5, 0).joined
    hub, in_current = (measure.swim(scene, drawn).hub for scene in (still, moving))
    np.testing.assert_allclose(in_current - np.arange(1, 11)[:, None, None] * [0.05, -0.02], hub, atol=1e-7)
    lengths = measure.path_lengths(moving, in_current)
    np.testing.assert_allclose(lengths, measure.path_lengths(still, hub), atol=1e-7)
    assert measure.energy_growth(moving) == pytest.approx(measure.energy_growth(still), rel=1e-3)


@pytest.mark.parametrize("kind", ["uniform", "vortex", "grid"])
def test_errors_are_divided_by_the_way_through_the_water(kind):
    """A robot that does nothing is carried by the water at its hub, nearly, and goes little way through it."""
    scene = resolved(in_water(CURRENTS[kind]), 5, Numerics("sdirk2", 2e-2, 1e-6))
    hub = measure.swim(scene, np.zeros((10, 1, 5))).hub
    assert measure.path_lengths(scene, hub)[0] < 0.2 * measure.path_lengths(SCENE, hub)[0]
    hub = np.arange(1, 11)[:, None, None] * np.array([0.05, 0.0])
    assert measure.path_lengths(in_water(UniformCurrent(0.05)), hub)[0] == pytest.approx(0.8e-4)
