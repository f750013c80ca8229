"""Measurements of the simulator and of learning: `python -m studies` lists them, `python -m studies NAME` runs one.

They need the extra `studies`, those of `learning` also the extra `train`.
"""

import os
import sys

from seastar_gym.extras import is_command, require_extra

require_extra("The studies", "studies", "matplotlib", "rich", "tqdm", "tyro")


def run_as_study(words: list[str]) -> None:
    """Run `python -m studies.NAME` as `python -m studies NAME`. words: Of the command line."""
    at = words.index("-m") + 1
    os.execv(sys.executable, [*words[:at], "studies", words[at].removeprefix("studies."), *words[at + 1 :]])


if is_command() and any(word.startswith("studies.") for word in sys.orig_argv):
    run_as_study(sys.orig_argv)
