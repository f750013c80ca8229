"""Pictures, tables and footers of docs/ and README.md that follow from numbers which are committed there.

    python -m studies.committed

draws the pictures again and fills the pages again, from the files of numbers beside them, in a few seconds and without
running a study. `--check` changes nothing and names what is not what its numbers say. A page has tables and footers
between lines `<!-- made: NAME -->` and `<!-- end -->`; some pages are made as a whole.

Pictures whose study keeps no numbers here are in `UNCOVERED`, with the command that draws them.
"""

import json
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.command import run_command
from seastar_gym.files import write_atomically
from studies.parser import study_parser
from studies.provenance import FINAL, footer

BLOCK = re.compile(r"(<!-- made: (.+?) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
DIFFERENT, TOLERANCE = 32.0, 1e-4
"""Difference of pixels [of 255] that is seen, and the largest share of such pixels in two pictures that count as one.

Numbers may differ in the last bit between processors, which moves the edge of a line by a fraction of a pixel.
"""
UNCOVERED = {
    "convergence.png": "python -m studies.accuracy",
    "work_precision.png": "python -m studies.accuracy",
    "error_bars.png": "python -m studies.accuracy.error_bars",
    "throughput.png": "python -m studies.speed.throughput",
    "damping.png": f"python -m studies.scenes.damping, at commit {FINAL['damping.json']}",
    "fidelities.png": f"python -m studies.learning.fidelities, at commit {FINAL['fidelities.json']}",
}
"""Pictures that only their study can draw."""

# Studies are imported where something is drawn: some need torch, and this one is to run without.


def read(docs: Path, name: str) -> Any:
    """Numbers in a file."""
    return json.loads((docs / name).read_text(encoding="utf-8"))


def ablations(docs: Path, file: Path) -> None:
    """Learning curves of trainings that differ in one thing."""
    from studies.learning.ablations_page import draw

    draw(read(docs, "ablations.json"), file)


def bound(docs: Path, file: Path) -> None:
    """Speed in every direction."""
    from studies.learning.bound_page import draw

    draw(read(docs, "bound.json"), file)


def chapter(docs: Path, file: Path) -> None:
    """A figure of the chapter."""
    from studies.chapter import pictures
    from studies.chapter.kept import swims_of
    from studies.chapter.statements import PAIRS

    results = read(docs, "chapter.json")
    match file.stem:
        case "fig_13_2":
            pictures.draw_pentagon_snapshots(*swims_of(results, "pentagon"), file)
        case "fig_13_7a":
            pictures.draw_pentagon(*swims_of(results, "pentagon"), file)
        case "fig_13_8":
            pictures.draw_pairs(*swims_of(results, "pairs"), list(PAIRS), file)


def continuum(docs: Path, file: Path) -> None:
    """Errors of both discretisations over the nodes."""
    from studies.continuum.study import draw, rows_of

    draw(rows_of(read(docs, "continuum.json")), file)


def gaits(which: str) -> Callable[[Path, Path], None]:
    """A picture of the study of gaits."""

    def drawn(docs: Path, file: Path) -> None:
        from studies.gaits import pictures

        getattr(pictures, f"draw_{which}")(read(docs, "gaits.json"), file)

    return drawn


def heading(docs: Path, file: Path) -> None:
    """Time and energy over the demanded turn."""
    from studies.learning.heading_page import draw

    draw(read(docs, "heading.json"), file)


def in_time(docs: Path, file: Path) -> None:
    """Seconds round the pentagon over heat."""
    from studies.learning.in_time.pictures import draw

    draw(read(docs, "in_time.json")["runs"], file)


def limbs(docs: Path, file: Path) -> None:
    """Measured curvatures and their fits."""
    from studies.measurements.pictures import draw

    draw(read(docs, "limbs.json"), file)


def pentagon(docs: Path, file: Path) -> None:
    """Ways round the pentagon."""
    from studies.learning.traces import draw

    draw(read(docs, "pentagon.json"), file)


def ringing(docs: Path, file: Path) -> None:
    """What damped ringing costs."""
    from studies.accuracy.ringing import draw

    draw(read(docs, "ringing.json"), file)


def stability(docs: Path, file: Path) -> None:
    """A picture of the atlas."""
    from studies.stability.cases import STEPS, SWEEPS
    from studies.stability.pictures import draw
    from studies.stability.study import from_data

    results = read(docs, "stability.json")
    draw(from_data(results), SWEEPS, STEPS, results["scheme"], file)


def tasks(docs: Path, file: Path) -> None:
    """Means and intervals of all agents on the tasks."""
    from studies.tasks.page import draw
    from studies.tasks.rows import rows_of
    from studies.tasks.study import IDS

    draw(rows_of(read(docs, "tasks.json"), IDS), file)


def designs(docs: Path, file: Path) -> None:
    """Speed over what varies."""
    from studies.designs.pictures import draw

    draw(read(docs, "designs.json"), file)


def hub(docs: Path, file: Path) -> None:
    """Speed over the share of the mass in the hub."""
    from studies.designs.hub import draw

    draw(read(docs, "hub.json"), file)


def validation(docs: Path, file: Path) -> None:
    """Measured over predicted speeds."""
    from studies.validation.pictures import draw

    draw(read(docs, "validation.json"), file)


def work_precision_problems(docs: Path, file: Path) -> None:
    """Error over processor time on six robots."""
    from studies.accuracy.work_precision_page import draw

    draw(read(docs, "work_precision.json"), file)


PICTURES: dict[str, Callable[[Path, Path], None]] = {
    "ablations.png": ablations,
    "bound.png": bound,
    "continuum.png": continuum,
    "fig_13_2.png": chapter,
    "fig_13_7a.png": chapter,
    "fig_13_8.png": chapter,
    "designs.png": designs,
    "gaits_directions.png": gaits("directions"),
    "gaits_front.png": gaits("front"),
    "gaits_lag.png": gaits("lag"),
    "heading.png": heading,
    "hub.png": hub,
    "in_time.png": in_time,
    "limbs.png": limbs,
    "pentagon.png": pentagon,
    "ringing.png": ringing,
    "stability_error.png": stability,
    "stability_iterations.png": stability,
    "stability_needs.png": stability,
    "tasks.png": tasks,
    "validation.png": validation,
    "work_precision_problems.png": work_precision_problems,
}
"""How a picture is drawn from the numbers in a folder, into a file."""


def table(docs: Path, name: str) -> str:
    """Tables in Markdown, by the name that a page gives them."""
    match name.split():
        case ["footer", file]:
            return footer(read(docs, file), file)
        case ["ablations"]:
            from studies.learning import ablations_page

            return ablations_page.table(read(docs, "ablations.json"))
        case ["certificates"]:
            from studies.designs import certificates

            return certificates.table(read(docs, "certificates.json"))
        case ["chapter", part]:
            from studies.chapter import kept

            return str(getattr(kept, f"{part}_table")(read(docs, "chapter.json")))
        case ["designs", part]:
            from studies.designs import pictures

            return str(getattr(pictures, part)(read(docs, "designs.json")))
        case ["contracts"]:
            from studies import contracts

            return contracts.contracts()
        case ["environments"]:
            from studies import contracts

            return contracts.registered()
        case ["gaits", *part]:
            from studies.gaits import pages

            return pages.parts(read(docs, "gaits.json"))[" ".join(part)]
        case ["heading"]:
            from studies.learning import heading_page

            return heading_page.table(read(docs, "heading.json"))
        case ["in_time"]:
            from studies.learning.in_time.tables import as_markdown

            return as_markdown(read(docs, "in_time.json")["runs"])
        case ["leaderboard"]:
            from seastar_gym.benchmark import page, results

            return page.table(results.read(docs / "leaderboard" / "results.json"))
        case ["errors" | "choosing" | "presets" | "timed" | "timed_paths" as name]:
            from studies.accuracy import page as accuracy_page

            return str(getattr(accuracy_page, name)())
        case ["promises"]:
            from studies.accuracy import promises

            return promises.table(read(docs, "promises.json"))
        case ["sweeps"]:
            from studies.speed import sweeps

            return sweeps.table(read(docs, "sweeps.json"))
        case ["ringing"]:
            from studies.accuracy import ringing

            return ringing.table(read(docs, "ringing.json"))
        case ["stability"]:
            from studies.stability import study as atlas
            from studies.stability.cases import SWEEPS

            return atlas.as_markdown(atlas.summarise(atlas.from_data(read(docs, "stability.json")), SWEEPS))
        case ["validation"]:
            from studies.validation import laws

            return laws.table(read(docs, "validation.json"))
    raise ValueError(f"No table is called {name!r}.")


def filled(docs: Path, text: str) -> str:
    """A page with its blocks filled."""
    return BLOCK.sub(lambda found: f"{found[1]}\n{table(docs, found[2]).strip()}\n\n{found[4]}", text)


def whole_pages(docs: Path) -> dict[str, str]:
    """Pages that are made as a whole."""
    from studies.accuracy.work_precision_page import as_page
    from studies.continuum.study import as_markdown as errors_of_space
    from studies.scenes import gallery
    from studies.tasks.page import page
    from studies.tasks.study import IDS, has_cell

    return {
        "continuum.md": errors_of_space(read(docs, "continuum.json")),
        "gallery.md": gallery.page(read(docs, "gallery.json")),
        "tasks.md": page(read(docs, "tasks.json"), IDS, docs / "tasks.png", has_cell),
        "work_precision.md": as_page(read(docs, "work_precision.json"), "work_precision_problems.png"),
    }


def pages(docs: Path) -> Iterator[tuple[Path, str]]:
    """Pages that have made parts, and what they should be."""
    for name, text in whole_pages(docs).items():
        yield docs / name, text
    for file in sorted([*docs.glob("*.md"), *docs.parent.glob("README.md")]):
        text = file.read_text(encoding="utf-8")
        if BLOCK.search(text):
            yield file, filled(docs, text)


def is_drawn_so(docs: Path, name: str) -> bool:
    """Whether a picture is the one that its numbers give."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        new = Path(folder) / name
        PICTURES[name](docs, new)
        one, other = (np.asarray(Image.open(file).convert("RGB"), dtype=float) for file in (new, docs / name))
    return one.shape == other.shape and bool(np.mean(np.abs(one - other).max(axis=2) > DIFFERENT) < TOLERANCE)


def stale(docs: Path) -> list[str]:
    """Names of pictures and pages that are not what their numbers say."""
    wrong = [name for name in PICTURES if not is_drawn_so(docs, name)]
    return wrong + [file.name for file, text in pages(docs) if file.read_text(encoding="utf-8") != text]


def main() -> int:
    """Command line: make everything anew, or check it; returns the exit code."""
    parser = study_parser("studies.committed", __doc__)
    parser.add_argument("--docs", type=Path, default=Path("docs"), help="folder of the pages (default: %(default)s)")
    parser.add_argument("--check", action="store_true", help="change nothing, name what is not what its numbers say")
    parser.add_argument("--only", nargs="*", choices=sorted(PICTURES), metavar="PICTURE", help="draw these only")
    options = parser.parse_args()
    if options.check:
        wrong = stale(options.docs)
        print("\n".join(wrong) if wrong else "Everything is what its numbers say.")
        return int(bool(wrong))
    for name in PICTURES if options.only is None else options.only:
        PICTURES[name](options.docs, options.docs / name)
    for file, text in list(pages(options.docs)) if options.only is None else ():
        write_atomically(file, text.encode())
    return 0


if __name__ == "__main__":
    run_command(main)
