"""Evaluation: the measures of a swim, the loop in which policies swim, and what is written of a comparison."""

from itertools import count
from typing import get_args

import gymnasium as gym
import imageio.v3 as imageio
import numpy as np
import pytest

from evaluation.made_up import made_up_swim
from later import Later
from refusals import assert_refused
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.envs.commands import Actions, action_space, to_commands
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks import NAMED
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.pictures import COLOURS
from seastar_gym.evaluation.results import results, time_series, write_csv
from seastar_gym.evaluation.rollout import Episodes, make_batch, measure_of_task, rollout
from seastar_gym.evaluation.swim import RECORDED, Disturbance, swim, swims_of

colors = Later("matplotlib.colors")

SHORT = [[0.02, 0.0]]
EASY = {"fidelity": "fast", "waypoint_radius": 2e-3, "say": lambda text: None}

# Measures of a swim


TO_AND_FRO = [(0.0, 0.0), (0.02, 0.0), (0.01, 0.0), (0.03, 0.0), (0.02, 0.0), (0.04, 0.0)]
AHEAD = ((0.1, 0.0), (0.1, 0.1), (0.0, 0.0))
UNKNOWN = {"heating_time": np.full(1, np.nan), "energy": np.full(1, np.nan)}
SWIMS = {
    "follows the path round a corner, whose waypoint is reached 5 mm early: no error":
        made_up_swim([(0.0, 0.0), (0.095, 0.0), (0.1, 0.0), (0.1, 0.05), (0.1, 0.1)], [0, 1, 1, 1, 2]),
    "strays from the legs at hand": made_up_swim([(0.0, 0.0), (0.05, 0.02), (0.11, 0.0), (0.13, 0.05)], [0, 0, 1, 1]),
    "is on a leg that is yet to come: an error": made_up_swim([(0.0, 0.0), (0.05, 0.05)], [0, 0], waypoints=AHEAD),
    "swims 70 mm with 7 limbs heated":
        made_up_swim([(0.0, 0.0), (0.03, 0.0), (0.03, 0.04)], [0, 0, 0], limbs_heated=np.array([2, 5])),
    "stays: no number per metre": made_up_swim([(0.0, 0.0), (0.0, 0.0)], [0, 0]),
    "has unknown energy: no number": made_up_swim([(0.0, 0.0), (0.03, 0.0)], [0, 0], **UNKNOWN),
    "swims to and fro in strokes: all of it is its way": made_up_swim(TO_AND_FRO, [0] * 6),
    "swims to and fro within a second: that is no way": made_up_swim(TO_AND_FRO, [0] * 6, time=0.5 * np.arange(6.0)),
}  # fmt: skip
MEASURED = ("cross_track_errors", "finished", "strokes", "counted_in", "result", "waypoints_reached",
            "hub_path_length", "heated_per_metre", "seconds_heated", "joules_per_metre")  # fmt: skip


def test_measures_of_swims_are_as_kept(golden):
    def told(value):
        return str(np.round(value, 9)) if isinstance(value, float | np.ndarray) else str(value)

    golden("measures.txt", "".join(f"A swim that {case}\n" + "".join(
        f"  {name}: {told(getattr(done, name))}\n" for name in MEASURED) for case, done in SWIMS.items()))  # fmt: skip


def test_agents_swim_the_same_path():
    """A random one with a random heading, too, or that of the options of a reset."""
    agents = {"a": scripted("straight"), "b": scripted("rest")}
    a, b = evaluate(agents, "random", seed=5, max_strokes=2, random_heading=True, **EASY)
    np.testing.assert_array_equal(a.waypoints, b.waypoints)
    for seed, is_same in ((5, True), (6, False)):
        (other,) = evaluate({"a": agents["a"]}, "random", seed=seed, max_strokes=2, random_heading=True, **EASY)
        assert np.array_equal(other.hub, a.hub) == is_same
    (done,) = evaluate({"a": scripted("straight")}, reset_options={"path": SHORT}, **EASY)
    np.testing.assert_array_equal(done.waypoints, SHORT)
    assert done.finished


