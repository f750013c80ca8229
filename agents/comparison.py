"""Comparison at the end of a training: swims round the pentagon of what was learned and of its rival.

The film of the rival is made by a process of its own while the policy is trained.
"""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import seastar_gym
from agents.options import Options
from agents.run import Robot, physics
from seastar_gym.controllers.contract import Policy, actions_of, require_fit
from seastar_gym.controllers.open_loop import scripted
from seastar_gym.controllers.registry import load_agents
from seastar_gym.envs.commands import MOST_LIMBS
from seastar_gym.evaluation.comparison import evaluate
from seastar_gym.evaluation.report import Remarks
from seastar_gym.process import processors
from seastar_gym.scene import Scene


def compare(
    agents: Mapping[str, Policy],
    options: Options,
    robot: Robot,
    remarks: Remarks,
    folder: Path,
    filmed: Mapping[str, Callable[[], Path | None]] | None = None,
) -> None:
    """Compare agents round the pentagon: table, CSV, picture, videos and report, in `evaluation` within a folder.

    options, robot: Of the run. remarks: Of the report. filmed: See `evaluate`.
    """
    evaluate(
        agents,
        "pentagon",
        max_strokes=options.limit(robot.scene),
        decision_period=options.ppo.decision_period,
        scene=robot.scene,
        fidelity=robot.fidelity(options),
        video=options.video,
        filmed=filmed,
        report=remarks,
        out=folder / "evaluation",
    )
    print(f"Report:  {folder / 'evaluation' / 'report.html'}\nPolicy:  {folder / 'policy.safetensors'}")


def rival_of(decision_period: float | None, scene: Scene | None = None) -> str | None:
    """Name of the agent that a policy is compared with for a time between decisions [s]; None if there is none.

    The fastest scripted gait round the pentagon: in a timed environment the lagged one, where decisions allow it.
    Gaits are for five limbs; for other numbers of limbs it is the greedy agent.
    """
    for name in ("lagged-pentagon", "pentagon"):
        with suppress(ValueError):  # the gait needs other decisions, or another robot
            gait = scripted(name, decision_period=decision_period)
            if scene is not None:
                require_fit(gait, scene, actions_of(gait, scene.robot.n_limbs), decision_period)
            return name
    n_limbs = 5 if scene is None else scene.robot.n_limbs
    return "greedy" if n_limbs != 5 and n_limbs <= MOST_LIMBS else None


def rivals(decision_period: float | None, scene: Scene | None = None) -> dict[str, Policy]:
    """That agent by its name in the comparison, a gait as "script"; {} if there is none."""
    name = rival_of(decision_period, scene)
    if name is None:
        return {}
    (policy,) = load_agents([name], decision_period=decision_period, scene=scene).values()
    return {name if name == "greedy" else "script": policy}


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
