"""Fits of measured limbs: the closed form, the stored presets, the errors that pages promise, and honest intervals."""

import json
from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from seastar_gym.scene.actuators.sma_limb import FREQUENCIES, MEASURED
from studies.command import main
from studies.frame import DOCS
from studies.measurements import limbs
from studies.measurements.curves import MODELS, curvature, lagging, pulsed, read_curves
from studies.measurements.fit import fit, predict
from studies.pages import numbers
from studies.scenes import gallery

CURVES = read_curves()


def test_there_are_48_curves_of_six_materials_that_straighten_when_heated():
    assert [len(of_one) for of_one in CURVES.values()] == [8, 9, 11, 8, 5, 7] and list(CURVES) == list(MEASURED)
    assert {m: (of_one[0].frequency, of_one[-1].frequency) for m, of_one in CURVES.items()} == FREQUENCIES
    for curve in chain(*CURVES.values()):
        assert 1 <= np.argmin(curve.curvature) <= 8 and 60.0 < curve.peak < 110.0


def test_the_periodic_temperature_and_its_lag_solve_their_equations():
    period, width, rise, tau, lag = 0.7, 0.05, 10.0, 0.4, 0.015
    steady, t = rise / (1.0 - np.exp(-width / tau)), np.linspace(0.0, period, 101)

    def slope(now, state):
        return [(steady * (now < width) - state[0]) / tau, (state[0] - state[1]) / lag]

    start = [pulsed(t[:1], period, width, rise, tau)[0], lagging(t[:1], period, width, rise, tau, lag)[0]]
    found = solve_ivp(slope, (0.0, period), start, t_eval=t, max_step=5e-4, rtol=1e-8).y
    np.testing.assert_allclose(pulsed(t, period, width, rise, tau), found[0], atol=0.02)
    np.testing.assert_allclose(lagging(t, period, width, rise, tau, lag), found[1], atol=0.02)
    np.testing.assert_allclose(found[:, -1], start, atol=0.02)


@pytest.mark.parametrize(
    "liquid_metal, largest", [(0, 0.027), (10, 0.029), (20, 0.035), (30, 0.032), (40, 0.052), (50, 0.068)]
)
def test_presets_are_as_near_to_the_measurements_as_their_page_says_and_as_a_fit(liquid_metal, largest):
    names = {"heating_time": "width"}
    numbers = {names.get(name, name): x for name, x in MEASURED[liquid_metal]._asdict().items()}
    off = [(c.curvature - curvature(numbers, c.frequency, c.times)) / c.peak for c in CURVES[liquid_metal]]
    error = np.sqrt(np.mean(np.square(off)))
    assert error < largest and error < 1.01 * fit(limbs.CHOSEN, CURVES[liquid_metal], starts=2).error


def test_predictions_of_curves_that_obey_the_model_find_them_and_intervals_hold_about_their_share():
    rng, numbers = np.random.default_rng(0), fit("delay", CURVES[10], starts=1).numbers
    inside = []
    for _ in range(5):
        noisy = [
            replace(c, curvature=curvature(numbers, c.frequency, c.times) + rng.normal(0.0, 2.0, c.times.shape))
            for c in CURVES[10]
        ]
        predicted, width = predict(fit("delay", noisy[::2], starts=1), noisy[1::2])
        inside.append(np.abs(np.array([c.curvature for c in noisy[1::2]]) - predicted) <= width)
    assert 0.85 < np.mean(inside) < 0.97


def test_richer_models_fit_better_than_newtons_cooling_alone():
    errors = {model: fit(model, CURVES[0], starts=1).error for model in MODELS}
    assert min(errors, key=errors.__getitem__) == "delay, stress" and errors["delay"] < 0.75 * errors["newton"]


@pytest.mark.slow
def test_the_study_writes_its_figures_and_picture(tmp_path):
    assert main(["measurements.limbs", "--out", str(tmp_path)]) == 0
    found = json.loads((tmp_path / "limbs.json").read_text())
    errors = np.concatenate([one["errors"] for one in found["fits"].values()])
    assert errors.size == 48 and np.sum(errors < limbs.AIM) == 36
    assert (tmp_path / "limbs.png").stat().st_size > 50_000


def test_the_page_has_the_strokes_of_the_policies_that_were_counted():
    page = (DOCS / "validation.md").read_text(encoding="utf-8")
    for limb, strokes in numbers(DOCS, limbs.STUDY)["strokes_round_the_pentagon"].items():
        name = "the chapter's pulse" if limb == "pulse" else limb
        cells = ["-" if n is None else str(n) for n in (strokes["learned"], strokes["pentagon"])]
        assert f"| {' | '.join([name, *cells])} |" in page


# The gallery shows every scene with its cost.


@pytest.mark.slow
def test_the_gallery_has_a_picture_and_a_cost_of_every_scene(tmp_path):
    gallery.draw_all(tmp_path, strokes=1)
    text = gallery.table(gallery.measured(rounds=1, n_robots=8))
    for exhibit in gallery.EXHIBITS:
        assert f"**{exhibit.name}**" in text
        picture = tmp_path / f"{exhibit.name.replace(' ', '_')}.png"
        assert picture.stat().st_size > 1000


def test_costs_are_relative_to_the_first_scene():
    shown = gallery.EXHIBITS[:1] * 2
    costs, per_step = gallery.measure_costs(shown, rounds=1, n_robots=1)
    assert costs[0] == 1.0 and costs[1] > 0.0
    np.testing.assert_array_equal(per_step[0], per_step[1])


def test_an_outline_is_as_wide_as_the_limb():
    centre = np.stack([np.linspace(0.0, 0.1, 5), np.zeros(5)], axis=1)
    radius = np.linspace(2e-3, 1e-3, 5)
    contour = gallery.outline(centre, radius)
    np.testing.assert_allclose(contour[:5, 1], radius)
    np.testing.assert_allclose(contour[:4:-1, 1], -radius)
