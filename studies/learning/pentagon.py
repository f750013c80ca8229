"""The fastest pentagon in time that a beam search finds offline.

    python -m studies.learning.pentagon --beam 400 --out runs/pentagon.json

At every decision, all pairs of limbs (or all commands) are tried from the best states so far. States are compared by
the rewarded route that is left from where the hub would come to rest without further commands. Otherwise the search
sees the power strokes of limbs, but not what their way back costs. Swims that were given the same commands during the
last second differ little, and only the best few of them are kept.

Wires are deaf until they are cold (limbs swing from rest, as the chapter's do), or may be heated again at any time. The
result is what the search finds; it does not prove that nothing is faster.
"""

import json
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import tyro
from numpy.typing import NDArray

from seastar_gym.command import run_command
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.paths import make_path
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.files import write_atomically
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import State
from studies.learning.bound import WAYPOINT_RADIUS, name
from studies.learning.branches import Branches, Interval
from studies.learning.coasting import Coasting, fit_coasting
from studies.provenance import provenance

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

MM = 1e-3
"""Metres in a millimetre."""
POWER = SmaWires().heating_power
"""Electric power of a heated wire [W]."""
REMEMBERED = 1.0
"""Time for which swims of the same commands count as alike [s]: that of a wire from its pulse until it is cold."""


@dataclass(frozen=True)
class Options:
    """The fastest pentagon in time that a beam search finds offline."""

    beam: int = 400
    """States kept from one decision to the next."""
    alike: int = 20
    """Most states kept whose commands of the last second are the same."""
    decision_period: float = 0.2
    """Time between decisions [s]."""
    actions: Literal["pairs", "joint"] = "pairs"
    """Commands that are tried: pairs of limbs, or all."""
    deaf: bool = True
    """Whether limbs ignore commands until both their wires are cold."""
    fidelity: Fidelity = "fast"
    """Fidelity of the search."""
    price: float = 0.0
    """Way that a joule of heat counts as, when states are compared [mm/J]."""
    coasting: bool = True
    """Whether states are compared by where they would come to rest, instead of by where they are."""
    again: tuple[Fidelity, ...] = ("balanced", "reference")
    """Fidelities at which the commands that were found are swum once more, open loop."""
    path: str = "pentagon"
    """Path to swim."""
    max_seconds: float = 300.0
    """Time after which the search gives up [s]."""
    out: Path | None = None
    """File of the results (JSON)."""


class Found(NamedTuple):
    """A swim. actions: Shape (n_decisions,), empty if no swim ended. heated: Time for which wires were heated [s]."""

    actions: Indices
    heated: float


class Swims(NamedTuple):
    """Swims of a beam: their states, waypoints reached, time heated [s], and commands of the last second."""

    states: State
    reached: Indices
    heated: Floats
    lately: Indices


def scene_of(options: Options, fidelity: Fidelity | None = None) -> Scene:
    """The chapter's robot with wires, deaf or not."""
    actuator = SmaWires(deaf=options.deaf)
    return replace(Scene.preset(fidelity or options.fidelity), actuator=actuator)


