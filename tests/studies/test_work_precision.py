"""The work-precision study measures whole errors and says which setting is worth its time."""

import json

import numpy as np
import pytest

from seastar_gym import Contact, Numerics, Scene, Seastar
from seastar_gym.accuracy.commands import PROMISED
from seastar_gym.model.rods import make_rods
from seastar_gym.scene.numerics import PRESETS, Resolution
from studies.accuracy import contact
from studies.accuracy import work_precision as study
from studies.accuracy import work_precision_page as page
from studies.command import main


def test_settings_are_all_presets_and_more_and_every_problem_can_swim_them():
    assert set(PRESETS.values()) <= set(study.SETTINGS)
    assert len(set(study.SETTINGS)) == len(study.SETTINGS)
    for physics in study.PROBLEMS.values():
        for setting in (*study.SETTINGS, study.LIMIT, study.HALF):
            study.at(physics, setting)


def test_sequences_are_of_full_amplitude():
    drawn = study.draw_sequences(3)
    assert drawn.shape == (10, study.SAMPLES * len(PROMISED), 3)
    assert (np.abs(drawn).max(axis=(0, 2)) > 0.1).all()


def row(ms: float, error: float, discretisation: str = "continuum", preset: str | None = None) -> dict:
    return {
        "discretisation": discretisation, "nodes_per_limb": 10, "scheme": "sdirk2", "step": 0.02, "preset": preset,
        "ms_per_stroke": ms, "largest_error": error, "median_error": error, "straight_error": error,
    }  # fmt: skip


def test_the_front_has_what_no_other_setting_beats():
    rows = [row(1.0, 0.1), row(2.0, 0.2), row(3.0, 0.05), row(0.5, 0.4)]
    best = page.front(rows, page.error, lambda row: -row["ms_per_stroke"], noticeable=0.0)
    assert [each["ms_per_stroke"] for each in best] == [0.5, 1.0, 3.0]


def test_largest_errors_are_told_of_robots_whose_worst_sequences_have_a_limit():
    rows = [row(1.0, 0.1, preset=name) for name in PRESETS] + [row(2.0, 0.2, "chapter"), row(1.0, 0.05)]
    problems = {"a": {"limit_error": 1e-4, "settings": rows}, "contact": {"limit_error": 0.3, "settings": rows}}
    assert "Not so for contact, where 30 % are in doubt" in page._doubt(problems)
    assert "2 to 2 times faster" in page._conclusion(problems)
    rows[-1] |= {"largest_error": study.finite(np.inf)}
    assert page._rows(problems)[-1][-1].startswith("fails, 5 %")


@pytest.fixture
def small(monkeypatch):
    """One problem beside the chapter's, and settings of a moment."""
    settings = (*PRESETS.values(), Resolution("continuum", 5, Numerics("sdirk2", 2e-2, 1e-6)))
    fast = {name: each._replace(nodes_per_limb=5, numerics=Numerics("sdirk2", 2e-2, 1e-6 * (k + 1)))
            for k, (name, each) in enumerate(PRESETS.items())}  # fmt: skip
    monkeypatch.setattr(study, "PRESETS", fast)
    monkeypatch.setattr(study, "SETTINGS", (*fast.values(), settings[-1]))
    monkeypatch.setattr(study, "LIMIT", Resolution("continuum", 9, Numerics("implicit-midpoint", 5e-3, 1e-6)))
    monkeypatch.setattr(study, "HALF", Resolution("continuum", 5, Numerics("implicit-midpoint", 1e-2, 1e-6)))
    monkeypatch.setattr(study, "SAMPLES", 1)
    monkeypatch.setattr(study, "PROBLEMS", {"chapter's robot": Scene(), "short": Scene(Seastar(limb_length=0.05))})


def test_tables_and_picture_are_made_and_nothing_is_measured_twice(small, tmp_path, monkeypatch, capsys):
    out = tmp_path / "page.json"
    command = ["accuracy.work_precision", "--out", str(out)]
    assert main(command) == 0
    found = json.loads(out.read_text())
    assert set(found["problems"]) == {"chapter's robot", "short"}
    for name in PRESETS:
        assert f"| `{name}` |" in study.STUDY.tables["work_precision presets"](found)
    assert study.STUDY.tables["work_precision"](found).count("\n| 5") == len(study.SETTINGS)
    assert (tmp_path / "page_problems.png").stat().st_size > 20_000
    monkeypatch.setattr(study, "examine", lambda *_, **__: pytest.fail("measured twice"))
    assert main(command) == 0
    found["versions"]["numba"] = "0.1"
    out.write_text(json.dumps(found))
    assert main(command) == 2 and "another machine or version" in capsys.readouterr().err


def test_cones_are_those_of_the_opening_angle_and_only_where_they_are_asked_for():
    scene = Scene(Seastar(nodes_per_limb=37), contact=contact.KINDS[contact.CONES])
    smooth = make_rods(scene).contact.thickness[1:37]
    with contact.shape(contact.CONES):
        cones = make_rods(scene).contact.thickness[1:37]
    np.testing.assert_allclose(cones, np.minimum(1.6e-3, 0.15 * 0.1 / 36 * np.arange(1, 37)))
    assert np.all(smooth <= cones) and smooth[0] < 0.5 * cones[0]
    with contact.shape("Contact()"):
        np.testing.assert_array_equal(make_rods(scene).contact.thickness[1:37], smooth)


def test_contacts_are_told_by_error_softness_and_the_speed_that_stops_a_robot():
    """Softer limbs store less energy before they would pass through each other."""
    assert contact.survives(Contact(), 5.0) and not contact.survives(Contact(layer=10e-3), 10.0)
    assert set(contact.STEPS) == {*contact.NODES, contact.LIMIT}
    numbers = {"19": 0.05, "37": None, "10": 0.1}
    row = {"largest": numbers, "median": numbers, "away": [0.01, 0.2], "cost": 2.5}
    every = dict.fromkeys(contact.KINDS)
    told = contact.STUDY.tables["contact"](
        {what: dict.fromkeys(every, value) for what, value in (("contacts", row), ("bounds", 0.03), ("thrown", 5.0))}
    )
    assert "| `Contact()` | 10 %, 10 % | 5 %, 5 % | fails, fails | 3 % | 20 %, 1 % | 5 | x 2.5 |" in told
    assert "| cones | 10 %" in told
