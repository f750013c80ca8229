"""`SeastarObstTrap-v0`: a goal behind discs, most of which may form a horseshoe.

Fields of discs, and ways around them: shortest ways on a grid whose nodes keep clear of all discs.

A field is rows of centre and radius: x, y, r [m]. The grid lies around the way from the origin along +x. A node has
edges to the sixteen nearest nodes that are no multiples of others, so the length of a way is exact to 3 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.robots import Floats, Robots, Score
from seastar_gym.envs.scenery import Ring, Scenery
from seastar_gym.envs.waypoints import Waypoints
from seastar_gym.process import held_back
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import require_choice
from seastar_gym.scene.number import Range, not_negative, positive, ranging, whole
from seastar_gym.scene.serial import register_part

BOX = np.array([[-0.2, -0.4], [0.8, 0.4]])
"""Corners of the grid [m]: lower left, upper right."""
NEIGHBOURS = np.array([(1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2), (2, -1), (1, -2)])
"""Edges of a node, in steps of the grid; the opposite ones belong to the neighbours."""
WINDOW = 2
"""A point goes on by one of the nodes within so many steps of the one that is nearest to it."""


def rims(points: Floats, discs: Floats) -> Floats:
    """Distances of points, shape (..., 2), from the rims of discs, shape (..., m, 3) [m]; negative within."""
    away = points[..., None, :] - discs[..., :2]
    return np.asarray(np.hypot(away[..., 0], away[..., 1]) - discs[..., 2])


class _Grid(NamedTuple):
    """Nodes, shape (nx, ny, 2) [m], and edges: numbers of both ends, and lengths [m]."""

    nodes: Floats
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    length: Floats


@cache
def _grid(step: float) -> _Grid:
    """Grid of a step [m]."""
    nx, ny = (np.rint((BOX[1] - BOX[0]) / step).astype(int) + 1).tolist()
    number = np.arange(nx * ny).reshape(nx, ny)
    x, y = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    first, last, length = [], [], []
    for dx, dy in NEIGHBOURS.tolist():
        inside = (x + dx < nx) & (y + dy >= 0) & (y + dy < ny)
        first.append(number[inside])
        last.append(number[x[inside] + dx, y[inside] + dy])
        length.append(np.full(len(first[-1]), step * np.hypot(dx, dy)))
    nodes = BOX[0] + step * np.stack([x, y], axis=-1)
    return _Grid(nodes, np.concatenate(first), np.concatenate(last), np.concatenate(length))


class Ways(NamedTuple):
    """Lengths of the shortest ways to a goal from the nodes of a grid."""

    lengths: Floats
    """Shape (..., nx, ny) [m]; infinite where there is no way, NaN for nodes that are in a disc or too near to one."""
    step: float
    """[m]"""

    def __call__(self, points: Floats) -> Floats:
        """Lengths [m] from points, shape (..., k, 2), for lengths of shape (..., nx, ny).

        A point in a disc, with no clear node near, swims to the nearest node with a way first.
        """
        shape = self.lengths.shape[-2:]
        nearest = np.rint((points - BOX[0]) / self.step).astype(int)
        steps = np.arange(-WINDOW, WINDOW + 1)
        i, j = (np.clip(nearest[..., k, None] + steps, 0, shape[k] - 1) for k in (0, 1))
        i, j = np.repeat(i, len(steps), axis=-1), np.tile(j, len(steps))
        rows = self.lengths.reshape(*self.lengths.shape[:-2], 1, -1)
        flat = np.broadcast_to(rows, (*points.shape[:-1], rows.shape[-1]))
        there = np.take_along_axis(flat, i * shape[1] + j, axis=-1)
        away = BOX[0] + self.step * np.stack([i, j], axis=-1) - points[..., None, :]
        reached = np.where(np.isnan(there), np.inf, there + np.hypot(away[..., 0], away[..., 1]))
        found = np.asarray(reached.min(axis=-1))
        for lost in map(tuple, np.argwhere(np.isnan(there).all(axis=-1))):
            found[lost] = self._from_afar(points[lost], flat[lost])
        return found

    def _from_afar(self, point: Floats, lengths: Floats) -> float:
        """Length [m] from a point with no way near."""
        away = _grid(self.step).nodes.reshape(-1, 2) - point
        distances = np.where(np.isfinite(lengths), np.hypot(away[:, 0], away[:, 1]), np.inf)
        nearest = int(np.argmin(distances))
        return float(distances[nearest] + lengths[nearest])


def ways(discs: Floats, goal: Floats, clearance: float, step: float) -> Ways:
    """Shortest ways to a goal [m] that keep a clearance [m] from all discs, shape (m, 3), on a grid of a step [m]."""
    with held_back():  # these take long to import, and other tasks do without
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import dijkstra

    grid = _grid(step)
    is_free = (rims(grid.nodes, discs).min(axis=-1, initial=np.inf) >= clearance).ravel()
    open_ = is_free[grid.first] & is_free[grid.last]
    n = len(is_free)
    graph = csr_matrix((grid.length[open_], (grid.first[open_], grid.last[open_])), shape=(n, n))
    away = grid.nodes.reshape(-1, 2) - goal
    begin = int(np.argmin(np.hypot(away[:, 0], away[:, 1])))
    if not is_free[begin]:
        return Ways(np.full(grid.nodes.shape[:2], np.inf), step)
    lengths = np.where(is_free, dijkstra(graph, directed=False, indices=begin), np.nan)
    return Ways(lengths.reshape(grid.nodes.shape[:2]), step)


Potential = Literal["straight", "geodesic"]
SEEN = 6
"""Number of discs that the robot sees."""
N_HORSESHOE = 8
"""Discs of a horseshoe, or of one that is absent."""
PRESENCE = 0.8
"""Share of the episodes with a horseshoe."""
ARC: Range = (0.095, 0.13)
"""Radius of the arc on which the centres of its discs lie [m]."""
EXTENT: Range = (1.7, 2.0)
"""Angle from the middle of the arc to its ends [rad]."""
OVERLAP: Range = (0.55, 0.7)
"""Radius of its discs, as a share of the distance of neighbours: more than a half, so that they overlap."""
HOLE, WIDTH = 0.5, 2
"""Share of the horseshoes with a hole, and the number of discs that are missing there."""
OPENING = 0.5 * np.pi
"""Largest angle between the way from the goal to the start and the direction in which a horseshoe opens [rad]."""
FIRST, LAST = 0.12, 0.17
"""Least distances, along the straight way, of a horseshoe's centre from the start and from the goal [m]."""
ASIDE = 0.05
"""Largest distance of the horseshoe's centre from the straight way [m]."""
RADIUS: Range = (0.02, 0.045)
"""Radius of a scattered disc [m]."""
AROUND = 0.06
"""Clearance of the start and of the goal [m]."""
PASSAGE, SOLVING_STEP, STEP = 0.015, 0.02, 0.01
"""Clearance of the way that is asked for, and steps of the grids of draws and of the geodesic potential [m]."""
NEAREST_GOAL, FARTHEST_GOAL = 0.45, 0.6
"""Between nearer goals and the start there is no room for a horseshoe; farther ones are too near to the grid's end."""
MOST_DRAWS = 1000
START = np.zeros((1, 2))


