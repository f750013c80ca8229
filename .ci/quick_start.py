"""The two quick-start command lines of README.md.

Each stands alone in a fenced code block under a comment that names it:

    <!-- quick-start: test -->
    ```bash
    one command line
    ```

`python3 .ci/quick_start.py test` prints the one called `test`, byte for byte.
"""

import re
import sys
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"
MARKER = re.compile(r"^<!-- quick-start: ([\w-]+) -->$", re.MULTILINE)
BLOCK = re.compile(r"\s*^```(?:bash|sh|console)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def quick_start_commands(readme: str) -> dict[str, str]:
    """Name and command line of every quick start in the text of a README."""
    commands: dict[str, str] = {}
    for marker in MARKER.finditer(readme):
        name = marker[1]
        block = BLOCK.match(readme, marker.end())
        lines = block[1].splitlines() if block else []
        if len(lines) != 1 or not lines[0].strip():
            raise ValueError(f"quick start '{name}' is not followed by a code block of exactly one command line")
        if name in commands:
            raise ValueError(f"quick start '{name}' appears twice")
        commands[name] = lines[0]
    return commands


def main() -> None:
    name = sys.argv[1]
    commands = quick_start_commands(README.read_text(encoding="utf-8"))
    if name not in commands:
        sys.exit(f"{README.name} has no quick start '{name}', only {sorted(commands)}")
    print(commands[name])


if __name__ == "__main__":
    main()
