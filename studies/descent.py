"""What gradients of swims are good for: pulses of the pentagon, radii along limbs, and a fit of twenty numbers.

Pulses: a beam search (studies/learning/pentagon.py at commit 0e818f3) heated wires for whole pulses or not at all,
every 0.2 s. Here every command is a number from -1 to 1, whose size is the length of its pulse. A swim is to end at
the last waypoint a decision sooner than the last that did, and to pass the others. A step is the smallest change of all
commands that does so by the gradients of the distances from the waypoints that are missed, or nearly.

Radii: limbs are alike, with radii at some points along them, linear between. Steps along the gradient of the logarithm
of the speed, with no part along that of the actuators' work, which is held to that of the chapter's robot, in strokes
SETTLING + 1 to SETTLING + MEASURED of the straight gait.

Fit: the radii of all limbs, each its own, from positions of all nodes after every stroke: by `identify`, whose
derivatives are differences, and by the gradient of the sum of squares (L-BFGS). Costs are processor time.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from seastar_gym.gaits import STRAIGHT
from seastar_gym.gradients import record
from seastar_gym.identify import Measurement, identify
from seastar_gym.scene import Contact, Limb, Scene, SmaWires
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.per_robot import with_numbers
from studies.frame import DOCS, RESULTS, Floats, Results, Study, rounded
from studies.pages import markdown, read

EVERY, RADIUS, WITHIN = 0.2, 0.010, 0.0098
"""Length of a decision [s], radius of a waypoint [m], and the distance from it that is aimed at [m]."""
MARGIN, LARGEST = 0.001, 0.05
"""Distance from WITHIN from which on a waypoint is looked after [m], and largest change of a command in a step."""
TRIES, ROUNDS = 20, 6
"""Steps that may fail one after the other, and times that commands at their ends are looked for in each."""
FIDELITIES: tuple[Fidelity, ...] = ("fast", "balanced", "reference")
PENTAGON, WAYPOINTS = (DOCS / RESULTS / name for name in ("gaits/pentagon_reheated.json", "learning/pentagon.json"))
"""Numbers of other studies."""


def wires(fidelity: Fidelity) -> Scene:
    """The chapter's robot with wires that can be heated at any time."""
    return replace(Scene.preset(fidelity), actuator=SmaWires())


def found_by_search() -> Floats:
    """Commands of the beam search, shape (n, 5)."""
    gait = read(PENTAGON)["gait"]
    commands = np.zeros((len(gait), 5))
    for command, pulses in zip(commands, gait, strict=True):
        for limb, sign in filter(None, pulses.strip("{}").split(",")):
            command[int(limb) - 1] = 1.0 if sign == "+" else -1.0
    return commands


def passed(hub: Floats, goals: Floats) -> NDArray[np.int64]:
    """Decisions after which a hub has passed the waypoints, one after the other, as far as it comes."""
    found: list[int] = []
    for goal in goals:
        begin = found[-1] if found else 0
        near = np.flatnonzero(np.hypot(*(hub[begin:] - goal).T) < RADIUS)
        if not near.size:
            break
        found.append(begin + int(near[0]))
    return np.array(found)


def when_due(hub: Floats, goals: Floats) -> NDArray[np.int64]:
    """Decisions after which a hub is within WITHIN of waypoints, or else nearest to them; of the last one, the end."""
    found: list[int] = []
    for goal in goals[:-1]:
        begin = found[-1] if found else 0
        distance = np.hypot(*(hub[begin:] - goal).T)
        near = np.flatnonzero(distance < WITHIN)
        found.append(begin + int(near[0] if near.size else np.argmin(distance)))
    return np.array([*found, len(hub) - 1])


