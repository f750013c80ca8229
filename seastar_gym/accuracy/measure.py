"""Errors of space and time of any scene, over classes of commands, and whether its settings gather energy.

Sequences of all classes of commands are swum with every setting, of NODES and NUMERICS, with the same nodes and very
short steps, and with many nodes and very short steps: the last stand for the continuum. The error of space is that
of few nodes with short steps against many nodes, and what is left of the latter's own; that of time is that of a
setting against short steps with the same nodes; both are largest distances of the hub at ends of strokes or decisions,
as fractions of the length of the hub's path through the water. The sum of the two bounds the whole error, also where
they cancel.

Classes of commands are those of commands.py.

Errors are measured over ten strokes, and long swims tell which settings gather energy. The implicit midpoint rule damps
nothing, and on some meshes it resonates with some steps: the robot gathers energy for a hundred strokes, and only then
swims differently. Kinetic energies at the ends of strokes tell, without a swim of short steps to compare with. They are
relative to the water, which may carry the robot off.

In a current, a robot's start and way are those that the water sees. A uniform current is a translation: what swims in
it has the errors of still water, though it is carried off. Where the water differs from place to place, the current is
that at the hub.
"""

import math
import os
import platform
import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.accuracy.certificate import CLASSES_VERSION, MOST_SAMPLES, Certificate, Setting, at, physics
from seastar_gym.accuracy.commands import (
    CLASSES,
    SECONDS,
    SLOWEST,
    SMALL_COMMANDS,
    STROKES,
    Batch,
    Floats,
    draw_batch,
)
from seastar_gym.accuracy.resonance import resonances
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import velocities_at
from seastar_gym.process import processors
from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.actuators.base import complete
from seastar_gym.scene.checks import require_count, require_period, require_seed, shown
from seastar_gym.scene.numerics import DAMPING, Resolution
from seastar_gym.scene.robot import Discretisation
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.watches import ENOUGH, WINDOW
from seastar_gym.version import __version__


def velocity(scene: Scene, places: Floats) -> Floats:
    """Velocity of the water [m/s] at places [m], shape (..., 2), as `velocities_at`; zero without a current."""
    current = _current(scene)
    return np.zeros_like(places) if current is None else velocities_at(current, places)


def with_the_water(scene: Scene, n_robots: int, threads: int | None = None, error_bars: bool = False) -> Simulator:
    """Robots at rest in the water: with the hub at the origin, and with the velocity of the water there."""
    simulator = Simulator(scene, n_robots, threads, error_bars)
    if _current(scene) is not None:
        state = simulator.get_state()
        simulator.set_state(state._replace(velocities=state.velocities + velocity(scene, np.zeros(2))))
    return simulator


def carried(scene: Scene, hub: Floats) -> Floats:
    """How far the water carries a hub in every stroke [m]: by its velocity where the stroke begins and where it ends.

    hub: At the ends of strokes from the origin [m], shape (strokes, n, 2), as is the result.
    """
    at_ends = velocity(scene, np.concatenate([np.zeros((1, *hub.shape[1:])), hub]))
    return scene.actuator.period * 0.5 * (at_ends[:-1] + at_ends[1:])


def _current(scene: Scene) -> Any:
    return None if scene.fluid is None else scene.fluid.current


LONG, LONG_IN_TIME = 200, 500
"""Strokes, and decisions that are shorter, of a long swim."""
NOISE = 1e-6
"""Share of the largest early energy of all swims, below which an energy is noise. Equal limbs that all turn alike end
their strokes at rest, with 1e-20 to 1e-28 of it, which is rounding; other swims of 2 to 6 equal limbs have at least
0.1."""


def energy_growth(scene: Scene, samples: int = 8, seed: int = 0, period: float | None = None) -> float:
    """Largest kinetic energy of late strokes over that of early ones, the worst of some long swims; inf for a failure.

    Robots repeat one command, or two in turn, `samples` of each, and swim the alternation of mirrored pairs. A setting
    that gathers no energy has about 1, one that resonates ten and more; at `ENOUGH` the swims end.

    period: Time between decisions [s], which are then held for a period of the actuator. None means strokes.
    """
    commands = long_swims(scene.robot.n_limbs, samples, seed)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "The kinetic energy", RuntimeWarning)  # it is told by the result
        if period is None:
            return float(_energy_growths(scene, commands).max())
        held = max(1, round(scene.actuator.period / period))
        return float(_energy_growths(scene, np.repeat(commands, held, axis=0), period, LONG_IN_TIME).max())


