"""Errors and speeds that come with the package: what `info`, README.md and docs/accuracy.md promise of the presets.

`seastar certify` with more sequences, settings and nodes, for the chapter's robot: one table of strokes, and two of
decisions every 0.1 to 0.5 s, for robots with `SmaWires` whose limbs damp as soft silicone does, and whose limbs damp
nothing. Settings are the presets, and those of the front that `studies.front` finds. Errors are against the continuum:
infinitely many nodes per limb and infinitely short steps; seastar_gym/accuracy/measure.py defines them. `--store`
writes the tables of `seastar_gym.accuracy.chapters`.

`--fresh` swims sequences and decision periods that no table used, and keeps how many err more than is promised;
`--robots` does so for certificates of other robots.
"""

import itertools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from seastar_gym.accuracy import Certificate, Setting, chapters_certificate, measure, timed_certificate
from seastar_gym.accuracy import chapters as chapter
from seastar_gym.accuracy.certificate import CLASSES_VERSION, REPEATED, at, physics
from seastar_gym.accuracy.command import progress_bar
from seastar_gym.accuracy.commands import (
    LEAST_SHARE,
    SECONDS,
    SLOWEST,
    SMALL_COMMANDS,
    STROKES,
    Batch,
    decisions,
    draw_batch,
)
from seastar_gym.controllers.contract import actions_of
from seastar_gym.controllers.registry import load_agent
from seastar_gym.envs.group import transform_commands
from seastar_gym.evaluation.rollout import env_of
from seastar_gym.gaits import PAIRS, STRAIGHT, pentagon_gait
from seastar_gym.scene import Numerics, Scene, Seastar, SmaWires, Water
from seastar_gym.scene.numerics import PRESETS, Fidelity, Resolution
from seastar_gym.scene.robot import Discretisation
from seastar_gym.version import __version__
from studies import front
from studies.frame import Floats, Results, Study, require_known, rounded
from studies.pages import markdown, show

MILLI = 1e-3
"""Seconds per millisecond."""
TIGHT = 1e-9
"""Newton tolerance of the swims that others are compared with."""

# Sequences of commands


def every_command() -> Floats:
    """Every command of -1, 0 and +1 that moves the hub, once per class under the robot's symmetry, shape (n, 5).

    Rest and the same command for all limbs are left out, because the hub then stays where it is.
    """
    commands = np.array([each for each in itertools.product((-1.0, 0.0, 1.0), repeat=5) if len({*each}) > 1])
    alike = transform_commands(commands[:, None], np.arange(10)).tolist()
    return np.array(sorted({min(map(tuple, each)) for each in alike}))


def of_strokes(samples: int, seed: int, side: tuple[int, int]) -> list[Batch]:
    """Classes of strokes, with every command repeated, and the chapter's swims.

    side: Strokes of swimming and of rest on a side of the pentagon.
    """
    drawn = dict(draw_batch(samples, 5, seed).commands)
    drawn["repeated ternary"] = np.tile(every_command(), (STROKES, 1, 1))
    drawn["chapter's"] = np.tile(np.array([STRAIGHT, *PAIRS.values()]), (STROKES, 1, 1))
    return [Batch(drawn), Batch({"chapter's": pentagon_gait(*side)[:, None]})]


SHARES = 2
"""Shares of a pulse of every command that is repeated: resonances make some of them the worst."""
DRIVERS = {"SeastarSwimTimed-v0": ("learned", "planner"), "SeastarSwimTimedModerate-v0": ("learned", "greedy")}
"""Ids, and the bundled agents whose commands are swum again."""


@cache
def driven() -> Floats:
    """Commands of DRIVERS for twenty decisions on random paths, shape (20, 16, 5)."""
    found = []
    for (id, names), seed in itertools.product(DRIVERS.items(), range(4)):
        for name in names:
            agent = load_agent(name, env_of(id, fidelity="fast"))
            env: Any = gym.make(id, fidelity="fast", path="random", actions=actions_of(agent, 5))
            observation, _ = env.reset(seed=seed)
            commands = list[Floats]()
            while len(commands) < 20:
                observation = env.step(agent.predict(observation, deterministic=True)[0])[0]
                commands.append(env.unwrapped.frame().command)
            found.append(commands)
    return np.array(found).swapaxes(0, 1)


