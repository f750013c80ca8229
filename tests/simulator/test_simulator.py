"""A robot's trajectory depends on its state and its commands, to the last bit, and on nothing else."""

import multiprocessing
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hubs import TEN, robot_with
from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, SolverStatus, State, Water
from seastar_gym.envs.pictures import observed_rows
from seastar_gym.simd.dispatch import KnownCode, code_for
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator.report import MEASURED_IF_ASKED
from strokes import assert_same_bits, finished

ROOT = Path(__file__).resolve().parents[2]
SCHEMES = ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
EVERY_WAY = [*SCHEMES, "adaptive"]
STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])


def scene_of(scheme="implicit-midpoint", step=0.01, **numerics) -> Scene:
    """The chapter's robot; "adaptive" is the implicit midpoint rule with steps adapted to their error."""
    if scheme == "adaptive":
        return Scene(TEN, numerics=Numerics("implicit-midpoint", step, path_tolerance=0.02, **numerics))
    return Scene(TEN, numerics=Numerics(scheme, step, **numerics))


def random_commands(n_robots: int, n_strokes: int = 3, seed: int = 0) -> np.ndarray:
    """Commands of the chapter, -1, 0 and 1, and others in between; shape (n_strokes, n_robots, 5)."""
    rng = np.random.default_rng(seed)
    whole = rng.integers(-1, 2, (n_strokes, n_robots, 5)).astype(float)
    return np.where(rng.random(whole.shape) < 0.5, whole, rng.uniform(-1.0, 1.0, whole.shape))


def random_velocities(n_robots: int, size: float, seed: int = 0) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal((n_robots, 46, 2))


def set_motion(simulator: Simulator, velocities: np.ndarray) -> None:
    """Keep positions and time, and give the robots other velocities [m/s]."""
    state = simulator.get_state()
    simulator.set_state(state._replace(velocities=velocities))


# Robots at rest


def test_robots_begin_at_rest_with_the_hub_at_the_origin():
    simulator = Simulator(Scene(TEN), n_robots=3)
    np.testing.assert_array_equal(simulator.positions, np.tile(TEN.nodes(), (3, 1, 1)))
    for zero in (simulator.velocities, simulator.time, simulator.hub_position(), simulator.hub_velocity()):
        assert not zero.any()
    assert simulator.positions.shape == simulator.velocities.shape == (3, 46, 2)
    assert simulator.time.shape == simulator.elastic_energy().shape == simulator.kinetic_energy().shape == (3,)
    assert simulator.hub_position().shape == simulator.hub_velocity().shape == (3, 2)


@pytest.mark.parametrize("scheme", EVERY_WAY)
def test_a_robot_left_alone_stays_where_it_is(scheme):
    simulator = Simulator(scene_of(scheme))
    for _ in range(3):
        simulator.stroke(np.zeros((1, 5)))
    np.testing.assert_allclose(simulator.positions[0], TEN.nodes(), rtol=0.0, atol=1e-13)
    assert simulator.elastic_energy()[0] < 1e-25


def test_held_nodes_stay_where_they_are_to_the_last_bit():
    held = [0, 1, 2]
    simulator = Simulator(Scene(TEN, held_nodes=(0, 1, 2), numerics=Numerics("implicit-midpoint", 0.01)), 2)
    state = simulator.get_state()
    simulator.set_state(state._replace(positions=state.positions + 0.03, velocities=state.velocities + 0.01))
    start = simulator.positions
    for command in random_commands(2):
        simulator.stroke(command)
    np.testing.assert_array_equal(simulator.positions[:, held], start[:, held])
    assert not simulator.velocities[:, held].any()
    assert np.abs(simulator.positions - start).max() > 1e-3


def test_what_is_read_is_a_copy():
    simulator = Simulator(scene_of(), n_robots=2)
    simulator.stroke(random_commands(2)[0])
    before = simulator.get_state()
    for array in (
        simulator.positions, simulator.velocities, simulator.time, simulator.hub_position(), simulator.hub_velocity(),
        *(part for part in simulator.get_state() if part is not None), simulator.elastic_energy(),
    ):  # fmt: skip
        array[:] = 7.0
    assert_same_bits(simulator.get_state(), before)


