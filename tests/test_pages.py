"""Every block of Python on README and the pages of the guide runs, in short form, and their links lead somewhere."""

import ast
import doctest
import importlib
import inspect
import json
import re
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from types import ModuleType

import gymnasium as gym
import pytest

import seastar_gym
from documented import documented
from seastar_gym import Numerics, Scene
from seastar_gym.accuracy import measure
from seastar_gym.envs import paths
from seastar_gym.evaluation import swim as many
from seastar_gym.scene import numerics

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
FENCED = re.compile(r"^```(\S*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"(?:\]\(|<img src=\")(?!\w+:)([^)#\s\"]*)(#[^)\s]+)?[)\"]")
LONGEST = 3  # steps of an episode


def blocks(page: Path) -> list[str]:
    """The page's blocks of Python, each at the line where it stands, so that a traceback names it."""
    text = page.read_text(encoding="utf-8")
    found = [match for match in FENCED.finditer(text) if match[1] == "python"]
    return ["\n" * text.count("\n", 0, match.start(2)) + match[2] for match in found]


RUN = [page for page in PAGES if blocks(page)]
NOTEBOOK = ROOT / "examples" / "first_hour.ipynb"


@pytest.fixture
def short_form(monkeypatch, tmp_path):
    """Short episodes and trainings, certificates of one setting, no window, and nothing that outlives the page."""
    from stable_baselines3 import PPO

    make, learn = gym.make, PPO.learn

    def make_short(name, **arguments):
        if arguments.get("render_mode") == "human":
            arguments["render_mode"] = "rgb_array"
        return make(name, max_episode_steps=LONGEST, **arguments)

    def learn_shortly(model, _):
        return learn(model, model.n_envs * model.n_steps)

    monkeypatch.setattr(gym, "make", make_short)
    monkeypatch.setattr(PPO, "learn", learn_shortly)
    monkeypatch.setitem(many.swim_many.__kwdefaults__, "max_strokes", LONGEST)
    monkeypatch.setattr(measure, "NODES", (12,))
    monkeypatch.setattr(measure, "SHORT", Numerics("implicit-midpoint", 1e-3, 1e-8))
    monkeypatch.setattr(measure, "NUMERICS", (Numerics("implicit-midpoint", 2.5e-3, 1e-6),))
    monkeypatch.setattr(measure, "LONG", 40)
    monkeypatch.setattr(measure, "MANY_NODES", 17)
    monkeypatch.setattr(paths, "PATHS", dict(paths.PATHS))
    monkeypatch.setattr(numerics, "SCHEME_NAMES", [*numerics.SCHEME_NAMES])
    monkeypatch.setitem(gym.registry, "SeastarAway-v0", None)
    del gym.registry["SeastarAway-v0"]  # which the page on extending registers
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def certificate(short_form):
    """File certificate.json of the chapter's robot, of one setting, in place of the minutes that all would take."""
    seastar_gym.certify(Scene(), 2).save("certificate.json")


@pytest.mark.filterwarnings("ignore:.*is not within the observation space:UserWarning")
@pytest.mark.usefixtures("short_form")
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_every_block_of_python_runs(page, monkeypatch, request):
    if "certificate.json" in "".join(blocks(page)):
        request.getfixturevalue("certificate")
    module = ModuleType(page.stem)
    monkeypatch.setitem(sys.modules, module.__name__, module)  # where dataclasses look for their names
    for block in blocks(page):
        exec(compile(block, page.name, "exec"), vars(module))


@pytest.mark.usefixtures("short_form")
def test_the_notebook_of_the_first_hour_runs():
    """Every cell, the last line of which shows something as a notebook would."""
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict[str, object] = {}
    for cell in (cell for cell in cells if cell["cell_type"] == "code"):
        assert cell["outputs"] == [] and cell["execution_count"] is None  # as it was written
        *lines, last = ast.parse("".join(cell["source"])).body
        exec(compile(ast.Module(lines, []), NOTEBOOK.name, "exec"), names)
        if isinstance(last, ast.Expr):
            shown = eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names)
            assert len(getattr(shown, "_repr_html_", shown.__repr__)()) < 3000
        else:
            exec(compile(ast.Module([last], []), NOTEBOOK.name, "exec"), names)
    assert 8 <= len(cells) < 24


EXAMPLES = [file for file in sorted((ROOT / "seastar_gym").rglob("*.py")) if ">>> " in file.read_text("utf-8")]


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_examples_in_docstrings_give_what_they_say(file):
    module = importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
    failed, tried = doctest.testmod(module, optionflags=doctest.ELLIPSIS)
    assert tried and not failed


