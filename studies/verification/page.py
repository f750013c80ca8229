"""Comparisons with references, and the page and tables that show them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from studies.pages import markdown


@dataclass(frozen=True)
class Row:
    """A compared quantity, one line of the page.

    allowed: Largest |ours - reference| that the tests accept, in `unit`.
    digits: Significant digits on the page. shown: Whether the page shows the row; the command shows all.
    """

    quantity: str
    reference: float
    ours: float
    unit: str
    allowed: float
    digits: int = 6
    shown: bool = True

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


INTRODUCTION = """# Verification: exact solutions, published codes, MuJoCo

The simulator agrees with beam theory, drag laws and two published codes: limbs under load to 0.4 % of their deflection
with ten nodes, their first frequency to 0.05 %, the chapter's swim to 4e-8 mm. Errors fall with the order that theory
gives.

`python -m studies.verification` shows every comparison and writes this page, which has a part of them;
`tests/test_verification.py` holds each to a bound. Robot and fluid are the chapter's, l is the length of an edge, and
*continuum* and *chapter* are the [two discretisations](model.md#two-discretisations). A difference is ours minus the
reference; in brackets, over the reference.
"""


def as_page(sections: Sequence[Section]) -> str:
    """Page of the rows that it shows in Markdown."""
    parts = [INTRODUCTION]
    for section in sections:
        parts.append(f"## {section.title}\n\n{section.method}\n")
        parts.append(f"{as_table([row for row in section.rows if row.shown])}\n")
    return "\n".join(parts)


def as_table(rows: Sequence[Row]) -> str:
    """Rows as a table in Markdown."""
    return markdown(["quantity", "reference", "ours", "difference"], map(as_cells, rows))
