"""Minari datasets of the tasks, of three qualities: random actions, the greedy rule, and a learned policy.

    python -m studies.tasks.data --episodes 100

The learned policy is the one in the box. A dataset that is there is not made again, so the command goes on where it
stopped. Read them with MINARI_DATASETS_PATH=OUT, under the names TASK/random-v0, TASK/greedy-v0 and TASK/learned-v0.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from seastar_gym import TASKS
from seastar_gym.controllers.learned import load
from seastar_gym.data.command import name_of, write_to
from seastar_gym.data.dataset import summary, swim_once, write
from seastar_gym.data.recorder import Episode, Recorder
from seastar_gym.extras import require_extra
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Results, Study
from studies.tasks.controllers import make_controller
from studies.tasks.episodes import Agent, Batch, Info, make_batch

QUALITIES = ("random", "greedy", "learned")


@dataclass(frozen=True)
class Options:
    """Minari datasets of the tasks, of three qualities."""

    ids: tuple[str, ...] = tuple(TASKS)
    """Environments."""
    qualities: tuple[str, ...] = QUALITIES
    """Qualities: random, greedy, learned."""
    episodes: int = 100
    """Episodes of every dataset, of the split "train", with the seeds 0, 1, ..."""
    seed: int = 0
    """Seed of the random actions."""
    fidelity: Fidelity = "fast"
    """Accuracy of the simulation."""
    num_threads: int | None = None
    """Threads of the simulator; by default one for every processor."""
    out: Path = Path("runs/data")
    """Folder of the datasets."""

    def __post_init__(self) -> None:
        require_count("episodes", self.episodes, 1, 100_000)
        for kind, asked, known in (("task", self.ids, tuple(TASKS)), ("quality", self.qualities, QUALITIES)):
            if unknown := set(asked) - set(known):
                raise ValueError(f"Unknown {kind} {min(unknown)!r}: choose of {', '.join(known)}.")


class Random:
    """Agent that draws actions uniformly."""

    def __init__(self, batch: Batch, seed: int):
        self._space = batch.action_space
        self._space.seed(seed)

    def act(self, observations: NDArray[np.float32], info: Info) -> NDArray[np.int64]:
        """Actions of all robots."""
        return np.asarray(self._space.sample())


def agent_of(quality: str, id: str, recorder: Recorder, options: Options) -> tuple[Batch, Agent]:
    """Agent of a quality, and the batch that it sees."""
    if quality == "random":
        return recorder, Random(recorder, options.seed)
    if quality == "greedy":
        return recorder, make_controller("greedy", recorder)
    from agents.tasks.command import file_of
    from studies.tasks.learning import Trained

    return recorder, cast(Agent, Trained(load(file_of(id))))


def record(id: str, quality: str, options: Options) -> list[Episode]:
    """Episodes of a task, each from its reset to its end."""
    recorder = Recorder(make_batch(id, options.episodes, "train", options.fidelity, options.num_threads))
    batch, agent = agent_of(quality, id, recorder, options)
    swim_once(batch, recorder, agent.act, list(range(options.episodes)))
    recorder.close()
    return recorder.episodes(only_first=True)


def make_datasets(options: Options) -> None:
    """Write the datasets that are missing; says a line on each."""
    import minari

    write_to(options.out)
    there = minari.list_local_datasets()
    for id in options.ids:
        for quality in options.qualities:
            name = name_of(id, quality)
            if name in there:
                print(f"{name} is there already.")
                continue
            episodes = record(id, quality, options)
            write(
                episodes, name, id, quality, "Written by python -m studies.tasks.data", split="train",
                fidelity=options.fidelity,
            )  # fmt: skip
            print(f"{name}: {summary(episodes)}", flush=True)


def run(options: Options, _: Results) -> None:
    """Write the datasets that are missing."""
    require_extra("Datasets", "data", "minari", "h5py")
    make_datasets(options)


STUDY = Study("tasks.data", run, Options)