def in_time(samples: int, seed: int, period: float) -> Batch:
    """Classes of decisions, with every command repeated, and what policies, the planner and the greedy rule do."""
    drawn, n = dict(draw_batch(samples, 5, seed, period).commands), decisions(period)
    drawn["repeated command"] = np.tile(every_command(), (n, 1, 1))
    shares = np.random.default_rng([seed, n]).uniform(LEAST_SHARE, 1.0, (SHARES * len(every_command()), 1))
    of_all = np.tile(np.tile(every_command(), (SHARES, 1)) * shares, (n, 1, 1))
    drawn["repeated share"] = np.concatenate([drawn["repeated share"], of_all], axis=1)
    chosen = np.random.default_rng(seed).permutation(driven().shape[1])[:samples]
    drawn["policies"] = np.resize(driven()[:, chosen], (n, len(chosen), 5))
    return Batch(drawn, period)


# What is measured


@dataclass(frozen=True)
class Table:
    """Robot, commands and limits of a certificate.

    scene: Of the robot. samples: Sequences of every class that is drawn, for every period.
    periods: Times between decisions [s] (resonances lie 40 ms apart, see docs/numerics.md). () means strokes.
    limit: Nodes per limb and time step [s] of the swims that stand for the continuum.
    fine, finest: Time steps [s] that stand for infinitely short ones, with fewer than MANY nodes, and with more.
    side: Strokes of swimming and of rest on a side of the pentagon.
    front: What of `studies.front` is measured beside the presets: "strokes", "decisions" or nothing.
    """

    scene: Scene
    samples: int
    periods: tuple[float, ...] = ()
    limit: tuple[int, float] = (73, 0.1 * MILLI)
    fine: float = 0.1 * MILLI
    finest: float = 0.1 * MILLI
    side: tuple[int, int] = (6, 1)
    front: str = ""

    def batches(self, seed: int, samples: int | None = None, periods: Sequence[float] = ()) -> list[list[Batch]]:
        """Batches whose errors are told together: all of strokes, or of one period."""
        n = self.samples if samples is None else samples
        if not self.periods:
            return [of_strokes(n, seed, self.side)]
        return [[in_time(n, seed, period)] for period in periods or self.periods]

    def continuum(self) -> Resolution:
        """Resolution that stands for the continuum."""
        return Resolution("continuum", self.limit[0], Numerics("implicit-midpoint", self.limit[1], TIGHT))

    def short(self, discretisation: Discretisation, nodes: int) -> Numerics:
        """Numerics that stand for infinitely short steps."""
        return Numerics("implicit-midpoint", self.finest if nodes >= MANY else self.fine, TIGHT)

    def settings(self) -> list[Resolution]:
        """Resolutions that are measured, presets first."""
        more = [*TRAINED_AT, *front.chosen(self.front)] if self.front else []
        return list(dict.fromkeys([*PRESETS.values(), *more]))


TRAINED_AT = [
    one._replace(numerics=replace(one.numerics, damping=0.0)) for one in (PRESETS["fast"], PRESETS["balanced"])
]
"""Settings that bundled policies were trained at, without numerical damping."""
MANY = 37
"""Nodes per limb of the preset with the shortest steps."""
PERIODS = (0.1, 0.125, 0.15, 0.2, 0.25, 0.3, 0.5)
TABLES = {
    "strokes": Table(front.SCENES["strokes"], 32, front="strokes"),
    "wires": Table(front.SCENES["decisions"], 12, PERIODS, (73, 0.2 * MILLI), 0.4 * MILLI, front="decisions"),
    "undamped": Table(Scene(actuator=SmaWires()), 8, PERIODS),
}
"""What is measured, by the names of the files."""


def worst(settings: Sequence[Setting]) -> Setting:
    """One setting over several sets of sequences: the largest of every error, and the lowest speed."""
    first, names = settings[0], ("space_error", "time_error", "energy_growth", "heading_error", "end_error")
    numbers: Any = {name: float(np.fmax.reduce([getattr(each, name) for each in settings])) for name in names}
    for name in ("errors", "typical"):
        numbers[name] = {key: max(getattr(each, name)[key] for each in settings) for key in getattr(first, name)}
    return replace(first, speed=min(each.speed for each in settings), **numbers)


