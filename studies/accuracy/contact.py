"""How well limbs that press each other are resolved, by stiffness and shape of their contact.

The sequences of the work-precision study are swum with more and more nodes, and with 73, all with steps that leave
errors of space alone. Other numbers say how far a contact leads from the default's path, what `certify` promises, how
fast two neighbours may be thrown at each other before their robot stops, and what a stroke costs over one without
contact.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import cache, partial
from itertools import takewhile
from typing import Any
from unittest.mock import patch

import numpy as np

from seastar_gym.accuracy.commands import CLASSES, draw_classes
from seastar_gym.accuracy.measure import MANY_NODES, SAMPLES, SHORT, Swims, errors, measure, path_lengths, swim
from seastar_gym.accuracy.setting import at
from seastar_gym.der.contact import contact
from seastar_gym.scene import Contact, Numerics, Scene, Seastar
from seastar_gym.scene.numerics import DAMPING, PRESETS, Resolution
from seastar_gym.simulator import Simulator
from studies.accuracy.settings import MILLI
from studies.accuracy.work_precision import cost, draw_sequences, finite
from studies.frame import Floats, Results, Study, rounded
from studies.pages import markdown
from studies.style import PERCENT

KINDS: dict[str, Contact] = {
    "Contact()": Contact(),
    "Contact(opening_angle=0.3)": Contact(opening_angle=0.3),
    "Contact(layer=10e-3)": Contact(layer=10e-3),
    "cones": Contact(opening_angle=0.3),
}
CONES = "cones"
"""Limbs that begin as cones of the opening angle, as the package had them first."""
NODES = (10, 19, 37)
LIMIT = 73
"""Nodes per limb, and of the swims that stand for the continuum."""
STEPS = {10: 1 * MILLI, 19: 1 * MILLI, 37: 0.5 * MILLI, LIMIT: 0.25 * MILLI}
SPEEDS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)
"""Speeds of tips that are thrown at each other [m/s]."""
WORST = ("repeated ternary", "repeated continuous", "alternating ternary")
"""Classes of commands for which `certify` finds the largest errors of contact."""
CERTIFIED = Resolution("continuum", 19, Numerics("implicit-midpoint", 1 * MILLI, 1e-7, damping=DAMPING))


def cone(reach: float, distance: float, opening_angle: float) -> float:
    """Thickness of a cone at a distance from its root [m]."""
    return min(reach, 0.5 * opening_angle * distance)


def shape(name: str) -> AbstractContextManager[object]:
    """Limbs begin with the shape of a contact of KINDS in simulators that are made here."""
    return patch.object(contact, "tapered", cone) if name == CONES else nullcontext()


@cache
def swum(name: str, nodes: int) -> Swims:
    """Swims of all sequences."""
    numerics = Numerics("implicit-midpoint", STEPS[nodes], 1e-7, damping=DAMPING)
    with shape(name):
        return swim(at(Scene(contact=KINDS[name]), Resolution("continuum", nodes, numerics)), draw_sequences(5))


def path_errors(found: Swims, exact: Swims) -> Floats:
    """Errors of paths as fractions of their length."""
    return errors(found, exact, path_lengths(Scene(), exact.hub)).path


def kept(number: float) -> float | None:
    """Number as the file has it: four digits, none where the solver failed."""
    return None if finite(number) is None else rounded(number)


def bound(name: str) -> float | None:
    """Error that `certify` promises for WORST with CERTIFIED."""
    drawn = np.split(draw_classes(SAMPLES, 5, 0), len(CLASSES), axis=1)
    commands = np.concatenate([drawn[list(CLASSES).index(each)] for each in WORST], axis=1)
    limit = Resolution("continuum", MANY_NODES, SHORT)
    with shape(name):
        found = measure(Scene(contact=KINDS[name]), [CERTIFIED], limit, lambda *_: SHORT, commands)
    return kept((found.space[0].path * 4.0 / 3.0 + found.time[0].path).max())


def thrown(name: str) -> float:
    """Largest of SPEEDS that a robot survives, as it does all below [m/s]; 0 for none."""
    with shape(name):
        return max(takewhile(partial(survives, KINDS[name]), SPEEDS), default=0.0)


def survives(touch: Contact, speed: float) -> bool:
    """Whether a robot swims on whose limbs 1 and 2 are thrown at each other, their tips so fast [m/s]."""
    robot = Seastar(nodes_per_limb=10)
    simulator = Simulator(Scene(robot, None, numerics=Numerics("sdirk2", 20 * MILLI), contact=touch))
    state = simulator.get_state()
    x, y = np.moveaxis(state.positions[0, 1:] - state.positions[0, 0], -1, 0)
    turning = np.repeat([1.0, -1.0, 0.0, 0.0, 0.0], 9) * speed / robot.limb_length
    state.velocities[0, 1:] = np.stack([-turning * y, turning * x], axis=1)
    simulator.set_state(state)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Limbs of robot", RuntimeWarning)
        return not simulator.stroke(np.zeros((1, 5))).status.any()


def examine(name: str) -> dict[str, Any]:
    """Numbers of a contact."""
    limit = swum(name, LIMIT)
    found = {str(nodes): path_errors(swum(name, nodes), limit) for nodes in NODES}
    away = path_errors(limit, swum("Contact()", LIMIT))
    with shape(name):
        of_cost = [cost(at(Scene(contact=each), PRESETS["accurate"])) for each in (KINDS[name], None)]
    return {
        "largest": {nodes: kept(each.max()) for nodes, each in found.items()},
        "median": {nodes: kept(np.median(each)) for nodes, each in found.items()},
        "away": [kept(np.median(away)), kept(away.max())],
        "cost": rounded(of_cost[0] / of_cost[1]),
    }


def run(results: Results) -> None:
    """Examine the contacts that are missing."""
    for what, of in (("thrown", thrown), ("bounds", bound), ("contacts", examine)):
        results.fill({(what, name): partial(of, name) for name in KINDS}, str)


def table(results: Mapping[str, Any]) -> str:
    """Table of the contacts that were examined as a whole in Markdown."""
    rows = []
    for name in KINDS:
        bounds, speed = (results[what][name] for what in ("bounds", "thrown"))
        row = results["contacts"][name]
        each = [f"{_percent(row['largest'][str(n)])}, {_percent(row['median'][str(n)])}" for n in NODES]
        away = ", ".join(map(_percent, reversed(row["away"])))
        shown = name if name == CONES else f"`{name}`"
        rows.append([shown, *each, _percent(bounds), away, f"{speed:g}", f"x {row['cost']:.1f}"])
    nodes = (f"N = {n}" for n in NODES)
    return markdown(["contact", *nodes, "`certify`", "from the default's path", "thrown, m/s", "cost"], rows)


def _percent(share: float | None) -> str:
    return "fails" if share is None else f"{PERCENT * share:.2g} %"


STUDY = Study(
    "accuracy.contact",
    run,
    file="accuracy/contact.json",
    settings=lambda: {"sequences": 14},
    tables={"contact": table},
)
