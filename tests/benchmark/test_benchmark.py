"""The benchmark measures any agent on any registered task, and its results can be merged."""

import json
import math
import os
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from losing import LOST, Interrupted, Losing, first
from odd_values import taken
from refusals import assert_refused, assert_told
from seastar_gym import __version__
from seastar_gym.benchmark import page
from seastar_gym.benchmark.command import main
from seastar_gym.benchmark.results import MOST, Entry, best_means, merged, read, relative, write
from seastar_gym.command import INTERRUPTED
from seastar_gym.controllers import GreedyPolicy, load_agent, scripted
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.tasks.station import Station
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.measures import MEASURES, SECONDS, measure_of
from seastar_gym.evaluation.tasks import make_batch, require_seen, swim_episodes, task_ids

ROOT = Path(__file__).resolve().parents[2]
SWIM, SHORT, OTHER = "SeastarSwim-v0", "SeastarShort-v0", "SeastarDrift-v0"


class DriftEnv(SeastarSwimEnv):
    """A task of another measure, with a split."""

    challenge = Station()

    def __init__(self, split="train", **arguments):
        assert split == "test"
        super().__init__(**arguments)


@pytest.fixture
def tasks():
    """Two tasks that a user's package might register in this one's name: a short path, and one without a batch."""
    entry = {"entry_point": "seastar_gym.envs.seastar_swim:SeastarSwimEnv"}
    batch = {"vector_entry_point": "seastar_gym.envs.vector:SeastarSwimVectorEnv"}
    short = {"path": [[0.03, 0.0]], "random_heading": True, "fidelity": "fast"}
    gym.register(SHORT, **entry, **batch, max_episode_steps=30, kwargs=short)
    gym.register(OTHER, DriftEnv, max_episode_steps=33, kwargs={"fidelity": "fast"})
    yield
    for task in (SHORT, OTHER):
        del gym.registry[task]


def entry(agent="a", scores=(2.0, 2.0, 4.0, 4.0), **more):
    n = len(scores)
    facts = {
        "task": SWIM, "agent": agent, "fidelity": "", "measure": "time", "unit": "s", "better": "less",
        "seeds": list(range(HELD_OUT_SEED, HELD_OUT_SEED + n)), "scores": list(scores), "success": [True] * n,
        "returns": [0.0] * n, "decisions": [1] * n,
    }  # fmt: skip
    return Entry(**facts | more)


# Episodes


def test_tasks_are_the_registered_ids_of_this_package(tasks):
    assert {SWIM, "SeastarSwimTimed-v0", SHORT} <= set(task_ids())
    assert not any(id.startswith("CartPole") for id in task_ids())
    assert isinstance(make_batch(SHORT, 2), SeastarSwimVectorEnv)
    assert isinstance(make_batch(OTHER, 2, split="test"), gym.vector.SyncVectorEnv)


def test_returns_are_sums_of_rewards_and_who_does_not_arrive_has_the_time_limit(tasks):
    swum = swim_episodes(SHORT, scripted("4+,1-"), [7])
    env, total = gym.make(SHORT), 0.0
    env.reset(seed=7)
    for _ in range(swum.decisions[0]):
        total += env.step(np.array([2, 0, 0, 1, 0]))[1]
    assert swum.returns[0] == pytest.approx(total)
    swum = swim_episodes(SHORT, scripted("rest"), [0, 1], max_decisions=4)
    assert SECONDS.of(swum).tolist() == [4.0, 4.0] and not swum.success.any()


def test_a_task_of_another_measure_without_a_batch_is_swum_on_its_held_out_split(tasks, monkeypatch):
    monkeypatch.setattr("seastar_gym.evaluation.tasks.task_ids", lambda: [OTHER])
    env = DriftEnv("test", fidelity="fast")
    assert measure_of(env) is MEASURES[Station] and measure_of(SeastarSwimEnv()) is SECONDS
    swum = swim_episodes(OTHER, scripted("rest"), [0, 1])
    side = np.hypot(*env.reset(seed=0)[0][182:184]) * 100.0
    np.testing.assert_allclose(MEASURES[Station].of(swum), side, rtol=1e-3)


