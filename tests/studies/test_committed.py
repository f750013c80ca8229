"""Figures and tables that are committed are those of the code of today, where that is cheap to know."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import get_args

import pytest

from seastar_gym import Certificate, Scene
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.tasks import task_ids
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__
from studies.command import all_studies
from studies.frame import rounded
from studies.pages import BLOCK, check, draw, filled, is_drawn_so, pages, tables, told
from studies.provenance import FINAL, footer, machine, provenance

DOCS = Path(__file__).parents[2] / "docs"
STUDIES = list(all_studies())
RESULTS = DOCS / "results"
PICTURES = {
    study.committed(DOCS, name).relative_to(RESULTS).as_posix(): study
    for study in told(DOCS, STUDIES) for name in study.pictures
}  # fmt: skip
"""Studies of pictures that follow from numbers, by their files."""


def read(name):
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


def committed(ending):
    """Files in docs/results/ that have an ending."""
    return [file.relative_to(RESULTS).as_posix() for file in RESULTS.rglob(f"*.{ending}")]


@pytest.mark.parametrize("name", PICTURES)
def test_pictures_are_those_of_their_numbers(name):
    """`python -m studies --draw` draws them again."""
    assert is_drawn_so(DOCS, PICTURES[name], Path(name).name)


def test_another_number_makes_another_picture(tmp_path):
    """The comparison tells a curve that moved by a tenth."""
    folder = tmp_path / "results" / "speed"
    folder.mkdir(parents=True)
    shutil.copy(RESULTS / "speed" / "gpu.png", folder)
    results = read("speed/gpu.json")
    for row in results["speed"]["fast"]["cuda"].values():
        row["steps_per_second"] *= 1.1
    (folder / "gpu.json").write_text(json.dumps(results), encoding="utf-8")
    assert not is_drawn_so(tmp_path, PICTURES["speed/gpu.png"], "gpu.png")


def test_pages_say_what_their_numbers_say():
    """`python -m studies --draw` fills them again."""
    assert [file.name for file, text in pages(DOCS, STUDIES) if file.read_text(encoding="utf-8") != text] == []


def test_a_number_that_was_changed_by_hand_is_noticed():
    page = (DOCS / "plant.md").read_text(encoding="utf-8")
    (block,) = (found for found in BLOCK.finditer(page) if found[2] == "robustness")
    changed = page.replace(block[3], re.sub(r"\d", "8", block[3], count=1))
    assert changed != page and filled(changed, tables(DOCS, STUDIES)) == page


def test_every_picture_is_made_of_its_numbers_or_by_a_study_or_is_final():
    drawn = {name for study in STUDIES for name in study.drawn}
    final = {name for name in FINAL if name.endswith(".png")}
    assert set(committed("png")) == PICTURES.keys() | drawn | final
    assert len(PICTURES) == sum(len(study.pictures) for study in told(DOCS, STUDIES))
    assert not (PICTURES.keys() & drawn or (PICTURES.keys() | drawn) & final)


def test_every_file_of_numbers_has_a_footer():
    text = "".join(file.read_text(encoding="utf-8") for file in DOCS.glob("*.md"))
    assert [name for name in committed("json") if f"[{Path(name).name}](results/{name}) by `" not in text] == []


def test_numbers_and_pictures_stand_in_folders_of_claims():
    assert [file.name for file in DOCS.iterdir() if file.suffix in {".json", ".png"}] == []
    assert [file.name for file in RESULTS.iterdir() if file.is_file()] == []


def test_a_run_writes_where_docs_has_the_numbers_if_nothing_else_is_asked():
    found = [study for study in STUDIES if study.run and not study.out]
    assert len(found) > 5 and all(study.file for study in found)
    for study in found:
        assert DOCS.parent / study.default_out == (RESULTS / study.file).parent
    elsewhere = [study for study in STUDIES if study.out]
    assert len(elsewhere) > 3 and all(study.default_out == study.out for study in elsewhere)


def test_the_page_of_environments_holds_every_contract():
    """On GitHub as on the site: ids, spaces, observation, reward, info."""
    text = (DOCS / "environments.md").read_text(encoding="utf-8")
    for id in task_ids():
        assert f"| `{id}` | [" in text
    parts = dict(re.findall(r"^## (Seastar\w*Env)\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE))
    for name in ("SeastarSwimEnv", "SeastarSwimVectorEnv", "SeastarTaskEnv", "SeastarTaskVectorEnv"):
        assert name in parts
    headings = re.findall(r"^### (.*)$", parts["SeastarSwimEnv"], re.MULTILINE)
    assert {"Action space", "Observation space", "Reward", "Info", "Arguments"} <= set(headings), headings
    assert "`path_error`" in parts["SeastarSwimEnv"]


def test_a_table_of_no_study_is_refused():
    with pytest.raises(ValueError, match="No table is called 'luck'"):
        filled("<!-- made: luck -->\n<!-- end -->", tables(DOCS, STUDIES))


def test_stale_pages_are_named_and_filled(tmp_path, capsys):
    """A page with an empty block is stale, and is not after it was filled; blocks of other studies stay."""
    shutil.copytree(RESULTS, tmp_path / "results")
    shutil.copy(DOCS / "plant.md", tmp_path)
    page = tmp_path / "plant.md"
    page.write_text(BLOCK.sub(r"\1\4", page.read_text(encoding="utf-8")), encoding="utf-8")
    alone = [replace(study, pictures={}) for study in STUDIES]
    assert check(tmp_path, alone) == 1 and capsys.readouterr().out == "plant.md\n"
    draw(tmp_path, [study for study in alone if study.name == "gpu"])
    assert "made: robustness -->\n<!-- end" in page.read_text(encoding="utf-8") and check(tmp_path, alone) == 1
    draw(tmp_path, alone)
    assert page.read_text(encoding="utf-8") == (DOCS / "plant.md").read_text(encoding="utf-8")
    assert check(tmp_path, alone) == 0


def test_footers_say_files_and_commands_and_what_is_not_known():
    made = provenance("python -m studies.luck", "scipy")
    assert made["versions"]["seastar-gym"] == __version__ and "scipy" in made["versions"]
    assert made["machine"] == machine()
    line = footer({"some/luck.json": made, "learning/bound.json": {"command": "x", "machine": "y"}})
    assert "[luck.json](results/some/luck.json) by `python -m studies.luck`; [bound.json]" in line
    assert "(results/learning/bound.json) by `x` at commit 055100c4" in line
    assert line.endswith("(versions not recorded).*")


@pytest.mark.parametrize("page", ["README.md", "docs/accuracy.md"])
def test_errors_on_a_page_are_those_that_info_tells(page):
    """Largest and typical errors of random and of repeated commands, every second and every 0.2 s, and the speed."""
    blocks = [block[3] for block in BLOCK.finditer((DOCS.parent / page).read_text(encoding="utf-8"))]
    lines = [re.search(r"`(?:fidelity=\")?(\w+)\"?`", line) for block in blocks for line in block.splitlines()]
    rows = {found[1]: found.string for found in lines if found}
    if page == "README.md" and not rows:
        pytest.skip("README has no table of errors")
    assert {"fast", "balanced", "reference"} <= set(rows) <= set(get_args(Fidelity))
    for name, row in rows.items():
        cells, speed = [], 0.0
        for period in (1.0, 0.2):
            info = SeastarSwimEnv(fidelity=name, decision_period=period).reset(seed=0)[1]
            for kind in ("", "gait_"):
                typical, bound = info[f"typical_{kind}error"], info[f"{kind or 'path_'}error"]
                cells.append(f"{rounded(100 * bound, 2):g} % ({rounded(100 * typical, 2):g} %)")
            speed = info.get("batch_real_time_factor", 0.0) or speed
        assert row.endswith(f"| {' | '.join(cells)} | {speed:,.0f} |"), name


@pytest.mark.parametrize("name", ["accuracy/work_precision.json", "accuracy/promises.json"])
def test_measured_errors_are_of_this_version(name):
    results = read(name)
    assert results.get("version", results.get("versions", {}).get("seastar-gym")) == __version__


def test_the_certificate_of_the_worked_example_is_that_of_the_fitted_scene_and_of_the_trainings():
    folder = DOCS / "worked_example"
    found = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    certificate = Certificate.load(folder / "certificate.json")
    certificate.require_valid(Scene.from_dict(found["fit"]["scene"]))
    chosen = certificate.of(certificate.for_error(found["settings"]["error"]))
    assert str(chosen) == found["certificate"]["setting"] and certificate.samples == found["settings"]["samples"]
    assert chosen.error(certificate.promised) == found["certificate"]["error"]
    assert chosen.speed == found["certificate"]["times_real_time"]
