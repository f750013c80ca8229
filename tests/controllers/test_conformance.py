"""What every agent does: the same again, of one robot as in a batch, in its action mode, and nothing where it does not
fit. Agents are bundled policies, gaits, greedy and planning ones, models of Stable-Baselines3 and functions."""

from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from later import Later
from refusals import assert_refused
from seastar_gym import HeadingTargets, Scene, Seastar, SmaWires
from seastar_gym.controllers import registry
from seastar_gym.controllers.contract import actions_of, require_fit
from seastar_gym.controllers.learned import by_name, load
from seastar_gym.controllers.open_loop import GAITS, RandomPolicy, scripted
from seastar_gym.controllers.registry import load_agents
from seastar_gym.controllers.search import Budget, Planner, gait_planner
from seastar_gym.envs.commands import action_space, to_commands
from seastar_gym.envs.tasks import NAMED
from seastar_gym.evaluation.benchmark import track_of
from seastar_gym.evaluation.swim import swim_many

stable_baselines3 = Later("stable_baselines3")

FAST = Scene.preset("fast")
WIRES = Scene(actuator=SmaWires(), numerics=FAST.numerics)
N_ROBOTS, N_DECISIONS = 4, 3
FEW = Budget(2, 3)
LEARNERS = {
    "limbs": ("PPO", {"n_steps": 8, "batch_size": 8, "n_epochs": 1}),
    "pairs": ("DQN", {"learning_starts": 4, "buffer_size": 100, "batch_size": 4}),
    "joint": ("A2C", {"n_steps": 4}),
}
"""Learners of Stable-Baselines3, by action mode."""