def measured(name: str, table: Table) -> Certificate:
    """Errors and speeds of a table, presets first, and of decisions the largest of all periods."""
    began, resolutions, found, of_limit = time.process_time(), table.settings(), [], []
    for k, batches in enumerate(table.batches(0)):
        what = name if not table.periods else f"{name}, every {table.periods[k]:g} s"
        of_energy = [PRESETS[fidelity] for fidelity in FRESH] if batches[0].period in (None, OF_ENERGY) else []
        with progress_bar(what) as progress:
            some, own = measure.measure_settings(
                table.scene, resolutions, table.continuum(), table.short, batches, progress, of_energy
            )
        found.append(some)
        of_limit.append(own)
    settings = [worst(some) for some in zip(*found, strict=True)]
    classes = tuple(settings[0].errors)
    promised = tuple(each for each in classes if each != SMALL_COMMANDS)
    limit = table.continuum()
    over: dict[str, Any] = {
        "command": "python -m studies.accuracy --store", "of each drawn class": table.samples,
        "limit": f"{limit.nodes_per_limb} nodes per limb, {limit.numerics.step / MILLI:g} ms",
    }  # fmt: skip
    if table.periods:
        over |= {
            "seconds": SECONDS, "periods": list(table.periods),
            "shortest path": f"{SLOWEST:g} limb lengths per second",
            "largest and median by period": {
                f"{period:g}": {preset: [dict(each.errors), dict(each.typical)]
                                for preset, each in zip(PRESETS, some, strict=False)}
                for period, some in zip(table.periods, found, strict=True)
            },
        }  # fmt: skip
    return Certificate(
        physics(table.scene), tuple(settings), promised, table.samples * max(1, len(table.periods)),
        limit_error=max(of_limit), classes=CLASSES_VERSION, version=__version__, machine=measure.machine(),
        decision_period=max(table.periods, default=None),
        measured_over=over | {"processor_seconds": round(time.process_time() - began)},
    )  # fmt: skip


# Sequences that no table used

OF_ENERGY = 0.2
"""Time between decisions [s] of the long swims that tell whether energy grows."""
FRESH_SEED = 2_026
FRESH_PERIODS = (0.12, 0.13, 0.17, 0.2, 0.23)
"""Times between decisions [s] of fresh sequences."""
FRESH: tuple[Fidelity, ...] = ("rapid", "fast", "balanced", "accurate")
"""Presets that fresh sequences are swum at."""


def exceeding(name: str, samples: int) -> dict[Fidelity, dict[str, Floats]]:
    """Errors of fresh sequences of every class over what `info` promises of presets."""
    table, known = TABLES[name], certificate_of(name)
    found: dict[Fidelity, dict[str, list[Floats]]] = {fidelity: {} for fidelity in FRESH}
    limit = Resolution("continuum", measure.MANY_NODES, Numerics("implicit-midpoint", 0.2 * MILLI, TIGHT))
    for batches in table.batches(FRESH_SEED, samples, FRESH_PERIODS):
        for batch in batches:
            scenes = [at(table.scene, each) for each in (limit, *(PRESETS[fidelity] for fidelity in FRESH))]
            exact, *swums = measure.swim_all(scenes, batch.joined, period=batch.period)
            lengths = measure.path_lengths(table.scene, exact.hub, batch.period)
            for fidelity, swum in zip(FRESH, swums, strict=True):
                for each, path in batch.of_classes(measure.errors(swum, exact, lengths).path).items():
                    promised = in_table(fidelity, name).promise(beside(each, known))
                    found[fidelity].setdefault(each, []).append(path / promised)
    return {fidelity: {each: np.concatenate(some) for each, some in by.items()} for fidelity, by in found.items()}


def beside(name: str, of: Certificate) -> tuple[str, ...]:
    """Classes of a certificate that stand behind the same entry of `info` as one class."""
    if name == SMALL_COMMANDS:
        return (name,)
    repeated = name.startswith(REPEATED)
    return tuple(each for each in of.promised if each.startswith(REPEATED) == repeated)


def told_of(off: Floats) -> list[float]:
    """How many are beyond the promise, of how many, and the largest over it."""
    return [int((off > 1.0).sum()), off.size, rounded(float(off.max()), 2)]


def fresh_summary(results: Mapping[str, Any]) -> str:
    """Fresh swims beyond the promise, of all classes."""
    rows = []
    for fidelity in FRESH:
        row = [f"`{fidelity}`"]
        for name in TABLES:
            out, n, most = zip(*results[name][fidelity].values(), strict=True)
            row.append(f"{sum(out)} of {sum(n)}, {max(most):g}")
        rows.append(row)
    return markdown(["fidelity", "strokes", "decisions, limbs of silicone", "decisions, undamped limbs"], rows)


