"""Error bars: a twin tells how far the hub may be from the truth, and changes nothing else."""

import math
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import (
    Attachment,
    Body,
    Contact,
    DomainRandomization,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    ThermalSma,
    Uniform,
)
from seastar_gym.accuracy.commands import STROKES, draw_classes
from seastar_gym.accuracy.measure import SHORT, swim
from seastar_gym.accuracy.setting import resolved
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator import batch as module
from seastar_gym.simulator import error_bars
from strokes import assert_same, finished

FAST = Scene.preset("fast")
N_ROBOTS = N_LANES + 3
COMMANDS = np.random.default_rng(0).integers(-1, 2, (4, N_ROBOTS, 5)).astype(float)


def swimmers(scene: Scene = FAST, n_strokes: int = 1, threads: int = 1) -> Simulator:
    """Robots with error bars after some strokes."""
    simulator = Simulator(scene, N_ROBOTS, threads, error_bars=True)
    for commands in COMMANDS[:n_strokes]:
        simulator.stroke(commands)
    return simulator


@pytest.mark.parametrize("scene", [FAST, replace(FAST, contact=Contact()), replace(FAST, actuator=ThermalSma())])
def test_error_bars_change_no_bit_of_the_trajectory_and_of_other_reports(scene):
    plain, barred = Simulator(scene, N_ROBOTS, 1), Simulator(scene, N_ROBOTS, 1, error_bars=True)
    for commands in COMMANDS:
        without, with_bars = plain.stroke(commands), barred.stroke(commands)
        for name in set(without._fields) - {"error_estimate"}:
            np.testing.assert_array_equal(getattr(with_bars, name), getattr(without, name))
        assert np.isnan(without.error_estimate).all() and np.isnan(plain.error_estimate).all()
        assert (with_bars.error_estimate >= 0.0).all() and with_bars.error_estimate.any()
        np.testing.assert_array_equal(with_bars.error_estimate, barred.error_estimate)
    for one, wanted in zip(barred.get_state(), plain.get_state(), strict=True):
        np.testing.assert_array_equal(one, wanted)


@pytest.mark.slow
def test_robots_with_a_body_have_error_bars_that_cover_their_error():
    corners = tuple(Attachment(x, y, math.atan2(y, x)) for x, y in ((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015),
                                                                    (0.03, -0.015)))  # fmt: skip
    robot = Seastar(4, 7, body=Body.rectangle(0.06, 0.03, attachments=corners))
    scene = Scene(robot, numerics=FAST.numerics)
    simulator, fine = Simulator(scene, error_bars=True), Simulator(resolved(scene, 25, replace(SHORT, step=1e-3)))
    plain = Simulator(scene)
    for command in ([[1.0, 0.0, 0.0, -1.0]], [[0.0, 1.0, -1.0, 0.5]]):
        estimate = simulator.stroke(command).error_estimate[0]
        fine.stroke(command)
        plain.stroke(command)
        error = float(np.linalg.norm(simulator.hub_position() - fine.hub_position()))
        assert 0.0 < error < estimate < 50.0 * error
        np.testing.assert_array_equal(simulator.get_state().orientation, plain.get_state().orientation)
    with pytest.raises(ValueError, match="shape"):
        simulator.stroke([[1.0, 0.0]])
    assert simulator.error_estimate[0] == estimate


@pytest.mark.parametrize("wanted", [False, True])
def test_only_error_bars_have_a_twin(monkeypatch, wanted):
    made, make = [], module.Batch.__init__

    def count(batch, *arguments):
        made.append(batch)
        make(batch, *arguments)

    monkeypatch.setattr(module.Batch, "__init__", count)
    Simulator(FAST, error_bars=wanted).stroke(COMMANDS[0, :1])
    assert len(made) == 1 + wanted


