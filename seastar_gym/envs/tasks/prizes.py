"""`SeastarPrizes-v0`: prizes of different worth, more than can be reached in time.

Rounds among prizes: what the best choice of prizes brings within a way, and what the greedy one does.

A point swims from the origin straight from prize to prize. The best choice is exact, by dynamic programming over all
sets of prizes and their last ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.robots import Flags, Floats, Robots, Score, Task
from seastar_gym.envs.scenery import Ring, Scenery
from seastar_gym.scene import Scene
from seastar_gym.scene.number import not_negative, positive
from seastar_gym.scene.serial import register_part


class _Sets(NamedTuple):
    """Sets of n prizes as numbers whose bit k says whether prize k is among them."""

    members: NDArray[np.bool_]
    """Shape (2^n, n)."""
    steps: list[tuple[int, NDArray[np.intp], NDArray[np.intp]]]
    """Prize, sets without it, and the same with it, smaller sets first."""


@cache
def _sets(n: int) -> _Sets:
    numbers = np.arange(1 << n)
    members = (numbers[:, None] >> np.arange(n) & 1).astype(bool)
    size = members.sum(axis=1)
    steps = []
    for k in range(1, n):
        for prize in range(n):
            without = numbers[(size == k) & ~members[:, prize]]
            steps.append((prize, without, without | (1 << prize)))
    return _Sets(members, steps)


class Best(NamedTuple):
    """Best choice of prizes within a way."""

    worth: float
    """What it brings."""
    order: list[int]
    """Prizes in the order of the shortest way through them; empty if none is near enough."""


def best_round(first: Floats, between: Floats, worth: Floats, way: float) -> Best:
    """Best choice of prizes within a way [m]; of equal ones, the shortest.

    first: Ways to all prizes [m], shape (n,). between: Ways from prize to prize [m], shape (n, n), 0 to itself. worth:
    Shape (n,).
    """
    n = len(worth)
    sets = _sets(n)
    shortest = np.full((1 << n, n), np.inf)  # to be in the last one, having been in all
    shortest[1 << np.arange(n), np.arange(n)] = first
    for prize, without, along in sets.steps:
        shortest[along, prize] = (shortest[without] + between[:, prize]).min(axis=1)
    length = shortest.min(axis=1)
    brought = np.where(length <= way, sets.members @ worth, 0.0)
    most = brought.max()
    if most <= 0.0:
        return Best(0.0, [])
    among = np.flatnonzero(brought >= most - 1e-9)
    chosen = int(among[np.argmin(length[among])])
    order: list[int] = []
    last = int(np.argmin(shortest[chosen]))
    while True:
        order.append(last)
        chosen ^= 1 << last
        if chosen == 0:
            return Best(float(most), order[::-1])
        last = int(np.argmin(shortest[chosen] + between[:, last]))


def greedy_round(first: Floats, between: Floats, worth: Floats, way: float) -> float:
    """What a point brings that swims to the prize of most worth per metre, as long as one is within the way.

    Arguments as in `best_round`.
    """
    left, to, brought = np.ones(len(worth), bool), first, 0.0
    while True:
        value = np.where(left & (to <= way), worth / np.maximum(to, 1e-9), 0.0)
        best = int(np.argmax(value))
        if value[best] <= 0.0:
            return brought
        way, brought, left[best] = way - to[best], brought + float(worth[best]), False
        to = between[best]


def distances(points: Floats) -> Floats:
    """Distances between points [m], shape (n, n), of points of shape (n, 2)."""
    away = points[:, None] - points
    return np.asarray(np.hypot(away[..., 0], away[..., 1]))


WORTHS = np.array([1.0, 1.0, 2.0, 4.0])
N_PRIZES = 10
ATTRACTION = 0.1
"""Distance over which a prize attracts [m]."""
MOST_DRAWS = 1000
ROUNDING = 1e-9
"""Share of a time that is no time."""


@register_part
@dataclass(frozen=True)
class Prizes(Task):
    """Ten prizes of different worth, more than can be reached in time, among which the greedy choice is a poor one.

    Nothing is hidden. A controller that always swims to the prize of most worth per metre gets much less than one that
    chooses a round.

    A prize is taken where a decision ends with the hub within `radius` of it.

    ## Starting state
    The robot rests with a random heading. Ten prizes worth 1, 1, 2 or 4 lie anywhere in a square of `side` around it.
    Only draws are kept in which the best round brings a point that swims at `robot_speed` at least 1 + `gain` times as
    much as the greedy one.

    ## Episode end
    `terminated`: all prizes are taken, or `seconds` have passed; the time that is left is observed.

    ## Observation
    That of `SeastarSwim-v0`, with the nearest and the second nearest prize in the places of the current and of the next
    waypoint, and all prizes, nearest first; places for strokes, and for decisions every 0.5 s:

    | strokes  | timed    | meaning                                                        | unit  | range |
    |----------|----------|----------------------------------------------------------------|-------|-------|
    | 0..181   | 0..181   | stations of limbs and the hub, as in `SeastarSwim-v0`          | -     | -     |
    |          | 182..191 | limb after limb: contractions of its wires                     | 1     | 0..1  |
    | 182..212 | 192..222 | prize after prize: its place relative to the hub in the body   | 0.1 m | -     |
    |          |          | frame, x and y; its worth; three zeros for each that is taken. | 1     | 0..4  |
    |          |          | Then the share of time that is left                            | 1     | 0..1  |
    | 213..216 | 223..226 | nearest and second nearest prize relative to the hub; the same | 0.1 m | -     |
    |          |          | one where one is left, the hub where none is                   |       |       |

    ## Reward
    | term              | meaning                                                        | default weight |
    |-------------------|----------------------------------------------------------------|----------------|
    | `reward_progress` | increase of the attraction of the prizes that are left: sum of | 2 per worth    |
    |                   | worth times exp(-distance/0.1 m)                               |                |
    | `reward_prize`    | worth of the prizes taken in the decision                      | 5 per worth    |
    | `reward_effort`   | minus the time for which wires were heated, in pulses          | 0.01 per pulse |

    The task's measure is the worth of all prizes taken.

    ## Info
    That of `SeastarSwim-v0` without `waypoint_index`, `cross_track_error`, `energy_per_metre`, `reward_waypoint` and
    `reward_time`; `is_success` says whether all prizes are taken. Besides,

    | name           | type          | unit | meaning                                                 |
    |----------------|---------------|------|---------------------------------------------------------|
    | `instance`     | int           | -    | number of the episode in its split                      |
    | `distance`     | float         | m    | distance of the hub from the nearest prize that is left |
    | `taken`        | float         | 1    | worth of the prizes taken so far                        |
    | `prizes`       | array (10, 3) | m, 1 | prizes in the world: x, y, worth; 0 if taken            |
    | `reward_prize` | float         | 1    | term of the reward                                      |

    ## Arguments
    side: Side of the square [m].
    radius: Distance [m] within which a prize is taken.
    seconds: Time in which prizes can be taken [s].
    robot_speed: Speed of the point whose rounds are compared [m/s].
    gain: What the best round brings more than the greedy one, as a fraction of the latter.
    progress, prize, effort: Weights of the reward's terms.
    """

    side: Annotated[float, positive("m")] = 0.7
    radius: Annotated[float, positive("m")] = 0.015
    seconds: Annotated[float, positive("s")] = 200.0
    robot_speed: Annotated[float, positive("m/s")] = 0.004
    gain: Annotated[float, not_negative("1")] = 0.4
    progress: Annotated[float, not_negative("1")] = 2.0
    prize: Annotated[float, not_negative("1")] = 5.0
    effort: Annotated[float, not_negative("1")] = 0.01

    terms = ("reward_progress", "reward_prize", "reward_effort")
    entries = (*("vector", "scalar") * N_PRIZES, "scalar")

    @property
    def waypoint_radius(self) -> float:  # type: ignore[override]
        """Radius of the prizes in pictures [m]."""
        return self.radius

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """Prizes, the worth of those that are taken, and where the hub was when it was last scored."""
        return {"prizes": draw_prizes(rng, self), "taken": 0.0, "hub": np.zeros(2)}

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Know where the hub is."""
        robots.episode.hub = robots.simulator.hub_position()

    def targets(self, robots: Robots) -> Floats:
        """The nearest and the second nearest prize that are left."""
        hub = robots.seen_hub()
        near = _nearest_first(robots, hub)
        second = np.where(near[:, 1, 2:] > 0.0, near[:, 1, :2], near[:, 0, :2])
        return np.concatenate([hub + near[:, 0, :2], hub + second], axis=1)

    def observation(self, robots: Robots) -> Floats:
        """Prizes, nearest first, and the share of time that is left."""
        near = _nearest_first(robots, robots.seen_hub())
        places = robots.in_body_frame(near[..., :2]) / robots.scene.robot.limb_length
        seen = np.concatenate([places, near[..., 2:]], axis=-1).reshape(robots.n_robots, -1)
        return np.column_stack([seen, np.maximum(0.0, 1.0 - robots.simulator.time / self.seconds)])

    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """Attraction, prizes that are taken, and effort; success if none is left, and the end of the time."""
        now, time, worth = robots.episode, robots.simulator.time, robots.episode.prizes[..., 2]
        before, after = (np.exp(-_distances(robots, at) / ATTRACTION) for at in (now.hub, hub))
        in_time = time <= self.seconds * (1.0 + ROUNDING)
        reached = (_distances(robots, hub) <= self.radius) & in_time[:, None]
        gained = np.where(reached, worth, 0.0).sum(axis=1)
        terms = {
            "reward_progress": self.progress * (worth * (after - before)).sum(axis=1),
            "reward_prize": self.prize * gained,
            "reward_effort": -self.effort * pulses,
        }
        worth[reached] = 0.0
        now.taken += gained
        now.hub = hub.copy()
        none_left = (worth == 0.0).all(axis=1)
        return Score(terms, none_left, none_left | (time >= self.seconds * (1.0 - ROUNDING)))

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """The prizes, and what is taken."""
        nearest = _distances(robots, hub).min(axis=1)
        return {
            "distance": np.where(np.isinf(nearest), 0.0, nearest),
            "taken": robots.episode.taken.copy(),
            "prizes": robots.episode.prizes.copy(),
        }

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """The prizes that are left, and what they are worth."""
        prizes = robots.episode.prizes[robot]
        left = prizes[prizes[:, 2] > 0.0]
        return Scenery(
            rings=tuple(Ring(prize[:2], self.radius, f"{prize[2]:g}") for prize in left),
            progress=f"{robots.episode.taken[robot]:g} taken, {left[:, 2].sum():g} left",
        )


