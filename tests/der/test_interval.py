"""How an interval is covered, told by steps whose outcome the test decides: halvings, doublings, fallback, failure."""

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from seastar_gym import Scene, Seastar
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.interval import cover_interval, note_hub_angles
from seastar_gym.der.stepping.report import (
    BACKTRACKS,
    COVERED,
    HALVINGS,
    NEWTON_ITERATIONS,
    REGULARISED,
    REJECTIONS,
    REPORT_ROWS,
    SMALLEST_HUB_T,
    SOLVER_ITERATIONS,
    STEPS,
)
from seastar_gym.der.stepping.scales import Limits
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import LAST_STEP, SIZE, memory_row
from seastar_gym.der.stepping.steps import Step, end_guarded_step, solve_stages, try_step
from seastar_gym.der.terms.hub import Actuation
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import plain, rotated, rows

ROBOT = Seastar(5, 3)
RODS = make_rods(Scene(ROBOT))
MIDPOINT, EULER = SCHEMES["implicit-midpoint"], SCHEMES["implicit-euler"]
EVERYONE, NOBODY = np.ones(N_LANES, bool), np.zeros(N_LANES, bool)
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
    monkeypatch.setitem(cover_interval.plain.__globals__, "try_step", script)
    limits = Limits(np.array([1e-9]), 20, MOST, adaptive, np.array([LIMIT]))
    report = np.zeros((len(REPORT_ROWS), N_LANES))
    a = np.zeros((2 * ROBOT.n_nodes + 3, N_LANES))
    a[memory_row.plain(RODS, MIDPOINT, SIZE)] = last_size
    args = RODS, make_work(RODS, 1), MIDPOINT, EULER, None, rows(ROBOT.nodes()), None, a, DURATION
    arrived = lanes(cover_interval.plain(*args, Mask(alive), limits, report))
    return SimpleNamespace(
        tried=script.tried, accepted=script.accepted, arrived=arrived, report=report,
        sizes=[step.size for step in script.tried], halvings=[round(step.most / 20.0) - 1 for step in script.tried],
        size=a[memory_row.plain(RODS, MIDPOINT, SIZE)],
    )  # fmt: skip


EIGHTH, SIXTEENTH, SHORTEST = 2.0**-3, 2.0**-4, 2.0**-12
STORIES = {
    "no trouble": ("a", {}, [1.0]),
    "stuck: halves its step and covers the rest in small ones": ("ssa", {}, [1.0, 0.5] + 4 * [0.25]),
    "stuck at the shortest step: fails": ("s", {}, [0.5**k for k in range(13)]),
    "adapted: begins with an eighth and doubles on the grid of its own size": ("+", {}, [EIGHTH, EIGHTH, 0.25, 0.5]),
    "adapted: goes on with the last step's length": ("a", {"last_size": 0.5}, [0.5, 0.5]),
    "adapted: an error that is too large halves it": ("ra", {"last_size": 0.5}, [0.5] + 4 * [0.25]),
    "adapted: doubles four accepted steps after a halving": (
        "s+", {"last_size": SIXTEENTH}, [SIXTEENTH] + 4 * [SIXTEENTH / 2] + [SIXTEENTH],
    ),
    "adapted: the next doubling waits twice as long": (
        "ss+", {"last_size": EIGHTH}, [EIGHTH, SIXTEENTH] + 4 * [SIXTEENTH / 2] + 8 * [SIXTEENTH] + [EIGHTH],
    ),
    "adapted: and so after the next halving": (
        "s++++s+", {"last_size": SIXTEENTH},
        [SIXTEENTH] + 4 * [SIXTEENTH / 2] + [SIXTEENTH] + 8 * [SIXTEENTH / 2] + [SIXTEENTH],
    ),
    "adapted: no doubling leads back from the fallback": (
        "ssss+", {"last_size": 1.0}, [1.0, 0.5, 0.25, EIGHTH] + 16 * [SIXTEENTH],
    ),
    "adapted: stuck at the shortest step, it tries again": (
        "ss" + 100 * "a", {"last_size": SHORTEST}, 4 * [SHORTEST],
    ),
}  # fmt: skip
"""Outcomes of robot 0's steps, and the sizes of the first ones that it takes, as shares of the interval."""


