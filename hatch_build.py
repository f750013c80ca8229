"""What a package index shows: README with absolute links, and the addresses of the project.

README's links are relative, so that they lead somewhere in a checkout. A package index has no files beside it. So the
description of a wheel gets absolute ones, once `repository` in pyproject.toml (`[tool.hatch.metadata.hooks.custom]`) is
the address on GitHub. Until then it is empty, links stay as they are, and `python .ci/contents.py dist --release` says
so.

A wheel may carry machine code, so that nothing is compiled at the first start: with HATCH_BUILD_HOOK_ENABLE_CUSTOM=true
in the environment it is one of this Python on x86-64 Linux. All other builds are as they were.
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = re.compile(r"(!?)(\[[^\]]*\])\((?!\w+:|#)([^)\s]+)\)")
PICTURE = re.compile(r'(<img src=")(?!\w+:)')


def with_absolute_links(text: str, repository: str, version: str) -> str:
    """Markdown whose relative links and pictures lead to files of a version on GitHub; unchanged without address."""
    if not repository:
        return text

    def absolute(link: re.Match[str]) -> str:
        return f"{link[1]}{link[2]}({repository}/{'raw' if link[1] else 'blob'}/v{version}/{link[3]})"

    return PICTURE.sub(rf"\g<1>{repository}/raw/v{version}/", RELATIVE.sub(absolute, text))


def addresses(repository: str, version: str) -> dict[str, str]:
    """Project URLs; none without address."""
    if not repository:
        return {}
    return {
        "Repository": repository,
        "Documentation": f"{repository}/blob/v{version}/docs/index.md",
        "Changelog": f"{repository}/blob/v{version}/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }


class CustomMetadataHook(MetadataHookInterface):
    """Fills the dynamic fields of `[project]`."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set readme and urls."""
        repository, version = self.config["repository"].rstrip("/"), metadata["version"]
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        text = with_absolute_links(text, repository, version)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
        metadata["urls"] = addresses(repository, version)


class CustomBuildHook(BuildHookInterface[Any]):
    """Compiles the kinds of code that ids ask for, for processors of x86-64-v4 and v3.

    All registered ids, or those in SEASTAR_SHIPPED_IDS, parted by spaces.
    """

    LANES = {"x86-64-v4": "8", "x86-64-v3": "4"}

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and have the files included."""
        if version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        # What the build requires is in pip's own PYTHONPATH.
        path = os.pathsep.join(filter(None, [self.root, os.environ.get("PYTHONPATH")]))
        ids = os.environ.get("SEASTAR_SHIPPED_IDS", "").split()
        others = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
        with tempfile.TemporaryDirectory() as nothing:
            running = []
            for level, lanes in self.LANES.items():
                own = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": nothing, "PYTHONHASHSEED": "0", "SEASTAR_LANES": lanes}
                command = [sys.executable, "-m", "seastar_gym.cli.shipped", level, self._folder.name, *ids]
                running.append(subprocess.Popen(command, env=others | own, cwd=nothing))
            codes = [each.wait() for each in running]
            if any(codes):
                raise RuntimeError("The machine code of the wheel could not be compiled.")
        build_data["force_include"][self._folder.name] = "seastar_gym/compiled"
        build_data["pure_python"] = False
        python = f"cp{sys.version_info[0]}{sys.version_info[1]}"
        build_data["tag"] = f"{python}-{python}-manylinux_2_28_x86_64"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the files."""
        if version != "editable":
            self._folder.cleanup()
