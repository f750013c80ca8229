"""Progress by where a robot would come to rest: a shaped reward for decisions that are short against a stroke.

A limb's power stroke pulls the hub ahead, and its way back pushes it astern again. Where decisions are shorter than a
stroke, the progress within a decision says little about either. `CoastingProgress` measures progress by where the hub
would come to rest without further commands, which is a linear function of the observation, fitted to random swims.
"""

from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.greedy import turned
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.reward import RewardWeights
from seastar_gym.envs.stations import heading_of
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator

Floats = NDArray[np.floating[Any]]

ROBOTS, DECISIONS = 512, 24
"""Size of the swims that the function is fitted to: robots, and decisions of each."""
SECONDS = 1.2
"""Time in which a robot comes to rest [s]."""
RIDGE = 1e-6
"""Weight of the squared coefficients in the fit, relative to the mean square of the scaled features."""


class Coasting(NamedTuple):
    """Displacement of the hub until rest, in the body frame, as a linear function of what is observed of the robot.

    layout: Of the observations. coefficients: Shape (k + 1, 2), the constant last [limb lengths].
    """

    layout: Layout
    coefficients: Floats

    def __call__(self, observations: Floats) -> Floats:
        """Displacements [limb lengths], shape (n, 2), for observations of shape (n, size)."""
        robot = observations[:, : self.layout.waypoints.start]
        return np.asarray(robot @ self.coefficients[:-1] + self.coefficients[-1])


def fit_coasting(scene: Scene, decision_period: float | None, rng: np.random.Generator) -> Coasting:
    """Fit the function to random swims of pairs of limbs with rests in between.

    decision_period: Time between decisions [s]. None means a stroke.
    """
    env = SeastarSwimVectorEnv(ROBOTS, actions="pairs", scene=scene, decision_period=decision_period)
    env.reset(seed=0)
    twins, layout = Simulator(scene, ROBOTS), Layout.of(scene)
    n_commands = len(command_table("pairs", scene.robot.n_limbs))
    seen, ways = [], []
    for _ in range(DECISIONS):
        observations, *_ = env.step(rng.integers(n_commands, size=ROBOTS) * (rng.random(ROBOTS) < 0.5))
        simulator = env.simulator
        twins.set_state(simulator.get_state())
        twins.advance(SECONDS)
        heading = heading_of(simulator)
        seen.append(observations[:, : layout.waypoints.start].astype(np.float64))
        ways.append(turned(twins.hub_position() - simulator.hub_position(), -heading) / scene.robot.limb_length)
    env.close()
    return Coasting(layout, _ridge(np.concatenate(seen), np.concatenate(ways)))


def _ridge(x: Floats, y: Floats) -> Floats:
    """Coefficients, shape (k + 1, m), of the linear function with a constant of x, (n, k), that comes closest to y."""
    x = np.append(x, np.ones((len(x), 1)), axis=1)
    scale = np.sqrt(np.mean(x**2, axis=0))
    scale[scale == 0.0] = 1.0
    scaled = x / scale
    normal = scaled.T @ scaled / len(x) + RIDGE * np.eye(x.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ y / len(x)) / scale[:, None])


def with_coasting(batch: gym.vector.VectorEnv[Any, Any, Any], weights: RewardWeights) -> "CoastingProgress":
    """A batch whose reward counts coasting, fitted to its scene and its time between decisions."""
    inner: Any = batch.unwrapped
    return CoastingProgress(batch, fit_coasting(inner.scene, inner.decision_period, np.random.default_rng(0)), weights)


class CoastingProgress(gym.vector.VectorWrapper):
    """Batch in autoreset mode SAME_STEP whose reward for progress counts the way that the hub would coast.

    The step that ends an episode has the environment's own reward, so that a swim through the last waypoint is not
    charged for the way that it does not go on. weights: Those of the environment's reward, whose waypoints have the
    radius WAYPOINT_RADIUS.
    """

    env: Any

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], coasting: Coasting, weights: RewardWeights):
        super().__init__(env)
        self.coasting, self.weights = coasting, weights
        self._gain: Floats = np.zeros(env.num_envs)

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, info = self.env.reset(**arguments)
        self._gain = self.gain(self._true(observations))
        return observations, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One decision of every robot."""
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        gain = self.gain(self._true(observations))
        more = np.where(terminated | truncated, 0.0, gain - self._gain)
        self._gain = gain
        return observations, rewards + self.weights.progress * more, terminated, truncated, info

    def _true(self, observations: Floats) -> Floats:
        """What would be observed of robots that are seen as they are, see `privileged_observations`."""
        batch = self.env.unwrapped
        return observations if batch.layout == self.coasting.layout else batch.privileged_observations()

    def gain(self, observations: Floats) -> Floats:
        """Way to go that coasting would save [m], shape (n_robots,)."""
        layout, length = self.coasting.layout, self.env.unwrapped.scene.robot.limb_length
        current, following = (observations[:, at] * length for at in (layout.current_waypoint, layout.next_waypoint))
        here, there = (
            self.weights.way_to_next(place, current, following, WAYPOINT_RADIUS)
            for place in (np.zeros_like(current), length * self.coasting(observations))
        )
        return np.asarray(here - there)
