"""A stroke's work is bounded: no step below 1/4096 of an interval, and no robot beyond its iterations."""

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Contact, Numerics, Scene, Seastar, Simulator, SmaPulse, SolverStatus, State, StrokeReport
from seastar_gym.der.stepping.report import SOLVER_ITERATIONS, STEPS
from seastar_gym.model import rods as module
from seastar_gym.model.rods import make_limits
from strokes import finished

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