def test_agents_are_made_for_the_environment_they_swim_in_and_refused_where_they_cannot_see():
    env = SeastarSwimEnv(decision_period=0.5, fidelity="fast")
    assert load_agent("learned", env).decision_period == 0.5
    assert load_agent("learned", SeastarSwimEnv()).decision_period == 1.0
    assert load_agent("greedy", env).scene == env.scene
    greedy = GreedyPolicy.__new__(GreedyPolicy)
    greedy.actions, greedy.decision_period = "joint", 0.5
    with assert_refused("It reads observations of 196 numbers, the task shows 186."):
        require_seen(greedy, SeastarSwimEnv(decision_period=0.5, observe_actuators=False))


# Results


def test_relative_scores_are_one_for_the_best():
    assert relative(entry(), 2.0).tolist() == [1.0, 1.0, 0.5, 0.5]
    assert relative(entry(better="more"), 4.0).tolist() == [0.5, 0.5, 1.0, 1.0]
    assert relative(entry(scores=(0.0, 1.0)), 1.0).tolist() == [MOST, 1.0]
    assert relative(entry(scores=(0.0, 1.0), better="more"), 0.0).tolist() == [1.0, MOST]
    fast, slow = entry(scores=(1.0, 1.0)), entry("b", (3.0, 3.0))
    assert best_means([slow, fast]) == {SWIM: 1.0}
    assert best_means([replace(one, better="more") for one in (slow, fast)]) == {SWIM: 3.0}
    # A failure counts in the mean: an interquartile one would hide the quarter that does not arrive.
    found = entry(scores=(100.0, 100.0, 100.0, 300.0)).estimate()
    assert found.mean == 150.0 and found.low == 100.0 and found.high > 150.0


def test_results_come_back_from_their_file_and_the_later_of_two_counts(tmp_path):
    write([entry(), entry("b")], tmp_path / "results.json")
    found = read(tmp_path / "results.json")
    assert found == [entry(), entry("b")] and found[0].version == __version__
    later = merged(found, [entry(scores=(9.0,)), entry("c")])
    assert [one.agent for one in later] == ["a", "b", "c"] and later[0].scores == [9.0]
    with assert_refused("is measured by luck and by time"):
        merged(found, [entry("d", measure="luck")])


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", "[" * 100_000, "null", '{"format": 1, "entries": 5}', '{"format": 1, "entries": [5]}',
        '{"format": 2, "entries": []}', '{"format": 1, "entries": [{"task": "x"}]}',
    ],
)  # fmt: skip
def test_other_files_are_refused(tmp_path, text):
    (tmp_path / "results.json").write_text(text)
    with assert_refused("is no result of a benchmark"):
        read(tmp_path / "results.json")


def made(**facts):
    """An entry, refused in a sentence."""
    try:
        return Entry(**facts)
    except ValueError as wrong:
        raise ValueError(f"{wrong}.") from None


NOT_WHOLE = [
    {"success": [True]}, {"seeds": []}, {"seeds": [0, 0]}, {"seeds": [1001, 1000]}, {"success": [1, 0]},
    {"decisions": [0, 1]}, {"decisions": [1.0] * 2}, {"scores": [-1.0] * 2},
    *({name: [value] * 2} for name in ("scores", "returns") for value in (math.nan, 1e308, 10**400, None, "1", True)),
]  # fmt: skip
"""Facts of two episodes that no file may have."""


def test_odd_entries_are_refused(golden):
    """As a whole, and for every episode."""
    facts = vars(entry(scores=(2.0, 4.0)))
    lines = taken(made, facts)
    golden("entry.txt", "\n".join(lines))
    for wrong in ({"agent": "x" * 101}, {"agent": "\x1b[2J"}, {"unit": "\u202e"}, *NOT_WHOLE):
        with assert_refused("on one line" if wrong.keys() & {"agent", "unit"} else "of a on"):
            made(**facts | wrong)


