"""Errors of space and time of any scene.

Sequences of all classes of commands (commands.py) are swum with every resolution and numerics of SETTINGS, with the
same nodes and very short steps, and with many nodes and very short steps: the last stand for the continuum. The error
of space is that of few nodes with short steps against many nodes; that of time is that of a setting against short steps
with the same nodes; both are largest distances of the hub at ends of strokes, as fractions of the length of the hub's
path through the water. The sum of the two bounds the whole error, also where they cancel. Long swims tell which
settings gather energy (endurance.py).
"""

import os
import platform
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.certification.commands import ACTIONS, CLASSES, PROMISED, STROKES, VERSION, draw_classes
from seastar_gym.certification.endurance import energy_growth
from seastar_gym.certification.water import carried, velocity, with_the_water
from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.certificate import MOST_SAMPLES, Certificate, CertifiedSetting, physics, resolved
from seastar_gym.scene.checks import require_count, require_seed, shown
from seastar_gym.simulator import Simulator
from seastar_gym.version import __version__

Floats = NDArray[np.float64]
Progress = Callable[[float], None]
"""Called with the share of the work that is done, from 0 to 1."""

NODES = (7, 10, 13, 19)
MANY_NODES = 37
"""Nodes per limb of settings, and of the swims that stand for the continuum."""
NUMERICS = (
    Numerics("sdirk2", 20e-3, 1e-6),
    Numerics("implicit-midpoint", 5e-3, 1e-6),
    Numerics("implicit-midpoint", 2e-3, 1e-7),
    Numerics("implicit-midpoint", 1e-3, 1e-7),
)
SHORT = Numerics("implicit-midpoint", 0.25e-3, 1e-9)
"""Numerics that stand for infinitely short steps."""
SAMPLES = 60
"""Sequences per class: with the confidence 95 %, at most 5 % of all sequences of a class exceed the largest error."""
GROUP = 32
"""Robots that are swum together."""
SHARE_OF_SWIMS = 0.8
"""Part of the work that swims of sequences are, about; the rest are long swims and speeds."""
SHORTEST_PATH = 1e-3
"""Errors of paths that are shorter than this many limb lengths are fractions of that. It is for robots that stay where
they are. A floor within what robots swim would make other errors of all: ten strokes of the chapter's robot are 0.05 to
0.7 limb lengths long, and the largest error of a class is found on a path of an ordinary length."""


class Job(NamedTuple):
    """Sequences to be swum in one batch. cost: Roughly, in units of its own."""

    scene: Scene
    commands: Floats
    cost: float


