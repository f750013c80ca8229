"""Agents that decide several times a second: gaits, evaluation, planner, training and policies."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from agents import learner_file
from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model, make_training_env, policy_of
from agents.trials import main as trials_main
from refusals import assert_refused
from seastar_gym import Limited, Numerics, Scene, Simulator, SmaPulse, SmaWires, ThermalSma
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import checkpoint
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.greedy import GreedyPolicy, displacement_map
from seastar_gym.controllers.learned import LearnedPolicy, load, save
from seastar_gym.controllers.planner import Budget, Planner, state_of
from seastar_gym.controllers.scripted import scripted
from seastar_gym.envs import symmetry
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.results import as_text
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import lagged_gait, straight_gait, thrifty_gait, timed, turning_wave
from symmetries import assert_equivariant

PERIODS = (0.5, 0.2, 0.1)
FAST, SDIRK3 = Numerics.preset("fast"), Numerics("sdirk3", 1e-2, 1e-6)
PLUS_MINUS = straight_gait()[0]  # {2+, 5-}
SMALL = {"num_envs": 8, "rollout": 8, "batch_size": 32, "epochs": 1, "hidden": (8,), "max_episode_time": 5.0}


def speed_and_turn(gait, decision_period, seconds=6, scene=None):
    """Speed [m/s] and rate of turning [deg/s] over the last seconds, by fidelity "fast"."""
    simulator = Simulator(scene or make_scene(None, "fast", 0.5), 1, 1)
    for second in range(2 * seconds):
        if second == seconds:
            hub, heading = simulator.hub_position(), simulator.heading()
        for command in gait:
            simulator.advance(decision_period, command[None])
    turn = np.degrees(simulator.heading() - heading)[0] / seconds
    return np.linalg.norm(simulator.hub_position() - hub) / seconds, turn


# Gaits


@pytest.mark.parametrize("period, late", [(0.5, 0.5), (0.25, 0.5), (0.2, 0.6), (0.1, 0.6)])
def test_the_second_pair_lags(period, late):
    gait = lagged_gait(period)
    times = period * np.flatnonzero(gait.any(axis=1))
    np.testing.assert_allclose(times, [0.0, late])
    np.testing.assert_array_equal(gait[0], PLUS_MINUS)
    np.testing.assert_array_equal(gait[round(late / period)], [0, 0, 1, -1, 0])
    assert len(gait) == round(1 / period)
    np.testing.assert_allclose(np.unique(np.abs(thrifty_gait(period))), [0.0, 0.6])


@pytest.mark.parametrize("period", [1.0, 0.5, 0.1])
def test_strokes_begin_every_second(period):
    gait = timed(np.array([PLUS_MINUS, -PLUS_MINUS]), period)
    every = round(1 / period)
    assert gait.shape == (2 * every, 5) and np.count_nonzero(gait.any(axis=1)) == 2
    np.testing.assert_array_equal(gait[every], -PLUS_MINUS)


def test_lagged_pairs_swim_farther_and_thrifty_ones_with_less_heat():
    """7.4 and 7.6 mm/s at "balanced" (lag 0.6 s, and 0.5 s with 0.6 of the heat) against 3.3 mm/s of one pair."""
    together, _ = speed_and_turn(timed(straight_gait(), 0.5), 0.5)
    lagged, turn = speed_and_turn(lagged_gait(0.1), 0.1)
    thrifty, _ = speed_and_turn(thrifty_gait(0.5), 0.5)
    assert lagged > 2.0 * together and thrifty > 2.0 * together
    assert abs(turn) < 1e-3


def test_lagged_pairs_swim_as_fast_whatever_scheme_step_and_nodes():
    """But for the chapter's discretisation, in which the rods are other ones."""
    plain = make_scene(None, "fast", 0.5)
    fine = replace(plain, robot=replace(plain.robot, nodes_per_limb=37))
    others = [replace(plain, numerics=each) for each in (SDIRK3, Numerics("implicit-euler", 1e-3, 1e-6))]
    speeds = [speed_and_turn(lagged_gait(0.1), 0.1, 4, scene)[0] for scene in (plain, fine, *others)]
    assert max(speeds) < 1.05 * min(speeds)
    assert speed_and_turn(lagged_gait(0.1), 0.1, 4, make_scene(None, "chapter", 0.5))[0] > 0.5 * min(speeds)


def test_the_wave_turns_on_the_spot():
    speed, turn = speed_and_turn(turning_wave(0.2), 0.2)
    assert turn < -9.0 and speed < 2e-3


