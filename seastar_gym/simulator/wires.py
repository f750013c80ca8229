"""`SmaWires` of all robots in one compiled call, to the bits of its methods, which take forty calls of numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from seastar_gym.lanes.compile import entry_point
from seastar_gym.scene.actuators.base import SPENT
from seastar_gym.scene.actuators.wires import COLD, SmaWires

Floats = NDArray[np.float64]


@entry_point
def contract(t, commands, state, peaks, heating_time, cooling_time, refractory, spent, cold, turned, after, heated):
    """Fill rotations, states and times of heating, of the shapes that `contracted` returns.

    peaks: Peak angles [rad], shape (n_robots,), or (1,) for all robots. spent: Time left that is rounding [s]. cold:
    Contraction of a cold wire at most. Others: As of `SmaWires`.
    """
    n_times, duration = len(t), t[-1] - t[0]
    for robot in range(commands.shape[0]):
        peak = peaks[robot % len(peaks)]
        for limb in range(commands.shape[1]):
            before, command = state[robot, limb], commands[robot, limb]
            if refractory and (before[0] > cold or before[1] > cold or before[2] > 0.0 or before[3] > 0.0):
                command = 0.0
            heated[robot, limb] = 0.0
            for wire in range(2):
                start, left = before[wire], before[2 + wire]
                wanted = heating_time * (command if wire == 0 else -command)
                if wanted > 0.0 and not t[0] > 0.0:
                    left = wanted
                most = min(start + left / heating_time, 1.0)
                for k in range(n_times):
                    since = t[k] - t[0]
                    if since <= left or n_times == 1:
                        x = min(start + since / heating_time, 1.0)
                    else:
                        x = max((left + most * cooling_time - since) / cooling_time, 0.0)
                    turned[k, robot, limb] = x if wire == 0 else peak * (turned[k, robot, limb] - x)
                rest = left - duration
                after[robot, limb, wire], after[robot, limb, 2 + wire] = x, rest if rest > spent else 0.0
                heated[robot, limb] += min(left, duration)


def contracted(wires: SmaWires, t: Floats, commands: Floats, state: Floats) -> tuple[Floats, Floats, Floats]:
    """Rotations and states as of `SmaWires.respond`, and times of heating as of its `seconds_heated`.

    t: Shape (n_times,). commands: Shape (n_robots, n_limbs). state: Shape (n_robots, n_limbs, 4).
    """
    turned, after, heated = np.empty((len(t), *commands.shape)), np.empty(state.shape), np.empty(commands.shape)
    contract(
        t, commands, state, np.ravel(wires.peak_angle), wires.heating_time, wires.cooling_time, wires.refractory,
        SPENT * wires.heating_time, COLD, turned, after, heated,
    )  # fmt: skip
    return turned, after, heated
