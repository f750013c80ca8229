"""Error and speed of every resolution, scheme, time step and tolerance.

Errors are against the continuum: infinitely many nodes per limb and infinitely short steps. The error of space is that
of N nodes with short steps against the continuum. The error of time is that of the setting against short steps with the
same nodes. Their sum is what can be promised, because where they cancel it is by luck. Writes `accuracy.csv`, the
summary `accuracy.md` and two pictures. `--store` also writes the table of `seastar_gym.accuracy.chapter`, from which
`Scene.for_error` and `info` take their errors and speeds.

The error is the hub's distance from the other path at the ends of strokes, as a fraction of that path's length. Times
are processor times of one thread, the best of several rounds, for a batch of random commands.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from seastar_gym.accuracy.chapter import STROKES
from seastar_gym.accuracy.command import progress_bar
from seastar_gym.accuracy.measure import Measured, Progress, Swims, errors, measure, path_lengths, swim_all
from seastar_gym.accuracy.setting import at
from seastar_gym.gaits import PAIRS, STRAIGHT
from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.numerics import Resolution, SchemeName
from seastar_gym.scene.robot import Discretisation
from seastar_gym.simulator import Simulator
from studies.accuracy import page
from studies.accuracy.cases import Cases, gaits, joined, pentagon, random_gaits, random_sequences, slow_sequences, swims
from studies.accuracy.pictures import draw_all
from studies.accuracy.rows import Figures, Row, figures, medians, promised
from studies.accuracy.rows import Study as Found
from studies.accuracy.settings import QUICK, Plan, settings
from studies.accuracy.tables import as_markdown, store, write_csv
from studies.frame import Floats, Results, Study
from studies.pages import show

TIGHT = 1e-9
"""Newton tolerance of the swims that others are compared with."""


def tight(nodes: int, step: float, scheme: SchemeName = "implicit-midpoint") -> Resolution:
    """Resolution of a swim that others are compared with."""
    return Resolution("continuum", nodes, Numerics(scheme, step, TIGHT))


def short(plan: Plan, discretisation: Discretisation, nodes: int) -> Numerics:
    """Numerics that stand for infinitely short steps with a discretisation and nodes per limb."""
    step = plan.limit[1] if nodes >= plan.limit[0] else plan.fine
    if discretisation == "chapter" and nodes > plan.finest:
        step = 4.0 * plan.fine
    return Numerics("implicit-midpoint", step, TIGHT)


def measured(cases: Cases, plan: Plan, resolutions: Sequence[Resolution], progress: Progress) -> Measured:
    """Swims of some cases and their errors at all resolutions."""
    return measure(Scene(), resolutions, tight(*plan.limit), partial(short, plan), cases.commands, progress)


def rows_of(batches: Sequence[Cases], found: Sequence[Measured], resolutions: Sequence[Resolution]) -> list[Row]:
    """Rows of all resolutions, yet without speeds. found: Errors of every batch."""
    rows = []
    for k, resolution in enumerate(resolutions):
        space, time = [each.space[k] for each in found], [each.time[k] for each in found]
        reports = [each.swims[k] for each in found]

        def mean(name: str, reports: list[Swims] = reports) -> float:
            return float(np.mean(np.concatenate([getattr(each, name).ravel() for each in reports])))

        rows.append(
            Row(
                resolution,
                figures(batches, space),
                figures(batches, time),
                iterations=mean("newton_iterations"),
                steps=mean("steps"),
                rejections=sum(int(each.rejections.sum()) for each in reports),
                halvings=sum(int(each.halvings.sum()) for each in reports),
                typical=medians(batches, space, time),
            )
        )
    return rows


def second_opinion(cases: Cases, plan: Plan, progress: Progress) -> dict[str, Figures]:
    """Errors of the limit itself on some cases, by what they are from.

    Space: Twice the edges bring a quarter of the error, so a third of the difference that they make is left. Time: The
    same for half the steps. Scheme: SDIRK3 against the midpoint rule, with the same nodes.
    """
    nodes, step = plan.opinion
    finer = 2 * nodes - 1
    wanted = tight(nodes, step), tight(finer, step), tight(nodes, 0.5 * step), tight(nodes, step, "sdirk3")
    plain, fine, shorter, other = swim_all([at(Scene(), each) for each in wanted], cases.commands, progress)
    lengths = path_lengths(Scene(), fine.hub)
    space, time, scheme = (
        figures([cases], [errors(each, against, lengths)])
        for each, against in ((plain, fine), (plain, shorter), (other, shorter))
    )
    return {
        f"space, from {nodes} and {finer} nodes": space._replace(
            path=space.path / 3.0, straight=space.straight / 3.0, pair=space.pair / 3.0
        ),
        f"time, midpoint {1e3 * step:g} ms": time,
        f"scheme, sdirk3 {1e3 * step:g} ms": scheme,
    }


def measure_speeds(scenes: Sequence[Scene], rounds: int, progress: Progress, n_robots: int = 32) -> Floats:
    """Real-time factors on one core for mixed commands and for the straight swim, shape (len(scenes), 2).

    Every round times all settings once, after the first stroke from rest. The best round counts, because other work of
    the machine can only add time.
    """
    mixed = random_sequences(n_robots, np.random.default_rng(1)).commands[:3]
    workloads = [mixed, np.broadcast_to(STRAIGHT, mixed.shape)]
    best = np.full((len(scenes), 2), np.inf)
    simulators: dict[tuple[int, int], tuple[Simulator, Any]] = {}
    for turn in range(rounds):
        for k, scene in enumerate(scenes):
            for w, commands in enumerate(workloads):
                if (k, w) not in simulators:
                    simulator = Simulator(scene, n_robots, threads=1)
                    simulator.stroke(commands[0])
                    simulators[k, w] = simulator, simulator.get_state()
                simulator, state = simulators[k, w]
                simulator.set_state(state)
                start = time.thread_time()
                for command in commands[1:]:
                    simulator.stroke(command)
                best[k, w] = min(best[k, w], time.thread_time() - start)
            progress((turn + (k + 1) / len(scenes)) / rounds)
    simulated = n_robots * (len(mixed) - 1) * Scene().actuator.period
    return simulated / best


def study(plan: Plan) -> Found:
    """Run the whole study; drawing is left to the caller."""
    rng = np.random.default_rng(0)
    batches, mine = [sequences(plan, rng), pentagon(*plan.side)], settings(plan)
    few = joined(swims(), random_sequences(min(11, plan.n_random), rng))
    with progress_bar("second opinion") as report:
        doubt = second_opinion(few, plan, report)
    found = []
    for batch in batches:
        with progress_bar(f"errors of {len(batch)} swims") as report:
            found.append(measured(batch, plan, mine, report))
    rows = with_speeds(rows_of(batches, found, mine), plan)
    hub = found[0].limit.hub
    distances = dict(zip(("straight", *PAIRS), np.hypot(*hub[-1, :5].T).tolist(), strict=True))
    return Found(rows, doubt, distances, float(hub[0, 0, 0]))


def sequences(plan: Plan, rng: np.random.Generator) -> Cases:
    """All command sequences of equal length."""
    some = joined(swims(), random_sequences(plan.n_random, rng), slow_sequences(plan.n_slow, rng))
    return joined(some, gaits(), random_gaits(plan.n_gaits, rng))


def with_speeds(rows: list[Row], plan: Plan) -> list[Row]:
    """Rows with their speeds and promises."""
    with progress_bar("speeds") as report:
        speeds = measure_speeds([at(Scene(), row.resolution) for row in rows], plan.rounds, report)
    timed = zip(rows, speeds, strict=True)
    return promised([replace(row, speed=float(mixed), straight_speed=float(alone)) for row, (mixed, alone) in timed])


@dataclass(frozen=True)
class Options:
    """Errors and speeds of the chapter's robot."""

    quick: bool = False
    """Run fewer settings and swims, in under a minute."""
    store: bool = False
    """Also write the table of errors and speeds that comes with the package."""

    def __post_init__(self) -> None:
        if self.quick and self.store:
            raise ValueError("--store needs the whole study, not --quick.")


def run(options: Options, results: Results) -> None:
    """Run the study, write its files and print its table."""
    found = study(QUICK if options.quick else Plan())
    write_csv(found, results.out / "accuracy.csv")
    (results.out / "accuracy.md").write_text(as_markdown(found), encoding="utf-8")
    drawn = draw_all(found, results.out)
    show(as_markdown(found))
    if options.store:
        store(found)
        print(f"Stored: {STROKES}")
    print(f"Written: {', '.join(str(path) for path in (results.out / 'accuracy.csv', *drawn))}")


STUDY = Study(
    "accuracy",
    run,
    Options,
    out=Path("runs/accuracy"),
    tables={
        name: lambda _, name=name: getattr(page, name)()  # type: ignore[misc]
        for name in ("errors", "choosing", "presets", "timed")
    },
    drawn=("accuracy/convergence.png", "accuracy/work_precision.png"),
)
