"""How far a robot goes on without commands, until it is at rest: a linear function of its state, fitted to swims."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.greedy import turned
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.stations import body_heading
from seastar_gym.scene import Scene, Seastar
from seastar_gym.simulator import Simulator, State

Floats = NDArray[np.float64]

ROBOTS, DECISIONS = 512, 24
"""Size of the swims that the function is fitted to: robots, and decisions of each."""
SECONDS = 1.2
"""Time in which a robot comes to rest [s]."""
RIDGE = 1e-6
"""Weight of the squared coefficients in the fit, relative to the mean square of the scaled features."""


def features(states: State, robot: Seastar) -> tuple[Floats, Floats]:
    """Numbers of states in the body frame, shape (n, k), and headings [rad], shape (n,)."""
    heading = body_heading(states.positions, robot)
    c, s = np.cos(heading), np.sin(heading)
    to_body = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)
    from_hub = (states.positions - states.positions[:, :1])[:, 1:] @ to_body / robot.limb_length
    velocities = states.velocities @ to_body
    assert states.actuators is not None
    parts = (from_hub, velocities, states.actuators[..., :2], np.ones((len(heading), 1)))
    return np.concatenate([part.reshape(len(heading), -1) for part in parts], axis=1), heading


class Coasting(NamedTuple):
    """Displacement of the hub until rest, as a linear function of `features`.

    robot: Robot. coefficients: Shape (k, 2) [m]. explained: Share of the displacement's variance on other swims.
    """

    robot: Seastar
    coefficients: Floats
    explained: float

    def __call__(self, states: State) -> Floats:
        """Displacement in the world frame [m], shape (n, 2)."""
        numbers, heading = features(states, self.robot)
        return turned(numbers @ self.coefficients, heading)


def fit_coasting(scene: Scene, decision_period: float, rng: np.random.Generator) -> Coasting:
    """Fit the function to random swims of pairs of limbs with rests in between, and test it on a quarter of them."""
    simulator, coasting = Simulator(scene, ROBOTS), Simulator(scene, ROBOTS)
    commands = command_table("pairs", scene.robot.n_limbs)
    numbers, ways = [], []
    for _ in range(DECISIONS):
        chosen = rng.integers(len(commands), size=ROBOTS) * (rng.random(ROBOTS) < 0.5)
        simulator.advance(decision_period, commands[chosen])
        states = simulator.get_state()
        coasting.set_state(states)
        coasting.advance(SECONDS)
        each, heading = features(states, scene.robot)
        numbers.append(each)
        ways.append(turned(coasting.hub_position() - simulator.hub_position(), -heading))
    x, y = np.stack(numbers, axis=1), np.stack(ways, axis=1)
    known = ROBOTS * 3 // 4
    coefficients = ridge(x[:known].reshape(-1, x.shape[-1]), y[:known].reshape(-1, 2))
    missed = y[known:] - x[known:] @ coefficients
    return Coasting(scene.robot, coefficients, float(1.0 - np.mean(missed**2) / np.mean(y[known:] ** 2)))


def ridge(x: Floats, y: Floats) -> Floats:
    """Coefficients, shape (k, m), of the linear function of x, (n, k), that comes closest to y, (n, m)."""
    scale = np.sqrt(np.mean(x**2, axis=0))
    scale[scale == 0.0] = 1.0
    scaled = x / scale
    normal = scaled.T @ scaled / len(x) + RIDGE * np.eye(x.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ y / len(x)) / scale[:, None])
