"""Fastest swims found offline: the best gaits, the best speed in every direction, and the fastest pentagon.

    python -m studies.learning.bound

The study simulates all periodic gaits of one and two strokes over all commands, and of three and four strokes over
pairs of limbs, once for every class under the symmetry of the robot. Swimming several gaits in turn reaches every
velocity in their convex hull. The fastest pentagon is looked for by a wide beam search. The results are what searches
without a time limit find; they do not prove that nothing is faster.
"""

import itertools
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from seastar_gym.controllers.contract import Policy
from seastar_gym.controllers.greedy import Displacements, measure_gaits
from seastar_gym.controllers.planner import Branching
from seastar_gym.controllers.registry import load_agents
from seastar_gym.envs.commands import Actions, command_table
from seastar_gym.envs.options import make_scene
from seastar_gym.envs.paths import LINE_LENGTH, WAYPOINT_RADIUS, make_path
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.symmetry import action_table
from seastar_gym.evaluation.many import swim_many
from seastar_gym.files import save_figure
from seastar_gym.scene import Scene
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator
from studies.frame import Floats, Results, Study
from studies.style import CYCLE, MM, subplots

Gaits = NDArray[np.intp]

SETTLING, MEASURED = 12, 12
"""Strokes before and during the measurement of a gait; 12 strokes are whole periods of gaits of one to four strokes."""
CHUNK = 4096
"""Gaits that are simulated in one batch."""
STRAIGHT = np.radians(0.3)
"""Largest turn per stroke [rad] of a straight gait, which its mirror image or a rare other stroke can correct."""


def distinct_gaits(period: int, actions: Actions, n_limbs: int = 5) -> Gaits:
    """One gait of every class under turns, mirror images and cyclic shifts, as actions of shape (n_gaits, period)."""
    carried, n_actions = action_table(actions, n_limbs), len(command_table(actions, n_limbs))
    place = n_actions ** np.arange(period)[::-1]
    numbers = np.arange(n_actions**period)
    gaits = numbers[:, None] // place % n_actions
    least = numbers
    for element, shift in itertools.product(range(2 * n_limbs), range(period)):
        least = np.minimum(least, np.roll(carried[element][gaits], shift, axis=1) @ place)
    return gaits[least == numbers]


def measure(scene: Scene, gaits: Gaits, actions: Actions) -> Displacements:
    """Displacements of gaits per stroke, in the body frame."""
    table = command_table(actions, scene.robot.n_limbs)
    chunks = (gaits[begin : begin + CHUNK] for begin in range(0, len(gaits), CHUNK))
    parts = [measure_gaits(scene, table[chunk], SETTLING, MEASURED) for chunk in chunks]
    return Displacements(np.concatenate([part.hub for part in parts]), np.concatenate([part.turn for part in parts]))


def all_directions(hub: Floats, n_limbs: int = 5) -> Floats:
    """Displacements [m] of all turned and mirrored gaits, shape (2 n_limbs n_gaits, 2)."""
    way = hub @ [1.0, 1.0j]
    turns = np.exp(2j * np.pi / n_limbs * np.arange(n_limbs))[:, None]
    every = (turns * np.stack([way, way.conj()])[:, None]).reshape(-1)
    return np.stack([every.real, every.imag], axis=1)


def mixed_speed(displacements: Floats, directions: Floats) -> Floats:
    """Largest speed [m per stroke] along directions [rad] by gaits swum in turn: the edge of their convex hull."""
    normals = ConvexHull(displacements).equations  # n.x + b <= 0
    along = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    return np.asarray(1.0 / (along @ (normals[:, :2] / -normals[:, 2:]).T).max(axis=1))


