"""Small films of every task, for the page of the environments.

The agent "adaptive", which remembers, swims the first held-out episode, or "planner" where nothing is hidden. A film
has a picture every BETWEEN seconds of the robot's time and shows FPS of them a second.
"""

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym import TASKS
from seastar_gym.evaluation.films import Picture, shrunk, write_gif
from seastar_gym.evaluation.rollout import Info
from seastar_gym.evaluation.tasks import make_batch
from studies.frame import Results, Study, require_known
from studies.tasks.ahead import Robots
from studies.tasks.controllers import is_swum, make_controller
from studies.tasks.episodes import rollout_of

BETWEEN = 2.0
"""Simulated time between two pictures [s]."""
FPS = 10
REST = 10
"""Pictures for which a film rests on its end."""
LONGEST = 120.0
"""Simulated time after which a film ends [s]."""


def file_name(id: str) -> str:
    """Name of the film of a task, such as miswired_timed.gif for SeastarMiswiredTimed-v0."""
    short = id.removeprefix("Seastar").removesuffix("-v0")
    return f"{short.removesuffix('Timed').lower()}{'_timed' if short.endswith('Timed') else ''}.gif"


def swimmer(batch: Any) -> str:
    """Name of the agent that a film shows."""
    return "adaptive" if is_swum("adaptive", Robots(batch).inner.challenge) else "planner"


def pictures(id: str) -> list[Picture]:
    """Pictures of the first held-out episode of a task."""
    batch: Any = make_batch(id, 1, 1, split="test", fidelity="fast", render_mode="rgb_array")
    decision_period = TASKS[id][2]
    every, numbers, film = round(BETWEEN / decision_period), itertools.count(), list[Picture]()

    def look(info: Info) -> None:
        if next(numbers) % every == 0:
            film.append(shrunk(batch.render()[0]))

    found = rollout_of(
        batch, make_controller(swimmer(batch), batch), look, seeds=0,
        options={"instance": np.array([0])}, until=round(LONGEST / decision_period),
    )  # fmt: skip
    if found.decisions[0] % every:
        film.append(shrunk(batch.render()[0]))
    batch.close()
    return film


@dataclass(frozen=True)
class Options:
    """Films of the tasks."""

    tasks: tuple[str, ...] = tuple(TASKS)
    """Environments."""

    def __post_init__(self) -> None:
        require_known("task", self.tasks, TASKS)


def run(options: Options, results: Results) -> None:
    """Write the films."""
    for id in options.tasks:
        film = pictures(id)
        write_gif(film + film[-1:] * REST, results.folder / file_name(id), FPS)
        print(f"Written: {results.out / file_name(id)}, {len(film)} pictures.", flush=True)


STUDY = Study("tasks.films", run, Options, out=Path("docs/gallery"))
