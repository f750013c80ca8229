"""Results of the tasks: the bound, which tasks are kept, and the table, picture and verdicts that follow."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.tasks.envs import CHALLENGES
from seastar_gym.evaluation.measures import measure_of_challenge
from seastar_gym.evaluation.statistics import crossed_interval
from seastar_gym.files import save_figure
from studies.pages import markdown
from studies.style import CYCLE, FAINT, as_numbers, subplots

MORE_IS_BETTER = tuple(name for name, each in CHALLENGES.items() if measure_of_challenge(each).better == "more")
ORDER = ("rest", "greedy", "planner", "adaptive", "prior", "informed", "turn, then swim", "PPO", "PPO, memory",
         "PPO, told the way", "PPO, memory, coasting", "RecurrentPPO", "bundled")  # fmt: skip
"""Agents from top to bottom."""
HEADROOM, LEFT = 0.2, 1.0 / 3.0
"""A task is kept where the bound is so much better than greedy, and PPO leaves so much of that."""


class Row(NamedTuple):
    """Results of a task."""

    id: str
    challenge: str
    agents: dict[str, list[NDArray[np.float64]]]
    """Measures of all episodes, one array for every seed."""

    @property
    def in_order(self) -> list[tuple[str, list[NDArray[np.float64]]]]:
        """Agents and their measures, from top to bottom."""
        return sorted(self.agents.items(), key=lambda one: ORDER.index(one[0]))

    def mean(self, agent: str, episodes: int | None = None) -> float:
        """Mean measure of an agent over seeds and the first episodes, all if None."""
        return float(np.mean([values[:episodes].mean() for values in self.agents[agent]]))

    def shared(self, agent: str) -> float:
        """Mean measure of an agent over the episodes that all agents of the row have swum, for comparisons."""
        return self.mean(agent, min(len(values) for seeds in self.agents.values() for values in seeds))

    @property
    def bound(self) -> str:
        """The agent with the best mean."""
        best = max if self.challenge in MORE_IS_BETTER else min
        return best(self.agents, key=self.shared)

    def is_ahead(self, agent: str, *others: str) -> bool:
        """Whether the mean of an agent is better than those of the others that have swum."""
        sign = 1.0 if self.challenge in MORE_IS_BETTER else -1.0
        return all(sign * self.shared(agent) > sign * self.shared(other) for other in set(others) & self.agents.keys())

    @property
    def headroom(self) -> float:
        """By how much of greedy's measure the bound is better; infinite where greedy catches nothing."""
        greedy, bound = self.shared("greedy"), self.shared(self.bound)
        return abs(bound - greedy) / greedy if greedy > 0.0 else np.inf

    @property
    def better(self) -> str:
        """The headroom in words."""
        return f"{100.0 * self.headroom:.0f} %" if self.headroom < 10.0 else "more than ten times"

    @property
    def left(self) -> float:
        """Share of the headroom that PPO leaves."""
        greedy, bound = self.shared("greedy"), self.shared(self.bound)
        return abs(bound - self.shared("PPO")) / abs(bound - greedy)

    @property
    def is_kept(self) -> bool:
        """Whether the task has headroom that PPO does not take."""
        return self.headroom >= HEADROOM and self.left >= LEFT


def rows_of(results: Mapping[str, Any], ids: Mapping[str, str]) -> list[Row]:
    """Results by task."""
    rows = {id: Row(id, challenge, {}) for id, challenge in ids.items()}
    for name, found in results["cells"].items():
        id, _, rest = name.partition(", ")
        agent, _, _ = rest.rpartition(", ")
        rows[id].agents.setdefault(agent, []).append(np.array(found["measure"]))
    return [row for row in rows.values() if row.agents]