# Own robots

ROBOTS = {
    "stiff, E = 10 MPa": Scene(Seastar(youngs_modulus=1e7)), "short, L = 5 cm": Scene(Seastar(limb_length=0.05)),
    "soft, E = 0.1 MPa": Scene(Seastar(youngs_modulus=1e5)), "thick, r = 3 mm": Scene(Seastar(rod_radius=3e-3)),
    "slippery, C_d = 0.3": Scene(fluid=Water(drag_coefficient=0.3)),
}  # fmt: skip
"""Robots whose certificates are held against fresh sequences."""


def certified(scene: Scene, samples: int) -> list[float]:
    """Fresh sequences against a robot's own certificate, at all of its settings.

    Returns how many exceed the promise, of how many, the largest over it, and how many exceed the largest measured
    error of their own class.
    """
    certificate = measure.certify(scene, samples)
    batch = draw_batch(samples, scene.robot.n_limbs, FRESH_SEED)
    limit = Resolution("continuum", measure.MANY_NODES, measure.SHORT)
    scenes = [at(scene, limit), *map(certificate.at, certificate.settings)]
    exact, *swums = measure.swim_all(scenes, batch.joined)
    lengths = measure.path_lengths(scene, exact.hub)
    promised, own = [], []
    for setting, swum in zip(certificate.settings, swums, strict=True):
        for name, off in batch.of_classes(measure.errors(swum, exact, lengths).path).items():
            promised.append(off / setting.promise(beside(name, certificate)))
            own.append(off / setting.errors[name])
    return [*told_of(np.concatenate(promised)), int((np.concatenate(own) > 1.0).sum())]


def robots_table(results: Mapping[str, Any]) -> str:
    """Fresh swims of own robots beyond their certificates."""
    rows = [[name, f"{out} of {n:,}", f"{most:g}", str(own)] for name, (out, n, most, own) in results["robots"].items()]
    head = ["robot", "beyond the promise", "largest error over it", "beyond the largest measured of their class"]
    return markdown(head, rows)


# Tables of pages, from the certificates that come with the package: the largest measured error, and in brackets the
# median

PURPOSES: dict[Fidelity, str] = {
    "rapid": "searching many designs", "fast": "searching, training",
    "balanced": "doing anything else (default)",
    "accurate": "measuring a difference of a few per cent", "reference": "checking one of the above",
    "chapter": "repeating the chapter's figures",
}  # fmt: skip
ERRORS = ["random strokes [%]", "repeated strokes [%]", "random decisions [%]", "held or repeated decisions [%]",
          "quote: strokes [%]", "quote: decisions [%]"]  # fmt: skip
SAID = (("wires", "silicone"), ("undamped", "none"))
"""Tables of decisions, and the damping of their limbs."""
DETAILED: tuple[Fidelity, ...] = ("fast", "balanced", "accurate")
"""Presets of which the page has the errors of decisions by class."""


def in_table(fidelity: Fidelity, name: str = "strokes") -> Setting:
    """Errors of a preset in one of TABLES."""
    known = certificate_of(name).of(at(TABLES[name].scene, PRESETS[fidelity]))
    assert known is not None
    return known


def certificate_of(name: str) -> Certificate:
    """Certificate of one of TABLES that comes with the package."""
    found = chapters_certificate() if name == "strokes" else timed_certificate(0.2, TABLES[name].scene)
    assert found is not None
    return found


def percent(largest: float, typical: float | None = None) -> str:
    """Error in per cent, of two digits, and the median."""
    return f"{rounded(100 * largest, 2):g}" + ("" if typical is None else f" ({rounded(100 * typical, 2):g})")


def cells(fidelity: Fidelity, name: str) -> list[str]:
    """Errors of random and of repeated commands."""
    known, promised = in_table(fidelity, name), certificate_of(name).promised
    repeated = [each for each in promised if each.startswith(REPEATED)]
    random = [each for each in promised if each not in repeated]
    return [percent(known.error(some), known.typical_error(some)) for some in (random, repeated)]


def readme(_: object) -> str:
    """Some presets: what they are, and the largest of all errors."""
    rows = []
    for name in ("fast", "balanced", "reference"):
        row = in_table(name)
        error = max(max(in_table(name, each).errors.values()) for each in ("strokes", "wires"))
        numerics = f"{row.nodes_per_limb} nodes per limb, {row.step / MILLI:g} ms"
        rows.append([f"`{name}`", numerics, f"{percent(error)} %", f"{row.speed:,.0f}"])
    return markdown(["fidelity", "mesh and step", "largest error", "× real time"], rows, (0, 1))