def _energy_growths(scene: Scene, commands: Floats, period: float | None = None, n_strokes: int = LONG) -> Floats:
    """Growth of the energy of each long swim, shape (1 + 2 samples,)."""
    n, window = commands.shape[1], WINDOW * len(commands) // STROKES
    simulator, energies, failed = with_the_water(scene, n), np.empty((n_strokes, n)), np.zeros(n, bool)
    for stroke in range(n_strokes):
        command = commands[stroke % len(commands)]
        failed |= (simulator.stroke(command) if period is None else simulator.advance(period, command)).status > 0
        energies[stroke] = simulator.kinetic_energy(relative_to_water=True)
        early, late = energies[:window], energies[stroke : stroke + 1]
        growth = _growth(early, late) if stroke >= window else np.zeros(n)
        growth[failed] = np.inf
        if growth.max() >= ENOUGH:
            return growth
    return np.where(failed, np.inf, _growth(energies[:window], energies[-window:]))


def _growth(early: Floats, late: Floats) -> Floats:
    """Largest late energy over the largest early one of the same swim; both of shape (strokes, n)."""
    first = early.max(axis=0)
    least = max(NOISE * first.max(), np.finfo(float).tiny)
    return np.asarray(late.max(axis=0) / np.maximum(first, least))


def long_swims(n_limbs: int, samples: int, seed: int) -> Floats:
    """Commands that are repeated in long swims, shape (STROKES, 1 + 2 samples, n_limbs)."""
    rng = np.random.default_rng(seed)
    drawn = [CLASSES[name](rng, samples, n_limbs) for name in ("repeated ternary", "alternating ternary")]
    return np.concatenate([mirrored_pairs(n_limbs)[:, None], *drawn], axis=1)


