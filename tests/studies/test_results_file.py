"""Numbers that are kept are read back as they were, and what is drawn from them is what was swum."""

import json

import numpy as np
import pytest

from studies.chapter import results as chapter
from studies.chapter.swims import CHAPTER, swim
from studies.learning import traces
from studies.results_file import as_json, keep, rounded

PLAIN = {"name": "a [list] of\nlines", "numbers": [1, 2.5, None], "rows": [[1, "two"], []], "inner": {"x": [0.1]}}


def test_json_comes_back_with_a_line_for_every_list_of_numbers(tmp_path):
    keep(PLAIN, tmp_path / "folder" / "kept.json")
    text = (tmp_path / "folder" / "kept.json").read_text(encoding="utf-8")
    assert json.loads(text) == PLAIN
    assert ' "numbers": [1, 2.5, null],\n' in text and '\n  [1, "two"],\n' in text


def test_numbers_that_are_not_finite_are_refused():
    with pytest.raises(ValueError, match="not JSON compliant"):
        as_json({"speed": float("nan")})


def test_numbers_keep_their_significant_digits():
    assert [rounded(each) for each in (123456.0, -0.00123456, 0.0)] == [123500.0, -0.001235, 0.0]


def test_a_swim_of_the_chapter_comes_back():
    commands = chapter.pair_commands()[:2]
    swum = swim(CHAPTER, commands, 10)
    again = chapter.from_data(json.loads(as_json(chapter.as_data(swum, (0.1, 1.5)))), commands)
    assert again.label == swum.label and again.scene == swum.scene
    np.testing.assert_allclose(again.time, swum.time, atol=1e-9)
    np.testing.assert_allclose(again.positions[:, :, 0], swum.positions[:, :, 0], atol=chapter.UNIT)
    for time in (0.1, 1.5):
        at = swum.at(time)
        np.testing.assert_allclose(again.positions[at, 0], swum.positions[at, 0], atol=chapter.UNIT)
    assert np.isnan(again.positions[3, 0, 1:]).all()


def test_ways_round_the_pentagon_come_back():
    swims = traces.swims(max_strokes=3)
    results = json.loads(as_json(traces.as_data(swims)))
    for before, after in zip(swims, traces.from_data(results), strict=True):
        assert (after.agent, after.strokes, after.result) == (before.agent, 3, before.result)
        np.testing.assert_allclose(after.hub, before.hub, atol=traces.UNIT)
        np.testing.assert_allclose(after.waypoints, before.waypoints, atol=1e-6)