@pytest.mark.parametrize("fidelity", ["fast", "balanced"])
def test_the_estimate_covers_the_true_error_and_is_not_vacuous(fidelity):
    scene, commands = Scene.preset(fidelity), draw_classes(2, 5, seed=77)
    exact = swim(resolved(scene, 37, replace(SHORT, step=0.5e-3)), commands).hub
    simulator, ratios = Simulator(scene, commands.shape[1], 1, error_bars=True), []
    for k in range(STROKES):
        estimate = simulator.stroke(commands[k]).error_estimate
        ratios.append(estimate / np.linalg.norm(simulator.hub_position() - exact[k], axis=1))
    assert np.mean(np.array(ratios) >= 1.0) >= 0.95
    assert np.median(ratios) <= 5.0


def test_the_estimate_never_falls_within_an_episode():
    simulator = swimmers(n_strokes=0)
    estimates = np.array([simulator.stroke(commands).error_estimate for commands in COMMANDS])
    assert (np.diff(estimates, axis=0) >= 0.0).all()


def test_the_twin_has_edges_and_steps_half_as_long():
    adapted = replace(FAST, numerics=Numerics("implicit-midpoint", 4e-3, path_tolerance=0.01))
    for scene in (FAST, adapted):
        twin = error_bars.twin_scene(scene)
        assert twin.robot.nodes_per_limb - 1 == 2 * (scene.robot.nodes_per_limb - 1)
        assert twin.numerics.step == 0.5 * scene.numerics.step and twin.numerics.path_tolerance is None
        assert twin.numerics.scheme == scene.numerics.scheme and twin.robot.limb_length == scene.robot.limb_length


@pytest.mark.parametrize("threads", [1, 2])
def test_a_robot_has_its_estimate_whatever_its_company(threads):
    batch = swimmers(n_strokes=3, threads=threads)
    for robot in (0, N_ROBOTS - 1):
        alone = Simulator(FAST, 1, error_bars=True)
        for commands in COMMANDS[:3]:
            alone.stroke(commands[robot : robot + 1])
        assert alone.error_estimate[0] == batch.error_estimate[robot]


def test_robots_that_are_reset_begin_anew_and_the_others_go_on():
    simulator, other = swimmers(n_strokes=2), swimmers(n_strokes=2)
    mask = np.arange(N_ROBOTS) % 2 == 0
    simulator.reset(mask, heading=0.3)
    assert not simulator.error_estimate[mask].any()
    np.testing.assert_array_equal(simulator.error_estimate[~mask], other.error_estimate[~mask])
    fresh = Simulator(FAST, N_ROBOTS, 1, error_bars=True)
    fresh.reset(heading=0.3)
    for swimming in (simulator, other, fresh):
        swimming.stroke(COMMANDS[2])
    wanted = np.where(mask, fresh.error_estimate, other.error_estimate)
    np.testing.assert_array_equal(simulator.error_estimate, wanted)


@pytest.mark.parametrize("parts", [1, 3])
def test_strokes_in_parts_have_the_same_estimates(parts):
    simulator, other = swimmers(), swimmers()
    generator, wanted = simulator.stroke_in_parts(COMMANDS[1], parts), other.stroke(COMMANDS[1])
    before = simulator.error_estimate
    seen, report = finished(generator, lambda time: simulator.error_estimate)
    np.testing.assert_array_equal(seen, [before] * parts)
    np.testing.assert_array_equal(report.error_estimate, wanted.error_estimate)
    assert_same(simulator, other)


@pytest.mark.parametrize("repair", ["reset", "set_state"])
def test_a_reset_repairs_the_twin_where_one_was_interrupted(monkeypatch, repair):
    simulator = swimmers()
    state = simulator.get_state()

    def interrupt(robot, angle):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(simulator._bars.twin._batch, "put_at_rest", interrupt)
        with pytest.raises(KeyboardInterrupt):
            simulator.reset()
    with pytest.raises(RuntimeError, match="call reset"):
        simulator.stroke(COMMANDS[1])
    if repair == "set_state":
        simulator.set_state(state)
        assert np.isnan(simulator.stroke(COMMANDS[1]).error_estimate).all()
    simulator.reset()
    simulator.stroke(COMMANDS[0])
    assert_same(simulator, swimmers())


def test_a_pickled_simulator_goes_on_with_its_estimates():
    simulator = swimmers(n_strokes=2)
    copy = pickle.loads(pickle.dumps(simulator))
    for commands in COMMANDS[2:]:
        np.testing.assert_array_equal(copy.stroke(commands).error_estimate, simulator.stroke(commands).error_estimate)
    assert_same(copy, simulator)