def audible(commands: Floats, deaf: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Commands all of whose limbs can be heated: shape (n_states, n_commands), of deaf wires (n_states, n_limbs, 2)."""
    unheard = np.stack([commands > 0.0, commands < 0.0], axis=-1)[None] & deaf[:, None]
    return np.asarray(~unheard.any(axis=(-2, -1)))


def way_left(place: Floats, reached: Indices, waypoints: Floats) -> Floats:
    """Length of the rewarded route to the last waypoint [m] from places, shape (n, 2)."""
    legs = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    after_it = np.append(np.cumsum(legs[::-1])[::-1], 0.0)
    last = len(waypoints) - 1
    current, after = np.minimum(reached, last), np.minimum(reached + 1, last)
    to_next = RewardWeights().way_to_next(place, waypoints[current], waypoints[after], WAYPOINT_RADIUS)
    return np.where(reached > last, 0.0, to_next + after_it[after])


def best_of(value: Floats, alike: Indices, beam: int, most: int) -> Indices:
    """The `beam` swims of the smallest value, at most `most` that are alike: equal rows of `alike`, shape (n, k)."""
    order = np.argsort(value, kind="stable")
    _, kind = np.unique(alike[order], axis=0, return_inverse=True)
    by_kind = np.argsort(kind.ravel(), kind="stable")
    first = np.append(True, np.diff(kind.ravel()[by_kind]) > 0)
    place = np.arange(len(order))
    rank = np.empty(len(order), np.intp)
    rank[by_kind] = place - np.maximum.accumulate(np.where(first, place, 0))
    return np.asarray(order[rank < most][:beam])


def search(options: Options, waypoints: Floats, coasting: Coasting | None) -> Found:
    """The shortest swim found from rest through all waypoints [m]."""
    scene = scene_of(options)
    commands = command_table(options.actions, scene.robot.n_limbs)
    branches = Branches(scene, options.decision_period)
    n_lately = max(1, round(REMEMBERED / options.decision_period))
    swims = Swims(branches.at_rest(), np.zeros(1, np.intp), np.zeros(1), np.zeros((1, n_lately), np.intp))
    history: list[tuple[Indices, Indices]] = []
    for _ in range(round(options.max_seconds / options.decision_period)):
        parents, actions = np.nonzero(audible(commands, branches.deaf_wires(swims.states)))
        done = branches.swim(swims.states.of_robots(parents), commands[actions])
        swims = _after(swims, parents, actions, done, waypoints)
        place = done.states.positions[:, 0]
        if coasting is not None:
            place = place + coasting(done.states)
        cost = way_left(place, swims.reached, waypoints) + MM * options.price * POWER * swims.heated
        best = best_of(cost, swims.lately, options.beam, options.alike)
        history.append((parents[best], actions[best]))
        swims = Swims(swims.states.of_robots(best), swims.reached[best], swims.heated[best], swims.lately[best])
        ended = np.flatnonzero(swims.reached == len(waypoints))
        if len(ended):
            thrifty = int(ended[np.argmin(swims.heated[ended])])
            return Found(_actions_of(history, thrifty), float(swims.heated[thrifty]))
    return Found(np.zeros(0, np.intp), 0.0)


def _after(swims: Swims, parents: Indices, actions: Indices, done: Interval, waypoints: Floats) -> Swims:
    last, reached = len(waypoints) - 1, swims.reached[parents]
    distance = np.linalg.norm(waypoints[np.minimum(reached, last)] - done.states.positions[:, 0], axis=1)
    lately = np.concatenate([swims.lately[parents][:, 1:], actions[:, None]], axis=1)
    heated = swims.heated[parents] + done.heated
    return Swims(done.states, reached + (distance <= WAYPOINT_RADIUS), heated, lately)


def _actions_of(history: list[tuple[Indices, Indices]], swim: int) -> Indices:
    backwards = []
    for parents, actions in reversed(history):
        backwards.append(actions[swim])
        swim = int(parents[swim])
    return np.array(backwards[::-1])


def swim_again(options: Options, fidelity: Fidelity, found: Found, waypoints: Floats) -> dict[str, Any]:
    """The commands found, swum open loop at a fidelity: how near the hub passes every waypoint, in order [mm]."""
    scene = scene_of(options, fidelity)
    commands = command_table(options.actions, scene.robot.n_limbs)
    branches = Branches(scene, options.decision_period)
    states, hub = branches.at_rest(), []
    for action in found.actions:
        states = branches.swim(states, commands[[action]]).states
        hub.append(states.positions[0, 0])
    nearest, begin = [], 0
    for waypoint in waypoints:
        distances = np.linalg.norm(np.array(hub[begin:]) - waypoint, axis=1)
        within = np.flatnonzero(distances <= WAYPOINT_RADIUS)
        place = int(within[0] if len(within) else np.argmin(distances))
        nearest.append(round(float(distances[place]) / MM, 1))
        begin = min(begin + place, len(hub) - 1)
    return {"nearest_mm": nearest}


def study(options: Options) -> dict[str, Any]:
    """Search, and swim what was found at other fidelities; returns plain data."""
    began = time.perf_counter()
    scene, waypoints = scene_of(options), make_path(options.path, np.random.default_rng(0))
    coasting = fit_coasting(scene, options.decision_period, np.random.default_rng(0)) if options.coasting else None
    found = search(options, waypoints, coasting)
    searched = time.perf_counter() - began
    table = command_table(options.actions, scene.robot.n_limbs)[found.actions]
    return {
        "seconds": round(len(found.actions) * options.decision_period, 6),
        "decisions": len(found.actions),
        "limbs_heated": int(np.count_nonzero(table)),
        "heated_s": round(found.heated, 3),
        "energy_J": round(POWER * found.heated, 1),
        "explained_by_coasting": None if coasting is None else round(coasting.explained, 4),
        "search_s": round(searched, 1),
        "again": {each: swim_again(options, each, found, waypoints) for each in options.again if len(found.actions)},
        "gait": [name(command) for command in table],
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line of the study; returns the exit code."""
    options = tyro.cli(Options, prog="python -m studies.learning.pentagon", args=arguments)
    results = study(options)
    given = sys.argv[1:] if arguments is None else arguments
    results |= provenance(shlex.join(["python", "-m", "studies.learning.pentagon", *given]))
    if options.out is not None:
        write_atomically(options.out, (json.dumps(results, indent=1) + "\n").encode())
    if not results["decisions"]:
        print(f"No swim ended within {options.max_seconds:g} s.")
        return 1
    print(json.dumps({key: value for key, value in results.items() if key != "gait"}, indent=1))
    return 0


if __name__ == "__main__":
    run_command(main)
