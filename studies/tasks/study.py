"""Headroom of the tasks: what rules, planners, learners and a bound that knows everything make of them.

    python -m studies.tasks

A cell is a task, an agent and a seed. Every cell is swum on the same held-out episodes, the first of the split "test";
learners are trained on the split "train" before. Results are written after every cell, and a cell that is already in
the file with as many episodes is not repeated, so the study can be broken off and continued, also with more seeds.
"""

import itertools
import time
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.utils import LinearSchedule

from agents.tasks.command import file_of
from agents.tasks.learning import LEARNERS, Learner, hyperparameters, make_learning_env, new_model
from seastar_gym import TASKS
from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers.learned import load
from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.evaluation.measures import measure_of_challenge
from seastar_gym.evaluation.rollout import Episodes
from seastar_gym.scene.numerics import Fidelity
from studies.frame import Results, Study, require_known
from studies.tasks import heading
from studies.tasks.controllers import CONTROLLERS, is_swum, make_controller
from studies.tasks.episodes import swim
from studies.tasks.page import BUNDLED, RECURRENT, draw, means, rows_of, table, verdicts

IDS: dict[str, str] = {id: about[0] for id, about in TASKS.items()} | {heading.ID: "heading"}
"""Name of the challenge of every id."""
ALL_LEARNERS = {**LEARNERS, RECURRENT: Learner(symmetric=False)}
"""Learners by name. A network with a state of its own cannot have its limbs renamed from one decision to the next, so
it learns without the symmetry."""
AGENTS = (*CONTROLLERS, heading.RULE, *ALL_LEARNERS, BUNDLED)
DECISIONS, EPISODES = 200_000, 64
"""Length of every training [decisions], and number of held-out episodes."""
FIDELITY: Fidelity = "fast"
DEFAULT_LEARNERS = ("PPO", "PPO, memory", "PPO, told the way", "PPO, memory, coasting")


@dataclass(frozen=True)
class Options:
    """Headroom of the tasks: what rules, planners, learners and a bound that knows everything make of them."""

    tasks: tuple[str, ...] = tuple(IDS)
    """Environments."""
    agents: tuple[str, ...] = (*CONTROLLERS, heading.RULE, *DEFAULT_LEARNERS, BUNDLED)
    """Agents; "RecurrentPPO" needs sb3-contrib."""
    seeds: tuple[int, ...] = (0, 1)
    """Seeds of the trainings; agents that do not learn swim once."""

    def __post_init__(self) -> None:
        require_known("task", self.tasks, IDS)
        require_known("agent", self.agents, AGENTS)


def has_cell(id: str, agent: str) -> bool:
    """Whether an agent can swim a task: there is a controller, or a way around discs to be told."""
    if id == heading.ID or agent == heading.RULE:
        return id == heading.ID and agent in heading.AGENTS
    if agent in CONTROLLERS:
        return is_swum(agent, CHALLENGES[IDS[id]])
    if agent == BUNDLED:
        return True
    learner, challenge = ALL_LEARNERS[agent], IDS[id]
    if learner.coasting:
        return challenge == "sim-to-real"
    return not learner.told_the_way or challenge == "obst-trap"


def _recurrent(id: str, env: BatchVecEnv, seed: int) -> Any:
    from sb3_contrib import RecurrentPPO

    task, _, period, *_ = TASKS[id]
    chosen = hyperparameters(task, period)
    return RecurrentPPO(
        "MlpLstmPolicy",
        env,
        n_steps=32,
        batch_size=1024,
        n_epochs=chosen.epochs,
        learning_rate=LinearSchedule(chosen.learning_rate, 0.0, 1.0),
        gamma=chosen.discount_per_decision,
        gae_lambda=chosen.gae_lambda,
        clip_range=chosen.clip_range,
        policy_kwargs={"net_arch": list(chosen.hidden), "lstm_hidden_size": 64},
        seed=seed,
        device="cpu",
    )


def train(id: str, name: str, seed: int, decisions: int, fidelity: Fidelity) -> Any:
    """A learner after so many decisions of training, a `PPO` or `RecurrentPPO`."""
    torch.set_num_threads(1)
    env = make_learning_env(id, ALL_LEARNERS[name], fidelity, None)
    model = _recurrent(id, env, seed) if name == RECURRENT else new_model(id, env, seed)
    model.learn(decisions)
    env.close()
    return model


def evaluate(id: str, name: str, model: Any, n_episodes: int, fidelity: Fidelity) -> Episodes:
    """Held-out episodes of a learner."""
    return swim(id, lambda batch: model, n_episodes, fidelity, ALL_LEARNERS[name].wrap)


def swum(id: str, agent: str, seed: int) -> Episodes:
    """Held-out episodes of an agent."""
    if id == heading.ID:
        return heading.swum(agent, seed, DECISIONS, EPISODES, FIDELITY)
    if agent in CONTROLLERS:
        return swim(id, lambda batch: make_controller(agent, batch), EPISODES, FIDELITY)
    if agent == BUNDLED:
        policy = load(file_of(id))
        return swim(id, lambda batch: policy, EPISODES, FIDELITY)
    model = train(id, agent, seed, DECISIONS, FIDELITY)
    return evaluate(id, agent, model, EPISODES, FIDELITY)


def cell(id: str, agent: str, seed: int) -> dict[str, Any]:
    """Result of a cell as plain data: measure, return and success of every episode, and the processor's time [s]."""
    began = time.process_time()
    done = swum(id, agent, seed)
    return {
        "measure": np.round(measure_of_challenge(CHALLENGES.get(IDS[id])).of(done), 4).tolist(),
        "return": np.round(done.returns, 3).tolist(),
        "success": done.success.tolist(),
        "processor_seconds": round(time.process_time() - began),
    }


def study(options: Options, results: Results) -> None:
    """Swim the cells that are missing, and print all tasks."""
    cells = {
        ("cells", f"{id}, {agent}, {seed}"): partial(cell, id, agent, seed)
        for seed, id, agent in itertools.product(options.seeds, options.tasks, options.agents)
        if has_cell(id, agent) and (agent in ALL_LEARNERS or seed == options.seeds[0])
    }
    results.fill(
        cells, lambda found: f"{np.mean(found['measure']):.2f}", lambda found: len(found["measure"]) >= EPISODES
    )
    print(*(table(row, has_cell) for row in rows_of(results, IDS)), sep="\n\n")


STUDY = Study(
    "tasks",
    study,
    Options,
    "tasks/tasks.json",
    settings=lambda _: {"decisions": DECISIONS, "fidelity": FIDELITY},
    pictures={"tasks.png": lambda results, file: draw(rows_of(results, IDS), file)},
    tables={
        "tasks": lambda results: means(rows_of(results, IDS)),
        "tasks verdicts": lambda results: verdicts(rows_of(results, IDS)),
    },
    packages=("torch", "stable_baselines3"),
)
