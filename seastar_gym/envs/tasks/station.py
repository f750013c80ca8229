"""`SeastarStation-v0`: a place to keep in a current that shows in the velocities."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.robots import Flags, Floats, Robots, Score, Task
from seastar_gym.envs.scenery import Ring, Scenery
from seastar_gym.scene import Scene, UniformCurrent, Water
from seastar_gym.scene.number import Range, not_negative, positive, ranging
from seastar_gym.scene.serial import register_part

FARTHEST_COUNTED = 0.02
"""Distance from the station beyond which `reward_distance` grows no more [m]."""
U_X, U_Y = "fluid.current.u_x", "fluid.current.u_y"


@dataclass(frozen=True)
class AnyDirection:
    """Draws of a uniform current with a speed in a range [m/s] and any direction."""

    speed: Range

    def first_values(self, scene: Scene, n_robots: int) -> dict[str, Floats]:
        """Still water."""
        return {U_X: np.zeros(n_robots), U_Y: np.zeros(n_robots)}

    def draw(self, values: dict[str, Floats], robot: int, rng: np.random.Generator) -> None:
        """Draw a robot's current, in place."""
        speed, direction = rng.uniform(*self.speed), rng.uniform(-np.pi, np.pi)
        values[U_X][robot], values[U_Y][robot] = speed * np.cos(direction), speed * np.sin(direction)


@register_part
@dataclass(frozen=True)
class Station(Task):
    """A point to keep the hub at, in a uniform current that is not told but shows in the velocities.

    The current would carry a resting robot by 0.1 to 0.3 m in an episode. It is hardly hidden: after one decision at
    rest, a line through the hub's velocity over ground tells the current with R2 = 0.97. What the task tests is to
    place the hub to fractions of a millimetre while the water flows, as one that thinks two decisions ahead does.

    ## Starting state
    The robot rests over ground, with its hub at the origin and a random heading, and the station lies at a distance in
    `distance`. The current has a speed of `current`, in any direction. All draws can be solved: the robot swims in any
    direction faster than the water.

    ## Episode end
    The task never ends by itself.

    ## Observation
    That of `SeastarSwim-v0`, with the station in the places of the current and of the next waypoint, and with the
    command of the last decision among the numbers of every limb; places for strokes, and for decisions every 0.5 s:

    | strokes  | timed    | meaning                                                    | unit | range |
    |----------|----------|------------------------------------------------------------|------|-------|
    | 0..181   | 0..181   | stations of limbs and the hub, as in `SeastarSwim-v0`;     | -    | -     |
    |          |          | velocities are those over ground                           |      |       |
    | 182..186 | 182..196 | limb after limb: contractions of its wires, if timed; its  | 1    | -1..1 |
    |          |          | last command                                               |      |       |
    | 187..190 | 197..200 | the station relative to the hub: x, y, and once more       | 0.1m | -     |

    ## Reward
    | term              | meaning                                                   | default weight    |
    |-------------------|-----------------------------------------------------------|-------------------|
    | `reward_progress` | decrease of the distance from the station [m]             | 200 per metre     |
    | `reward_distance` | minus that distance, 20 mm at most, times the time [m s]  | 100 per metre and |
    |                   |                                                           | second            |
    | `reward_effort`   | minus the time for which wires were heated, in pulses     | 0.01 per pulse    |

    The task's measure is the mean distance from the 31st second on.

    ## Info
    That of `SeastarSwim-v0` without `waypoint_index`, `cross_track_error`, `energy_per_metre`, `reward_waypoint`,
    `reward_time` and the measured errors, which are those of still water; `is_success` says whether the hub is within
    `tolerance` of the station. Besides,

    | name                | type       | unit | meaning                                        |
    |---------------------|------------|------|------------------------------------------------|
    | `instance`          | int        | -    | number of the episode in its split             |
    | `distance`          | float      | m    | distance of the hub from the station           |
    | `station`           | array (2,) | m    | station in the world: x, y                     |
    | `fluid.current.u_x` | float      | m/s  | velocity of the water, in the world            |
    | `fluid.current.u_y` | float      | m/s  | velocity of the water, in the world            |
    | `reward_distance`   | float      | 1    | term of the reward                             |

    ## Arguments
    current: Smallest and largest speed of the current [m/s].
    distance: Smallest and largest distance of the station from the start [m].
    tolerance: Distance [m] within which the station is kept.
    progress, nearness, effort: Weights of the reward's terms.
    """

    current: Annotated[Range, ranging("m/s", zero_allowed=True)] = (0.001, 0.0025)
    distance: Annotated[Range, ranging("m", zero_allowed=True)] = (0.0, 0.05)
    tolerance: Annotated[float, positive("m")] = 0.002
    progress: Annotated[float, not_negative("1")] = 200.0
    nearness: Annotated[float, not_negative("1")] = 100.0
    effort: Annotated[float, not_negative("1")] = 0.01

    terms = ("reward_progress", "reward_distance", "reward_effort")
    observes_commands = True
    tells_errors = False  # errors were measured in still water

    @property
    def waypoint_radius(self) -> float:  # type: ignore[override]
        """Radius of the station in pictures [m]."""
        return self.tolerance

    @property
    def randomization(self) -> AnyDirection:  # type: ignore[override]
        """The current."""
        return AnyDirection(self.current)

    def simulated(self, scene: Scene) -> Scene:
        """The scene in a current; robots know that of still water."""
        return replace(scene, fluid=replace(scene.fluid or Water(), current=UniformCurrent()))

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """A station, and the distance from it."""
        distance, direction = rng.uniform(*self.distance), rng.uniform(-np.pi, np.pi)
        return {"station": [distance * np.cos(direction), distance * np.sin(direction)], "distance": 0.0}

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Know how far the station is."""
        robots.episode.distance[begun] = _distances(robots, robots.simulator.hub_position())[begun]

    def targets(self, robots: Robots) -> Floats:
        """The station, twice."""
        return np.concatenate([robots.episode.station, robots.episode.station], axis=1)

    def score(self, robots: Robots, hub: Floats, pulses: Floats) -> Score:
        """Progress towards the station, the distance from it, and effort; success within its tolerance."""
        now = robots.episode
        before, now.distance = now.distance, _distances(robots, hub)
        counted = np.minimum(now.distance, FARTHEST_COUNTED)
        terms = {
            "reward_progress": self.progress * (before - now.distance),
            "reward_distance": -self.nearness * robots.decision_period * counted,
            "reward_effort": -self.effort * pulses,
        }
        return Score(terms, success=now.distance <= self.tolerance)

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """The station, and the distance from it."""
        return {"distance": _distances(robots, hub), "station": robots.episode.station.copy()}

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """The station; pictures show the current by themselves."""
        now = robots.episode
        return Scenery(
            rings=(Ring(now.station[robot], self.tolerance),), progress=f"{1000.0 * now.distance[robot]:.1f} mm off"
        )


def _distances(robots: Robots, hub: Floats) -> Floats:
    """Distances of hubs from their stations [m]."""
    away = hub - robots.episode.station
    return np.hypot(away[:, 0], away[:, 1])
