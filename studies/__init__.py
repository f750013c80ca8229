"""Measurements of the simulator and of learning: `python -m studies` lists them, `python -m studies NAME` runs one.

They need the extra `studies`, that of `methods` also the extra `train`.
"""

import os
import sys

from seastar_gym.files import is_command, require_extra

require_extra("The studies", "studies", "matplotlib", "rich", "tqdm", "tyro")


# `python -m studies.NAME` is `python -m studies NAME`
at = sys.orig_argv.index("-m") + 1 if is_command() and "-m" in sys.orig_argv else 0
if at and sys.orig_argv[at].startswith("studies."):
    name, options = sys.orig_argv[at].removeprefix("studies."), sys.orig_argv[at + 1 :]
    os.execv(sys.executable, [*sys.orig_argv[:at], "studies", name, *options])
