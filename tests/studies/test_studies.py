"""The frame of the studies: results that resume, the command, and pages that say what their numbers say."""

import json
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import pytest

from refusals import assert_refused
from seastar_gym.accuracy.certificate import MARGIN
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__
from studies import command, pages
from studies.command import main, module_of, names
from studies.frame import DOCS, Study, require_known, rounded
from studies.pages import BLOCK, stale

PAGES = [*DOCS.glob("*.md"), DOCS.parent / "README.md"]
TEXTS = {page.name: page.read_text(encoding="utf-8") for page in PAGES}


@dataclass(frozen=True)
class Options:
    """Toy."""

    seeds: tuple[int, ...] = (0,)
    """Seeds."""
    strokes: int = 1
    """Strokes."""

    def __post_init__(self) -> None:
        require_known("seed", map(str, self.seeds), list(map(str, range(20))))


def swim(options, results):
    """Cells of all seeds; those of seed 13 fail."""
    cells = {("runs", "one", str(seed)): partial(float, seed) for seed in options.seeds}
    results.fill(cells, lambda found: f"{found:g} m")
    return "Seed 13 has failed." if 13 in options.seeds else None


TOY = Study(
    "toy", swim, Options, "toys/toy.json", Path("runs/toy"), settings=lambda options: {"strokes": options.strokes},
    pictures={"toy.png": lambda results, file: file.write_text(f"{len(results['runs']['one'])}")},
    tables={"toy": lambda found: f"| {sum(found['runs']['one'].values())} |"},
)  # fmt: skip


@pytest.fixture
def toy(monkeypatch, tmp_path):
    """The command of a study that writes into a folder."""
    monkeypatch.setattr(command, "names", lambda: ["toy", "contracts"])
    modules = {"toy": SimpleNamespace(STUDY=TOY, __doc__="A toy."), "contracts": module_of("contracts")}
    monkeypatch.setattr(command, "module_of", modules.get)
    return lambda *given: main(["toy", *given, "--out", str(tmp_path)])


def test_a_study_goes_on_where_it_was_broken_off_and_says_what_failed(toy, tmp_path, capsys):
    assert toy("--seeds", "10", "2") == 0
    assert "one, 10: 10 m (0 s)" in capsys.readouterr().out
    assert toy("--seeds", "2", "13") == 1
    said = capsys.readouterr()
    assert "one, 2:" not in said.out and "one, 13: 13 m" in said.out and "toy:\n\n| 25.0 |" in said.out
    assert said.err == "Seed 13 has failed.\n" and (tmp_path / "toy.png").read_text() == "3"
    kept = json.loads((tmp_path / "toy.json").read_text())
    assert kept["runs"]["one"] == {"10": 10.0, "2": 2.0, "13": 13.0}
    assert list(kept)[:4] == ["command", "machine", "versions", "settings"] and "cores of" in kept["machine"]
    assert kept["versions"]["numba"] and kept["versions"]["seastar-gym"] == __version__


@pytest.mark.parametrize(
    "text, said",
    [
        ('{"settings": {"strokes": 2}}', "has results of {'strokes': 2}, not of {'strokes': 1}: give another --out."),
        ("{}", "has results of None, not of {'strokes': 1}"),
    ],
)
def test_what_does_not_fit_is_refused_and_the_file_stays(toy, tmp_path, capsys, text, said):
    (tmp_path / "toy.json").write_text(text)
    assert toy() == 2 and said in capsys.readouterr().err
    assert (tmp_path / "toy.json").read_text() == text


def test_the_command_lists_the_studies_and_refuses_others(toy, capsys):
    assert main([]) == 0 and re.search(r"^    toy +A toy.$", capsys.readouterr().out, re.MULTILINE)
    assert main(["luck"]) == 2 and "Unknown study 'luck': choose of toy; contracts." in capsys.readouterr().err
    assert main(["contracts"]) == 2 and "nothing to run" in capsys.readouterr().err
    with assert_refused("Unknown seed '99'"):
        Options((99,))


