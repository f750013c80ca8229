"""The film of the agent that a policy is compared with: a process of its own makes it while the policy is trained."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import seastar_gym
from agents.training.options import Options
from agents.training.robot import physics
from seastar_gym.processors import processors

LOWEST = 19
"""Priority of the process: it takes what the training leaves of the processors."""


@contextmanager
def filmed_beside(agent: str | None, options: Options, folder: Path) -> Iterator[Callable[[], Path | None]]:
    """Context in which `seastar evaluate` films an agent round the pentagon, beside whatever else is done.

    Gives a function that waits for the film and returns its file, which is there until the context ends; None where
    there is none: no film or agent was asked for, there is one processor only, or no process could be made or it was
    lost.

    agent: Its name, None for none. folder: Of the run with these options.
    """
    if agent is None or not options.video or processors() < 2:
        yield lambda: None
        return
    with tempfile.TemporaryDirectory(prefix="seastar-film-", ignore_cleanup_errors=True) as place:
        words = ["--agents", agent, *physics(options, folder.resolve()), "--seconds", str(options.seconds)]
        process = _begun([*words, "--video", "--out", place])

        def film() -> Path | None:
            file = Path(place, f"{agent}.mp4")
            return file if process is not None and process.wait() == 0 and file.is_file() else None

        try:
            yield film
        finally:
            _end(process)


def _begun(options: list[str]) -> subprocess.Popen[bytes] | None:
    """Process of `seastar evaluate` with its own session, which Ctrl-C does not reach; None if there can be none."""
    command = [sys.executable, "-m", "seastar_gym.cli", "evaluate", *options]
    nowhere, root = subprocess.DEVNULL, Path(seastar_gym.__file__).parents[1]
    try:
        process = subprocess.Popen(
            command, cwd=root, stdin=nowhere, stdout=nowhere, stderr=nowhere, start_new_session=True
        )
    except OSError:
        return None
    with suppress(OSError):  # it has ended
        os.setpriority(os.PRIO_PROCESS, process.pid, LOWEST)
    return process


def _end(process: subprocess.Popen[bytes] | None) -> None:
    """End a process, with those that it started, if it has not ended."""
    if process is not None and process.poll() is None:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
