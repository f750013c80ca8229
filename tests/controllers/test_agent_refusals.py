"""Controllers refuse in a sentence what they could not use, and take what is just allowed."""

import json
import json.decoder
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete

from refusals import assert_refused
from seastar_gym import HeadingTargets, Numerics, RewardWeights, Scene, Seastar
from seastar_gym.cli.main import main
from seastar_gym.controllers import checkpoint, learned, third_party
from seastar_gym.controllers.contract import (
    actions_in,
    actions_of,
    as_floating,
    observed,
    require_fit,
    require_policy,
    starts,
)
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.greedy import GreedyPolicy
from seastar_gym.controllers.learned import BUNDLED, bundled_file, by_name, of_task, pretrained
from seastar_gym.controllers.planner import TIMED_BUDGETS, Budget, Planner, Targets, budget_for
from seastar_gym.controllers.registry import AGENTS, default_agents, files_of, load_agent, load_agents
from seastar_gym.controllers.scripted import GAITS, OpenLoopPolicy, RandomPolicy, scripted
from seastar_gym.envs.paths import PATHS
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

FAST = Scene(numerics=Numerics.preset("fast"))
FOUR = Scene(Seastar(4))
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
    "an agent twice": (lambda: load_agents(["rest", "rest"]), "The agent 'rest' is named twice."),
    "an agent for others": (lambda: load_agents(["pentagon"], scene=FOUR), "are for five limbs, not 4"),
    "an unknown agent": (lambda: load_agents(["gallop"]), "Unknown scripted agent 'gallop'"),
    "an unknown agent, and others": (
        lambda: load_agents(["gallop"]), "Others are learned, greedy, planner, gait-planner",
    ),
    "a gait by number": (lambda: scripted(3), "name must be the name of a gait"),
    "a gait of no decisions": (lambda: scripted("rest", decision_period=0.0), "decision_period"),
    "a gait of no actions": (lambda: scripted("pentagon", "legs"), "actions must be one of"),
    "random draws of no actions": (lambda: scripted("random", "legs"), "actions must be one of"),
    "no pair of all limbs": (lambda: OpenLoopPolicy(np.ones((1, 5)), "pairs"), 'no action with actions="pairs"'),
    "half a command": (lambda: OpenLoopPolicy(np.full((1, 5), 0.5), "limbs"), 'no action with actions="limbs"'),
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


# Agents by name: one line adds one, and the command lines tell all names.


def test_an_agent_of_one_line_is_made_for_the_scene_of_the_fidelity(monkeypatch):
    scenes = []

    def mine(scene, decision_period, task):
        assert decision_period is None and task is None
        scenes.append(scene)
        return scripted("rest")

    monkeypatch.setitem(AGENTS, "mine", mine)
    assert list(load_agents(["mine", "rest"], fidelity="fast")) == ["mine", "rest"]
    assert [type(scene) for scene in scenes] == [Scene] and scenes[0] == Scene.preset("fast")


def test_an_agent_by_its_name_fits_the_environment():
    env = SeastarSwimEnv(fidelity="fast", scene=Scene(Seastar(4)))
    policy = load_agent("rest", env)
    action, _ = policy.predict(env.reset(seed=0)[0])
    assert env.action_space.contains(action) and not env.step(action)[4]["limbs_heated"]


def test_help_tells_the_names_of_all_agents(capsys):
    with pytest.raises(SystemExit):
        main(["evaluate", "--help"])
    text = " ".join(capsys.readouterr().out.replace("│", " ").split()).replace("- ", "-")  # names are parted at hyphens
    assert ", ".join(AGENTS) in text and ", ".join(GAITS) in text
    assert "usage: seastar evaluate" in text and ", ".join(PATHS) in text


@pytest.mark.parametrize("n_limbs, names", [(5, ("learned", "pentagon")), (4, ("greedy", "straight"))])
def test_agents_by_default_fit_the_robot(n_limbs, names):
    assert default_agents(Scene(Seastar(n_limbs))) == names


def test_what_a_policy_is_made_of_has_files():
    box = bundled_file(None)
    assert files_of("learned") == [box, box.with_suffix(".json")]
    assert files_of("learned", 0.5) == [bundled_file(0.5), bundled_file(0.5).with_suffix(".json")]
    assert files_of("runs/mine.safetensors") == [Path("runs/mine.safetensors"), Path("runs/mine.json")]
    assert files_of("model.zip") == [Path("model.zip")] and files_of("runs/mine") == [Path("runs/mine")]
    named = bundled_file(0.2)
    assert files_of("timed-0.2s") == [named, named.with_suffix(".json")]
    assert load_agents(["timed-0.2s"], decision_period=0.2)["timed-0.2s"].decision_period == 0.2
    assert [files_of(name) for name in ("greedy", "planner", "straight", "4+,1-")] == [[]] * 4
    assert files_of("json.decoder:JSONDecoder") == [Path(json.decoder.__file__)]
    for nothing in ("nowhere_at_all:make", "sys:exit", "nowhere.at_all:make"):
        with assert_refused("no file has the module"):
            files_of(nothing)


def test_the_policy_in_the_box_is_that_of_the_task_and_the_decisions():
    assert [bundled_file(period).name for period in (None, 0.5, 0.1)] == [
        "strokes.safetensors", "timed-0.5s.safetensors", "timed-0.1s.safetensors",
    ]  # fmt: skip
    of_miswired = BUNDLED.parent / "tasks" / "miswired-0.5s.safetensors"
    assert bundled_file(0.5, task="miswired") == of_task("miswired", 0.5) == of_miswired
    assert of_task("miswired", None).name == "miswired.safetensors"
    assert bundled_file(0.25, task="miswired").name == "timed-0.25s.safetensors"  # of waypoints, where there is none
    for wrong in ({"decision_period": -1.0}, {"decision_period": None, "task": 3}):
        with assert_refused([*wrong][-1]):
            bundled_file(**wrong)


def test_a_bundled_policy_has_a_name():
    for name, file in by_name().items():
        assert Description.from_facts(json.loads(file.with_suffix(".json").read_text())).scene == pretrained(name).scene
    assert pretrained().decision_period == 1.0 and pretrained("timed-0.2s").decision_period == 0.2
    for wrong in ("timed-0.3s", 0.2):
        with assert_refused("There is no bundled policy", "take one of strokes, timed-0.2s, timed-0.5s, fail-blind"):
            pretrained(wrong)


def test_a_policy_says_its_action_mode_or_takes_that_of_the_environment():
    class Silent:
        action_space = None

    class InPairs:
        action_space = Discrete(21)

    class Named:
        actions = "joint"

    assert [actions_in(policy(), "continuous", 5) for policy in (Silent, InPairs, Named)] == [
        "continuous", "pairs", "joint",
    ]  # fmt: skip
    assert actions_of(Silent(), 5) == "limbs" and actions_of(InPairs(), 5) == "pairs"
