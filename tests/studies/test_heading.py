"""Turn, then swim; and the study of what turning is worth."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("matplotlib")

from agents.hyperparameters import Hyperparameters
from agents.ppo import make_model
from seastar_gym import Headings, VectorSymmetryReduction
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.planner import Budget, Planner
from seastar_gym.controllers.turning import TurnThenSwim
from seastar_gym.envs import symmetry
from seastar_gym.envs.layout import HEADINGS
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.evaluation.swim import swim
from seastar_gym.gaits import turning_wave
from studies.command import main
from studies.learning import heading
from symmetries import assert_equivariant

DOCS = Path(__file__).resolve().parents[2] / "docs"


class Resting:
    """Swimmer that rests; it sees observations without headings."""

    actions = "pairs"

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        assert observation.shape == (196,)
        return 0, None


@pytest.mark.parametrize("asked", [0.5, -0.5])
def test_it_turns_to_the_side_that_is_asked_for_and_then_swims(asked):
    scene, headings = make_scene(None, "fast", 0.2), Headings(asked)
    agent = TurnThenSwim(turning_wave(0.2), Resting(), "pairs", scene, headings, 0.2)
    env = SeastarSwimEnv([[0.3, 0.0]], "joint", "fast", decision_period=0.2, headings=headings)
    done = swim("turn", agent, env, max_strokes=40)
    heated = done.limbs_heated > 0
    last = int(np.flatnonzero(heated)[-1])
    assert heated[:last].all() and 10 < last < 30 and not heated[last + 1 :].any()
    assert env._task.facts()["heading"][0] == pytest.approx(asked, abs=headings.tolerance)


def test_the_planner_turns_to_either_side_and_keeps_a_heading_that_is_met():
    ends = []
    for asked in (0.6, -0.6, 0.0):
        headings = Headings(asked)
        env = SeastarSwimEnv([[0.005, 0.0]], "pairs", "fast", decision_period=0.5, headings=headings)
        planner = Planner(decision_period=0.5, headings=headings, budget=Budget(2, 4, 0.5), threads=1)
        done = swim("planner", planner, env, max_strokes=30)
        assert done.finished
        ends.append(done.time[-1])
    assert ends[0] > 2.0 and ends[1] > 2.0 and ends[2] == 0.5


def test_strokes_and_wires_arrive_and_wires_turn_faster(tmp_path):
    options = ["--decisions", "0", "--turns", "0", "72", "--swimmers", "strokes", "wires"]
    assert main(["learning.heading", *options, "--out", str(tmp_path)]) == 0
    results = json.loads((tmp_path / "heading.json").read_text())
    strokes, wires = (results["swims"][name] for name in ("strokes", "wires"))
    for each in (strokes, wires):
        assert each["seconds"][1] > each["seconds"][0] > 10.0 and each["joules"][1] > each["joules"][0]
    assert wires["seconds"][1] - wires["seconds"][0] < 0.6 * (strokes["seconds"][1] - strokes["seconds"][0])
    assert (tmp_path / "heading.png").stat().st_size > 10_000


def test_a_learner_behind_the_reduction_does_the_carried_thing():
    env = SeastarSwimVectorEnv(
        2, actions="pairs", fidelity="fast", decision_period=0.5, headings=Headings(1.0), autoreset_mode="SameStep"
    )
    hyperparameters = Hyperparameters(num_envs=2, rollout=8, batch_size=16, hidden=(8,))
    model = make_model(BatchVecEnv(VectorSymmetryReduction(env)), hyperparameters, 0)
    agent = heading.reduced(model, env.scene)
    seen = np.random.default_rng(0).normal(size=(10, 200)).astype(np.float32)
    assert_equivariant(agent, seen, symmetry.memory_mirror(env.scene.actuator), HEADINGS)


def test_a_swim_that_does_not_arrive_has_no_time(monkeypatch):
    monkeypatch.setattr(heading, "LIMIT", 3.0)
    swimmer = heading.Swimmer("rest", 0.5, lambda scene, headings: Resting200())
    found = heading.measured(swimmer, heading.Options(turns=(36.0,), fidelity="fast"))
    assert found["seconds"] == found["joules"] == [None]
    assert "| - |" in heading.table({"turns_deg": [36.0], "swims": {"rest": found}})


class Resting200:
    """Agent that rests."""

    actions = "pairs"

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return 0, None


def test_the_page_compares_the_same_rule_with_strokes_and_wires():
    """In seconds and joules, beyond the way without a turn; other controllers are named."""
    swims = json.loads((DOCS / "heading.json").read_text(encoding="utf-8"))["swims"]
    said = " ".join((DOCS / "gaits.md").read_text(encoding="utf-8").split())
    for name, sentence in {
        "strokes": "takes {} s and {} J more than to swim straight with the chapter's strokes",
        "wires": "and {} s and {} J more with wires every 0.2 s",
        "planner": "the planner takes {} s and {} J more",
        "learned": "the learned policy {} s and {} J",
    }.items():
        more = [swims[name][what][-1] - swims[name][what][0] for what in ("seconds", "joules")]
        assert sentence.format(*(f"{round(each):g}" for each in more)) in said