# Pages


def test_pages_say_what_their_numbers_say():
    """`python -m studies --draw` fills them again."""
    assert [file.name for file, _ in stale([module_of(name).STUDY for name in names()])] == []


def test_a_number_that_was_changed_by_hand_is_noticed_and_mended(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pages, "DOCS", tmp_path / "docs")
    made = "<!-- made: toy -->\n\n| {} |\n\n<!-- end -->\n\n<!-- made: footer toys/toy.json -->\n\n{}\n\n<!-- end -->\n"
    (tmp_path / "docs" / "results" / "toys").mkdir(parents=True)
    (tmp_path / "docs" / "results" / "toys" / "toy.json").write_text('{"runs": {"one": {"1": 1.5}}}')
    (tmp_path / "docs" / "page.md").write_text(made.format(8.5, ""))
    (tmp_path / "README.md").write_text("<!-- made: luck -->\n<!-- end -->")
    with assert_refused("No study makes 'luck'"):
        list(stale([TOY]))
    (tmp_path / "README.md").write_text("")
    monkeypatch.setattr(command, "names", lambda: ["toy"])
    monkeypatch.setattr(command, "module_of", lambda _: SimpleNamespace(STUDY=TOY))
    assert main(["--check"]) == 1 and capsys.readouterr().out == "page.md\n" and main(["--draw"]) == 0
    footer = "*Numbers: [toy.json](results/toys/toy.json) by `python -m studies.toy`.*"
    assert (tmp_path / "docs" / "page.md").read_text() == made.format(1.5, footer) and main(["--check"]) == 0


def test_every_file_of_results_stands_on_a_page():
    files = [file.relative_to(DOCS).as_posix() for file in (DOCS / "results").rglob("*.*")]
    assert len(files) > 20 and [file for file in files if not any(f"({file})" in text for text in TEXTS.values())] == []


def test_commands_on_pages_exist_or_have_the_commit_that_has_them():
    command, said = re.compile(r"(.{0,40})python -m studies\.([\w.]+[a-z])(.{0,160})"), []
    for page, text in TEXTS.items():
        said += [(page, *found) for found in command.findall(" ".join(text.split()))]
    assert len(said) > 10
    lost = [each for each in said if each[2] not in names()]
    assert [each for each in lost if not re.search(r"commit `?[0-9a-f]{7,8}\b", f"{each[1]}{each[3]}")] == []


def test_errors_on_pages_are_those_that_info_tells():
    """Largest and typical errors of random and of repeated commands, every second and every 0.2 s, and the speed. What
    is promised, the largest with a margin, is quoted of repeated commands. README has the largest of all."""
    for page, presets in {"README.md": ["fast", "balanced", "reference"], "accuracy.md": get_args(Fidelity)}.items():
        lines = [line for block in BLOCK.finditer(TEXTS[page]) for line in block[3].splitlines()]
        rows = {found[1]: line for line in lines if (found := re.search(r"`(?:fidelity=\")?(\w+)\"?`", line))}
        assert set(rows) == set(presets)
        for name, row in rows.items():
            errors, speed = [], 0.0
            for period in (1.0, 0.2):
                info = SeastarSwimEnv(fidelity=name, decision_period=period).reset(seed=0)[1]
                for kind in ("", "gait_"):
                    errors.append((info[f"{kind or 'path_'}error"] / MARGIN, info[f"typical_{kind}error"]))
                speed = info.get("batch_real_time_factor", 0.0) or speed
            largest = f"{rounded(100 * max(errors)[0], 2):g} %"
            each = [f"{rounded(100 * most, 2):g} ({rounded(100 * usual, 2):g})" for most, usual in errors]
            each = " | ".join([*each, *(f"{100 * MARGIN * most:g}" for most, _ in errors[1::2])])
            assert row.endswith(f"| {largest if page == 'README.md' else each} | {speed:,.0f} |"), name