def test_no_block_hides_from_the_tests():
    """Python stands in blocks that say so; what they hold is counted, so that none is lost by a new spelling."""
    known = {"python", "bash", "bibtex", "c", "dockerfile", "json", "markdown", "{toctree}"}
    kinds = [match[1] for page in PAGES for match in FENCED.finditer(page.read_text(encoding="utf-8"))]
    assert set(kinds) <= known, f"pages have blocks of {set(kinds) - known}"
    assert sum(len(blocks(page)) for page in RUN) == kinds.count("python") > 20


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub and the site name them."""
    titles = re.findall(r"^#+ (.+)$", FENCED.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


def test_links_lead_to_files_and_their_headings():
    for page in (*PAGES, NOTEBOOK):
        text = FENCED.sub("", page.read_text(encoding="utf-8"))
        links = [(page.parent / target if target else page, anchor[1:]) for target, anchor in LINK.findall(text)]
        assert [(page.name, target) for target, _ in links if not target.exists()] == []
        lost = [(target.name, anchor) for target, anchor in links if anchor and anchor not in anchors(target)]
        assert [page.name, lost] == [page.name, []]


SAID = re.compile(r"docs/(\w+\.md)")


def test_pages_and_files_that_code_and_pages_name_are_there():
    """In docstrings, model cards, sentences of the programs, and on the page on extending."""
    files = [file for room in ("seastar_gym", "agents", "studies", ".ci") for file in (ROOT / room).rglob("*.*")]
    texts = {file: file.read_text("utf-8") for file in files if file.suffix in {".py", ".md", ".yml", ".html"}}
    named = {(file.name, page) for file, text in texts.items() for page in SAID.findall(text)}
    assert len(named) > 10
    assert [(file, page) for file, page in named if not (ROOT / "docs" / page).is_file()] == []
    extending = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    code = re.findall(r"`((?:seastar_gym|tests|rods)/[\w/]+\.py)`", extending)
    assert len(code) > 8
    assert [name for name in code if not any((base / name).is_file() for base in (ROOT, ROOT / "seastar_gym"))] == []


TABLE = re.compile(r"^\|.*\n(?:\|.*(?:\n|\Z))+", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?")


def rows(table: str) -> set[tuple[float, ...]]:
    """Numbers of the rows of a table that have two or more, whatever stands around them."""
    lines = (LINK.sub("", line) for line in table.splitlines()[2:])
    numbers = (tuple(map(float, NUMBER.findall(line))) for line in lines)
    return {found for found in numbers if len(found) > 1}


def repeated(texts: dict[str, str]) -> Iterator[tuple[str, str, tuple[float, ...]]]:
    """Pages whose tables have two rows in common, and one of these."""
    tables = [(name, rows(table)) for name, text in texts.items() for table in TABLE.findall(text)]
    for (page, one), (other, another) in combinations(tables, 2):
        if page != other and len(one & another) > 1:
            yield page, other, min(one & another)


def test_no_table_stands_on_two_pages():
    """It is kept where it belongs, and others link to it. README shows some rows of the guide."""
    texts = {page.name: FENCED.sub("", page.read_text(encoding="utf-8")) for page in PAGES[1:]}
    assert sum(len(TABLE.findall(text)) for text in texts.values()) > 50
    assert [*repeated(texts)] == []


# Pages that are made when the site is built

SECTIONS = ["Description", "Action Space", "Observation Space", "Rewards", "Starting State", "Episode End", "Info",
            "Arguments", "Baselines", "Version History"]  # fmt: skip
"""As Gymnasium's pages of environments have them."""


@pytest.fixture
def made(monkeypatch):
    """Generated pages in Markdown, by their files."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_extensions"))
    pages = {name: importlib.import_module(name).pages() for name in ("environments", "reference")}
    every = ((place, name, text) for place, found in pages.items() for name, text in found.items())
    return {ROOT / "docs" / place / f"{name}.md": text for place, name, text in every}


def test_every_id_and_every_documented_name_has_its_place_on_a_page(made):
    for id in seastar_gym.IDS:
        text = made[ROOT / "docs" / "environments" / f"{id}.md"]
        assert re.findall(r"^## (.+)$", text, re.MULTILINE) == SECTIONS
        assert all(part.strip() for part in re.split(r"^## .+$", text, flags=re.MULTILINE))
    named = [name for text in made.values() for name in re.findall(r"^### (\w+)$", text, re.MULTILINE)]
    in_package = {name for name, module in documented().items() if module.startswith("seastar_gym")}
    exported = {name for name in dir(seastar_gym) if inspect.isclass(getattr(seastar_gym, name))}
    assert in_package | exported <= {*named} and len(named) == len({*named})
    lost = {name: target for page, text in made.items() for target, _ in LINK.findall(text)
            if (name := page.name) and target and (file := (page.parent / target).resolve()) not in made
            and not file.is_file()}  # fmt: skip
    assert lost == {}
