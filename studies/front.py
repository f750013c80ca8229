"""What every setting errs and costs, in strokes and in decisions within them: one scan of all that a user may choose.

Nodes per limb, scheme, time step, numerical damping and Newton tolerance are scanned together. Strokes are those of the
chapter's robot, whose limbs damp nothing; decisions are those of the environments' robot with wires, whose limbs damp
as silicone does. Errors are whole errors against many nodes and short steps, where those of space and time may cancel:
they choose the settings of which `studies.accuracy` measures what can be promised.

Cost is counted, so that it is the same on every machine: Newton iterations times the operations of one, over those of
`fast`.
"""

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache, partial
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.accuracy.certificate import REPEATED, at
from seastar_gym.accuracy.commands import SECONDS, SMALL_COMMANDS, Batch, draw_batch
from seastar_gym.accuracy.measure import Swims, errors, path_lengths, swim, swim_all
from seastar_gym.files import save_figure
from seastar_gym.scene import Numerics, Scene, Seastar, SmaWires
from seastar_gym.scene.numerics import DAMPING, PRESETS, Fidelity, Resolution, SchemeName
from seastar_gym.scene.robot import SILICONE
from studies.frame import DOCS, Floats, Results, Study, rounded
from studies.pages import markdown, numbers
from studies.style import CYCLE, FAINT, INK, subplots

NODES = (6, 7, 8, 9, 10, 11, 12, 13, 14, 16, 19, 25, 28)
STEPS = (10.0, 20 / 3, 5.0, 10 / 3, 2.5, 5 / 3, 1.25, 1.0, 0.5)
"""Time steps [ms] of the midpoint rule."""
TOLERATED = (
    (DAMPING, 1e-4), (DAMPING, 1e-5), (DAMPING, 1e-6), (0.01, 1e-5), (0.03, 1e-4), (0.03, 1e-5), (0.05, 1e-4),
)  # fmt: skip
"""Numerical dampings and Newton tolerances of the midpoint rule."""
OTHERS: tuple[tuple[SchemeName, float], ...] = (("sdirk2", 20.0), ("sdirk2", 10.0), ("sdirk2", 5.0))
"""Other schemes, and their steps [ms]."""
PERIODS = (0.125, 0.2, 0.3)
"""Times between decisions [s]."""
SAMPLES, SEED = 8, 7
PER_NODE, PER_LIMB = 1500, -1287
"""Operations of a Newton iteration of a limb: of each node, and of all limbs (docs/speed.md)."""
LIMIT = 37
"""Nodes per limb of the swims that stand for the continuum."""
SCENES = {"strokes": Scene(), "decisions": Scene(Seastar(relaxation_time=SILICONE), actuator=SmaWires())}
SHORT = {"strokes": 0.2e-3, "decisions": 0.4e-3}
"""Time steps of the swims that stand for the continuum [s]. Undamped limbs need shorter ones."""
NOTICEABLE, SHOWN = 0.03, 0.2
"""A dearer setting joins the front, and stands in tables, if it reduces an error by at least this fraction."""
NAMES: tuple[Fidelity, ...] = ("rapid", "fast", "balanced", "accurate")
"""Presets that the scan has."""
TITLES = {"strokes": "strokes, limbs of the chapter", "decisions": "decisions every 0.125 to 0.3 s, silicone"}
SCHEMES = {"implicit-midpoint": ("midpoint rule", FAINT), "sdirk2": ("SDIRK2", CYCLE[1])}
"""How schemes are named and drawn."""


def is_scanned(nodes: int, step: float, damping: float, tolerance: float) -> bool:
    """Whether a setting of the midpoint rule may be worth its cost: many nodes need short steps [ms]."""
    shortest, longest = (2 if nodes <= 8 else 1 if nodes < 16 else 0), (10 if nodes < 16 else 4 if nodes < 25 else 2.5)
    return (
        shortest <= step <= longest
        and (tolerance >= 1e-5 or step <= 2.5)  # small updates of short steps need small tolerances
        and (damping < 0.05 or step >= 5)  # damping of so much hides what short steps are for
    )