def mirrored_pairs(n_limbs: int) -> Floats:
    """Limbs 2 and n opposed, then 3 and n - 1, in turn: a fast straight gait, shape (STROKES, n_limbs)."""
    commands = np.zeros((STROKES, n_limbs))
    for stroke in range(STROKES):
        limb = 1 + stroke % max(1, (n_limbs - 1) // 2)
        commands[stroke, limb % n_limbs], commands[stroke, -limb] = 1.0, -1.0
    return commands


Progress = Callable[[float], None]
"""Called with the share of the work that is done, from 0 to 1."""

NODES = (7, 10, 13, 19)
MANY_NODES = 37
"""Nodes per limb of settings, and of the swims that stand for the continuum."""
NUMERICS = (
    Numerics("implicit-midpoint", 10e-3, 1e-4, damping=0.05),
    Numerics("implicit-midpoint", 5e-3, 1e-5, damping=DAMPING),
    Numerics("implicit-midpoint", 2.5e-3, 1e-5, damping=0.01),
    Numerics("implicit-midpoint", 1e-3, 1e-6, damping=DAMPING),
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


class Swims(NamedTuple):
    """Swims of some robots from rest in the water, at the ends of strokes or decisions; arrays over these and robots.

    hub: Positions of hubs [m], shape (strokes, n, 2); NaN once the solver failed.
    heading: What robots were turned by [rad].
    error_estimate [m], newton_iterations, steps, halvings: See `StrokeReport`.
    """

    hub: Floats
    heading: Floats
    error_estimate: Floats
    newton_iterations: Floats
    steps: Floats
    halvings: Floats


class Errors(NamedTuple):
    """Errors of swims against others of the same commands, shape (n,) each; inf where the solver failed.

    path, end: Largest and last distance of the hub from the other path, as fractions of a path's length.
    heading: Largest difference of the heading [rad].
    """

    path: Floats
    end: Floats
    heading: Floats


class Measured(NamedTuple):
    """Swims of some resolutions, and their errors of space and of time, in this order.

    limit: Swims that stand for the continuum. of_limit: Errors of their paths, shape (n,), which those of space have.
    """

    limit: Swims
    of_limit: Floats
    swims: list[Swims]
    space: list[Errors]
    time: list[Errors]


def certify(
    scene: Scene,
    samples: int = SAMPLES,
    seed: int = 0,
    progress: Progress | None = None,
    decision_period: float | None = None,
) -> Certificate:
    """Measure errors and speeds of a scene's settings: some minutes on two cores.

    scene: Any scene for one robot. Its nodes per limb, discretisation and numerics do not matter.
    samples: Sequences per class of commands. seed: Seed of the sequences. progress: Called as the work goes on.
    decision_period: Time between decisions [s] that are shorter than a stroke. None means strokes.
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
    period = _within_a_stroke(scene, decision_period)
    batch = draw_batch(samples, scene.robot.n_limbs, seed, period)
    settings = [Resolution("continuum", nodes, numerics) for nodes in NODES for numerics in NUMERICS]
    limit = Resolution("continuum", MANY_NODES, SHORT)
    found, of_limit = measure_settings(scene, settings, limit, lambda *_: SHORT, [batch], progress, of_energy=settings)
    promised = tuple(name for name in batch.commands if name != SMALL_COMMANDS)
    return Certificate(
        physics(scene), tuple(found), promised, samples, limit_error=of_limit,
        classes=CLASSES_VERSION, version=__version__, machine=machine(), decision_period=period,
        measured_over={} if period is None else {"resonances": resonances(scene, period)},
    )  # fmt: skip


def _within_a_stroke(scene: Scene, decision_period: float | None) -> float | None:
    """Time between decisions [s], None for strokes; ValueError for one that the scene's actuator cannot take."""
    require_period(decision_period)
    stroke = scene.actuator.period
    if decision_period is None or decision_period == stroke:
        return None
    if not complete(scene.actuator).has_memory or not stroke / 100.0 <= decision_period < stroke:
        raise ValueError(
            f"Decisions every {decision_period:g} s need wires, SmaWires(), whose period is longer, and at most a "
            f"hundred times as long: it is {stroke:g} s."
        )
    return decision_period


def measure_settings(
    scene: Scene,
    resolutions: Sequence[Resolution],
    limit: Resolution,
    short: Callable[[Discretisation, int], Numerics],
    batches: Sequence[Batch],
    progress: Progress | None = None,
    of_energy: Sequence[Resolution] = (),
) -> tuple[list[Setting], float]:
    """Errors and speeds of a scene at some resolutions over all batches together, and the largest error of the limit.

    limit, short: See `measure`. of_energy: Resolutions whose long swims are swum, to see whether energy grows.
    """
    report = (lambda share: None) if progress is None else progress
    found, done, whole = list[Measured](), 0, sum(each.joined.size for each in batches)
    for batch in batches:

        def told(share: float, before: int = done, own: int = batch.joined.size) -> None:
            report(SHARE_OF_SWIMS * (before + own * share) / whole)

        found.append(measure(scene, resolutions, limit, short, batch.joined, told, batch.period))
        done += batch.joined.size

    def by_class(numbers: Iterable[Floats]) -> dict[str, Floats]:
        parts = [batch.of_classes(each) for batch, each in zip(batches, numbers, strict=True)]
        names = dict.fromkeys(name for part in parts for name in part)  # none twice
        return {name: np.concatenate([part[name] for part in parts if name in part]) for name in names}

    scenes, period, settings = [at(scene, each) for each in resolutions], batches[0].period, []
    for k, (each, factor) in enumerate(
        zip(resolutions, real_time_factors(scenes, batches[0].joined, period), strict=True)
    ):
        parts = [(swum.space[k], swum.time[k]) for swum in found]
        sums = by_class(space.path + in_time.path for space, in_time in parts)
        growth, numerics = energy_growth(scenes[k], period=period) if each in of_energy else math.nan, each.numerics
        settings.append(
            Setting(
                each.nodes_per_limb, numerics.scheme, numerics.step, numerics.newton_tolerance,
                errors={name: rounded_up(float(some.max())) for name, some in sums.items()},
                typical={name: rounded_up(float(np.median(some))) for name, some in sums.items()},
                space_error=_largest(by_class(space.path for space, _ in parts)),
                time_error=_largest(by_class(in_time.path for _, in_time in parts)),
                speed=factor, energy_growth=rounded_up(growth),
                heading_error=_largest(by_class(np.degrees(space.heading + time.heading) for space, time in parts)),
                end_error=_largest(by_class(space.end + in_time.end for space, in_time in parts)),
                discretisation=each.discretisation, damping=numerics.damping,
            )
        )  # fmt: skip
        report(SHARE_OF_SWIMS + (1.0 - SHARE_OF_SWIMS) * (k + 1) / len(resolutions))
    return settings, _largest(by_class(swum.of_limit for swum in found))


def _largest(errors: Mapping[str, Floats]) -> float:
    """Largest error of all classes but small commands, rounded upwards."""
    return rounded_up(float(max(some.max() for name, some in errors.items() if name != SMALL_COMMANDS)))


def measure(
    scene: Scene,
    resolutions: Sequence[Resolution],
    limit: Resolution,
    short: Callable[[Discretisation, int], Numerics],
    commands: Floats,
    progress: Progress | None = None,
    period: float | None = None,
) -> Measured:
    """Errors of a scene at some resolutions, of space and of time, sequence by sequence.

    Errors of space fall with the second power of the edges. So a third of the error of edges twice as long as those of
    the limit is left in the limit, and is added to all.

    limit: What stands for the continuum. short: Numerics that stand for infinitely short steps with a discretisation
    and nodes per limb. commands: Shape (strokes, n, n_limbs). period: Time between decisions [s]; errors are then those
    after any decision. None means strokes.
    """
    meshes = [each[:2] for each in resolutions]
    half: tuple[Discretisation, int] = (limit.discretisation, (limit.nodes_per_limb + 1) // 2)
    fine = [Resolution(*mesh, short(*mesh)) for mesh in dict.fromkeys([*meshes, half])]
    exact, *swum = swim_all([at(scene, each) for each in (limit, *fine, *resolutions)], commands, progress, period)
    lengths = path_lengths(scene, exact.hub, period)
    converged = {each[:2]: found for each, found in zip(fine, swum, strict=False)}
    of_limit = errors(converged[half], exact, lengths).path / 3.0
    space = {mesh: errors(found, exact, lengths) for mesh, found in converged.items()}
    space = {mesh: each._replace(path=each.path + of_limit) for mesh, each in space.items()}
    swims = swum[len(fine) :]
    time = [errors(each, converged[mesh], lengths) for each, mesh in zip(swims, meshes, strict=True)]
    return Measured(exact, of_limit, swims, [space[mesh] for mesh in meshes], time)


def errors(swum: Swims, exact: Swims, lengths: Floats) -> Errors:
    """Errors of swims against others. lengths: Of paths [m], shape (n,), of which errors are fractions.

    With the same lengths for space and time, no swim errs by more than the sum of the two.
    """
    distance = np.linalg.norm(swum.hub - exact.hub, axis=-1)
    turn = np.abs(np.angle(np.exp(1j * (swum.heading - exact.heading)))).max(axis=0)
    failed = np.isnan(distance).any(axis=0)
    found = distance.max(axis=0) / lengths, distance[-1] / lengths, turn
    return Errors(*(np.where(failed, np.inf, each) for each in found))


def machine() -> str:
    """Machine that speeds are measured on: cores, architecture, lanes and Python."""
    return f"{os.cpu_count()} cores, {platform.machine()}, {N_LANES} lanes, Python {platform.python_version()}"


def swim(scene: Scene, commands: Floats, period: float | None = None, error_bars: bool = False) -> Swims:
    """Swims by commands, shape (n_strokes, n, n_limbs), or by decisions every so many seconds."""
    simulator, rows = with_the_water(scene, commands.shape[1], threads=1, error_bars=error_bars), []
    for each in commands:
        report = simulator.stroke(each) if period is None else simulator.advance(period, each)
        hub = np.where((report.status > 0)[:, None], np.nan, simulator.hub_position())
        counts = (getattr(report, name) for name in Swims._fields[2:])
        rows.append(Swims(hub, simulator.heading(), *counts))
    return Swims(*map(np.array, zip(*rows, strict=True)))


def swim_all(
    scenes: Sequence[Scene], commands: Floats, progress: Progress | None = None, period: float | None = None
) -> list[Swims]:
    """Swims of all sequences with every scene, on all processors, the dearest first.

    period: Time between decisions [s], after each of which swims are told. None means strokes.
    """
    groups = [commands[:, k : k + GROUP] for k in range(0, commands.shape[1], GROUP)]
    jobs = [(scene, group) for scene in scenes for group in groups]
    cost = [scene.robot.nodes_per_limb * group[0].size / scene.numerics.step for scene, group in jobs]
    velocity(scenes[0], np.zeros(2))  # not first in a thread
    order, done = sorted(range(len(jobs)), key=lambda k: -cost[k]), 0.0
    found: dict[int, Swims] = {}
    with ThreadPoolExecutor(processors()) as pool:
        for k, swum in zip(order, pool.map(lambda k: swim(*jobs[k], period), order), strict=True):
            found[k] = swum
            done += cost[k]
            if progress is not None:
                progress(done / sum(cost))
    parts = [[found[k + each] for each in range(len(groups))] for k in range(0, len(jobs), len(groups))]
    return [Swims(*(np.concatenate(each, axis=1) for each in zip(*some, strict=True))) for some in parts]


def whole_seconds(period: float | None, n: int) -> slice:
    """Which of n decisions end about whole seconds, of all strokes if the period is None."""
    every = 1 if period is None else round(1.0 / period)
    return slice((n - 1) % every, None, every)


def path_lengths(scene: Scene, hub: Floats, period: float | None = None) -> Floats:
    """Lengths of paths through a scene's water from the origin [m], shape (n,), of which errors are fractions.

    They are at least SHORTEST_PATH, and at least SLOWEST fast where decisions are shorter than strokes.

    hub: At the ends of strokes or decisions [m], shape (strokes, n, 2). How far the water carries it is no way swum.
    period: Time between decisions [s]; a path is then as long as it is seen at whole seconds. None means strokes.
    """
    hub, shortest = hub[whole_seconds(period, len(hub))], SHORTEST_PATH if period is None else SLOWEST * SECONDS
    steps = np.diff(hub, axis=0, prepend=0.0) - carried(scene, hub)
    return np.fmax(np.linalg.norm(steps, axis=-1).sum(axis=0), shortest * float(np.max(scene.robot.limb_length)))


def real_time_factors(
    scenes: Sequence[Scene], commands: Floats, period: float | None = None, rounds: int = 3, most: int = 64
) -> list[float]:
    """Simulated time over processor time of batches on one core, rounded to two digits.

    Every round times all scenes once, after a first stroke or decision from rest. The best round counts, because other
    work of the machine can only add time.
    """
    every = max(1, commands.shape[1] // most)
    some, timed = commands[:, ::every][:, :most], 2 if period is None else round(2.0 / period)
    simulators = [Simulator(scene, some.shape[1], threads=1) for scene in scenes]

    def swim_on(simulator: Simulator, commands: Floats) -> None:
        for each in commands:
            simulator.stroke(each) if period is None else simulator.advance(period, each)

    for simulator in simulators:
        swim_on(simulator, some[:1])
    states, best = [simulator.get_state() for simulator in simulators], np.full(len(scenes), np.inf)
    for _ in range(rounds):
        for k, (simulator, state) in enumerate(zip(simulators, states, strict=True)):
            simulator.set_state(state)
            start = time.thread_time()
            swim_on(simulator, some[1 : 1 + timed])
            best[k] = min(best[k], time.thread_time() - start)
    simulated = some.shape[1] * timed * (scenes[0].actuator.period if period is None else period)
    return [float(f"{simulated / each:.2g}") for each in best]


def rounded_up(number: float) -> float:
    """Rounded upwards to two digits, so that a promise is not less than what was measured."""
    if not np.isfinite(number) or number <= 0.0:
        return number
    unit = 10.0 ** (np.floor(np.log10(number)) - 1)
    return float(f"{np.ceil(number / unit - 1e-9) * unit:.2g}")
