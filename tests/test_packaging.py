"""What the project says about itself (dependencies, versions, README commands) is true."""

import ast
import importlib
import importlib.metadata
import re
import runpy
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import gymnasium as gym
import hatchling.build
import pygame
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import seastar_gym
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Where the import name does not say it.
DISTRIBUTION_OF = {"cupy": "cupy-cuda13x", "PIL": "pillow", "pygame": "pygame-ce", "yaml": "pyyaml"}
# Torch's wheels for CUDA name these; its wheels for the CPU do not.
ONLY_WITH_CUDA = re.compile(r"(nvidia|cuda|triton)\b")

contents = runpy.run_path(str(ROOT / ".ci" / "contents.py"))
hatch_build = runpy.run_path(str(ROOT / "hatch_build.py"))
quick_start_commands = runpy.run_path(str(ROOT / ".ci" / "quick_start.py"))["quick_start_commands"]


def requirements(*extras: str) -> list[Requirement]:
    """The base dependencies and those of the extras, which may name each other."""
    lines = [*PROJECT["dependencies"], *(line for extra in extras for line in PROJECT["optional-dependencies"][extra])]
    found = []
    for requirement in map(Requirement, lines):
        if requirement.name == PROJECT["name"]:
            found += requirements(*sorted(requirement.extras))
        else:
            found.append(requirement)
    return found


def names(found: list[Requirement]) -> set[str]:
    return {canonicalize_name(requirement.name) for requirement in found}


def pins(file: str) -> dict[str, Version]:
    """Name and version of every line of a constraints file."""
    lines = (line.partition("#")[0].strip() for line in (ROOT / file).read_text(encoding="utf-8").splitlines())
    pairs = [line.split("==") for line in lines if line]
    found = {canonicalize_name(name): Version(version) for name, version in pairs}
    assert len(found) == len(pairs), f"{file} pins a name twice"
    return found


def installed_with(found: list[Requirement]) -> set[str]:
    """Names of all that these requirements bring along on this machine, by the metadata of what is installed."""
    waiting, seen = list(found), set()
    while waiting:
        requirement = waiting.pop()
        key = canonicalize_name(requirement.name), frozenset(requirement.extras)
        if key in seen or ONLY_WITH_CUDA.match(key[0]):
            continue
        seen.add(key)
        for inner in map(Requirement, importlib.metadata.requires(requirement.name) or []):
            if inner.marker is None or any(inner.marker.evaluate({"extra": e}) for e in requirement.extras or {""}):
                waiting.append(inner)
    return {name for name, _ in seen}


WITH_ROS = "rclpy", "geometry_msgs", "std_msgs"
"""Packages that no package index has: they come with ROS 2."""


