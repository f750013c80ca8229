"""The page that tells how to extend the package runs."""

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from seastar_gym.envs import paths

PAGE = Path(__file__).parents[1] / "docs" / "extending.md"


@pytest.mark.filterwarnings("ignore:.*is not within the observation space:UserWarning")
def test_every_code_block_of_the_page_on_extending_runs(monkeypatch):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) >= 4
    page = ModuleType("extending")
    monkeypatch.setitem(sys.modules, page.__name__, page)  # where dataclasses look for their names
    monkeypatch.setattr(paths, "PATHS", dict(paths.PATHS))  # the page adds one
    for block in blocks:
        exec(compile(block, PAGE.name, "exec"), vars(page))
    assert page.info["waypoint_index"] == 0


def test_the_files_that_the_page_names_are_there():
    root = PAGE.parents[1]
    named = re.findall(r"`((?:seastar_gym|tests|der|model)/[\w/]+\.py)`", PAGE.read_text(encoding="utf-8"))
    assert len(named) > 8
    missing = [name for name in named if not any((base / name).is_file() for base in (root, root / "seastar_gym"))]
    assert not missing