def settings() -> list[Resolution]:
    """All settings of the scan."""
    found = [
        Resolution("continuum", nodes, Numerics("implicit-midpoint", 1e-3 * step, tolerance, damping=damping))
        for nodes, step, (damping, tolerance) in itertools.product(NODES, STEPS, TOLERATED)
        if is_scanned(nodes, step, damping, tolerance)
    ]
    for nodes, (scheme, step), tolerance in itertools.product((7, 8, 10, 12), OTHERS, (1e-4, 1e-5)):
        found.append(Resolution("continuum", nodes, Numerics(scheme, 1e-3 * step, tolerance)))
    return list(dict.fromkeys([*found, *(PRESETS[name] for name in NAMES)]))


class Point(NamedTuple):
    """A setting of the scan. Errors are fractions of the path: the largest and the median, of the class with most.

    cost: Operations over those of `fast`.
    """

    resolution: Resolution
    cost: float
    random: float
    typical: float
    repeated: float
    typical_repeated: float


def batches(kind: str) -> list[Batch]:
    """Sequences of strokes, or of decisions of every period."""
    periods = (None,) if kind == "strokes" else PERIODS
    drawn = [draw_batch(2 * SAMPLES if kind == "strokes" else SAMPLES, 5, SEED, period) for period in periods]
    return [Batch({k: v for k, v in each.commands.items() if k != SMALL_COMMANDS}, each.period) for each in drawn]


@cache
def exact(kind: str) -> list[tuple[Batch, Swims, Floats]]:
    """Batches, their swims in the continuum, and the lengths of their paths [m]."""
    scene = SCENES[kind]
    limit = at(scene, Resolution("continuum", LIMIT, Numerics("implicit-midpoint", SHORT[kind], 1e-9)))
    found = []
    for batch in batches(kind):
        (swum,) = swim_all([limit], batch.joined, period=batch.period)
        found.append((batch, swum, path_lengths(scene, swum.hub, batch.period)))
    return found


def measured(kind: str, resolution: Resolution) -> list[float]:
    """Operations per robot and second, and errors as `Point` has them."""
    scene, iterations, seconds, by_class = at(SCENES[kind], resolution), 0.0, 0.0, dict[str, list[Floats]]()
    for batch, limit, lengths in exact(kind):
        swum = swim(scene, batch.joined, batch.period)
        iterations += float(swum.newton_iterations.sum())
        seconds += SECONDS * batch.joined.shape[1]
        for name, some in batch.of_classes(errors(swum, limit, lengths).path).items():
            by_class.setdefault(name, []).append(some)
    found = [iterations / seconds * (PER_NODE * resolution.nodes_per_limb + PER_LIMB)]
    for is_repeated in (False, True):
        mine = [np.concatenate(each) for name, each in by_class.items() if name.startswith(REPEATED) == is_repeated]
        found += [max(float(each.max()) for each in mine), max(float(np.median(each)) for each in mine)]
    return [rounded(each, 3) for each in found]


def keys_of(resolution: Resolution) -> tuple[str, str]:
    """Mesh and numerics, as the file names them."""
    _, nodes, each = resolution
    return str(nodes), f"{each.scheme} {1e3 * each.step:.6g} {each.damping:g} {each.newton_tolerance:g}"


def run(results: Results) -> None:
    """Measure what is missing, mesh by mesh."""
    for kind, nodes in itertools.product(SCENES, NODES):
        some = [each for each in settings() if each.nodes_per_limb == nodes]
        results.fill({(kind, str(nodes)): partial(mesh, kind, some)}, lambda found: f"{len(found)} settings")


def mesh(kind: str, some: Sequence[Resolution]) -> dict[str, list[float]]:
    """What settings of one mesh cost and err."""
    return {keys_of(each)[1]: measured(kind, each) for each in some}


def points(results: Mapping[str, Any], kind: str) -> list[Point]:
    """Points of the scan, cheapest first."""
    nodes, numerics = keys_of(PRESETS["fast"])
    unit, given = results[kind][nodes][numerics][0], {keys_of(each): each for each in settings()}
    found = [
        Point(given[nodes, name], operations / unit, *off)
        for nodes, by_numerics in results[kind].items()
        for name, (operations, *off) in by_numerics.items()
    ]
    return sorted(found, key=lambda each: each.cost)