def _distances(robots: Robots, hub: Floats) -> Floats:
    """Distances of hubs from the prizes that are left [m], shape (n_robots, N_PRIZES); infinite from others."""
    prizes = robots.episode.prizes
    away = prizes[..., :2] - hub[:, None]
    return np.where(prizes[..., 2] > 0.0, np.hypot(away[..., 0], away[..., 1]), np.inf)


def _nearest_first(robots: Robots, hub: Floats) -> Floats:
    """Prizes relative to the hub, nearest first: x, y [m], worth; then zeros for those that are taken."""
    prizes, far = robots.episode.prizes, _distances(robots, hub)
    order = np.argsort(far, axis=1, kind="stable")[..., None]
    seen = np.concatenate([prizes[..., :2] - hub[:, None], prizes[..., 2:]], axis=-1)
    return np.take_along_axis(np.where(np.isinf(far)[..., None], 0.0, seen), order, axis=1)


def draw_prizes(rng: np.random.Generator, task: Prizes) -> Floats:
    """Prizes around the origin: x, y [m], worth; shape (N_PRIZES, 3). ValueError: none were found."""
    way = task.robot_speed * task.seconds
    for _ in range(MOST_DRAWS):
        places = rng.uniform(-0.5 * task.side, 0.5 * task.side, (N_PRIZES, 2))
        worth = rng.choice(WORTHS, N_PRIZES)
        first, between = np.hypot(places[:, 0], places[:, 1]), distances(places)
        wanted = (1.0 + task.gain) * greedy_round(first, between, worth, way)
        if first.min() <= task.radius or wanted > worth.sum():
            continue
        if best_round(first, between, worth, way).worth >= wanted:
            return np.column_stack([places, worth])
    raise ValueError(f"Of {MOST_DRAWS} draws of prizes, the best round brings so much more in none: ask for less gain.")