def choosing(_: object) -> str:
    """All presets, by what they are for: errors of strokes and of decisions, what is promised of both, and speeds."""
    rows = []
    for name, why in PURPOSES.items():
        errors = [each for table in ("strokes", "wires") for each in cells(name, table)]
        known = [(in_table(name, table), certificate_of(table)) for table in ("strokes", "wires")]
        promised = [f"{100 * each.promise(of.repeated(of.promised)):g}" for each, of in known]
        rows.append([why, f'`fidelity="{name}"`', *errors, *promised, f"{in_table(name).speed:,.0f}"])
    return markdown(["you are", "take", *ERRORS, "× real time"], rows, (0, 1))


def presets(_: object) -> str:
    """Numerics of all presets, and their errors by part and by commands."""
    rows = []
    for name in PURPOSES:
        row = in_table(name)
        nodes = f"{row.nodes_per_limb}{'' if row.discretisation == 'continuum' else ', chapter' + chr(39) + 's'}"
        scheme = row.scheme.replace("implicit-midpoint", "midpoint").replace("implicit-euler", "implicit Euler")
        numbers = [percent(row.space_error), percent(row.time_error), *cells(name, "strokes")]
        growth = max(in_table(name, each).energy_growth for each in ("strokes", "wires"))
        rows.append([
            f"`{name}`", nodes, f"{scheme}, {row.step / MILLI:g} ms", f"{row.damping:g}", f"{row.newton_tolerance:.0e}",
            *numbers, "–" if math.isnan(growth) else f"{growth:.2f}",
        ])  # fmt: skip
    head = ["fidelity", "N", "scheme and step", "damping", "tolerance", "space [%]", "time [%]", "random [%]",
            "repeated [%]", "growth"]  # fmt: skip
    return markdown(head, rows)


def by_class(_: object) -> str:
    """Errors of presets by class of decisions, and by the damping of limbs."""
    classes = certificate_of(SAID[0][0]).settings[0].errors
    rows = [
        [f"`{fidelity}`", said, *(percent(known.errors[each], known.typical[each]) for each in classes)]
        for name, said in SAID for fidelity in DETAILED for known in [in_table(fidelity, name)]
    ]  # fmt: skip
    return markdown(["fidelity", "damping", *(f"{each} [%]" for each in classes)], rows, (0, 1))


@dataclass(frozen=True)
class Options:
    """Errors and speeds of the chapter's robot."""

    store: bool = False
    """Write the tables that come with the package, instead of files in --out."""
    only: tuple[str, ...] = tuple(TABLES)
    """What is measured: strokes, decisions of robots of silicone (wires), and of undamped ones."""
    fresh: int = 0
    """Measure nothing, but hold the package's tables against so many fresh sequences of every class."""
    robots: int = 0
    """Measure nothing, but certify other robots on so many sequences of every class, and swim as many fresh ones."""

    def __post_init__(self) -> None:
        require_known("table", self.only, TABLES)


def run(options: Options, results: Results) -> None:
    """Measure and write the certificates, or hold those of the package against fresh sequences."""
    if options.fresh:
        results.read()
        for name in options.only:
            found = exceeding(name, options.fresh)
            results[name] = {preset: {each: told_of(off) for each, off in by.items()} for preset, by in found.items()}
            results.update(results.about)
            results.save()
        return None
    if options.robots:
        cells = {("robots", name): partial(certified, scene, options.robots) for name, scene in ROBOTS.items()}
        return results.fill(cells, str)
    folder = chapter.FOLDER if options.store else Path("runs/accuracy")
    folder.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        certificate = measured(name, TABLES[name])
        file = folder / f"{name}.json"
        certificate.save(file)
        shown = [[fidelity, *map(percent, each.errors.values())]
                 for fidelity, each in zip(PRESETS, certificate.settings, strict=False)]  # fmt: skip
        show(markdown(["error [%]", *certificate.settings[0].errors], shown), f"Written: {file}")
    return None


STUDY = Study(
    "accuracy", run, Options, file="accuracy/fresh.json",
    tables={
        "errors": readme, "choosing": choosing, "presets": presets, "timed": by_class,
        "robots": robots_table, "fresh": fresh_summary,
    },
)  # fmt: skip
