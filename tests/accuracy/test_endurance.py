"""Long swims: which settings gather energy, told apart from noise, and in any current."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from currents import CURRENTS, velocity
from seastar_gym import Body, Numerics, Scene, Seastar, Simulator, UniformCurrent
from seastar_gym.accuracy import commands, endurance, measure, water
from seastar_gym.accuracy.setting import Setting, resolved

SCENE = Scene(Seastar(limb_length=0.08))
EULER = Numerics("implicit-euler", 1e-2, 1e-6)
SETTING = Setting(7, "implicit-euler", 5e-3, 1e-6, {"small": 0.1}, {"small": 0.05}, 0.0, 0.0, 1.0, 1.0)


def in_water(current, scene=SCENE):
    return replace(scene, fluid=replace(scene.fluid, current=current))


@pytest.mark.parametrize("n_limbs", [3, 4, 6])
def test_equal_limbs_that_turn_alike_and_end_at_rest_gather_no_energy(n_limbs):
    """Their energies are rounding, early and late, and no ratio of these counts."""
    scene = resolved(Scene(Seastar(n_limbs=n_limbs)), 5, EULER)
    simulator = Simulator(scene)
    simulator.stroke(-np.ones((1, n_limbs)))
    assert simulator.kinetic_energy()[0] < 1e-20
    assert endurance.energy_growth(scene) <= 1.01


def swims_of(energies, monkeypatch):
    """Growth over 17 swims whose kinetic energies at ends of strokes are these, shape (200, 17); and strokes swum."""
    strokes = []

    class Scripted:
        def __init__(self, *_):
            pass

        def stroke(self, _):
            strokes.append(1)
            return SimpleNamespace(status=np.zeros(17))

        def kinetic_energy(self, relative_to_water):
            assert relative_to_water
            return energies[len(strokes) - 1]

    monkeypatch.setattr(endurance, "with_the_water", Scripted)
    return endurance.energy_growth(SCENE), len(strokes)


def test_the_last_20_of_200_strokes_are_compared_with_the_first_20(monkeypatch):
    energies = np.ones((200, 17))
    energies[19, 0], energies[20:180, 0], energies[180, 0] = 2.0, 10.0, 3.0
    assert swims_of(energies, monkeypatch) == (1.5, 200)
    energies[199, 1] = 7.0
    assert swims_of(energies, monkeypatch) == (7.0, 200)


@pytest.mark.parametrize("stroke", [20, 60, 198])
def test_swims_end_where_the_energy_has_grown_20_fold(monkeypatch, stroke):
    energies = np.ones((200, 17))
    energies[stroke, 5] = 20.0
    assert swims_of(energies, monkeypatch) == (20.0, stroke + 1)
    energies[stroke, 5] = np.nextafter(20.0, 0.0)
    assert swims_of(energies, monkeypatch)[1] == 200


def test_a_millionth_of_the_largest_early_energy_is_noise(monkeypatch):
    energies = np.ones((200, 17))
    energies[:20, 1], energies[20:, 1] = 1e-30, 3e-6
    assert swims_of(energies, monkeypatch)[0] == pytest.approx(3.0)
    energies[:20, 1] = 2e-6
    assert swims_of(energies, monkeypatch)[0] == pytest.approx(1.5)
    assert swims_of(np.zeros((200, 17)), monkeypatch)[0] == 0.0


def test_a_setting_endures_up_to_a_growth_by_half():
    assert replace(SETTING, energy_growth=1.5).is_energy_stable
    assert not replace(SETTING, energy_growth=np.nextafter(1.5, 2.0)).is_energy_stable


def test_the_energy_of_a_swim_that_fails_grows_without_bound(monkeypatch):
    monkeypatch.setattr(Simulator, "stroke", lambda *_: SimpleNamespace(status=np.array([1] + [0] * 16)))
    assert endurance.energy_growth(SCENE) == np.inf


@pytest.mark.parametrize("n_limbs", [1, 2, 3, 5, 12])
def test_long_swims_turn_mirrored_limbs_against_each_other(n_limbs):
    commands = endurance.long_swims(n_limbs, samples=2, seed=0)
    assert commands.shape == (10, 5, n_limbs) and np.abs(commands).max() == 1.0
    pairs = endurance.mirrored_pairs(n_limbs)
    if n_limbs > 2:
        np.testing.assert_array_equal(pairs[:, 1:], -pairs[:, :0:-1])


@pytest.mark.parametrize("kind", CURRENTS)
def test_the_water_moves_as_its_current_says(kind):
    places = np.random.default_rng(0).uniform(-0.3, 0.3, (7, 3, 2))
    expected = velocity(kind, places.reshape(-1, 2)).reshape(places.shape)
    np.testing.assert_allclose(water.velocity(in_water(CURRENTS[kind]), places), expected, rtol=1e-9, atol=1e-14)
    assert not water.velocity(SCENE, places).any()


@pytest.mark.parametrize("body", [None, pytest.param(Body(radius=0.02, mass=0.02), marks=pytest.mark.slow)])
def test_a_uniform_current_is_a_translation(body):
    """Energies, ways and errors are those in still water, for any scheme."""
    current = UniformCurrent(0.05, -0.02)
    still = Scene(Seastar(nodes_per_limb=5, discretisation="continuum", body=body), numerics=EULER)
    moving = in_water(current, still)
    drawn = commands.draw_classes(1, 5, 0)
    one, two = (water.with_the_water(scene, drawn.shape[1]) for scene in (still, moving))
    for each in drawn:
        one.stroke(each), two.stroke(each)
        energies = [each.kinetic_energy(relative_to_water=True) for each in (one, two)]
        np.testing.assert_allclose(energies[1], energies[0], rtol=1e-4, atol=1e-18)
    before = two.get_state()
    two.kinetic_energy(relative_to_water=True)
    np.testing.assert_array_equal(two.velocities, before.velocities)
    hub, in_current = (measure.swim(scene, drawn).hub for scene in (still, moving))
    np.testing.assert_allclose(in_current - np.arange(1, 11)[:, None, None] * [0.05, -0.02], hub, atol=1e-7)
    lengths = measure.path_lengths(moving, in_current)
    np.testing.assert_allclose(lengths, measure.path_lengths(still, hub), atol=1e-7)
    assert endurance.energy_growth(moving) == pytest.approx(endurance.energy_growth(still), rel=1e-3)


def test_errors_are_divided_by_the_way_through_the_water():
    """A robot at rest in a current goes nowhere; one that swims has the same errors as in still water."""
    hub = np.arange(1, 11)[:, None, None] * np.array([0.05, 0.0])
    in_current = in_water(UniformCurrent(0.05))
    assert measure.path_lengths(in_current, hub)[0] == pytest.approx(0.8e-4)
    assert measure.path_lengths(SCENE, hub)[0] == pytest.approx(0.5)


@pytest.mark.parametrize("kind", ["vortex", "grid"])
def test_a_current_that_differs_from_place_to_place_carries_the_hub(kind):
    """A robot that does nothing is carried by the water at its hub, nearly, and goes little way through it."""
    scene = resolved(in_water(CURRENTS[kind]), 5, Numerics("sdirk2", 2e-2, 1e-6))
    hub = measure.swim(scene, np.zeros((10, 1, 5))).hub
    over_ground = measure.path_lengths(SCENE, hub)[0]
    through_the_water = measure.path_lengths(scene, hub)[0]
    assert through_the_water < 0.2 * over_ground