def test_reset_puts_the_chosen_robots_at_rest_and_touches_no_other():
    simulator, commands = Simulator(scene_of(), n_robots=11), random_commands(11)
    simulator.stroke(commands[0])
    before, mask = simulator.get_state(), np.arange(11) % 3 == 0
    simulator.reset(mask)
    after = simulator.get_state()
    assert_same_bits(after.of_robots(~mask), before.of_robots(~mask))
    np.testing.assert_array_equal(after.positions[mask], np.tile(TEN.nodes(), (mask.sum(), 1, 1)))
    assert not after.velocities[mask].any() and not after.time[mask].any()


def test_no_state_leaks_across_a_reset():
    fresh, used, commands = Simulator(scene_of(), 3), Simulator(scene_of(), 3), random_commands(3)
    set_motion(used, random_velocities(3, 1.0))
    used.stroke(commands[2])
    used.reset()
    for command in commands:
        reports = [simulator.stroke(command) for simulator in (fresh, used)]
        assert_same_bits(fresh.get_state(), used.get_state())
        for one, other in zip(*reports, strict=True):
            np.testing.assert_array_equal(one, other)


def test_heading_turns_the_robot_at_rest():
    simulator, headings = Simulator(Scene(TEN), n_robots=3), np.array([0.0, 0.7, -3.0])
    simulator.reset(heading=headings)
    np.testing.assert_allclose(simulator.heading(), headings, rtol=0.0, atol=1e-12)
    for nodes, heading in zip(simulator.positions, headings, strict=True):
        c, s = np.cos(heading), np.sin(heading)
        np.testing.assert_allclose(nodes, TEN.nodes() @ [[c, s], [-s, c]], rtol=0.0, atol=1e-16)
    simulator.reset(np.array([False, True, False]), heading=1.0)
    np.testing.assert_allclose(simulator.positions[1, 9], [0.1 * np.cos(1.0), 0.1 * np.sin(1.0)], rtol=1e-14)


# Bits: batch, lane, threads


@pytest.mark.parametrize("scheme", [*SCHEMES, "adaptive"])
def test_a_robot_moves_to_the_same_bits_alone_as_in_any_lane_of_any_batch(scheme):
    n_robots = 2 * N_LANES + 3
    commands, velocities = random_commands(n_robots), random_velocities(n_robots, 0.05)
    batch = Simulator(scene_of(scheme, 0.02), n_robots)
    set_motion(batch, velocities)
    shuffled = np.random.default_rng(1).permutation(n_robots)
    other = Simulator(scene_of(scheme, 0.02), n_robots)
    set_motion(other, velocities[shuffled])
    alone = [Simulator(scene_of(scheme, 0.02)) for _ in range(n_robots)]
    for k, single in enumerate(alone):
        set_motion(single, velocities[k : k + 1])
    for command in commands:
        report = batch.stroke(command)
        other.stroke(command[shuffled])
        for k, single in enumerate(alone):
            its_report = single.stroke(command[k : k + 1])
            assert_same_bits(single.get_state(), batch.get_state().of_robots(slice(k, k + 1)))
            for name, found, wanted in zip(report._fields, report, its_report, strict=True):
                np.testing.assert_array_equal(found[k : k + 1], wanted, err_msg=name)
        assert_same_bits(other.get_state(), batch.get_state().of_robots(shuffled))


@pytest.mark.parametrize("threads", [2, 3, 7])
def test_any_number_of_threads_gives_the_same_bits(threads):
    n_robots = 4 * N_LANES + 1
    one, many = Simulator(scene_of(), n_robots, threads=1), Simulator(scene_of(), n_robots, threads=threads)
    assert many.threads == min(threads, 5)
    for command in random_commands(n_robots):
        reports = [simulator.stroke(command) for simulator in (one, many)]
        assert_same_bits(one.get_state(), many.get_state())
        for a, b in zip(*reports, strict=True):
            np.testing.assert_array_equal(a, b)


def wild_swim() -> list[np.ndarray]:
    """Two strokes of nine robots, six of which fly about: positions, velocities and counts."""
    simulator, velocities = Simulator(scene_of("sdirk3", 0.02), 9), random_velocities(9, 0.1)
    velocities[:3] = 0.0
    set_motion(simulator, velocities)
    for command in random_commands(9, 2):
        report = simulator.stroke(command)
    counts = [report.status, report.newton_iterations, report.regularised, report.backtracks, report.halvings]
    return [simulator.positions, simulator.velocities, np.array(counts)]


