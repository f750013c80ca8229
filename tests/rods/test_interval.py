"""How an interval is covered, told by steps whose outcome the test decides: halvings, doublings, fallback, failure."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np
import pytest

from seastar_gym import Scene, Seastar
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods import interval
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.interval import cover_interval
from seastar_gym.rods.newton import Limits
from seastar_gym.rods.step import (
    COVERED,
    HALVINGS,
    NEWTON_ITERATIONS,
    REJECTIONS,
    REPORT_ROWS,
    SCHEMES,
    SIZE,
    STEPS,
    memory_row,
)
from slopes import plain, rows

ROBOT = Seastar(5, 3)
RODS = make_rods(Scene(ROBOT))
MIDPOINT, EULER = SCHEMES["implicit-midpoint"], SCHEMES["implicit-euler"]
EVERYONE = np.ones(N_LANES, bool)
FIRST = np.arange(N_LANES) == 0
LIMIT, DURATION, MOST = 2.0, 0.4, 1000
SMALL, LARGE = 0.1 * LIMIT, 0.5 * LIMIT
"""Errors that let a step be doubled, and not."""


def lanes(x) -> np.ndarray:
    return np.broadcast_to(plain(x), N_LANES)


class Script:
    """Steps of robot 0: 's' is stuck, 'r' rejected, 'a' accepted with a large error, any other with a small one.

    A function instead of such letters tells the error of a step. All other robots' steps are accepted with a large one.
    """

    def __init__(self, outcomes: str | Callable[[SimpleNamespace], float], iterations: float = 0.0):
        self.outcomes, self.iterations, self.tried, self.accepted = outcomes, iterations, [], []

    def __call__(self, rods, work, tableau, actuation, q, v, a, step, going, limits, report):
        going = going.robots
        good, accepted, error = going.copy(), going.copy(), np.full(N_LANES, LARGE)
        if going[0]:
            self.tried.append(
                SimpleNamespace(
                    start=lanes(step.start)[0], size=lanes(step.size)[0], h=lanes(step.h)[0],
                    most=lanes(step.iteration_limit)[0], retrying=lanes(step.retrying)[0], fallback=tableau is EULER,
                )
            )  # fmt: skip
            good[0], error[0] = self.outcome()
            accepted[0] = good[0] and error[0] <= LIMIT
            self.accepted.append(bool(accepted[0]))
        report[NEWTON_ITERATIONS] += self.iterations * going
        return Mask(good), Mask(accepted), Lanes(error)

    def outcome(self) -> tuple[bool, float]:
        """(whether the step that was tried last is not stuck, its error)."""
        if callable(self.outcomes):
            return True, self.outcomes(self.tried[-1])
        letter = self.outcomes[min(len(self.tried), len(self.outcomes)) - 1]
        return letter != "s", {"r": 2.0 * LIMIT, "a": LARGE}.get(letter, SMALL)


def cover(monkeypatch, outcomes, adaptive=False, last_size=0.0, iterations=0.0, alive=EVERYONE):
    script = Script(outcomes, iterations)
    monkeypatch.setattr(interval, "try_step", script)
    limits = Limits(np.array([1e-9]), 20, MOST, adaptive, np.array([LIMIT]))
    report = np.zeros((len(REPORT_ROWS), N_LANES))
    a = np.zeros((2 * ROBOT.n_nodes + 3, N_LANES))
    a[memory_row(RODS, MIDPOINT, SIZE)] = last_size
    args = RODS, make_work(RODS, 1), MIDPOINT, EULER, None, rows(ROBOT.nodes()), None, a, DURATION
    arrived = lanes(cover_interval(*args, Mask(alive), limits, report))
    return SimpleNamespace(
        tried=script.tried, accepted=script.accepted, arrived=arrived, report=report,
        size=a[memory_row(RODS, MIDPOINT, SIZE)],
    )  # fmt: skip


STORIES = {
    "no trouble": ("a", {}),
    "stuck: halves its step and covers the rest in small ones": ("ssa", {}),
    "stuck at the shortest step: fails": ("s", {}),
    "stuck and its iterations spent: fails at once": ("s", {"iterations": MOST}),
    "its iterations spent, but not stuck: goes on": ("a", {"iterations": MOST}),
    "failed before: left alone": ("s", {"alive": ~FIRST}),
    "adapted: begins with an eighth and doubles on the grid of its own size": ("+", {"adaptive": True}),
    **{f"adapted: {what}": (outcomes, {"adaptive": True, "last_size": 2.0**-k}) for what, outcomes, k in (
        ("goes on with the last step's length", "a", 1),
        ("an error that is too large halves it", "ra", 1),
        ("doubles four accepted steps after a halving, and waits twice as long for the next", "ss+", 3),
        ("and so after the next halving", "s++++s+", 4),
        ("no doubling leads back from the fallback", "ssss+", 0),
        ("stuck at the shortest step, it tries again", "ss+", 12),
    )},
}  # fmt: skip
"""Outcomes of robot 0's steps, and options."""


def told(found: SimpleNamespace) -> Iterator[str]:
    """The first steps of robot 0, and what is counted and kept of it and of its neighbour."""
    for step, good in [*zip(found.tried, found.accepted, strict=True)][:60]:
        how = f"{' retrying' * bool(step.retrying)}{' fallback' * step.fallback}{'' if good else ' in vain'}"
        yield f"at {step.start:.9g} {step.size:.9g}, {step.most:g} iterations{how}"
    rows = HALVINGS, REJECTIONS, STEPS, COVERED
    for k in (0, 1):
        counted = " ".join(f"{number:.9g}" for number in found.report[rows, k])
        yield f"arrived: {found.arrived[k]}, counted: {counted}, next {found.size[k]:.9g}"


def test_steps_are_halved_and_doubled(monkeypatch, golden):
    """Every halving of a robot that is stuck gives it more iterations, and after four of them it goes on with the
    fallback; those of an error that is too large do not count. Other robots take their own steps. The file shows it."""
    found = {name: cover(monkeypatch, outcomes, **options) for name, (outcomes, options) in STORIES.items()}
    for each in found.values():
        ways = [step.size * good for step, good in zip(each.tried, each.accepted, strict=True)]
        assert [step.start for step in each.tried] == np.cumsum([0.0, *ways])[: len(ways)].tolist()
    golden("steps.txt", "\n".join(line for name, each in found.items() for line in ("", name, *told(each))))


@pytest.mark.parametrize("largest", 2.0 ** np.linspace(-4.9, -3.1, 8))
def test_adapted_steps_grow_to_where_their_errors_let_them_and_are_not_refused_there(monkeypatch, largest):
    """The error per time of a step that is twice as long is four times as large; a quarter of the interval is hard."""

    def error(step):
        return LIMIT * (step.size / (largest if step.start >= 0.25 else 2.0**-8)) ** 2

    found = cover(monkeypatch, error, adaptive=True)
    settled = np.array([step.size for step in found.tried if step.start > 0.5])
    assert found.arrived.all() and np.all((settled > 0.4 * largest) & (settled <= largest))