UNITS = {
    "miswired": "seconds to the last waypoint, 400 if it is not reached",
    "prey": "prey caught in 200 s",
    "fast-prey": "prey caught in 200 s",
    "station": "mean distance from the station after 30 s [mm]",
    "fail-blind": "seconds to the last waypoint, the time limit if it is not reached",
    "obst-trap": "seconds to the goal, the time limit if it is not reached",
    "prizes": "worth of the prizes taken in 200 s",
    "fast-prizes": "worth of the prizes taken in 115 s",
    "sim-to-real": "seconds to the last waypoint, the time limit if it is not reached",
    "heading": "seconds to the last waypoint, 300 if it is not reached",
}
"""Measures in words, by challenge."""
SHORT = {
    "miswired": "seconds to the last waypoint",
    "station": "mean distance from the station [mm]",
    "fail-blind": "seconds to the last waypoint",
    "obst-trap": "seconds to the goal",
    "sim-to-real": "seconds to the last waypoint",
    "heading": "seconds to the last waypoint",
}
"""What the picture says in their place."""
RECURRENT = "RecurrentPPO"
"""Agent that is not missing where it has not swum: it needs a package of its own."""
COLUMNS = {
    "greedy": "greedy", "planner": "planner", "adaptive": "adaptive", "informed": "oracle", "PPO": "PPO",
    "PPO, memory": "PPO, frame stack", ORDER[-1]: "bundled",
}  # fmt: skip
"""Agents of the page's table, and their names there."""
IN_TABLE = {
    "miswired": "time [s]", "fail-blind": "time [s]", "obst-trap": "time [s]", "sim-to-real": "time [s]",
    "prey": "prey caught", "fast-prey": "prey caught", "station": "distance [mm]", "prizes": "worth",
    "fast-prizes": "worth",
}  # fmt: skip
"""Measures in the page's table, by challenge."""


def means(rows: Sequence[Row]) -> str:
    """Table in Markdown of the means of all tasks that have a greedy agent."""
    lines = []
    for row in (row for row in rows if "greedy" in row.agents):
        numbers = [f"{row.mean(agent):.3g}" if agent in row.agents else "" for agent in COLUMNS]
        lines.append([f"`{row.id.removeprefix('Seastar').removesuffix('-v0')}`", IN_TABLE[row.challenge], *numbers])
    return markdown(["task", "measure", *COLUMNS.values()], lines, (0, 1))


def table(row: Row, has_cell: Callable[[str, str], bool] = lambda id, agent: True) -> str:
    """Everything about a task in Markdown, for the terminal. has_cell: Whether an agent can swim a task, by its id."""
    rows = []
    for agent, seeds in row.in_order:
        low, high = crossed_interval(seeds)
        each = ", ".join(f"{values.mean():.3g}" for values in seeds) if len(seeds) > 1 else ""
        rows.append([agent, f"{row.mean(agent):.3g}", f"{low:.3g} to {high:.3g}", min(map(len, seeds)), each])
    head = ["agent", "mean", "95 % interval", "episodes", "means of seeds"]
    parts = [f"## {row.id}", f"{UNITS[row.challenge].capitalize()}.", markdown(head, rows, (0, 2, 4))]
    missing = [agent for agent in ORDER if agent not in (*row.agents, RECURRENT) and has_cell(row.id, agent)]
    if missing:
        parts.append(f"Not swum yet: {'; '.join(missing)}.")
    if {"greedy", "informed"} <= row.agents.keys():
        judged = _verdict(row) if "PPO" in row.agents else ""
        parts.append(f"Bound: {row.bound}, {row.better} better than greedy.{judged}")
    return "\n\n".join(parts)


def _verdict(row: Row) -> str:
    """What PPO leaves, and whether the task is kept for that."""
    return f" Gap left by PPO: {100.0 * row.left:.0f} %. By this, {'kept' if row.is_kept else 'not kept'}."


