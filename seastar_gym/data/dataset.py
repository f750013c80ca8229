"""Episodes on disk, in the format of Minari.

    from seastar_gym.data.dataset import record, write

    episodes = record("SeastarSwim-v0", load(), 100)
    write(episodes, "SeastarSwim/mine-v0", "SeastarSwim-v0", "mine", actions="pairs")
    minari.load_dataset("SeastarSwim/mine-v0")

Minari keeps datasets below MINARI_DATASETS_PATH, or ~/.minari/datasets.
"""

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.data.recorder import Episode, Recorder
from seastar_gym.evaluation.rollout import rollout
from seastar_gym.evaluation.tasks import make_batch, make_task
from seastar_gym.version import __version__

AT_ONCE = 128
"""Robots that swim side by side."""


def record(task: str, policy: Policy, n_episodes: int, seed: int = 0, **arguments: Any) -> list[Episode]:
    """Episodes with the seeds `seed`, `seed` + 1, ... of a registered task.

    arguments: Of the environment, such as `actions` and `fidelity`.
    """
    found: list[Episode] = []
    for first in range(seed, seed + n_episodes, AT_ONCE):
        seeds = list(range(first, min(first + AT_ONCE, seed + n_episodes)))
        recorder = Recorder(make_batch(task, len(seeds), **arguments))
        rollout(recorder, policy, seeds=seeds)
        found += recorder.episodes(only_first=True)
        recorder.close()
    return found


def require_new(dataset_id: str) -> None:
    """ValueError where there is such a dataset."""
    import minari

    if dataset_id in minari.list_local_datasets():
        raise ValueError(f"There is a dataset {dataset_id} already: delete it (minari delete), or write elsewhere.")


def write(
    episodes: Sequence[Episode], dataset_id: str, task: str, algorithm: str, description: str = "", **arguments: Any
) -> Any:
    """Write a dataset; returns Minari's object of it.

    dataset_id: NAMESPACE/NAME-vNUMBER. algorithm: Who chose the actions. arguments: Of the environment, which the
    dataset can then make anew. ValueError: There is such a dataset, or there are no episodes.
    """
    import minari
    from minari.data_collector import EpisodeBuffer

    require_new(dataset_id)
    if not episodes:
        raise ValueError(f"There are no episodes for {dataset_id}.")
    env = make_task(task, **arguments)
    buffers = [
        EpisodeBuffer(
            id=number,
            seed=one.seed,
            observations=one.observations,
            actions=one.actions,
            rewards=one.rewards,
            terminations=one.terminated,
            truncations=one.truncated,
            infos=one.infos,
        )
        for number, one in enumerate(episodes)
    ]
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="minari")  # it asks for addresses that there are not
        dataset = minari.create_dataset_from_buffers(
            dataset_id,
            buffers,
            env=env,
            algorithm_name=algorithm,
            author="The seastar-gym authors",
            description=description or None,
            requirements=[f"seastar-gym=={__version__}"],
        )
    env.close()
    return dataset


def summary(episodes: Sequence[Episode]) -> str:
    """A line on episodes: their number and length, mean return, and the share that ended with success."""
    returns = np.mean([one.rewards.sum() for one in episodes])
    success = np.mean([one.infos["is_success"][-1] for one in episodes])
    decisions = sum(len(one.rewards) for one in episodes)
    return f"{len(episodes)} episodes, {decisions} decisions, mean return {returns:.1f}, success {success:.0%}"