@pytest.mark.parametrize(
    "width", [4 if N_LANES == 8 else 8, *(pytest.param(width, marks=pytest.mark.slow) for width in (2, 16))]
)
def test_any_lane_width_gives_the_same_bits(tmp_path, width):
    code = (
        "import sys; sys.path[:0] = ['.', 'tests', 'tests/simulator']; import numpy as np, test_simulator; "
        "np.savez(sys.argv[1], *test_simulator.wild_swim())"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "swim.npz")]
    subprocess.run(command, cwd=ROOT, env={**os.environ, "SEASTAR_LANES": str(width)}, check=True)
    with np.load(tmp_path / "swim.npz") as found:
        for name, expected in zip(found.files, wild_swim(), strict=True):
            np.testing.assert_array_equal(found[name], expected)


# Bits: parts, states, pickles


@pytest.mark.parametrize("scheme", EVERY_WAY)
@pytest.mark.parametrize("parts", [1, 2, 7, 10, 100])
def test_a_stroke_in_parts_gives_the_same_bits_as_a_whole_one(scheme, parts):
    whole, cut = Simulator(scene_of(scheme), 3), Simulator(scene_of(scheme), 3)
    for k, command in enumerate(random_commands(3)):
        report = whole.stroke(command)
        seen, cut_report = finished(cut.stroke_in_parts(command, parts), lambda time: (time, *cut.time))
        times = np.array(seen)
        assert len(times) == parts and (times[-1] == [1.0, *[k + 1.0] * 3]).all()
        np.testing.assert_allclose(times[:, 0], np.arange(1, parts + 1) / parts, atol=0.01)
        np.testing.assert_allclose(times[:, 1:], k + times[:, :1] * np.ones(3), rtol=1e-12)
        assert_same_bits(whole.get_state(), cut.get_state())
        for one, other in zip(report, cut_report, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_stroke_of_any_length_pauses_after_equal_times():
    numerics = Numerics("implicit-midpoint", 1e-29)
    simulator = Simulator(Scene(TEN, actuator=SmaPulse(0.1, 1e-28, 9e-28), numerics=numerics))
    times, _ = finished(simulator.stroke_in_parts(np.zeros((1, 5)), 10))
    np.testing.assert_allclose(times, 1e-28 * np.arange(1, 11), rtol=1e-9, atol=0.0)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("scheme", EVERY_WAY)
def test_a_state_set_again_and_a_pickle_continue_to_the_same_bits(scheme, threads):
    n_robots = N_LANES + 1
    first, second = (Simulator(scene_of(scheme), n_robots, threads) for _ in range(2))
    commands = random_commands(n_robots, 4)
    for command in commands[:2]:
        first.stroke(command)
    second.stroke(commands[3])
    second.set_state(first.get_state())
    third = pickle.loads(pickle.dumps(first))
    for command in commands[2:]:
        for simulator in (first, second, third):
            simulator.stroke(command)
        assert_same_bits(first.get_state(), second.get_state())
        assert_same_bits(first.get_state(), third.get_state())


def test_a_pickled_simulator_swims_on_under_another_lane_width(tmp_path):
    """Pickles travel: to a processor without AVX-512, say."""
    simulator, file = Simulator(scene_of("sdirk3", 0.02), 9), tmp_path / "simulator.pickle"
    file.write_bytes(pickle.dumps(simulator))
    simulator.stroke(np.ones((9, 5)) * STRAIGHT)
    width = 4 if N_LANES != 4 else 8
    code = (
        "import pickle, sys, numpy as np; simulator = pickle.load(open(sys.argv[1], 'rb'))\n"
        "simulator.stroke(np.tile([0.0, 1.0, 0.0, 0.0, -1.0], (9, 1))); np.save(sys.argv[2], simulator.positions)"
    )
    command = [sys.executable, "-c", code, str(file), str(tmp_path / "positions.npy")]
    subprocess.run(command, cwd=ROOT, env={**os.environ, "SEASTAR_LANES": str(width)}, check=True, capture_output=True)
    np.testing.assert_array_equal(np.load(tmp_path / "positions.npy"), simulator.positions)


def stroke_in_a_child(simulator: Simulator, answers) -> None:
    simulator.stroke(np.zeros((simulator.n_robots, 5)))
    answers.put(simulator.time[0])


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:This process.*is multi-threaded:DeprecationWarning")
def test_a_forked_process_swims_on_with_threads():
    simulator = Simulator(scene_of(), 2 * N_LANES, threads=2)
    simulator.stroke(np.zeros((2 * N_LANES, 5)))
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=stroke_in_a_child, args=(simulator, answers))
    child.start()
    child.join(60.0)
    if child.is_alive():
        child.kill()
        child.join()
    assert child.exitcode == 0
    assert answers.get(timeout=1.0) == 2.0


