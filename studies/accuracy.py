"""Errors and speeds that come with the package: what `info`, README.md and docs/accuracy.md promise of the presets.

`seastar certify` with more sequences, settings and nodes, for the chapter's robot. Errors are against the continuum:
infinitely many nodes per limb and infinitely short steps. The error of space is that of N nodes with short steps
against the continuum, that of time is that of the setting against short steps with the same nodes. Their sum is what
can be promised, because where they cancel it is by luck. An error is the hub's largest distance from the other path, at
ends of strokes, as a fraction of that path's length. `--store` writes the tables of `seastar_gym.accuracy.chapters`.

With 0.1 to 0.5 s between decisions, robots have `SmaWires` and swim ten seconds by commands of the classes in TIMED,
with the damping of soft silicone and without any. `--fresh` swims sequences and decision periods that no table used,
and tells the largest error over what the table promises of a preset.
"""

import itertools
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Literal, cast

import gymnasium as gym
import numpy as np

from seastar_gym.accuracy import Certificate, Setting, chapters_certificate, timed_certificate
from seastar_gym.accuracy import chapters as chapter
from seastar_gym.accuracy import measure as measuring
from seastar_gym.accuracy.certificate import CLASSES_VERSION, REPEATED, at, physics
from seastar_gym.accuracy.command import progress_bar
from seastar_gym.accuracy.measure import (
    CLASSES,
    Errors,
    Progress,
    draw_classes,
    errors,
    machine,
    measure,
    path_lengths,
    rounded_up,
    swim_all,
    whole_seconds,
)
from seastar_gym.controllers.contract import actions_of
from seastar_gym.controllers.registry import load_agent
from seastar_gym.envs.commands import to_commands
from seastar_gym.gaits import PAIRS, STRAIGHT, pentagon_gait
from seastar_gym.scene import Numerics, Scene, Seastar, SmaWires
from seastar_gym.scene.numerics import DAMPING, PRESETS, Fidelity, Resolution, SchemeName
from seastar_gym.scene.robot import SILICONE, Discretisation
from seastar_gym.simulator import Simulator
from seastar_gym.version import __version__
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown, show

# Sequences of commands

Kind = Literal["straight", "pair", "pentagon", "random", "slow", "gait"]
STROKES = 10
"""Strokes of a swim, except round the pentagon."""
SLOW = 0.1
"""Factor of the commands of slow swims, whose short paths feel a Newton tolerance most."""


@dataclass(frozen=True)
class Cases:
    """Command sequences of equal length, one per robot.

    names, kinds: Name and kind of every robot's sequence.
    commands: Commands in [-1, 1], shape (n_strokes, n_robots, n_limbs).
    """

    names: tuple[str, ...]
    kinds: tuple[Kind, ...]
    commands: Floats

    def __len__(self) -> int:
        return len(self.names)


def of_kind(kind: Kind, names: Iterable[str], commands: Floats) -> Cases:
    """Sequences of one kind. commands: Of every stroke, or of one that is repeated, shape (n_robots, n_limbs)."""
    whole = np.repeat(commands[None], STROKES, axis=0) if commands.ndim == 2 else commands
    return Cases(tuple(names), (kind,) * whole.shape[1], whole)


def numbered(name: str, n: int) -> list[str]:
    """Names of n sequences."""
    return [f"{name} {k + 1}" for k in range(n)]


def joined(*cases: Cases) -> Cases:
    """Cases of equal length as one batch."""
    names = tuple(name for each in cases for name in each.names)
    kinds = tuple(kind for each in cases for kind in each.kinds)
    return Cases(names, kinds, np.concatenate([each.commands for each in cases], axis=1))


def swims() -> Cases:
    """The straight swim and the four pairs of Fig. 13.8."""
    return joined(
        of_kind("straight", ["straight"], STRAIGHT[None]), of_kind("pair", PAIRS, np.array([*PAIRS.values()]))
    )


def pentagon(swimming: int, resting: int) -> Cases:
    """The pentagon of (13.15), with these numbers of strokes of swimming and of rest per side."""
    return of_kind("pentagon", ["pentagon"], pentagon_gait(swimming, resting)[:, None])


def random_sequences(n: int, rng: np.random.Generator) -> Cases:
    """Random sequences of n robots: half draw from -1, 0 and 1, as an environment's actions do, half from [-1, 1]."""
    commands = rng.uniform(-1.0, 1.0, (STROKES, n, 5))
    commands[:, ::2] = rng.integers(-1, 2, commands[:, ::2].shape)
    return of_kind("random", numbered("random", n), commands)


def slow_sequences(n: int, rng: np.random.Generator) -> Cases:
    """Random sequences of n robots at a tenth of the amplitude."""
    return of_kind("slow", numbered("slow", n), SLOW * random_sequences(n, rng).commands)


def gaits() -> Cases:
    """Repetitions of every command of -1, 0 and +1 that is not in `swims`, once per class under the robot's symmetry.

    A turn of the robot rolls a command over the limbs; a mirror image exchanges limbs and signs. Rest and the same
    command for all limbs are left out, because the hub then stays where it is.
    """
    known = {symmetric_form(command) for command in (*PAIRS.values(), np.zeros(5), np.ones(5))}
    forms = sorted({symmetric_form(np.array(command)) for command in itertools.product((-1, 0, 1), repeat=5)} - known)
    return of_kind("gait", ("".join("-0+"[sign + 1] for sign in form) for form in forms), np.array(forms, float))