def draw(rows: Sequence[Row], file: Path) -> None:
    """Draw means and intervals of all agents, a panel for every task with the agents that have swum it."""
    columns = min(2, len(rows))
    lines = -(-len(rows) // columns)
    figure, grid = subplots(lines, columns, figsize=(3.6 * columns, 2.5 * lines + 0.4), squeeze=False)
    panels = iter(grid.flat)
    for row, axes in zip(rows, panels, strict=False):  # in this order, so that no panel is lost
        _draw_row(axes, row)
    for axes in panels:
        axes.set_axis_off()
    handles = [grid[0, 0].plot([], [], "o-", color=colour, lw=2.5)[0] for colour in (FAINT, CYCLE[0])]
    figure.legend(handles, ["rule or planner", "learned"], title="mean and its 95 % interval",
                  loc="outside upper center", ncols=2)  # fmt: skip
    save_figure(figure, file)


def _draw_row(axes: Any, row: Row) -> None:
    names = [agent for agent, _ in row.in_order]
    for place, (agent, seeds) in enumerate(row.in_order):
        mean, (low, high) = row.mean(agent), crossed_interval(seeds)
        colour = CYCLE[0] if agent.startswith(("PPO", "Rec", "bundled")) else FAINT
        axes.plot([low, high], [place, place], color=colour, lw=2.5, solid_capstyle="butt")
        axes.plot(mean, place, "o", color=colour, ms=5)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    better = "more is better" if row.challenge in MORE_IS_BETTER else "less is better"
    axes.set_title(row.id)
    axes.set_xlabel(f"{SHORT.get(row.challenge, UNITS[row.challenge])}\n({better})", fontsize="small")
    axes.set_xlim(left=-0.02 * axes.get_xlim()[1])
    if row.challenge == "station":
        axes.set_xscale("log")
        axes.set_xlim(0.3, 200.0)
        as_numbers(axes.xaxis)


RULES = ("rest", "greedy", "planner", "adaptive")
"""Agents that neither learn nor are told what is hidden."""
BUNDLED, MEMORY, TOLD = "bundled", "PPO, memory", "informed"
"""Agents that swim the policy that the package brings for a task, learn with a memory, and know what is hidden."""


def verdicts(rows: Sequence[Row]) -> str:
    """Paragraphs of the page in Markdown; those for which agents have not swum yet are left out."""
    judged = [row for row in rows if {"greedy", "informed", "PPO"} <= row.agents.keys()]
    boxed = [row for row in rows if {BUNDLED, MEMORY, *RULES[:3]} <= row.agents.keys()]
    paragraphs = [_kept(judged)] * bool(judged) + [_in_the_box(boxed)] * bool(boxed)
    return "\n\n".join(textwrap.fill(each, 120, break_on_hyphens=False) for each in paragraphs)


def _kept(rows: Sequence[Row]) -> str:
    dropped = [row for row in rows if not row.is_kept]
    text = f"{len(rows) - len(dropped)} of {len(rows)} tasks are kept."
    if dropped:
        text += f" Not kept: {'; '.join(map(_why_not, dropped))}."
    return text


def _why_not(row: Row) -> str:
    if row.left < LEFT:
        return f"{_name(row)}, where PPO leaves {100.0 * row.left:.0f} % of the gap"
    return f"{_name(row)}, whose bound is only {100.0 * row.headroom:.0f} % better than greedy"


def _in_the_box(rows: Sequence[Row]) -> str:
    trained = sum(row.is_ahead(BUNDLED, MEMORY) for row in rows)
    ahead = [row for row in rows if row.is_ahead(BUNDLED, *RULES)]
    also = [row for row in ahead if row.is_ahead(BUNDLED, TOLD)]
    return (
        f"Six times the training is worth more than a frame stack alone on {trained} of {len(rows)} tasks. Bundled "
        f"policies beat every rule that is not told what is hidden on {_names(ahead)}, and also the one that is told "
        f"on {_names(also)}. Elsewhere rules that remember or plan are ahead."
    )


def _name(row: Row) -> str:
    return f"`{row.id.removeprefix('Seastar').removesuffix('-v0')}`"


def _names(rows: Sequence[Row]) -> str:
    *most, last = [_name(row) for row in rows] or ["no task"]
    return f"{', '.join(most)} and {last}" if most else last