def test_a_simulator_pickled_within_a_stroke_knows_its_actuation():
    simulator = Simulator(scene_of())
    parts = simulator.stroke_in_parts(STRAIGHT, 10)
    next(parts)
    assert pickle.loads(pickle.dumps(simulator)).elastic_energy() == simulator.elastic_energy()
    finished(parts)


def test_energies_within_a_stroke_do_not_depend_on_the_batch_to_the_last_bit():
    commands = random_commands(N_LANES + 1, 1)[0]
    together, alone = Simulator(scene_of(), N_LANES + 1, threads=1), Simulator(scene_of(), 1)
    for _ in zip(together.stroke_in_parts(commands, 7), alone.stroke_in_parts(commands[:1], 7), strict=True):
        np.testing.assert_array_equal(together.elastic_energy()[:1], alone.elastic_energy())


def test_a_robot_whose_stroke_was_left_half_way_is_not_actuated():
    simulator = Simulator(scene_of())
    next(simulator.stroke_in_parts(STRAIGHT, 10))
    assert simulator.elastic_energy()[0] < 1e-25


# Work and outcome


def test_a_report_says_what_a_stroke_cost():
    simulator = Simulator(scene_of("sdirk2", 0.02), n_robots=2)
    report = simulator.stroke(np.array([[0.0] * 5, [0.0, 1.0, 0.0, 0.0, -1.0]]))
    for field in report:
        assert field.shape == (2,)
    assert report.status.tolist() == [SolverStatus.CONVERGED, SolverStatus.CONVERGED]
    assert report.newton_iterations[1] > report.newton_iterations[0] >= 2 * 50
    np.testing.assert_allclose(report.covered, 1.0, rtol=1e-12)
    assert report.smallest_opening_angle[0] == pytest.approx(2.0 * np.pi / 5.0)


def test_adapted_steps_are_short_where_the_swim_is_hard_and_long_where_it_is_easy():
    simulator = Simulator(scene_of("adaptive", 0.05), 2)
    for _ in range(3):
        report = simulator.stroke(np.array([[0.0] * 5, [-1.0, 1.0, 0.0, 0.0, 0.0]]))
    assert report.steps[0] < 50 < report.steps[1]
    assert report.rejections[0] == 0
    np.testing.assert_allclose(report.covered, 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    "hub, peak", [("rigid", 0.5), ("rigid", 0.9), ("opening", np.pi / 5), ("turning", 0.5), ("opening", 0.9)]
)
def test_smallest_opening_angle_is_that_of_the_limbs_during_the_stroke(hub, peak):
    scene = Scene(robot_with(hub), actuator=SmaPulse(peak), numerics=Numerics("implicit-euler", 0.01))
    simulator = Simulator(scene)

    def opening(time):
        roots = simulator.positions[0, 1::9] - simulator.positions[0, 0]
        after = np.roll(roots, -1, axis=0)
        cross, dot = roots[:, 0] * after[:, 1] - roots[:, 1] * after[:, 0], np.sum(roots * after, axis=1)
        return np.arctan2(cross, dot).min()

    smallest, report = finished(simulator.stroke_in_parts([[1.0, -1.0, 0.0, 0.3, 0.0]], 100), opening)
    assert report.smallest_opening_angle[0] == pytest.approx(min(smallest), abs=1e-4)
    assert (report.smallest_opening_angle[0] < 0.0) == (peak == 0.9)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("speed", [0.1, 1.0, 10.0])
def test_robots_with_wild_velocities_arrive(scheme, speed):
    """Plain Newton ends in NaN for these scenes."""
    simulator = Simulator(scene_of(scheme), n_robots=8)
    set_motion(simulator, random_velocities(8, speed))
    for command in random_commands(8):
        report = simulator.stroke(command)
        assert not report.status.any()
        np.testing.assert_allclose(report.covered, 1.0, rtol=1e-12)
    assert np.isfinite(simulator.positions).all() and np.isfinite(simulator.velocities).all()


