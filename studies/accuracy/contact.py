"""How well limbs that press each other are resolved, by stiffness and shape of their contact.

The sequences of the work-precision study are swum with more and more nodes, and with 73, all with steps that leave
errors of space alone. Other numbers say how far a contact leads from the default's path, what `certify` says of
repeated commands, how fast two neighbours may be thrown at each other before their robot stops, and what a stroke costs
over one without contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, partial
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.accuracy.commands import CLASSES, draw_classes
from seastar_gym.accuracy.measure import MANY_NODES, SAMPLES, SHORT, Swims, errors, measure, path_lengths, swim
from seastar_gym.accuracy.setting import at
from seastar_gym.scene import Contact, Numerics, Scene, Seastar
from seastar_gym.scene.numerics import DAMPING, PRESETS, Resolution
from seastar_gym.simulator import Simulator
from studies.accuracy.settings import MS
from studies.accuracy.work_precision import cost, draw_sequences, finite
from studies.frame import InDocs, Results, Study
from studies.results_file import rounded
from studies.style import PERCENT

Floats = NDArray[np.float64]

KINDS: dict[str, Contact] = {
    "Contact()": Contact(),
    "Contact(opening_angle=0.15)": Contact(opening_angle=0.15),
    "Contact(layer=5.6e-3)": Contact(layer=5.6e-3),
    "Contact(layer=10e-3)": Contact(layer=10e-3),
}
BETWEEN = {f"Contact(layer={layer})": Contact(layer=float(layer)) for layer in ("7e-3", "8e-3")}
"""Contacts of which only the bound of `certify` and the speed are measured."""
NODES = (10, 19, 37)
LIMIT = 73
"""Nodes per limb, and of the swims that stand for the continuum."""
STEPS = {10: 1 * MS, 19: 1 * MS, 37: 0.5 * MS, LIMIT: 0.25 * MS}
SPEEDS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0)
"""Speeds of tips that are thrown at each other [m/s]."""
WORST = "repeated ternary"
"""Class of commands for which `certify` finds the largest errors of contact."""
CERTIFIED = Resolution("continuum", 19, Numerics("implicit-midpoint", 1 * MS, 1e-7, damping=DAMPING))


@cache
def swum(contact: Contact, nodes: int) -> Swims:
    """Swims of all sequences."""
    numerics = Numerics("implicit-midpoint", STEPS[nodes], 1e-7, damping=DAMPING)
    return swim(at(Scene(contact=contact), Resolution("continuum", nodes, numerics)), draw_sequences(5))


def path_errors(found: Swims, exact: Swims) -> Floats:
    """Errors of paths as fractions of their length."""
    return errors(found, exact, path_lengths(Scene(), exact.hub)).path


def kept(number: float) -> float | None:
    """Number as the file has it: four digits, none where the solver failed."""
    return None if finite(number) is None else rounded(number)


def bound(contact: Contact) -> float | None:
    """Error that `certify` promises for WORST with CERTIFIED."""
    drawn = np.split(draw_classes(SAMPLES, 5, 0), len(CLASSES), axis=1)[list(CLASSES).index(WORST)]
    limit = Resolution("continuum", MANY_NODES, SHORT)
    found = measure(Scene(contact=contact), [CERTIFIED], limit, lambda *_: SHORT, drawn)
    return kept((found.space[0].path * 4.0 / 3.0 + found.time[0].path).max())


def thrown(contact: Contact) -> float:
    """Largest of SPEEDS that a robot survives, as it does all below [m/s]; 0 for none."""
    return max(takewhile(partial(survives, contact), SPEEDS), default=0.0)


def survives(contact: Contact, speed: float) -> bool:
    """Whether a robot swims on whose limbs 1 and 2 are thrown at each other, their tips so fast [m/s]."""
    robot = Seastar(nodes_per_limb=10)
    simulator = Simulator(Scene(robot, None, numerics=Numerics("sdirk2", 20 * MS), contact=contact))
    state = simulator.get_state()
    x, y = np.moveaxis(state.positions[0, 1:] - state.positions[0, 0], -1, 0)
    turning = np.repeat([1.0, -1.0, 0.0, 0.0, 0.0], 9) * speed / robot.limb_length
    state.velocities[0, 1:] = np.stack([-turning * y, turning * x], axis=1)
    simulator.set_state(state)
    return not simulator.stroke(np.zeros((1, 5))).status.any()


def examine(contact: Contact) -> dict[str, Any]:
    """Numbers of a contact."""
    limit = swum(contact, LIMIT)
    found = {str(nodes): path_errors(swum(contact, nodes), limit) for nodes in NODES}
    away = path_errors(limit, swum(Contact(), LIMIT))
    of_cost = [cost(at(Scene(contact=each), PRESETS["accurate"])) for each in (contact, None)]
    return {
        "largest": {nodes: kept(each.max()) for nodes, each in found.items()},
        "median": {nodes: kept(np.median(each)) for nodes, each in found.items()},
        "away": [kept(np.median(away)), kept(away.max())],
        "cost": rounded(of_cost[0] / of_cost[1]),
    }


def run(_: InDocs, results: Results) -> None:
    """Examine the contacts that are missing."""
    kinds = KINDS | BETWEEN
    for what, of, some in (("thrown", thrown, kinds), ("bounds", bound, kinds), ("contacts", examine, KINDS)):
        results.fill({(what, name): partial(of, each) for name, each in some.items()}, str)


def table(results: Mapping[str, Any]) -> str:
    """Table of the contacts that were examined as a whole in Markdown."""
    nodes = " | ".join(f"N = {n}" for n in NODES)
    lines = [
        f"| contact | {nodes} | `certify` | from the default's path | thrown, m/s | cost |",
        f"|---|{'---:|' * (len(NODES) + 4)}",
    ]
    for name in sorted(KINDS, key=_layer):
        bounds, speed = (results[what][name] for what in ("bounds", "thrown"))
        row = results["contacts"][name]
        each = [f"{_percent(row['largest'][str(n)])}, {_percent(row['median'][str(n)])}" for n in NODES]
        away = ", ".join(map(_percent, reversed(row["away"])))
        lines.append(
            f"| `{name}` | {' | '.join(each)} | {_percent(bounds)} | {away} | {speed:g} | x {row['cost']:.1f} |"
        )
    return "\n".join(lines)


def _layer(name: str) -> float:
    """Layer of a contact by its name [m]; 0 for others, which come first."""
    return KINDS[name].layer or 0.0


def _percent(share: float | None) -> str:
    return "fails" if share is None else f"{PERCENT * share:.2g} %"


STUDY = Study(
    "accuracy.contact",
    run,
    file="accuracy/contact.json",
    settings=lambda _: {"sequences": 14},
    tables={"contact": table},
)