@register_part
@dataclass(frozen=True)
class ObstTrap(Waypoints):
    """A goal behind discs, most of which form a horseshoe that may be open towards the robot.

    A robot that swims towards the goal ends in the horseshoe, or at its side. It sees the discs around it alone; one
    that remembers the discs it has seen, and plans its way around them, finds out. Where the horseshoe lies and opens,
    and whether there is one, is drawn: knowing the draws is no help.

    The hub must stay out of discs, limbs may pass over them.

    ## Starting state
    The robot rests with a random heading. The goal lies at a distance in `distance`. In four episodes of five, eight
    discs of one radius overlap in a horseshoe: anywhere between start and goal, up to 50 mm aside, open to any side but
    that of the goal. Half of the horseshoes have a hole, where two discs are missing, anywhere but at their ends. Discs
    that are missing there, all eight where there is no horseshoe, and `scattered` discs more lie elsewhere. None is
    near the start or the goal. Only fields that can be solved are drawn: there is a way that keeps 15 mm clear of all
    discs and is no longer than `longest_way`.

    ## Episode end
    `terminated`: the goal is reached, or a decision ends with the hub within a disc, which is no success.

    ## Observation
    That of `SeastarSwim-v0`, with the goal in the places of the current and of the next waypoint, and the six discs
    whose rims are nearest to the hub, nearest first; places for strokes, and for decisions every 0.5 s:

    | strokes  | timed    | meaning                                                     | unit  | range |
    |----------|----------|-------------------------------------------------------------|-------|-------|
    | 0..181   | 0..181   | stations of limbs and the hub, as in `SeastarSwim-v0`       | -     | -     |
    |          | 182..191 | limb after limb: contractions of its wires                  | 1     | 0..1  |
    | 182..199 | 192..209 | disc after disc: its centre relative to the hub in the body | 0.1 m | -     |
    |          |          | frame, x and y; its radius                                  |       |       |
    | 200..203 | 210..213 | the goal relative to the hub: x, y, and once more           | 0.1 m | -     |

    ## Reward
    | term              | meaning                                                 | default weight |
    |-------------------|---------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the way to the goal [m], see `potential`    | 200 per metre  |
    | `reward_waypoint` | 1 in the decision in which the goal is reached          | 1              |
    | `reward_effort`   | minus the time for which wires were heated, in pulses   | 0.01 per pulse |
    | `reward_time`     | minus the duration of the decision [s]                  | 0 per second   |
    | `reward_touch`    | -1 in the decision in which a disc is touched           | 20             |

    With `potential="straight"`, the default, the way is the straight line to the goal through all discs. It leads into
    the horseshoe: what a learner makes of this reward says little about what it could make of another one. With
    `potential="geodesic"` it is the shortest way around all discs. That tells what the robot does not see, so it is for
    learners that are to be told. The task's measure is the time until the goal is reached.

    ## Info
    That of `SeastarSwim-v0`, and

    | name           | type          | unit | meaning                                                          |
    |----------------|---------------|------|------------------------------------------------------------------|
    | `instance`     | int           | -    | number of the episode in its split                               |
    | `clearance`    | float         | m    | distance of the hub from the nearest rim; below 0 it touches     |
    | `discs`        | array (11, 3) | m    | all discs in the world: x, y, radius; there are 8 + `scattered`  |
    | `reward_touch` | float         | 1    | term of the reward                                               |

    `discs` has more than the robot sees.

    ## Arguments
    distance: Smallest and largest distance of the goal from the start [m].
    scattered: Number of discs besides the horseshoe.
    longest_way: Length of the longest way that has to be swum [m].
    potential: What progress is measured by: "straight" or "geodesic".
    touch: Weight of the term `reward_touch`.
    reward: Weights of the other terms.
    """

    distance: Annotated[Range, ranging("m")] = (0.45, 0.6)
    scattered: Annotated[int, whole(0, 20)] = 3
    longest_way: Annotated[float, positive("m")] = 0.85
    potential: Potential = "straight"
    touch: Annotated[float, not_negative("1")] = 20.0
    reward: RewardWeights = RewardWeights()

    def __post_init__(self) -> None:
        super().__post_init__()
        nearest, farthest = self.distance
        if nearest < NEAREST_GOAL or farthest > FARTHEST_GOAL:
            bounds = f"{NEAREST_GOAL} to {FARTHEST_GOAL} m"
            raise ValueError(f"ObstTrap.distance must lie from {bounds}, not {self.distance}.")
        require_choice("ObstTrap.potential", self.potential, get_args(Potential))

    terms = (*Waypoints.terms, "reward_touch")
    goals_are_waypoints = False
    entries = ("vector", "scalar") * SEEN

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """A goal, discs, and for the geodesic potential the ways around them."""
        goal = np.array([rng.uniform(*self.distance), 0.0])
        discs = draw_discs(rng, goal, self.scattered, self.longest_way)
        around = {"ways": ways(discs, goal, PASSAGE, STEP).lengths} if self.potential == "geodesic" else {}
        return {**self.along(goal[None]), "discs": discs, **around}

    def measure_way_to_go(self, robots: Robots, hub: Floats) -> Floats:
        """Length of the straight way to the goal, or of the shortest one around all discs [m], see `potential`."""
        if self.potential == "straight":
            return super().measure_way_to_go(robots, hub)
        return Ways(robots.episode.ways, STEP)(hub[:, None])[:, 0]

    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """That of all swims along waypoints, and the price of touching a disc, which ends the episode."""
        score, touches = super().score(robots, hub, pulses), clearance(robots, hub) < 0.0
        terms = {**score.terms, "reward_touch": -self.touch * touches.astype(np.float64)}
        return Score(terms, score.success & ~touches, score.over | touches)

    def observation(self, robots: Robots) -> Floats:
        """The nearest discs."""
        hub, discs = robots.seen_hub(), robots.episode.discs
        order = np.argsort(rims(hub, discs), axis=1, kind="stable")[:, :SEEN]
        nearest = np.take_along_axis(discs, order[..., None], axis=1)
        seen = np.concatenate([robots.in_body_frame(nearest[..., :2] - hub[:, None]), nearest[..., 2:]], axis=-1)
        return seen.reshape(robots.n_robots, -1) / robots.scene.robot.limb_length

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """Where robots are on their ways, and the discs."""
        found = super().info(robots, hub)
        return {**found, "clearance": clearance(robots, hub), "discs": robots.episode.discs.copy()}

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """The discs, and the end of who touched one."""
        touches = clearance(robots, robots.simulator.hub_position())[robot] < 0.0
        return Scenery(
            obstacles=tuple(Ring(disc[:2], float(disc[2])) for disc in robots.episode.discs[robot]),
            progress="touched a disc" if touches else None,
        )