@pytest.mark.parametrize("robot, step", [(Seastar(nodes_per_limb=40), 0.05), (TEN, 0.01), (Seastar(n_limbs=12), 0.02)])
def test_scenes_that_defeat_plain_newton_arrive(robot, step):
    commands = np.resize([1.0, -1.0], (1, robot.n_limbs))
    simulator = Simulator(Scene(robot, actuator=SmaPulse(min(np.pi / 5, 1.2)), numerics=Numerics(step=step)))
    for _ in range(3):
        assert simulator.stroke(commands).status[0] == SolverStatus.CONVERGED


@pytest.mark.parametrize("scheme", SCHEMES)
def test_nodes_are_within_the_tolerance_as_a_rule_and_nowhere_far_beyond_it(scheme):
    """One step of robots that swim, against the same step at a far tighter tolerance.

    The last Newton step is foreseen, not taken (see minimise), and now and then it is longer than foreseen.
    """
    n_robots, h = 128, 0.01
    swimmers = Simulator(scene_of("implicit-midpoint", 5e-3), n_robots)
    for command in random_commands(n_robots, 2):
        swimmers.stroke(command)
    actuator, ends = SmaPulse(heating_time=h, cooling_time=h), {}
    for tolerance in (1e-6, 1e-8, 1e-13):
        numerics = Numerics(scheme, h, newton_tolerance=tolerance)
        simulator = Simulator(Scene(TEN, actuator=actuator, numerics=numerics), n_robots)
        simulator.set_state(swimmers.get_state())
        parts = simulator.stroke_in_parts(random_commands(n_robots, seed=1)[0], 2)
        next(parts)
        ends[tolerance] = simulator.positions
        finished(parts)
    for tolerance in (1e-6, 1e-8):
        error = np.linalg.norm(ends[tolerance] - ends[1e-13], axis=2).max(axis=1) / (tolerance * 0.1)
        assert np.median(error) < 1.0 and error.max() < 100.0


def test_a_step_that_does_not_converge_is_two_steps_of_half_its_length():
    """Steps of 10 ms need more than two iterations, and their halves do not."""
    h, ends, halvings = 0.01, {}, {}
    for step, max_iterations in ((h, 2), (h / 2, 60), (h, 60)):
        numerics = Numerics("implicit-euler", step, newton_tolerance=1e-4, max_iterations=max_iterations)
        simulator = Simulator(Scene(TEN, actuator=SmaPulse(0.1, h, h), numerics=numerics))
        set_motion(simulator, random_velocities(1, 0.01))
        report = simulator.stroke(STRAIGHT)
        halvings[step, max_iterations], ends[step, max_iterations] = report.halvings[0], simulator.positions
        assert report.covered[0] == pytest.approx(2 * h, rel=1e-12)
    assert halvings == {(h, 2): 2, (h / 2, 60): 0, (h, 60): 0}
    np.testing.assert_allclose(ends[h, 2], ends[h / 2, 60], rtol=0.0, atol=1e-4 * 0.1)
    assert np.abs(ends[h, 60] - ends[h / 2, 60]).max() > 10 * 1e-4 * 0.1


# Failure is a value


def broken_state(n_robots: int, broken: int) -> State:
    """Robots at rest, one of them with all its nodes in one point: no angle, no direction, no way on."""
    state = Simulator(scene_of(), n_robots).get_state()
    state.positions[broken] = 0.25
    return state


def test_a_robot_that_cannot_be_solved_fails_alone_with_a_status_and_a_finite_state():
    n_robots, broken = N_LANES + 2, 1
    well, ill = Simulator(scene_of(), n_robots), Simulator(scene_of(), n_robots)
    ill.set_state(broken_state(n_robots, broken))
    others = np.arange(n_robots) != broken
    for k, command in enumerate(random_commands(n_robots), start=1):
        well.stroke(command)
        report = ill.stroke(command)
        assert report.status[broken] == SolverStatus.NOT_CONVERGED and not report.status[others].any()
        assert report.covered[broken] == 0.0
        assert ill.failed.tolist() == (~others).tolist()
        assert_same_bits(well.get_state().of_robots(others), ill.get_state().of_robots(others))
        np.testing.assert_array_equal(ill.positions[broken], 0.25)
        assert ill.time[broken] == 0.0 and ill.time[0] == k
    for name, field in report._asdict().items():
        assert name in MEASURED_IF_ASKED or np.isfinite(field).all()