def symmetric_form(command: Floats) -> tuple[int, ...]:
    """Smallest of all commands that are this one turned or mirrored: equal for commands that swim alike."""
    mirrored = -command[[0, 4, 3, 2, 1]]
    return min(tuple(int(c) for c in np.roll(form, turn)) for form in (command, mirrored) for turn in range(5))


def random_gaits(n: int, rng: np.random.Generator) -> Cases:
    """Gaits of n robots each: a command in [-1, 1] repeated, a tenth of it repeated, and two commands in alternation.

    Half of those in alternation are drawn from -1, 0 and 1.
    """
    once, some = rng.uniform(-1.0, 1.0, (n, 5)), random_sequences(n, rng).commands[:2]
    return joined(
        of_kind("gait", numbered("gait", n), once),
        of_kind("slow", numbered("slow gait", n), SLOW * once),
        of_kind("gait", numbered("alternating", n), np.tile(some, (STROKES // 2, 1, 1))),
    )


# Settings that are measured

MILLI = 1e-3
"""Seconds per millisecond."""
STEPS: dict[SchemeName, tuple[float, ...]] = {
    "implicit-euler": (20, 10, 5, 3, 1),
    "sdirk2": (50, 30, 20, 15, 10, 5),
    "sdirk3": (30, 20, 10),
    "implicit-midpoint": (10, 8, 6, 5, 4, 3, 2, 1.5, 1, 0.7, 0.5, 0.3, 0.1),
}
"""Time steps [ms] of every scheme."""
UNDAMPED = (5, 1)
"""Time steps [ms] at which the midpoint rule is measured without `Numerics.damping`, too."""
ADAPTED, LARGEST_ADAPTED = (0.02, 0.01, 0.005), 5 * MILLI
"""Path tolerances of the settings with adapted steps, and the largest of these steps [s]."""
TIGHT = 1e-9
"""Newton tolerance of the swims that others are compared with."""


@dataclass(frozen=True)
class Plan:
    """Size of the study.

    n_random, n_slow: Numbers of random and of slow sequences. n_gaits: Robots of each kind in `random_gaits`.
    side: Strokes of swimming and of rest on a side of the pentagon.
    limit: Nodes per limb and time step [s] of the swims that stand for the continuum.
    fine: Time step [s] of the swims that stand for infinitely short steps, with fewer nodes than `limit`. The chapter's
        discretisation with more than `finest` nodes, whose error is one of space, has four times that.
    opinion: Nodes per limb and time step [s] with which the limit itself is doubted.
    meshes: Discretisations and nodes per limb that are measured.
    shortest: Shortest time step of the settings [s].
    finest: Most nodes per limb with which settings are measured at all tolerances, and adapted steps.
    rounds: Rounds of timing.
    timed, periods, timed_limit: Sequences of every class with decisions in time, times between decisions [s]
        (resonances lie 40 ms apart, see docs/numerics.md), and what stands for the continuum of these swims.
    """

    n_random: int = 51
    n_slow: int = 8
    n_gaits: int = 20
    side: tuple[int, int] = (6, 1)
    limit: tuple[int, float] = (73, 0.1 * MILLI)
    fine: float = 0.05 * MILLI
    opinion: tuple[int, float] = (37, 0.1 * MILLI)
    meshes: tuple[tuple[Discretisation, int], ...] = (
        *(("continuum", n) for n in (6, 7, 8, 10, 11, 12, 13, 19, 25, 28, 37)), *(("chapter", n) for n in (10, 37, 73)),
    )  # fmt: skip
    shortest: float = 0.1 * MILLI
    finest: int = 19
    rounds: int = 3
    timed: int = 24
    periods: tuple[float, ...] = (0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.5)
    timed_limit: tuple[int, float] = (73, 0.2 * MILLI)


QUICK = Plan(
    n_random=6, n_slow=2, n_gaits=2, side=(1, 0), limit=(37, 0.4 * MILLI), fine=0.4 * MILLI, opinion=(10, 1 * MILLI),
    meshes=(("continuum", 7), ("continuum", 10), ("chapter", 10)), shortest=2 * MILLI, rounds=1, timed=12,
    periods=(0.2, 0.5), timed_limit=(37, 1 * MILLI),
)  # fmt: skip


def tolerances(step: float) -> tuple[float, ...]:
    """Newton tolerances that are measured with a time step [s]: short steps bring small updates, so need small ones."""
    if step >= 5 * MILLI:
        return 3e-5, 1e-5, 1e-6
    return (1e-6, 1e-7) if step >= 1 * MILLI else (1e-8,)


def dampings(discretisation: Discretisation, scheme: SchemeName, step: float) -> tuple[float, ...]:
    """Numbers `Numerics.damping` that are measured with a scheme and a time step [ms]: schemes that damp have none."""
    if discretisation == "chapter" or scheme != "implicit-midpoint":
        return (0.0,)
    return (DAMPING, 0.0) if step in UNDAMPED else (DAMPING,)


def numerics_of(plan: Plan, discretisation: Discretisation, nodes: int) -> Iterable[Numerics]:
    """Numerics that are measured with a mesh: fewer with many nodes, which are dear."""
    allowed = 0.1 if nodes == 10 else 0.3 if discretisation == "continuum" else 1
    for scheme, step in ((scheme, step) for scheme, steps in STEPS.items() for step in steps):
        every = tolerances(step * MILLI) if step * MILLI >= max(plan.shortest, allowed * MILLI) else ()
        for damping in dampings(discretisation, scheme, step):
            for tolerance in every if nodes <= plan.finest else every[-1:]:
                yield Numerics(scheme, step * MILLI, tolerance, damping=damping)
    for path_tolerance in ADAPTED if nodes <= plan.finest else ():
        damping = dampings(discretisation, "implicit-midpoint", LARGEST_ADAPTED / MILLI)[0]
        yield Numerics("implicit-midpoint", LARGEST_ADAPTED, 1e-7, path_tolerance=path_tolerance, damping=damping)


def settings(plan: Plan) -> list[Resolution]:
    """All settings that are measured, and the presets whatever the plan leaves out."""
    found = [Resolution(*mesh, each) for mesh in plan.meshes for each in numerics_of(plan, *mesh)]
    return list(dict.fromkeys([*found, *PRESETS.values()]))


# Errors, and what can be promised

UNSEEN = 1.5
"""Promised over measured error of gaits and slow swims.

Of 64 random gaits that the study did not use, the worst erred by 1.3 times the largest error of the 40 that it did, see
tests/accuracy/test_shipped.py. Errors of other swims are largest for the pairs, which are all measured.
"""
NOTICEABLE = 0.03
"""A slower setting joins the front if it reduces the error by at least this fraction."""
LARGEST_DOUBT = 3e-4
"""Largest path error of the limit itself, of each kind, with which results are stored."""


def largest(kinds: Sequence[Kind], found: Errors) -> dict[str, float]:
    """Largest errors by kind of swim: path errors, and of all but gaits and slow swims end and heading [deg], too."""
    kind = np.array(kinds)
    main = (kind != "gait") & (kind != "slow")
    by_kind = {name: float(found.path[kind == name].max(initial=0.0)) for name in ("straight", "gait", "slow")}
    all_main = {"path": found.path, "end": found.end, "heading": np.degrees(found.heading)}
    return by_kind | {name: float(each[main].max()) for name, each in all_main.items()}


@dataclass(frozen=True)
class Row:
    """A setting, its largest errors of space and of time by kind, medians of their sums, and its real-time factor."""

    resolution: Resolution
    space: Mapping[str, float]
    time: Mapping[str, float]
    typical: Mapping[str, float]
    speed: float = math.nan

    def promise(self, *kinds: str) -> float:
        """Largest sum of the two errors, with a margin for what varies most among commands.

        The two may cancel, and a promise does not rely on that.
        """
        return max(
            (UNSEEN if each in ("gait", "slow") else 1.0) * (self.space[each] + self.time[each]) for each in kinds
        )


def no_coarser(other: Numerics, numerics: Numerics) -> bool:
    """Whether `other` has the scheme of `numerics`, no less damping, and no larger step or tolerance."""
    return (
        other.scheme == numerics.scheme
        and other.damping >= numerics.damping
        and (other.path_tolerance is None) == (numerics.path_tolerance is None)
        and other.step <= numerics.step
        and other.newton_tolerance <= numerics.newton_tolerance
        and (other.path_tolerance or 0.0) <= (numerics.path_tolerance or 0.0)
    )


def promised(rows: Sequence[Row]) -> list[Row]:
    """Rows with the errors that can be promised.

    At some steps, and with some numbers of nodes, errors of opposite sign cancel. So the error of time is the largest
    of the setting and of all that are no coarser, and that of space the largest of N nodes and of more.
    """

    def worst(some: Iterable[Mapping[str, float]], own: Mapping[str, float]) -> dict[str, float]:
        found = list(some)
        return {name: max(each[name] for each in found) for name in own}

    sure = []
    for row in rows:
        (discretisation, nodes, numerics), alike = row.resolution, [(each, each.resolution) for each in rows]
        alike = [(each, other) for each, other in alike if other.discretisation == discretisation]
        space = (each.space for each, other in alike if other.nodes_per_limb >= nodes)
        finer = (e.time for e, other in alike if other[1] == nodes and no_coarser(other.numerics, numerics))
        sure.append(replace(row, space=worst(space, row.space), time=worst(finer, row.time)))
    return sure


def front(rows: Iterable[Row], error: Callable[[Row], float]) -> list[Row]:
    """Pareto front of error and speed, fastest first; a slower row needs a noticeably smaller error."""
    chosen: list[Row] = []
    for row in sorted(rows, key=lambda row: (-row.speed, error(row))):
        if not chosen or error(row) < (1.0 - NOTICEABLE) * error(chosen[-1]):
            chosen.append(row)
    return [row for row in chosen if math.isfinite(error(row))]


def fronts(rows: Sequence[Row]) -> list[Row]:
    """For every mesh, rows on the front of the path error or of the worse of path and gait, fastest first."""
    chosen: dict[Resolution, Row] = {}
    for mesh in dict.fromkeys(row.resolution[:2] for row in rows):
        mine = [row for row in rows if row.resolution[:2] == mesh]
        of_both = front(mine, lambda row: row.promise("path")), front(mine, lambda row: row.promise("path", "gait"))
        chosen |= {row.resolution: row for each in of_both for row in each}
    return sorted(chosen.values(), key=lambda row: -row.speed)


# Strokes


def short(plan: Plan, discretisation: Discretisation, nodes: int) -> Numerics:
    """Numerics that stand for infinitely short steps with a discretisation and nodes per limb."""
    step = plan.limit[1] if nodes >= plan.limit[0] else plan.fine
    if discretisation == "chapter" and nodes > plan.finest:
        step = 4.0 * plan.fine
    return Numerics("implicit-midpoint", step, TIGHT)


def measured(plan: Plan, batches: Sequence[Cases], resolutions: Sequence[Resolution], progress: Progress) -> list[Row]:
    """Rows of all resolutions, yet without speeds."""
    limit = Resolution("continuum", plan.limit[0], Numerics("implicit-midpoint", plan.limit[1], TIGHT))
    found = [measure(Scene(), resolutions, limit, partial(short, plan), each.commands, progress) for each in batches]
    kinds, rows = [kind for batch in batches for kind in batch.kinds], []
    for k, resolution in enumerate(resolutions):
        space, in_time = (
            Errors(*map(np.concatenate, zip(*(getattr(each, part)[k] for each in found), strict=True)))
            for part in ("space", "time")
        )
        sums = {name: (space.path + in_time.path)[np.array(kinds) == name] for name in ("random", "gait", "slow")}
        typical = {name: float(np.median(each)) for name, each in sums.items()}
        rows.append(Row(resolution, largest(kinds, space), largest(kinds, in_time), typical))
    return rows


def doubts(cases: Cases, plan: Plan, progress: Progress) -> dict[str, float]:
    """Largest path errors of the limit itself on some cases, by what they are from.

    Space: Twice the edges bring a quarter of the error, so a third of the difference that they make is left. Time: The
    same for half the steps. Scheme: SDIRK3 against the midpoint rule, with the same nodes.
    """
    (nodes, step), rule = plan.opinion, "implicit-midpoint"
    wanted: list[tuple[int, float, Any]] = [(nodes, step, rule), (2 * nodes - 1, step, rule), (nodes, 0.5 * step, rule)]
    scenes = [
        at(Scene(), Resolution("continuum", n, Numerics(scheme, h, TIGHT)))
        for n, h, scheme in (*wanted, (nodes, step, "sdirk3"))
    ]
    plain, fine, shorter, other = swim_all(scenes, cases.commands, progress)
    lengths = path_lengths(Scene(), fine.hub)
    pairs = {"space": (plain, fine), "time": (plain, shorter), "scheme": (other, shorter)}
    found = {name: float(errors(*pair, lengths).path.max()) for name, pair in pairs.items()}
    return found | {"space": found["space"] / 3.0}


def speeds(scenes: Sequence[Scene], rounds: int, progress: Progress, n_robots: int = 32) -> Floats:
    """Real-time factors on one core for mixed commands.

    Every round times all settings once, after the first stroke from rest. The best round counts, because other work of
    the machine can only add time.
    """
    commands, best = random_sequences(n_robots, np.random.default_rng(1)).commands[:3], np.full(len(scenes), np.inf)
    simulators = [Simulator(scene, n_robots, threads=1) for scene in scenes]
    states = [(simulator.stroke(commands[0]), simulator.get_state())[1] for simulator in simulators]
    for turn in range(rounds):
        for k, (simulator, state) in enumerate(zip(simulators, states, strict=True)):
            simulator.set_state(state)
            start = time.thread_time()
            for command in commands[1:]:
                simulator.stroke(command)
            best[k] = min(best[k], time.thread_time() - start)
            progress((turn + (k + 1) / len(scenes)) / rounds)
    return n_robots * 2 * Scene().actuator.period / best


def as_setting(row: Row) -> Setting:
    """Setting of a row: errors rounded upwards to two digits, speed rounded to two digits."""
    discretisation, nodes_per_limb, numerics = row.resolution
    space, in_time = rounded_up(row.space["path"]), rounded_up(row.time["path"])
    kinds = {"repeated": "gait", "small": "slow", "straight": "straight"}
    # The straight swim is one, so that its median is its error.
    typical = {"random": row.typical["random"], "repeated": row.typical["gait"], "small": row.typical["slow"]}
    return Setting(
        nodes_per_limb, numerics.scheme, numerics.step, numerics.newton_tolerance,
        errors={"random": float(f"{space + in_time:.6g}")}
        | {name: rounded_up(row.promise(kind)) for name, kind in kinds.items()},
        typical={name: rounded_up(each) for name, each in {**typical, "straight": row.promise("straight")}.items()},
        space_error=space, time_error=in_time, speed=rounded(row.speed, 2),
        heading_error=rounded_up(row.promise("heading")), end_error=rounded_up(row.promise("end")),
        path_tolerance=numerics.path_tolerance, discretisation=discretisation, damping=numerics.damping,
    )  # fmt: skip


def measured_over(plan: Plan) -> dict[str, Any]:
    """Command sequences behind the package's table: how many of each kind, and with which confidence they bound."""
    n, sure = plan.n_random, f"{1.0 - 0.95**plan.n_random:.2f}"
    return {
        "command": "python -m studies.accuracy --store",
        "strokes": STROKES,
        "path_error": {"straight": 1, "pairs of Fig. 13.8": 4, "pentagon": 1, "random, ternary and continuous": n},
        "gait_error": {
            "repeated ternary, all that differ": len(gaits()), "repeated continuous": plan.n_gaits,
            "alternating, ternary and continuous": plan.n_gaits, "factor for those not measured": UNSEEN,
        },
        "slow_error": {"random, a tenth": plan.n_slow, "repeated continuous, a tenth": plan.n_gaits,
                       "factor for those not measured": UNSEEN},
        "confidence": f"With {sure} confidence, at most 5 % of random sequences exceed the largest of {n}.",
        "held_out": "Exceedances of sequences that no table used: python -m studies.accuracy --fresh 1000.",
    }  # fmt: skip


def in_strokes(plan: Plan) -> tuple[Certificate, dict[str, float]]:
    """Errors and speeds in strokes, presets first, then what no other setting beats; and the doubt about the limit."""
    rng = np.random.default_rng(0)
    some = joined(swims(), random_sequences(plan.n_random, rng), slow_sequences(plan.n_slow, rng))
    batches = [joined(some, gaits(), random_gaits(plan.n_gaits, rng)), pentagon(*plan.side)]
    few = joined(swims(), random_sequences(min(11, plan.n_random), rng))
    with progress_bar("doubt") as progress:
        doubt = doubts(few, plan, progress)
    with progress_bar("errors") as progress:
        rows = measured(plan, batches, settings(plan), progress)
    with progress_bar("speeds") as progress:
        found = speeds([at(Scene(), row.resolution) for row in rows], plan.rounds, progress)
    rows = promised([replace(row, speed=float(speed)) for row, speed in zip(rows, found, strict=True)])
    by_resolution = {row.resolution: row for row in rows}
    chosen = {each: by_resolution[each] for each in PRESETS.values()} | {row.resolution: row for row in fronts(rows)}
    stored = {resolution: as_setting(row) for resolution, row in chosen.items()}
    certificate = Certificate(
        physics(Scene()), tuple(stored.values()), ("random",), ("random", "repeated"), plan.n_random,
        limit_error=rounded_up(stored[PRESETS["reference"]].space_error / 3.0), classes=CLASSES_VERSION,
        version=__version__, machine=machine(), measured_over=measured_over(plan),
    )  # fmt: skip
    return certificate, doubt


# Commands in time

ROBOTS: dict[str, tuple[float | None, int, int]] = {"wires": (SILICONE, 1, 1), "undamped": (None, 2, 3)}
"""Relaxation times [s] of the robots with `SmaWires` that are measured, by the names of their files: that of the
environments, which has the damping of silicone, and the chapter's, which has none. Without damping, swims converge
late: the other numbers divide the step of the limit, and the number of sequences."""
SECONDS, SEED = 10, 0
SLOWEST = 0.1
"""Errors of swims that are slower than this [limb lengths per second] are fractions of a path at this speed: held and
repeated commands hardly swim, so that shares of their paths would say nothing."""
HELD = (10.0, 5.0, 2.0, 1.0)
"""Times for which a command is held [s]."""


def wired(robot: str) -> Scene:
    """The chapter's scene with wires and the damping of one of ROBOTS."""
    return replace(Scene(), actuator=SmaWires(), robot=Seastar(relaxation_time=ROBOTS[robot][0]))


def ternary(rng: np.random.Generator, *shape: int) -> Floats:
    """Commands of -1, 0 and 1, shape (*shape, 5)."""
    return rng.integers(-1, 2, (*shape, 5)).astype(float)


def in_turn(commands: Floats, every: float, period: float) -> Floats:
    """Commands that change every so many seconds, as decisions, shape (n_decisions, n, 5), the last at the end."""
    k = (np.arange(round(SECONDS / period)) * period / every + 1e-9).astype(int)
    return np.asarray(commands[k % len(commands)])


def held(rng: np.random.Generator, n: int, period: float) -> Floats:
    """Commands that are held for each of HELD in turn."""
    return np.concatenate([in_turn(ternary(rng, SECONDS, n // len(HELD)), each, period) for each in HELD], axis=1)


def on_off(rng: np.random.Generator, n: int, period: float) -> Floats:
    """A command for a second, then a second of rest."""
    return in_turn(np.stack([ternary(rng, n), np.zeros((n, 5))]), 1.0, period)


def paired(rng: np.random.Generator, n: int, period: float) -> Floats:
    """Two limbs of another pair of opposed commands in every decision, as the actions "pairs" are."""
    table = np.array([command for command in itertools.product((-1.0, 0.0, 1.0), repeat=5) if sorted(command) == PAIR])
    return np.asarray(table[rng.integers(len(table), size=(round(SECONDS / period), n))])


PAIR = [-1.0, 0.0, 0.0, 0.0, 1.0]
"""Numbers of a command of "pairs", sorted."""
DRIVERS = {"SeastarSwimTimed-v0": ("learned", "planner"), "SeastarSwimTimedModerate-v0": ("learned", "greedy")}
"""Ids, and the bundled agents whose commands are swum again."""


@cache
def driven() -> Floats:
    """Commands of DRIVERS for twenty decisions on random paths, shape (20, 16, 5)."""
    found = []
    for (id, names), seed in itertools.product(DRIVERS.items(), range(4)):
        for name in names:
            agent = load_agent(name, cast(Any, gym.make(id, fidelity="fast").unwrapped))
            actions = actions_of(agent, 5)
            env = gym.make(id, fidelity="fast", path="random", actions=actions)
            observation, _ = env.reset(seed=seed)
            commands = list[Floats]()
            while len(commands) < 20:
                action = agent.predict(observation, deterministic=True)[0]
                commands.append(to_commands(actions, 5, [action], 1)[0])
                observation = env.step(action)[0]
            found.append(commands)
    return np.array(found).swapaxes(0, 1)


def policies(rng: np.random.Generator, n: int, period: float) -> Floats:
    """What bundled policies, the planner and the greedy rule do, again and again, at any period."""
    chosen = driven()[:, rng.integers(0, driven().shape[1], n)]
    return np.resize(chosen, (round(SECONDS / period), n, 5))


def repeated_second(rng: np.random.Generator, n: int, period: float) -> Floats:
    """A second of random commands, repeated."""
    a_second = rng.uniform(-1.0, 1.0, (max(1, round(1.0 / period)), n, 5))
    return np.resize(a_second, (round(SECONDS / period), n, 5))


def at_random(rng: np.random.Generator, n: int, period: float) -> Floats:
    """Another command for every decision, half of them of -1, 0 and 1."""
    commands = rng.uniform(-1.0, 1.0, (round(SECONDS / period), n, 5))
    commands[:, ::2] = rng.integers(-1, 2, commands[:, ::2].shape)
    return commands


def repeated_command(rng: np.random.Generator, n: int, period: float) -> Floats:
    """Every command of -1, 0 and +1 for ten seconds, once per class under the robot's symmetry, as scripts do."""
    return np.tile([*gaits().commands[0], *PAIRS.values()], (round(SECONDS / period), 1, 1))


TIMED: dict[str, Callable[[np.random.Generator, int, float], Floats]] = {
    "random": at_random, "pairs": paired, "repeated second": repeated_second, "held": held, "on-off": on_off,
    "policies": policies, "repeated command": repeated_command,
}  # fmt: skip
"""Classes of commands in time, by name."""


def timed_sequences(period: float, n: int, seed: int = SEED) -> tuple[Floats, dict[str, slice]]:
    """Sequences of all classes of TIMED, n of each that is drawn, shape (n_decisions, n_robots, 5); their places."""
    rng = np.random.default_rng([seed, round(1000 * period)])
    drawn = {name: draw(rng, n, period) for name, draw in TIMED.items()}
    ends = np.cumsum([each.shape[1] for each in drawn.values()]).tolist()
    places = {name: slice(end - each.shape[1], end) for (name, each), end in zip(drawn.items(), ends, strict=True)}
    return np.concatenate([*drawn.values()], axis=1), places


@dataclass(frozen=True)
class Timed:
    """Errors of space and of time of one resolution, by class of TIMED: shape (n_sequences,) each."""

    resolution: Resolution
    space: Mapping[str, Floats]
    time: Mapping[str, Floats]

    def by_class(self, of: Callable[[Floats], float]) -> dict[str, float]:
        """A number of the sums of every class, rounded upwards to two digits."""
        return {name: rounded_up(float(of(space + self.time[name]))) for name, space in self.space.items()}

    def setting(self) -> Setting:
        """Setting of the largest errors and of their medians."""
        discretisation, nodes_per_limb, numerics = self.resolution
        space, in_time = (rounded_up(max(map(np.max, some.values()))) for some in (self.space, self.time))
        return Setting(
            nodes_per_limb, numerics.scheme, numerics.step, numerics.newton_tolerance,
            errors=self.by_class(np.max), typical=self.by_class(np.median), space_error=space, time_error=in_time,
            discretisation=discretisation, damping=numerics.damping,
        )  # fmt: skip


def timed_limit(robot: str, plan: Plan) -> tuple[Resolution, int]:
    """What stands for the continuum of one of ROBOTS, and the number of sequences of a class and period."""
    (nodes, step), (_, finer, fewer) = plan.timed_limit, ROBOTS[robot]
    return Resolution("continuum", nodes, Numerics("implicit-midpoint", step / finer, TIGHT)), plan.timed // fewer


def every(robot: str, period: float, plan: Plan) -> list[Timed]:
    """Errors of all presets of one of ROBOTS for a time between decisions [s]."""
    limit, n = timed_limit(robot, plan)
    commands, places = timed_sequences(period, n)
    with progress_bar(f"{robot}, every {period:g} s") as progress:
        found = measure(wired(robot), [*PRESETS.values()], limit, lambda *_: limit.numerics, commands, progress, period,
                        SLOWEST * SECONDS)  # fmt: skip
    each = zip(PRESETS.values(), found.space, found.time, strict=True)
    return [
        Timed(resolution, *({name: errors.path[place] for name, place in places.items()} for errors in (space, time)))
        for resolution, space, time in each
    ]


def joint(some: Sequence[Timed]) -> Timed:
    """Errors of one resolution for all periods together."""
    space, in_time = ({name: np.concatenate([getattr(each, part)[name] for each in some]) for name in some[0].space}
                      for part in ("space", "time"))  # fmt: skip
    return Timed(some[0].resolution, space, in_time)


def in_time(robot: str, plan: Plan) -> Certificate:
    """Errors of all presets of one of ROBOTS, each the largest of all periods of the plan."""
    began = time.process_time()
    of_periods = [every(robot, period, plan) for period in plan.periods]
    settings = tuple(joint(some).setting() for some in zip(*of_periods, strict=True))
    limit, n = timed_limit(robot, plan)
    table = {
        f"{period:g}": {name: [each.by_class(np.max), each.by_class(np.median)]
                        for name, each in zip(PRESETS, found, strict=True)}
        for period, found in zip(plan.periods, of_periods, strict=True)
    }  # fmt: skip
    return Certificate(
        physics(wired(robot)), settings, tuple(TIMED), tuple(TIMED), n * len(plan.periods),
        limit_error=rounded_up(min(each.space_error for each in settings) / 3.0),
        classes=CLASSES_VERSION, version=__version__, machine=machine(), decision_period=max(plan.periods),
        measured_over={
            "command": "python -m studies.accuracy --store",
            "seconds": SECONDS, "periods": list(plan.periods), "of each class and period": n,
            "shortest path": f"{SLOWEST:g} limb lengths per second",
            "limit": f"{limit.nodes_per_limb} nodes per limb, {limit.numerics.step / MILLI:g} ms",
            "largest and median by period": table, "processor_seconds": round(time.process_time() - began),
        },
    )  # fmt: skip


# Sequences that no table used

FRESH_SEED = 2_026


FRESH_PERIODS = (0.13, 0.17, 0.2, 0.23)
"""Times between decisions [s] of fresh sequences."""


def exceeding(name: Fidelity, samples: int) -> dict[str, Floats]:
    """Errors of fresh sequences of every class of strokes over what the package's table promises of a preset."""
    commands, known = draw_classes(samples, 5, FRESH_SEED), in_table(name)
    limit = Resolution("continuum", measuring.MANY_NODES, measuring.SHORT)
    swum, exact = swim_all([Scene.preset(name), at(Scene(), limit)], commands)
    off = errors(swum, exact, path_lengths(Scene(), exact.hub)).path.reshape(len(CLASSES), samples)
    kinds = {"random ternary": "random", "random continuous": "random", "small": "small"}
    bounds = [known.errors[kinds[each]] if each in kinds else known.error(("random", "repeated")) for each in CLASSES]
    return dict(zip(CLASSES, off / np.array(bounds)[:, None], strict=True))


def exceeding_in_time(robot: str, names: Sequence[Fidelity], samples: int) -> dict[Fidelity, dict[str, Floats]]:
    """Errors of fresh sequences of every class in time, at FRESH_PERIODS, over what `info` promises of presets."""
    found: dict[Fidelity, list[dict[str, Floats]]] = {name: [] for name in names}
    limit = Resolution("continuum", measuring.MANY_NODES, Numerics("implicit-midpoint", 0.2 * MILLI, TIGHT))
    for period in FRESH_PERIODS:
        commands, places = timed_sequences(period, samples, FRESH_SEED)
        scenes = [at(wired(robot), each) for each in (limit, *(PRESETS[name] for name in names))]
        exact, *swums = swim_all(scenes, commands, period=period)
        lengths = path_lengths(wired(robot), exact.hub[whole_seconds(period, len(exact.hub))], SLOWEST * SECONDS)
        for name, swum in zip(names, swums, strict=True):
            path = errors(swum, exact, lengths).path
            found[name].append({each: path[place] for each, place in places.items()})
    certificate = certificate_of(robot)
    return {
        name: {each: np.concatenate([of_period[each] for of_period in some])
               / in_table(name, robot).error(_beside(each, certificate)) for each in TIMED}
        for name, some in found.items()
    }  # fmt: skip


def _beside(name: str, certificate: Certificate) -> tuple[str, ...]:
    """Classes that stand behind the same entry of `info` as one class."""
    gaits = certificate.repeated(certificate.actions)
    return gaits if name in gaits else tuple(each for each in certificate.actions if each not in gaits)


# Tables of pages, from the certificates that come with the package. Every error is one that `info` has: a bound, and in
# brackets the median.

PURPOSES: dict[Fidelity, str] = {
    "fast": "searching, training", "balanced": "doing anything else; it is the default",
    "accurate": "measuring a difference of a few per cent", "reference": "checking one of the above",
    "chapter": "repeating the chapter's figures",
}  # fmt: skip
ERRORS = ["random strokes", "repeated strokes", "random decisions", "held or repeated decisions"]


def in_table(name: Fidelity, robot: str | None = None) -> Setting:
    """Errors of a preset in strokes, or of one of ROBOTS with commands in time."""
    scene = Scene.preset(name)
    if robot is None:
        known = chapters_certificate().of(scene)
    else:
        scene = replace(scene, actuator=SmaWires(), robot=replace(scene.robot, relaxation_time=ROBOTS[robot][0]))
        known = certificate_of(robot).of(scene)
    assert known is not None
    return known


def certificate_of(robot: str) -> Certificate:
    """Certificate of one of ROBOTS that comes with the package."""
    found = timed_certificate(0.2, wired(robot))
    assert found is not None
    return found


def percent(bound: float, typical: float | None = None) -> str:
    """Error in per cent, of two digits, and the median below it."""
    return f"{rounded(100 * bound, 2):g} %" + ("" if typical is None else f" ({rounded(100 * typical, 2):g} %)")


def cells(known: Setting) -> list[str]:
    """Errors of random and of repeated commands, in strokes or in time."""
    random = [name for name in known.errors if name in ("random", "pairs")]
    repeated = [name for name in known.errors if name.startswith(REPEATED)]
    return [percent(known.error(some), known.typical_error(some)) for some in (random, repeated)]


def row_of(name: Fidelity) -> list[str]:
    """Errors of strokes and of commands in time, and the speed."""
    return [*cells(in_table(name)), *cells(in_table(name, "wires")), f"{in_table(name).speed:,.0f}"]


def readme(_: object) -> str:
    """Some presets."""
    rows = [[f"`{name}`", *row_of(name)] for name in PURPOSES if name in ("fast", "balanced", "reference")]
    return markdown(["fidelity", *ERRORS, "× real time"], rows)


def choosing(_: object) -> str:
    """All presets, by what they are for."""
    rows = [[why, f'`fidelity="{name}"`', *row_of(name)] for name, why in PURPOSES.items()]
    return markdown(["you are", "take", *ERRORS, "× real time"], rows, (0, 1))


def presets(_: object) -> str:
    """Numerics of all presets, and their errors by part and by commands."""
    rows = []
    for name in PURPOSES:
        row = in_table(name)
        nodes = f"{row.nodes_per_limb}{'' if row.discretisation == 'continuum' else ', chapter' + chr(39) + 's'}"
        scheme = row.scheme.replace("implicit-midpoint", "midpoint").replace("implicit-euler", "implicit Euler")
        path, repeated = cells(row)
        numbers = [percent(row.space_error), percent(row.time_error), f"**{path.replace(' (', '** (', 1)}", repeated]
        rows.append([
            f"`{name}`", nodes, f"{scheme}, {row.step / MILLI:g} ms", f"{row.newton_tolerance:.0e}",
            *(each.replace(" %", "") for each in numbers),
        ])  # fmt: skip
    head = ["fidelity", "N", "scheme and step", "tolerance", "space [%]", "time [%]", "path error [%]", "gaits [%]"]
    return markdown(head, rows)


def timed(_: object) -> str:
    """Errors of all presets by class of commands in time, with and without material damping."""
    rows = [
        [f"`{name}`", said, *(percent(known.errors[each], known.typical[each]).replace(" %", "") for each in TIMED)]
        for robot, said in (("wires", "silicone"), ("undamped", "none"))
        for name in PURPOSES
        for known in [in_table(name, robot)]
    ]
    return markdown(["fidelity", "damping", *(f"{name} [%]" for name in TIMED)], rows, (0, 1))


def by_period(_: object) -> str:
    """Largest errors of all classes of commands in time, by the time between decisions [s]."""
    rows = []
    for robot, said in (("wires", "silicone"), ("undamped", "none")):
        of_periods = certificate_of(robot).measured_over["largest and median by period"]
        for name in PURPOSES:
            found = [max(of_period[name][0].values()) for of_period in of_periods.values()]
            rows.append([f"`{name}`", said, *(percent(each).replace(" %", "") for each in found)])
    return markdown(["fidelity", "damping", *(f"{each} s [%]" for each in of_periods)], rows, (0, 1))


@dataclass(frozen=True)
class Options:
    """Errors and speeds of the chapter's robot."""

    quick: bool = False
    """Measure fewer settings and swims, in a minute."""
    store: bool = False
    """Write the tables that come with the package, instead of files in --out."""
    only: tuple[str, ...] = ("strokes", *ROBOTS)
    """What is measured: strokes, commands in time of robots of silicone (wires), and of undamped ones."""
    fresh: int = 0
    """Measure nothing, but hold the package's table against so many fresh sequences of every class."""

    def __post_init__(self) -> None:
        if self.quick and self.store:
            raise ValueError("--store needs the whole study, not --quick.")
        if unknown := {*self.only} - {"strokes", *ROBOTS}:
            raise ValueError(f"--only is some of strokes, {', '.join(ROBOTS)}, not {', '.join(sorted(unknown))}.")


def run(options: Options, results: Results) -> None:
    """Measure and write the certificates, or hold that of the package against fresh sequences."""
    if options.fresh:
        presets: tuple[Fidelity, ...] = ("fast", "balanced", "accurate")
        for what in options.only:
            found = (
                {name: exceeding(name, options.fresh) for name in presets}
                if what == "strokes"
                else exceeding_in_time(what, presets, options.fresh)
            )
            rows = [
                [name, *(f"{(each > 1.0).sum()} of {each.size}, {each.max():.2f}" for each in by_class.values())]
                for name, by_class in found.items()
            ]
            show(markdown(["fidelity", *found["fast"]], rows), f"{what}: beyond the promise, and the worst over it")
        return None
    plan, folder = QUICK if options.quick else Plan(), chapter.FOLDER if options.store else results.folder
    for name in options.only:
        if name == "strokes":
            certificate, doubt = in_strokes(plan)
            print(f"Error of the limit itself: {doubt}")
            if options.store and not max(doubt.values()) <= LARGEST_DOUBT:
                raise ValueError(f"The limit is in doubt by more than {LARGEST_DOUBT:.0e}: nothing is stored.")
        else:
            certificate = in_time(name, plan)
        file = folder / f"{name}.json"
        certificate.save(file)
        shown = [
            [name, *map(percent, each.errors.values())]
            for name, each in zip(PRESETS, certificate.settings, strict=False)
        ]
        show(markdown(["fidelity", *certificate.settings[0].errors], shown), f"Written: {file}")
    return None


STUDY = Study(
    "accuracy", run, Options, out=Path("runs/accuracy"),
    tables={"errors": readme, "choosing": choosing, "presets": presets, "timed": timed, "periods": by_period},
)  # fmt: skip
