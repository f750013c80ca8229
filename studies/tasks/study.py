"""Headroom of the tasks: what rules, planners, learners and a bound that knows everything make of them.

    python -m studies.tasks

A cell is a task, an agent and a seed. Every cell is swum on the same held-out episodes, the first of the split "test";
learners are trained on the split "train" before. Results are written after every cell, and a cell that is already in
the file with as many episodes is not repeated, so the study can be broken off and continued, also with more seeds.
"""

import itertools
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import tyro

from agents.tasks.command import file_of
from seastar_gym import TASKS
from seastar_gym.controllers.learned import load
from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.evaluation.measures import measure_of_challenge
from seastar_gym.evaluation.rollout import Episodes
from seastar_gym.files import write_atomically
from seastar_gym.scene.numerics import Fidelity
from studies.provenance import provenance
from studies.tasks import heading
from studies.tasks.controllers import CONTROLLERS, is_swum, make_controller
from studies.tasks.episodes import swim
from studies.tasks.learning import ALL_LEARNERS, evaluate, train
from studies.tasks.page import write_page

IDS: dict[str, str] = {id: about[0] for id, about in TASKS.items()} | {heading.ID: "heading"}
"""Name of the challenge of every id."""
IN_THE_BOX = "in the box"
"""Agent that swims the policy that the package brings for a task."""
AGENTS = (*CONTROLLERS, heading.RULE, *ALL_LEARNERS, IN_THE_BOX)
DEFAULT_LEARNERS = ("PPO", "PPO, memory", "PPO, told the way")


@dataclass(frozen=True)
class Options:
    """Headroom of the tasks: what rules, planners, learners and a bound that knows everything make of them."""

    ids: tuple[str, ...] = tuple(IDS)
    """Environments."""
    agents: tuple[str, ...] = (*CONTROLLERS, heading.RULE, *DEFAULT_LEARNERS, IN_THE_BOX)
    """Agents; "RecurrentPPO" needs sb3-contrib."""
    seeds: tuple[int, ...] = (0, 1)
    """Seeds of the trainings; agents that do not learn swim once."""
    decisions: int = 200_000
    """Length of every training [decisions]."""
    episodes: int = 64
    """Number of held-out episodes."""
    fidelity: Fidelity = "fast"
    """Fidelity of the simulated swims."""
    num_threads: int | None = None
    """Threads of the simulator; all processors by default."""
    out: Path = Path("docs/tasks.json")
    """File of the results. The page and the picture have the same name with the suffixes .md and .png."""

    def __post_init__(self) -> None:
        for kind, asked, known in (("task", self.ids, IDS), ("agent", self.agents, AGENTS)):
            if unknown := set(asked) - set(known):
                raise ValueError(f"Unknown {kind} {min(unknown)!r}: choose of {', '.join(known)}.")

    @property
    def settings(self) -> dict[str, Any]:
        """What all cells of a file have in common."""
        return {name: getattr(self, name) for name in ("decisions", "fidelity")}


def has_cell(id: str, agent: str) -> bool:
    """Whether an agent can swim a task: there is a controller, or a way around discs to be told."""
    if id == heading.ID or agent == heading.RULE:
        return id == heading.ID and agent in heading.AGENTS
    if agent in CONTROLLERS:
        return is_swum(agent, CHALLENGES[IDS[id]])
    if agent == IN_THE_BOX:
        return True
    return not ALL_LEARNERS[agent].told_the_way or IDS[id] == "obst-trap"


def swum(id: str, agent: str, seed: int, options: Options) -> Episodes:
    """Held-out episodes of an agent."""
    fidelity, threads = options.fidelity, options.num_threads
    if id == heading.ID:
        return heading.swum(agent, seed, options.decisions, options.episodes, fidelity, threads)
    if agent in CONTROLLERS:
        return swim(id, lambda batch: make_controller(agent, batch), options.episodes, fidelity, threads)
    if agent == IN_THE_BOX:
        policy = load(file_of(id))
        return swim(id, lambda batch: policy, options.episodes, fidelity, threads)
    model = train(id, agent, seed, options.decisions, fidelity, threads)
    return evaluate(id, agent, model, options.episodes, fidelity, threads)


def cell(id: str, agent: str, seed: int, options: Options) -> dict[str, Any]:
    """Result of a cell as plain data: measure, return and success of every episode, and the processor's time [s]."""
    began = time.process_time()
    done = swum(id, agent, seed, options)
    return {
        "measure": np.round(measure_of_challenge(CHALLENGES.get(IDS[id])).of(done), 4).tolist(),
        "return": np.round(done.returns, 3).tolist(),
        "success": done.success.tolist(),
        "processor_seconds": round(time.process_time() - began),
    }


def read_cells(options: Options) -> dict[str, Any]:
    """Results in the output file, or empty ones; ValueError if they were made with other settings."""
    if not options.out.is_file():
        return {"settings": options.settings, "cells": {}}
    results: Any = json.loads(options.out.read_text(encoding="utf-8"))
    if results.get("settings") != options.settings:
        raise ValueError(f"{options.out} has results of {results.get('settings')}, not of {options.settings}.")
    return cast(dict[str, Any], results)


def study(options: Options) -> dict[str, Any]:
    """Swim the cells that are missing, and write the results after each."""
    for seed, id, agent in itertools.product(options.seeds, options.ids, options.agents):
        name = f"{id}, {agent}, {seed}"
        before = read_cells(options)["cells"].get(name, {"measure": ()})["measure"]
        again = agent not in ALL_LEARNERS and seed != options.seeds[0]
        if again or len(before) >= options.episodes or not has_cell(id, agent):
            continue
        found = cell(id, agent, seed, options)
        results = read_cells(options)  # another process may have written meanwhile
        results |= provenance("python -m studies.tasks", "torch", "stable_baselines3")
        results["cells"][name] = found
        options.out.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(options.out, (json.dumps(results) + "\n").encode())
        print(f"{name}: {np.mean(found['measure']):.2f} ({found['processor_seconds']} s)", flush=True)
    return read_cells(options)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line of the study; returns the exit code."""
    try:
        options = tyro.cli(Options, prog="python -m studies.tasks", args=arguments)
        results = study(options)
    except ValueError as wrong:
        print(wrong, file=sys.stderr)
        return 2
    write_page(results, IDS, options.out, has_cell)
    return 0