@pytest.mark.parametrize("name", STORIES)
def test_steps_are_halved_and_doubled(monkeypatch, name):
    """Every halving of a robot that is stuck gives it more iterations, and after four of them it goes on with the
    fallback; those of an error that is too large do not count. Other robots take their own steps."""
    outcomes, options, sizes = STORIES[name]
    found = cover(monkeypatch, outcomes, adaptive="adapted" in name, **options)
    assert found.sizes[: len(sizes)] == sizes
    assert len(found.sizes) == len(sizes) or "adapted" in name
    starts = np.cumsum([0.0, *(size * good for size, good in zip(found.sizes, found.accepted, strict=True))])[:-1]
    np.testing.assert_array_equal([step.start for step in found.tried], starts)
    halvings, n_stuck = found.halvings, outcomes.count("s") if len(outcomes) > 1 else 13 * (outcomes == "s")
    assert [step.most for step in found.tried[:n_stuck]] == [20.0 * (1 + k) for k in range(n_stuck)]
    assert [step.fallback for step in found.tried] == [k >= 4 for k in halvings]
    assert [step.retrying for step in found.tried] == [k > 0 for k in halvings]
    np.testing.assert_array_equal(found.report[HALVINGS], n_stuck * FIRST)
    np.testing.assert_array_equal(found.report[REJECTIONS], outcomes.count("r") * FIRST)
    np.testing.assert_array_equal(found.arrived, EVERYONE if outcomes != "s" else ~FIRST)
    assert found.report[STEPS, 0] == sum(found.accepted)
    np.testing.assert_allclose(found.report[COVERED], DURATION * (found.arrived | ~FIRST))
    if "adapted" in name:  # the next interval goes on with these
        assert found.size[0] >= found.sizes[-1] and np.all(found.size[1:] == options.get("last_size", EIGHTH))


@pytest.mark.parametrize("outcomes, arrives", [("s", False), ("a", True)])
def test_a_robot_whose_iterations_are_spent_fails_when_it_is_stuck_and_not_before(monkeypatch, outcomes, arrives):
    """And one that has failed before is left alone."""
    found = cover(monkeypatch, outcomes, iterations=MOST)
    assert len(found.tried) == 1 and found.arrived[0] == arrives
    found = cover(monkeypatch, outcomes, alive=~FIRST)
    assert not found.tried and not found.report[STEPS, 0]
    np.testing.assert_array_equal(found.arrived, ~FIRST)


@pytest.mark.parametrize("largest", 2.0 ** np.linspace(-4.9, -3.1, 8))
def test_adapted_steps_grow_to_where_their_errors_let_them_and_are_not_refused_there(monkeypatch, largest):
    """The error per time of a step that is twice as long is four times as large; a quarter of the interval is hard."""

    def error(step):
        return LIMIT * (step.size / (largest if step.start >= 0.25 else 2.0**-8)) ** 2

    found = cover(monkeypatch, error, adaptive=True)
    settled = np.array([step.size for step in found.tried if step.start > 0.5])
    assert found.arrived.all() and np.all((settled > 0.4 * largest) & (settled <= largest))


# One step


def step_of(h=0.01, size=1.0, limit=20.0, retrying=NOBODY) -> Step:
    return Step(Lanes(0.0), Lanes(size), Lanes(h), Lanes(limit), Mask(retrying))


SILENT = np.zeros((2, 0, N_LANES))
"""Memory of the effort that nobody asks for."""


def stroke_limits(adaptive=False, most=MOST) -> Limits:
    return Limits(np.array([1e-9]), 20, most, adaptive, np.array([LIMIT]))


