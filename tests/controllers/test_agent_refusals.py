"""Controllers refuse in a sentence what they could not use, and take what is just allowed."""

import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from refusals import assert_refused
from seastar_gym import HeadingTargets, Numerics, RewardWeights, Scene, Seastar
from seastar_gym.controllers import checkpoint, learned, third_party
from seastar_gym.controllers.contract import actions_of, as_floating, observed, require_fit, require_policy, starts
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.greedy import GreedyPolicy
from seastar_gym.controllers.planner import TIMED_BUDGETS, Budget, Planner, Targets, budget_for
from seastar_gym.controllers.registry import load_agent, load_agents
from seastar_gym.controllers.scripted import RandomPolicy, scripted

FAST = Scene(numerics=Numerics.preset("fast"))
TWO = Scene(Seastar(limb_length=np.array([0.1, 0.09])))


def agent(**attributes):
    """Policy with attributes of its own."""
    return SimpleNamespace(predict=lambda *_: None, **attributes)


def fitting(policy, **more):
    """Whether a policy can drive the chapter's robot."""
    return require_fit(policy, FAST, "pairs", **more)


REFUSED = {
    "no predict": (lambda: require_policy(3), "must have predict(observation, ...)"),
    "a class": (lambda: require_policy(RandomPolicy), "must have predict(observation, ...)"),
    "an unknown space": (lambda: actions_of(agent(action_space=Discrete(7)), 5), "is no action mode of a robot of 5"),
    "other decisions": (lambda: fitting(agent(decision_period=0.5)), "decides every 0.5 s, the environment every 1 s"),
    "strokes": (lambda: fitting(agent(decision_period=1.0), decision_period=0.5), "the environment every 0.5 s"),
    "other observations": (
        lambda: fitting(agent(observation_space=Box(-1.0, 1.0, (7,)))), "observations of shape (7,), the environment's",
    ),
    "other numbers": (
        lambda: fitting(agent(observation_space=Box(-1.0, 1.0, (186,))), n_seen=191), "the environment's have (191,)",
    ),
    "another space": (lambda: fitting(agent(action_space=Discrete(243))), 'environment with actions="pairs"'),
    "texts": (lambda: as_floating("observation", ["a"]), "observation must be numbers, not"),
    "flags": (lambda: as_floating("observation", [True]), "observation must be numbers, not"),
    "a cube": (lambda: observed(np.zeros((1, 1, 9)), 1), "must have shape (size,) or (n, size)"),
    "a point": (lambda: observed(np.float32(1.0), 0), "must have shape (size,) or (n, size)"),
    "too few numbers": (lambda: observed(np.zeros(3), 4), "with 4 numbers or more, not (3,)"),
    "starts of floats": (lambda: starts([0.0], 1), "episode_start must be flags of shape (1,)"),
    "starts of others": (lambda: starts([True] * 3, 2), "episode_start must be flags of shape (2,)"),
    "starts in rows": (lambda: starts([[True]], 1), "episode_start must be flags of shape (1,)"),
    "weights in a list": (lambda: learned._require_weights([1.0]), "weights must be arrays by name"),
    "weights of lists": (lambda: learned._require_weights({"0.bias": [1.0]}), "weights must be arrays by name"),
    "no description": (lambda: learned.LearnedPolicy(3, {}), "description must be a Description"),
    "no policy": (lambda: learned.save(3, "mine.safetensors"), "policy must be a LearnedPolicy"),
    "no scene": (lambda: GreedyPolicy(3), "scene must be a Scene"),
    "several robots": (lambda: GreedyPolicy(TWO), "scene must be that of one robot."),
    "no radius": (lambda: Planner(FAST, 0.0), "waypoint_radius"),
    "no reward": (lambda: Planner(FAST, reward=3), "reward must be RewardWeights"),
    "no headings": (lambda: Planner(FAST, headings=3), "headings must be HeadingTargets"),
    "no budget": (lambda: Planner(FAST, budget=3), "budget must be a Budget"),
    "no threads": (lambda: Planner(FAST, threads=0), "threads"),
    "no depth": (lambda: Budget(0, 1), "depth must be a whole number from 1 to 1000"),
    "no beam": (lambda: Budget(1, 0), "beam must be a whole number from 1 to 100000"),
    "too deep": (lambda: Budget(1001), "depth must be a whole number from 1 to 1000"),
    "too wide": (lambda: Budget(1, 100_001), "beam must be a whole number from 1 to 100000"),
    "coasting back": (lambda: Budget(coasting=-0.1), "coasting"),
    "a budget for no time": (lambda: budget_for(0.0), "decision_period"),
    "an agent by number": (lambda: load_agent(3, None), "name must be the name of an agent"),
    "an agent in no environment": (lambda: load_agent("rest", 3), "env must be an environment of this package, not 3"),
    "a seed below zero": (lambda: load_agents(["rest"], -1), "seed"),
    "an unknown fidelity": (lambda: load_agents(["rest"], fidelity="quick"), "fidelity must be one of"),
    "no decisions": (lambda: load_agents(["rest"], decision_period=-1.0), "decision_period"),
    "agents of no scene": (lambda: load_agents(["rest"], scene=3), "scene must be a Scene"),
    "agents in no list": (lambda: load_agents("rest"), "Agents"),
    "a gait by number": (lambda: scripted(3), "name must be the name of a gait"),
    "a gait of no decisions": (lambda: scripted("rest", decision_period=0.0), "decision_period"),
    "a gait of no limbs": (lambda: scripted("rest", n_limbs=0), "n_limbs"),
    "a gait without rng": (lambda: scripted("random", rng=3), "rng must be a numpy Generator"),
}  # fmt: skip
"""What is refused, and words of the sentence."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_controller_could_use_is_refused_in_a_sentence(case):
    make, words = REFUSED[case]
    with assert_refused(words):
        make()


def test_what_is_just_allowed_is_taken():
    fitting(agent(decision_period=1.0 + 1e-12, observation_space=Box(-1.0, 1.0, (186,)), action_space=Discrete(21)))
    require_policy(agent())
    assert observed(np.zeros(4), 4).shape == (4,) and observed(np.zeros((0, 4)), 4).shape == (0, 4)
    assert starts(None, 2).tolist() == [False] * 2 and starts(True, 2).tolist() == starts([1], 2).tolist() == [True] * 2
    assert starts([0, 1], 2).tolist() == [False, True]
    assert (Budget(1000, 100_000).depth, Budget(1, 1).beam) == (1000, 1)
    assert actions_of(agent(action_space=Discrete(73)), 9) == "pairs" and actions_of(agent(), 9) == "limbs"


def test_a_search_is_allowed_the_budget_of_the_next_longer_decision():
    assert [budget_for(seconds) for seconds in (None, 1.0, 0.5, 0.4, 0.2, 0.15, 0.1, 0.05)] == [
        Budget(), Budget(), *(TIMED_BUDGETS[known] for known in (0.5, 0.5, 0.2, 0.2, 0.1, 0.1)),
    ]  # fmt: skip
    cost = [budget.beam * (budget.depth - 1) for _, budget in sorted(TIMED_BUDGETS.items())]
    assert cost == sorted(cost)


@pytest.mark.parametrize("headings", [None, HeadingTargets(tolerance=0.2)])
def test_a_planner_of_strokes_and_one_in_time_know_their_scene(headings):
    strokes, timed = Planner(headings=headings), Planner(decision_period=0.5, headings=headings)
    assert strokes.scene == Scene.preset("fast") and timed.scene.actuator.has_memory
    assert (strokes.budget, timed.budget) == (Budget(), TIMED_BUDGETS[0.5])
    seen = np.random.default_rng(0).normal(size=(2, timed._layout.size)).astype(np.float32)
    targets, at = timed._targets(seen), timed._layout
    np.testing.assert_allclose(targets.current, 0.1 * seen[:, at.current_waypoint])
    np.testing.assert_allclose(targets.after, 0.1 * seen[:, at.next_waypoint])
    if headings is None:
        assert targets.turn is targets.turn_after is None
        return
    for turn, (c, s) in zip((targets.turn, targets.turn_after), ((0, 1), (2, 3)), strict=True):
        c, s = seen[:, at.headings][:, [c, s]].T.astype(float)
        np.testing.assert_allclose(turn, np.arctan2(s, c))


def test_a_search_in_time_compares_robots_that_have_coasted():
    """Without commands they swim on; the one that ends nearest counts, not the one that is nearest now."""
    planner = Planner(decision_period=0.5, budget=Budget(1, 1, 0.5), threads=1)
    scene, n = planner.scene, 21
    start = planner._swim_all._simulator(1).get_state()
    later = planner._swim_all(start)
    coasted = planner._swim_all.coasted(later, 0.5)
    assert coasted.shape == (n, scene.robot.n_nodes, 2)
    goal = np.array([[0.3, 0.1]])
    (chosen,) = planner._search(start, Targets(goal, goal))
    ways = np.hypot(*(coasted[:, 0] - goal).T)
    assert ways[chosen] == ways.min() and np.argmin(np.hypot(*(later.positions[:, 0] - goal).T)) != chosen


@pytest.mark.parametrize("content", [None, b"no zip"])
def test_a_file_that_is_no_zip_is_no_model(content, tmp_path):
    file = tmp_path / "model.zip"
    if content is not None:
        file.write_bytes(content)
    assert not third_party.is_model(file)
    with pytest.raises((ValueError, FileNotFoundError), match=r"model\.zip.*\.$"):
        checkpoint.load(file)


def test_a_zip_is_a_model_of_others_if_it_has_their_entries_and_not_ours(tmp_path):
    file, names = tmp_path / "model.zip", ("data", "policy.pth", "policy.json")
    for known, expected in ((names[:2], True), (names, False), (names[:1], False), (names[1:], False)):
        with zipfile.ZipFile(file, "w") as archive:
            for name in known:
                archive.writestr(name, "")
        assert third_party.is_model(file) == expected


def test_a_network_of_a_training_is_a_policy(tmp_path):
    description = Description("pairs", False, FAST, (4, 3))
    rng = np.random.default_rng(0)
    weights = {name: rng.normal(size=shape).astype(np.float32) for name, shape in description.shapes().items()}
    names = {"0": "mlp_extractor.policy_net.0", "1": "mlp_extractor.policy_net.2", "2": "action_net"}
    arrays = {
        f"network.{names[layer]}.{kind}": array
        for (layer, _, kind), array in ((name.partition("."), array) for name, array in weights.items())
    }
    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        archive.writestr("policy.json", description.to_json())
        archive.writestr("learner.safetensors", learned.safetensors.numpy.save(arrays | {"other": np.zeros(3)}))
    policy = checkpoint.load(tmp_path / "model.zip")
    assert policy.description == description
    assert all((policy.weights[name] == array).all() for name, array in weights.items())


def test_rewards_of_a_search_are_those_of_its_environment():
    own = RewardWeights(progress=1.0)
    assert Planner(FAST, reward=own).reward is own and Planner(FAST).reward == RewardWeights()
