"""What the project says about itself (dependencies, versions, README commands) is true."""

import ast
import importlib
import importlib.metadata
import re
import runpy
import sys
import tomllib
from pathlib import Path

import gymnasium as gym
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

import seastar_gym
from seastar_gym import controllers
from seastar_gym.envs.seastar_swim import SeastarSwimEnv

ROOT = Path(__file__).resolve().parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
OURS = {"seastar_gym", "agents", "studies", "train"}
NOT_REQUIRED = {*OURS, "rclpy", "geometry_msgs", "std_msgs", "cv2"}  # examples of ROS 2 and of OpenCV
OF_PACKAGE = ["render", "studies", "train", "search", "ray", "slurm", "dask", "tracks", "export", "gpu", "plant"]
# Distributions of imports whose names do not say it.
NAMED = {"cupy": "cupy-cuda13x", "PIL": "pillow", "pygame": "pygame-ce", "serial": "pyserial", "yaml": "pyyaml"}
# Torch's wheels for CUDA name these; its wheels for the CPU do not.
ONLY_WITH_CUDA = re.compile(r"(nvidia|cuda|triton)\b")

hatch_build = runpy.run_path(str(ROOT / "hatch_build.py"))


def requirements(*extras: str) -> list[Requirement]:
    """The base dependencies and those of the extras, which may name each other."""
    lines = [*PROJECT["dependencies"], *(line for extra in extras for line in PROJECT["optional-dependencies"][extra])]
    found = list(map(Requirement, lines))
    own = [extra for one in found if one.name == PROJECT["name"] for extra in sorted(one.extras)]
    return [one for one in found if one.name != PROJECT["name"]] + (requirements(*own) if own else [])


def names(found: list[Requirement]) -> set[str]:
    return {canonicalize_name(requirement.name) for requirement in found}


def pins(file: str) -> dict[str, Version]:
    """Name and version of every line of a constraints file."""
    lines = (line.partition("#")[0].strip() for line in (ROOT / file).read_text(encoding="utf-8").splitlines())
    pairs = [line.split("==") for line in lines if line]
    found = {canonicalize_name(name): Version(version) for name, version in pairs}
    assert len(found) == len(pairs), f"{file} pins a name twice"
    assert all(version.local is None for version in found.values())  # +cpu would match one index only
    return found


def installed_with(found: list[Requirement]) -> set[str]:
    """Names of all that these requirements bring along on this machine, by the metadata of what is installed."""
    waiting, seen = list(found), set()
    while waiting:
        requirement = waiting.pop()
        key = canonicalize_name(requirement.name), frozenset(requirement.extras)
        if key not in seen and not ONLY_WITH_CUDA.match(key[0]):
            seen.add(key)
            inner = map(Requirement, importlib.metadata.requires(requirement.name) or [])
            asked = [{"extra": extra} for extra in requirement.extras or {""}]
            waiting += [one for one in inner if not one.marker or any(map(one.marker.evaluate, asked))]
    return {name for name, _ in seen}


