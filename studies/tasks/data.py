"""Minari datasets of the tasks, of three qualities: random actions, the greedy rule, and a learned policy.

    python -m studies.tasks.data --episodes 100

The learned policy is the bundled one. A dataset that is there is not made again, so the command goes on where it
stopped. Read them with MINARI_DATASETS_PATH=OUT, under the names TASK/random-v0, TASK/greedy-v0 and TASK/learned-v0.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from seastar_gym import TASKS
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import load
from seastar_gym.controllers.scripted import scripted
from seastar_gym.data.command import name_of, write_to
from seastar_gym.data.dataset import summary, write
from seastar_gym.data.recorder import Episode, Recorder
from seastar_gym.evaluation.tasks import make_batch
from seastar_gym.extras import require_extra
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Results, Study, require_known
from studies.tasks.controllers import make_controller
from studies.tasks.episodes import Agent, rollout_of

QUALITIES = ("random", "greedy", "learned")
FIDELITY: Fidelity = "fast"


@dataclass(frozen=True)
class Options:
    """Minari datasets of the tasks, of three qualities."""

    tasks: tuple[str, ...] = tuple(TASKS)
    """Environments."""
    episodes: int = 100
    """Episodes of every dataset, of the split "train", with the seeds 0, 1, ..."""

    def __post_init__(self) -> None:
        require_count("episodes", self.episodes, 1, 100_000)
        require_known("task", self.tasks, TASKS)


def agent_of(quality: str, id: str, recorder: Recorder) -> Agent | Policy:
    """Agent of a quality."""
    if quality == "random":
        return scripted("random", TASKS[id][1], rng=np.random.default_rng(0))
    if quality == "greedy":
        return make_controller("greedy", recorder)
    from agents.tasks.command import file_of

    return load(file_of(id))


def record(id: str, quality: str, n_episodes: int) -> list[Episode]:
    """Episodes of a task, each from its reset to its end."""
    recorder = Recorder(make_batch(id, n_episodes, split="train", fidelity=FIDELITY))
    rollout_of(recorder, agent_of(quality, id, recorder), seeds=list(range(n_episodes)))
    recorder.close()
    return recorder.episodes(only_first=True)


def run(options: Options, results: Results) -> None:
    """Write the datasets that are missing; says a line on each."""
    require_extra("Datasets", "data", "minari", "h5py")
    import minari

    write_to(results.out)
    there = minari.list_local_datasets()
    for id in options.tasks:
        for quality in QUALITIES:
            name = name_of(id, quality)
            if name in there:
                print(f"{name} is there already.")
                continue
            episodes = record(id, quality, options.episodes)
            write(
                episodes, name, id, quality, "Written by python -m studies.tasks.data", split="train",
                fidelity=FIDELITY,
            )  # fmt: skip
            print(f"{name}: {summary(episodes)}", flush=True)


STUDY = Study("tasks.data", run, Options, out=Path("runs/data"))
