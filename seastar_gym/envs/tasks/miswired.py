"""`SeastarMiswired-v0`: limbs whose two wires may have been swapped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.scenery import Scenery
from seastar_gym.envs.swimming import Flags, Floats
from seastar_gym.envs.task import SwimTask
from seastar_gym.envs.tasks.challenge import Challenge
from seastar_gym.envs.tasks.numbered import Numbered, Split
from seastar_gym.scene.number import within
from seastar_gym.scene.serial import register_part


@register_part
@dataclass(frozen=True)
class Miswired(Challenge):
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

    def swimming(self, options: SwimOptions, n_robots: int, threads: int | None, split: Split) -> MiswiredTask:
        """The task of so many robots."""
        return MiswiredTask(self, options, n_robots, threads, split)


class MiswiredTask(Numbered, SwimTask):
    """Task of robots whose wires may be swapped."""

    observes_commands = True

    def __init__(self, config: Miswired, options: SwimOptions, n_robots: int, threads: int | None, split: Split):
        self.config = config
        options = replace(options, path="random", random_heading=True, reward=config.reward)
        SwimTask.__init__(self, options, n_robots, threads)
        self.wiring = np.ones((n_robots, self.scene.robot.n_limbs))
        self._number(split)

    def _draw(self, robot: int, rng: np.random.Generator, asked: Any) -> None:
        super()._draw(robot, rng, asked)
        swapped = rng.random(self.wiring.shape[1]) < self.config.swap_probability
        self.wiring[robot] = np.where(swapped, -1.0, 1.0)

    def _wired(self, commands: Floats) -> Floats:
        return commands * self.wiring

    def _refractory_wires(self) -> Flags:
        return self._by_command(super()._refractory_wires())

    def _by_command(self, of_wires: NDArray[Any]) -> NDArray[Any]:
        """Values of wires + and -, shape (n_robots, n_limbs, 2), in the names that commands have for them."""
        return np.where(self.wiring[..., None] < 0.0, of_wires[..., ::-1], of_wires)

    def _observed_wires(self) -> Floats:
        wires = super()._observed_wires().reshape(*self.wiring.shape, -1)
        return self._by_command(wires).reshape(self.n_robots, -1)

    def _task_info(self, hub: Floats) -> dict[str, NDArray[Any]]:
        return {**super()._task_info(hub), "wiring": self.wiring.copy()}

    def scenery(self, robot: int) -> Scenery:
        """What pictures of a robot show besides its waypoints."""
        swapped = np.flatnonzero(self.wiring[robot] < 0.0) + 1
        return Scenery(note="wires swapped: " + (", ".join(map(str, swapped)) or "none"))