def test_results_of_another_version_or_measure_and_what_is_no_file_are_not_merged(tmp_path, capsys):
    file, arguments = tmp_path / "results.json", ["--agents", "--out", str(tmp_path / "out"), "--merge"]
    for make in (os.mkfifo, os.mkdir):
        make(tmp_path / make.__name__)
        assert main([*arguments, str(tmp_path / make.__name__)]) == 2
        assert_told(capsys, "There is no file")
    for wrong, sentence in (
        ({"version": "0.0.9"}, f"has results of version 0.0.9 of seastar_gym, not of this one, {__version__}"),
        ({"better": "more"}, "SeastarSwim-v0 is measured by time until done [s], of which less is better"),
        ({"unit": "h"}, "SeastarSwim-v0 is measured by time until done [s]"),
        ({"task": "CartPole-v1"}, "CartPole-v1"),
    ):
        write([entry(**{"measure": SECONDS.name} | wrong)], file)
        assert main([*arguments, str(file)]) == 2
        assert_told(capsys, sentence)
        assert not (tmp_path / "out").exists()


def test_names_are_text_not_markup_in_the_page(tmp_path, golden):
    wicked = "<script>a|b`c`[d](e)*$\\frac{$&lt;"
    entries = [entry(wicked, measure="m|<b>", unit="|"), entry("b"), entry("c``d")]
    golden("page.md", page.page(entries, f"seastar `{wicked}` ``", "profiles.png"))
    page.draw(page.common(entries)[1], tmp_path / "profiles.png")


def test_only_tasks_that_all_agents_swam_are_added_up():
    entries = [entry(), entry("b", (4.0, 4.0)), entry(task="other"), entry(task="third"), entry("b", task="third")]
    tasks, scores = page.common(entries)
    assert tasks == [SWIM, "third"] and scores["a"].shape == scores["b"].shape == (2, 2)
    assert page.common([entry(), entry("b", task="other")]) == ([], {})


# The command


def test_the_command_measures_merges_and_writes_a_page(tasks, tmp_path, capsys):
    out = tmp_path / "one"
    first = ["--agents", "straight", "greedy", "--tasks", SHORT, "--seeds", "4", "--out", str(out)]
    assert main([*first, "--decisions", "12"]) == 0
    assert {file.name for file in out.iterdir()} == {"results.json", "benchmark.md", "profiles.png"}
    printed = capsys.readouterr().out
    assert "| SeastarShort-v0 | time until done [s], less is better |" in printed
    written = (out / "benchmark.md").read_text()
    assert "over 4 episodes" in written and "profiles.png" in written and f"--tasks {SHORT}" in written
    facts = json.loads((out / "results.json").read_text())["entries"]
    assert [one["agent"] for one in facts] == ["straight", "greedy"] and facts[0]["seeds"] == [1000, 1001, 1002, 1003]

    both = tmp_path / "both"
    arguments = ["--tasks", SHORT, "--seeds", "2", "--decisions", "3", "--out", str(both)]
    assert main(["--agents", "two=straight,rest", *arguments, "--merge", str(out / "results.json")]) == 0
    assert [one.agent for one in read(both / "results.json")] == ["straight", "greedy", "two"]
    assert "2 to 4 episodes" in (both / "benchmark.md").read_text()


FEW = (
    "--agents", "straight", "two=random,rest", "--tasks", SWIM, "--fidelity", "fast", "--seeds", "5",
    "--decisions", "3", "--seeds-per-job", "2",
)  # fmt: skip


@pytest.mark.parametrize("executor", ["processes", "ray"])
def test_results_are_the_same_bits_on_every_executor(executor, tmp_path, monkeypatch, capsys):
    """Jobs of two seeds each, on two workers."""
    if executor == "ray":
        pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    words = "--executor", executor, "--workers", "2"
    for name, more in (("here", ()), (executor, words)):
        assert main([*FEW, *more, "--out", str(tmp_path / name)]) == 0, capsys.readouterr().err
    here, there = (read(tmp_path / name / "results.json") for name in ("here", executor))
    assert here == there and [one.agent for one in here] == ["straight", "two"]
    assert [len(one.seeds) for one in here] == [5, 5]


