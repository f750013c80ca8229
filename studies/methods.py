"""Methods on the benchmark: the page's tables and pictures, from the cells that `agents.tasks --benchmark` trained.

--references swims the greedy rules, a planner and the oracle instead: an id after the other, those that are missing or
of another contract. Scores are measured between rules and oracle. --agreement correlates returns with measures, by
price of time.
"""

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.methods import METHODS
from agents.tasks import file_of
from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.learned import load
from seastar_gym.evaluation import benchmark
from seastar_gym.evaluation.benchmark import ENTRIES, EPISODES, GREEDY, ORACLE, REFERENCES, Cell, contract
from seastar_gym.evaluation.rollout import measure_of_task
from seastar_gym.files import save_figure
from studies.frame import Results, Study, commit_of, provenance, rounded
from studies.oracle import Adaptive, Planner, oracle_of
from studies.pages import markdown, show
from studies.tasks import greedy

AGENTS = {GREEDY: greedy, "planner": Planner, "adaptive": Adaptive, ORACLE: oracle_of}
SHARES, PRICES = (0.0, 0.1, 0.3, 0.5), (0.0, 1.0)
"""Shares of random actions, and prices of time [1/s], of the agreement."""


@dataclass(frozen=True)
class Options:
    """Which cells are read, or whether references or agreement are swum instead."""

    cells: Path = Path("runs/benchmark")
    """Folder of the cells."""
    references: bool = False
    """Swim the greedy rules, the planner and the oracle, and write them into the package."""
    agreement: bool = False
    """Correlate returns with measures, of ids with a price of time."""


def swim_references(file: Path = REFERENCES) -> None:
    """Swim what is missing of greedy rules, planner and oracle, and write the file after each; all others stay."""
    known = {(cell.agent, cell.id): cell for cell in benchmark.cells_in(file)} if file.is_file() else {}
    for (agent, make_agent), id in product(AGENTS.items(), ENTRIES):
        if (agent, id) in known and known[agent, id].contract == contract(id):
            continue
        batch = benchmark.make(id, EPISODES, "test", 1)
        swum = benchmark.swum(batch, make_agent(batch))
        known[agent, id] = Cell(agent, "plain", id, 0, contract(id), 0, **swum)
        about = provenance("python -m studies.methods --references") | {"commit": commit_of()}
        benchmark.write([*known.values()], file, **about)
        print(f"{id}, {agent}: {np.mean(swum['measure']):.4g}, return {np.mean(swum['returns']):.4g}", flush=True)


class Perturbed:
    """Policy that takes a share of its actions at random."""

    batched = True

    def __init__(self, policy: Policy, share: float, n_actions: int):
        self._policy, self._share, self._n, self._rng = policy, share, n_actions, np.random.default_rng(0)

    def predict(self, observation: Any, *others: Any, **named: Any) -> Any:
        """Actions and state of the policy, some actions at random."""
        actions, state = self._policy.predict(observation, *others, **named)
        at_random = self._rng.random(len(actions)) < self._share
        return np.where(at_random, self._rng.integers(self._n, size=len(actions)), actions), state


def agreement(id: str) -> list[str]:
    """Correlation of return and measure by price of time, over all episodes of `SHARES` and of both agents.

    In brackets that over solved ones. Time of unsolved episodes is the limit, as in the measure.
    """
    found, price = [], ENTRIES[id].price or 0.0
    for share, is_bundled in product(SHARES, (False, True)):
        bundled = load(file_of(id)) if is_bundled else None
        batch = benchmark.make(id, EPISODES, "test", 1, **({} if bundled is None else {"actions": bundled.actions}))
        space: Any = batch.single_action_space
        swum = benchmark.swum(batch, Perturbed(bundled or greedy(batch), share, int(space.n)))
        found.append([swum[name] for name in ("measure", "returns", "success")])
    measure, returns, success = (np.concatenate(column) for column in zip(*found, strict=True))
    told = []
    for other in PRICES:
        paid = returns + (price - other) * measure
        every, solved = (np.corrcoef(paid[of], measure[of])[0, 1] for of in (slice(None), success))
        told.append(f"{every:.2f} ({solved:.2f})")
    return told


def run(options: Options, results: Results) -> str | None:
    """Put the cells of all files together, or swim the references, or the agreement."""
    if options.references:
        swim_references()
        return None
    if options.agreement:
        rows = [[f"`{id}`", *agreement(id)] for id, entry in ENTRIES.items() if entry.price is not None]
        show(markdown(["id", *(f"{price:g} per second" for price in PRICES)], rows))
        return None
    places = list(METHODS)
    cells = benchmark.read(sorted(options.cells.glob("*/*/*.json")))
    cells.sort(key=lambda cell: places.index(cell.agent) if cell.agent in places else len(places))
    if not cells:
        return f"There are no cells in {options.cells}: python -m agents.tasks --benchmark trains them."
    results["cells"] = [
        cell._replace(measure=[rounded(x) for x in cell.measure], returns=[rounded(x) for x in cell.returns])._asdict()
        for cell in cells
    ]
    return None