def smallest_change(commands: Floats, slopes: Floats, excess: Floats) -> Floats:
    """The smallest change of commands that takes some numbers to zero, by their slopes, shape (n, *commands.shape)."""
    J, x = slopes.reshape(len(slopes), -1), commands.ravel()
    change, free = np.zeros_like(x), np.ones(x.size, bool)
    for _ in range(ROUNDS):  # commands at an end stay there, if they were to go beyond
        own = np.where(free, J, 0.0)
        change = -own.T @ np.linalg.lstsq(own @ own.T, excess)[0]
        free &= (np.abs(x) < 1.0) | (change * x <= 0.0)
    return np.asarray(change * min(1.0, LARGEST / np.abs(change).max())).reshape(commands.shape)


def sooner(commands: Floats, goals: Floats) -> tuple[Floats, list[list[float]]]:
    """Commands of the shortest swim, and after how many gradients [1] swims of a time [s] were found."""
    scene, spent, tries = wires("fast"), 0, 0
    best, found, length = commands, list[list[float]](), len(commands)
    while tries <= TRIES:
        swim = record(scene, commands[:length], duration=EVERY)
        hub, reached = swim.swim.hub, passed(swim.swim.hub, goals)
        if len(reached) == len(goals):
            best, tries = commands[: reached[-1]].copy(), 0
            found.append([spent, len(best) * EVERY])
            length = len(best) - 1
            continue
        due = when_due(hub, goals)
        distance = np.hypot(*(hub[due] - goals).T)
        slopes = []
        for k in np.flatnonzero(distance > WITHIN - MARGIN):
            slope = np.zeros_like(hub)
            slope[due[k]] = (hub[due[k]] - goals[k]) / distance[k]
            slopes.append(swim.gradient({"hub": slope}, ["commands"])["commands"])
        excess = np.maximum(distance[distance > WITHIN - MARGIN] - WITHIN, 0.0)
        change = smallest_change(commands[:length], np.array(slopes), excess)
        commands = np.clip(commands[:length] + change, -1.0, 1.0)
        spent, tries = spent + len(slopes), tries + 1
    return best, found


def again(fidelity: Fidelity, commands: Floats, goals: Floats) -> list[float]:
    """How near to the waypoints, one after the other, a swim comes at a fidelity, at ends of decisions [mm]."""
    hub, begin, found = record(wires(fidelity), commands, duration=EVERY).swim.hub, 1, list[float]()
    for goal in goals:
        distance = np.hypot(*(hub[begin:] - goal).T)
        found.append(rounded(1e3 * float(distance.min()), 3))
        begin += int(distance.argmin())
    return found


def pulses() -> dict[str, Any]:
    """The beam search's pulses, improved."""
    goals, searched, began = (
        np.array(read(WAYPOINTS)["waypoints_m"]),
        found_by_search(),
        time.process_time(),
    )
    best, found = sooner(searched, goals)
    best = np.round(best, 4)
    return {
        "processor_s": rounded(time.process_time() - began, 2),
        "shortest_s": [[int(step), rounded(seconds, 4)] for step, seconds in found],
        "nearest_mm": {fidelity: again(fidelity, best, goals) for fidelity in FIDELITIES},
        "commands": best.tolist(),
    }


SETTLING, MEASURED = 3, 5
"""Strokes before and during the measurement, as of the designs."""
POINTS = {"uniform, the chapter's": 1, "two radii": 2, "seven radii": 7}
"""Radii along a limb: root and tip, or more."""
THINNEST, THICKEST = 0.32e-3, 4.48e-3
"""Bounds of radii [m]: those of the designs."""
CHANGES = [*np.geomspace(0.2, 0.02, 24), 0.0, 0.0]
"""Changes of the logarithms of radii, step by step; the last steps correct the work alone."""


def with_radii(scene: Scene, radii: Sequence[float]) -> Scene:
    """The scene with the same radii along all limbs [m]."""
    limb = Limb(radius=tuple(radii))
    return replace(scene, robot=replace(scene.robot, limbs=(limb,) * scene.robot.n_limbs))


