"""The worked example goes all the way in short form, continues where it stopped, and says what was found."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from agents.hyperparameters import Hyperparameters
from refusals import assert_refused
from seastar_gym import Certificate, DomainRandomization, Numerics, Scene, Uniform
from seastar_gym.accuracy import endurance, measure
from seastar_gym.identify import Measurement
from seastar_gym.identify.parameters import get_parameter
from studies.command import main
from studies.worked_example import robots, study, tables, trainings
from studies.worked_example.pictures import draw
from studies.worked_example.robots import DEVIATIONS, FITTED, NOMINAL, built, tracked
from studies.worked_example.study import Options, beliefs

KEPT = Path(__file__).resolve().parents[2] / Options().out
TINY = Hyperparameters(num_envs=8, rollout=8, batch_size=32, epochs=1, hidden=(8,), max_episode_time=10.0)


def test_the_robot_as_built_differs_in_what_is_fitted_and_in_limbs_that_are_not_alike():
    scene = built()
    for each in DEVIATIONS:
        if each.name != "robot.youngs_modulus":
            assert get_parameter(scene, each.name) == each.built != get_parameter(NOMINAL, each.name)
    stiffness = [limb.youngs_modulus for limb in scene.robot.limbs]
    assert len(set(stiffness)) == 5 and np.mean(stiffness) == pytest.approx(1.4e6, rel=0.1)
    assert NOMINAL.robot.is_symmetric and not scene.robot.is_symmetric
    assert built() == scene  # the same robot every time


def results(n_seeds: int = 3) -> dict:
    """Results in which policies of the fit are 10 s faster than those of the nominal robot, and draws 12 s."""
    value = np.array([each.built for each in DEVIATIONS])
    fit = {"values": value, "lower": 0.95 * value, "upper": 1.05 * value, "root_mean_square_m": 1e-3}
    runs = {
        name: {
            str(seed): {
                "random": [time + seed, time - seed],
                "pentagon": time + seed,
                "expected": [time],
                "processor_seconds": 20.0,
            }
            for seed in range(n_seeds)
        }
        for name, time in (("nominal", 150.0), ("cooling", 141.0), ("fitted", 140.0), ("drawn", 138.0))
    }
    return {
        "machine": "some machine", "settings": {"tracked": 12, "strokes": 1000, "error": 0.1, "paths": 2},
        "fit": fit, "certificate": {"setting": "some setting", "error": 0.03}, "runs": runs,
    }  # fmt: skip


def test_gains_are_over_the_nominal_policy_of_the_same_seed():
    runs = results()["runs"]
    np.testing.assert_allclose(tables.saved(runs, "fitted", "random"), 10.0)
    np.testing.assert_allclose(tables.saved(runs, "drawn", "pentagon"), 12.0)
    del runs["drawn"]["1"]
    assert len(tables.saved(runs, "drawn", "pentagon")) == 2


def test_results_are_told_and_drawn(tmp_path):
    text = tables.as_markdown(results())
    assert "| the fit | 140.0 [140.0, 140.0] | 10.0 [10.0, 10.0] | 141.0 [140.0, 142.0] |" in text
    assert all(f"`{name}`" in text for name in FITTED) and "All numbers as built lie within" in text
    assert "Those of the fit are 7 % faster, in 3 of 3 seeds." in text
    draw(results(), tmp_path / "results.png")
    assert (tmp_path / "results.png").stat().st_size > 10_000


def test_results_say_what_does_not_look_good():
    found = results()
    found["fit"]["lower"][0] = 1.01 * DEVIATIONS[0].built
    assert f"outside their intervals: `{FITTED[0]}`." in tables.as_markdown(found)
    for seed, time in (("0", 149.0), ("1", 151.0), ("2", 150.5)):
        found["runs"]["drawn"][seed]["random"] = [time]
        found["runs"]["fitted"][seed]["random"] = [time + 10.0]
    assert "draws from its intervals differ by no more than seeds do" in tables.verdict(found, "drawn")
    assert "slower, in 3 of 3 seeds" in tables.verdict(found, "fitted")


def test_a_camera_sees_hub_and_tips_of_the_scene_that_is_fitted(monkeypatch):
    coarse = built(5, Numerics("implicit-midpoint", 0.02, 1e-6))
    monkeypatch.setattr(robots, "NOMINAL", replace(NOMINAL, robot=replace(NOMINAL.robot, nodes_per_limb=7)))
    seen = tracked(coarse, 2)
    assert seen.nodes == (0, 6, 12, 18, 24, 30)
    assert 0.0 < np.isnan(seen.positions).mean() < 0.1
    rest = coarse.robot.nodes()[[0, 4, 8, 12, 16, 20]]
    np.testing.assert_allclose(np.nan_to_num(seen.positions[0] - rest), 0.0, atol=5e-3)


@pytest.fixture
def small(monkeypatch):
    """Robots of few nodes and long steps, certificates of one setting, trainings and swims of a few strokes."""
    coarse = Numerics("implicit-midpoint", 0.01, 1e-6)
    nominal = replace(NOMINAL, robot=replace(NOMINAL.robot, nodes_per_limb=5), numerics=coarse)
    for module in (robots, study):
        monkeypatch.setattr(module, "NOMINAL", nominal)
    monkeypatch.setattr(study, "built", lambda: built(5, coarse))
    monkeypatch.setattr(trainings, "SWUM_WITH", (5, coarse))
    monkeypatch.setattr(trainings, "LEARNER", TINY)
    monkeypatch.setattr(trainings, "MAX_STROKES", 2)
    monkeypatch.setattr(measure, "NODES", (5,))
    monkeypatch.setattr(measure, "MANY_NODES", 7)
    monkeypatch.setattr(measure, "SHORT", Numerics("implicit-midpoint", 2.5e-3, 1e-8))
    monkeypatch.setattr(measure, "NUMERICS", (coarse,))
    monkeypatch.setattr(endurance, "LONG", 20)


@pytest.mark.filterwarnings("ignore:Errors of this scene:UserWarning")
def test_the_way_goes_from_a_camera_to_swims_and_is_not_gone_twice(small, tmp_path, capsys):
    command = ["--tracked", "3", "--samples", "2", "--error", "0.9", "--strokes", "64", "--paths", "2"]
    command = ["worked_example", *command, "--out", str(tmp_path)]
    assert main([*command, "--seeds", "0"]) == 0
    found = json.loads((tmp_path / "results.json").read_text())

    measured = Measurement.from_csv(tmp_path / "tracking.csv", tmp_path / "commands.csv")
    assert measured.commands.shape == (3, 5) and measured.positions.shape == (60, 6, 2)

    fit = found["fit"]
    assert not fit["untold"]
    truth = np.array([each.built for each in DEVIATIONS])
    np.testing.assert_allclose(fit["values"][1:], truth[1:], rtol=0.1)  # three strokes tell little of the body's drag
    assert (np.array(fit["lower"]) < fit["values"]).all() and (np.array(fit["upper"]) > fit["values"]).all()
    scene = Scene.from_dict(fit["scene"])
    assert [get_parameter(scene, name) for name in FITTED] == fit["values"]

    training = Certificate.load(tmp_path / "certificate.json").at(
        Certificate.load(tmp_path / "certificate.json").settings[0]
    )
    options = Options(tracked=3, samples=2, error=0.9, strokes=64, paths=2, out=tmp_path)
    believed = beliefs(options, found)
    assert believed["fitted"].scene == believed["drawn"].scene == training
    assert believed["nominal"].scene.numerics == training.numerics
    assert believed["nominal"].scene.actuator == NOMINAL.actuator
    cooling = believed["cooling"].scene
    assert get_parameter(cooling, study.COOLING) == get_parameter(scene, study.COOLING)
    assert replace(cooling, actuator=NOMINAL.actuator) == believed["nominal"].scene
    name, low, high = FITTED[0], fit["lower"][0], fit["upper"][0]
    assert isinstance(believed["drawn"].draws, DomainRandomization)
    assert believed["drawn"].draws.distributions[name] == Uniform(low, high)

    assert {name: set(runs) for name, runs in found["runs"].items()} == {name: {"0"} for name in tables.WORDS}
    assert found["runs"]["drawn"]["0"]["random"] == [2.0, 2.0]  # no robot arrives that soon
    assert (tmp_path / "results.png").stat().st_size > 10_000
    assert "Machine: " in capsys.readouterr().out

    assert main([*command, "--seeds", "0"]) == 0
    assert ", 0: " not in capsys.readouterr().out
    assert main([*command, "--strokes", "128"]) == 2
    assert "give another --out" in capsys.readouterr().err


def test_options_that_make_no_sense_are_refused():
    with assert_refused("samples"):
        Options(samples=1)
    with assert_refused("error"):
        Options(error=0.0)


def test_the_committed_certificate_is_that_of_the_fitted_scene_and_of_the_trainings():
    found = json.loads((KEPT / "results.json").read_text(encoding="utf-8"))
    certificate = Certificate.load(KEPT / "certificate.json")
    certificate.require_valid(Scene.from_dict(found["fit"]["scene"]))
    chosen = certificate.of(certificate.for_error(found["settings"]["error"]))
    assert str(chosen) == found["certificate"]["setting"] and certificate.samples == found["settings"]["samples"]
    assert chosen.error(certificate.promised) == found["certificate"]["error"]
    assert chosen.speed == found["certificate"]["times_real_time"]