def search_path(scene: Scene, waypoints: Floats, actions: Actions, beam: int, max_strokes: int = 400) -> Gaits:
    """Actions of the shortest swim found from rest through all waypoints [m]; empty if none ends within max_strokes."""
    swim_all = Branching(scene, command_table(actions, scene.robot.n_limbs)[:, None])
    states, actions_so_far = Simulator(scene).get_state(), np.zeros((1, 0), np.intp)
    n_actions, reached = len(swim_all.moves), np.zeros(1, np.intp)
    legs = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    way_after = np.append(np.cumsum(legs[::-1])[::-1], 0.0)
    last = len(waypoints) - 1
    for _ in range(max_strokes):
        states, reached = swim_all(states), np.repeat(reached, n_actions)
        hub = states.positions[:, 0]
        reached = reached + (np.linalg.norm(waypoints[np.minimum(reached, last)] - hub, axis=1) <= WAYPOINT_RADIUS)
        current, after = np.minimum(reached, last), np.minimum(reached + 1, last)
        to_next = RewardWeights().way_to_next(hub, waypoints[current], waypoints[after], WAYPOINT_RADIUS)
        way = to_next + way_after[after]
        best = np.argsort(way)[:beam]
        actions_so_far = np.column_stack([actions_so_far[best // n_actions], best % n_actions])
        states, reached = states.of_robots(best), reached[best]
        if (reached > last).any():
            return actions_so_far[np.argmax(reached > last)]
    return np.zeros(0, np.intp)


MIXED = "best periodic gaits, mixed"
"""Name of the speeds of straight gaits that are swum in turn."""


def draw(results: Mapping[str, Any], file: Path) -> None:
    """Draw the speeds by direction, in the sector of 36 degrees that turns and mirror images repeat."""
    figure, axes = subplots(figsize=(6.4, 4.4))
    directions, speeds = results["directions_deg"], dict(results["mm_per_stroke"])
    axes.plot(directions, speeds.pop(MIXED), label="best mix of straight gaits: every periodic gait of up to four\n"
              "strokes was tried, and those that do not turn are swum in turn")  # fmt: skip
    for (name, swum), colour in zip(speeds.items(), CYCLE[1:], strict=False):
        axes.plot(directions, swum, "o", color=colour, label=f"agent {name}, from rest to a waypoint in that direction")
    axes.set(
        xlabel="direction of the swim, from limb 1 [degrees]; 36 is midway between two limbs", xticks=directions,
        ylabel="speed [mm per stroke]",
    )  # fmt: skip
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.4 * (high - low))
    axes.legend(loc="upper right")
    save_figure(figure, file)


@dataclass(frozen=True)
class Options:
    """Fastest swims found offline: the best gaits, the best speed in every direction, and the fastest pentagon."""

    fidelity: Fidelity = "fast"
    """Fidelity of the simulated swims."""


def study_gaits(scene: Scene) -> tuple[list[dict[str, Any]], Floats]:
    """Fastest straight gaits of every period, and the displacements per stroke [m] of all straight gaits."""
    kinds: tuple[tuple[int, Actions], ...] = ((1, "joint"), (2, "joint"), (3, "pairs"), (4, "pairs"))
    fastest, straight = [], []
    for period, actions in kinds:
        gaits = distinct_gaits(period, actions)
        done = measure(scene, gaits, actions)
        keeps = np.abs(done.turn) < STRAIGHT
        straight.append(all_directions(done.hub[keeps]))
        speed = np.where(keeps, np.linalg.norm(done.hub, axis=1), 0.0)
        fastest += [
            {
                "period": period,
                "gait": [name(command) for command in command_table(actions, scene.robot.n_limbs)[gaits[k]]],
                "mm_per_stroke": MM * float(speed[k]),
                "direction_deg": float(np.degrees(np.arctan2(done.hub[k, 1], done.hub[k, 0]))),
                "searched": len(gaits),
            }
            for k in np.argsort(-speed)[:5]
        ]
    return fastest, np.concatenate(straight)


def name(command: Floats) -> str:
    """Name of a command such as {2+,5-}."""
    limbs = [f"{limb}{'+' if share > 0 else '-'}" for limb, share in enumerate(command, start=1) if share]
    return "{" + ",".join(limbs) + "}"


def agent_speeds(agent: str, policy: Policy, scene: Scene, directions: Floats) -> Floats:
    """Speeds [m per stroke] of an agent from rest to waypoints at distance LINE_LENGTH in directions [rad]."""
    speeds = []
    for direction in directions:
        waypoint = LINE_LENGTH * np.array([np.cos(direction), np.sin(direction)])
        done = swim_many(agent, policy, waypoint[None], 1, scene)[0]
        speeds.append((LINE_LENGTH - np.linalg.norm(waypoint - done.hub[-1])) / done.strokes)
    return np.array(speeds)


def run(options: Options, results: Results, beam: int = 300) -> None:
    """Search gaits, speeds and the pentagon.

    beam: Width of the beam search round the pentagon, over pairs of limbs [states].
    """
    began, scene = time.perf_counter(), make_scene(None, options.fidelity)
    fastest, displacements = study_gaits(scene)
    directions = np.radians(np.arange(0.0, 37.0, 6.0))
    mixed = mixed_speed(displacements, directions)
    learned = MM * agent_speeds("learned", load_agents(("learned",))["learned"], scene, directions)
    pentagon = search_path(scene, make_path("pentagon", np.random.default_rng(0)), "pairs", beam)
    results.update(
        {
            "fidelity": options.fidelity,
            "fastest_gaits": fastest,
            "directions_deg": np.degrees(directions).tolist(),
            "mm_per_stroke": {MIXED: (MM * mixed).tolist(), "learned": learned.tolist()},
            "pentagon": {
                "strokes": len(pentagon),
                "beam": beam,
                "gait": [name(command) for command in command_table("pairs", scene.robot.n_limbs)[pentagon]],
            },
        }
    )
    print(json.dumps({key: value for key, value in results.items() if key != "pentagon"}, indent=1))
    print(f"Pentagon: {results['pentagon']['strokes']} strokes. All in {time.perf_counter() - began:.0f} s.")


STUDY = Study("learning.bound", run, Options, "learning/bound.json", pictures={"bound.png": draw})
