"""Page and picture of the headroom of the tasks."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from seastar_gym.evaluation.statistics import crossed_interval
from studies.provenance import footer
from studies.style import CYCLE, FAINT, as_numbers, subplots
from studies.tasks.rows import MORE_IS_BETTER, ORDER, Row, rows_of
from studies.tasks.verdicts import verdicts

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
OPTIONAL = "RecurrentPPO"
"""Agent that is not missing where it has not swum: it needs a package of its own."""
INTRODUCTION = """# Tasks with headroom

{command} writes this page. Every agent swims the same held-out episodes, the first of the split "test", at
fidelity "{fidelity}", {episodes} of them or as many as the table says. Learners are trained for {decisions:,} decisions
on the split "train". Numbers are means. Their 95 % intervals are those of a bootstrap over seeds and episodes; of one
seed, over episodes. Where a learner has several seeds, the mean of each is given. What is missing, or has swum fewer
episodes, is swum by the same command, which goes on where it was broken off; `--seeds 0 1 2` adds seeds.

Learners have one to three seeds, and differ from seed to seed: the last column has each.

A task is kept if the best that was found is at least 20 % better than greedy, and if PPO leaves at least a third of
that after {decisions:,} decisions. *Bound* is the best mean of all agents of a row: what can be reached, not a proof
that nothing is better. *Gap left* is the share of the way from greedy to the bound that a learner does not go.
Comparisons are over the episodes that all agents of a task have swum.

| agent | what it is |
|---|---|
| rest | no limb is ever heated |
| greedy | the action whose mean displacement, by a map, ends nearest |
| planner | simulates a decision ahead what is observed, as if nothing hidden differed from what is usual |
| adaptive | remembers: goes by the wires, the drift, .. that have explained the past best; keeps a map of discs |
| prior | besides, is told how `ObstTrap` draws horseshoes: it swims around the most probable one, too |
| informed | is told what is hidden: the wires, the water, the course of the prey, the dead limbs, all discs |
| turn, then swim | of `SeastarSwimHeading-v0`: a wave of single limbs turns, then the bundled policy swims |
| PPO | tuned for this robot and symmetric: the project's hyperparameters, horizons of `agents.tasks.learning.OWN` |
| PPO, memory | the same, and tips, last commands and targets of the last eight observations |
| PPO, told the way | PPO of `ObstTrap`, by a reward that measures the way around all discs |
| PPO, memory, coasting | PPO of `SimToReal` with a memory; its reward measures where the robot would come to rest |
| bundled | the bundled policy, one training: PPO with memory, after six times as many decisions |

To the planner, wires are as they should be, the water is still, prey swim straight on, all limbs are alive, and the
way between the discs that it sees is the straight one. The current of `Station` is hardly hidden: it shows in the
velocities over ground (R2 = 0.97 after one decision at rest), so that the task is to keep a place in it. Of prizes
nothing is hidden: there, the planner swims to the prize of most worth per metre as greedy does, and *informed* is the
best round through those that are left, planned before every decision. Contracts of the tasks stand in the docstrings of
`Miswired`, `Prey`, `Station`, `FailBlind`, `ObstTrap`, `Prizes` and `SimToReal`.

In `SeastarSwimHeading-v0` nothing is hidden, either, and its agents are other ones, so that it is not judged. They swim
random paths with random headings, those of the seeds from 1000 on, that no training draws, within 300 s. *Turn, then
swim* decides every 0.2 s, as its wave asks for, the others every 0.5 s, among them PPO on random headings.

Bundled policies are in `seastar_gym/controllers/policies/tasks`, each with a card. `python -m agents.tasks` trains
them, that of `ObstTrap` by the reward that measures the way around all discs. That of `SimToReal` is an imitation of
the bundled policy of waypoints, which sees the true state: 98,304 decisions of supervised learning, by no reward. To
watch one, type `seastar swim --task SeastarPrey-v0 --agent learned`.

{verdicts}In `ObstTrap`, the reward's way to the goal is the straight one, which leads into the horseshoe. That a
learner does not arrive by this reward says little about other rewards: *told the way* is one. `Prizes` keeps draws
alone in which the best round brings a point 40 % more than the greedy one, so its headroom is by choice of the draws.
"""


def table(row: Row, has_cell: Callable[[str, str], bool] = lambda id, agent: True) -> str:
    """Table in Markdown of a task. has_cell: Whether an agent can swim a task, by its id."""
    lines = [f"## {row.id}", "", f"{UNITS[row.challenge].capitalize()}.", ""]
    lines += ["| agent | mean | 95 % interval | episodes | means of seeds |", "|---|---:|---|---:|---|"]
    for agent, seeds in row.in_order:
        low, high = crossed_interval(seeds)
        each = ", ".join(f"{values.mean():.3g}" for values in seeds) if len(seeds) > 1 else ""
        n_episodes = min(map(len, seeds))
        lines.append(f"| {agent} | {row.mean(agent):.3g} | {low:.3g} to {high:.3g} | {n_episodes} | {each} |")
    missing = [agent for agent in ORDER if agent not in (*row.agents, OPTIONAL) and has_cell(row.id, agent)]
    if missing:
        lines += ["", f"Not swum yet: {'; '.join(missing)}."]
    if {"greedy", "informed"} <= row.agents.keys():
        judged = _verdict(row) if "PPO" in row.agents else ""
        lines += ["", f"Bound: {row.bound}, {row.better} better than greedy.{judged}"]
    return "\n".join(lines)


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
    figure.savefig(file)


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


def page(
    results: Mapping[str, Any], ids: Mapping[str, str], picture: Path, has_cell: Callable[[str, str], bool]
) -> str:
    """The page in Markdown. picture: Its file, beside which the tasks' pictures are. has_cell: See `table`."""
    rows, settings = rows_of(results, ids), results["settings"]
    most = max((len(values) for row in rows for seeds in row.agents.values() for values in seeds), default=0)
    text = INTRODUCTION.format(command="`python -m studies.tasks`", episodes=most, verdicts=verdicts(rows), **settings)
    text += _pictures(picture.parent / "tasks", dict.fromkeys(row.challenge for row in rows))
    tables = "\n\n".join(table(row, has_cell) for row in rows)
    return f"{text}\n![Means and intervals]({picture.name})\n\n{tables}\n\n{footer(results, 'tasks.json')}\n"


def _pictures(folder: Path, challenges: Iterable[str]) -> str:
    """Table in Markdown of the pictures of tasks that there are, two in a row; empty without any."""
    shown = [f"![{name}]({folder.name}/{name}.png)" for name in challenges if (folder / f"{name}.png").is_file()]
    if not shown:
        return ""
    pairs = [shown[k : k + 2] for k in range(0, len(shown), 2)]
    rows = ["| " + " | ".join([*pair, ""][:2]) + " |" for pair in pairs]
    return (
        "\n".join(["\n`python -m studies.tasks.pictures` draws an episode of each:\n", "| | |", "|---|---|", *rows])
        + "\n"
    )
