"""A training's run: rounds of RLlib, checkpoints that are there whole or not at all, and the policy beside them."""

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from ray.rllib.algorithms.ppo import PPO
from ray.rllib.utils.metrics import ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME

from agents.rllib.algorithm import make_algorithm, policy_of
from agents.rllib.options import Options
from agents.training import efficiency
from agents.training.folder import record
from seastar_gym.controllers.learned import save
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.evaluation.swim import swim

KEPT = 2
"""Checkpoints that are kept: the last, and the one before it."""


class Round(NamedTuple):
    """State of a training after a round. strokes: All until now. restarts: Env runners that were started again."""

    algorithm: PPO
    strokes: int
    restarts: int


Watch = Callable[[Round], bool]
"""Called after every round; whether the training goes on."""


def train(options: Options, watch: Watch) -> Round:
    """Train, or go on with the run in the folder, until the strokes are done or the watch ends it."""
    algorithm = make_algorithm(options)
    try:
        if newest := last_checkpoint(options.out):
            algorithm.restore_from_path(str(newest.resolve()))
        done = Round(algorithm, strokes_of(algorithm), 0)
        saved, goes_on = done.strokes, True
        began, before = time.perf_counter(), efficiency.read(options.out).seconds
        while goes_on and done.strokes < options.length:
            algorithm.train()
            done = Round(algorithm, strokes_of(algorithm), restarts_of(algorithm))
            goes_on = watch(done)
            if done.strokes >= saved + options.save_freq or done.strokes >= options.length or not goes_on:
                saved = done.strokes
                keep(done, options, before + time.perf_counter() - began)
        return done
    finally:
        algorithm.stop()


def strokes_of(algorithm: PPO) -> int:
    """Strokes of all env runners, in all sessions."""
    found: Any = algorithm.metrics.peek((ENV_RUNNER_RESULTS, NUM_ENV_STEPS_SAMPLED_LIFETIME), default=0)
    return int(found)


def restarts_of(algorithm: PPO) -> int:
    """Env runners that were started again in this session."""
    group: Any = algorithm.env_runner_group
    return int(group.num_remote_worker_restarts())


def keep(done: Round, options: Options, seconds: float) -> None:
    """Write the policy, how it swims round the pentagon, and a checkpoint."""
    folder, policy = options.out, policy_of(done.algorithm, options)
    ppo = options.ppo
    pentagon = SeastarSwimEnv(
        "pentagon", actions=ppo.actions, fidelity=options.fidelity, decision_period=ppo.decision_period
    )
    swum = swim("learned", policy, pentagon, max_strokes=options.limit(pentagon.scene))
    save_checkpoint(done.algorithm, folder, done.strokes)
    save(policy, folder / "policy.safetensors", strokes=done.strokes, seed=options.seed)
    record(folder, done.strokes, seconds, swum)
    reached = "" if swum.finished else f" (only {swum.waypoints_reached} waypoints)"
    print(f"{done.strokes} strokes trained: the pentagon takes {swum.strokes}{reached}.", flush=True)


def save_checkpoint(algorithm: PPO, folder: Path, strokes: int) -> None:
    """Write a checkpoint beside its place and rename it; older ones than KEPT are deleted."""
    place = (folder / "checkpoints" / f"{strokes:012d}").resolve()
    part = place.with_name(f".{place.name}.{os.getpid()}")
    try:
        algorithm.save_to_path(str(part))
        shutil.rmtree(place, ignore_errors=True)
        part.rename(place)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    for old in checkpoints(folder)[:-KEPT]:
        shutil.rmtree(old)


def checkpoints(folder: Path) -> list[Path]:
    """Checkpoints of a run, the oldest first."""
    return sorted(place for place in (folder / "checkpoints").glob("[0-9]*") if place.is_dir())


def last_checkpoint(folder: Path) -> Path | None:
    """Newest checkpoint of a run, None before the first."""
    return next(reversed(checkpoints(folder)), None)
