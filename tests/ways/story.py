"""A story: what somebody who was never here types, command after command, in an empty folder and fresh processes."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
FENCED = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PROGRAMS = {
    "python": [sys.executable],
    "seastar": [sys.executable, "-m", "seastar_gym.cli"],
    "train.py": [str(ROOT / "train.py")],
}
"""What the words of a documented command stand for, in a checkout with its environment active."""


def block(page: str, *words: str) -> str:
    """The first block of a page, of any language, in which all words occur."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = [code for _, code in FENCED.findall(text) if all(word in code for word in words)]
    assert found, f"{page} has no block with {words}."
    return found[0]


def command(page: str, *words: str) -> str:
    """The first line of a page's commands in which all words occur."""
    lines = "\n".join(code for _, code in FENCED.findall((ROOT / page).read_text(encoding="utf-8"))).splitlines()
    found = [line.partition("  #")[0] for line in lines if all(word in line for word in words)]
    assert found, f"{page} has no command with {words}."
    return found[0]


class Story:
    """An empty folder in which commands are run.

    told: What the last command wrote.
    """

    def __init__(self, folder: Path):
        self.folder, self.told = folder, ""

    def has(self, name: str, text: str) -> None:
        """Write a file."""
        (self.folder / name).write_text(text, encoding="utf-8")

    def types(self, line: str, ends: int = 0, stop: Callable[[], bool] | None = None, answer: str = "") -> str:
        """Run a command line; what it writes. It ends with a status, after Ctrl-C as soon as `stop()` is true."""
        words = [part for word in shlex.split(line.replace(".venv/bin/", "")) for part in PROGRAMS.get(word, [word])]
        return self._run(words, ends, stop, answer)

    def runs(self, code: str, ends: int = 0) -> str:
        """Run Python in a fresh process; what it writes."""
        return self._run([sys.executable, "-c", code], ends, None, "")

    def _run(self, words: list[str], ends: int, stop: Callable[[], bool] | None, answer: str) -> str:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        env = {**os.environ, "PYTHONPATH": str(ROOT), "SDL_VIDEODRIVER": "dummy", "COLUMNS": "200"}
        with subprocess.Popen(words, cwd=self.folder, env=env, text=True, **pipes) as process:
            while stop is not None and process.poll() is None:
                if stop():
                    process.send_signal(signal.SIGINT)
                    break
                time.sleep(0.02)
            self.told, _ = process.communicate(answer)
        assert process.returncode == ends, f"{words} ended with {process.returncode}:\n{self.told}"
        assert "Traceback" not in self.told, self.told
        return self.told