def of_limbs(n_limbs: int, points: int) -> list[str]:
    """Names of the radii of all limbs, limb by limb."""
    return [f"robot.limbs.{limb}.radius.{point}" for limb in range(n_limbs) for point in range(points)]


def speed_and_work(scene: Scene, radii: Floats) -> tuple[float, float, Any]:
    """Speed [m/s] and work [J] per stroke of the straight gait with these radii, and the swim."""
    swim = record(with_radii(scene, radii.tolist()), np.tile(STRAIGHT, (SETTLING + MEASURED, 1)))
    way = np.linalg.norm(swim.swim.hub[-1] - swim.swim.hub[SETTLING])
    return float(way) / MEASURED, float(swim.swim.work[SETTLING:].sum()) / MEASURED, swim


def slopes_in_radii(swim: Any, radii: Floats) -> tuple[Floats, Floats]:
    """Gradients of the logarithms of speed and work in the logarithms of radii, shape (n,) each."""
    hub, work = np.zeros_like(swim.swim.hub), np.zeros_like(swim.swim.work)
    way = swim.swim.hub[-1] - swim.swim.hub[SETTLING]
    hub[-1], hub[SETTLING] = way / (way @ way), -way / (way @ way)
    work[SETTLING:] = 1.0 / swim.swim.work[SETTLING:].sum()
    names = of_limbs(len(STRAIGHT), len(radii))
    found = (swim.gradient(slopes, names) for slopes in ({"hub": hub}, {"work": work}))
    of_speed, of_work = (
        radii * np.reshape([each[name] for name in names], (-1, len(radii))).sum(axis=0) for each in found
    )
    return of_speed, of_work


def at(fidelity: Fidelity, radii: Sequence[float]) -> dict[str, float]:
    """Speed [mm/s] and work [mJ] per stroke with these radii [mm] at a fidelity, with limbs that may touch."""
    scene = replace(Scene.preset(fidelity), contact=Contact())
    speed, work, _ = speed_and_work(scene, 1e-3 * np.array(radii))
    return {"mm_per_s": rounded(1e3 * speed, 4), "mJ_per_stroke": rounded(1e3 * work, 4)}


def shaped(points: int) -> dict[str, Any]:
    """Radii with which the chapter's robot swims fastest at its work [mm]."""
    scene, began = Scene.preset("balanced"), time.process_time()
    radii = np.full(points, float(scene.robot.rod_radius))
    _, allowed, swim = speed_and_work(scene, radii)
    for change in CHANGES if points > 1 else []:
        of_speed, of_work = slopes_in_radii(swim, radii)
        off = np.log(swim.swim.work[SETTLING:].sum() / MEASURED / allowed)
        along = of_speed - (of_speed @ of_work) / (of_work @ of_work) * of_work
        step = change * along / np.linalg.norm(along) - off / (of_work @ of_work) * of_work
        radii = np.clip(radii * np.exp(step), THINNEST, THICKEST)
        _, _, swim = speed_and_work(scene, radii)
    millimetres = [rounded(1e3 * radius, 4) for radius in radii.tolist()]
    return {
        "processor_s": rounded(time.process_time() - began, 2),
        "radii_mm": millimetres,
        "at": {fidelity: at(fidelity, millimetres) for fidelity in ("balanced", "reference")},
    }


FITTED, SWUM = 4, 10
"""Radii along each limb that are fitted, and strokes that are measured."""
LIMITS = {"maxfun": 60, "ftol": 1e-12}
"""Of L-BFGS."""
UNEVEN = 0.1
"""Standard deviation of the logarithm of the true radii."""