def test_lost_jobs_are_run_again_and_agents_that_are_always_lost_are_left_out(tasks, tmp_path, monkeypatch, capsys):
    words = ["--tasks", SHORT, "--seeds", "4", "--decisions", "2", "--seeds-per-job", "1", "--out", str(tmp_path)]
    for is_lost, agents, swum, code in (
        (first(5), ["rest"], ["rest"], 0), (first(12), ["rest"], ["rest"], 2),
        (lambda task: task.agent == "random", ["random", "rest"], ["rest"], 1),
    ):  # fmt: skip
        monkeypatch.setattr("seastar_gym.benchmark.command.executor_of", lambda options, lost=is_lost: Losing(lost))
        assert main(["--agents", *agents, *words]) == code
        assert [(one.agent, one.seeds) for one in read(tmp_path / "results.json")] == [
            (agent, [1000, 1001, 1002, 1003]) for agent in swum]  # fmt: skip
        assert (f"{agents[0]} does not swim SeastarShort-v0: {LOST}" in capsys.readouterr().err) == (code > 0)


def test_an_interrupt_keeps_what_is_finished_for_another_run_to_merge(tasks, tmp_path, monkeypatch, capsys):
    """Of two agents with two jobs each, the first is finished after three jobs. Results of an earlier run stay."""
    words = ["--tasks", SHORT, "--seeds", "2", "--decisions", "2", "--seeds-per-job", "1", "--out", str(tmp_path)]
    assert main(["--agents", "straight", *words]) == 0
    before = (tmp_path / "results.json").read_bytes()
    capsys.readouterr()
    with monkeypatch.context() as pressed:
        pressed.setattr("seastar_gym.benchmark.command.executor_of", lambda options: Interrupted(3))
        assert main(["--agents", "rest", "random", *words]) == INTERRUPTED
        kept, told = tmp_path / "interrupted.json", capsys.readouterr().err
        pressed.setattr("seastar_gym.benchmark.command.executor_of", lambda options: Interrupted(1))
        (tmp_path / "nothing").mkdir()
        assert main(["--agents", "rest", *words[:-1], str(tmp_path / "nothing")]) == INTERRUPTED
        assert capsys.readouterr().err == "Interrupted: no agent had finished a task.\n"
        assert not list((tmp_path / "nothing").iterdir())
    assert told == f"Interrupted: what is finished is in {kept}, which --merge takes.\n"
    assert [(one.agent, one.seeds) for one in read(kept)] == [("rest", [1000, 1001])]
    assert (tmp_path / "results.json").read_bytes() == before
    assert main(["--agents", "random", *words, "--merge", str(kept)]) == 0
    assert [one.agent for one in read(tmp_path / "results.json")] == ["rest", "random"]


@pytest.mark.parametrize(
    "agent, words", [("a_bug:make", ""), ("lagged", "SeastarShort-v0: A lagged gait needs two decisions")]
)
def test_an_agent_with_a_bug_or_that_does_not_fit_does_not_cost_the_others_their_results(
    agent, words, tasks, tmp_path, monkeypatch, capsys
):
    (tmp_path / "a_bug.py").write_text("def make(env):\n    return 1 + 'one'\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    options = ["--tasks", SHORT, "--agents", agent, "rest", "--seeds", "2", "--out", str(tmp_path / "out")]
    assert main([*options, "--fidelity", "fast", "--decisions", "2"]) == 2
    assert f"{agent} does not swim {words}" in capsys.readouterr().err
    assert [entry.agent for entry in read(tmp_path / "out" / "results.json")] == ["rest"]


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["--tasks", "CartPole-v1"], "There is no task 'CartPole-v1': choose of SeastarSwim-v0, "),
        (["--agents", "rest", "rest"], "Two agents are called rest: name them with LABEL=AGENT."),
        (["--seeds-per-job", "0"], "--seeds-per-job must be"),
        (["--agents"], "There is nothing to show"),
        (["--merge", "nowhere.json", "--agents"], "nowhere.json"),
    ],
)
def test_what_cannot_be_measured_is_said_in_a_sentence(arguments, words, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert_told(capsys, words)
    assert not list(tmp_path.iterdir())