def certify(scene: Scene, samples: int = SAMPLES, seed: int = 0, progress: Progress | None = None) -> Certificate:
    """Measure errors and speeds of a scene's settings: some minutes on two cores.

    scene: Any scene for one robot. Its nodes per limb, discretisation and numerics do not matter.
    samples: Sequences per class of commands. seed: Seed of the sequences. progress: Called as the work goes on.
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"certify needs a Scene, not {shown(scene)}.")
    if scene.n_robots is not None:
        raise ValueError("A scene with numbers of each robot has no one certificate: certify scene.of_robot(0), say.")
    if scene.held_nodes or scene.loads:
        raise ValueError("Held and loaded nodes belong to one mesh, so a scene with some cannot be certified.")
    if float(np.max(scene.actuator.peak_angle)) == 0.0 or (scene.limb_strengths and not any(scene.limb_strengths)):
        raise ValueError("Nothing moves this robot: its peak angle, or the strength of all limbs, is zero.")
    require_count("samples", samples, 2, MOST_SAMPLES)
    require_seed(seed)
    commands = draw_classes(samples, scene.robot.n_limbs, seed)
    exact = [resolved(scene, nodes, SHORT) for nodes in (MANY_NODES, *NODES)]
    settings = [(nodes, numerics) for nodes in NODES for numerics in NUMERICS]
    scenes = [*exact, *(resolved(scene, *setting) for setting in settings)]
    report = (lambda share: None) if progress is None else progress
    limit, *swum = swim_all(scenes, commands, lambda share: report(SHARE_OF_SWIMS * share))
    lengths = _lengths(scene, limit)

    def distance(hub: Floats, other: Floats) -> Floats:
        return _finite(np.linalg.norm(hub - other, axis=-1).max(axis=0)) / lengths

    fine = dict(zip(NODES, swum, strict=False))
    of_limit = distance(fine[NODES[-1]], limit) / 3.0  # of second order in the edges, which are half as long there
    found = []
    for k, ((nodes, numerics), hub) in enumerate(zip(settings, swum[len(NODES) :], strict=True), start=1):
        space, in_time = distance(fine[nodes], limit) + of_limit, distance(hub, fine[nodes])
        found.append(
            CertifiedSetting(
                nodes, numerics.scheme, numerics.step, numerics.newton_tolerance,
                errors=by_class(space + in_time, samples),
                typical=by_class(space + in_time, samples, np.median),
                space_error=_rounded(max(by_class(space, samples)[name] for name in PROMISED)),
                time_error=_rounded(max(by_class(in_time, samples)[name] for name in PROMISED)),
                speed=_rounded(speed(resolved(scene, nodes, numerics), commands)),
                energy_growth=_rounded(energy_growth(resolved(scene, nodes, numerics))),
            )
        )  # fmt: skip
        report(SHARE_OF_SWIMS + (1.0 - SHARE_OF_SWIMS) * k / len(settings))
    return Certificate(
        physics(scene), tuple(found), PROMISED, ACTIONS, samples,
        limit_error=max(by_class(of_limit, samples)[name] for name in PROMISED),
        classes=VERSION, version=__version__, machine=machine(),
    )  # fmt: skip


def exceeded(
    certificate: Certificate, scene: Scene, samples: int, seed: int, progress: Progress | None = None
) -> dict[str, float]:
    """Share of fresh sequences, by class, whose error exceeds the certificate's, for a scene at a measured setting.

    The error is the whole one, against the limit. samples: Sequences per class. seed: Of these sequences; take another
    one than that of the certificate.
    """
    setting = certificate.of(scene)
    if setting is None:
        raise ValueError(f"This setting was not measured: {shown(scene.numerics)}.")
    commands = draw_classes(samples, scene.robot.n_limbs, seed)
    limit, hub = swim_all([resolved(scene, MANY_NODES, SHORT), scene], commands, progress)
    distances = _finite(np.linalg.norm(hub - limit, axis=-1).max(axis=0))
    errors = (distances / _lengths(scene, limit)).reshape(len(CLASSES), samples)
    return {name: float(np.mean(each > setting.errors[name])) for name, each in zip(CLASSES, errors, strict=True)}


def machine() -> str:
    """Machine that speeds are measured on."""
    return f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}"


def swim(scene: Scene, commands: Floats) -> Floats:
    """Hub at the ends of strokes from rest in the water [m], shape (STROKES, n, 2); NaN where the solver failed."""
    simulator, hub = with_the_water(scene, commands.shape[1], threads=1), []
    for each in commands:
        failed = simulator.stroke(each).status > 0
        hub.append(np.where(failed[:, None], np.nan, simulator.hub_position()))
    return np.array(hub)


def swim_all(scenes: list[Scene], commands: Floats, progress: Progress | None = None) -> list[Floats]:
    """Swims of all sequences with every scene, on all processors, the dearest first."""
    groups = [slice(k, k + GROUP) for k in range(0, commands.shape[1], GROUP)]
    jobs = [
        Job(scene, commands[:, group], scene.robot.nodes_per_limb * scene.robot.n_limbs / scene.numerics.step)
        for scene in scenes
        for group in groups
    ]
    velocity(scenes[0], np.zeros(2))  # not first in a thread
    order, done, total = sorted(range(len(jobs)), key=lambda k: -jobs[k].cost), 0.0, sum(job.cost for job in jobs)
    found: dict[int, Floats] = {}
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for k, hub in zip(order, pool.map(lambda k: swim(jobs[k].scene, jobs[k].commands), order), strict=True):
            found[k] = hub
            done += jobs[k].cost
            if progress is not None:
                progress(done / total)
    parts = [found[k] for k in range(len(jobs))]
    n = len(groups)
    return [np.concatenate(parts[k * n : (k + 1) * n], axis=1) for k in range(len(scenes))]


def path_lengths(hub: Floats, limb_length: float, carried: Floats | float = 0.0) -> Floats:
    """Lengths of paths from the origin, at the ends of strokes [m], at least SHORTEST_PATH limb lengths.

    carried: How far the water carries the hub in every stroke [m], which is no way swum.
    """
    steps = np.diff(np.concatenate([np.zeros((1, *hub.shape[1:])), hub]), axis=0) - carried
    return np.fmax(np.linalg.norm(steps, axis=-1).sum(axis=0), SHORTEST_PATH * limb_length)


def _lengths(scene: Scene, hub: Floats) -> Floats:
    """Lengths of paths through a scene's water [m]."""
    return path_lengths(hub, float(np.max(scene.robot.limb_length)), carried(scene, hub))


def by_class(errors: Floats, samples: int, of: Callable[..., Floats] = np.max) -> dict[str, float]:
    """Largest error of every class, or another number `of` its errors, rounded upwards to two digits."""
    found = of(errors.reshape(len(CLASSES), samples), axis=1)
    return {name: _rounded(float(error)) for name, error in zip(CLASSES, found, strict=True)}


def speed(scene: Scene, commands: Floats, strokes: int = 3) -> float:
    """Simulated time over processor time of a batch on one core, the best of some strokes."""
    simulator, best = Simulator(scene, min(64, commands.shape[1]), threads=1), np.inf
    for k in range(strokes):
        begin = time.thread_time()
        simulator.stroke(commands[k % STROKES, : simulator.n_robots])
        best = min(best, time.thread_time() - begin)
    return float(scene.actuator.period * simulator.n_robots / best)


def _finite(distances: Floats) -> Floats:
    return np.where(np.isnan(distances), np.inf, distances)


def _rounded(number: float, digits: int = 2) -> float:
    """Rounded upwards, so that a promise is not less than what was measured."""
    if not np.isfinite(number) or number <= 0.0:
        return number
    unit = 10.0 ** (np.floor(np.log10(number)) - digits + 1)
    return float(f"{np.ceil(number / unit - 1e-9) * unit:.{digits}g}")
