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
from studies.tasks.controllers import CONTROLLERS, is_swum, make_controller
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
    """Name of the agent that a film shows unless another one is asked for."""
    return "adaptive" if is_swum("adaptive", Robots(batch).inner.challenge) else "planner"


def pictures(id: str, agent_name: str | None, longest: float = LONGEST, instance: int = 0) -> list[Picture]:
    """Pictures of an episode; agent_name: None means `swimmer`. longest: Simulated time [s]."""
    batch: Any = make_batch(id, 1, 1, split="test", fidelity="fast", render_mode="rgb_array")
    decision_period = TASKS[id][2]
    every, numbers, film = round(BETWEEN / decision_period), itertools.count(), list[Picture]()

    def look(info: Info) -> None:
        if next(numbers) % every == 0:
            film.append(shrunk(batch.render()[0]))

    found = rollout_of(
        batch, make_controller(agent_name or swimmer(batch), batch), look, seeds=0,
        options={"instance": np.array([instance])}, until=round(longest / decision_period),
    )  # fmt: skip
    if found.decisions[0] % every:
        film.append(shrunk(batch.render()[0]))
    batch.close()
    return film


@dataclass(frozen=True)
class Options:
    """Films of the tasks."""

    ids: tuple[str, ...] = tuple(TASKS)
    """Environments."""
    agent: str | None = None
    """Who swims; "adaptive", or "planner", by default."""
    seconds: float = LONGEST
    """Longest film, simulated [s]."""
    instance: int = 0
    """Number of the episode."""
    out: Path = Path("docs/gallery")
    """Folder."""

    def __post_init__(self) -> None:
        require_known("task", self.ids, TASKS)
        require_known("agent", [self.agent] if self.agent else [], CONTROLLERS)


def run(options: Options, _: Results) -> None:
    """Write the films."""
    options.out.mkdir(parents=True, exist_ok=True)
    for id in options.ids:
        film = pictures(id, options.agent, options.seconds, options.instance)
        write_gif(film + film[-1:] * REST, options.out / file_name(id), FPS)
        print(f"Written: {options.out / file_name(id)}, {len(film)} pictures.", flush=True)


STUDY = Study("tasks.films", run, Options)
