"""Errors of the presets where commands come several times a second, to wires.

    python -m studies.accuracy.timed --store

Robots with `SmaWires` swim ten seconds from rest by decisions every 0.5, 0.2 and 0.1 s: half of them by random commands
of -1, 0 and 1 or from between, half by a random second that is repeated; the two have errors of their own. The error is
the hub's largest distance, at whole seconds, from its path with 73 nodes per limb and steps of 0.2 ms, as a fraction of
that path's length. A path that is shorter than a tenth of a limb length per second counts as that long: repeated
seconds hardly swim, so that shares of their paths would say nothing. The error of space is that of the preset's nodes
with steps of 0.2 ms, that of time the rest, against the same nodes. `--store` writes the table that environments
promise in `info`, bounds and medians.
"""

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np

from seastar_gym.accuracy import Certificate, Setting, chapter
from seastar_gym.accuracy.certificate import CLASSES_VERSION
from seastar_gym.accuracy.command import progress_bar
from seastar_gym.accuracy.measure import Progress, machine, measure, path_lengths, rounded_up, swim_all
from seastar_gym.accuracy.setting import at, physics
from seastar_gym.scene import Numerics, Scene, SmaWires
from seastar_gym.scene.numerics import PRESETS, Fidelity, Resolution
from seastar_gym.version import __version__
from studies.accuracy.page import PERIODS, timed
from studies.frame import Floats, Results, Study, rounded
from studies.pages import show

SCENE = replace(Scene(), actuator=SmaWires())
SECONDS = 10
SAMPLES, SEED = 60, 0
"""Sequences of either kind for each time between decisions. With the confidence 95 %, at most 5 % of all others exceed
the largest error of 60."""
SLOWEST = 0.1
"""Errors of swims that are slower than this [limb lengths per second] are fractions of a path at this speed."""
LIMIT_NODES = 73
SHORT = Numerics("implicit-midpoint", 0.2e-3, 1e-9)
"""Nodes per limb and numerics that stand for the continuum."""


class Plan(NamedTuple):
    """Size of the study. presets: Fidelities that are measured."""

    samples: int = SAMPLES
    seconds: int = SECONDS
    nodes: int = LIMIT_NODES
    short: Numerics = SHORT
    presets: tuple[Fidelity, ...] = get_args(Fidelity)


def sequences(period: float, plan: Plan, rng: np.random.Generator) -> Floats:
    """Commands of decisions, shape (n_decisions, 2 samples, 5): random ones, then a second that is repeated."""
    a_second = round(1.0 / period)
    commands = rng.uniform(-1.0, 1.0, (plan.seconds * a_second, 2 * plan.samples, 5))
    commands[:, ::2] = rng.integers(-1, 2, commands[:, ::2].shape)
    commands[:, plan.samples :] = np.tile(commands[:a_second, plan.samples :], (plan.seconds, 1, 1))
    return commands


def drawn(period: float, plan: Plan) -> Floats:
    """Sequences of the study."""
    return sequences(period, plan, np.random.default_rng([SEED, round(1000 * period)]))


def paths(period: float, plan: Plan) -> dict[str, list[float]]:
    """Shortest, median and longest path [mm] at "fast" of random commands and of repeated seconds."""
    (swum,) = swim_all([at(SCENE, PRESETS["fast"])], drawn(period, plan), period=period)
    random, repeated = np.split(1e3 * path_lengths(SCENE, swum.hub, 0.0), 2)
    kinds = {"random": random, "repeated": repeated}
    return {name: [rounded(float(end), 2) for end in np.percentile(some, (0, 50, 100))] for name, some in kinds.items()}


def setting(resolution: Resolution, space: Floats, time: Floats) -> Setting:
    """Setting of errors of space and of time, of random and then of as many repeated commands; rounded upwards."""
    discretisation, nodes_per_limb, numerics = resolution
    (random, repeated), (in_time, repeated_in_time) = np.split(space, 2), np.split(time, 2)
    of_space, of_time = rounded_up(random.max()), rounded_up(in_time.max())
    medians = np.median(random + in_time), np.median(repeated + repeated_in_time)
    return Setting(
        nodes_per_limb, numerics.scheme, numerics.step, numerics.newton_tolerance,
        errors={"random": of_space + of_time, "repeated": rounded_up(repeated.max() + repeated_in_time.max())},
        typical={name: rounded_up(float(each)) for name, each in zip(("random", "repeated"), medians, strict=True)},
        space_error=of_space, time_error=of_time, discretisation=discretisation, damping=numerics.damping,
    )  # fmt: skip


def errors(period: float, plan: Plan, progress: Progress) -> dict[str, Setting]:
    """Settings of all presets, for a time between decisions [s]."""
    resolutions = [PRESETS[name] for name in plan.presets]
    limit, shortest = Resolution("continuum", plan.nodes, plan.short), SLOWEST * plan.seconds
    found = measure(SCENE, resolutions, limit, lambda *_: plan.short, drawn(period, plan), progress, period, shortest)
    settings = zip(plan.presets, found.space, found.time, strict=True)
    return {name: setting(PRESETS[name], space.path, time.path) for name, space, time in settings}


def study(period: float, plan: Plan) -> Certificate:
    """Errors of all presets for a time between decisions [s]."""
    began = time.process_time()
    with progress_bar(f"every {period:g} s") as progress:
        settings = tuple(errors(period, plan, progress).values())
    return Certificate(
        physics(SCENE), settings, ("random",), ("random", "repeated"), plan.samples,
        limit_error=rounded_up(min(each.space_error for each in settings) / 3.0), classes=CLASSES_VERSION,
        version=__version__, machine=machine(), decision_period=period,
        measured_over={
            "command": "python -m studies.accuracy.timed --store",
            "seconds": plan.seconds, "random": plan.samples, "a repeated second": plan.samples,
            "shortest path": f"{SLOWEST:g} limb lengths per second",
            "limit": f"{plan.nodes} nodes per limb, {1e3 * plan.short.step:g} ms",
            "paths": paths(period, plan), "processor_seconds": round(time.process_time() - began),
        },
    )  # fmt: skip


@dataclass(frozen=True)
class Options:
    """Errors of the presets in time."""

    store: bool = False
    """Write the certificates that come with the package."""


def run(options: Options, results: Results) -> None:
    """Run the study, and print its table."""
    for period in PERIODS:
        certificate = study(period, Plan())
        certificate.save(chapter.file_of(period, chapter.FOLDER if options.store else results.out))
        print(*(f"{period:g} s: {each}: {each.errors}" for each in certificate.settings), sep="\n")
    if options.store:
        show(timed())


STUDY = Study("accuracy.timed", run, Options, out=Path("runs/timed_errors"))
