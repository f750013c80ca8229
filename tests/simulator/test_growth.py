"""Whoever chooses numerics of his own is told when they gather energy, and only then."""

import pickle
import warnings
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from currents import CURRENTS, velocity
from hubs import TEN
from seastar_gym import (
    Body,
    Contact,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    SmaWires,
    SolverStatus,
    State,
    StrokeReport,
    UniformCurrent,
    Water,
)
from seastar_gym.accuracy.endurance import long_swims
from seastar_gym.der.stepping.report import SOLVER_ITERATIONS, STEPS
from seastar_gym.model import rods as module
from seastar_gym.model.rods import make_limits
from seastar_gym.simulator.growth import ENOUGH, EVERY, WINDOW, EnergyGrowth, is_watched
from strokes import finished

RESONANT = Scene(Seastar(nodes_per_limb=12), numerics=Numerics("implicit-midpoint", 10e-3, 1e-5))
"""Gathers energy within some 60 strokes."""
GAITS = long_swims(5, 8, 1)
CALM = Numerics("implicit-midpoint", 5e-3, 1e-5)
FAST = Scene.preset("fast")


def swim(scene: Scene, strokes: int, commands: np.ndarray = GAITS, **options) -> tuple[Simulator, np.ndarray]:
    """Simulator after strokes of these commands in turn, and the growth after every stroke."""
    simulator = Simulator(scene, commands.shape[1], **options)
    return simulator, np.array([simulator.stroke(commands[k % len(commands)]).energy_growth for k in range(strokes)])


def test_numerics_that_gather_energy_are_told_once():
    with pytest.warns(RuntimeWarning, match="gather energy") as told:
        simulator, growth = swim(RESONANT, 80)
    assert len([each for each in told if "kinetic energy" in str(each.message)]) == 1
    assert (growth[:WINDOW] == 1.0).all() and (growth[WINDOW:] != 1.0).all()
    assert growth.max() >= ENOUGH
    np.testing.assert_array_equal(simulator.energy_growth, growth[-1])


@pytest.mark.filterwarnings("error")
def test_numerical_damping_keeps_the_same_robot_calm():
    damped = replace(RESONANT, numerics=replace(RESONANT.numerics, damping=0.005))
    assert swim(damped, 80)[1].max() < 1.5


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("first", [0.1, 0.0], ids=["gentle", "at rest"])
def test_commands_that_grow_are_no_growth(first):
    """Energies go with the square of commands, and the first strokes begin with the first command."""
    rng = np.random.default_rng(0)
    commands = rng.integers(-1, 2, (60, 16, 5)).astype(float)
    commands[:25] *= first
    growth = swim(Scene(Seastar(nodes_per_limb=7), numerics=CALM), 60, commands)[1]
    assert growth.max() < 5.0
    assert (growth[: WINDOW + 25 if first == 0.0 else WINDOW] == 1.0).all()


@pytest.mark.filterwarnings("error")
def test_a_robot_that_drifts_with_the_water_has_no_energy_of_that():
    fluid = Water(current=UniformCurrent(0.5, 0.0))
    scenes = [Scene(Seastar(nodes_per_limb=7), each, numerics=CALM) for each in (Water(), fluid)]
    rng = np.random.default_rng(1)
    commands = rng.integers(-1, 2, (30, 4, 5)).astype(float)
    still = swim(scenes[0], 30, commands)[1]
    drifting = Simulator(scenes[1], 4)
    state = drifting.get_state()
    drifting.set_state(state._replace(velocities=state.velocities + [0.5, 0.0]))
    carried = np.array([drifting.stroke(each).energy_growth for each in commands])
    np.testing.assert_allclose(carried[WINDOW:], still[WINDOW:], rtol=1e-3)


