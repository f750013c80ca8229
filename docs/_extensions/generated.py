"""What pages do not say themselves: pages of ids and of the package's rooms, and what lists them.

A page has a line `<!-- site: NAME words -->`, which GitHub does not show, and the site has what the function NAME of
GENERATORS makes of the words, in Markdown.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import environments
import reference
from sphinx.application import Sphinx

DOCS = Path(__file__).resolve().parents[1]
MARKER = re.compile(r"^<!-- site: (\w+) ?(.*?) -->$", re.MULTILINE)
OF_CODE = re.compile(r"\[(`?)([\w-]+)\1\]\((?:\.\./)?seastar_gym/[\w/]+\.py\)")
"""Links to code under the name of an id or a class."""
OUTSIDE = re.compile(r"\]\((\.\./[\w./]+\.md)\)")
"""Links to Markdown outside of the site, which are files to it."""


def more_pages() -> str:
    """Contents of the pages that index.md does not name, so that a new page comes in by itself."""
    named = (DOCS / "index.md").read_text(encoding="utf-8").splitlines()
    pages = [page.stem for page in sorted(DOCS.glob("*.md")) if page.stem not in {"index", *named}]
    return contents(pages, ":caption: More") if pages else ""


def ids() -> str:
    """Contents of the pages of all ids."""
    return contents([f"environments/{name}" for name in environments.names()])


def rooms() -> str:
    """Table of the rooms of the reference, and contents of their pages."""
    return f"{reference.table()}\n\n{contents([f'reference/{room}' for room in reference.rooms()])}"


def contents(pages: list[str], *options: str) -> str:
    """Entries of the sidebar."""
    return "\n".join(["```{toctree}", ":hidden:", *options, "", *pages, "```"])


def nothing(*words: str) -> str:
    """Nothing: `reference` reads this line."""
    return ""


GENERATORS: dict[str, Callable[..., str]] = {
    "ids": ids,
    "more_pages": more_pages,
    "names": nothing,
    "rooms": rooms,
}


def to_page(link: re.Match[str]) -> str:
    """On the site, the page of an id or a class in place of its code, which GitHub shows."""
    name = link[2]
    return f"[`{name}`](environments/{name}.md)" if name in environments.names() else link[0]


def generate(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the markers of a page."""
    source[0] = MARKER.sub(lambda marker: GENERATORS[marker[1]](*marker[2].split()), source[0])
    if "/" not in page:
        source[0] = OUTSIDE.sub(r"](path:\1)", OF_CODE.sub(to_page, source[0]))


def pages_with_markers(app: Sphinx, *known: object) -> list[str]:
    """Pages that are always read anew: what they show stands in other files."""
    return [page.stem for page in DOCS.glob("*.md") if MARKER.search(page.read_text(encoding="utf-8"))]


def write(app: Sphinx) -> None:
    """Write the pages of ids and rooms beside the others, where git ignores them; what has not changed stays."""
    for folder, pages in {"environments": environments.pages(), "reference": reference.pages()}.items():
        place = DOCS / folder
        place.mkdir(exist_ok=True)
        for file in {*place.glob("*.md")} - {place / f"{name}.md" for name in pages}:
            file.unlink()
        for name, text in pages.items():
            file = place / f"{name}.md"
            if not file.is_file() or file.read_text(encoding="utf-8") != text:
                file.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages that are generated, and fill every page when it is read."""
    app.connect("builder-inited", write)
    app.connect("source-read", generate)
    app.connect("env-get-outdated", pages_with_markers)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