def clearance(robots: Robots, hub: Floats) -> Floats:
    """Distance of hubs [m], shape (n_robots, 2), from the nearest rim [m], shape (n_robots,)."""
    return np.asarray(rims(hub, robots.episode.discs).min(axis=1))


class Horseshoe(NamedTuple):
    """Discs that overlap on an arc."""

    centre: Floats
    """Centre of the arc: x, y [m]."""
    arc: float
    """Radius of the arc [m]."""
    extent: float
    """Angle from the middle of the arc to its ends [rad]."""
    middle: float
    """Direction of the middle from the centre [rad]: 0 is towards the goal, and the horseshoe opens the other way."""
    radius: float
    """Radius of the discs [m]."""
    hole: int = N_HORSESHOE
    """Number of the first of the WIDTH discs that are missing; N_HORSESHOE for none."""

    @property
    def discs(self) -> Floats:
        """Its discs, shape (N_HORSESHOE, 3); NaN where one is missing."""
        at = self.middle + np.linspace(-self.extent, self.extent, N_HORSESHOE)
        places = self.centre + self.arc * np.stack([np.cos(at), np.sin(at)], axis=1)
        discs = np.column_stack([places, np.full(N_HORSESHOE, self.radius)])
        discs[self.hole : self.hole + WIDTH] = np.nan
        return discs