def test_currents_of_each_robot_are_taken_off_its_own_energy():
    """Robots at rest in water of their own, and one over ground."""
    u_x = np.array([0.5, -0.2, 0.0, 0.1, 0.3, 0.0, 0.0, 0.2, 0.7])
    simulator = Simulator(Scene(Seastar(nodes_per_limb=5), Water(current=UniformCurrent(u_x, 0.1)), numerics=CALM), 9)
    state = simulator.get_state()
    velocities = np.broadcast_to(np.stack([u_x, np.full(9, 0.1)], axis=1)[:, None], state.velocities.shape).copy()
    velocities[6] = 0.0
    simulator.set_state(state._replace(velocities=velocities))
    found, over_ground = simulator.kinetic_energy(relative_to_water=True), simulator.kinetic_energy()
    np.testing.assert_allclose(np.delete(found, 6), 0.0, atol=1e-20)
    np.testing.assert_allclose(found[6], over_ground[2], rtol=1e-12)  # whose water has the same speed
    np.testing.assert_array_equal(simulator.velocities, velocities)


@pytest.mark.parametrize("body", [None, Body(radius=0.02, mass=0.02)], ids=["hub", "disc"])
@pytest.mark.parametrize("name", CURRENTS)
def test_the_energy_in_a_current_is_that_of_the_same_motion_in_still_water(name, body):
    scene = Scene(Seastar(nodes_per_limb=5, body=body), Water(current=CURRENTS[name]), numerics=CALM)
    simulator, still = Simulator(scene, 9), Simulator(replace(scene, fluid=Water()), 9)
    state, rng = simulator.get_state(), np.random.default_rng(2)
    positions, velocities = (each + rng.normal(0.0, 0.05, each.shape) for each in (state.positions, state.velocities))
    state = state._replace(positions=positions, velocities=velocities)
    if body is not None:
        state = state._replace(orientation=rng.normal(size=9), spin=rng.normal(size=9))
    simulator.set_state(state)
    water = velocity(name, state.positions.reshape(-1, 2)).reshape(state.positions.shape)
    still.set_state(state._replace(velocities=state.velocities - water))
    found = simulator.kinetic_energy(relative_to_water=True)
    np.testing.assert_allclose(found, still.kinetic_energy(), rtol=1e-9)
    assert (np.abs(found - simulator.kinetic_energy()) > 1e-3 * found).all()


@pytest.mark.filterwarnings("error")
def test_equal_limbs_that_all_turn_alike_and_end_at_rest_have_no_growth_of_rounding():
    growth = swim(Scene(Seastar(nodes_per_limb=5), numerics=CALM), 40, np.ones((1, 1, 5)))[1]
    assert growth.max() == 1.0 and growth[WINDOW:].max() < 1.0


def test_fidelities_of_the_chapters_robot_are_not_watched_and_everything_else_is():
    assert not is_watched(FAST) and np.isnan(swim(FAST, 25)[1]).all()
    others = [
        replace(FAST, numerics=CALM), replace(FAST, robot=replace(FAST.robot, nodes_per_limb=8)),
        replace(FAST, robot=replace(FAST.robot, youngs_modulus=1e7)),
    ]  # fmt: skip
    assert all(map(is_watched, others))


def test_watching_changes_no_bit():
    simulator, _ = swim(RESONANT, 30)
    blind = Simulator(RESONANT, GAITS.shape[1])
    blind._growth = None
    for k in range(30):
        blind.stroke(GAITS[k % len(GAITS)])
    np.testing.assert_array_equal(simulator.positions, blind.positions)
    np.testing.assert_array_equal(simulator.velocities, blind.velocities)


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


def test_energies_are_taken_once_in_a_period_however_short_the_decisions():
    watch, taken = EnergyGrowth(2, 1.0), []

    def energy() -> np.ndarray:
        taken.append(1)
        return np.array([1.0, 4.0])

    for k in range(1, 10 * (WINDOW + 2) + 1):
        watch.begin(0.1, np.array([[1.0], [-2.0]]))
        watch.end(energy, np.full(2, 0.1 * k))
    assert len(taken) == WINDOW + 1  # and then every fifth
    np.testing.assert_allclose(watch.growth, 1.0)


def test_the_twin_of_error_bars_is_not_watched():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulator, _ = swim(FAST, 2, error_bars=True)
    assert np.isnan(simulator.energy_growth).all() and np.isnan(simulator._bars.twin.energy_growth).all()


