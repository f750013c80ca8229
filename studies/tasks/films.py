"""Small films of every task, for the page of the environments.

The agent "adaptive", which remembers, swims the first held-out episode, or "planner" where nothing is hidden. A film
has a picture every BETWEEN seconds of the robot's time and shows FPS of them a second.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym import TASKS
from seastar_gym.evaluation.films import Picture, shrunk, write_gif
from studies.frame import Results, Study, require_known
from studies.tasks.ahead import Robots
from studies.tasks.controllers import CONTROLLERS, is_swum, make_controller
from studies.tasks.episodes import make_batch

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


def pictures(id: str, agent_name: str | None, longest: float = LONGEST, instance: int = 0) -> Iterator[Picture]:
    """Pictures of an episode; agent_name: None means `swimmer`. longest: Simulated time [s]."""
    batch: Any = make_batch(id, 1, "test", "fast", 1, render_mode="rgb_array")
    decision_period = TASKS[id][2]
    every = round(BETWEEN / decision_period)
    agent = make_controller(agent_name or swimmer(batch), batch)
    observations, info = batch.reset(seed=0, options={"instance": np.array([instance])})
    yield shrunk(batch.render()[0])
    for decision in range(1, round(longest / decision_period) + 1):
        observations, _, terminated, truncated, info = batch.step(agent.act(observations, info))
        is_over = bool(terminated[0] | truncated[0])
        if decision % every == 0 or is_over:
            yield shrunk(batch.render()[0])
        if is_over:
            break
    batch.close()


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
        film = list(pictures(id, options.agent, options.seconds, options.instance))
        write_gif(film + film[-1:] * REST, options.out / file_name(id), FPS)
        print(f"Written: {options.out / file_name(id)}, {len(film)} pictures.", flush=True)


STUDY = Study("tasks.films", run, Options)