def test_a_failed_robot_is_well_again_after_a_reset_or_a_new_state():
    fresh, simulator, command = Simulator(scene_of(), 3), Simulator(scene_of(), 3), random_commands(3)[0]
    fresh.stroke(command)
    for cure in (
        lambda: simulator.reset(simulator.failed),
        lambda: simulator.set_state(Simulator(scene_of(), 3).get_state()),
    ):
        simulator.set_state(broken_state(3, 1))
        assert simulator.stroke(np.zeros((3, 5))).status.tolist() == [0, 1, 0]
        cure()
        assert not simulator.failed.any()
        simulator.stroke(command)
        np.testing.assert_array_equal(simulator.positions[1], fresh.positions[1])


@pytest.mark.parametrize("how", ["whole", "in parts"])
def test_time_of_a_robot_that_fails_within_a_stroke_is_that_of_its_state_and_stands_still(how):
    """Velocities so large that rounding ends the stroke some tenths of a second after its beginning."""
    simulator = Simulator(scene_of(max_iterations=2), 2)
    velocities = np.zeros((2, 46, 2))
    velocities[1] = random_velocities(1, 1e14)[0]
    set_motion(simulator, velocities)
    times = []
    for _ in range(2):
        commands = np.repeat(STRAIGHT, 2, axis=0)
        report = simulator.stroke(commands) if how == "whole" else finished(simulator.stroke_in_parts(commands, 4))[1]
        assert report.status.tolist() == [0, 1]
        times.append((simulator.time[1], report.covered[1]))
    assert times[0][1] > 0.0 and times[1][1] == 0.0
    assert times[0][0] == pytest.approx(times[0][1]) and times[1][0] == times[0][0]


def test_time_of_a_stroke_within_which_a_simulator_was_copied_counts():
    simulator = Simulator(scene_of())
    parts = simulator.stroke_in_parts(STRAIGHT, 2)
    assert next(parts) == 0.5
    copy = pickle.loads(pickle.dumps(simulator))
    with pytest.raises(ValueError, match="limbs would jump"):
        copy.stroke(STRAIGHT)
    copy.advance(0.25)
    assert copy.time[0] == pytest.approx(0.75)


@pytest.mark.parametrize("speed", [1e30, 1e160, 1e300])
def test_velocities_beyond_all_bounds_end_in_a_status_not_in_nan(speed):
    simulator = Simulator(scene_of(), n_robots=4)
    velocities = np.zeros((4, 46, 2))
    velocities[2] = random_velocities(1, speed)[0]
    set_motion(simulator, velocities)
    report = simulator.stroke(np.zeros((4, 5)))
    assert report.status.tolist() == [0, 0, 1, 0]
    assert np.isfinite(simulator.positions).all() and np.isfinite(simulator.velocities).all()


def test_every_status_is_one_sentence():
    for status in SolverStatus:
        assert status.sentence.endswith(".") and "\n" not in status.sentence


def test_vacuum_and_water_without_density_give_the_same_bits():
    ends = []
    for fluid in (None, Water(density=0.0)):
        simulator = Simulator(Scene(TEN, fluid=fluid, numerics=Numerics(step=0.01)))
        simulator.stroke(STRAIGHT)
        ends.append(simulator.positions)
    np.testing.assert_array_equal(*ends)


def test_machine_code_that_is_kept_is_that_for_its_arguments(monkeypatch):
    """A robot for all, then each with numbers of its own; commands of pulses, with and without pauses; energies."""
    call, entries = KnownCode.call, set()

    def checked(self, kind, entry, *args):
        call(self, kind, entry, *args)
        assert self._codes[entry, kind] is code_for(entry, *args)
        entries.add(entry)

    monkeypatch.setattr(KnownCode, "call", checked)
    simulator = Simulator(Scene(numerics=Numerics(step=0.05)), 2)
    for density in (1000.0, np.array([900.0, 1100.0]), 1000.0):
        simulator.set_scene(Scene(Seastar(density=density), numerics=Numerics(step=0.05)))
        simulator.stroke(np.ones((2, 5)))
        finished(simulator.advance_in_parts(1.0, np.ones((2, 5)), 2))
        assert (simulator.elastic_energy() >= 0.0).all() and (simulator.kinetic_energy() > 0.0).all()
        observed_rows(simulator, np.zeros((2, 4)))
    assert {entry.__name__ for entry in entries} == {"advance", "energies", "energies_in_water", "observe"}