@pytest.mark.parametrize("gait", ["lagged-pentagon", "pentagon"])
def test_gaits_in_time_round_the_pentagon(gait):
    (done,) = evaluate(
        {"script": scripted(gait, decision_period=0.5)},
        decision_period=0.5,
        fidelity="fast",
    )
    assert done.finished and done.time[-1] == pytest.approx(0.5 * done.strokes)
    assert done.time[-1] < (120 if gait == "lagged-pentagon" else 260)
    assert done.heating_time.sum() == pytest.approx(0.1 * done.limbs_heated.sum())
    assert done.joules_per_metre == pytest.approx(7.6 * done.seconds_heated / done.hub_path_length)


@pytest.mark.parametrize(
    "name, period", [("lagged", None), ("lagged", 1.0), ("wave", 0.5), ("pentagon", 0.3), ("lagged-pentagon", 0.7)]
)
def test_gaits_that_do_not_fit_the_decisions_are_refused(name, period):
    with assert_refused("decision"):
        scripted(name, decision_period=period)


def test_partial_pulses_are_continuous_actions():
    policy = scripted("thrifty", decision_period=0.5)
    assert policy.actions == "continuous"
    env = SeastarSwimEnv(actions="continuous", decision_period=0.5, fidelity="fast")
    done = swim("thrifty", policy, env, max_strokes=4)
    np.testing.assert_allclose(done.heating_time, 0.12)
    random, _ = scripted("random", "continuous").predict(np.zeros((3, 196), np.float32))
    assert random.shape == (3, 5) and random.dtype == np.float32 and np.abs(random).max() <= 1.0


def test_an_agent_for_other_decisions_is_refused():
    for period in (1.0, 0.2):
        with assert_refused("every 0.5 s", f"every {period:g} s"):
            swim("a", scripted("lagged", decision_period=0.5), SeastarSwimEnv(decision_period=period), max_strokes=1)


# Search


@pytest.mark.parametrize("actuator", [SmaWires(), ThermalSma(), Limited(SmaPulse(), 0.5, 2.0)])
def test_the_planner_sees_the_state_of_the_wires(actuator):
    """From the state read off the observations, the same commands go the same way."""
    scene = Scene(actuator=actuator, numerics=FAST)
    env = SeastarSwimVectorEnv(3, actions="pairs", scene=scene, decision_period=0.5, random_heading=True, threads=1)
    observations, _ = env.reset(seed=3)
    env.action_space.seed(4)
    for _ in range(4):
        observations, *_ = env.step(env.action_space.sample())
    twin = Simulator(scene, 3, threads=1)
    twin.set_state(state_of(observations, scene))
    np.testing.assert_allclose(twin.actuators, env.simulator.actuators, atol=1e-5 * max(1.0, twin.actuators.max()))
    before, commands = env.simulator.hub_position(), np.tile(PLUS_MINUS, (3, 1))
    twin.advance(0.5, commands)
    env.simulator.advance(0.5, commands)
    moved = np.linalg.norm(env.simulator.hub_position() - before, axis=1)
    np.testing.assert_allclose(np.linalg.norm(twin.hub_position(), axis=1), moved, rtol=1e-3)


def test_the_planner_swims_faster_in_time_than_the_lagged_script():
    planner = Planner(decision_period=0.5, budget=Budget(3, 4), threads=1)
    env = SeastarSwimEnv([[0.1, 0.0]], actions="pairs", decision_period=0.5, fidelity="fast")
    planned = swim("planner", planner, env, max_strokes=60)
    lagged = swim("lagged", scripted("lagged", "pairs", decision_period=0.5), env, max_strokes=60)
    assert planned.finished and planned.strokes <= lagged.strokes + 1


