"""Tables and footers of docs/ and README.md, which stand between lines `<!-- made: NAME -->` and `<!-- end -->`."""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from studies.frame import DOCS, Study

BLOCK = re.compile(r"(<!-- made: (.+?) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def markdown(head: Sequence[object], rows: Iterable[Sequence[object]], texts: Collection[int] = (0,)) -> str:
    """Table in Markdown. texts: Columns that hold texts; others hold numbers, which stand on the right."""
    rule = "|".join("---" if column in texts else "---:" for column in range(len(head)))
    first, *others = (f"| {' | '.join(map(str, line))} |" for line in (head, *rows))
    return "\n".join([first, f"|{rule}|", *others])


def numbers(docs: Path, study: Study) -> Any:
    """Numbers of a study in docs/, if it keeps any."""
    return json.loads((docs / "results" / study.file).read_text("utf-8")) if study.file else {}


def show(text: str, title: str = "") -> None:
    """Print a table below a title."""
    print(f"{title}:\n\n{text}\n" if title else f"{text}\n")


def content(name: str, studies: Sequence[Study]) -> str:
    """What a block holds: the table of that name, or the footer of files in docs/results/."""
    kind, *files = name.split()
    made = {study.file: f"python -m studies.{study.name}" for study in studies}
    if kind == "footer" and not set(files) - set(made):
        return f"*Numbers: {'; '.join(f'[{Path(n).name}](results/{n}) by `{made[n]}`' for n in files)}.*"
    for study in studies:
        if name in study.tables:
            return study.tables[name](numbers(DOCS, study)).strip()
    raise ValueError(f"No study makes {name!r}.")


def stale(studies: Sequence[Study]) -> Iterator[tuple[Path, str]]:
    """Pages that are not what the numbers in docs/results/ say, and what they should be."""
    for file in sorted([*DOCS.glob("*.md"), DOCS.parent / "README.md"]):
        text = file.read_text("utf-8")
        wanted = BLOCK.sub(lambda found: f"{found[1]}\n{content(found[2], studies)}\n\n{found[4]}", text)
        if wanted != text:
            yield file, wanted
