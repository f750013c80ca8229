"""Comparisons with references, and the page and tables that show them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Row:
    """A compared quantity, one line of the page.

    allowed: Largest |ours - reference| that the tests accept, in `unit`.
    digits: Significant digits on the page.
    """

    quantity: str
    reference: float
    ours: float
    unit: str
    allowed: float
    digits: int = 6

    @property
    def difference(self) -> float:
        """Difference ours - reference, in the row's unit."""
        return self.ours - self.reference

    @property
    def holds(self) -> bool:
        """Whether the difference is within the row's bound."""
        return abs(self.difference) <= self.allowed


@dataclass(frozen=True)
class Section:
    """Rows with one kind of reference; method: Text that says what is computed and how."""

    title: str
    method: str
    rows: list[Row]


def order_row(of: str, edge_lengths: ArrayLike, errors: ArrayLike, allowed: float, theory: float = 2.0) -> Row:
    """Row that compares the order of convergence over edge lengths [m] with that of theory."""
    order = np.polyfit(np.log(np.asarray(edge_lengths)), np.log(np.abs(np.asarray(errors))), 1)[0]
    return Row(f"order in l, {of}", theory, float(order), "", allowed, digits=3)


def as_cells(row: Row) -> tuple[str, str, str, str]:
    """Cells of a row: quantity with unit, reference, ours, and the absolute and relative difference."""
    unit = f" [{row.unit}]" if row.unit else ""
    relative = f" ({row.difference / row.reference:+.1e})" if row.unit else ""
    reference, ours = (f"{value:#.{row.digits}g}" for value in (row.reference, row.ours))
    return row.quantity + unit, reference, ours, f"{row.difference:+.1e}{relative}"


def as_page(sections: Sequence[Section]) -> str:
    """Page of all sections in Markdown."""
    lines = [
        "# Verification against exact solutions and published codes",
        "",
        "Written by `python -m studies.verification`. `tests/test_verification.py` checks each line against a bound.",
        "Robot and fluid are the chapter's unless a section says otherwise, and l is the length of an edge. Continuum",
        "and chapter are the two discretisations of a `Seastar`. The difference is ours minus the reference; in",
        "brackets it is relative to the reference.",
    ]
    for section in sections:
        lines += ["", f"## {section.title}", "", section.method, ""]
        lines += ["| quantity | reference | ours | difference |", "|---|---:|---:|---:|"]
        lines += [f"| {' | '.join(as_cells(row))} |" for row in section.rows]
    return "\n".join(lines) + "\n"