def test_a_state_from_elsewhere_has_no_estimate_until_the_reset():
    simulator = swimmers(n_strokes=2)
    simulator.set_state(simulator.get_state())
    assert np.isnan(simulator.error_estimate).all()
    assert np.isnan(simulator.stroke(COMMANDS[2]).error_estimate).all()
    mask = np.arange(N_ROBOTS) == 1
    simulator.reset(mask)
    assert simulator.error_estimate[1] == 0.0
    fresh = Simulator(FAST, N_ROBOTS, 1, error_bars=True)
    estimate, wanted = (each.stroke(COMMANDS[0]).error_estimate for each in (simulator, fresh))
    assert estimate[1] == wanted[1] and np.isnan(estimate[~mask]).all()


def test_a_robot_that_fails_has_no_estimate_until_its_reset():
    simulator = swimmers(n_strokes=1)
    simulator.v[0, 0, 2] = np.nan
    report = simulator.stroke(COMMANDS[1])
    assert np.isnan(report.error_estimate).tolist() == (report.status > 0).tolist() == simulator.failed.tolist()
    assert simulator.failed.sum() == 1
    simulator.reset(simulator.failed)
    assert np.isfinite(simulator.stroke(COMMANDS[2]).error_estimate).all()


def test_a_robot_whose_twin_fails_has_no_estimate_until_its_reset():
    simulator, plain = swimmers(n_strokes=1), Simulator(FAST, N_ROBOTS, 1)
    simulator._bars.twin.v[0, 0, 2] = np.nan
    for commands in COMMANDS[1:3]:
        report = simulator.stroke(commands)
        assert not simulator.failed.any() and not report.status.any()
        assert np.isnan(report.error_estimate).tolist() == simulator._bars.twin.failed.tolist()
        assert np.isnan(simulator.error_estimate).sum() == 1
    for commands in COMMANDS[:3]:
        plain.stroke(commands)
    np.testing.assert_array_equal(simulator.positions, plain.positions)
    simulator.reset(np.isnan(simulator.error_estimate))
    assert np.isfinite(simulator.stroke(COMMANDS[3]).error_estimate).all()


@pytest.mark.parametrize("lengths", [0.1, (0.1, 0.2)], ids=["one length", "each its own"])
def test_the_estimate_is_at_least_what_newton_leaves(lengths):
    """Newton's tolerance counts beside the distance of the two hubs, in limb lengths, but not at rest."""
    robot = replace(FAST.robot, limb_length=np.array(lengths) if np.ndim(lengths) else lengths)
    numerics = Numerics("implicit-midpoint", 5e-3, newton_tolerance=1e-3)
    simulator = Simulator(replace(FAST, robot=robot, numerics=numerics), 2, error_bars=True)
    assert not simulator.error_estimate.any()
    estimate = simulator.stroke(COMMANDS[0, :2]).error_estimate
    distance = np.linalg.norm(simulator.hub_position() - simulator._bars.twin.hub_position(), axis=1)
    floor = 1e-3 * np.broadcast_to(lengths, 2)
    assert (distance > 0.0).all()
    np.testing.assert_allclose(estimate, error_bars.FACTORS["implicit-midpoint"] * (distance + floor), rtol=1e-12)


def test_limb_strengths_hold_for_the_twin():
    strengths = (1.0, 0.5, 0.0, 0.8, 1.0)
    simulator = Simulator(FAST, N_ROBOTS, 1, error_bars=True)
    simulator.set_limb_strengths(strengths)
    other = Simulator(replace(FAST, limb_strengths=strengths), N_ROBOTS, 1, error_bars=True)
    estimates = [each.stroke(COMMANDS[0]).error_estimate for each in (simulator, other)]
    np.testing.assert_array_equal(*estimates)