def cells_of(found: Any) -> list[Cell]:
    """Cells that results keep; none before any was trained."""
    return [Cell(**cell) for cell in found.get("cells", [])]


def ids_table(found: Any) -> str:
    """Why each id is there, and between which means scores are measured."""
    measures = {id: measure_of_task(benchmark.task_of(id)) for id in ENTRIES}
    means = {(cell.id, cell.agent): f"{np.mean(cell.measure):.3g}" for cell in benchmark.read([REFERENCES])}
    lines = [
        [
            f"`{id}`", entry.why, f"{measures[id].name} [{measures[id].unit}], {measures[id].better} is better",
            *(means.get((id, agent), "none") for agent in (GREEDY, ORACLE)),
            "-" if entry.price is None else f"{entry.price:g}",
        ]
        for id, entry in ENTRIES.items()
    ]  # fmt: skip
    return markdown(["id", "asks for", "measure", "greedy", "oracle", "price of time [1/s]"], lines, (0, 1, 2))


def trained(found: Any, first: int = 0) -> list[Cell]:
    """Cells of learners. first: Number of the first of their test episodes."""
    return [cell for cell in cells_of(found) if cell.decisions is not None and cell.first == first]


def rows_table(found: Any) -> str:
    """Tables of the rows that are trained."""
    cells = trained(found)
    if not cells:
        return "No row is trained yet."
    picture = "![Scores against decisions and time](results/benchmark/curves.png)"
    return f"{benchmark.tables(cells, benchmark.as_markdown)}\n{picture}"


def rules_table(found: Any) -> str:
    """Table of the oracle, and of rules, which learn nothing."""
    rules = [cell for cell in cells_of(found) if cell.decisions is None]
    return benchmark.as_markdown(*benchmark.table_of(benchmark.rows_of([*benchmark.read([REFERENCES]), *rules])))


def check_table(found: Any) -> str:
    """Means of the check episodes, in bold where they are outside the interval of the test episodes."""
    before = {(row.agent, row.track): row for row in benchmark.rows_of(trained(found))}
    lines = []
    for row in benchmark.rows_of(trained(found, benchmark.FIRST["check"])):
        shown = dict.fromkeys(ENTRIES, "–")
        for id in row.cells:
            mean, of_test = row.measure(id).mean, before[row.agent, row.track].measure(id)
            shown[id] = f"{mean:.3g}" if of_test.low <= mean <= of_test.high else f"**{mean:.3g}**"
        lines.append([row.agent, row.track, *shown.values()])
    return markdown(
        ["agent", "track", *(id.removeprefix("Seastar").removesuffix("-v0") for id in ENTRIES)], lines, (0, 1)
    )


def draw_curves(found: Any, file: Path) -> None:
    """Mean score of every row against decisions, and against processor time."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for row in (row for *_, rows in benchmark.groups(trained(found)) for row in rows):
        curves = [(id, cell.curve) for id, own in row.cells.items() for cell in own if id in benchmark.scales()]
        if not curves:
            continue
        points = []
        for at in zip(*(curve for _, curve in curves), strict=False):
            scales = [benchmark.scales()[id] for id, _ in curves]
            scores = [(g - point["measure"]) / (g - o) for (g, o), point in zip(scales, at, strict=True)]
            points.append(
                [np.mean([point[name] for point in at]) for name in ("decisions", "seconds")] + [np.mean(scores)]
            )
        decisions, seconds, scores = np.transpose(points)
        for axis, x in zip(axes, (decisions / 1000.0, seconds), strict=True):
            axis.plot(x, scores, marker="o", label=f"{row.agent}, {row.track}")
    axes[0].set(xlabel="decisions [1000]", ylabel="mean score over ids and seeds")
    axes[0].set_ylim(-1.0, 1.0)  # learners that rest score below, the oracle 1
    axes[1].set(xlabel="processor time of a training [s]")
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize="small", loc="outside lower center", ncols=3)
    save_figure(figure, file)


STUDY = Study(
    "methods", run, Options, "benchmark/benchmark.json",
    pictures={"curves.png": draw_curves},
    tables={
        "benchmark ids": ids_table, "benchmark rows": rows_table, "benchmark rules": rules_table,
        "benchmark check": check_table,
    },
)  # fmt: skip