def test_the_greedy_map_is_one_of_decisions(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    scene = make_scene(None, "fast", 0.5)
    half = displacement_map(scene, "pairs", 0.5)
    whole = displacement_map(scene, "pairs")
    assert not np.allclose(half.hub, whole.hub) and len(list(tmp_path.rglob("*.npz"))) == 2
    policy = GreedyPolicy.__new__(GreedyPolicy)
    policy.__dict__.update(scene=scene, waypoint_radius=0.01, reward=Planner(threads=1).reward, _hub=half.hub)
    env = SeastarSwimEnv(actions="pairs", scene=scene, decision_period=0.5)
    assert env.action_space.contains(policy.predict(env.reset(seed=0)[0])[0])


# Training


def learner(**more):
    hyperparameters = Hyperparameters(**SMALL, **more)
    env = make_training_env(hyperparameters, "random", random_heading=True, fidelity="fast", threads=1)
    return make_model(env, hyperparameters, seed=0)


def test_discount_and_time_limit_are_those_of_seconds():
    strokes, half = Hyperparameters(), Hyperparameters(decision_period=0.5)
    assert strokes.discount_per_decision == 0.8 and strokes.max_episode_steps == 400
    assert half.discount_per_decision == pytest.approx(0.8**0.5) and half.max_episode_steps == 800
    assert Hyperparameters(decision_period=1.0).discount_per_decision == 0.8
    for wrong in ({"decision_period": 0.0}, {"decision_period": "a"}, {"max_episode_time": np.nan}):
        with assert_refused(next(iter(wrong))):
            Hyperparameters(**wrong)
    with assert_refused("actions"):
        Hyperparameters(actions="continuous")


def test_a_timed_policy_survives_the_disk_with_its_decision_period(tmp_path):
    model = learner(decision_period=0.5)
    assert model.gamma == pytest.approx(0.8**0.5)
    assert model.env.get_attr("max_episode_steps")[0] == 10
    model.learn(64)
    learner_file.save(model, tmp_path / "model.zip")
    save(policy_of(model), tmp_path / "policy.safetensors")
    again = learner_file.resume(tmp_path / "model.zip", model.get_env())
    assert again.gamma == model.gamma
    for policy in (load(tmp_path / "policy.safetensors"), checkpoint.load(tmp_path / "model.zip")):
        assert policy.decision_period == 0.5 and isinstance(policy.scene.actuator, SmaWires)
        env = gym.make(
            "SeastarSwim-v0", actions=policy.actions, scene=policy.scene, decision_period=policy.decision_period
        ).unwrapped
        assert swim("learned", policy, env, max_strokes=3).strokes == 3
        with assert_refused("remember differently"):
            swim("learned", policy, SeastarSwimEnv(actions="pairs"), max_strokes=1)
        with assert_refused("every 0.5 s"):
            swim("learned", policy, SeastarSwimEnv(actions="pairs", decision_period=0.2), max_strokes=1)


def test_a_description_without_a_decision_period_is_of_strokes():
    description = Description("pairs", True, Scene(), (4,))
    text = description.to_json()
    assert Description.from_json(text.replace('  "decision_period": null,\n', "")) == description
    timed = Description("pairs", True, make_scene(None, None, 0.5), (4,), 0.5)
    assert Description.from_json(timed.to_json()) == timed
    with assert_refused("decision_period"):
        Description.from_json(text.replace('"decision_period": null', '"decision_period": 0.5'))


def test_a_timed_policy_behind_the_symmetry_is_equivariant():
    scene, rng = make_scene(None, "fast", 0.5), np.random.default_rng(0)
    description = Description("pairs", True, scene, (16,), 0.5)
    shapes = description.shapes()
    policy = LearnedPolicy(description, {name: rng.normal(size=shapes[name]).astype(np.float32) for name in shapes})
    seen = rng.normal(size=(100, 196)).astype(np.float32)
    assert_equivariant(policy, seen, symmetry.memory_mirror(scene.actuator))


def test_masks_are_handed_out_robot_by_robot():
    """As sb3-contrib's MaskablePPO asks for them."""
    scene = Scene(actuator=SmaWires(refractory=True), numerics=FAST)
    env = SeastarSwimVectorEnv(
        3, actions="pairs", scene=scene, decision_period=0.2, autoreset_mode=AutoresetMode.SAME_STEP, threads=1
    )
    for wrapped in (env, symmetry.VectorSymmetryReduction(env)):
        batch = BatchVecEnv(wrapped)
        batch.reset()
        _, _, _, infos = batch.step(np.array([1, 0, 5]))
        masks = np.stack(batch.env_method("action_masks"))
        assert masks.shape == (3, 21) and masks.dtype == bool
        np.testing.assert_array_equal(masks, [info["action_mask"] for info in infos])
        assert masks[1].all() and not masks[0].all()


def test_tables_of_timed_swims_count_decisions_and_seconds(tmp_path, capsys):
    command = ["--agents", "rest", "--sets", "nominal", "--decision-period", "0.5", "--fidelity", "fast"]
    assert trials_main([*command, "--seconds", "20", "--num-threads", "1", "--out", str(tmp_path / "trials.csv")]) == 0
    printed = capsys.readouterr().out
    assert "decisions" in printed and "of 0.5 s" in printed and "time [s]" in printed and "strokes" not in printed


def test_a_swim_is_counted_in_decisions_unless_they_take_a_second():
    for period, word in ((1.0, "strokes"), (0.5, "decisions")):
        env = SeastarSwimEnv([[0.02, 0.0]], decision_period=period, fidelity="fast")
        done = swim("straight", scripted("straight", decision_period=period), env, max_strokes=30)
        assert done.counted_in == word and done.result == f"{done.strokes} {word}"
        assert as_text([done]).split()[0] == word
        assert replace(done, waypoints=np.ones((7, 2))).result == "1 of 7 waypoints"