def test_robots_have_estimates_of_their_own_numbers():
    moduli = np.linspace(5e5, 2e6, N_ROBOTS)
    simulator = Simulator(FAST, N_ROBOTS, 1, error_bars=True)
    own = replace(FAST, robot=replace(FAST.robot, youngs_modulus=moduli))
    simulator.set_scene(own)
    estimate = simulator.stroke(COMMANDS[0]).error_estimate
    for robot in (0, N_ROBOTS - 1):
        alone = Simulator(own.of_robot(robot), 1, error_bars=True)
        assert alone.stroke(COMMANDS[0, robot : robot + 1]).error_estimate[0] == estimate[robot]


def test_a_scene_that_is_refused_changes_nothing_in_the_twin():
    simulator, other = swimmers(), swimmers()
    for scene in (None, Scene.preset("balanced"), replace(FAST, held_nodes=(0,))):
        with pytest.raises(ValueError, match=r"\.$"):
            simulator.set_scene(scene)
    simulator.stroke(COMMANDS[1])
    other.stroke(COMMANDS[1])
    assert_same(simulator, other)


@pytest.mark.parametrize("fixed", [{"held_nodes": (0, 1)}, {"loads": ((3, 0.0, 1e-3),)}], ids=["held", "loaded"])
def test_held_nodes_and_loads_belong_to_one_mesh(fixed):
    with assert_refused("one mesh", "error_bars=False"):
        Simulator(replace(FAST, **fixed), error_bars=True)
    Simulator(replace(FAST, **fixed))


@pytest.mark.parametrize("value", [1, "yes", None], ids=repr)
def test_error_bars_is_a_flag(value):
    with assert_refused("error_bars"):
        Simulator(FAST, error_bars=value)
    with assert_refused("error_bars"):
        SeastarSwimEnv(error_bars=value)


def test_info_has_the_estimate_alone_as_in_the_batch():
    batch = SeastarSwimVectorEnv(3, fidelity="fast", error_bars=True, max_episode_steps=3)
    singles = [gym.make("SeastarSwim-v0", fidelity="fast", error_bars=True, max_episode_steps=3) for _ in range(3)]
    rng = np.random.default_rng(1)
    first = batch.reset(seed=5)[1]
    own = [env.reset(seed=5 + k)[1]["error_estimate"] for k, env in enumerate(singles)]
    assert first["error_estimate"].tolist() == own == [0.0] * 3
    for _ in range(3):
        actions = rng.integers(0, 3, (3, 5))
        info = batch.step(actions)[4]
        own = [env.step(action)[4]["error_estimate"] for env, action in zip(singles, actions, strict=True)]
        assert info["error_estimate"].tolist() == own and min(own) > 0.0
        assert info["_error_estimate"].all()
    assert not batch.step(actions)[4]["error_estimate"].any()  # the next episodes have begun


def test_info_has_no_estimate_without_error_bars():
    """NaN would differ from itself in Gymnasium's checker, which compares two runs."""
    env = SeastarSwimEnv(fidelity="fast")
    assert "error_estimate" not in env.reset(seed=0)[1]
    assert "error_estimate" not in env.step([0, 1, 0, 0, 2])[4]


def test_drawn_robots_have_estimates():
    drawn = DomainRandomization({"robot.youngs_modulus": Uniform(8e5, 1.2e6), "limb_strengths": Uniform(0.5, 1.0)})
    env = SeastarSwimEnv(fidelity="fast", error_bars=True, randomization=drawn)
    env.reset(seed=0)
    estimates = [env.step([0, 1, 0, 0, 2])[4]["error_estimate"] for _ in range(2)]
    assert 0.0 < estimates[0] <= estimates[1] < 0.01


def test_the_environment_of_a_spec_has_error_bars_too():
    env = gym.make("SeastarSwim-v0", fidelity="fast", error_bars=True)
    again = gym.make(type(env.spec).from_json(env.spec.to_json()))
    again.reset(seed=0)
    assert again.step([0, 1, 0, 0, 2])[4]["error_estimate"] > 0.0


def test_chapters_discretisation_has_error_bars():
    scene = Scene.preset("chapter")
    simulator = Simulator(scene, 1, error_bars=True)
    simulator.stroke(COMMANDS[:1, 0])
    assert 1e-5 < simulator.error_estimate[0] < 1e-2
    assert error_bars.factor(scene) == error_bars.FACTOR_OF_CHAPTER