def imports_of(*paths: Path) -> set[str]:
    """Distributions that these files and folders import from outside this project, at the top or later."""
    files = [file for path in paths for file in ([path] if path.is_file() else sorted(path.rglob("*.py")))]
    assert files
    modules = set()
    for node in (node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"), str(file)))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules.add(node.module)
    beside = {path.stem for folder in ("tests", "docs", "examples") for path in (ROOT / folder).rglob("*.py")}
    folders = {path.stem for path in (ROOT / "tests").rglob("*")}
    own = {"seastar_gym", "agents", "studies", "train", *beside, *folders, *WITH_ROS}
    packages = {module.partition(".")[0] for module in modules} - sys.stdlib_module_names - own
    return {canonicalize_name(DISTRIBUTION_OF.get(package, package)) for package in packages}


def test_wheel_holds_the_package_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    wheel = tmp_path / hatchling.build.build_wheel(str(tmp_path))
    files = zipfile.ZipFile(wheel).namelist()
    assert {file.partition("/")[0] for file in files} == {"seastar_gym", f"seastar_gym-{PROJECT['version']}.dist-info"}
    assert "seastar_gym/__init__.py" in files
    assert "seastar_gym/py.typed" in files  # the annotations are for its users too
    policies = {file.removesuffix(".safetensors") for file in files if file.endswith(".safetensors")}
    assert len(policies) >= 3
    assert {f"{policy}{suffix}" for policy in policies for suffix in (".json", ".md")} <= set(files)


def test_every_base_dependency_is_imported_by_the_package():
    assert names(requirements()) <= imports_of(ROOT / "seastar_gym")


def test_every_extra_is_in_the_table_of_the_guide():
    text = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^\| extra \| for \|\n\|[-|]+\|\n((?:\|.*\n)+)", text, re.MULTILINE)
    rows = [row.split("|")[1:3] for row in table.splitlines()]
    names_and_uses = {name.strip(" `"): use for name, use in rows if name.strip() != "none"}
    assert len(names_and_uses) == len(rows) - 1 and set(names_and_uses) == set(PROJECT["optional-dependencies"])
    for extra, lines in PROJECT["optional-dependencies"].items():
        brought = {part for line in map(Requirement, lines) if line.name == PROJECT["name"] for part in line.extras}
        assert brought == set(re.findall(r"`([a-z-]+)`", names_and_uses[extra].partition("with ")[2])), extra


@pytest.mark.parametrize(
    ("folders", "extras"),
    [
        (["seastar_gym"], ["render", "studies", "train", "search", "ray", "slurm", "data", "export", "gpu"]),
        (["studies"], ["train", "sweep", "test", "data"]),
        (["agents", "train.py"], ["train", "rllib"]),
        (["tests"], ["test", "browser", "ray", "learners"]),
        (["docs", "examples"], ["docs", "learners"]),
    ],
)
def test_every_import_has_its_requirement(folders, extras):
    assert imports_of(*(ROOT / folder for folder in folders)) <= names(requirements(*extras))


NOT_NEEDED = {
    "numba", "llvmlite", "scipy", "torch", "stable_baselines3", "matplotlib", "plotly", "pygame", "imageio", "rich",
    "seastar_gym.accuracy",
}  # fmt: skip


@pytest.mark.parametrize(
    "code, most",
    [("import seastar_gym", 4), ("from seastar_gym.controllers import load; load()", 43)],
    ids=["the package", "a policy"],
)
def test_importing_the_package_and_loading_a_policy_leave_out_what_they_do_not_need(code, most):
    code = f"import sys; {code}; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert "seastar_gym" in loaded and loaded.isdisjoint(NOT_NEEDED)
    assert len({name for name in loaded if name.partition(".")[0] == "seastar_gym"}) <= most


def test_names_of_the_package_are_those_of_its_modules():
    """What type checkers see, what is there when asked for, what `dir` says and what the site tells are the same."""
    import seastar_gym
    from seastar_gym import controllers
    from seastar_gym.envs import symmetry

    reference = runpy.run_path(str(ROOT / "docs" / "_extensions" / "reference.py"))
    for package in (seastar_gym, controllers, symmetry):
        (block,) = (node for node in ast.parse(Path(package.__file__).read_text()).body if isinstance(node, ast.If))
        for line in block.body:
            for alias in line.names:
                assert getattr(package, alias.name) is getattr(importlib.import_module(line.module), alias.name)
                assert alias.name in package.__all__
        told = re.findall(r"py:(?:class|function)} [\w.]+\.(\w+)", reference["public"](package.__name__))
        assert told == [name for name in package.__all__ if callable(getattr(package, name))]
        assert all(hasattr(package, name) for name in package.__all__) and {*package.__all__} <= {*dir(package)}
        with pytest.raises(AttributeError, match=f"module '{package.__name__}' has no attribute 'nothing'"):
            package.nothing  # noqa: B018
    assert seastar_gym.envs.rendering.__name__ == "seastar_gym.envs.rendering"


@pytest.mark.parametrize(
    "requirement", requirements("test", "browser", "docs", "release"), ids=lambda requirement: requirement.name
)
def test_tested_version_lies_in_the_declared_range(requirement):
    assert pins("constraints.txt")[canonicalize_name(requirement.name)] in requirement.specifier


def test_upper_bounds_are_those_with_a_reason():
    """Which pyproject.toml says beside them; constraints.txt has the versions that were tested."""
    every = requirements(*PROJECT["optional-dependencies"])
    bounded = {one.name for one in every if any(part.operator != ">=" for part in one.specifier)}
    assert bounded == {"gymnasium", "numba"}


def test_constraints_pin_all_that_gets_installed():
    assert installed_with(requirements("test")) <= set(pins("constraints.txt"))


@pytest.mark.parametrize("file", ["constraints.txt", "constraints-rllib.txt"])
def test_constraints_fit_every_build_of_a_version(file):
    """A local tag such as +cpu would match one index only."""
    assert all(version.local is None for version in pins(file).values())


def test_rllib_s_environment_differs_by_its_gymnasium_alone():
    usual, its_own = pins("constraints.txt"), pins("constraints-rllib.txt")
    assert {name for name in its_own if usual.get(name, its_own[name]) != its_own[name]} == {"gymnasium"}
    assert all(its_own[canonicalize_name(one.name)] in one.specifier for one in requirements("rllib"))


def test_lowest_versions_are_those_of_the_declared_ranges():
    lowest = pins(".ci/lowest.txt")
    assert set(lowest) == names(requirements())
    for requirement in requirements():
        (bound,) = (Version(s.version) for s in requirement.specifier if s.operator == ">=")
        assert lowest[canonicalize_name(requirement.name)] == bound


@pytest.mark.parametrize("version", ["1.2.2", "1.4.0"])
def test_both_gymnasium_versions_are_allowed(version):
    """RLlib pins the first."""
    (gymnasium,) = (requirement for requirement in requirements() if requirement.name == "gymnasium")
    assert version in gymnasium.specifier


def test_readme_has_two_quick_starts_that_do_their_own_set_up():
    commands = quick_start_commands((ROOT / "README.md").read_text(encoding="utf-8"))
    assert set(commands) == {"train", "test"}
    for command in commands.values():
        assert command.startswith("python3 -m venv .venv && .venv/bin/pip install ")
        assert "-c constraints.txt" in command
    assert commands["train"].endswith(" .venv/bin/python train.py")
    assert " && .venv/bin/pytest" in commands["test"]


@pytest.mark.parametrize(
    ("readme", "complaint"),
    [
        ("<!-- quick-start: test -->\n```bash\none\ntwo\n```\n", "exactly one command line"),
        ("<!-- quick-start: test -->\n```bash\n```\n", "exactly one command line"),
        ("<!-- quick-start: test -->\nSome words first.\n```bash\none\n```\n", "exactly one command line"),
        ("<!-- quick-start: test -->\n```bash\none\n```\n" * 2, "appears twice"),
    ],
)
def test_unclear_quick_starts_are_refused(readme, complaint):
    with pytest.raises(ValueError, match=complaint):
        quick_start_commands(readme)


def test_quick_start_is_taken_byte_for_byte():
    line = 'a -c b.txt -e ".[c]" && d  # e'
    readme = f"# Title\n\n<!-- quick-start: test -->\n\n```bash\n{line}\n```\n\n```bash\nanother\n```\n"
    assert quick_start_commands(readme) == {"test": line}


@pytest.mark.parametrize(
    ("file", "pattern"), [("CITATION.cff", r"^version: (\S+)$"), ("CHANGELOG.md", r"^## \[([\d.]+)\]")]
)
def test_version_is_the_same_everywhere(file, pattern):
    match = re.search(pattern, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    assert match is not None
    assert match[1] == PROJECT["version"]


ADDRESS = "https://github.com/someone/seastar-gym"


def test_links_of_the_readme_are_absolute_on_a_package_index():
    text = hatch_build["with_absolute_links"]((ROOT / "README.md").read_text(encoding="utf-8"), ADDRESS, "1.2.3")
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert len(links) > 20 and all(link.startswith("https://") for link in links)
    assert f"({ADDRESS}/raw/v1.2.3/docs/swim.gif)" in text and f"({ADDRESS}/blob/v1.2.3/docs/start.md)" in text


def test_links_stay_as_they_are_while_there_is_no_address():
    assert hatch_build["with_absolute_links"]("[a](b.md)", "", "1.2.3") == "[a](b.md)"
    assert hatch_build["addresses"]("", "1.2.3") == {}
    kept = "[a](https://b.c) [d](#e) ![f](mailto:g@h)"
    assert hatch_build["with_absolute_links"](kept, ADDRESS, "1.2.3") == kept


def test_a_wheel_has_the_addresses(tmp_path, monkeypatch):
    """A copy of what the metadata needs, with an address filled in."""
    for name in ("pyproject.toml", "README.md", "LICENSE", "hatch_build.py", "seastar_gym/__init__.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    project = tmp_path / "pyproject.toml"
    project.write_text(project.read_text("utf-8").replace('repository = ""', f'repository = "{ADDRESS}/"'), "utf-8")
    monkeypatch.chdir(tmp_path)
    wheel = zipfile.ZipFile(tmp_path / hatchling.build.build_wheel(str(tmp_path)))
    (metadata,) = (wheel.read(name).decode() for name in wheel.namelist() if name.endswith("/METADATA"))
    assert f"Project-URL: Repository, {ADDRESS}\n" in metadata
    assert f"]({ADDRESS}/blob/v{PROJECT['version']}/docs/start.md)" in metadata


def test_a_release_without_an_address_is_refused_with_sentences(tmp_path):
    (tmp_path / ".ci").mkdir()
    for name, without, filled in (
        ("pyproject.toml", 'repository = ""', f'repository = "{ADDRESS}"'),
        (".ci/release.md", "OWNER", "someone"),
        ("CITATION.cff", "license: MIT\n", f"license: MIT\nrepository-code: {ADDRESS}\n"),
    ):
        text = (ROOT / name).read_text(encoding="utf-8")
        (tmp_path / name).write_text(text.replace(without, filled), encoding="utf-8")
    (no_person,) = contents["placeholders"](tmp_path)
    assert "names no person" in no_person
    citation = (tmp_path / "CITATION.cff").read_text(encoding="utf-8")
    (tmp_path / "CITATION.cff").write_text(citation.replace("  - name: The", "  - family-names: The"), "utf-8")
    assert contents["placeholders"](tmp_path) == []
    project = (tmp_path / "pyproject.toml").read_text(encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text(project.replace(ADDRESS, ""), encoding="utf-8")
    (tmp_path / ".ci" / "release.md").write_text("https://github.com/OWNER/seastar-gym", encoding="utf-8")
    (tmp_path / "CITATION.cff").write_text("title: seastar-gym", encoding="utf-8")
    address, owner, citation, person = contents["placeholders"](tmp_path)
    assert "fill in repository" in address and "OWNER" in owner and "repository-code" in citation and "person" in person


# The first ten lines that a user reads run, show the shipped policy, and say what to do without a display.


FILE = Path(seastar_gym.__file__).parents[1] / "examples" / "ten_lines.py"


@pytest.fixture
def short(monkeypatch):
    """The same lines with a waypoint that is near."""
    pygame.display.quit()
    make = gym.make
    monkeypatch.setattr(gym, "make", lambda id, **arguments: make(id, path=[[0.03, 0.0]], fidelity="fast", **arguments))
    yield
    pygame.display.quit()


def test_they_are_ten_and_show_the_policy_that_arrives(short, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    shown = []
    monkeypatch.setattr(SeastarSwimEnv, "_draw_frame", lambda env: shown.append(env.render_mode))
    assert sum(bool(line.strip()) for line in FILE.read_text(encoding="utf-8").splitlines()[4:]) <= 11
    left = runpy.run_path(str(FILE))
    assert left["terminated"] and left["info"]["is_success"]
    assert set(shown) == {"human"} and len(shown) > 10


def test_without_a_display_they_say_what_to_do(short, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    with pytest.warns(UserWarning, match=r"No window can be opened .* or write a film, seastar swim --film swim.mp4"):
        runpy.run_path(str(FILE))