@pytest.mark.parametrize("iterations_before, limit, most", [(0.0, 20.0, 20.0), (990.0, 20.0, 10.0), (1000.0, 9.0, 0.0)])
def test_newton_has_what_the_step_and_the_stroke_leave_it_and_is_counted(monkeypatch, iterations_before, limit, most):
    asked, counts = [], (7.0, 2.0, 3.0)

    def minimise(rods, work, stage, robots, tolerance, limit):
        asked.append((robots.robots.copy(), lanes(limit)[0], work.q[:].copy()))
        return robots, Lanes(0.0), *map(Lanes, counts)

    monkeypatch.setitem(solve_stages.plain.__globals__, "minimise", minimise)
    q, v = rows(ROBOT.nodes()), np.full((2 * ROBOT.n_nodes, N_LANES), 0.3)
    work, report = make_work(RODS, 1), np.zeros((len(REPORT_ROWS), N_LANES))
    report[NEWTON_ITERATIONS], report[SOLVER_ITERATIONS] = 0.75 * iterations_before, 0.25 * iterations_before
    a, still = np.zeros((2 * ROBOT.n_nodes + 3, N_LANES)), Actuation(*np.zeros((2, 5, N_LANES)))
    step = step_of(limit=limit, retrying=FIRST)
    args = RODS, work, MIDPOINT, still, q, v, a, step, Mask(EVERYONE), stroke_limits(), report
    good, guarded, _ = solve_stages.plain(*args)
    ((robots, limit_asked, start),) = asked
    assert limit_asked == most and np.all(robots == (most > 0.0)) and np.all(lanes(good) == robots)
    assert lanes(guarded).all()  # regularised or shortened
    counted = report[[NEWTON_ITERATIONS, REGULARISED, BACKTRACKS], 0]
    np.testing.assert_array_equal(counted, [0.75 * iterations_before + 7.0, 2.0, 3.0])
    # In still water a robot that tries again starts where it stands, the others where their velocity leads them.
    np.testing.assert_allclose(start - q, 0.005 * v * ~FIRST, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("size, error, accepted", [(1.0, 0.9, True), (1.0, 1.1, False), (2.0**-12, 1.1, True)])
def test_a_step_is_accepted_whose_error_is_small_or_that_is_the_shortest(monkeypatch, size, error, accepted):
    """Its length is then kept for the next."""
    h, stuck = 0.01, FIRST
    fakes = {
        "solve_stages": lambda *_: (Mask(~stuck), Mask(NOBODY), None), "end_step": lambda *args: ended.append(args[-1]),
        "step_error": lambda *args: Lanes(error * LIMIT * h),
    }  # fmt: skip
    for name, fake in fakes.items():
        monkeypatch.setitem(try_step.plain.__globals__, name, fake)
    a, ended = np.full((2 * ROBOT.n_nodes + 3, N_LANES), 9.0), []
    args = RODS, None, MIDPOINT, None, None, None, a, step_of(h, size), Mask(EVERYONE), stroke_limits(True), None
    good, taken, error_rate = map(lanes, try_step.plain(*args))
    np.testing.assert_array_equal(good, ~stuck)
    np.testing.assert_array_equal(taken, ~stuck & accepted)
    np.testing.assert_array_equal(ended[0].robots, taken)
    np.testing.assert_allclose(error_rate, error * LIMIT)
    np.testing.assert_array_equal(a[memory_row.plain(RODS, MIDPOINT, LAST_STEP)], np.where(taken, h, 9.0))


@pytest.mark.parametrize(
    "halvings, cut, turns_back",
    [(0, 0.01, True), (7, 0.01, True), (8, 0.01, False), (11, 0.01, False), (12, 1.0, False)],
)
def test_the_guard_is_milder_after_eight_halvings_and_after_twelve(monkeypatch, halvings, cut, turns_back):
    asked = {}

    def hold(rods, work, scheme, q, v, h, frame, robots, allowed, largest_cut):
        asked.update(cut=lanes(largest_cut)[0], held=robots.robots)
        return Mask(NOBODY), Mask(EVERYONE)

    def poles(rods, work, q, robots):
        asked.update(turnable=robots.robots)
        return Mask(NOBODY)

    space = end_guarded_step.plain.__globals__
    for name, fake in {"hold_to_energy": hold, "through_poles": poles, "end_step": lambda *_: None}.items():
        monkeypatch.setitem(space, name, fake)
    q, v = rows(ROBOT.nodes()), np.zeros((2 * ROBOT.n_nodes, N_LANES))
    work, report = make_work(RODS, 1), np.zeros((len(REPORT_ROWS), N_LANES))
    still, step = Actuation(*np.zeros((2, 5, N_LANES))), step_of(limit=20.0 * (1 + halvings))
    masks = Mask(EVERYONE), Mask(FIRST)
    end_guarded_step.plain(
        RODS, work, MIDPOINT, still, q, v, np.zeros((2 * ROBOT.n_nodes + 3, N_LANES)), step, None, *masks,
        stroke_limits(), report,
    )  # fmt: skip
    assert asked["cut"] == cut
    np.testing.assert_array_equal(asked["held"], FIRST)
    np.testing.assert_array_equal(asked["turnable"], FIRST & turns_back)
    np.testing.assert_array_equal(report[REPORT_ROWS.index("energy_cuts")], 1.0)


# Hub angles


@pytest.mark.parametrize("limb", range(5))
def test_the_smallest_hub_angle_may_be_any_gaps_but_wide_ones_do_not_count(limb):
    """Limb j turned towards the next; a gap of more than pi may close as it likes."""
    nodes = ROBOT.nodes()
    nodes[2 * limb + 1 : 2 * limb + 3] = rotated(nodes[2 * limb + 1 : 2 * limb + 3], 0.5)
    for wide in (None, limb):
        angle = RODS.hub.angle.copy()
        if wide is not None:
            angle[wide] = -0.1
        rods, report = RODS._replace(hub=RODS.hub._replace(angle=angle)), np.full((len(REPORT_ROWS), N_LANES), np.inf)
        note_hub_angles.plain(rods, rows(nodes), Mask(EVERYONE), report)
        gap = 0.4 * np.pi - (0.5 if wide is None else 0.0)
        np.testing.assert_allclose(report[SMALLEST_HUB_T], np.tan(gap / 2.0), rtol=1e-12)
