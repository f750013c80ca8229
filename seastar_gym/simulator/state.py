"""`State`: positions, velocities, time and actuators of all robots of a simulator."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import as_floats

Floats = NDArray[np.float64]


class State(NamedTuple):
    """State of all robots of a simulator. Together with later commands it determines every later state.

    positions: Node positions [m], shape (n_robots, n_nodes, 2).
    velocities: Node velocities [m/s], shape (n_robots, n_nodes, 2).
    time: Simulated time [s], shape (n_robots,).
    actuators: State of every limb's actuator, shape (n_robots, n_limbs, n_state), where n_state is 0 for actuators
        without memory. `None` means at rest.
    """

    positions: Floats
    velocities: Floats
    time: Floats
    actuators: Floats | None = None

    def of_robots(self, robots: NDArray[np.intp] | NDArray[np.bool_] | slice) -> "State":
        """State of the chosen robots, in their order."""
        return State(*(None if part is None else part[robots] for part in self))  # type: ignore[arg-type]


def checked_state(state: object, n_robots: int, n_nodes: int, actuators_at_rest: Floats) -> list[Floats]:
    """Arrays of a state, actuators at rest where it has None. ValueError if a shape is wrong or a number not finite."""
    if not isinstance(state, tuple | list) or len(state) not in (3, 4):
        raise ValueError(f"A State of {', '.join(State._fields)} is needed, not {type(state).__name__}.")
    state = State(*state)
    if state.actuators is None:
        state = state._replace(actuators=actuators_at_rest)
    shape = (n_robots, n_nodes, 2)
    shapes = (shape, shape, (n_robots,), actuators_at_rest.shape)
    arrays = []
    for name, value, wanted in zip(State._fields, state, shapes, strict=True):
        array = as_floats(f"State.{name}", value)
        if array.shape != wanted:
            raise ValueError(f"State.{name} must have shape {wanted}, not {array.shape}.")
        if not np.isfinite(array).all():
            raise ValueError(f"State.{name} must be finite.")
        arrays.append(array)
    return arrays