def test_info_has_the_growth_where_it_is_watched():
    own = gym.make("SeastarSwim-v0", scene=replace(FAST, numerics=CALM))
    _, info = own.reset(seed=0)
    assert info["energy_growth"] == 1.0
    for _ in range(WINDOW + 1):
        info = own.step([2, 1, 0, 2, 1])[4]
    assert 0.0 < info["energy_growth"] < 2.0 and info["energy_growth"] != 1.0
    assert "energy_growth" not in gym.make("SeastarSwim-v0", fidelity="fast").reset(seed=0)[1]


def test_wires_are_watched_too():
    scene = Scene(Seastar(nodes_per_limb=5), actuator=SmaWires(), numerics=CALM)
    simulator = Simulator(scene, 2)
    for k in range(5 * (WINDOW + 1)):
        report = simulator.advance(0.2, np.full((2, 5), (-1.0) ** k))
    assert np.isfinite(report.energy_growth).all() and (report.energy_growth != 1.0).all()


# A stroke's work is bounded: no step below 1/4096 of an interval, and no robot beyond its iterations.


SCHEMES = ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint", "adaptive"]
SHORTEST = 4096  # of an interval


def numerics(scheme: str, step: float) -> Numerics:
    return Numerics("implicit-midpoint", step, path_tolerance=0.01) if scheme == "adaptive" else Numerics(scheme, step)


def swimmers(scene: Scene, n_robots: int = 11, speed: float = 0.0) -> tuple[Simulator, np.ndarray]:
    """Robots whose nodes have random velocities [m/s], the more the later they come, and commands for them."""
    simulator, rng = Simulator(scene, n_robots), np.random.default_rng(0)
    state = simulator.get_state()
    velocities = speed * np.linspace(0.0, 1.0, n_robots)[:, None, None] * rng.standard_normal(state.positions.shape)
    simulator.set_state(State(state.positions, velocities, state.time))
    return simulator, rng.integers(-1, 2, (n_robots, scene.robot.n_limbs)).astype(float)


def in_parts(simulator: Simulator, commands: np.ndarray, parts: int) -> tuple[np.ndarray, StrokeReport]:
    """(time steps of the robots in every part, report)."""

    def steps(time: float) -> np.ndarray:
        return simulator._batch.report[:, STEPS].reshape(-1)[: simulator.n_robots].copy()

    seen, report = finished(simulator.stroke_in_parts(commands, parts), steps)
    return np.diff([np.zeros(simulator.n_robots), *seen], axis=0), report


def test_error_control_and_halvings_together_keep_the_shortest_step_and_the_bound():
    """Error control goes down to 1/4096 here, and then Newton is stuck; on top of each other they took for ever."""
    scene = Scene(Seastar(12, 10), None, SmaPulse(1.3), Numerics.preset("accurate"))
    simulator, command = Simulator(scene), np.array([[1.0, -1.0] * 6])
    for _ in range(3):
        steps, report = in_parts(simulator, command, 200)
        assert steps.max() <= SHORTEST
        assert report.newton_iterations[0] <= make_limits(scene).most_iterations
        assert report.status[0] != SolverStatus.NOT_FINITE
        assert (report.covered[0] == pytest.approx(1.0)) == (report.status[0] == SolverStatus.CONVERGED)


@pytest.mark.parametrize("speed", [0.0, 3.0], ids="{:g} m/s".format)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_robots_that_need_more_iterations_than_they_have_fail_and_the_others_keep_every_bit(monkeypatch, scheme, speed):
    scene = Scene(TEN, numerics=numerics(scheme, 0.05))
    free, commands = swimmers(scene, speed=speed)
    needed = free.stroke(commands).newton_iterations
    most = int(np.median(needed))
    monkeypatch.setattr(module, "MOST_ITERATIONS_PER_STEP", 0)
    monkeypatch.setattr(module, "MOST_ITERATIONS", most)
    for n_parts in (1, 7):
        bound, _ = swimmers(scene, speed=speed)
        _, report = in_parts(bound, commands, n_parts)
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


