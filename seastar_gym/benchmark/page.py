"""Table, profiles and page of a benchmark."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.benchmark.results import Entry, best_means, relative
from seastar_gym.evaluation.statistics import Estimate, mean_with_interval, profile
from seastar_gym.files import save_figure

Floats = NDArray[np.float64]
LEVELS = np.linspace(0.0, 1.2, 241)
"""Levels of the profiles: scores relative to the best agent of a task."""


def names(entries: Sequence[Entry], what: str) -> list[str]:
    """Tasks or agents of the entries, in their order."""
    return list(dict.fromkeys(getattr(entry, what) for entry in entries))


def plain(name: str) -> str:
    """A name as Markdown shows it, whatever is in it."""
    return re.sub(r"([\\`*\[\]<>|&~$])", r"\\\1", name)


def code(command: str) -> str:
    """A command as code in Markdown, between more backticks than it has in a row."""
    ticks = "`" * (1 + max(map(len, re.findall("`+", command)), default=0))
    return f"{ticks} {command} {ticks}" if len(ticks) > 1 else f"`{command}`"


def table(entries: Sequence[Entry]) -> str:
    """Table in Markdown: means with intervals, and successes, of all agents on all tasks."""
    agents = names(entries, "agent")
    lines = [f"| task | measure | {' | '.join(map(plain, agents))} |", "|---|---|" + "---:|" * len(agents)]
    for (task, fidelity), row in by_task(entries).items():
        first = next(iter(row.values()))
        at = f", {code(fidelity)}" if fidelity else ""
        measure = f"{plain(first.measure)} [{plain(first.unit)}], {first.better} is better"
        cells = [cell(row.get(agent)) for agent in agents]
        lines.append(f"| {plain(task)}{at} | {measure} | {' | '.join(cells)} |")
    return "\n".join(lines)


def by_task(entries: Sequence[Entry]) -> dict[tuple[str, str], dict[str, Entry]]:
    """Entries by their agents, by task and fidelity."""
    found: dict[tuple[str, str], dict[str, Entry]] = {}
    for entry in entries:
        found.setdefault((entry.task, entry.fidelity), {})[entry.agent] = entry
    return found


def cell(entry: Entry | None) -> str:
    """Mean with its interval, and share of successes; a dash for no entry."""
    return "\u2013" if entry is None else f"{entry.estimate()}; {entry.success_rate:.0%}"


def common(entries: Sequence[Entry]) -> tuple[list[str], dict[str, Floats]]:
    """Tasks that every agent swam, and the relative scores on them by agent, shape (seeds, tasks)."""
    best, agents = best_means(entries), names(entries, "agent")
    by_task: dict[str, dict[str, Floats]] = {}
    for entry in entries:
        by_task.setdefault(entry.task, {})[entry.agent] = relative(entry, best[entry.task])
    n_seeds = min((len(entry.seeds) for entry in entries), default=0)
    tasks = [task for task, scores in by_task.items() if set(scores) == set(agents)]
    if not tasks:
        return [], {}
    return tasks, {agent: np.stack([by_task[task][agent][:n_seeds] for task in tasks], axis=1) for agent in agents}


def overall(scores: Mapping[str, Floats]) -> str:
    """Table in Markdown of the relative scores over all tasks, best agent first."""
    found = {agent: mean_with_interval(of_agent.ravel()) for agent, of_agent in scores.items()}
    lines = ["| agent | relative score |", "|---|---:|"]
    for agent, mean in sorted(found.items(), key=lambda pair: -pair[1].mean):
        lines.append(f"| {plain(agent)} | {_fine(mean)} |")
    return "\n".join(lines)


def _fine(mean: Estimate) -> str:
    return f"{mean.mean:.2f}" + ("" if np.isnan(mean.low) else f" [{mean.low:.2f}, {mean.high:.2f}]")


def draw(scores: Mapping[str, Floats], file: Path) -> None:
    """Picture of the performance profiles, with the intervals as bands."""
    from matplotlib.figure import Figure

    from seastar_gym.evaluation.pictures import COLOURS, LINE_STYLES

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    for number, (agent, of_agent) in enumerate(scores.items()):
        share, low, high = profile(of_agent, LEVELS)
        colour, style = COLOURS[number % len(COLOURS)], LINE_STYLES[number % len(LINE_STYLES)]  # one may hide another
        label, level = agent.replace("$", r"\$"), 4.0 - 0.01 * number
        axes.plot(LEVELS, 100.0 * share, color=colour, linestyle=style, label=label, zorder=level)
        axes.fill_between(LEVELS, 100.0 * low, 100.0 * high, color=colour, alpha=0.15, linewidth=0.0)
    axes.set(
        xlabel="score relative to the best agent's mean", ylabel="episodes that reach it [%]",
        xlim=(LEVELS[0], LEVELS[-1]), ylim=(0.0, 102.0),
    )  # fmt: skip
    axes.grid(color="0.92")
    axes.legend(frameon=False, loc="lower left")
    save_figure(figure, file, dpi=140)


def page(entries: Sequence[Entry], command: str, picture: str | None) -> str:
    """The page in Markdown. picture: File of the profiles beside the page, if there is one."""
    tasks, scores = common(entries)
    seeds = sorted({len(entry.seeds) for entry in entries})
    numbers = str(seeds[0]) if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"
    lines = [
        "# Leaderboard",
        "",
        f"Means over {numbers} episodes, one for each seed, with bootstrap intervals of 95 %, and the share of them",
        f"that ended with success ({code(' '.join(command.split()))}).",
        "Results of others are merged with `seastar benchmark --merge`.",
        "",
        table(entries),
    ]
    if len(scores) > 1:
        lines += [
            "",
            f"Scores relative to the best agent of each task, over the {len(tasks)} tasks that all agents swam:",
            "",
            overall(scores),
        ]
        if picture is not None:
            lines += ["", f"![Share of episodes whose relative score reaches a level]({picture})"]
    return "\n".join(lines) + "\n"
