"""The continuum's discretisation: ten nodes swim as infinitely many do, and keep what mechanics keeps."""

import numpy as np

from momenta import momenta
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, State
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.model.rods import make_rods

TEN = Seastar()
LIMIT = {"straight": 34.360, "{1-,2+}": 28.189, "{1-,4+}": 39.355, "{1-,5+}": 32.282}
"""Distances after ten strokes with N to infinity and h to 0 [mm]."""
OF_TEN_NODES = {"straight": 34.364, "{1-,2+}": 27.977, "{1-,4+}": 39.333, "{1-,5+}": 32.085}
"""The same with ten nodes and h to 0."""


def test_ten_nodes_swim_as_infinitely_many_do():
    commands = np.array([STRAIGHT, *(PAIRS[name] for name in list(LIMIT)[1:])])
    simulator = Simulator(Scene(TEN, numerics=Numerics("implicit-midpoint", 1e-3)), len(commands))
    for _ in range(10):
        assert not simulator.stroke(commands).status.any()
    distances = 1e3 * np.hypot(*simulator.hub_position().T)
    np.testing.assert_allclose(distances, list(OF_TEN_NODES.values()), rtol=1e-3)
    np.testing.assert_allclose(distances, list(LIMIT.values()), rtol=1e-2)
    assert abs(simulator.hub_position()[0, 1]) < 1e-9


def test_in_vacuum_momentum_angular_momentum_and_small_energies_stay():
    scene = Scene(TEN, None, SmaPulse(0.0), Numerics("implicit-midpoint", 5e-4, newton_tolerance=1e-12))
    rods, rng, simulator = make_rods(scene), np.random.default_rng(0), Simulator(scene)
    noise = 1e-3 * rng.standard_normal((1, 46, 2))
    simulator.set_state(State(TEN.nodes()[None], noise, np.zeros(1)))

    def kept() -> np.ndarray:
        linear, spin = momenta(rods, simulator.positions, simulator.velocities)
        return np.array([*linear[0], *spin])

    before, energy = kept(), simulator.elastic_energy() + simulator.kinetic_energy()
    simulator.stroke(np.zeros((1, 5)))
    np.testing.assert_allclose(kept(), before, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(simulator.elastic_energy() + simulator.kinetic_energy(), energy, rtol=0.02)


def test_hub_hinges_are_the_chapters():
    with assert_refused('only discretisation="chapter"'):
        Seastar(hub_hinge="turning", discretisation="continuum")


def test_limbs_do_not_turn_by_half_a_turn():
    with assert_refused("pi"):
        Scene(TEN, actuator=SmaPulse(3.2))


def test_a_discretisation_that_is_not_known_is_refused():
    with assert_refused("discretisation must be one of"):
        Seastar(discretisation="fine")
