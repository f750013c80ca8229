"""Pictures, tables and footers of docs/ and README.md that follow from numbers which are committed there.

A page has tables and footers between lines `<!-- made: NAME -->` and `<!-- end -->`.
"""

import json
import re
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markdown import Markdown

from seastar_gym.files import write_atomically
from studies.frame import RESULTS, Study
from studies.provenance import footer

BLOCK = re.compile(r"(<!-- made: (.+?) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
DIFFERENT, TOLERANCE = 32.0, 1e-4
"""Difference of pixels [of 255] that is seen, and the largest share of such pixels in two pictures that count as one.

Numbers may differ in the last bit between processors, which moves the edge of a line by a fraction of a pixel.
"""


def read(file: Path) -> Any:
    """Numbers in a file."""
    return json.loads(file.read_text(encoding="utf-8"))


def numbers(docs: Path, study: Study) -> Any:
    """Numbers of a study, if it keeps any."""
    return read(study.committed(docs, study.file)) if study.file else {}


def told(docs: Path, studies: Sequence[Study]) -> list[Study]:
    """Studies whose numbers are in the folder, or that keep none."""
    return [study for study in studies if not study.file or study.committed(docs, study.file).exists()]


def markdown(head: Sequence[object], rows: Iterable[Sequence[object]], texts: Collection[int] = (0,)) -> str:
    """Table in Markdown. texts: Columns that hold texts; others hold numbers, which stand on the right."""
    rule = "|".join("---" if column in texts else "---:" for column in range(len(head)))
    first, *others = (f"| {' | '.join(map(str, line))} |" for line in (head, *rows))
    return "\n".join([first, f"|{rule}|", *others])


def show(text: str, title: str = "") -> None:
    """Print Markdown as tables that a terminal shows, below a title."""
    Console().print(Markdown(f"{title}:\n\n{text}" if title else text))


def footer_of(docs: Path, names: str) -> str:
    """Footer of numbers in files of docs/results/, whose names have spaces between them."""
    return footer({name: read(docs / RESULTS / name) for name in names.split()})


def tables(docs: Path, studies: Sequence[Study]) -> dict[str, Callable[[], str]]:
    """How the blocks of pages are filled that are of these studies, by their names."""

    def filling(study: Study, text: Callable[[Any], str]) -> Callable[[], str]:
        return lambda: text(numbers(docs, study))

    found = {name: filling(study, text) for study in studies for name, text in study.tables.items()}
    texts = (file.read_text(encoding="utf-8") for file in docs.glob("*.md"))
    footers = {name for text in texts for _, name, *_ in BLOCK.findall(text) if name.startswith("footer ")}
    return found | {name: partial(footer_of, docs, name.removeprefix("footer ")) for name in footers}


def filled(text: str, blocks: dict[str, Callable[[], str]], of_all: bool = True) -> str:
    """A page with its blocks filled. of_all: Whether the blocks are of all studies: others are an error, then."""

    def fill(block: re.Match[str]) -> str:
        if block[2] in blocks:
            return f"{block[1]}\n{blocks[block[2]]().strip()}\n\n{block[4]}"
        if of_all:
            raise ValueError(f"No table is called {block[2]!r}.")
        return block[0]

    return BLOCK.sub(fill, text)


def pages(docs: Path, studies: Sequence[Study]) -> Iterator[tuple[Path, str]]:
    """Pages that these studies fill, and what they should be."""
    blocks = tables(docs, studies)
    for file in sorted([*docs.glob("*.md"), *docs.parent.glob("README.md")]):
        text = file.read_text(encoding="utf-8")
        if BLOCK.search(text):
            yield file, filled(text, blocks, len(studies) > 1)


def is_drawn_so(docs: Path, study: Study, name: str) -> bool:
    """Whether a picture is the one that its numbers give."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        new = Path(folder) / name
        study.pictures[name](numbers(docs, study), new)
        files = new, study.committed(docs, name)
        one, other = (np.asarray(Image.open(file).convert("RGB"), dtype=float) for file in files)
    return one.shape == other.shape and bool(np.mean(np.abs(one - other).max(axis=2) > DIFFERENT) < TOLERANCE)


def stale(docs: Path, studies: Sequence[Study]) -> list[str]:
    """Names of pictures and pages that are not what their numbers say."""
    wrong = [name for study in told(docs, studies) for name in study.pictures if not is_drawn_so(docs, study, name)]
    return wrong + [file.name for file, text in pages(docs, studies) if file.read_text(encoding="utf-8") != text]


def check(docs: Path, studies: Sequence[Study]) -> int:
    """Print what is stale; returns the exit code."""
    wrong = stale(docs, studies)
    print("\n".join(wrong) if wrong else "Everything is what its numbers say.")
    return int(bool(wrong))


def draw(docs: Path, studies: Sequence[Study]) -> int:
    """Draw the pictures and fill the pages again; returns the exit code."""
    for study in told(docs, studies):
        study.write(numbers(docs, study), study.committed(docs, study.file).parent)
    fill(docs, studies)
    return 0


def fill(docs: Path, studies: Sequence[Study]) -> None:
    """Fill the pages that have blocks of these studies."""
    for file, text in list(pages(docs, studies)):
        write_atomically(file, text.encode())