def test_a_robot_that_had_too_few_iterations_swims_again_after_a_reset(monkeypatch):
    scene = Scene(TEN, numerics=numerics("implicit-euler", 0.05))
    with monkeypatch.context() as patch:
        patch.setattr(module, "MOST_ITERATIONS", -1950)  # and 100 for each of 20 steps
        simulator, commands = swimmers(scene, 3)
        assert (simulator.stroke(commands).status == SolverStatus.ITERATION_LIMIT).all()
    simulator.set_scene(Scene(Seastar(nodes_per_limb=10, density=1001.0), numerics=scene.numerics))
    assert simulator.failed.all()
    simulator.reset()
    assert not simulator.stroke(commands).status.any()


def test_adapted_steps_that_were_halved_grow_again_within_their_interval():
    """From velocities that need short steps at first: without growth, they took 65,533 for the two intervals."""
    adapted = Numerics("implicit-midpoint", 0.1, path_tolerance=0.02)
    scene = Scene(TEN, actuator=SmaPulse(0.3, 0.1, 0.1), numerics=adapted)
    simulator, rng = Simulator(scene, 8), np.random.default_rng(0)
    state = simulator.get_state()
    simulator.set_state(State(state.positions, 300.0 * rng.standard_normal(state.positions.shape), state.time))
    report = simulator.stroke(rng.integers(-1, 2, (8, 5)))
    assert not report.status.any()
    assert report.halvings.max() > 4
    assert report.steps.max() < SHORTEST
    np.testing.assert_allclose(report.covered, 0.2, rtol=1e-12)


def test_the_bound_leaves_room_for_the_strokes_of_every_fidelity():
    for fidelity in ("fast", "balanced", "accurate", "reference", "chapter"):
        scene = Scene(TEN, numerics=Numerics.preset(fidelity))
        report = Simulator(scene).stroke([[1.0, -1.0, 1.0, -1.0, 1.0]])
        assert report.newton_iterations[0] < 0.05 * make_limits(scene).most_iterations


def crowd() -> Simulator:
    """Two robots of twelve limbs that touch, those of the second thrown at each other at 30 m/s."""
    scene = Scene(Seastar(12, 10), None, SmaPulse(0.2), Numerics("implicit-midpoint", 5e-3), contact=Contact())
    simulator = Simulator(scene, 2)
    state = simulator.get_state()
    speeds = 30.0 * np.random.default_rng(0).uniform(-1.0, 1.0, 12) / scene.robot.limb_length
    arms = (state.positions[1, 1:] - state.positions[1, 0]).reshape(12, -1, 2)
    state.velocities[1, 1:] = (np.stack([-arms[..., 1], arms[..., 0]], axis=-1) * speeds[:, None, None]).reshape(-1, 2)
    simulator.set_state(state)
    return simulator


@pytest.mark.filterwarnings("ignore:Limbs of robot:RuntimeWarning")
def test_iterations_of_the_linear_solver_count_where_limbs_touch(monkeypatch):
    """A crowd needs hundreds of them for a Newton iteration. It fails, and its neighbour keeps every bit."""
    commands = np.resize([1.0, -1.0], (2, 12))
    free = crowd()
    needed = free.stroke(commands).newton_iterations
    solver = free._batch.report[0, SOLVER_ITERATIONS, :2]
    most = int(2 * needed.max())
    assert solver[0] + needed[0] < most < solver[1]
    monkeypatch.setattr(module, "MOST_ITERATIONS_PER_STEP", 0)
    monkeypatch.setattr(module, "MOST_ITERATIONS", most)
    bound = crowd()
    report = bound.stroke(commands)
    assert report.status.tolist() == [SolverStatus.CONVERGED, SolverStatus.ITERATION_LIMIT]
    assert report.newton_iterations[1] < needed[1]
    np.testing.assert_array_equal(bound.positions[0], free.positions[0])
    np.testing.assert_array_equal(bound.velocities[0], free.velocities[0])
