"""Summaries of the parts of a scene that fit a screen: as a line of Python, and as a table for notebooks."""

import html
from collections.abc import Iterable, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from seastar_gym.scene.checks import shown
from seastar_gym.scene.number import Unnamed, declared


def short_repr(part: Any) -> str:
    """Call that makes a part, without arguments that have their defaults; values are cut where they are long."""
    if isinstance(part, tuple) and part and all(map(is_dataclass, part)):
        inner = [short_repr(one) for one in part]
        return f"({inner[0]},) * {len(part)}" if len(part) > 1 and len(set(inner)) == 1 else f"({', '.join(inner)},)"
    if not is_dataclass(part) or isinstance(part, type):
        return shown(part)
    named = [each.name for each in fields(part) if each.compare and not _is_usual(part, each)]
    return f"{type(part).__name__}({', '.join(f'{name}={short_repr(getattr(part, name))}' for name in named)})"


def _is_usual(part: Any, each: Field[Any]) -> bool:
    """Whether a field has its default, or a value that nobody named."""
    value = getattr(part, each.name)
    usual = each.default if each.default_factory is MISSING else each.default_factory()
    return isinstance(value, Unnamed) or bool(value == usual)


def html_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table as HTML, with a title."""

    def line(cells: Sequence[str], tag: str) -> str:
        style = ' style="text-align: left; vertical-align: top"'
        return "<tr>" + "".join(f"<{tag}{style}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    lines = [line(heads, "th"), *(line(row, "td") for row in rows)]
    return f"<table><caption>{html.escape(title)}</caption>{''.join(lines)}</table>"


def scene_html(scene: Any) -> str:
    """Parts of a scene with all numbers that are set, and their units, as a table."""
    rows = [(each.name, *_kind_and_numbers(getattr(scene, each.name))) for each in fields(scene)]
    return html_table(type(scene).__name__, ("part", "kind", "numbers"), [row for row in rows if row[2]])


def _kind_and_numbers(part: Any) -> tuple[str, str]:
    if not is_dataclass(part):
        return "", "" if part in (None, ()) else short_repr(part)
    units = {name: each.number.unit for name, each in declared(part.__class__).items()}
    values = {each.name: getattr(part, each.name) for each in fields(part) if each.compare}
    return type(part).__name__, ", ".join(
        f"{name} {short_repr(value)}" + (f" {units[name]}" if units.get(name, "1") != "1" else "")
        for name, value in values.items() if value is not None and value != ()
    )  # fmt: skip
