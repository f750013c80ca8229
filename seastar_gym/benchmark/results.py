"""Results of a benchmark: one entry for every task and agent, in a file that can be merged with others."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.evaluation.many import mean_with_interval
from seastar_gym.evaluation.statistics import Estimate
from seastar_gym.files import write_atomically
from seastar_gym.version import __version__

FORMAT = 1
"""Version of the file."""
MOST = 2.0
"""Largest relative score, of episodes twice as good as the best agent's."""


@dataclass(frozen=True)
class Entry:
    """Result of an agent on a task: for every seed the score, the success, the return and the decisions.

    fidelity: That of the simulation, "" for the task's own. better: "less" or "more" of the measure.
    """

    task: str
    agent: str
    fidelity: str
    measure: str
    unit: str
    better: str
    seeds: list[int]
    scores: list[float]
    success: list[bool]
    returns: list[float]
    decisions: list[int]
    version: str = __version__

    def __post_init__(self) -> None:
        lists = (self.scores, self.success, self.returns, self.decisions)
        if self.better not in ("less", "more") or not self.seeds or any(len(one) != len(self.seeds) for one in lists):
            raise ValueError(f"the entry of {self.agent} on {self.task} is not whole")
        if not np.isfinite(np.array([self.scores, self.returns], float)).all():
            raise ValueError(f"the scores of {self.agent} on {self.task} are not all numbers")

    @property
    def key(self) -> tuple[str, str, str]:
        """What there is one entry of."""
        return self.task, self.agent, self.fidelity

    def estimate(self) -> Estimate:
        """Mean of the scores, failures among them, with its interval over episodes."""
        mean, *ends = mean_with_interval(np.array(self.scores))
        return Estimate(mean, *ends) if len(self.scores) > 1 else Estimate(mean, np.nan, np.nan)

    @property
    def success_rate(self) -> float:
        """Share of episodes that ended with success."""
        return float(np.mean(self.success))


def relative(entry: Entry, best: float) -> NDArray[np.float64]:
    """Scores relative to the best mean of their task: 1 is as good, 0.5 half as good, MOST the most."""
    scores = np.array(entry.scores)
    ratio = np.where(scores == best, 1.0, MOST)
    part, whole = (scores, best) if entry.better == "more" else (best, scores)
    np.divide(part, whole, out=ratio, where=np.asarray(whole) > 0.0)
    return np.minimum(ratio, MOST)


def best_means(entries: Iterable[Entry]) -> dict[str, float]:
    """Best mean of every task."""
    found: dict[str, float] = {}
    for entry in entries:
        mean, choose = entry.estimate().mean, max if entry.better == "more" else min
        found[entry.task] = choose(found.get(entry.task, mean), mean)
    return found


def merged(*results: Sequence[Entry]) -> list[Entry]:
    """Entries of several benchmarks; of two for the same task, agent and fidelity, the later one."""
    found = {entry.key: entry for entries in results for entry in entries}
    for entry in found.values():
        other = next(one for one in found.values() if one.task == entry.task)
        if (entry.measure, entry.better) != (other.measure, other.better):
            raise ValueError(f"{entry.task} is measured by {entry.measure} and by {other.measure}: merge only one.")
    return list(found.values())


def write(entries: Sequence[Entry], file: Path) -> None:
    """Write entries as JSON."""
    text = json.dumps({"format": FORMAT, "entries": [asdict(entry) for entry in entries]}, indent=1)
    write_atomically(file, f"{text}\n".encode())


def read(file: Path) -> list[Entry]:
    """Entries that `write` wrote. ValueError, with one sentence, for anything else."""
    try:
        facts: Any = json.loads(file.read_text(encoding="utf-8"))
        if facts["format"] != FORMAT:
            raise ValueError(f"its format is {facts['format']}, this version knows {FORMAT}")
        return [Entry(**entry) for entry in facts["entries"]]
    except (KeyError, TypeError, ValueError) as wrong:
        raise ValueError(f"{file} is no result of a benchmark: {str(wrong).rstrip('.')}.") from wrong
