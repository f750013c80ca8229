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

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from seastar_gym.certification.measure import GROUP
from seastar_gym.command import run_command
from seastar_gym.scene import Numerics, Scene, SmaWires
from seastar_gym.scene.fidelity import TIMED_PRESETS
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator
from studies.accuracy.page import timed
from studies.accuracy.tables import two_digits
from studies.parser import study_parser

Floats = NDArray[np.float64]

PERIODS = (0.5, 0.2, 0.1)
"""Times between decisions [s]."""
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


QUICK = Plan(4, 2, 19, Numerics("implicit-midpoint", 1e-3, 1e-8), ("fast", "balanced"))


def sequences(period: float, plan: Plan, rng: np.random.Generator) -> Floats:
    """Commands of decisions, shape (n_decisions, 2 samples, 5): random ones, then a second that is repeated."""
    a_second = round(1.0 / period)
    commands = rng.uniform(-1.0, 1.0, (plan.seconds * a_second, 2 * plan.samples, 5))
    commands[:, ::2] = rng.integers(-1, 2, commands[:, ::2].shape)
    commands[:, plan.samples :] = np.tile(commands[:a_second, plan.samples :], (plan.seconds, 1, 1))
    return commands


def swim(scene: Scene, commands: Floats, period: float) -> Floats:
    """Hubs at whole seconds [m], shape (seconds, n, 2). commands: Shape (n_decisions, n, 5). period: [s]."""
    parts = []
    for begin in range(0, commands.shape[1], GROUP):
        some = commands[:, begin : begin + GROUP]
        simulator, hub = Simulator(scene, some.shape[1], threads=1), []
        for k, each in enumerate(some, start=1):
            simulator.advance(period, each)
            if k % round(1.0 / period) == 0:
                hub.append(simulator.hub_position())
        parts.append(np.array(hub))
    return np.concatenate(parts, axis=1)


def scene_at(nodes: int, numerics: Numerics, like: Scene) -> Scene:
    """Robot with wires, with so many nodes per limb, these numerics and the discretisation of another."""
    return replace(like, robot=replace(like.robot, nodes_per_limb=nodes), numerics=numerics, actuator=SmaWires())


def way(hub: Floats) -> Floats:
    """Lengths of paths from the origin at whole seconds [m], shape (n,)."""
    return np.asarray(np.linalg.norm(np.diff(hub, axis=0, prepend=0.0), axis=-1).sum(axis=0))


def path_lengths(hub: Floats, limb_length: float) -> Floats:
    """Lengths of paths at whole seconds, at least those of a hub that swims at SLOWEST [m], shape (n,)."""
    return np.fmax(way(hub), SLOWEST * limb_length * len(hub))


def paths(period: float, plan: Plan) -> dict[str, list[float]]:
    """Shortest, median and longest path [mm] at "fast" of random commands and of repeated seconds."""
    fast = Scene.preset("fast")
    commands = sequences(period, plan, np.random.default_rng([SEED, round(1000 * period)]))
    length = 1e3 * way(swim(scene_at(fast.robot.nodes_per_limb, fast.numerics, fast), commands, period))
    kinds = {"random": length[: plan.samples], "repeated": length[plan.samples :]}
    return {name: [two_digits(float(end)) for end in np.percentile(some, (0, 50, 100))] for name, some in kinds.items()}


def summary(space: Floats, time: Floats, samples: int) -> dict[str, float]:
    """Fields of a `TimedPromise` of errors of space and of time, shape (2 samples,), random commands first."""
    largest = {"space_error": space[:samples].max(), "time_error": time[:samples].max()}
    gaits, both = slice(samples, None), space + time
    return {
        **largest, "gait_error": space[gaits].max() + time[gaits].max(),
        "typical_error": np.median(both[:samples]), "typical_gait_error": np.median(both[gaits]),
    }  # fmt: skip


def errors(period: float, plan: Plan, progress: Any) -> dict[str, dict[str, float]]:
    """Errors of every preset, for a time between decisions [s]."""
    commands = sequences(period, plan, np.random.default_rng([SEED, round(1000 * period)]))
    limit = swim(scene_at(plan.nodes, plan.short, Scene.preset("fast")), commands, period)
    progress()
    lengths = path_lengths(limit, Scene().robot.limb_length)

    def distance(hub: Floats, other: Floats) -> Floats:
        return np.asarray(np.linalg.norm(hub - other, axis=-1).max(axis=0) / lengths)

    found: dict[str, dict[str, float]] = {}
    for name in plan.presets:
        preset = Scene.preset(name)
        fine = swim(scene_at(preset.robot.nodes_per_limb, plan.short, preset), commands, period)
        hub = swim(scene_at(preset.robot.nodes_per_limb, preset.numerics, preset), commands, period)
        found[name] = summary(distance(fine, limit), distance(hub, fine), plan.samples)
        progress()
    return found


def study(plan: Plan) -> dict[str, Any]:
    """Run the study; returns its results as plain data, errors rounded upwards to two digits."""
    began = time.process_time()
    with tqdm(total=len(PERIODS) * (1 + len(plan.presets)), unit="set") as bar:
        found = {period: errors(period, plan, bar.update) for period in PERIODS}
    return {
        "about": "Written by python -m studies.accuracy.timed --store; read by seastar_gym.scene.fidelity.",
        "measured_over": {
            "seconds": plan.seconds, "random": plan.samples, "a repeated second": plan.samples,
            "shortest path": f"{SLOWEST:g} limb lengths per second",
            "limit": f"{plan.nodes} nodes per limb, {1e3 * plan.short.step:g} ms",
        },
        "paths": {f"{period:g}": paths(period, plan) for period in PERIODS},
        "processor_seconds": round(time.process_time() - began),
        "presets": {
            name: {f"{period:g}": {what: two_digits(one, up=True) for what, one in found[period][name].items()}
                   for period in PERIODS} for name in plan.presets
        },
    }  # fmt: skip


def main() -> None:
    """Command line: run the study and print its table."""
    parser = study_parser("studies.accuracy.timed", __doc__)
    parser.add_argument("--quick", action="store_true", help="simulate fewer swims and presets")
    parser.add_argument("--store", action="store_true", help="write the table that comes with the package")
    parser.add_argument("--out", type=Path, default=Path("runs/timed_errors.json"), help="file (default: %(default)s)")
    options = parser.parse_args()
    if options.quick and options.store:
        parser.error("--store needs the whole study, not --quick.")
    results = study(QUICK if options.quick else Plan())
    file = TIMED_PRESETS if options.store else options.out
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    print(timed() if options.store else json.dumps(results["presets"], indent=1))


if __name__ == "__main__":
    run_command(main)
