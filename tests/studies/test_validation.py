"""Validation against a measured swimmer: data, scenes, weights, and intervals that are honest where truth is known."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import norm

from seastar_gym.scene import MeasuredCurve
from studies.command import main
from studies.frame import DOCS
from studies.pages import numbers
from studies.validation import follow, laws, study, swimmer, turns
from studies.validation.in_turn import LATE, InTurn
from studies.validation.inference import (
    LEVEL,
    SPREAD,
    best_known,
    effective,
    other_fours,
    predict,
    quantiles,
    score,
    told,
    weights,
)
from studies.validation.priors import SWEEPS, UNKNOWNS, place_in_range, samples
from studies.validation.speeds import read_speeds, training
from studies.validation.swimmer import VARIANTS, bending, cross_section, fitted_curve, measured_curve, scene

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


@pytest.mark.parametrize("variant", VARIANTS)
def test_swimmers_curl_at_rest_and_straighten_when_heated(variant):
    values = samples(8)
    made = scene(CONDITIONS[CHOSEN[1]], values, SWEEPS[1], VARIANTS[variant])
    assert made.n_robots == 8 and made.robot.n_limbs == 4
    shapes = made.robot.limb_shapes(0)
    assert [np.sign(shape.natural_curvature) for shape in shapes] == [1.0, 1.0, -1.0, -1.0]
    heated = -made.of_robot(0).actuator.peak_angle / values["limb length"][0]
    assert 29.0 < shapes[0].natural_curvature + heated < 54.0  # the smallest measured curvatures
    assert made.actuator.period == pytest.approx(1.25)


def test_discs_have_the_weight_stiffness_drag_and_fluid_of_the_strip():
    values, share = samples(8), np.array([0.5])
    strips, discs = (scene(CONDITIONS[CHOSEN[1]], values, SWEEPS[1], VARIANTS[name]) for name in ("strips", "full"))
    for k in range(8):
        strip, disc = (made.robot.limb_shapes(k)[0].cuts(1000.0, share)[0] for made in (strips, discs))
        assert (disc.area, disc.EI) == pytest.approx((strip.area, strip.EI))
        across, round_across = (made.of_robot(k).fluid.drag_coefficient for made in (strips, discs))
        assert round_across * disc.width == pytest.approx(across * strip.width)
        thin, plate = cross_section(values, strips=True).added[k], 0.25 * np.pi * strip.width**2
        assert discs.of_robot(k).fluid.added_mass_coefficient * disc.added == pytest.approx(thin * plate)


@pytest.mark.parametrize("material, frequency", [(0, 0.4), (10, 1.2), (50, 2.3)])
def test_the_polygon_of_a_curve_is_as_near_to_it_as_it_says(material, frequency):
    condition = next(one for one in CONDITIONS if one[:2] == (material, frequency))
    for how, curve in (("fitted", fitted_curve), ("measured", measured_curve)):
        (times, k), (t, exact) = bending(condition, how), curve(condition)
        assert 8 < len(times) < 61 and np.abs(np.interp(t, times, k) - exact).max() <= swimmer.LOOSE + 1e-9
        assert k[0] == k[-1]
    ramp, pulse = bending(condition, "ramp")[1], bending(condition, "80 ms")[1]
    assert len(ramp) == 3 and ramp.min() == exact.min() == pytest.approx(pulse.min(), abs=swimmer.LOOSE)


def test_fits_straighten_three_to_twelve_times_as_fast_as_the_limbs_that_were_measured():
    """Above 0.9 Hz, where samples are close enough."""
    ratio = {
        condition: steepest(*fitted_curve(condition)) / steepest(*measured_curve(condition))
        for condition in CONDITIONS
        if condition.frequency >= 0.9
    }
    few, much = ([ratio[one] for one in ratio if (one.liquid_metal >= 40) == metal] for metal in (False, True))
    assert (min(few), max(few), min(much), max(much)) == pytest.approx((3.0, 5.5, 6.1, 11.9), abs=0.05)


def steepest(t, k):
    """Largest rate at which a limb straightens [1/(m s)]."""
    return -(np.diff(k) / np.diff(t)).min()


# Pairs in turn


def test_late_limbs_follow_the_curve_half_a_period_later_and_wait_for_their_first_turn():
    actuator = InTurn(MeasuredCurve((0.0, 0.2, 1.0), (0.0, 1.0, 0.0)), 0.5)
    assert actuator.corners == (0.0, 0.2, 0.5, 0.7, 1.0)
    t, commands = np.array(actuator.corners), np.array([1.0, -LATE])
    first, state = actuator.respond(t, commands, np.zeros((2, 1)))
    np.testing.assert_allclose(first, [[0.0, 0.0], [1.0, 0.0], [0.625, 0.0], [0.375, -1.0], [0.0, -0.625]], atol=1e-12)
    second, _ = actuator.respond(t, commands, state)
    np.testing.assert_allclose(second[:, 1], [-0.625, -0.375, 0.0, -1.0, -0.625], atol=1e-12)


# Limbs that follow their curves


def test_without_drag_a_swimmer_whose_limbs_follow_ends_every_stroke_where_it_began():
    values = samples(8)
    still = {name: np.zeros(8) if "drag" in name else column for name, column in values.items()}
    swims, stays = (follow.speeds(CONDITIONS[:1], each, follow.Law()) for each in (values, still))
    assert np.median(np.abs(swims)) > 3e-3 and np.abs(stays).max() < 1e-5


def test_swimmers_whose_limbs_follow_need_no_more_steps(monkeypatch):
    few = follow.speeds(CONDITIONS[7:8], samples(8), follow.Law("fitted", lag=0.5))
    monkeypatch.setattr(follow, "STEPS", 2 * follow.STEPS)
    many = follow.speeds(CONDITIONS[7:8], samples(8), follow.Law("fitted", lag=0.5))
    np.testing.assert_allclose(few, many, atol=0.03 * np.abs(many).max())


def test_an_interrupted_study_goes_on_where_it_was(tmp_path, monkeypatch):
    swum = []

    def count(condition, values, variant, finer):
        swum.append(condition.name)
        if len(swum) == 3:
            raise KeyboardInterrupt
        return np.full(len(values["limb length"]), condition.speed)

    monkeypatch.setattr(swimmer, "speeds", count)
    with pytest.raises(KeyboardInterrupt):
        study.simulate(CONDITIONS[:5], "full", 8, tmp_path)
    found = study.simulate(CONDITIONS[:5], "full", 8, tmp_path)
    assert len(swum) == 6 and swum[2] == swum[3]
    assert found[0].tolist() == [condition.speed for condition in CONDITIONS[:5]]


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["full", "all three"])
def test_the_swimmer_swims_forward(variant):
    found = swimmer.speeds(CONDITIONS[CHOSEN[1]], samples(8), VARIANTS[variant])
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
    kept = numbers(DOCS, study.STUDY)
    found = laws.law_scores(CONDITIONS, CHOSEN, other_fours(CONDITIONS, study.FOURS))
    assert len(found) == len(kept["laws"]) == 13
    for one, other in zip(found, kept["laws"], strict=True):
        assert one["error"] == pytest.approx(other["error"], rel=1e-6)
        assert one["fours"] == pytest.approx(other["fours"], rel=1e-6)
    root_f_dk = next(one for one in found if one["powers"] == [0.5, 1.0])
    assert (root_f_dk["error"], root_f_dk["fours"][1]) == pytest.approx((0.149, 0.163), abs=5e-4)


def test_measured_speeds_go_with_other_powers_of_the_change_that_was_measured_than_of_that_of_the_fits():
    (f, dk), (error_f, error_dk) = laws.powers(CONDITIONS, MEASURED)
    assert (f, dk, error_f, error_dk) == pytest.approx((0.66, 1.68, 0.07, 0.37), abs=5e-3)
    assert laws.powers(CONDITIONS, MEASURED, fitted_curve)[0] == pytest.approx([0.81, 2.65], abs=5e-3)
    root_f_dk = np.exp(laws.logarithms(CONDITIONS, fitted_curve) @ [0.0, 0.5, 1.0])
    assert laws.law_error(root_f_dk, MEASURED, CHOSEN) == pytest.approx(0.162, abs=5e-4)
    others = [laws.law_error(root_f_dk, MEASURED, four) for four in other_fours(CONDITIONS, study.FOURS)]
    assert np.median(others) == pytest.approx(0.173, abs=5e-4)
    exact = np.exp(laws.logarithms(CONDITIONS, measured_curve) @ [0.3, 0.5, 2.0])
    np.testing.assert_allclose(laws.powers(CONDITIONS, exact), [[0.5, 2.0], [0.0, 0.0]], atol=1e-9)


def test_the_tracked_swimmer_turns_away_from_limbs_that_heat_in_the_first_stroke_of_a_letter():
    letters = turns.read_letters()
    turning = np.array([turns.turns_left(name) != 0.0 for name in letters.names])
    assert turning.sum() == 11 and np.all(letters.turns[turning] > 0.28)
    assert letters.first[turning].sum() / letters.turns[turning].sum() > 0.8
    assert np.all(np.abs(letters.turns[~turning]) < 0.2) and np.all(letters.ways > 0.03)


@pytest.mark.slow
def test_letters_of_the_left_and_of_the_right_turn_samples_alike():
    left, right = (turns.swum(letter, "all four", 10, samples(4)) for letter in "FE")
    np.testing.assert_allclose(left, right, rtol=1e-3, atol=1e-6)
    assert np.all(np.abs(turns.swum("B", "all four", 10, samples(4))[0]) < 1e-6)


def test_the_committed_turns_are_those_that_were_tracked():
    results = numbers(DOCS, study.STUDY)["turns"]
    letters = turns.read_letters()
    for found in results.values():
        assert found["letters"] == "".join(letters.names)
        assert found["way_mm"]["measured"] == pytest.approx(1e3 * letters.ways, rel=1e-3)
        held = [low <= each <= high for low, each, high in
                zip(*(found["turn_rad"][name] for name in ("low", "measured", "high")), strict=True)]  # fmt: skip
        assert found["turn_rad"]["score"]["covered"] == pytest.approx(np.mean(held))


def test_what_is_missing_is_added_to_results_that_are_there(tmp_path):
    kept = numbers(DOCS, study.STUDY)
    (tmp_path / "validation.json").write_text(json.dumps(kept | {"laws": []}), encoding="utf-8")
    assert main(["validation", "--more", "--out", str(tmp_path)]) == 0
    results = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    assert results["samples"] == 512 and len(results["laws"]) == 13


def test_the_command_writes_its_page(tmp_path, monkeypatch):
    def invented(condition, values, variant, finer=1):
        return made_up(values)[:, CONDITIONS.index(condition)]

    monkeypatch.setattr(swimmer, "speeds", invented)
    monkeypatch.setattr(follow, "speeds", lambda conditions, values, law: made_up(values))
    monkeypatch.setattr(turns, "swum", lambda letter, second, material, values: np.full((3, 64), 0.1))
    few = partial(study.run, n_samples=64, variants=("ramp",), runs=tmp_path)
    monkeypatch.setattr(study, "STUDY", replace(study.STUDY, run=few))
    assert main(["validation", "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "validation.json").read_text(encoding="utf-8"))
    assert found["discretisation"] == 0.0 and len(found["laws"]) == 13
    assert set(found["followers"]) == set(follow.LAWS)
    assert set(found["turns"]) == set(turns.SECOND)
    assert set(found["models"]) == {"full", study.SAME_SAMPLES, "ramp"} and len(found["speeds_mm_per_s"]) == 37
    assert (tmp_path / "validation.png").stat().st_size > 10_000
