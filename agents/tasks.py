"""Trains the bundled policy of every task, and writes its card.

    python -m agents.tasks
    python -m agents.tasks --benchmark    # cells of the benchmark instead, see `agents.methods`

PPO is trained on a task's split "train", with the project's hyperparameters, the horizon of the task and a memory. Of
several seeds, the one with the largest mean return in other episodes of that split is published, with a card that says
how it swims the split "test". The bundled policies are those of seed 0; that of `SeastarStation-v0` is the better of
two.
"""

import hashlib
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO

from agents.cards import training_facts
from agents.distillation import ENOUGH, PAST, distil
from agents.ppo import Hyperparameters, hyperparameters, make_model, policy_of
from agents.run import versions_and_machine
from seastar_gym import TASKS, SmaPulse
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.command import answered, run_command
from seastar_gym.controllers import learned
from seastar_gym.controllers.learned import LearnedPolicy, bundled_file, load, save
from seastar_gym.envs.symmetry import VectorFrameStack
from seastar_gym.envs.tasks.obst_trap import ObstTrap
from seastar_gym.evaluation.results import mean_with_interval
from seastar_gym.evaluation.rollout import env_of, make_batch, measure_of, swim_episodes
from seastar_gym.evaluation.swim import HELD_OUT_SEED
from seastar_gym.files import write_atomically
from seastar_gym.scene.checks import require_count
from seastar_gym.scene.numerics import Fidelity

IMITATION = "imitation"
"""Learner that imitates the bundled policy of waypoints, which sees the true state, see `agents.distillation`."""
TOLD_THE_WAY = "PPO, memory, told the way"
"""Learner whose reward measures the way around all discs of `ObstTrap`; its policy swims the task as it is."""
OTHERS = {"obst-trap": TOLD_THE_WAY, "sim-to-real": IMITATION}
"""Learners of tasks that a memory alone does not serve best."""
RECIPES: dict[str, str] = {id: OTHERS.get(str(row.task), "PPO, memory") for id, row in TASKS.items()}
"""Learner of every task that has a bundled policy."""
VALIDATION = 64
"""Episodes of the split "train" by which seeds are compared."""
FAR_SEED = 10**6
"""Seed of the first of them: trainings begin with the seeds of their robots, which are small."""


@dataclass(frozen=True)
class Options:
    """Train the bundled policy of every task, and write its card; with --benchmark, cells of the benchmark instead."""

    tasks: tuple[str, ...] = tuple(RECIPES)
    """Environments."""
    seeds: tuple[int, ...] = (0, 1)
    """Seeds of the trainings, of which the best is published."""
    decisions: int = 1_200_000
    """Length of every training [decisions]."""
    fidelity: Fidelity = "fast"
    """Fidelity of the simulation."""
    num_threads: int | None = None
    """Threads of the simulator; by default one for every processor."""
    cards_only: bool = False
    """Measure the policies that are there, and write their cards anew."""
    out: Path = learned.TASKS
    """Folder of the policies."""

    def __post_init__(self) -> None:
        if unknown := set(self.tasks) - set(RECIPES):
            raise ValueError(f"{min(unknown)!r} has no bundled policy: choose of {', '.join(RECIPES)}.")
        require_count("decisions", self.decisions, 1, 10**9)
        if not self.seeds:
            raise ValueError("There must be at least one seed.")


def training_batch(id: str, fidelity: Fidelity, threads: int | None, told_the_way: bool = False) -> VectorFrameStack:
    """Batch of a training, on the split "train", whose policies remember.

    told_the_way: Whether the reward measures the way around all discs of `ObstTrap`.
    """
    task = {"task": ObstTrap(potential="geodesic")} if told_the_way else {}
    batch = make_batch(
        id, Hyperparameters().num_envs, split="train", fidelity=fidelity, threads=threads,
        autoreset_mode=AutoresetMode.SAME_STEP, **task,
    )  # fmt: skip
    return VectorFrameStack(batch, PAST)


def new_model(id: str, seed: int, fidelity: Fidelity, threads: int | None) -> PPO:
    """PPO for a task that has learned nothing yet."""
    env = BatchVecEnv(training_batch(id, fidelity, threads, RECIPES[id] == TOLD_THE_WAY))
    batch: Any = env.env.unwrapped
    return make_model(env, hyperparameters(str(TASKS[id].task), float(batch.decision_period)), seed)


def train(id: str, seed: int, decisions: int, fidelity: Fidelity, threads: int | None) -> PPO:
    """PPO after so many decisions of training."""
    torch.set_num_threads(1)
    model = new_model(id, seed, fidelity, threads)
    model.learn(decisions)
    env = model.get_env()
    assert env is not None
    env.close()
    return model


def imitate(id: str, seed: int, decisions: int, fidelity: Fidelity, threads: int | None) -> LearnedPolicy:
    """Policy with memory after so many decisions of learning from the bundled one of waypoints, which sees all."""
    torch.set_num_threads(1)
    batch = training_batch(id, fidelity, threads)
    period = float(batch.unwrapped.decision_period)  # type: ignore[attr-defined]
    return distil(load(bundled_file(period)), batch, decisions, seed)


def file_of(id: str, folder: Path = learned.TASKS) -> Path:
    """File of the policy of a task."""
    row = TASKS[id]
    period = None if row.decision_period == SmaPulse().period else row.decision_period
    return learned.of_task(str(row.task), period, folder)


