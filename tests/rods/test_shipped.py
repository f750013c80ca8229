"""Machine code that a wheel carries: found where nothing was compiled, with the same bits, by processors it fits."""

import os
import runpy
import subprocess
import sys
from types import SimpleNamespace

import gymnasium as gym
import pytest

from seastar_gym.cli import shipped as shipping
from seastar_gym.lanes import compile as compiling
from seastar_gym.lanes.registers import N_LANES

ID = "SeastarSwim-v0"
NATIVE = {8: "x86-64-v4", 4: "x86-64-v3"}
START = f"""
import sys
from pathlib import Path
from seastar_gym.lanes import compile as compiling
compiling.SHIPPED = Path(sys.argv[1])
import gymnasium as gym
env = gym.make("{ID}")
env.reset(seed=0)
print(env.step([1, 0, 2, 0, 1])[0].tobytes().hex())
"""
V3, V4 = (",".join(f"+{each}" for each in sorted(compiling.LEVELS[level])) for level in ("x86-64-v3", "x86-64-v4"))


def codegen(features, triple="x86_64-unknown-linux-gnu"):
    return SimpleNamespace(magic_tuple=lambda: (triple, "znver3", features))


@pytest.mark.parametrize(
    "features, levels",
    [(V4, ["x86-64-v4", "x86-64-v3"]), (V3, ["x86-64-v3"]), (V3.replace("+movbe", "-movbe"), []),
     (V4.replace("+avx512vl", "-avx512vl"), ["x86-64-v3"]), ("", [])],
)  # fmt: skip
def test_code_is_of_levels_whose_every_feature_the_processor_has(features, levels, monkeypatch):
    triple = "x86_64-unknown-linux-gnu"
    assert compiling.levels_of(codegen(features)) == [(triple, level) for level in levels]
    monkeypatch.setattr(compiling.numba.config, "BOUNDSCHECK", 1)
    assert compiling.levels_of(codegen(features)) == []


def test_code_of_every_level_is_compiled_on_the_lanes_of_its_processors(tmp_path):
    hook = runpy.run_path(str(compiling.PACKAGE.parent / "hatch_build.py"))["CustomBuildHook"]
    assert {level: str(shipping.lanes_of(level)) for level in compiling.LEVELS} == hook.LANES
    for level in compiling.LEVELS:
        if shipping.lanes_of(level) != N_LANES:
            with pytest.raises(SystemExit, match="set SEASTAR_LANES="):
                shipping.main(level, str(tmp_path))


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """Folder of the code that one id asks for."""
    if N_LANES not in NATIVE:
        pytest.skip("a processor of neither level")
    folder = tmp_path_factory.mktemp("shipped")
    command = [sys.executable, "-m", "seastar_gym.cli.shipped", NATIVE[N_LANES], str(folder / "code"), ID]
    own = {"NUMBA_CACHE_DIR": str(folder / "builders"), "PYTHONPATH": str(compiling.PACKAGE.parent)}
    subprocess.run(command, env=os.environ | own, check=True, capture_output=True)
    return folder / "code"


def test_nothing_is_compiled_or_written_where_code_came_with_the_package_and_bits_are_the_same(shipped, tmp_path):
    own = {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(compiling.PACKAGE.parent)}
    command = [sys.executable, "-c", START, str(shipped)]
    run = subprocess.run(command, env=os.environ | own, check=True, capture_output=True, text=True)
    assert "compiles" not in run.stderr and not [each for each in tmp_path.rglob("*") if each.suffix == ".nbc"]
    env = gym.make(ID)
    env.reset(seed=0)
    assert run.stdout.strip() == env.step([1, 0, 2, 0, 1])[0].tobytes().hex()
