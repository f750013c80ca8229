"""`SeastarMiswired-v0`: limbs whose two wires may have been swapped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.options import RewardWeights
from seastar_gym.envs.robots import Flags, Floats, Robots
from seastar_gym.envs.scenery import Scenery
from seastar_gym.envs.waypoints import Waypoints
from seastar_gym.scene import Scene
from seastar_gym.scene.number import within
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class Miswired(Waypoints):
    """Waypoints for a robot whose wires may be swapped, limb by limb, which it has to find out.

    At the start of an episode, each limb's two wires are swapped with probability `swap_probability`, and stay so: a
    command + then turns that limb clockwise, and - anti-clockwise. Nothing tells the robot, but what its limbs do. A
    controller that remembers what followed from which command knows all wires after a few decisions; one observation
    tells of the limbs at most that were heated last.

    ## Episode
    A random path of five legs of 0.1 to 0.2 m, as `path="random"` of `SeastarSwim-v0`, from a random heading. It ends
    when the last waypoint is reached. Every draw can be solved: a robot that knows its wires swims as any other.

    ## Observation
    That of `SeastarSwim-v0`, with the command of the last decision among the numbers of every limb, after those of its
    actuator; places for strokes, and for decisions every 0.5 s:

    | strokes  | timed    | meaning                                                    | unit | range |
    |----------|----------|------------------------------------------------------------|------|-------|
    | 0..181   | 0..181   | stations of limbs and the hub, as in `SeastarSwim-v0`      | -    | -     |
    | 182..186 | 182..196 | limb after limb: contractions of its wires, if timed, in   | 1    | -1..1 |
    |          |          | the names of the commands; its last command                |      |       |
    | 187..190 | 197..200 | current and next waypoint, as in `SeastarSwim-v0`          | -    | -     |

    ## Reward
    | term              | meaning                                                      | default weight |
    |-------------------|--------------------------------------------------------------|----------------|
    | `reward_progress` | decrease of the length of the route to the last waypoint [m] | 200 per metre  |
    | `reward_waypoint` | waypoints reached in the decision                            | 1 per waypoint |
    | `reward_effort`   | minus the time for which wires were heated, in pulses        | 0.01 per pulse |

    The return says how far the robot got. Robots that arrive are compared by their time, the task's measure.

    ## Info
    That of `SeastarSwim-v0`, and

    | name       | type       | unit | meaning                                              |
    |------------|------------|------|------------------------------------------------------|
    | `instance` | int        | -    | number of the episode in its split                   |
    | `wiring`   | array (5,) | 1    | limb by limb: 1, or -1 where the wires are swapped   |

    `wiring` is what the robot is not told: only for judges, and for controllers that are to know everything.

    ## Arguments
    swap_probability: Probability that a limb's wires are swapped, 0 to 1.
    reward: Weights of the reward's terms.
    """

    swap_probability: Annotated[float, within(0.0, 1.0)] = 0.5
    reward: RewardWeights = RewardWeights()

    observes_commands = True

    def draw(self, rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
        """A path, and which wires are swapped."""
        path = super().draw(rng, scene)
        swapped = rng.random(scene.robot.n_limbs) < self.swap_probability
        return {**path, "wiring": np.where(swapped, -1.0, 1.0)}

    def begin(self, robots: Robots, begun: Flags) -> None:
        """Swap the wires, and swim to the first waypoint."""
        robots.wiring = robots.episode.wiring
        super().begin(robots, begun)

    def info(self, robots: Robots, hub: Floats) -> dict[str, NDArray[Any]]:
        """Where robots are on their paths, and their wires."""
        return {**super().info(robots, hub), "wiring": robots.episode.wiring.copy()}

    def scenery(self, robots: Robots, robot: int) -> Scenery:
        """Which wires are swapped."""
        swapped = np.flatnonzero(robots.episode.wiring[robot] < 0.0) + 1
        return Scenery(note="wires swapped: " + (", ".join(map(str, swapped)) or "none"))