def imports_of(*paths: Path) -> set[str]:
    """Distributions that these files and folders import from outside this project, at the top or later."""
    files = [file for path in paths for file in ([path] if path.is_file() else sorted(path.rglob("*.py")))]
    modules = set()
    for node in (node for file in files for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"), str(file)))):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules.add(node.module)
    own = {path.stem for folder in ("tests", "docs", "examples") for path in (ROOT / folder).rglob("*")}
    packages = {module.partition(".")[0] for module in modules} - sys.stdlib_module_names - own - NOT_REQUIRED
    return {canonicalize_name(NAMED.get(package, package)) for package in packages}


@pytest.mark.parametrize(
    ("folders", "extras"),
    [
        (["seastar_gym"], OF_PACKAGE),
        (["studies"], ["train", "sweep", "test"]),
        (["agents", "train.py"], ["train"]),
        (["tests"], ["test", "browser", "ray", "learners"]),
        (["docs", "examples"], ["docs", "learners", "ray"]),
    ],
)
def test_every_import_has_its_requirement(folders, extras):
    assert imports_of(*(ROOT / folder for folder in folders)) <= names(requirements(*extras))


def test_names_of_the_package_are_those_of_its_modules():
    """What type checkers see, what is there when asked for, what `dir` says and what the site tells are the same."""
    rooms = runpy.run_path(str(ROOT / "docs" / "_extensions" / "reference.py"))["rooms"]()
    told = {name for modules in rooms.values() for named in modules.values() for name in named}
    for package in (seastar_gym, controllers):
        for line in ast.parse(Path(package.__file__).with_suffix(".pyi").read_text()).body:
            home = importlib.import_module(f".{line.module or ''}", package.__name__)
            for alias in line.names:
                assert getattr(package, alias.name) is getattr(home, alias.name)
                assert alias.name in package.__all__ or line.module == "envs"
        assert {name for name in package.__all__ if callable(getattr(package, name))} <= told
        assert all(hasattr(package, name) for name in package.__all__) and {*package.__all__} <= {*dir(package)}
        with pytest.raises(AttributeError, match="nothing"):
            package.nothing  # noqa: B018
    assert seastar_gym.envs.rendering.__name__ == "seastar_gym.envs.rendering"


def test_constraints_pin_all_that_gets_installed_within_the_declared_ranges():
    pinned = pins("constraints.txt")
    assert installed_with(requirements("test")) <= set(pinned)
    for one in requirements("test", "browser", "docs", "release"):
        assert pinned[canonicalize_name(one.name)] in one.specifier, one.name


def test_machine_code_in_the_wheel_is_of_the_pinned_numba():
    hook = PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]
    required, pinned = list(map(Requirement, hook["dependencies"])), pins("constraints.txt")
    assert names(required) | {"llvmlite"} == names(requirements())
    assert all(pinned[canonicalize_name(one.name)] in one.specifier for one in required)


def test_lowest_versions_are_those_of_the_declared_ranges():
    lowest = pins(".ci/lowest.txt")
    assert set(lowest) == names(requirements())
    for requirement in requirements():
        (bound,) = (Version(s.version) for s in requirement.specifier if s.operator == ">=")
        assert lowest[canonicalize_name(requirement.name)] == bound


@pytest.mark.parametrize(
    ("file", "pattern"), [("CITATION.cff", r"^version: (\S+)$"), ("CHANGELOG.md", r"^## \[([\d.]+)\]")]
)
def test_version_is_the_same_everywhere(file, pattern):
    match = re.search(pattern, (ROOT / file).read_text(encoding="utf-8"), re.MULTILINE)
    assert match is not None and match[1] == PROJECT["version"] == seastar_gym.version.__version__


ADDRESS = "https://github.com/someone/seastar-gym"


def test_a_package_index_shows_readme_with_absolute_links_once_there_is_an_address():
    metadata = {"version": "1.2.3"}
    hatch_build["CustomMetadataHook"](str(ROOT), {"repository": f"{ADDRESS}/"}).update(metadata)
    links = re.findall(r"(?:\]\(|src=\")([^)\"]+)[)\"]", text := metadata["readme"]["text"])
    assert len(links) > 20 and all(link.startswith("https://") for link in links)
    assert f"({ADDRESS}/raw/v1.2.3/docs/swim.gif)" in text and f"({ADDRESS}/blob/v1.2.3/docs/start.md)" in text
    assert metadata["urls"]["Repository"] == ADDRESS
    kept = "[a](https://b.c) [d](#e) ![f](mailto:g@h)"
    assert hatch_build["with_absolute_links"](kept, ADDRESS, "1.2.3") == kept
    assert hatch_build["with_absolute_links"]("[a](b.md)", "", "1.2.3") == "[a](b.md)"
    assert hatch_build["addresses"]("", "1.2.3") == {}


def test_the_first_ten_lines_show_the_policy_that_arrives(monkeypatch):
    make, shown = gym.make, []
    monkeypatch.setattr(gym, "make", lambda id, **arguments: make(id, path=[[0.03, 0.0]], fidelity="fast", **arguments))
    monkeypatch.setattr(SeastarSwimEnv, "draw_frame", lambda env: shown.append(env.render_mode))
    left = runpy.run_path(str(ROOT / "examples" / "ten_lines.py"))
    assert left["terminated"] and left["info"]["is_success"]
    assert set(shown) == {"human"} and len(shown) > 10
