"""Results of a benchmark: one entry for every task and agent, in a file that can be merged with others."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.evaluation.many import HELD_OUT_SEED
from seastar_gym.evaluation.statistics import Estimate, mean_with_interval
from seastar_gym.files import read_json, write_atomically
from seastar_gym.scene.checks import is_finite_number, is_whole_number
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.version import __version__

FORMAT = 1
"""Version of the file."""
LONGEST = 100
"""Characters of a name at most."""
LARGEST = 1e6
"""Largest score and number of decisions; `seastar benchmark` has no longer episodes."""
SOUND: dict[str, tuple[Callable[[Any], bool], str]] = {
    "scores": (lambda one: is_finite_number(one) and 0.0 <= one <= LARGEST, f"numbers from 0 to {LARGEST:g}"),
    "success": (lambda one: isinstance(one, bool), "true or false"),
    "returns": (lambda one: is_finite_number(one) and abs(one) <= 1e3 * LARGEST, f"numbers up to {1e3 * LARGEST:g}"),
    "decisions": (lambda one: is_whole_number(one) and 1 <= one <= LARGEST, f"counts up to {LARGEST:g}"),
}
"""What the numbers of every episode are."""
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
        texts = (self.task, self.agent, self.measure, self.unit, self.version)
        if not all(isinstance(text, str) and text.isprintable() and len(text) <= LONGEST for text in texts):
            raise ValueError(f"its names are not all texts on one line, of {LONGEST} characters at most")
        words = all(isinstance(word, str) for word in (self.better, self.fidelity))
        known = words and self.better in ("less", "more") and self.fidelity in ("", *get_args(Fidelity))
        if not known or not self._is_whole:
            raise ValueError(f"the entry of {self.agent} on {self.task} is not whole")
        if self.seeds != list(range(HELD_OUT_SEED, HELD_OUT_SEED + len(self.seeds))):
            raise ValueError(f"the seeds of {self.agent} on {self.task} are not {HELD_OUT_SEED} and those that follow")
        for name, (is_sound, numbers) in SOUND.items():
            if not all(map(is_sound, getattr(self, name))):
                raise ValueError(f"the {name} of {self.agent} on {self.task} are not all {numbers}")

    @property
    def _is_whole(self) -> bool:
        lists = (self.seeds, *(getattr(self, name) for name in SOUND))
        return all(isinstance(one, list) for one in lists) and {len(one) for one in lists} == {len(self.seeds) or -1}

    @property
    def key(self) -> tuple[str, str, str]:
        """What there is one entry of."""
        return self.task, self.agent, self.fidelity

    def estimate(self) -> Estimate:
        """Mean of the scores, failures among them, with its interval over episodes."""
        found = mean_with_interval(self.scores)
        return found if len(self.scores) > 1 else Estimate(found.mean, np.nan, np.nan)

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
    write_atomically(file, f"{text}\n")


def read(file: Path) -> list[Entry]:
    """Entries that `write` wrote. ValueError, with one sentence, for anything else."""
    try:
        facts = read_json(file)
        if facts["format"] != FORMAT:
            raise ValueError(f"its format is {facts['format']}, this version knows {FORMAT}")
        entries = [Entry(**entry) for entry in facts["entries"]]
    except (KeyError, TypeError, ValueError) as wrong:
        raise ValueError(f"{file} is no result of a benchmark: {str(wrong).rstrip('.')}.") from wrong
    for entry in entries:
        if entry.version != __version__:
            raise ValueError(
                f"{file} has results of version {entry.version} of seastar_gym, not of this one, {__version__}: "
                "measure them again."
            )
    return entries