# What is written


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder and swims of an evaluation of one agent that finishes and one that does not."""
    folder, agents = tmp_path_factory.mktemp("evaluation"), {name: scripted(name) for name in ("straight", "2-,5+")}
    return folder, evaluate(agents, SHORT, max_strokes=8, out=folder / "new", trajectory=True, **EASY)


def test_files_hold_the_swims_and_a_picture_their_traces(written, tmp_path, monkeypatch):
    folder, swims = written
    for name, rows in (("evaluation.csv", results(swims)), ("trajectories.csv", time_series(swims))):
        write_csv(rows, tmp_path / name)
        assert (folder / "new" / name).read_text() == (tmp_path / name).read_text()
    pixels = imageio.imread(folder / "new" / "traces.png")[..., :3].astype(float) / 255.0
    assert min(pixels.shape[:2]) > 200
    for colour in COLOURS[:2]:
        assert np.count_nonzero(np.abs(pixels - colors.to_rgb(colour)).max(axis=-1) < 0.02) > 100
    monkeypatch.chdir(tmp_path)
    evaluate({"a": scripted("straight")}, SHORT, max_strokes=1, **EASY)
    evaluate({"a": scripted("straight")}, SHORT, max_strokes=1, out="there", video=False, **EASY)
    found = {str(file.relative_to(tmp_path)) for file in tmp_path.rglob("*.*")}
    assert found == {"evaluation.csv", "trajectories.csv", "there/evaluation.csv", "there/traces.png"}


REST = {"a": scripted("rest")}
REFUSED = [
    (lambda: evaluate({}, SHORT, **EASY), "at least one agent"),
    (lambda: evaluate(REST, SHORT, max_strokes=0, **EASY), "max_strokes must be a whole number from 1"),
    (lambda: evaluate(REST, SHORT, scene=5, **EASY), "scene must be a Scene"),
    (lambda: evaluate({"a b": scripted("rest"), "a/b": scripted("rest")}, SHORT, out="x", **EASY), "same file name"),
    (lambda: Disturbance(lost=1.5), "weakness and lost must be at most 1"),
    (lambda: Disturbance(weakness=2.0), "weakness and lost must be at most 1"),
    (lambda: Disturbance(noise=-1.0), "Disturbance.noise"),
    (lambda: Disturbance(current=np.nan), "Disturbance.current"),
]
"""What is refused, and words of the sentence."""


@pytest.mark.parametrize("call, words", REFUSED)
def test_what_cannot_be_evaluated_is_refused(call, words):
    with assert_refused(words):
        call()


# The one loop in which policies swim: what they are asked, when episodes end, and what is kept of them.


class Asked:
    """A policy that swims along limb 1 and writes down what it is asked. It counts the decisions of every episode."""

    def __init__(self):
        self.asked = []

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        alone = observation.ndim == 1
        before = np.zeros(1 if alone else len(observation), int) if state is None else state
        self.asked.append((None if state is None else state.tolist(), list(episode_start), deterministic))
        action = np.array([0, 1, 0, 0, 2])
        return action if alone else np.tile(action, (len(observation), 1)), np.where(episode_start, 0, before) + 1


def batch(n, **arguments):
    return make_batch("SeastarSwim-v0", n, 1, **{"fidelity": "fast", "max_episode_steps": 3, **arguments})


def test_a_policy_gets_its_state_back_and_hears_of_every_start_once():
    policy = Asked()
    done = swim("asked", policy, SeastarSwimEnv(fidelity="fast"), max_strokes=3, seed=0)
    assert policy.asked == [(None, [True], True), ([1], [False], True), ([2], [False], True)]
    assert done.strokes == 3
    np.testing.assert_array_equal(done.time, [0.0, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(done.limbs_heated, [2, 2, 2])
    policy = Asked()
    rollout(batch(2), policy, seeds=0)
    assert policy.asked == [(None, [True] * 2, True), ([1, 1], [False] * 2, True), ([2, 2], [False] * 2, True)]


def test_a_rollout_ends_when_it_is_told_to_and_shows_every_info():
    seen = []

    def look(info):
        seen.append(info["time"][0])
        return len(seen) == 3

    assert rollout(batch(1, max_episode_steps=9), Asked(), seeds=0, on_step=look).decisions.tolist() == [2]
    assert seen == [0.0, 1.0, 2.0]
    numbers = count()
    found = rollout(batch(1, max_episode_steps=9), Asked(), seeds=0, until=4, on_step=lambda info: next(numbers))
    assert found.decisions.tolist() == [4] and next(numbers) == 5  # a number is no wish to end
    assert not found.success.any()


@pytest.mark.parametrize("kind", ["vector_entry_point", "sync"])
def test_episodes_of_a_batch_are_those_of_one_robot_each(kind):
    """Whatever makes the batch; each in its own time: one robot arrives early and rests, the others have a limit."""
    own = {"path": [[0.06, 0.0]], "random_heading": True, "fidelity": "fast", "actions": "pairs"}
    own["waypoint_radius"] = 0.05
    robots = gym.make_vec("SeastarSwim-v0", 3, vectorization_mode=kind, **own)
    found = rollout(robots, scripted("straight", "pairs"), seeds=[0, 1, 2], until=8, record=(*RECORDED, "nothing"))
    assert "nothing" not in found.entries and found.decisions.tolist() == [6, 3, 8]
    for robot, seed in enumerate((0, 1, 2)):
        env = gym.make("SeastarSwim-v0", **own)
        alone = rollout(env, scripted("straight", "pairs"), seeds=seed, until=8, record=RECORDED)
        assert alone.decisions[0] == found.decisions[robot] and alone.success[0] == found.success[robot]
        assert alone.returns[0] == found.returns[robot] and alone.total("energy")[0] == found.total("energy")[robot]
        for name in ("time", "hub_position", "waypoint_index"):
            np.testing.assert_array_equal(alone.last(name)[0], found.last(name)[robot])
        np.testing.assert_array_equal(alone.of("energy")[:, 0], found.of("energy")[: alone.decisions[0], robot])
        assert np.isnan(found.of("energy")[alone.decisions[0] :, robot]).all()


def test_who_has_arrived_rests_until_all_have():
    batch, commands = SeastarSwimVectorEnv(2, path="line", fidelity="fast", threads=1), []
    step = batch.step
    batch.step = lambda actions: commands.append(np.array(actions)) or step(actions)
    paths = [np.array(SHORT), np.array([[0.04, 0.0]])]
    batch.set_attr("path", paths)
    early, late = swims_of("asked", rollout(batch, Asked(), seeds=0, record=RECORDED))
    assert early.finished and late.finished and early.strokes < late.strokes == len(commands)
    assert [given[0].any() for given in commands] == [stroke < early.strokes for stroke in range(late.strokes)]
    assert all(given[1].any() for given in commands)
    np.testing.assert_array_equal(early.waypoints, paths[0])
    for actions in get_args(Actions):  # zero is rest in every action mode
        zero = np.zeros_like(action_space(actions, 5).sample())
        assert not to_commands(actions, 5, np.array([zero]), 1).any()


# Every task is measured by what it asks for, over episodes that end with success or without.


def test_measures_are_those_of_finished_and_unfinished_episodes():
    """Episodes of three decisions without success, and of one with success; of the station, of three both."""
    time = np.array([[10.0, 10.0], [20.0, 20.0], [40.0, 40.0]])
    distance = 0.001 * np.array([[9.0, 1.0], [8.0, 1.0], [2.0, 3.0]])
    entries = {"time": time, "distance": distance, "catches": time / 10.0, "taken": time / 5.0}
    of_reset = {name: np.concatenate([np.zeros((1, 2)), values]) for name, values in entries.items()}
    episodes = Episodes(of_reset, np.array([False, True]), np.zeros(2), np.array([3, 1]), (), limit=400.0)
    both = episodes._replace(decisions=np.array([3, 3]))
    for challenge, of, expected in (
        ("miswired", episodes, [400.0, 10.0]), ("prey", episodes, [4.0, 1.0]), ("prizes", episodes, [8.0, 2.0]),
        ("station", both, [2.0, 3.0]),
    ):  # fmt: skip
        assert measure_of_task(NAMED[challenge]).of(of).tolist() == pytest.approx(expected)
