"""What the results of the tasks say, in words: which are kept, and where the bundled policies are ahead."""

import textwrap
from collections.abc import Sequence

from studies.tasks.rows import LEFT, Row

RULES = ("rest", "greedy", "planner", "adaptive")
"""Agents that neither learn nor are told what is hidden."""
BUNDLED, MEMORY, TOLD = "bundled", "PPO, memory", "informed"


def verdicts(rows: Sequence[Row]) -> str:
    """Paragraphs of the page in Markdown; those for which agents have not swum yet are left out."""
    judged = [row for row in rows if {"greedy", "informed", "PPO"} <= row.agents.keys()]
    boxed = [row for row in rows if {BUNDLED, MEMORY, *RULES[:3]} <= row.agents.keys()]
    paragraphs = [_kept(judged)] * bool(judged) + [_in_the_box(boxed)] * bool(boxed)
    return "\n\n".join(textwrap.fill(each, 120, break_on_hyphens=False) for each in paragraphs)


def _kept(rows: Sequence[Row]) -> str:
    dropped = [row for row in rows if not row.is_kept]
    text = f"{len(rows) - len(dropped)} of {len(rows)} tasks are kept."
    if dropped:
        text += f" Not kept: {'; '.join(map(_why_not, dropped))}."
    return text


def _why_not(row: Row) -> str:
    if row.left < LEFT:
        return f"{_name(row)}, where PPO leaves {100.0 * row.left:.0f} % of the gap"
    return f"{_name(row)}, whose bound is only {100.0 * row.headroom:.0f} % better than greedy"


def _in_the_box(rows: Sequence[Row]) -> str:
    trained = sum(row.is_ahead(BUNDLED, MEMORY) for row in rows)
    ahead = [row for row in rows if row.is_ahead(BUNDLED, *RULES)]
    also = [row for row in ahead if row.is_ahead(BUNDLED, TOLD)]
    return (
        f"Six times the training is worth more than a frame stack alone on {trained} of {len(rows)} tasks. Bundled "
        f"policies beat every rule that is not told what is hidden on {_names(ahead)}, and also the one that is told "
        f"on {_names(also)}. Elsewhere rules that remember or plan are ahead."
    )


def _name(row: Row) -> str:
    return f"`{row.id.removeprefix('Seastar').removesuffix('-v0')}`"


def _names(rows: Sequence[Row]) -> str:
    *most, last = [_name(row) for row in rows] or ["no task"]
    return f"{', '.join(most)} and {last}" if most else last
