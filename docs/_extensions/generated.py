"""What pages do not say themselves: references from docstrings, new pages.

A page has a line `<!-- site: NAME words -->`, which GitHub does not show, and the site has what the function NAME of
GENERATORS makes of the words, in Markdown.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from reference import names, public
from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parents[1]
MARKER = re.compile(r"^<!-- site: (\w+) ?(.*?) -->$", re.MULTILINE)


def more_pages() -> str:
    """Contents of the pages that index.md does not name, so that a new page comes in by itself."""
    named = (DOCS / "index.md").read_text(encoding="utf-8").splitlines()
    pages = [page.stem for page in sorted(DOCS.glob("*.md")) if page.stem not in {"index", *named}]
    return "\n".join(["```{toctree}", ":hidden:", ":caption: More", "", *pages, "```"]) if pages else ""


GENERATORS: dict[str, Callable[..., str]] = {
    "more_pages": more_pages,
    "names": names,
    "public": public,
}


def generate(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the markers of a page."""
    source[0] = MARKER.sub(lambda marker: GENERATORS[marker[1]](*marker[2].split()), source[0])


def pages_with_markers(app: Sphinx, *known: object) -> list[str]:
    """Pages that are always read anew: what they show stands in other files."""
    return [page.stem for page in DOCS.glob("*.md") if MARKER.search(page.read_text(encoding="utf-8"))]


def setup(app: Sphinx) -> dict[str, Any]:
    """Fill every page when it is read."""
    app.connect("source-read", generate)
    app.connect("env-get-outdated", pages_with_markers)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
