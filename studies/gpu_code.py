"""Registers that the code for GPUs needs, and what it spills into memory: no GPU is needed, NVIDIA's assembler is.

`pip install -e ".[gpu-check]"` brings it (ptxas). Tests refuse code that needs more than `gpu_code.json` in docs/ has.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any, get_args

import numpy as np

from seastar_gym.envs.pictures import observing
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.simd import cuda
from seastar_gym.simd.compilation import kept_code
from seastar_gym.simd.device import Program
from seastar_gym.simulator.device_batch import DeviceBatch, program_of
from studies.frame import Results, Study
from studies.gpu import EVERYTHING, scenes
from studies.pages import markdown

ARCHITECTURES = ("sm_80", "sm_90")
"""NVIDIA's names of the A100's and the H100's instructions."""
NAMES = ("the chapter's scene", "contact, limbs apart", EVERYTHING, *get_args(SchemeName))
FACTS = re.compile(
    r"(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads.*?Used (\d+) registers", re.DOTALL
)


def assembler() -> str | None:
    """Path of ptxas: on the PATH, or from the package of the extra gpu-check; None without."""
    try:
        found = [str(file.locate()) for file in files("nvidia-cuda-nvcc") or () if file.name == "ptxas"]
    except PackageNotFoundError:
        found = []
    return shutil.which("ptxas") or next(iter(found), None)


def code_of(scene: Scene) -> str:
    """The code for GPUs (PTX) of a scene whose limbs all turn alike, which is kept on the disk."""
    return _kept(program_of(scene))


def code_of_observations(scene: Scene) -> str:
    """The code for GPUs (PTX) of the observations of a scene's robot, likewise."""
    batch = DeviceBatch(scene, 1, "scalar", effort=False)
    return _kept(batch.filling(*observing(batch.coefficients, scene.robot, np.zeros((1, 4)))))


def _kept(program: Program) -> str:
    return kept_code(f"{program.key}-{cuda.ARCHITECTURE}.ptx", lambda: cuda.ptx_of(program).encode()).decode()


def needs(code: str, architecture: str, ptxas: str) -> dict[str, int]:
    """Registers of a thread, and bytes of its stack and of what it spills."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "swim.ptx")
        file.write_text(code)
        command = [ptxas, "-v", "--gpu-name", architecture, str(file), "-o", str(file.with_suffix(".cubin"))]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    return facts(told)


def facts(told: str) -> dict[str, int]:
    """Numbers in what ptxas says. ValueError where it says something else."""
    found = FACTS.search(told)
    if found is None:
        raise ValueError(f"ptxas tells no registers: {told.strip()}")
    return dict(zip(("stack", "spill_stores", "spill_loads", "registers"), map(int, found.groups()), strict=True))


def run(results: Results) -> str | None:
    """Compile and assemble the code of some scenes for every architecture."""
    ptxas = assembler()
    if ptxas is None:
        return 'NVIDIA\'s assembler ptxas is not here: pip install "seastar-gym[gpu-check]".'
    results["needs"] = {}
    for name in NAMES:
        code = code_of(scenes()[name])
        results["needs"][name] = {architecture: needs(code, architecture, ptxas) for architecture in ARCHITECTURES}
        print(name, results["needs"][name], flush=True)
    return None


def registers(results: Mapping[str, Any]) -> str:
    """Table of registers and of bytes spilled, by scene and architecture."""
    head = [column for name in ARCHITECTURES for column in (f"{name}: registers", "bytes spilled, read back")]
    rows = []
    for name, row in results["needs"].items():
        found = [row[each] for each in ARCHITECTURES]
        pairs = [(one["registers"], f"{one['spill_stores']}, {one['spill_loads']}") for one in found]
        rows.append([name, *(cell for pair in pairs for cell in pair)])
    return markdown(["scene", *head], rows)


STUDY = Study("gpu_code", run, file="speed/gpu_code.json", out=Path("runs/gpu_code"), tables={"gpu_code": registers})