def measured() -> tuple[Scene, list[str], Measurement]:
    """A first guess, names of its radii, and where the nodes of another robot are after every stroke."""
    rng, guess = np.random.default_rng(0), with_radii(Scene.preset("fast"), [1.6e-3] * FITTED)
    names = of_limbs(guess.robot.n_limbs, FITTED)
    truth = with_numbers(guess, {name: 1.6e-3 * float(np.exp(UNEVEN * rng.standard_normal())) for name in names})
    commands = rng.uniform(-0.9, 0.9, (SWUM, guess.robot.n_limbs))
    places = record(truth, commands).swim.positions[1:]
    return guess, names, Measurement(np.arange(1.0, SWUM + 1.0), places, tuple(range(places.shape[1])), commands)


def by_differences() -> dict[str, float]:
    """The fit by `identify`."""
    guess, names, seen = measured()
    identify(guess, names[:2], seen)  # compiled
    began = time.process_time()
    found = identify(guess, names, seen)
    return {"processor_s": rounded(time.process_time() - began, 3), "rms_um": rounded(1e6 * found.root_mean_square, 2)}


def by_gradients() -> dict[str, float]:
    """The fit by gradients of the mean square."""
    guess, names, seen = measured()

    def mean_square(logarithms: Floats) -> tuple[float, Floats]:
        radii = 1.6e-3 * np.exp(logarithms)
        swim = record(with_numbers(guess, dict(zip(names, radii.tolist(), strict=True))), seen.commands)
        off, slopes = swim.swim.positions[1:] - seen.positions, np.zeros_like(swim.swim.positions)
        slopes[1:] = 2e6 * off / off.size
        found = swim.gradient({"positions": slopes}, names)
        return 1e6 * float(np.square(off).mean()), radii * np.array([found[name] for name in names])

    mean_square(np.zeros(len(names)))  # compiled
    began = time.process_time()
    found = minimize(mean_square, np.zeros(len(names)), jac=True, method="L-BFGS-B", options=LIMITS)
    return {
        "processor_s": rounded(time.process_time() - began, 3),
        "rms_um": rounded(1e3 * float(np.sqrt(found.fun)), 2),
        "gradients": int(found.nfev),
    }


CELLS: dict[tuple[str, str], Callable[[], Any]] = {
    ("pulses", "pentagon"): pulses,
    **{("radii", name): partial(shaped, points) for name, points in POINTS.items()},
    ("fit", "differences"): by_differences,
    ("fit", "gradients"): by_gradients,
}


def run(results: Results) -> None:
    """Compute what is missing."""
    results.fill(CELLS, str)


def table_of_pulses(results: Mapping[str, Any]) -> str:
    """Table in Markdown of the shortest swims."""
    found = results["pulses"]["pentagon"]["shortest_s"]
    found = found[:: max(len(found) // 2, 1)]
    row = ["round the pentagon [s]", *(f"{seconds:.1f}" for _, seconds in found)]
    return markdown(["gradients", *(int(spent) for spent, _ in found)], [row])


def table_of_radii(results: Mapping[str, Any]) -> str:
    """Table in Markdown of the limbs."""
    rows = []
    for name, found in results["radii"].items():
        fine = found["at"]["reference"]
        radii = ", ".join(f"{radius:.2f}" for radius in found["radii_mm"])
        rows.append([name, radii, f"{fine['mm_per_s']:.2f}", f"{fine['mJ_per_stroke']:.3g}"])
    return markdown(["limb", "radii from root to tip [mm]", "speed [mm/s]", "work [mJ]"], rows, (0, 1))


def table_of_fits(results: Mapping[str, Any]) -> str:
    """Table in Markdown of both fits."""
    rows = [[name, f"{one['processor_s']:.2g}", f"{one['rms_um']:.2g}"] for name, one in results["fit"].items()]
    return markdown(["twenty radii fitted by", "processor time [s]", "misfit left [µm]"], rows)


STUDY = Study(
    "descent", run, file="gradients/descent.json",
    settings=lambda: {"largest_change": LARGEST, "tries": TRIES, "uneven": UNEVEN, "strokes_fitted": SWUM},
    tables={"descent pulses": table_of_pulses, "descent radii": table_of_radii, "descent fits": table_of_fits},
)  # fmt: skip
