"""The benchmark: six ids, one protocol, scores from a greedy rule to an oracle, and results that merge.

    from seastar_gym.evaluation.benchmark import make

    batch = make("SeastarMiswiredTimed-v0", 64, autoreset_mode="SameStep")  # to train on
    cells = measured("SeastarMiswiredTimed-v0", "mine", ["0.zip", "1.zip", "2.zip"])

Learners train on the split "train", and their last policies swim the same test episodes, with deterministic actions.
What `info` has of hidden state is for judges alone. docs/benchmark.md says why, and has the results.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import reason_of
from seastar_gym.controllers.registry import is_file, is_function, load_agent
from seastar_gym.envs import IDS
from seastar_gym.envs.instances import SIZES, Split
from seastar_gym.envs.robots import Task
from seastar_gym.envs.tasks import NAMED
from seastar_gym.evaluation.results import (
    Estimate,
    interquartile_mean,
    over_trainings,
    probability_of_improvement,
    smallest_difference,
    text_table,
    write_csv,
)
from seastar_gym.evaluation.rollout import RECORDED, Batch, env_of, make_batch, measure_of_task, require_seen, rollout
from seastar_gym.files import beside, read_json, write_atomically, write_json
from seastar_gym.scene.checks import (
    is_whole_number,
    require_choice,
    require_count,
    require_flag,
    require_kind,
    require_number,
    require_numbers,
)
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.serial import to_dict

Track = Literal["plain", "symmetric"]
"""Whether a learner turns and mirrors what it sees into one sector. It outweighs the algorithm: never in one table."""
TRACKS: tuple[Track, ...] = ("plain", "symmetric")


class Entry(NamedTuple):
    """An id of the benchmark. price: `RewardWeights.time` [1/s], with which returns agree with the measure."""

    why: str
    price: float | None = None


ENTRIES: dict[str, Entry] = {
    "SeastarPreyTimed-v0": Entry("foresight over tens of seconds"),
    "SeastarPrizesTimed-v0": Entry("planning with nothing hidden"),
    "SeastarStation-v0": Entry("precision against a disturbance"),
    "SeastarMiswiredTimed-v0": Entry("memory, with a clear ceiling", 1.0),
    "SeastarFailBlind-v0": Entry("memory by twelve numbers", 1.0),
    "SeastarSwimSimToReal-v0": Entry("delay, noise and a robot that is not known exactly", 1.0),
}
BUDGETS, CURVE = (200_000, 1_000_000), (25_000, 50_000, 100_000, 200_000)
"""Decisions of trainings, and those after which their learning curves have a point."""
SEEDS = tuple(range(10))
FIDELITY: Fidelity = "fast"
EPISODES = 64
FIRST = {"test": 0, "check": 64}
"""Number of the first of EPISODES test episodes: those that everybody swims, and those of a last check."""


def task_of(id: str) -> Task:
    """Task of an id, with the price of time of the benchmark."""
    task: Any = NAMED[str(IDS[id].task)]
    price = ENTRIES[id].price
    return task if price is None else replace(task, reward=replace(task.reward, time=price))


def make(id: str, n: int, split: Split = "train", threads: int | None = None, **more: Any) -> Batch:
    """Batch of n robots of an id, as the benchmark has it. more: Of the batch, such as autoreset_mode and actions."""
    require_ids([id])
    return make_batch(id, n, threads, **{"task": task_of(id), "split": split, "fidelity": FIDELITY, **more})


def require_ids(ids: Iterable[str]) -> None:
    """ValueError for an id that is not of the benchmark."""
    if unknown := set(ids) - set(ENTRIES):
        raise ValueError(f"{min(unknown)} is no id of the benchmark: choose of {', '.join(ENTRIES)}.")


PROBED = 4
"""Decisions whose observations and rewards are part of a contract."""
NOTHING = 1e-9
"""Size of a number of them below which it is rounding."""


def _set(data: Any) -> Any:
    """Plain data without what is off: None, False, 0 and nothing. Options that nobody uses may come and go."""
    if isinstance(data, Mapping):
        return {name: left for name, value in data.items() if (left := _set(value))}
    return [_set(value) for value in data] if isinstance(data, list | tuple) else data


@cache
def contract(id: str) -> str:
    """Hash of what a result of an id depends on: task, robot, numerics and splits as they are said, and their numbers.

    The numbers are the first observations and rewards of a test episode, to six digits: rounding changes none of them,
    unless it lies between two.
    """
    batch = make(id, 1, "test", 1)
    inner: Any = batch.unwrapped
    seen = [batch.reset(options={"instance": 0})[0]]
    for action in range(1, PROBED + 1):
        observations, rewards, *_ = batch.step(np.full(1, action))
        seen += [observations, rewards]
    batch.close()
    row = IDS[id]._replace(threshold=None)._asdict()
    said = {
        "id": id, "row": {name: value for name, value in row.items() if name != "goal"}, "task": to_dict(inner.task),
        "scene": to_dict(inner.scene), "splits": SIZES, "episodes": EPISODES,
    }  # fmt: skip
    numbers = [f"{x:.5e}" if abs(x) > NOTHING else "0" for part in seen for x in np.ravel(part).tolist()]
    text = json.dumps([_set(said), numbers], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


POINT = ("decisions", "seconds", "measure")
"""What a point of a learning curve has at least."""


class Cell(NamedTuple):
    """What one training, or rule, reached in the test episodes of an id.

    seed: Of the training. measure, returns, success: Of every episode. decisions, seconds: Length of the training, in
    processor time; None where it is not known. curve: Points of it, with decisions, seconds, measure and returns.
    """

    agent: str
    track: Track
    id: str
    seed: int
    contract: str
    first: int
    measure: list[float]
    returns: list[float]
    success: list[bool]
    decisions: int | None = None
    seconds: float | None = None
    curve: Sequence[Mapping[str, float]] = ()


def swum(batch: Batch, policy: Policy, first: int = 0) -> dict[str, Any]:
    """Measure, return and success of every test episode that the robots of a batch swim; closes the batch.

    first: Number of the first of them.
    """
    inner: Any = batch.unwrapped
    episodes = rollout(batch, policy, seeds=0, record=RECORDED, options={"instance": first + np.arange(inner.num_envs)})
    batch.close()
    episodes = episodes._replace(limit=inner.max_episode_steps * inner.decision_period)
    of = measure_of_task(inner.task).of(episodes)
    return {
        "measure": np.round(of, 4).tolist(), "returns": np.round(episodes.returns, 3).tolist(),
        "success": episodes.success.tolist(),
    }  # fmt: skip


def track_of(policy: Policy) -> Track:
    """Track of a policy: its attribute `symmetric`, which learned ones and models have, says whether it reduces."""
    return "symmetric" if getattr(policy, "symmetric", False) else "plain"


def length_of(policy: Policy) -> int | None:
    """Decisions that a policy learned for; None where it does not say."""
    training = getattr(policy, "training", None)
    own = getattr(policy, "num_timesteps", training.get("strokes") if isinstance(training, dict) else None)
    return own if is_whole_number(own) else None


def require_length(name: str, policy: Policy, decisions: int | None) -> None:
    """ValueError where a policy says that it learned for another number of decisions, beyond its last rollout."""
    own = length_of(policy)
    if decisions is not None and own is not None and abs(own - decisions) > 0.1 * decisions:
        raise ValueError(f"{name} learned for {own:,} decisions: say --decisions {own}.")


def measured(
    id: str, agent: str, names: Sequence[str], first: int = 0, threads: int | None = None,
    decisions: int | None = BUDGETS[0],
) -> list[Cell]:  # fmt: skip
    """Cells of an agent: what each of its policies reaches.

    names: Names of policies as of `load_agent`, such as one file for each seed. ValueError for one that does not fit.
    decisions: Length of their trainings, which says in which table they are. Rules have none, and what the package
    brings its own; ValueError for a file that says a length more than a tenth away.
    """
    require_ids([id])
    names = [names] if isinstance(names, str) else names
    env, cells = env_of(id, task=task_of(id), split="test", fidelity=FIDELITY), list[Cell]()
    ready = list[tuple[Policy, int | None, Any]]()
    for name in names:  # all, before one swims
        policy = load_agent(name, env)
        length = length_of(policy) if not (is_file(name) or is_function(name)) else decisions
        require_length(name, policy, length)
        ready.append((policy, length, require_seen(policy, env)))
    for seed, (policy, length, actions) in enumerate(ready):
        batch = make(id, EPISODES, "test", threads, actions=actions)
        reached = swum(batch, policy, first)
        cells.append(Cell(agent, track_of(policy), id, seed, contract(id), first, **reached, decisions=length))
    env.close()
    return cells


REFERENCES = Path(__file__).with_name("references.json")
"""Cells of the greedy rule and of the oracle, which `python -m studies.methods --references` makes."""
GREEDY, ORACLE = "greedy", "oracle"


@cache
def scales() -> dict[str, tuple[float, float]]:
    """Mean measures of the greedy rule and of the oracle in the test episodes, of ids that have both."""
    means = {(cell.agent, cell.id): float(np.mean(cell.measure)) for cell in read([REFERENCES])}
    return {id: (means[GREEDY, id], means[ORACLE, id]) for id in ENTRIES if (ORACLE, id) in means}


def score(cell: Cell) -> float:
    """0 for the greedy rule's mean, 1 for the oracle's; NaN where an id has no oracle."""
    greedy, oracle = scales().get(cell.id, (np.nan, np.nan))
    return float((greedy - np.mean(cell.measure)) / (greedy - oracle))


# Results that merge


RESULTS = "benchmark.json"
"""Name of the file of them in a folder."""
FORMS = (".json", ".csv", ".md", ".tex", ".npz")
"""Endings of all files that `write_all` writes there."""


def write(cells: Sequence[Cell], file: Path, **about: Any) -> None:
    """Write cells as JSON, which `read` reads and merges. about: What else the file says."""
    write_json(file, {**about, "cells": [cell._asdict() for cell in cells]})


def cells_in(file: Path | str) -> list[Cell]:
    """Cells of a file. FileNotFoundError or ValueError, with one sentence, where it has none."""
    data = read_json(file)
    try:
        cells = [Cell(**cell) for cell in data["cells"]]
        for cell in cells:
            require_cell(cell)
    except (KeyError, OverflowError, TypeError, ValueError) as wrong:
        raise ValueError(f"{file} is no file of the benchmark: {reason_of(wrong)}.") from wrong
    return cells


def require_cell(cell: Cell) -> None:
    """ValueError for a cell with entries that cannot be, also of an id that is not of the benchmark."""
    for name in ("agent", "track", "id", "contract"):
        require_kind(name, getattr(cell, name), str, "a text")
    if not cell.agent.strip():
        raise ValueError("An agent has no name.")
    require_choice("track", cell.track, TRACKS)
    require_ids([cell.id])
    for name, smallest in {"seed": 0, "first": 0, "decisions": 1}.items():
        if (count := getattr(cell, name)) is not None or name != "decisions":
            require_count(name, count, smallest, 2**53)
    if cell.seconds is not None:
        require_number("seconds", cell.seconds, "s", zero_allowed=True)
    for name in ("measure", "returns", "success"):
        require_kind(name, getattr(cell, name), list, "a list")
    require_numbers("measure", (*cell.measure, *cell.returns), "1")
    for done in cell.success:
        require_flag("success", done)
    if not len(cell.measure) == len(cell.returns) == len(cell.success) > 0:
        raise ValueError("A cell has as many measures as returns and successes, and at least one.")
    require_kind("curve", cell.curve, list, "a list of points")
    for point in cell.curve:
        require_numbers("curve", tuple(point[name] for name in POINT), "1")


def read(files: Iterable[Path | str] | str) -> list[Cell]:
    """Cells of all files, or of one, see `merged`."""
    files = [files] if isinstance(files, str) else files
    return merged({str(file): cells_in(file) for file in files})


def merged(parts: Mapping[str, Iterable[Cell]]) -> list[Cell]:
    """Cells of several sources, by their names.

    ValueError: two are of different contracts, or have different results of one training.
    """
    found, of = dict[tuple[Any, ...], tuple[Cell, str]](), dict[str, tuple[str, str]]()
    for source, cells in parts.items():
        for cell in cells:
            hashed, whose = of.setdefault(cell.id, (cell.contract, source))
            if hashed != cell.contract:
                raise ValueError(
                    f"{whose} and {source} are of different contracts of {cell.id}, whose task, observation, reward, "
                    "numerics or split changed in between: swim one of them again."
                )
            key = cell.agent, cell.track, cell.id, cell.seed, cell.first, cell.decisions
            same, whose = found.setdefault(key, (cell, source))
            if (same.measure, same.returns, same.success) != (cell.measure, cell.returns, cell.success):
                both = f"{source} has two" if whose == source else f"{whose} and {source} have different"
                raise ValueError(
                    f"{both} results of {cell.agent} in {cell.id}, seed {cell.seed}: name them apart by LABEL=FILES, "
                    "whose seeds are their places, from 0."
                )
    return [cell for cell, _ in found.values()]


def require_current(cells: Iterable[Cell], source: str) -> None:
    """ValueError, with one sentence, for cells of no id of the benchmark, or of another contract than it has here."""
    of = {(cell.id, cell.contract, len(cell.measure)) for cell in cells}
    require_ids(id for id, *_ in of)
    for id, hashed, n_episodes in sorted(of):
        if hashed != contract(id):
            raise ValueError(
                f"{source} and this version are of different contracts of {id}, whose task, observation, reward, "
                "numerics or split changed in between: swim it again."
            )
        if n_episodes != EPISODES:
            raise ValueError(f"{source} has {n_episodes} episodes of {id}, not {EPISODES}: swim it again.")


# Tables


class Row(NamedTuple):
    """Trainings of an agent in one track, by id."""

    agent: str
    track: Track
    cells: dict[str, list[Cell]]

    def measure(self, id: str) -> Estimate:
        """Mean measure over seeds, with its interval."""
        return over_trainings([np.mean(cell.measure) for cell in self.cells[id]])

    @property
    def scores(self) -> dict[str, list[float]]:
        """Scores of the seeds, of ids that have a scale."""
        return {id: list(map(score, self.cells[id])) for id in ENTRIES if id in self.cells and id in scales()}

    def overall(self, ids: Collection[str]) -> Estimate:
        """Interquartile mean of the scores over these ids; NaN for a row that has others."""
        has_all = bool(ids) and self.scores.keys() == {*ids}
        return interquartile_mean([self.scores[id] for id in ids]) if has_all else Estimate(np.nan, np.nan, np.nan)

    @property
    def smallest(self) -> float:
        """Smallest difference of the mean score over the ids that ten seeds can see; NaN below three seeds."""
        each = [smallest_difference(scores) for scores in self.scores.values()]
        return float(np.sqrt(np.sum(np.square(each))) / len(each)) if each else np.nan


def rows_of(cells: Iterable[Cell]) -> list[Row]:
    """Rows of cells, in their order."""
    found = dict[tuple[str, Track], dict[str, list[Cell]]]()
    for cell in cells:
        found.setdefault((cell.agent, cell.track), {}).setdefault(cell.id, []).append(cell)
    return [Row(*key, by_id) for key, by_id in found.items()]


def groups(cells: Sequence[Cell]) -> list[tuple[Track, int, int | None, list[Row]]]:
    """What is never put together: tracks, sets of episodes by their first, and lengths of training; and their rows."""
    kinds = dict.fromkeys((cell.track, cell.first, cell.decisions) for cell in cells)
    return [
        (*kind, rows_of(cell for cell in cells if (cell.track, cell.first, cell.decisions) == kind)) for kind in kinds
    ]


def named_rows(cells: Sequence[Cell]) -> dict[str, Row]:
    """Rows by agent, track, length of training where it is not the shorter budget, and first episode where not 0."""
    found = dict[str, Row]()
    for track, first, decisions, rows in groups(cells):
        of = f", {decisions:,} decisions" if decisions not in (None, BUDGETS[0]) else ""
        found |= {f"{row.agent}, {track}{of}" + (f", from {first}" if first else ""): row for row in rows}
    return found


def score_arrays(cells: Sequence[Cell]) -> dict[str, Any]:
    """Arrays of the scores of every row, shape (seeds, ids): of its ids, and of the seeds that have them all."""
    found = dict[str, Any]()
    for name, row in named_rows(cells).items():
        by_id = [{cell.seed: score(cell) for cell in row.cells[id]} for id in ENTRIES if id in row.scores]
        seeds = sorted(set.intersection(*map(set, by_id))) if by_id else []
        found[name] = np.array([[of[seed] for of in by_id] for seed in seeds]).reshape(len(seeds), len(by_id))
    return found


def records(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """A record of every agent, track, length of training, set of episodes and id, by the names of the CSV."""
    found = []
    for track, first, decisions, rows in groups(cells):
        for row, id, own in ((each, id, own) for each in rows for id, own in each.cells.items()):
            mean, scores = row.measure(id), [score(cell) for cell in own]
            found.append({
                "agent": row.agent, "track": track, "decisions": decisions, "first": first, "id": id,
                "seeds": len(own), "measure": mean.mean, "measure_low": mean.low, "measure_high": mean.high,
                "return": float(np.mean([cell.returns for cell in own])),
                "success_rate": float(np.mean([cell.success for cell in own])),
                "score": float(np.mean(scores)), "smallest_difference": smallest_difference(scores),
                "contract": own[0].contract,
            })  # fmt: skip
    return found


def _shown(estimate: Estimate) -> str:
    """An estimate as tables show it."""
    if np.isnan(estimate.mean):
        return "–"
    return f"{estimate.mean:.3g}" + ("" if np.isnan(estimate.low) else f" [{estimate.low:.3g}, {estimate.high:.3g}]")


def _title(id: str) -> str:
    """Title of the column of an id: its name, the unit of its measure, and whether less or more of it is better."""
    measure = measure_of_task(task_of(id))
    return f"{_short(id)}\n[{measure.unit}],\n{measure.better} is better"


def _short(id: str) -> str:
    return id.removeprefix("Seastar").removesuffix("-v0")


def table_of(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Titles and lines of the table of a track: means over seeds with intervals, and the number of seeds in brackets.

    The last columns: the interquartile mean of the scores, the smallest difference of their mean that ten seeds can
    see, and the probability that a seed scores more than one of the first row that has all ids. Rows that lack an id
    that others have a score of have none of the three.
    """
    ids = [id for id in ENTRIES if any(id in row.cells for row in rows)]
    scored = [id for id in ids if id in scales()]
    over = f"score over\n{', '.join(map(_short, scored))},\nmore is better" if scored else "score"
    titles, lines = ["agent", *map(_title, ids), over, "seen by ten", "P(> first)"], list[list[str]]()
    whole = next((row for row in rows if row.scores.keys() == {*scored}), None)
    for row in rows:
        shown = [f"{_shown(row.measure(id))} ({len(row.cells[id])})" if id in row.cells else "–" for id in ids]
        overall, smallest, better = row.overall(scored), np.nan, np.nan
        if not np.isnan(overall.mean):
            smallest = row.smallest
            if whole is not None and row is not whole:
                better = probability_of_improvement(*([each.scores[id] for id in scored] for each in (row, whole)))
        last = [_shown(overall), f"{smallest:.2g}", f"{better:.2f}"]
        lines.append([row.agent, *shown, *(text.replace("nan", "–") for text in last)])
    return titles, lines


