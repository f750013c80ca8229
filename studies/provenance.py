"""Where numbers come from: the command, the versions and the machine, which a study writes beside its results.

A page has them below its numbers: `footer` makes the line from the file of the results, so nobody writes it by hand.
"""

import importlib.metadata
import os
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from seastar_gym.version import __version__

PACKAGES = ("numpy", "numba", "llvmlite")
"""Packages that every result depends on."""


def provenance(command: str, *packages: str) -> dict[str, Any]:
    """Command, machine and versions, for the file of a study's results.

    command: What is typed to run the study. packages: Further packages whose versions count, such as "torch".
    """
    versions = {"seastar-gym": __version__, "python": platform.python_version()}
    versions |= {name: importlib.metadata.version(name) for name in (*PACKAGES, *packages)}
    return {"command": command, "machine": machine(), "versions": versions}


def machine() -> str:
    """Processors of this machine in words."""
    return f"{os.cpu_count()} cores of {_processor()}"


def _processor() -> str:
    """Name of the processor where Linux tells it, otherwise its architecture."""
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text(encoding="utf-8").splitlines() if facts.is_file() else []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())


COMMANDS = {
    "accuracy/promises.json": "python -m studies.accuracy.promises",
}
"""Commands of files that were written before studies recorded them."""


FINAL = {
    file: commit
    for commit, files in {
        "0e818f3": "accuracy/damping.json accuracy/damping.png learning/fidelities.png gaits/gaits_directions.png "
        "gaits/gaits_front.png gaits/gaits_lag.png gaits/pentagon_from_rest.json gaits/pentagon_reheated.json",
        "9cd3be4": "learning/ablations.png accuracy/ringing.json accuracy/ringing.png",
        "71299f4": "gaits/heading.png designs/hub.png accuracy/numerical_damping.json",
        "60498ae": "learning/in_time.png",
        "055100c4": "designs/designs.png designs/front.png gradients/gradients.png learning/bound.json "
        "learning/bound.png learning/pentagon.png speed/throughput.png tasks/tasks.png validation/limbs.png "
        "validation/validation.png",
    }.items()
    for file in files.split()
}
"""Files of docs/results/ that are final, and the last commit that has the code of their study."""


def made_by(results: Mapping[str, Any], file: str) -> str:
    """Words in Markdown that say how the results in a file were made, and what the run did not record.

    file: The file in docs/results/, which has the options, the versions and the machine.
    """
    command = " ".join(str(results.get("command", COMMANDS.get(file))).split()[:3])
    said = f"[{Path(file).name}](results/{file}) by `{command}`"
    said += f" at commit {FINAL[file]}" if file in FINAL else ""
    missing = " and ".join(name for name in ("versions", "machine") if name not in results)
    return f"{said}{f' ({missing} not recorded)' if missing else ''}"


def footer(files: Mapping[str, Mapping[str, Any]]) -> str:
    """Line in Markdown below the numbers of a page. files: Results, by their files in docs/results/."""
    made = "; ".join(made_by(found, name) for name, found in files.items())
    return f"*Numbers: {made}.*"
