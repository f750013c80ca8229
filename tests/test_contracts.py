"""Imports point one way: a planted import against the direction is found, whatever it connects."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("seastar_gym", "agents", "studies")


@pytest.fixture
def sources(tmp_path):
    """Copy of the sources and of the contracts."""
    for name in SOURCES:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=lambda _, files: [f for f in files if _is_no_source(f)])
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def _is_no_source(name: str) -> bool:
    return name == "__pycache__" or ("." in name and not name.endswith(".py"))


def lint(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run of the linter on the sources in a folder, without its cache."""
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    env = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run([sys.executable, "-c", code], cwd=folder, env=env, capture_output=True, text=True)


def plant(file: Path, imported: str) -> None:
    source = file.read_text(encoding="utf-8") if file.exists() else ""
    file.write_text(f"{source}\nimport {imported}\n", encoding="utf-8")


def test_the_sources_keep_their_contracts(sources):
    done = lint(sources)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


@pytest.mark.parametrize(
    "file, imported",
    [
        ("seastar_gym/scene/checks.py", "seastar_gym.simulator.clock"),
        ("seastar_gym/scene/limb.py", "seastar_gym"),
        ("seastar_gym/der/geometry.py", "seastar_gym.scene.limb"),
        ("seastar_gym/scene/limb.py", "seastar_gym.der.geometry"),
        ("seastar_gym/model/mesh.py", "seastar_gym.simulator.batch"),
        ("seastar_gym/simulator/clock.py", "seastar_gym.envs.reward"),
        ("seastar_gym/envs/reward.py", "seastar_gym.identify.fit"),
        ("seastar_gym/simd/rows.py", "seastar_gym.der.geometry"),
        ("seastar_gym/envs/reward.py", "agents.ppo"),
        ("seastar_gym/envs/reward.py", "seastar_gym.controllers.scripted"),
        ("seastar_gym/controllers/scripted.py", "seastar_gym.evaluation.swim"),
        ("seastar_gym/evaluation/swim.py", "agents.ppo"),
        ("agents/ppo.py", "studies.frame"),
        ("seastar_gym/scene/checks.py", "seastar_gym.scene.limb"),
        ("seastar_gym/simulator/clock.py", "seastar_gym.simulator.simulator"),
        ("seastar_gym/der/terms/stretching.py", "seastar_gym.der.terms.damping"),
        ("seastar_gym/der/terms/bending.py", "seastar_gym.der.potential"),
        ("seastar_gym/der/terms/bending.py", "seastar_gym.der.contact.contact"),
        ("seastar_gym/der/body/forces.py", "seastar_gym.der.terms.fluid"),
        ("seastar_gym/scene/limb.py", "numba"),
        ("seastar_gym/identify/fit.py", "torch"),
        ("seastar_gym/controllers/learned.py", "stable_baselines3"),
    ],
)
def test_an_import_against_the_direction_is_found(sources, file, imported):
    assert (sources / file).exists()
    plant(sources / file, imported)
    done = lint(sources)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "BROKEN" in done.stdout and Path(file).stem in done.stdout


@pytest.mark.parametrize("room", ["seastar_gym", "seastar_gym/der"])
def test_a_module_that_no_layer_lists_is_found(sources, room):
    plant(sources / room / "helpers.py", "math")
    done = lint(sources)
    assert done.returncode == 1
    assert "helpers" in done.stdout
