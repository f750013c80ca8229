"""`State`: positions, velocities, time and actuators of all robots of a simulator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.checks import as_floats
from seastar_gym.simulator.body_frame import best_fit_heading

Floats = NDArray[np.float64]


class State(NamedTuple):
    """State of all robots of a simulator. Together with later commands it determines every later state.

    positions: Node positions [m], shape (n_robots, n_nodes, 2).
    velocities: Node velocities [m/s], shape (n_robots, n_nodes, 2).
    time: Simulated time [s], shape (n_robots,).
    actuators: State of every limb's actuator, shape (n_robots, n_limbs, n_state), where n_state is 0 for actuators
        without memory. `None` means at rest.
    commands: Commands under way, shape (n_robots, n_limbs). `None` means none.
    phase: Time since they were given [s], shape (n_robots,), 0 where none are under way. All robots that have commands
        under way share it. `None` means 0.
    orientation: Angle by which every robot's body has turned from rest [rad], shape (n_robots,). `None` means that of
        the rest shape that fits the nodes best; it is `None` without a body.
    spin: Its angular velocity [rad/s], shape (n_robots,). `None` means 0.
    """

    positions: Floats
    velocities: Floats
    time: Floats
    actuators: Floats | None = None
    commands: Floats | None = None
    phase: Floats | None = None
    orientation: Floats | None = None
    spin: Floats | None = None

    def of_robots(self, robots: NDArray[np.intp] | NDArray[np.bool_] | slice) -> State:
        """State of the chosen robots, in their order."""
        return State(*(None if part is None else part[robots] for part in self))  # type: ignore[arg-type]

    @classmethod
    def joined(cls, states: Sequence[State]) -> State:
        """States of the same kind of robots as one, in their order. A part that is `None` in one is `None` in all."""
        parts = zip(*states, strict=True)
        return cls(*(None if any(part is None for part in each) else np.concatenate(each) for each in parts))  # type: ignore[arg-type]


def checked_state(state: object, rest: Floats, actuators_at_rest: Floats, longest: float) -> list[Floats]:
    """Arrays of a state, at rest where it has None. ValueError if a shape or a number is wrong.

    rest: Node positions at rest [m], shape (n_nodes, 2), or those of every robot, shape (n_robots, n_nodes, 2).
    actuators_at_rest: Shape (n_robots, n_limbs, n_state). longest: Time for which commands may be under way [s].
    """
    if not isinstance(state, tuple | list) or not 3 <= len(state) <= len(State._fields):
        raise ValueError(f"A State of {', '.join(State._fields)} is needed, not {type(state).__name__}.")
    n_robots, n_limbs, _ = actuators_at_rest.shape
    nodes, each = (n_robots, *rest.shape[-2:]), np.zeros(n_robots)
    positions, velocities, time, actuators, commands, phase, orientation, spin = State(*state)
    arrays = [
        _checked_array("State.positions", positions, nodes),
        _checked_array("State.velocities", velocities, nodes),
        _checked_array("State.time", time, each.shape),
        _checked_array("State.actuators", actuators, actuators_at_rest.shape, actuators_at_rest),
        _checked_array("State.commands", commands, (n_robots, n_limbs), np.zeros((n_robots, n_limbs))),
        _checked_array("State.phase", phase, each.shape, each),
    ]
    _check_phase(arrays[-1], longest)
    fitting = best_fit_heading(arrays[0], rest)
    return [
        *arrays,
        _checked_array("State.orientation", orientation, each.shape, fitting),
        _checked_array("State.spin", spin, each.shape, each),
    ]


def _checked_array(name: str, value: object, wanted: tuple[int, ...], at_rest: Floats | None = None) -> Floats:
    array = as_floats(name, at_rest if value is None and at_rest is not None else value)
    if array.shape != wanted:
        raise ValueError(f"{name} must have shape {wanted}, not {array.shape}.")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite.")
    return array


def _check_phase(phase: Floats, longest: float) -> None:
    wrong = phase[(phase < 0.0) | (phase >= longest)]
    if len(wrong):
        raise ValueError(f"State.phase must be at least 0 and less than {longest:.4g} s, not {wrong[0]:.4g} s.")
    different = np.unique(phase[phase > 0.0])
    if len(different) > 1:
        raise ValueError(
            "State.phase must be one time for all robots that have commands under way, since they share time steps, "
            f"not {different[0]:.4g} s and {different[1]:.4g} s."
        )
