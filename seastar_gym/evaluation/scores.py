"""Agents on registered tasks: a score for every seed, and a table of their means with intervals."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.controllers.registry import is_file, is_function, learned_file, load_agent
from seastar_gym.evaluation.results import Estimate, mean_with_interval, number, over_trainings, text_table, write_csv
from seastar_gym.evaluation.rollout import env_of, held_out, measure_of, swim_episodes
from seastar_gym.evaluation.swim import HELD_OUT_SEED
from seastar_gym.files import write_json
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__


class Scores(NamedTuple):
    """What an agent reached in a task, in the order of the seeds.

    measure, unit, better: What scores are, and whether "less" or "more" is better. fidelity: None means the task's own.
    trainings: Number of trainings that took turns over the seeds; 0 for a rule.
    """

    task: str
    agent: str
    fidelity: Fidelity | None
    measure: str
    unit: str
    better: str
    seeds: list[int]
    scores: list[float]
    success: list[bool]
    returns: list[float]
    decisions: list[int]
    trainings: int = 0

    @property
    def mean(self) -> Estimate:
        """Mean score, failures among them, with its interval: over episodes for a rule, over trainings for a learner.

        There is none for one episode, nor for a learner with fewer than three trainings.
        """
        mean = mean_with_interval(self.scores)
        if self.trainings:
            each = over_trainings([np.mean(self.scores[k :: self.trainings]) for k in range(self.trainings)])
            return mean._replace(low=each.low, high=each.high)
        return mean

    def row(self) -> dict[str, Any]:
        """Row of the table, by the names of the CSV."""
        named = {name: getattr(self, name) for name in self._fields[:6]}
        score = dict(zip(("score", "score_low", "score_high"), self.mean, strict=True))
        return named | score | {
            "success_rate": sum(self.success) / len(self.seeds), "seeds": len(self.seeds),
            "trainings": self.trainings, "version": __version__
        }  # fmt: skip


_NAMES = re.compile(r"(?:^|,)(\{?\d+[+-],\d+[+-]\}?(?=,|$)|[^,]*)")
"""Name of a policy, between commas; pairs of limbs such as 4+,1- have one."""


def policies_of(agent: str) -> tuple[str, list[str]]:
    """Label of an agent, and the names of its policies: LABEL=A,B,C are several, such as trainings, in one row.

    What is before "=" in the name of a file, or of one in a folder that is there, is no label.
    """
    label, several, names = agent.partition("=")
    if not several or Path(agent).is_file() or (os.sep in label and Path(agent).parent.is_dir()):
        return Path(agent).stem if len(Path(agent).parts) > 1 else agent, [agent]
    policies = [names] if Path(names).is_file() else _NAMES.findall(names)
    if not (label.strip() and all(policies)):
        raise ValueError(f"{agent!r} lacks a label or a policy: write LABEL=A,B,C.")
    places = [Path(name).resolve() if is_file(name) else name for name in policies]
    if twice := [name for k, name in enumerate(policies) if places[k] in places[:k]]:
        raise ValueError(f"{label} has {twice[0]} twice: every policy is a training of its own.")
    return label, policies


def measured(
    task: str, agent: str, seeds: int = 10, *, fidelity: Fidelity | None = None, max_decisions: int | None = None,
    threads: int | None = None,
) -> Scores:  # fmt: skip
    """Scores of an agent on held-out episodes of a task, which no training draws.

    task: Id, or module:id. agent: Name, see `policies_of`; its policies take turns over the seeds. seeds: Number of
    them. fidelity, max_decisions: None means the task's own. threads: Of the simulator; None means one per processor.
    ValueError, with one sentence, where the agent does not fit the task.
    """
    label, names = policies_of(agent)
    env = env_of(task, **held_out(task, fidelity))
    measure, found = measure_of(env), dict[int, tuple[Any, ...]]()
    took_turns = names[:seeds]
    policies = [load_agent(name, env, HELD_OUT_SEED + turn) for turn, name in enumerate(took_turns)]  # before one swims
    for turn, policy in enumerate(policies):
        own = list(range(HELD_OUT_SEED, HELD_OUT_SEED + seeds))[turn :: len(names)]
        swum = swim_episodes(task, policy, own, fidelity=fidelity, max_decisions=max_decisions, threads=threads)
        rows = (column.tolist() for column in (measure.of(swum), swum.success, swum.returns, swum.decisions))
        found |= zip(own, zip(*rows, strict=True), strict=True)
    columns: Any = map(list, zip(*(found[seed] for seed in sorted(found)), strict=True))
    learns = [is_file(one) or learned_file(one) is not None or (is_function(one) and len(names) > 1) for one in names]
    trainings = len(took_turns) if any(learns) else 0
    what = task, label, fidelity, measure.name, measure.unit, measure.better
    return Scores(*what, sorted(found), *columns)._replace(trainings=trainings)


def as_text(found: Sequence[Scores]) -> str:
    """Table for a terminal, a line for every agent on every task."""
    titles = "agent", "task", "measure", "better", "mean [95 %]", "success [%]", "episodes", "trainings"
    return text_table(titles, [
        [one.agent, one.task, f"{one.measure} [{one.unit}]", one.better, str(one.mean),
         number(100.0 * one.row()["success_rate"]), str(len(one.seeds)), str(one.trainings or "–")]
        for one in found
    ])  # fmt: skip


def write(found: Iterable[Scores], file: Path) -> None:
    """Write the table as CSV, or as JSON with the score, success, return and decisions of every seed."""
    if file.suffix == ".json":
        write_json(file, [one._asdict() | {"version": __version__} for one in found])
    else:
        write_csv([one.row() for one in found], file)
