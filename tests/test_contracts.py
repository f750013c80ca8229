"""Imports point one way: the sources keep their contracts, and a planted import against the direction is found."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LINT = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
PLANTED = [
    None,
    ("seastar_gym/simulator/state.py", "seastar_gym.envs.options"),
    ("agents/ppo.py", "studies"),
    ("seastar_gym/scene/limb.py", "numba"),
]


@pytest.mark.parametrize("planted", PLANTED)
def test_imports_point_one_way(planted, tmp_path):
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for name in ("seastar_gym", "agents", "studies"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    if planted is not None:
        with (tmp_path / planted[0]).open("a", encoding="utf-8") as source:
            source.write(f"\nimport {planted[1]}\n")
    env = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", LINT], cwd=tmp_path, env=env, capture_output=True, text=True)
    if planted is None:
        assert done.returncode == 0 and "0 broken" in done.stdout, done.stdout + done.stderr
    else:
        assert done.returncode == 1 and "BROKEN" in done.stdout, done.stdout + done.stderr
        assert Path(planted[0]).stem in done.stdout
