"""Error of the hub's path over processor time per stroke, for six robots: which setting is worth its time.

The chapter's robot, one of silicone, one with thermal actuators, one whose limbs touch, and ones of three and of twelve
limbs swim ten strokes from rest, with sequences of every class of commands of full amplitude
(`seastar_gym.accuracy.commands`). The error is the hub's largest distance, at the ends of strokes, from its path
with 73 nodes per limb of the continuum's discretisation and the implicit midpoint rule at 0.125 ms, over the length of
that path: the whole error, which is smaller than the promised sum of space and time where the two cancel. The straight
swim of the chapter's robot stands beside, with four published codes.

Times are processor times of one thread per robot and stroke, the best of several strokes of a batch. Writes the
numbers (JSON) and a picture. A robot whose numbers are in the file is not swum again.
"""

from functools import partial
from typing import Any

import numpy as np

from seastar_gym.accuracy.commands import CLASSES, PROMISED, draw_classes
from seastar_gym.accuracy.measure import errors, path_lengths, swim
from seastar_gym.accuracy.setting import at
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Contact, Numerics, Scene, Seastar, SmaPulse, relaxation_time
from seastar_gym.scene.actuators.thermal import ThermalSma
from seastar_gym.scene.numerics import PRESETS, Resolution
from seastar_gym.simulator import Simulator
from studies.accuracy.settings import MILLI
from studies.accuracy.work_precision_page import draw, of_presets, of_settings
from studies.benchmark import repeat
from studies.frame import Floats, Results, Study

PROBLEMS: dict[str, Scene] = {
    "chapter's robot": Scene(),
    "silicone": Scene(Seastar(relaxation_time=relaxation_time(0.1, 10.0))),
    "thermal actuators": Scene(actuator=ThermalSma()),
    "contact": Scene(contact=Contact()),
    "three limbs": Scene(Seastar(3), actuator=SmaPulse(0.4)),
    "twelve limbs": Scene(Seastar(12), actuator=SmaPulse(0.25)),
}
"""Scenes. Hub hinges of the chapter's discretisation allow three and twelve limbs no larger peak angles."""
SETTINGS: tuple[Resolution, ...] = (
    *PRESETS.values(),
    *(Resolution("continuum", n, Numerics("sdirk2", 20 * MILLI, 1e-6)) for n in (7, 10)),
    *(Resolution("continuum", n, Numerics("implicit-midpoint", 5 * MILLI, 1e-5)) for n in (10, 19)),
    *(Resolution("continuum", n, Numerics("implicit-midpoint", 2 * MILLI, 1e-7)) for n in (10, 13)),
    Resolution("chapter", 10, Numerics("implicit-euler", 10 * MILLI)),
    *(Resolution("chapter", 10, Numerics("implicit-midpoint", h * MILLI, 1e-7)) for h in (5, 1)),
    *(Resolution("chapter", n, Numerics("implicit-midpoint", 1 * MILLI, 1e-7)) for n in (19, 37)),
)
"""Settings of both discretisations, the presets first."""
LIMIT = Resolution("continuum", 73, Numerics("implicit-midpoint", 0.125 * MILLI, 1e-9))
HALF = Resolution("continuum", 37, Numerics("implicit-midpoint", 0.25 * MILLI, 1e-9))
"""What stands for the continuum, and twice its edges and steps: its own error is a third of their difference."""
SAMPLES, SEED = 2, 7
"""Sequences per class, and their seed."""
BATCH, STROKES = 32, 4
"""Robots and strokes of the timing."""


def draw_sequences(n_limbs: int) -> Floats:
    """Sequences of all classes of full amplitude, shape (strokes, n, n_limbs)."""
    drawn = np.split(draw_classes(SAMPLES, n_limbs, SEED), len(CLASSES), axis=1)
    return np.concatenate([each for name, each in zip(CLASSES, drawn, strict=True) if name in PROMISED], axis=1)


def cost(scene: Scene, n_robots: int = BATCH, error_bars: bool = False) -> float:
    """Processor time of a stroke [s] per robot of a batch, for random commands after one stroke from rest."""
    simulator, rng = Simulator(scene, n_robots, 1, error_bars), np.random.default_rng(0)

    def stroke() -> None:
        simulator.stroke(rng.integers(-1, 2, (n_robots, scene.robot.n_limbs)).astype(float))

    return min(repeat(stroke, 0.0)) / n_robots


def finite(number: float) -> float | None:
    """Number as JSON has it: none where the solver failed."""
    return float(number) if np.isfinite(number) else None


def examine(physics: Scene, straight: bool) -> dict[str, Any]:
    """Numbers of a problem. straight: Whether the chapter's straight swim stands beside the sequences, as the last."""
    commands = draw_sequences(physics.robot.n_limbs)
    if straight:
        commands = np.concatenate([commands, np.tile(STRAIGHT, (len(commands), 1, 1))], axis=1)
    limit, half = (swim(at(physics, each), commands) for each in (LIMIT, HALF))
    lengths = path_lengths(physics, limit.hub)
    rows = []
    for setting in SETTINGS:
        scene = at(physics, setting)
        found = errors(swim(scene, commands), limit, lengths).path
        own = found[:-1] if straight else found
        rows.append({
            "discretisation": setting.discretisation, "nodes_per_limb": setting.nodes_per_limb,
            "scheme": setting.numerics.scheme, "step": setting.numerics.step,
            "newton_tolerance": setting.numerics.newton_tolerance,
            "preset": next((name for name, each in PRESETS.items() if each == setting), None),
            "ms_per_stroke": 1e3 * cost(scene),
            "largest_error": finite(own.max()), "median_error": finite(np.median(own)),
            **({"straight_error": finite(found[-1])} if straight else {}),
        })  # fmt: skip
    return {
        "sequences": commands.shape[1] - straight,
        "limit_error": float((errors(half, limit, lengths).path / 3.0).max()),
        **({"straight_distance": float(np.hypot(*limit.hub[-1, -1]))} if straight else {}),
        "settings": rows,
    }  # fmt: skip


def run(results: Results) -> None:
    """Examine the problems that are missing. ValueError where the file is of another machine or version."""
    results.read()
    if results and {name: results.get(name) for name in results.about} != results.about:
        raise ValueError(f"{results.file} has numbers of another machine or version: give another --out.")
    cells = {
        ("problems", name): partial(examine, physics, straight=physics.is_chapters)
        for name, physics in PROBLEMS.items()
    }
    results.fill(cells, lambda found: f"{len(found)} rows")


STUDY = Study(
    "accuracy.work_precision",
    run,
    file="accuracy/work_precision.json",
    pictures={"work_precision_problems.png": draw},
    tables={"work_precision presets": of_presets, "work_precision": of_settings},
)
