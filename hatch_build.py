"""What a package index shows: README with absolute links, and the addresses of the project.

README's links are relative, so that they lead somewhere in a checkout. A package index has no files beside it. So the
description of a wheel gets absolute ones, once `repository` in pyproject.toml (`[tool.hatch.metadata.hooks.custom]`) is
the address on GitHub. Until then it is empty, links stay as they are, and `python .ci/contents.py dist --release` says
so.
"""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

RELATIVE = re.compile(r"(!?)(\[[^\]]*\])\((?!\w+:|#)([^)\s]+)\)")


def with_absolute_links(text: str, repository: str, version: str) -> str:
    """Markdown whose relative links and pictures lead to files of a version on GitHub; unchanged without address."""
    if not repository:
        return text

    def absolute(link: re.Match[str]) -> str:
        return f"{link[1]}{link[2]}({repository}/{'raw' if link[1] else 'blob'}/v{version}/{link[3]})"

    return RELATIVE.sub(absolute, text)


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