def as_text(titles: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Table for a terminal."""
    return text_table(titles, lines)


def as_markdown(titles: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Table in Markdown."""
    rule = ["---", *["---:"] * (len(titles) - 1)]
    head, *body = [[cell.replace("\n", " ").replace("|", r"\|") for cell in line] for line in (titles, *lines)]
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, rule, *body))


LATEX = {each: rf"\{each}" for each in "&%$#_{}"} | {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": "$<$", ">": "$>$",
    "|": "$|$", "–": "--", "\n": " ",
}  # fmt: skip
"""What LaTeX writes for characters that it reads otherwise."""


def as_latex(titles: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Table in LaTeX, with the rules of the package booktabs."""
    escapes = str.maketrans(LATEX)
    head, *body = (" & ".join(cell.translate(escapes) for cell in line) + r" \\" for line in (titles, *lines))
    parts = [rf"\begin{{tabular}}{{l{'r' * (len(titles) - 1)}}}", r"\toprule", head, r"\midrule", *body, r"\bottomrule"]
    return "\n".join([*parts, r"\end{tabular}"])


def tables(cells: Sequence[Cell], form: Callable[..., str] = as_text) -> str:
    """Tables of cells: one of every track, and of every set of episodes and length of training."""
    marks = {as_markdown: ("", ":"), as_latex: ("% ", "")}
    before, after = marks.get(form, ("", ":"))
    parts = []
    for track, first, decisions, rows in groups(cells):
        of = "" if decisions is None else f", {decisions:,} decisions"
        title = f"{before}Track {track}{of}, test episodes {first} to {first + EPISODES - 1}{after}"
        parts.append(f"{title}\n\n{form(*table_of(rows))}")
    return "\n\n".join(parts) + "\n"


def write_all(cells: Sequence[Cell], folder: Path) -> None:
    """Write benchmark.json, which merges, tables as .csv, .md and .tex, and arrays of scores as .npz, into a folder."""
    if not cells:
        raise ValueError("There are no cells to write.")
    arrays, lines = score_arrays(cells), records(cells)
    texts = {ending: tables(cells, form) for ending, form in {".md": as_markdown, ".tex": as_latex}.items()}
    write(cells, folder / RESULTS)  # which can be shown, as it was
    with beside(folder / "benchmark.npz", ".npz") as part:
        np.savez(part, **arrays)
    write_csv(lines, folder / "benchmark.csv")
    for ending, text in texts.items():
        write_atomically(folder / f"benchmark{ending}", text)
