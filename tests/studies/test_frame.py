"""The frame of the studies: options, results that resume, files, and the command."""

import json
import subprocess
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from refusals import assert_refused
from studies import command
from studies.command import declared, main, module_of
from studies.frame import Results, Study, require_known
from studies.style import COLOURS, CYCLE, SETTINGS, as_numbers, as_percent, new_figure, subplots

ABOUT = {"command": "python -m studies.toy", "machine": "some machine"}


@dataclass(frozen=True)
class Options:
    """Toy."""

    seeds: tuple[int, ...] = (0,)
    """Seeds."""
    strokes: int = 1
    """Strokes."""

    def __post_init__(self) -> None:
        require_known("number", map(str, self.seeds), list(map(str, range(20))))


def swim(options, results):
    """Cells of all seeds; those of seed 13 fail."""
    cells = {("runs", "one", str(seed)): partial(float, seed) for seed in options.seeds}
    results.fill(cells, lambda found: f"{found:g} m")
    return "Seed 13 has failed." if 13 in options.seeds else None


def draw(results, file):
    file.write_text(f"{len(results['runs']['one'])} of {results['machine']}")


TOY = Study(
    "toy", swim, Options, "toys/toy.json", Path("runs/toy"), settings=lambda options: {"strokes": options.strokes},
    pictures={"toy.png": draw, "other.png": draw},
    tables={"toy": lambda found: f"| {sum(found['runs']['one'].values())} |"}, packages=("scipy",),
)  # fmt: skip


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """The command of a study that writes into a folder."""
    monkeypatch.setattr(command, "declared", lambda: {"toy": "A toy."})
    monkeypatch.setattr(command, "module_of", lambda name: type("module", (), {"STUDY": TOY, "__doc__": "A toy."}))
    return lambda *given, out=tmp_path: main(["toy", *given, "--out", str(out)])


def test_a_study_goes_on_where_it_was_broken_off_and_seeds_stand_in_their_order(toy, tmp_path, capsys):
    assert toy("--seeds", "10", "2") == 0
    assert "one, 10: 10 m (0 s)" in capsys.readouterr().out
    assert toy("--seeds", "2", "1") == 0
    printed = capsys.readouterr().out
    assert "one, 2:" not in printed and "one, 1: 1 m" in printed and "toy:" in printed and "| 13.0 |" in printed
    kept = json.loads((tmp_path / "toy.json").read_text())
    assert list(kept["runs"]["one"].items()) == [("1", 1.0), ("2", 2.0), ("10", 10.0)]
    assert list(kept)[:4] == ["command", "machine", "versions", "settings"] and kept["versions"]["scipy"]
    assert kept["command"] == "python -m studies.toy"
    assert (tmp_path / "toy.png").read_text() == f"3 of {kept['machine']}"


def test_results_of_other_settings_are_not_mixed(toy, tmp_path, capsys):
    assert toy() == 0 and toy("--strokes", "2") == 2
    assert "has results of {'strokes': 1}, not of {'strokes': 2}: give another --out." in capsys.readouterr().err


@pytest.mark.parametrize("text", ["{}", "[]", '{"settings": null}'])
def test_a_file_of_something_else_is_not_written_over(toy, tmp_path, capsys, text):
    (tmp_path / "toy.json").write_text(text)
    assert toy() == 2 and "has results of something else, not of" in capsys.readouterr().err
    assert (tmp_path / "toy.json").read_text() == text


def test_a_file_may_be_named_and_gives_its_name_to_what_is_beside_it(toy, tmp_path):
    assert toy(out=tmp_path / "mine.json") == 0
    assert {file.name for file in tmp_path.iterdir()} == {"mine.json", "mine.png", "other.png"}


def test_a_failure_is_said_once_the_files_are_written(toy, tmp_path, capsys):
    assert toy("--seeds", "13") == 1
    assert capsys.readouterr().err == "Seed 13 has failed.\n" and (tmp_path / "toy.png").is_file()


def test_numbers_of_a_study_that_does_not_resume_are_those_of_its_last_run(tmp_path):
    for number in (1, 2):
        found = Results(ABOUT, tmp_path / "toy.json")
        found[str(number)] = number
        found.save()
    assert json.loads((tmp_path / "toy.json").read_text()) == ABOUT | {"2": 2}


def test_several_processes_fill_one_file(tmp_path):
    """A cell that another process writes meanwhile stays, and is not computed again."""
    mine, others = (Results(ABOUT, tmp_path / "toy.json", {"strokes": 1}) for _ in range(2))

    def slow():
        others.fill({("runs", "1"): lambda: "theirs", ("runs", "2"): lambda: "theirs"}, str)
        return "mine"

    mine.fill({("runs", "0"): slow, ("runs", "1"): lambda: pytest.fail("computed twice")}, str)
    assert json.loads((tmp_path / "toy.json").read_text())["runs"] == {"0": "mine", "1": "theirs", "2": "theirs"}


def test_a_cell_that_is_not_done_is_computed_again(tmp_path):
    found = Results(ABOUT, tmp_path / "toy.json", {})
    for n in (1, 2, 1):
        found.fill({("cells", "a"): lambda n=n: [0] * n}, str, lambda cell, n=n: len(cell) >= n)
    assert found["cells"] == {"a": [0, 0]}


def test_unknown_studies_and_names_are_refused(capsys):
    assert main(["luck"]) == 2 and "Unknown study 'luck': choose of " in capsys.readouterr().err
    assert main(["--out", "anywhere"]) == 2 and "name it" in capsys.readouterr().err
    with assert_refused("Unknown number '99'"):
        Options(seeds=(99,))
    assert main(["contracts"]) == 2 and "nothing to run" in capsys.readouterr().err


def test_the_list_has_every_study_with_a_line(capsys):
    assert main([]) == 0
    printed = capsys.readouterr().out
    for name, line in declared().items():
        assert f"    {name} " in printed and line and line in printed
    assert {"tasks", "gallery", "benchmark", "accuracy"} <= set(declared())


@pytest.mark.parametrize("name", declared())
def test_help_names_the_command_and_shows_the_docstring_in_the_width_of_the_terminal(name, monkeypatch, capsys):
    module = module_of(name)
    if module.STUDY.run is None:
        pytest.skip("there is nothing to run")
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main([name, "--help"])
    shown = capsys.readouterr().out
    assert f"usage: python -m studies.{name} [" in shown
    assert " ".join(module.__doc__.split()) in " ".join(shown.split())
    assert all(len(line) <= 80 for line in shown.partition("usage: ")[0].splitlines())
    assert f"by default {module.STUDY.default_out}." in " ".join(shown.split())
    assert module.STUDY.name == name


def test_a_study_is_run_by_the_name_of_its_module_too():
    done = [
        subprocess.run([sys.executable, "-m", *words, "--help"], capture_output=True, text=True, check=True).stdout
        for words in (["studies", "fit"], ["studies.fit"])
    ]
    assert done[0] == done[1] and "usage: python -m studies.fit [" in done[0]


# All studies draw in one style.


STUDIES = Path(__file__).parents[2] / "studies"


def test_pictures_begin_with_the_style():
    """Nobody else makes figures, so that a change of the style changes all pictures."""
    texts = {file: file.read_text(encoding="utf-8") for file in STUDIES.rglob("*.py") if file.name != "style.py"}
    assert len(texts) > 20
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
