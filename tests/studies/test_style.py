"""All studies draw in one style."""

from pathlib import Path

import numpy as np

from studies.style import COLOURS, CYCLE, SETTINGS, as_numbers, as_percent, new_figure, subplots

STUDIES = Path(__file__).parents[2] / "studies"


def test_pictures_begin_with_the_style():
    """Nobody else makes figures, so that a change of the style changes all pictures."""
    texts = {file: file.read_text(encoding="utf-8") for file in STUDIES.rglob("*.py") if file.name != "style.py"}
    assert len(texts) > 50
    assert not [file for file, text in texts.items() if "pyplot" in text or "Figure(figsize" in text]


def test_figures_have_the_style():
    figure, axes = subplots(1, 2, figsize=(4.0, 2.0))
    lines = [each.plot([0, 1])[0].get_color() for each in axes]
    assert lines == [CYCLE[0]] * 2
    assert not axes[0].spines["top"].get_visible() and axes[0].xaxis.get_gridlines()[0].get_visible()
    assert axes[0].xaxis.label.get_color() == SETTINGS["axes.labelcolor"]
    np.testing.assert_allclose(figure.get_size_inches(), [4.0, 2.0])
    assert not new_figure(1.0, 1.0).axes


def test_colours_differ():
    assert len(set(CYCLE)) == len(CYCLE) and len(set(COLOURS.values())) == len(COLOURS)


def test_ticks_are_labelled_as_people_write_them():
    _, axes = subplots(figsize=(2.0, 2.0))
    as_percent(axes.xaxis)
    as_numbers(axes.yaxis)
    assert axes.xaxis.get_major_formatter()(0.1, 0) == "0.1 %"
    assert [axes.yaxis.get_major_formatter()(value, 0) for value in (0.25, 12000.0)] == ["0.25", "12,000"]
