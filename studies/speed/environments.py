"""Decisions per second of environments, one robot and a batch, beside those of Gymnasium's MuJoCo environments.

`pip install -e ".[studies,mujoco]"` brings MuJoCo. Everything runs on one core, with random actions. Environments take
turns, round by round, so that all meet the same machine.
"""

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import seastar_gym  # noqa: F401, registers the ids
from studies.frame import Results, Study, rounded
from studies.pages import markdown

DECISIONS, ROUNDS = 256, 15
"""Decisions of a round, at least, and rounds, of which the median counts."""
BATCHES = {"SeastarSwim-v0": 512, "SeastarSwimTimedModerate-v0": 512, "Swimmer-v5": 64, "HalfCheetah-v5": 64}
"""Environments, and the robots of their batches: about as many as make them fastest."""


def is_ours(id: str) -> bool:
    """Whether an environment is of this package."""
    return id.startswith("Seastar")


class Single:
    """One robot as `gym.make` makes it; a decision is a step."""

    def __init__(self, id: str):
        options: dict[str, Any] = {"fidelity": "fast"} if is_ours(id) else {}
        self.env: gym.Env[Any, Any] = gym.make(id, **options)
        self.env.action_space.seed(0)
        self.env.reset(seed=0)
        self.decisions = DECISIONS

    def go(self) -> None:
        """Make the decisions of a round."""
        for _ in range(self.decisions):
            _, _, terminated, truncated, _ = self.env.step(self.env.action_space.sample())
            if terminated or truncated:
                self.env.reset()


class Batch:
    """Robots as `gym.make_vec` makes them; a step is a decision of each."""

    def __init__(self, id: str):
        ours = {"vectorization_mode": "vector_entry_point", "fidelity": "fast", "threads": 1}
        options: dict[str, Any] = ours if is_ours(id) else {"vectorization_mode": "sync"}
        self.envs = gym.make_vec(id, BATCHES[id], **options)
        self.envs.action_space.seed(0)
        self.envs.reset(seed=0)
        self.steps = max(4, DECISIONS // BATCHES[id])
        self.decisions = self.steps * BATCHES[id]

    def go(self) -> None:
        """Make the decisions of a round."""
        for _ in range(self.steps):
            self.envs.step(self.envs.action_space.sample())


def simulated(id: str) -> float:
    """Simulated time of a decision [s]."""
    env: Any = gym.make(id).unwrapped
    env.reset(seed=0)
    info = env.step(env.action_space.sample())[-1]
    return float(info["time"] if is_ours(id) else env.dt)


def run(results: Results) -> None:
    """Time all environments."""
    kinds: dict[str, Callable[[str], Single | Batch]] = {"single": Single, "batch": Batch}
    rooms = {(id, name): kind(id) for id in BATCHES for name, kind in kinds.items()}
    rates: dict[tuple[str, str], list[float]] = {each: [] for each in rooms}
    for room in rooms.values():
        room.go()
    for _ in range(ROUNDS):
        for each, room in rooms.items():
            began = time.process_time()
            room.go()
            rates[each].append(room.decisions / (time.process_time() - began))
    for id in BATCHES:
        found = {name: float(np.median(rates[id, name])) for name in kinds}
        results.row(["decisions_per_second"])[id] = found | {"simulated": simulated(id), "robots": BATCHES[id]}
        print(id, found, flush=True)


def table(results: Mapping[str, Any]) -> str:
    """Decisions per second, and simulated time per processor time, by environment."""
    head = [
        "environment", "simulated time of a decision [s]", "one robot: decisions per second", "× real time",
        "batch: robots", "decisions per second", "× real time",
    ]  # fmt: skip
    rows = []
    for id, row in results["decisions_per_second"].items():
        single, batch = ([_two(row[name]), _two(row[name] * row["simulated"])] for name in ("single", "batch"))
        rows.append([f"`{id}`", f"{row['simulated']:g}", *single, row["robots"], *batch])
    return markdown(head, rows)


def _two(number: float) -> str:
    return f"{rounded(number, 2):,.0f}"


STUDY = Study(
    "speed.environments", run, file="speed/speed_environments.json", out=Path("runs/environments"),
    tables={"speed environments": table},
    packages=("mujoco",), extra="mujoco",
)  # fmt: skip
