"""From README's first command to a report, and from its ten lines of Python to a window."""

import re

import pytest

from ways.story import command


@pytest.mark.parametrize("options, slowest", [("", 155.0), ("--seed 1 --decision-period 0.5 --strokes 65536", 120.0)])
def test_the_first_command_ends_with_a_lap_and_a_report(story, options, slowest):
    (train,) = re.findall(r"python train\.py.*", command("README.md", ".[train]"))
    story.types(f"{train} {options} --no-video --out run")
    laps = dict(re.findall(r"^(learned|script) +\d+ +([\d.]+) +5 of 5", story.told, re.MULTILINE))
    assert float(laps["learned"]) <= slowest, story.told
    assert float(laps["script"]) == pytest.approx(114.5 if "0.5" in options else 241.0, rel=0.01)
    assert (story.folder / "run/evaluation/report.html").stat().st_size > 10_000
