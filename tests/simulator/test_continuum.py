"""The continuum's discretisation: ten nodes swim as infinitely many do, and keep what mechanics keeps."""

import numpy as np
import pytest

from hubs import TEN
from momenta import momenta
from refusals import assert_refused
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, State
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.model.rods import make_rods

TEN = TEN
LIMIT = {"straight": 34.360, "{1-,2+}": 28.189, "{1-,4+}": 39.355, "{1-,5+}": 32.282}
"""Distances after ten strokes with N to infinity and h to 0 [mm]."""
AFTER_ONE = 4.708
"""That of the straight swim after one stroke [mm]."""
OF_NODES = {
    10: (34.364, 27.977, 39.333, 32.085),
    19: (34.365, 28.159, 39.362, 32.229),
    37: (34.361, 28.182, 39.358, 32.279),
}
"""Those after ten strokes with h to 0, over the nodes per limb, as a prototype of its own found them [mm]."""


def distances(nodes_per_limb: int, step: float) -> np.ndarray:
    """Distances after ten strokes [mm] of the commands of LIMIT, after the first stroke of the straight one, too."""
    commands = np.array([STRAIGHT, *(PAIRS[name] for name in list(LIMIT)[1:])])
    robot = Seastar(nodes_per_limb=nodes_per_limb)
    simulator, found = Simulator(Scene(robot, numerics=Numerics("implicit-midpoint", step)), len(commands)), []
    for _ in range(10):
        assert not simulator.stroke(commands).status.any()
        found.append(1e3 * np.hypot(*simulator.hub_position().T))
    assert abs(simulator.hub_position()[0, 1]) < 1e-9
    return np.array([*found[-1], found[0][0]])


@pytest.mark.parametrize("nodes_per_limb", OF_NODES)
def test_few_nodes_swim_as_the_prototype_did(nodes_per_limb):
    np.testing.assert_allclose(distances(nodes_per_limb, 5e-4)[:4], OF_NODES[nodes_per_limb], rtol=1e-3)


def test_ten_nodes_swim_as_infinitely_many_do():
    np.testing.assert_allclose(distances(10, 1e-3)[:4], list(LIMIT.values()), rtol=1e-2)


@pytest.mark.slow
def test_73_nodes_swim_as_infinitely_many_do():
    np.testing.assert_allclose(distances(73, 5e-5), [*LIMIT.values(), AFTER_ONE], rtol=1e-4)


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
