"""Whoever chooses numerics of his own is told when they gather energy, and only then."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from currents import CURRENTS, velocity
from hubs import TEN
from seastar_gym import Body, Numerics, Scene, Seastar, Simulator, SolverStatus, UniformCurrent, Water
from seastar_gym import model as module
from seastar_gym.accuracy.measure import long_swims
from seastar_gym.rods.step import scheme_of, tableau
from seastar_gym.scene.numerics import DAMPING
from seastar_gym.simulator.watches import ENOUGH, EVERY, WINDOW, may_gather
from strokes import finished

RESONANT = Scene(Seastar(nodes_per_limb=12), numerics=Numerics("implicit-midpoint", 10e-3, 1e-5))
"""Gathers energy within some 60 strokes."""
GAITS = long_swims(5, 8, 1)
CALM = Numerics("implicit-midpoint", 5e-3, 1e-5)


def swim(scene: Scene, strokes: int, commands: np.ndarray = GAITS, **options) -> tuple[Simulator, np.ndarray]:
    """Simulator after strokes of these commands in turn, and the growth after every stroke."""
    simulator = Simulator(scene, commands.shape[1], **options)
    return simulator, np.array([simulator.stroke(commands[k % len(commands)]).energy_growth for k in range(strokes)])


def test_numerics_that_gather_energy_are_told_once():
    """Energies are taken once in a stroke at first, and then every fifth."""
    with pytest.warns(RuntimeWarning, match="gather energy") as told:
        simulator, growth = swim(RESONANT, 80)
    assert len([each for each in told if "kinetic energy" in str(each.message)]) == 1
    assert (growth[:WINDOW] == 1.0).all() and (growth[WINDOW:] != 1.0).all()
    assert growth.max() >= ENOUGH
    np.testing.assert_array_equal(simulator.energy_growth, growth[-1])
    assert np.flatnonzero(np.diff(growth, axis=0).any(axis=1)).tolist() == [*range(WINDOW - 1, 79, EVERY)]


@pytest.mark.parametrize("scheme, blamed", [
    (scheme_of("implicit-midpoint", 0.0), True), (scheme_of("implicit-midpoint", 0.002), True),
    (scheme_of("implicit-midpoint", DAMPING), False), (scheme_of("implicit-euler", 0.0), False),
    (scheme_of("sdirk2", 0.0), False), (tableau([[0.25, 0.0], [0.5, 0.25]], [0.5, 0.5]), True),
])  # fmt: skip
def test_only_schemes_that_keep_what_is_too_fast_for_a_step_are_blamed(scheme, blamed):
    assert may_gather(scheme) is blamed


U_X = np.array([0.5, -0.2, 0.0, 0.1, 0.3, 0.0, 0.0, 0.2, 0.7])


@pytest.mark.parametrize("body", [None, Body(radius=0.02, mass=0.02)], ids=["hub", "disc"])
@pytest.mark.parametrize("name", [*CURRENTS, "of each robot"])
def test_the_energy_in_a_current_is_that_of_the_same_motion_in_still_water(name, body):
    current = UniformCurrent(U_X, 0.1) if name == "of each robot" else CURRENTS[name]
    scene = Scene(Seastar(nodes_per_limb=5, body=body), Water(current=current), numerics=CALM)
    simulator, still = Simulator(scene, 9), Simulator(replace(scene, fluid=Water()), 9)
    state, rng = simulator.get_state(), np.random.default_rng(2)
    positions, velocities = (each + rng.normal(0.0, 0.05, each.shape) for each in (state.positions, state.velocities))
    state = state._replace(positions=positions, velocities=velocities)
    if body is not None:
        state = state._replace(orientation=rng.normal(size=9), spin=rng.normal(size=9))
    simulator.set_state(state)
    if name == "of each robot":
        water = np.stack([U_X, np.full(9, 0.1)], axis=1)[:, None]
    else:
        water = velocity(name, positions.reshape(-1, 2)).reshape(positions.shape)
    still.set_state(state._replace(velocities=velocities - water))
    found = simulator.kinetic_energy(relative_to_water=True)
    np.testing.assert_allclose(found, still.kinetic_energy(), rtol=1e-9)
    assert (np.abs(found - simulator.kinetic_energy()) > 1e-3 * found).all()
    np.testing.assert_array_equal(simulator.velocities, velocities)


def test_a_reset_and_a_new_state_begin_anew_and_a_pickle_goes_on():
    simulator, growth = swim(replace(RESONANT, numerics=CALM), 25)
    again = pickle.loads(pickle.dumps(simulator))
    np.testing.assert_array_equal(again.energy_growth, growth[-1])
    for k in range(25, 25 + EVERY):
        one, other = (each.stroke(GAITS[k % len(GAITS)]).energy_growth for each in (simulator, again))
        np.testing.assert_array_equal(one, other)
    simulator.reset(np.arange(GAITS.shape[1]) == 3)
    assert np.flatnonzero(simulator.energy_growth == 1.0).tolist() == [3]
    simulator.set_state(simulator.get_state())
    assert (simulator.energy_growth == 1.0).all()


# A stroke's work is bounded: no step below 1/4096 of an interval, and no robot beyond its iterations.


STEPPED = {scheme: Numerics(scheme, 0.05) for scheme in ("implicit-euler", "sdirk2", "implicit-midpoint")}


def swimmers(scene: Scene, speed: float) -> tuple[Simulator, np.ndarray]:
    """Robots whose nodes have random velocities [m/s], the more the later they come, and commands for them."""
    simulator, rng = Simulator(scene, 11), np.random.default_rng(0)
    state = simulator.get_state()
    velocities = speed * np.linspace(0.0, 1.0, 11)[:, None, None] * rng.standard_normal(state.positions.shape)
    simulator.set_state(state._replace(velocities=velocities))
    return simulator, rng.integers(-1, 2, (11, scene.robot.n_limbs)).astype(float)


@pytest.mark.parametrize("speed", [0.0, 3.0], ids="{:g} m/s".format)
@pytest.mark.parametrize("name", STEPPED)
def test_robots_that_need_more_iterations_than_they_have_fail_and_the_others_keep_every_bit(monkeypatch, name, speed):
    scene = Scene(TEN, numerics=STEPPED[name])
    free, commands = swimmers(scene, speed)
    needed = free.stroke(commands).newton_iterations
    most = int(np.median(needed))
    monkeypatch.setattr(module, "MOST_ITERATIONS_PER_STEP", 0)
    monkeypatch.setattr(module, "MOST_ITERATIONS", most)
    for n_parts in (1, 7):
        bound, _ = swimmers(scene, speed)
        _, report = finished(bound.stroke_in_parts(commands, n_parts))
        failed = report.status > 0
        assert 0 < failed.sum() < len(failed)
        np.testing.assert_array_equal(failed, needed > most)
        np.testing.assert_array_equal(report.status[failed], SolverStatus.ITERATION_LIMIT)
        np.testing.assert_array_equal(report.newton_iterations, np.minimum(needed, most))
        np.testing.assert_array_equal(bound.positions[~failed], free.positions[~failed])
        np.testing.assert_array_equal(bound.velocities[~failed], free.velocities[~failed])
        assert np.isfinite(bound.positions).all() and (report.covered[failed] < 1.0).all()
        np.testing.assert_array_equal(bound.time, np.where(failed, report.covered, 1.0))
        later = bound.stroke(commands)
        np.testing.assert_array_equal(later.status[failed], SolverStatus.ITERATION_LIMIT)
        assert not later.newton_iterations[failed].any()
    monkeypatch.undo()
    bound.set_scene(Scene(replace(TEN, density=1001.0), numerics=scene.numerics))
    assert bound.failed.any()
    bound.reset()
    assert not bound.stroke(commands).status.any()