def front(points: Iterable[Point], error: Callable[[Point], float], least: float = NOTICEABLE) -> list[Point]:
    """Pareto front of cost and error, cheapest first; a dearer setting needs a noticeably smaller error."""
    chosen: list[Point] = []
    for point in points:
        if not chosen or error(point) < (1.0 - least) * error(chosen[-1]):
            chosen.append(point)
    return chosen


def of_any(point: Point) -> float:
    """Largest error of any commands."""
    return max(point.random, point.repeated)


ERRORS: tuple[Callable[[Point], float], ...] = attrgetter("random"), of_any
"""Errors of which there is a front: of random commands, and of any."""


def chosen(kind: str) -> list[Resolution]:
    """Settings on the front of all, and for strokes on that of each mesh, which a robot may name."""
    known = points(numbers(DOCS, STUDY), kind)
    of_mesh = [[each for each in known if each.resolution.nodes_per_limb == nodes] for nodes in NODES]
    meshes = of_mesh if kind == "strokes" else []
    found = [each for some in (known, *meshes) for error in ERRORS for each in front(some, error)]
    return list(dict.fromkeys(each.resolution for each in found))


def picture(results: Mapping[str, Any], file: Path) -> None:
    """Largest error of any command over speed, for strokes and for decisions, with the front and the presets."""
    figure, both = subplots(1, 2, figsize=(8.4, 3.6), sharey=True)
    for axes, (kind, title) in zip(both, TITLES.items(), strict=True):
        some = points(results, kind)
        for scheme, (name, colour) in SCHEMES.items():
            of_scheme = drawn(each for each in some if each.resolution.numerics.scheme == scheme)
            axes.plot(*of_scheme, ".", ms=3, color=colour, label=name)
        axes.plot(*drawn(front(some, of_any)), color=CYCLE[0], lw=1.2, label="fastest for its error")
        for fidelity in NAMES:
            x, y = drawn(each for each in some if keys_of(each.resolution) == keys_of(PRESETS[fidelity]))
            axes.plot(x, y, "o", ms=5, color=INK, zorder=3)
            leader = {"arrowstyle": "-", "color": INK, "lw": 0.8}
            axes.annotate(
                fidelity, (x[0], y[0]), (16, -34), textcoords="offset points", fontsize=9, ha="center", va="top",
                arrowprops=leader,
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="speed over that of fast", title=title)
    both[0].set_ylabel("worst error of the hub's path [%]")
    both[0].legend(loc="upper left", fontsize=8)
    save_figure(figure, file)


def drawn(points: Iterable[Point]) -> tuple[list[float], list[float]]:
    """Speeds over that of `fast`, and errors of any commands [%]."""
    some = list(points)
    return [1.0 / each.cost for each in some], [100.0 * of_any(each) for each in some]


def table(results: Mapping[str, Any], kind: str) -> str:
    """Some of the front of any command, and the presets."""
    some = points(results, kind)
    best, names = front(some, of_any, SHOWN), {keys_of(PRESETS[name]): name for name in NAMES}
    rows = []
    for each in some:
        name = names.get(keys_of(each.resolution))
        if each in best or name is not None:
            off = [f"{rounded(100 * number, 2):g}" for number in each[2:]]
            _, nodes, its = each.resolution
            scheme = f"{its.scheme.replace('implicit-midpoint', 'midpoint')}, {1e3 * its.step:.3g} ms"
            rows.append([
                f"`{name}`" if name else "", nodes, scheme, f"{its.damping:g}", f"{its.newton_tolerance:.0e}",
                f"{1 / each.cost:.2g}", f"{off[0]} ({off[1]})", f"{off[2]} ({off[3]})",
            ])  # fmt: skip
    head = ["", "N", "scheme and step", "damping", "tolerance", "speed", "random [%]", "repeated [%]"]
    return markdown(head, rows, (0, 2))


STUDY = Study(
    "front", run, file="accuracy/front.json", pictures={"front.png": picture},
    tables={"front of strokes": partial(table, kind="strokes"), "front of decisions": partial(table, kind="decisions")},
)  # fmt: skip
