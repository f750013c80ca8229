"""Validation against a measured swimmer: data, scenes, weights, and intervals that are honest where truth is known."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from studies.command import main
from studies.validation import laws, simulate, study
from studies.validation.inference import LEVEL, SPREAD, effective, predict, quantiles, score, weights
from studies.validation.luck import other_fours
from studies.validation.priors import SWEEPS, UNKNOWNS, place_in_range, samples
from studies.validation.separation import best_known, told
from studies.validation.speeds import read_speeds, training
from studies.validation.swimmer import LOOSE, bending, round_limb, scene

DOCS = Path(__file__).resolve().parents[2] / "docs"
CONDITIONS = read_speeds()
MEASURED = np.array([condition.speed for condition in CONDITIONS])
CHOSEN = training(CONDITIONS)


def made_up(values: dict[str, np.ndarray]) -> np.ndarray:
    """Speeds of a model without a simulator: longer limbs are faster, heavier bodies slower at high frequencies."""
    f = np.array([condition.frequency for condition in CONDITIONS])
    length, mass = values["limb length"][:, None], values["body mass"][:, None]
    return 1.5 * length * f / (1.0 + 0.3 * f * (mass / 0.06))


# Data


def test_there_are_37_speeds_of_five_materials_and_the_model_is_fitted_to_four():
    assert len(CONDITIONS) == 37 and len({condition.liquid_metal for condition in CONDITIONS}) == 5
    assert len(CHOSEN) == 4 and all(0.019 < condition.speed < 0.059 for condition in CONDITIONS)
    assert [CONDITIONS[k].name for k in CHOSEN] == ["0-0.7", "10-0.8", "30-1.0", "50-2.0"]
    assert all(len(set(four)) == 4 for four in other_fours(CONDITIONS, 20))


def test_samples_fill_the_ranges_and_fewer_are_the_first_of_more():
    many, few = samples(64), samples(32)
    for unknown in UNKNOWNS:
        assert unknown.low <= many[unknown.name].min() and many[unknown.name].max() <= unknown.high
        np.testing.assert_array_equal(many[unknown.name][:32], few[unknown.name])
    places = place_in_range(many)
    assert places.min() >= 0.0 and places.max() <= 1.0
    np.testing.assert_allclose(places.mean(axis=0), 0.5, atol=0.02)


# Scenes


@pytest.mark.parametrize("variant", ["full", *study.VARIANTS])
def test_swimmers_curl_at_rest_and_straighten_when_heated(variant):
    values = samples(8)
    made = scene(CONDITIONS[CHOSEN[1]], values, SWEEPS[1], variant)
    assert made.n_robots == 8 and made.robot.n_limbs == 4
    shapes = made.robot.limb_shapes(0)
    assert [np.sign(shape.natural_curvature) for shape in shapes] == [1.0, 1.0, -1.0, -1.0]
    heated = -made.of_robot(0).actuator.peak_angle / values["limb length"][0]
    assert 29.0 < shapes[0].natural_curvature + heated < 54.0  # the smallest measured curvatures
    assert made.actuator.period == pytest.approx(1.25)


def test_a_round_limb_has_the_weight_stiffness_drag_and_fluid_of_the_strip():
    values = samples(8)
    limb, width, thickness = round_limb(values), values["limb width"], values["limb thickness"]
    np.testing.assert_allclose(np.pi * limb.radius**2, width * thickness)
    EI = limb.youngs_modulus * np.pi * limb.radius**4 / 4.0
    np.testing.assert_allclose(EI, values["Young's modulus"] * width * thickness**3 / 12.0)
    np.testing.assert_allclose(limb.drag * 2.0 * limb.radius, values["limb drag across"] * width)
    np.testing.assert_allclose(limb.added_mass * limb.radius**2, values["added mass"] * width**2 / 4.0)


@pytest.mark.parametrize("material, frequency", [(0, 0.4), (10, 1.2), (50, 2.3)])
def test_the_polygon_of_a_curve_is_as_near_to_it_as_it_says(material, frequency):
    fine, coarse = (bending(material, frequency), bending(material, frequency, ramp=True))
    assert 8 < len(fine[0]) < 60 and len(coarse[0]) == 3
    assert fine[1].min() == pytest.approx(coarse[1].min(), abs=LOOSE)
    assert fine[1][0] == fine[1][-1] == coarse[1][0]


def test_an_interrupted_study_goes_on_where_it_was(tmp_path, monkeypatch):
    swum = []

    def count(condition, values, variant):
        swum.append(condition.name)
        if len(swum) == 3:
            raise KeyboardInterrupt
        return np.full(len(values["limb length"]), condition.speed)

    monkeypatch.setattr(simulate, "speeds", count)
    with pytest.raises(KeyboardInterrupt):
        list(simulate.all_speeds(CONDITIONS[:5], samples(8), "full", tmp_path))
    found = list(simulate.all_speeds(CONDITIONS[:5], samples(8), "full", tmp_path))
    assert len(swum) == 6 and swum[2] == swum[3]
    assert [one[1][0] for one in found] == [condition.speed for condition in CONDITIONS[:5]]


@pytest.mark.slow
def test_the_swimmer_swims_forward():
    found = simulate.speeds(CONDITIONS[CHOSEN[1]], samples(8), "full")
    assert np.isfinite(found).all() and np.median(found) > 0.005


# Inference


def test_quantiles_of_a_mixture_are_those_of_normal_distributions():
    one, two = np.array([[0.3]]), np.array([[-1.0], [1.0]])
    assert quantiles(one, np.ones(1), 0.95) == pytest.approx(0.3 + SPREAD * norm.ppf(0.95), abs=1e-7)
    assert quantiles(two, np.array([0.5, 0.5]), 0.5) == pytest.approx(0.0, abs=1e-7)


def test_a_sample_that_explains_the_speeds_has_the_weight():
    simulated = np.stack([MEASURED, 2.0 * MEASURED, -MEASURED])
    weight = weights(simulated, MEASURED, CHOSEN)
    assert weight[0] > 0.99 and weight.sum() == pytest.approx(1.0)
    assert effective(weight) == pytest.approx(1.0, abs=0.02)
    found = score(predict(simulated, weight), MEASURED, CHOSEN)
    assert found.error < 0.01 and found.covered == 1.0


def test_intervals_hold_the_share_of_speeds_that_they_say_where_the_truth_is_a_sample():
    values, rng = samples(256), np.random.default_rng(0)
    simulated, covered, errors = made_up(values), [], []
    for truth in range(60):
        measured = simulated[truth] * np.exp(SPREAD * rng.standard_normal(len(CONDITIONS)))
        others = np.delete(np.arange(256), truth)
        found = score(predict(simulated[others], weights(simulated[others], measured, CHOSEN)), measured, CHOSEN)
        covered.append(found.covered)
        errors.append(found.error)
    assert np.mean(covered) == pytest.approx(LEVEL, abs=0.04)
    assert np.mean(errors) < 1.4 * SPREAD


def test_what_speeds_do_not_depend_on_stays_as_unknown_as_it_was():
    values = samples(256)
    simulated = made_up(values)
    weight = weights(simulated, simulated[17], CHOSEN)
    found = {one.name: one for one in told(values, weight)}
    assert found["limb length"].narrower < 0.8 < 0.85 < found["added mass"].narrower
    powers, narrower = best_known(values, weight)
    assert narrower < 0.6 and abs(powers["limb length"]) == 1.0


# Laws of one constant


def test_a_law_that_the_speeds_follow_has_no_error_and_its_constant_is_a_geometric_mean():
    shape = np.array([1.0, 2.0, 3.0, 5.0])
    assert laws.law_error(shape, 0.7 * shape, [0, 2]) == pytest.approx(0.0, abs=1e-12)
    measured = shape * [1.0, 1.0, 4.0, 2.0]  # the mean of log a is that of 2
    assert laws.law_error(shape, measured, [0, 2]) == pytest.approx(np.mean([1.0, 0.0]))


def test_the_committed_laws_are_those_of_the_committed_speeds():
    kept = json.loads((DOCS / "validation.json").read_text(encoding="utf-8"))
    found = laws.law_scores(CONDITIONS, CHOSEN, other_fours(CONDITIONS, study.FOURS))
    assert len(found) == len(kept["laws"]) == 13
    for one, other in zip(found, kept["laws"], strict=True):
        assert one["error"] == pytest.approx(other["error"], rel=1e-6)
        assert one["fours"] == pytest.approx(other["fours"], rel=1e-6)
    root_f_dk = next(one for one in found if one["powers"] == [0.5, 1.0])
    assert (root_f_dk["error"], root_f_dk["fours"][1]) == pytest.approx((0.162, 0.173), abs=5e-4)


def test_laws_are_added_to_results_that_are_there(tmp_path):
    kept = json.loads((DOCS / "validation.json").read_text(encoding="utf-8"))
    (tmp_path / "validation.json").write_text(json.dumps(kept | {"laws": []}), encoding="utf-8")
    assert main(["validation", "--only-laws", "--out", str(tmp_path)]) == 0
    results = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    assert results["samples"] == 512 and len(results["laws"]) == 13


def test_the_command_writes_its_page(tmp_path, monkeypatch):
    def invented(condition, values, variant, finer=1):
        return made_up(values)[:, CONDITIONS.index(condition)]

    for module in (simulate, study):
        monkeypatch.setattr(module, "speeds", invented)
    arguments = ["validation", "--samples", "64", "--variants", "ramp", "--runs", str(tmp_path), "--out", str(tmp_path)]
    assert main(arguments) == 0
    found = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    assert found["discretisation"] == 0.0 and len(found["laws"]) == 13
    assert set(found["models"]) == {"full", study.SAME_SAMPLES, "ramp"} and len(found["speeds_mm_per_s"]) == 37
    assert (tmp_path / "validation.png").stat().st_size > 10_000
