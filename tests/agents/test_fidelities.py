"""The study of fidelities goes all the way, continues where it stopped, and says what to train on."""

import json

import numpy as np
import pytest

from agents.hyperparameters import Hyperparameters
from studies.learning.fidelities import scenes, study, tables, trainings
from studies.learning.fidelities.pictures import draw
from studies.learning.fidelities.scenes import CHEAP, DEAR, FIDELITIES, PHYSICS, SWUM
from studies.learning.fidelities.study import CONTESTANTS, Options, main, stages

TINY = Hyperparameters(num_envs=8, rollout=8, batch_size=32, epochs=1, hidden=(8,), max_episode_time=10.0)
RATES = {CHEAP: 1e-3, DEAR: 4e-3}


def test_fidelities_are_all_numerics_with_all_nodes_and_the_chapters_has_its_discretisation():
    assert len(FIDELITIES) == len(scenes.NUMERICS) * len(scenes.NODES)
    assert {CHEAP, DEAR} <= set(FIDELITIES)
    for name, scene in FIDELITIES.items():
        assert scene.is_chapters and scene.numerics.named
        assert name.endswith(str(scene.robot.nodes_per_limb))
        assert scene.robot.discretisation == ("chapter" if name.startswith("chapter") else "continuum")
    assert not any(scene.is_chapters for scene in PHYSICS.values())


def test_contestants_have_equal_processor_time():
    for contestant in CONTESTANTS:
        spent = sum(RATES[name] * strokes for name, strokes in stages(contestant, 40.0, RATES))
        assert spent == pytest.approx(40.0, rel=0.15)
    assert [name for name, _ in stages("cheap, then dear", 40.0, RATES)] == [CHEAP, DEAR]


def results(**strokes: float) -> dict:
    """Results of two seeds of trainings at fidelities, whose policies take so many strokes everywhere."""
    rng = np.random.default_rng(0)

    def run(mean: float) -> dict:
        scores = mean + rng.uniform(0.0, 1.0, 4)
        return {"strokes": 100, "seconds": mean, "random": dict.fromkeys(SWUM, scores.tolist()), "pentagon": 150}

    runs = {name.replace("_", " "): {"0": run(mean), "1": run(mean)} for name, mean in strokes.items()}
    return {"settings": {"paths": 4}, "runs": runs, "finishing": {}}


def test_the_advice_is_the_cheapest_training_that_is_near_the_dearest():
    found = results(coarse_8=160.0, balanced_10=170.0, reference_19=171.0)
    assert tables.advice(found).startswith("Train at coarse 8")
    found = results(coarse_8=180.0, balanced_10=170.0, reference_19=171.0)
    assert tables.advice(found).startswith("Train at balanced 10")
    assert "yet" in tables.advice(results(coarse_8=180.0))


def test_a_matrix_of_any_size_is_drawn_and_told(tmp_path):
    for found in (results(coarse_8=160.0), results(**{name.replace(" ", "_"): 170.0 for name in FIDELITIES})):
        draw(found, tmp_path / "matrix.png")
        assert (tmp_path / "matrix.png").stat().st_size > 10_000
        assert f"on {DEAR}" in tables.as_markdown(found)


@pytest.fixture
def small(monkeypatch):
    """Trainings and swims of a few strokes."""
    monkeypatch.setattr(study, "LEARNER", TINY)
    monkeypatch.setattr(trainings, "MAX_STROKES", 2)


@pytest.mark.slow
def test_trainings_are_measured_and_not_repeated(small, tmp_path, capsys):
    out = tmp_path / "fidelities.json"
    command = ["--fidelities", CHEAP, DEAR, "--strokes", "128", "--paths", "2", "--budgets", "0.2", "--out", str(out)]
    assert main([*command, "--seeds", "0"]) == 0
    first = json.loads(out.read_text())
    for name in (CHEAP, DEAR):
        run = first["runs"][name]["0"]
        assert run["strokes"] == 128 and run["seconds"] > 0.0
        assert run["random"] == {name: [2, 2] for name in SWUM}  # no robot arrives that soon
    assert set(first["finishing"]["0.2"]) == set(CONTESTANTS)
    capsys.readouterr()
    assert main([*command, "--seeds", "0"]) == 0
    assert "seed 0" not in capsys.readouterr().out
    assert main([*command[:-2], "--strokes", "256", "--out", str(out)]) == 2
    assert "give another --out" in capsys.readouterr().err


def test_a_training_is_finished_in_another_scene(small):
    found = trainings.train([(FIDELITIES[CHEAP], 64), (FIDELITIES["balanced 10"], 128)], 0, TINY)
    assert found.strokes == 192
    assert found.policy.scene == FIDELITIES["balanced 10"]
    assert trainings.rounded(100.0, TINY) == 128 and trainings.rounded(0.0, TINY) == 64


def test_an_unknown_fidelity_is_refused():
    with pytest.raises(ValueError, match="Unknown fidelity 'perfect 10'"):
        Options(fidelities=("perfect 10",))
    with pytest.raises(ValueError, match="paths"):
        Options(paths=0)