def train(actions):
    """A model that has learned for a few strokes, on the plain environment."""
    name, arguments = LEARNERS[actions]
    kind, env = getattr(stable_baselines3, name), gym.make("SeastarSwim-v0", actions=actions, scene=FAST)
    return kind("MlpPolicy", env, policy_kwargs={"net_arch": [8]}, seed=0, device="cpu", **arguments).learn(16)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Models by action mode, and the files that they were saved in."""
    models = {actions: train(actions) for actions in LEARNERS}
    files = {actions: tmp_path_factory.mktemp("models") / "model.zip" for actions in LEARNERS}
    for actions, model in models.items():
        model.save(files[actions])
    return models, files


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        patch.syspath_prepend(Path(__file__).parent)
        yield


def named(name, decision_period=None):
    return lambda: load_agents([name], fidelity="fast", decision_period=decision_period)[name]


SEARCHING = {
    **{name: (named(name), FAST, {}) for name in (*registry.AGENTS, "own_agents:Towards") if name != "learned"},
    "planner": (lambda: Planner(FAST, budget=FEW, threads=1), FAST, {}),
    "timed planner": (
        lambda: Planner(decision_period=0.5, budget=Budget(2, 3, 0.5), threads=1, headings=HeadingTargets()), WIRES,
        {"decision_period": 0.5, "headings": HeadingTargets()},
    ),
    "gait-planner": (lambda: gait_planner(0.05, Budget(1, 2), threads=1), WIRES, {"decision_period": 0.05}),
}  # fmt: skip
"""Agents that need the state of robots that swim: what makes one, its scene and arguments of its environment."""
SCRIPTED = {
    **{f"{name} in {mode}": (lambda name=name, mode=mode: scripted(name, mode)) for mode in ("limbs", "joint", "pairs")
       for name in ("pentagon", "4+,1-", "random")},
    **{name: named(name, 0.1) for name in GAITS},
    "random in continuous": lambda: scripted("random", "continuous"),
}  # fmt: skip
BLIND = {**SCRIPTED, **{name: (lambda file=file: load(file)) for name, file in by_name().items()}}
"""Agents that are shown numbers drawn at random."""
AGENTS = [*BLIND, *SEARCHING, *(f"model in {actions}" for actions in LEARNERS)]


@pytest.fixture
def shown(request, trained):
    """An agent, and what its robots see in some decisions, shape (N_DECISIONS, N_ROBOTS, size)."""
    name = request.param
    if name in SEARCHING:
        make, scene, more = SEARCHING[name]
        policy = make()
        batch = gym.make_vec(
            "SeastarSwim-v0", N_ROBOTS, vectorization_mode="vector_entry_point", threads=1, path="random", scene=scene,
            random_heading=True, actions="continuous", **more,
        )  # fmt: skip
        batch.action_space.seed(4)
        seen = [batch.reset(seed=3)[0], *(batch.step(batch.action_space.sample())[0] for _ in range(N_DECISIONS - 1))]
        return policy, np.array(seen)
    policy = BLIND[name]() if name in BLIND else load_agents([str(trained[1][name.split()[-1]])])["model"]
    size = policy.description.observation_size if hasattr(policy, "description") else 186
    return policy, np.random.default_rng(0).normal(size=(N_DECISIONS, N_ROBOTS, size)).astype(np.float32)


def is_ours(policy):
    """Whether the package has the code of a policy."""
    return type(policy).__module__.startswith("seastar_gym") and not isinstance(policy, registry.OwnPolicy)


def decisions(policy, seen, begun):
    """Actions in a row; some robots begin an episode with the last decision but one."""
    state, actions = None, []
    for k, observation in enumerate(seen):
        action, state = policy.predict(observation, state, begun if k == N_DECISIONS - 2 else None, deterministic=True)
        actions.append(action)
    return np.array(actions)


@pytest.mark.parametrize("shown", AGENTS, indirect=True)
def test_an_agent_decides_the_same_again_for_one_robot_and_for_many(shown):
    """Whatever begins a new episode beside it; a copy does so, too. What no robot sees is refused."""
    policy, seen = shown
    for wrong in (np.zeros((1, 1, 186), np.float32), np.float32(1.0), np.zeros((2, 186), bool)):
        if is_ours(policy):  # others say what they like
            with assert_refused("bservation"):
                policy.predict(wrong)
    copy, begun = deepcopy(policy), np.array([False, True, False, True])
    together = decisions(policy, seen, begun)
    np.testing.assert_array_equal(decisions(copy, seen, begun), together)
    space = action_space(actions_of(policy, 5), 5)
    assert together.shape == (N_DECISIONS, N_ROBOTS, *space.shape)
    assert all(action in space for action in together.reshape(-1, *space.shape))
    if isinstance(policy, RandomPolicy):
        return
    for robot in range(N_ROBOTS):
        alone = decisions(policy, seen[:, robot], begun[robot : robot + 1])
        np.testing.assert_array_equal(alone, together[:, robot])
    anew = decisions(policy, seen[1:], None)
    np.testing.assert_array_equal(anew[:, begun], together[1:, begun])


@pytest.mark.parametrize("shown", [*by_name(), *SEARCHING], indirect=True)
def test_a_robot_rests_by_an_observation_that_cannot_be_and_others_go_on(shown):
    policy, seen = shown
    if not is_ours(policy):
        return
    begun, others, damaged = np.array([False, True, False, True]), [0, 1, 3], seen.copy()
    expected = decisions(policy, seen, begun)[:, others]
    for number in (np.nan, np.inf, -np.inf, 1e38):
        damaged[1, 2, [-3, 7]] = number
        acted = decisions(policy, damaged, begun)
        np.testing.assert_array_equal(acted[:, others], expected, err_msg=str(number))
        assert not to_commands(actions_of(policy, 5), 5, acted[1, 2:3], 1).any(), number


# Models of Stable-Baselines3


@pytest.mark.parametrize("actions", LEARNERS)
def test_a_model_acts_as_it_did_when_it_was_saved(actions, trained):
    model, file = (of[actions] for of in trained)
    (policy,) = load_agents([str(file)]).values()
    assert track_of(policy) == "plain"
    observations = np.random.default_rng(0).normal(size=(50, 186)).astype(np.float32)
    acted, expected = (each.predict(observations, deterministic=True)[0] for each in (policy, model))
    np.testing.assert_array_equal(acted, expected)
    (done,) = swim_many("mine", model, "pentagon", 1, FAST, max_strokes=1, threads=1)
    assert done.strokes == 1


# Bundled policies


@pytest.mark.parametrize("name, file", by_name().items(), ids=by_name())
def test_a_bundled_policy_fits_its_robot_and_mode_alone(name, file):
    policy = load(file)
    about = policy.description
    own = about.scene, about.actions, about.decision_period, about.observation_size
    task = about.task and NAMED[about.task]
    require_fit(policy, *own, task, about.sight)
    for change, words in (
        ((replace(about.scene, robot=Seastar(n_limbs=4)), *own[1:]), "robot of 5 limbs, the environment's has 4."),
        ((own[0], "continuous", *own[2:]), "takes actions=\"continuous\"."),
        ((*own[:3], 3), "the environment shows 3"),
        ((*own[:2], 0.3, own[3]), "make them equal"),
    ):  # fmt: skip
        with assert_refused(words):
            require_fit(policy, *change, task, about.sight)
