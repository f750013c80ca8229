"""Where numbers come from: what every study writes beside its results."""

import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any

from seastar_gym.version import __version__


def provenance(command: str) -> dict[str, Any]:
    """Command, machine and versions."""
    versions = {"seastar-gym": __version__, "python": platform.python_version()}
    versions |= {name: importlib.metadata.version(name) for name in ("numpy", "numba", "llvmlite")}
    lines = facts.read_text("utf-8").splitlines() if (facts := Path("/proc/cpuinfo")).is_file() else []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    machine = f"{os.cpu_count()} cores of {next(models, platform.machine())}"
    return {"command": command, "machine": machine, "versions": versions}
