"""Verification of the simulator against exact solutions and published codes; writes `docs/verification.md`.

The exact solutions are the elastica, the vibrating beam, quadratic drag and bending waves, for either discretisation.
Two published codes computed the chapter's straight swim. Validation would need measurements of a robot.
"""

from collections.abc import Callable
from pathlib import Path

from tqdm import tqdm

from studies.frame import Results, Study
from studies.pages import show
from studies.verification.clamped import elastica, natural_frequencies
from studies.verification.drag import quadratic_drag
from studies.verification.page import Section, as_page, as_table
from studies.verification.published import published_codes
from studies.verification.waves import bending_waves

SECTIONS: dict[str, Callable[[], Section]] = {
    "elastica": elastica,
    "frequencies": natural_frequencies,
    "drag": quadratic_drag,
    "waves": bending_waves,
    "published": published_codes,
}
"""Sections of the page by name, in their order."""
BESIDE = "\n## Beside MuJoCo"
"""What begins that part of the page which is kept: `studies.verification.mujoco` fills it."""


def run(results: Results) -> str | None:
    """Compute all sections, write the page and show it."""
    sections = [section() for section in tqdm(SECTIONS.values(), unit="section")]
    results.out.parent.mkdir(parents=True, exist_ok=True)
    before = results.out.read_text(encoding="utf-8") if results.out.exists() else ""
    results.out.write_text(as_page(sections) + "".join(before.partition(BESIDE)[1:]), encoding="utf-8")
    for section in sections:
        show(f"## {section.title}\n\n{as_table(section.rows)}")
    print(f"Written: {results.out}")
    outside = [row.quantity for section in sections for row in section.rows if not row.holds]
    return f"Outside of their bounds: {'; '.join(outside)}." if outside else None


STUDY = Study("verification", run, out=Path("docs/verification.md"))
