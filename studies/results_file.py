"""Numbers of a study that are kept in docs/, as JSON that a person can read: one line for every list of numbers."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from seastar_gym.files import write_atomically

INNERMOST = re.compile(r"\[\n([^\[\]{}]*)\n\s*\]")
BREAK = re.compile(r"\n\s*")


def as_json(results: Mapping[str, Any]) -> str:
    """Plain data as JSON; ValueError where a number is not finite."""
    text = json.dumps(results, indent=1, ensure_ascii=False, allow_nan=False)
    return INNERMOST.sub(lambda found: f"[{BREAK.sub(' ', found[1]).strip()}]", text) + "\n"


def keep(results: Mapping[str, Any], file: Path) -> None:
    """Write plain data into a file, whose folder is made."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(file, as_json(results).encode())


def rounded(value: float, digits: int = 4) -> float:
    """A number with a few significant digits."""
    return float(f"{value:.{digits}g}")