def trained(id: str, seed: int, options: Options) -> tuple[LearnedPolicy, dict[str, Any]]:
    """Policy of a seed, and what is to be told of its training."""
    began = time.process_time()
    decisions, fidelity, threads = options.decisions, options.fidelity, options.num_threads
    if RECIPES[id] == IMITATION:
        decisions = min(decisions, ENOUGH)
        policy = imitate(id, seed, decisions, fidelity, threads)
    else:
        model = train(id, seed, decisions, fidelity, threads)
        decisions, policy = model.num_timesteps, policy_of(model)
    facts = {"strokes": decisions, "seed": seed, "seconds": round(time.process_time() - began, 1)}
    return swims(policy, id), facts


def swims(policy: LearnedPolicy, id: str) -> LearnedPolicy:
    """The policy as one of a task, by whatever reward it was trained."""
    return LearnedPolicy(policy.description._replace(task=TASKS[id].task), policy.weights, policy.training)


def publish(id: str, options: Options, command: str) -> Path:
    """Train the seeds of a task, and keep the best; returns the policy's file."""
    found, far = [], list(range(FAR_SEED, FAR_SEED + VALIDATION))
    for seed in options.seeds:
        policy, facts = trained(id, seed, options)
        swum = swim_episodes(id, policy, far, fidelity=options.fidelity, split="train", threads=options.num_threads)
        score = float(np.mean(swum.returns))
        print(f"{id}, seed {seed}: mean return {score:.1f} after {facts['seconds']:.0f} s of training", flush=True)
        found.append((score, policy, facts))
    score, policy, facts = max(found, key=lambda one: one[0])
    file = file_of(id, options.out)
    save(
        policy,
        file,
        **facts,
        learner=RECIPES[id],
        id=id,
        seeds=list(options.seeds),
        validation_return=round(score, 2),
        commands=[command],
        options={"fidelity": options.fidelity},
        **versions_and_machine(),
    )
    return file


# Cards


EPISODES = 64
"""Held-out episodes of a card."""
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced")


def card(id: str, policy: LearnedPolicy, file: Path) -> str:
    """The card of the policy in a file, as Markdown."""
    about = policy.description
    layers = ", ".join(map(str, about.hidden))
    tried = policy.training.get("seeds", ())
    seeds = f"the best of seeds {', '.join(map(str, tried))}" if len(tried) > 1 else "one seed"
    told = ""
    if policy.training.get("learner") == TOLD_THE_WAY:
        told = ' Its training\'s reward measured the way around all discs, `ObstTrap(potential="geodesic")`.'
    if policy.training.get("learner") == IMITATION:
        told = (
            " It imitates the bundled policy of waypoints, which sees the true state.\n`docs/transfer.md` says what "
            "delays and softer limbs cost it, and what other seeds make of it."
        )
    past = f" and the most telling numbers of the last {about.past}" if about.past else ""
    env = env_of(id)
    measure = measure_of(env)
    return f"""# Model card: {file.stem}

A policy of the chapter's robot for `{id}`. What it sees and is rewarded for stands in the docstring of
`{type(env.task).__name__}`.{told}
It was trained in simulation, and no real robot has swum by it.

| | |
|---|---|
| file | `{file.name}`, sha256 `{hashlib.sha256(file.read_bytes()).hexdigest()}` |
| input | {about.input_size} numbers: the observation{past}, turned and mirrored into one sector |
| network | layers of {layers} neurons with tanh, which numpy runs |
| environment | `gym.make("{id}", actions="{about.actions}")` |
| learner | {policy.training.get("learner")}, {seeds} |
| licence | MIT, as the package |

## Training

{training_facts(policy.training)}

## How it swims

`python -m agents.tasks --cards-only` measures this, in {EPISODES} episodes of the split "test", where {measure.better}
is better. Other agents stand in docs/control.md.

| fidelity | {measure.name} [{measure.unit}]: mean (95 %, over episodes) | success |
|---|---:|---:|
{chr(10).join(_row(id, policy, fidelity) for fidelity in FIDELITIES)}
"""


def _row(id: str, policy: LearnedPolicy, fidelity: Fidelity) -> str:
    swum = swim_episodes(id, policy, list(range(HELD_OUT_SEED, HELD_OUT_SEED + EPISODES)), fidelity=fidelity)
    mean, low, high = mean_with_interval(measure_of(env_of(id)).of(swum))
    return f"| `{fidelity}` | {mean:.3g} ({low:.3g} to {high:.3g}) | {swum.success.sum()} of {EPISODES} |"


def write_card(id: str, policy: LearnedPolicy, file: Path) -> Path:
    """Measure the policy in a file, and write its card beside it; returns the card's file."""
    place = file.with_suffix(".md")
    write_atomically(place, card(id, policy, file))
    return place


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    prog = "python -m agents.tasks"

    def train_all() -> int | None:
        if "--benchmark" in given:
            from agents.methods import BenchmarkOptions, train_cells

            left = [word for word in given if word != "--benchmark"]
            return train_cells(tyro.cli(BenchmarkOptions, prog=f"{prog} --benchmark", args=left))
        options = tyro.cli(Options, prog=prog, args=given)
        for id in options.tasks:
            if not options.cards_only:
                publish(id, options, shlex.join(["python", "-m", "agents.tasks", *given]))
            file = file_of(id, options.out)
            print(write_card(id, load(file), file), flush=True)
        return None

    return answered(train_all)


if __name__ == "__main__":
    run_command(main)
