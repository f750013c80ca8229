"""What is under way: `Lag`, commands from decisions to wires, and `Tracker`, pictures from robots to who decides.

A picture is a row of numbers: hub x, y [m], cosine and sine of the heading, and what else is seen of the limbs, in the
order and the units of `layout.py`: places of stations, then, where nodes are seen, velocities. A decision knows the two
that the last decisions knew.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.headings import wrapped
from seastar_gym.envs.layout import N_STATIONS, VELOCITY_SCALE
from seastar_gym.envs.observation import lengths_of, pictures_of
from seastar_gym.envs.randomization import Distribution
from seastar_gym.envs.sight import Drawn, Sees, bounds_of, stations_seen
from seastar_gym.scene.actuators.base import Actuator, WirePair
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

GRID = 0.01
"""Drawn delays are rounded up to multiples of this time [s], so that all robots of a batch swim the same steps."""
ROUNDING = 1e-9


class Piece(NamedTuple):
    """Part of a decision, from one time at which commands may reach wires to the next."""

    begin: float
    """Time since the decision [s]."""
    duration: float
    """[s]"""
    commands: Floats
    """Commands that reach the wires at its beginning, shape (n_robots, n_limbs); 0 for what goes on."""


class Lag:
    """Commands of `n_robots` robots that reach their wires some time after the decision.

    delay: That time [s], or its distribution. period: Time between decisions [s].
    """

    def __init__(self, delay: Drawn, period: float, actuator: Actuator, n_robots: int, n_limbs: int):
        self._grid = GRID if isinstance(delay, Distribution) else None
        self._period = period
        low, high = bounds_of(delay)
        possible = [low] if self._grid is None else GRID * np.arange(_whole(low / GRID), _whole(high / GRID) + 1)
        places = [self._place(one) for one in possible]
        self._begins = sorted({0.0, *(rest for _, rest in places)})
        if len(self._begins) > 1 and not isinstance(actuator, WirePair):
            raise ValueError(
                f"action_delay must be whole decisions of {period:g} s for a {type(actuator).__name__}, whose strokes "
                "begin with decisions: use wires, such as SmaWires."
            )
        self._waiting = np.zeros((n_robots, 1 + max(whole for whole, _ in places), n_limbs))  # the latest first
        self._decisions, self._begin = np.zeros((2, n_robots), np.int64)

    def _place(self, delay: float) -> tuple[int, float]:
        """Whole decisions of a delay [s], and the rest of it [s]."""
        if self._grid is not None:
            delay = GRID * _whole(delay / GRID)
        decisions = math.floor(delay / self._period + ROUNDING)
        rest = delay - decisions * self._period
        return decisions, round(rest, 9) if rest > ROUNDING * self._period else 0.0

    def begin(self, robots: NDArray[np.bool_], delays: Floats) -> None:
        """Begin the episodes of the robots in a mask, with nothing on its way. delays: [s], shape (n_robots,)."""
        self._waiting[robots] = 0.0
        for robot in np.flatnonzero(robots):
            self._decisions[robot], rest = self._place(float(delays[robot]))
            self._begin[robot] = self._begins.index(rest)

    def pieces(self, commands: Floats) -> list[Piece]:
        """Pieces of the decision of these commands, shape (n_robots, n_limbs)."""
        arriving = self._with(commands)[np.arange(len(commands)), self._decisions]
        return [
            Piece(begin, end - begin, np.where((self._begin == k)[:, None], arriving, 0.0))
            for k, (begin, end) in enumerate(pairwise([*self._begins, self._period]))
        ]

    def send(self, commands: Floats) -> None:
        """The decision of these commands is over."""
        self._waiting = self._with(commands)

    def _with(self, commands: Floats) -> Floats:
        return np.concatenate([commands[:, None], self._waiting[:, :-1]], axis=1)


def _whole(count: float) -> int:
    """Number of steps of a grid, rounded up."""
    return math.ceil(count - ROUNDING)


Flags = NDArray[np.bool_]

SAME_TIME = 1e-9
"""Differences of times that are rounding [s]."""
POSE = 4
"""Numbers of a hub and a heading."""


class Pictures(NamedTuple):
    """One picture of every robot."""

    rows: Floats
    """Shape (n_robots, k)."""
    taken_at: Floats
    """Time since the episode began [s], shape (n_robots,)."""

    def put(self, robots: Flags, others: "Pictures") -> None:
        """Take the pictures of others for the robots in a mask."""
        self.rows[robots], self.taken_at[robots] = others.rows[robots], others.taken_at[robots]


class Tracker:
    """Pictures of `n_robots` robots.

    rate: Pictures per second [Hz]. sees: As of a `Sight`. numbers: Those of the sight by name, shape (n_robots,) each,
    at first the largest; they may change when an episode begins.
    """

    def __init__(self, rate: float, sees: Sees | int, n_limbs: int, numbers: dict[str, Floats]):
        self.rate, self.sees, self._numbers = rate, sees, numbers
        stations = (np.arange(n_limbs)[:, None] * N_STATIONS + stations_seen(sees)).ravel()
        self.n_places = 2 * len(stations)
        n_all = 2 * N_STATIONS * n_limbs
        velocities = np.arange(n_all, 2 * n_all + 2) if sees == "nodes" else np.zeros(0, np.intp)
        self.columns = np.concatenate([(2 * stations[:, None] + np.arange(2)).ravel(), velocities])
        """Places of what is seen of the limbs among `Layout.stations_and_hub`."""
        longest = float((numbers["sight.delay"] + numbers["sight.jitter"]).max())
        n_robots, n_kept, size = len(numbers["sight.delay"]), math.ceil(longest * rate) + 2, POSE + len(self.columns)
        self._generators = [np.random.default_rng(0)] * n_robots
        self._next = np.zeros(n_robots, np.int64)  # number of the next picture of the episode
        self._n_kept = np.zeros(n_robots, np.int64)
        self._rows = np.zeros((n_robots, n_kept, size))
        self._taken_at, self._seen_at = np.full((2, n_robots, n_kept), np.inf)
        self.now = Pictures(np.zeros((n_robots, size)), np.zeros(n_robots))
        self.before = Pictures(np.zeros((n_robots, size)), np.zeros(n_robots))

    def begin(self, robots: Flags, generators: list[np.random.Generator], simulator: Simulator) -> None:
        """Begin the episodes of the robots in a mask, which have been at rest.

        generators: Random generator of every robot, which gives that of its pictures.
        """
        rows, lengths = pictures_of(simulator, self.columns), lengths_of(simulator)
        for robot in np.flatnonzero(robots).tolist():
            self._generators[robot] = np.random.default_rng(generators[robot].integers(2**63))
        self._seen_at[robots], self._next[robots], self._n_kept[robots] = np.inf, 1, 0
        first = -np.ceil((self._numbers["sight.delay"] + self._numbers["sight.jitter"]) * self.rate - SAME_TIME)
        self.now.put(robots, Pictures(self._blurred(robots, rows, lengths), first / self.rate))
        for k in range(1 - self._rows.shape[1], 1):
            self._take(robots & (first < k), rows, np.full(len(rows), k / self.rate), lengths)
        self.look(np.zeros(len(rows)))
        self.before.put(robots, self.now)

    def due_times(self, time: Floats, duration: float) -> Floats:
        """When pictures of any robot are due in an interval [s], since it begins at these times [s]; shape (n,)."""
        last = np.floor((time + duration + SAME_TIME) * self.rate)
        most = int((last - self._next).max(initial=-1.0)) + 1
        due = (self._next[:, None] + np.arange(most)) / self.rate - time[:, None] - SAME_TIME
        return np.unique(due[due <= duration])

    def take(self, simulator: Simulator) -> None:
        """Take the pictures that are due."""
        time = simulator.time
        due = self._next / self.rate <= time + SAME_TIME
        if not due.any():
            return
        self._take(due, pictures_of(simulator, self.columns), time, lengths_of(simulator))
        self._next[due] = np.floor((time + SAME_TIME) * self.rate)[due].astype(np.int64) + 1

    def _take(self, robots: Flags, rows: Floats, time: Floats, lengths: Floats) -> None:
        """Take pictures of the robots in a mask at a time [s], some of which are lost.

        rows: What they show without errors, shape (n_robots, k). lengths: Of limbs [m], shape (n_robots,).
        """
        delay, jitter, dropout = (self._numbers[f"sight.{name}"] for name in ("delay", "jitter", "dropout"))
        lost, late = np.ones((2, len(rows)))
        for robot in np.flatnonzero(robots).tolist():
            lost[robot], late[robot] = self._generators[robot].random(2)
        blurred = self._blurred(robots, rows, lengths)
        seen_at = time + np.maximum(delay + jitter * (2.0 * late - 1.0), 0.0)
        self.keep(robots & (lost >= dropout), Pictures(blurred, time), seen_at)

    def keep(self, robots: Flags, pictures: Pictures, seen_at: Floats) -> None:
        """Keep pictures of the robots in a mask, which are seen at these times [s], shape (n_robots,)."""
        at = np.flatnonzero(robots), (self._n_kept % self._rows.shape[1])[robots]
        self._rows[at], self._taken_at[at] = pictures.rows[robots], pictures.taken_at[robots]
        self._seen_at[at] = seen_at[robots]
        self._n_kept += robots

    def _blurred(self, robots: Flags, rows: Floats, lengths: Floats) -> Floats:
        """Pictures with the errors of the robots in a mask."""
        noise, turn_noise = (self._numbers[f"sight.{name}"][:, None] for name in ("noise", "turn_noise"))
        errors = np.zeros((len(rows), 3 + self.n_places))
        for robot in np.flatnonzero(robots).tolist():
            errors[robot] = self._generators[robot].standard_normal(errors.shape[1])
        turn, of_hub, of_places = turn_noise * errors[:, :1], noise * errors[:, 1:3], noise * errors[:, 3:]
        c, s = rows[:, 2:3], rows[:, 3:4]
        found, at = rows.copy(), slice(POSE, POSE + self.n_places)
        found[:, :2] += np.concatenate(_turned(of_hub[:, :1], of_hub[:, 1:], c, -s), axis=1)
        found[:, 2:4] = np.concatenate(_turned(c, s, np.cos(turn), -np.sin(turn)), axis=1)
        places = rows[:, at] + (of_places - np.tile(of_hub, self.n_places // 2)) / lengths[:, None]
        x, y = _turned(places[:, ::2], places[:, 1::2], np.cos(turn), np.sin(turn))
        found[:, at] = np.stack([x, y], axis=2).reshape(len(rows), -1)
        return found

    def look(self, time: Floats) -> None:
        """Know the newest pictures that have been seen by a time [s], shape (n_robots,), and those of the last look."""
        taken_at = np.where(self._seen_at <= time[:, None] + SAME_TIME, self._taken_at, -np.inf)
        newest, robots = np.argmax(taken_at, axis=1), np.arange(len(time))
        found = Pictures(self._rows[robots, newest], taken_at[robots, newest])
        newer = found.taken_at > self.now.taken_at
        self.before.put(newer, self.now)
        self.now.put(newer, found)

    def wait(self, seconds: float) -> None:
        """Let the episodes' clock wait for so long: pictures are that much older on it."""
        for times in (self._taken_at, self._seen_at, self.now.taken_at, self.before.taken_at):
            times -= seconds

    def restart(self, pictures: Pictures) -> None:
        """Know these pictures, and none before."""
        everyone = np.ones(len(pictures.rows), bool)
        self._seen_at[:] = np.inf
        self.now.put(everyone, pictures)
        self.before.put(everyone, pictures)

    @property
    def hub(self) -> Floats:
        """Hubs as they are seen [m], shape (n_robots, 2), a copy."""
        return self.now.rows[:, :2].copy()

    @property
    def axes(self) -> Floats:
        """Cosines and sines of the headings as they are seen, shape (2, n_robots)."""
        return self.now.rows[:, 2:POSE].T

    def of_limbs(self, lengths: Floats) -> Floats:
        """What is seen of the limbs and the hub's velocity, shape (n_robots, k), see `Layout.stations_and_hub`."""
        seen = self.now.rows[:, POSE:]
        if self.sees == "nodes":
            return seen
        moved = (seen - self.before.rows[:, POSE:]) * (self._per_second * lengths / VELOCITY_SCALE)[:, None]
        return np.concatenate([seen, moved, self.hub_velocity], axis=1)

    @property
    def hub_velocity(self) -> Floats:
        """Mean velocities of the hubs between the two pictures [VELOCITY_SCALE], in the frame of the last, (n, 2)."""
        moved = (self.now.rows[:, :2] - self.before.rows[:, :2]) * (self._per_second / VELOCITY_SCALE)[:, None]
        return np.stack(_turned(moved[:, 0], moved[:, 1], *self.axes), axis=1)

    @property
    def turn_rate(self) -> Floats:
        """Mean rates of turn between the two pictures [rad/s], shape (n_robots,)."""
        after, before = (np.arctan2(seen.rows[:, 3], seen.rows[:, 2]) for seen in (self.now, self.before))
        return wrapped(after - before) * self._per_second

    @property
    def _per_second(self) -> Floats:
        """One over the time between the two pictures [1/s], 0 where they are the same, shape (n_robots,)."""
        between = self.now.taken_at - self.before.taken_at
        return np.divide(1.0, between, out=np.zeros_like(between), where=between > SAME_TIME)

    def entries(self, time: Floats) -> Floats:
        """Further entries of the observations, shape (n_robots, k), see `entries_of`. time: Now [s]."""
        moves = [] if self.sees == "nodes" else [self.turn_rate]
        if self.sees == "pose":
            moves = [*self.hub_velocity.T, *moves]
        return np.stack([*moves, self.age(time)], axis=1)

    def age(self, time: Floats) -> Floats:
        """Time since the last pictures were taken [s], shape (n_robots,)."""
        return np.maximum(time - self.now.taken_at, 0.0)


def _turned(x: Floats, y: Floats, c: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Vectors (x, y) as seen in a frame whose x axis is (c, s)."""
    return x * c + y * s, y * c - x * s
