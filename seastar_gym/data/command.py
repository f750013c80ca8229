"""Writes Minari datasets: swims of agents on registered tasks, with infos, to learn from without a simulator.

Agents are names as in `seastar swim`, files of policies, or module:function; LABEL=AGENT gives a dataset another name.
A dataset is called TASK/LABEL-v0. Episodes have the seeds 0, 1, ... of the split "train", where a task has splits.
"""

import argparse
import itertools
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

from seastar_gym.command import DEFAULT, answered, command_parser
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.registry import HELP, load_agent
from seastar_gym.controllers.scripted import RandomPolicy
from seastar_gym.data.dataset import record, require_new, summary, write
from seastar_gym.evaluation.tasks import env_of, require_seen, require_task, spec_of
from seastar_gym.extras import require_extra
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar data", __doc__)
    found.add_argument("--tasks", nargs="+", default=["SeastarSwim-v0"], help=f"ids of tasks {DEFAULT}")
    found.add_argument("--agents", nargs="+", default=["random", "greedy", "learned"], help=f"{HELP} {DEFAULT}")
    found.add_argument("--episodes", type=int, default=100, help=f"number of episodes of each {DEFAULT}")
    found.add_argument("--seed", type=int, default=0, help=f"seed of the first episode {DEFAULT}")
    found.add_argument("--fidelity", choices=get_args(Fidelity), help="accuracy (default: that of the task)")
    found.add_argument("--random-paths", action="store_true", help="random paths and headings, not the pentagon")
    found.add_argument("--out", type=Path, help="folder of the datasets (default: Minari's own)")
    return found


def write_to(folder: Path | None) -> None:
    """Have Minari keep its datasets in a folder."""
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        os.environ["MINARI_DATASETS_PATH"] = str(folder.resolve())


def name_of(task: str, label: str) -> str:
    """Id of a dataset."""
    return f"{task.removesuffix('-v0')}/{label}-v0"


def recorded(task: str, agent: str, options: argparse.Namespace, command: str) -> str:
    """Record and write a dataset; returns a line on it.

    ValueError, with one sentence, where agent and task do not fit, or where there is such a dataset.
    """
    label, _, name = agent.rpartition("=")
    dataset_id = name_of(task, label or Path(name).stem)
    require_new(dataset_id)
    arguments: dict[str, Any] = {} if options.fidelity is None else {"fidelity": options.fidelity}
    if options.random_paths:
        arguments |= _random_paths(task)
    env = env_of(task, **arguments)
    policy = _load(name, env, options.seed)
    arguments["actions"] = require_seen(policy, env)
    episodes = record(task, policy, options.episodes, options.seed, **arguments)
    write(episodes, dataset_id, task, agent, f"Written by: {command}", **arguments)
    return f"{dataset_id}: {summary(episodes)}"


def _random_paths(task: str) -> dict[str, Any]:
    """Arguments for random paths and headings."""
    if "task" in spec_of(task).kwargs:
        raise ValueError(f"{task} has no paths: leave --random-paths out.")
    return {"path": "random", "random_heading": True}


def _load(name: str, env: Any, seed: int) -> Policy:
    """Agent of a name; random actions are those of the environment's own mode."""
    if name == "random":
        return RandomPolicy(np.random.default_rng(seed), env.actions, env.scene.robot.n_limbs)
    return load_agent(name, env, seed)


def record_all(options: argparse.Namespace, command: str) -> int:
    """Record every agent on every task; returns the exit code, 2 where nothing was recorded."""
    require_extra("Datasets", "data", "minari", "h5py")
    require_count("--episodes", options.episodes, 1, 1_000_000)
    for task in options.tasks:
        require_task(task)
    write_to(options.out)
    done = 0
    for task, agent in itertools.product(options.tasks, options.agents):
        try:
            line = recorded(task, agent, options, command)
        except (ValueError, FileNotFoundError) as unfit:
            print(f"{agent} is not recorded on {task}: {unfit}", file=sys.stderr)
            continue
        print(line, flush=True)
        done += 1
    return 0 if done else 2


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = parser().parse_args(given)
    return answered(lambda: record_all(options, shlex.join(["seastar", "data", *given])))
