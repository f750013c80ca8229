"""Methods on the benchmark: the page's tables and pictures, from the cells that `agents.tasks --benchmark` trained.

--references swims the greedy rules, a planner and the oracle instead: an id after the other, those that are missing or
of another contract. Scores are measured between rules and oracle.
"""

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from agents.methods import METHODS
from seastar_gym.evaluation import benchmark
from seastar_gym.evaluation.benchmark import ENTRIES, EPISODES, GREEDY, ORACLE, REFERENCES, TRACKS, Cell, contract
from seastar_gym.evaluation.results import difference_of_episodes
from seastar_gym.evaluation.rollout import measure_of_task
from seastar_gym.files import save_figure
from studies.frame import Results, Study, commit_of, provenance, rounded
from studies.oracle import Adaptive, Planner, oracle_of
from studies.pages import markdown
from studies.style import CYCLE, INK, subplots
from studies.tasks import greedy

AGENTS = {GREEDY: greedy, "planner": Planner, "adaptive": Adaptive, ORACLE: oracle_of}


@dataclass(frozen=True)
class Options:
    """Which cells are read, or whether references are swum instead."""

    cells: Path = Path("runs/benchmark")
    """Folder of the cells."""
    references: bool = False
    """Swim the greedy rules, the planner and the oracle, and write them into the package."""


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


def run(options: Options, results: Results) -> str | None:
    """Put the cells of all files together, or swim the references."""
    if options.references:
        swim_references()
        return None
    places = {name: place for place, name in enumerate(METHODS)}
    cells = benchmark.read(sorted(options.cells.glob("*/*/*.json")))
    cells.sort(key=lambda cell: (cell.decisions or 0, places.get(cell.agent, len(places))))
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
            f"`{id}`<br>[![{id}](ids/{id}.png)](ids/{id}.gif)", entry.why,
            f"{measures[id].name} [{measures[id].unit}], {measures[id].better} is better",
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
    names = {"scores": "Scores with intervals", "curves": "Scores against decisions and time"}
    pictures = [f"![{what}](results/benchmark/{name}.png)" for name, what in names.items()]
    return "\n\n".join([benchmark.tables(cells, benchmark.as_markdown).strip(), *pictures])


def rules_table(found: Any) -> str:
    """Table of the oracle, and of rules, which learn nothing."""
    rules = [cell for cell in cells_of(found) if cell.decisions is None]
    return benchmark.as_markdown(*benchmark.table_of(benchmark.rows_of([*benchmark.read([REFERENCES]), *rules])))


def check_table(found: Any) -> str:
    """Means of the test and of the check episodes of the same seeds; bold where their difference is not noise."""
    before, lines, first = benchmark.named_rows(trained(found)), [], benchmark.FIRST["check"]
    for name, row in benchmark.named_rows(trained(found, first)).items():
        name = name.removesuffix(f", from {first}")
        shown = dict.fromkeys(ENTRIES, "–")
        for id, cells in row.cells.items():
            of_test = {cell.seed: cell for cell in before[name].cells[id]}
            pair = [of_test[cell.seed].measure for cell in cells], [cell.measure for cell in cells]
            differs, text = difference_of_episodes(*pair), ", ".join(f"{np.mean(each):.3g}" for each in pair)
            shown[id] = (f"**{text}**" if differs.low > 0.0 or differs.high < 0.0 else text) + f" ({len(cells)})"
        lines.append([name, *shown.values()])
    return markdown(["agent, track", *(id.removeprefix("Seastar").removesuffix("-v0") for id in ENTRIES)], lines)


def draw_scores(found: Any, file: Path) -> None:
    """Scores of all rows with their intervals, beside those of the rules."""
    ids = benchmark.scales()
    scored = [(row.overall(ids), row, name) for name, row in benchmark.named_rows(trained(found)).items()]
    scored = sorted((each for each in scored if not np.isnan(each[0].mean)), key=lambda each: each[0].mean)
    figure, axis = subplots(1, 1, figsize=(7.2, 1.2 + 0.28 * len(scored)))
    labels = []
    for place, (score, row, name) in enumerate(scored):
        colour, seeds = CYCLE[TRACKS.index(row.track)], sorted({len(cells) for cells in row.cells.values()})
        axis.plot([score.low, score.high], [place, place], color=colour, lw=2.0)
        axis.plot(score.mean, place, "o", color=colour)
        labels.append(f"{name} ({' to '.join(map(str, seeds[:1] + seeds[1:][-1:]))})")
    for rule in benchmark.rows_of([*benchmark.read([REFERENCES])]):
        at = rule.overall(ids).mean
        axis.axvline(at, color=INK, lw=1.0, ls="--")
        axis.annotate(rule.agent, (at, len(scored) - 0.3), rotation=90.0, ha="center", annotation_clip=False)
    axis.set_yticks(range(len(scored)), labels)
    axis.set(xlabel="score and its 95 % interval (numbers of seeds)", ylim=(-0.6, len(scored) - 0.4))
    save_figure(figure, file)


def draw_curves(found: Any, file: Path) -> None:
    """Score of every row that has one against decisions, and against processor time."""
    figure, axes = subplots(1, 2, figsize=(9.0, 4.2), sharey=True)
    scales, colours = benchmark.scales(), dict(zip(METHODS, (*CYCLE, INK), strict=False))
    for name, row in benchmark.named_rows(trained(found)).items():
        cells: list[Any] = [cell for own in row.cells.values() for cell in own]
        points: list[list[float]] = []
        for k in range(min(len(cell.curve) for cell in cells)):
            then = {
                id: [cell._replace(measure=[cell.curve[k]["measure"]]) for cell in own] for id, own in row.cells.items()
            }
            means = (np.mean([cell.curve[k][what] for cell in cells]) for what in ("decisions", "seconds"))
            points.append([*means, row._replace(cells=then).overall(scales).mean])
        style: dict[str, Any] = {"color": colours.get(row.agent), "ls": "-" if row.track == "symmetric" else "--"}
        if points and not np.isnan(points[-1][-1]):  # it has all ids
            decisions, seconds, scores = np.transpose(points)
            for axis, x in zip(axes, (decisions / 1000.0, seconds), strict=True):
                axis.plot(x, scores, marker="o", label=name, **style)
    for axis, ticks in zip(axes, ([25, 50, 100, 200, 500, 1000], [10, 30, 100, 300, 1000]), strict=True):
        axis.set_xscale("log")
        axis.set_xticks(ticks, [*map(str, ticks)])
        axis.minorticks_off()
    axes[0].set(xlabel="decisions [1000]", ylabel="score")
    axes[1].set(xlabel="processor time of a training [s]")
    figure.legend(*axes[0].get_legend_handles_labels(), fontsize="small", loc="outside lower center", ncols=3)
    save_figure(figure, file)


STUDY = Study(
    "methods", run, Options, "benchmark/benchmark.json",
    pictures={"scores.png": draw_scores, "curves.png": draw_curves},
    tables={
        "benchmark ids": ids_table, "benchmark rows": rows_table, "benchmark rules": rules_table,
        "benchmark check": check_table,
    },
)  # fmt: skip