def draw_kind(rng: np.random.Generator) -> tuple[float, int]:
    """Fields `middle` and `hole` of a horseshoe."""
    hole = int(rng.integers(1, N_HORSESHOE - WIDTH)) if rng.random() < HOLE else N_HORSESHOE
    return rng.uniform(-OPENING, OPENING), hole


def draw_horseshoe(rng: np.random.Generator, goal: float, middle: float, hole: int) -> Horseshoe:
    """A horseshoe of a kind, somewhere on the way to a goal at this distance [m]."""
    arc, extent = rng.uniform(*ARC), rng.uniform(*EXTENT)
    centre = np.array([rng.uniform(FIRST, goal - LAST), rng.uniform(-ASIDE, ASIDE)])
    spacing = 2.0 * arc * np.sin(extent / (N_HORSESHOE - 1))
    return Horseshoe(centre, arc, extent, middle, rng.uniform(*OVERLAP) * spacing, hole)


def draw_discs(rng: np.random.Generator, goal: Floats, scattered: int, longest_way: float) -> Floats:
    """Discs around which there is a way from the origin to the goal [m] on the x axis, shape (8 + scattered, 3).

    The first eight are a horseshoe, or as many discs of which some or all are scattered. ValueError: none were found.
    """
    is_there, kind = rng.random() < PRESENCE, draw_kind(rng)  # before, so that what is refused changes no shares
    for _ in range(MOST_DRAWS):
        horseshoe = draw_horseshoe(rng, goal[0], *kind)
        discs = rng.uniform([-0.05, -0.25, RADIUS[0]], [goal[0] + 0.05, 0.25, RADIUS[1]], (N_HORSESHOE + scattered, 3))
        discs[:N_HORSESHOE, 2] = horseshoe.radius
        if is_there:
            is_part = ~np.isnan(horseshoe.discs[:, 0])
            discs[:N_HORSESHOE][is_part] = horseshoe.discs[is_part]
            outside = np.concatenate([discs[:N_HORSESHOE][~is_part], discs[N_HORSESHOE:]])
            if (rims(horseshoe.centre, outside) < horseshoe.arc + horseshoe.radius).any():
                continue
        clear = min(rims(START[0], discs).min(), rims(goal, discs).min()) >= AROUND
        if clear and ways(discs, goal, PASSAGE, SOLVING_STEP)(START)[0] <= longest_way:
            return discs
    raise ValueError(f"Of {MOST_DRAWS} fields of discs none can be passed: ask for fewer discs, or for longer ways.")
