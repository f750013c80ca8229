"""Frequencies of a robot, and whether decisions drive them.

Limbs that damp nothing ring. Decisions in a rhythm drive modes near a multiple of their frequency, which time steps
misplace: a step of length h gives a mode of frequency f the frequency atan(pi f h) / (pi h), and a resonance that is
swum on its other side makes another swim (docs/numerics.md, "Resonance").
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene import Numerics, Scene
from seastar_gym.scene.checks import require_kind, require_number
from seastar_gym.simulator import Simulator

Floats = NDArray[np.float64]

STEP, SECONDS, ROBOTS = 1e-3, 4.0, 4
"""Time step, and length of a swim, whose spectrum has the frequencies [s]; robots that are kicked differently."""
KICK = 1e-3
"""Velocity of tips [limb lengths per second], at which drag is nothing beside elastic forces."""
BENDS = 4
"""Half waves along limbs that kicks have, from none on."""
FAINTEST = 1e-6
"""Peaks of less power than this share of the largest are no modes of the limbs' bending that a swim shows."""
NEAR, MOST = 0.03, 10
"""Largest distance of a mode from a multiple of the decisions' frequency, as its share, and the largest multiple."""
DAMPED = 0.1
"""Loss factor from which on a mode does not resonate."""


def natural_frequencies(scene: Scene) -> list[float]:
    """Frequencies [Hz] of the robot's bending at rest, as its own mesh has them, from the lowest on.

    They are peaks of the spectrum of small oscillations of undamped limbs, which are simulated for four seconds.

    >>> [round(f, 1) for f in natural_frequencies(Scene())][:2]
    [1.5, 6.2]
    """
    require_kind("scene", scene, Scene, "a Scene")
    one = scene if scene.n_robots is None else scene.of_robot(0)
    own = one.numerics if one.numerics.scheme == "implicit-midpoint" else Numerics("implicit-midpoint")
    return list(_frequencies(replace(one, numerics=replace(own, step=STEP, newton_tolerance=1e-9))))


@lru_cache(32)
def _frequencies(scene: Scene) -> tuple[float, ...]:
    """Peaks of the spectrum of all nodes, between the second line and half of the samples' frequency [Hz]."""
    swum = np.array(list(_ringing(scene)))
    window = np.hanning(len(swum))[:, None, None, None]
    power = (np.abs(np.fft.rfft(window * (swum - swum.mean(axis=0)), axis=0)) ** 2).sum(axis=(1, 2, 3))
    lines = np.arange(3, len(power) - 1)
    peaks = lines[(power[lines] > power[lines - 1]) & (power[lines] >= power[lines + 1])]
    peaks = peaks[power[peaks] > FAINTEST * power[3:].max(initial=0.0)]
    below, at, above = (np.log(power[peaks + k]) for k in (-1, 0, 1))
    slow = (peaks + 0.5 * (below - above) / (below - 2.0 * at + above)) / (len(swum) * STEP)
    return tuple(float(f) for f in np.tan(np.pi * slow * STEP) / (np.pi * STEP))  # as without time steps


def _ringing(scene: Scene) -> Iterator[Floats]:
    """Positions of all nodes from the hub [limb lengths], shape (ROBOTS, n_nodes, 2), after every step of a kick."""
    robot, fluid = replace(scene.robot, relaxation_time=None), scene.fluid
    still = replace(scene, robot=robot, fluid=fluid and replace(fluid, current=None), gravity=(0.0, 0.0))
    simulator, length = Simulator(still, ROBOTS, threads=1), float(np.max(robot.limb_length))
    state, rng = simulator.get_state(), np.random.default_rng(0)
    out = (simulator.positions - simulator.hub_position()[:, None]) / length
    angle, along = np.arctan2(out[..., 1], out[..., 0]), np.linalg.norm(out, axis=-1)
    strength = np.zeros(angle.shape)
    for around, bend in itertools.product(range(robot.n_limbs // 2 + 1), range(BENDS)):
        size, *phases = rng.uniform(0.5, 1.0, (3, ROBOTS, 1)) * np.array([1.0, 2.0 * np.pi, 2.0 * np.pi])[:, None, None]
        strength += size * np.cos(around * angle + phases[0]) * np.cos(np.pi * bend * along + phases[1])
    across = np.stack([-out[..., 1], out[..., 0]], axis=-1)
    simulator.set_state(state._replace(velocities=KICK * length * strength[..., None] * across))
    for _ in range(round(SECONDS / STEP)):
        simulator.advance(STEP)
        yield (simulator.positions - simulator.hub_position()[:, None]) / length


def resonances(scene: Scene, decision_period: float) -> list[dict[str, float]]:
    """Modes that decisions drive: their frequency [Hz], and the multiple of the decisions' frequency that is near.

    None where limbs damp them. decision_period: Time between decisions [s].
    """
    require_kind("scene", scene, Scene, "a Scene")
    require_number("decision_period", decision_period, "s")
    relaxation_time = 0.0 if scene.robot.relaxation_time is None else float(np.min(scene.robot.relaxation_time))
    found = []
    for frequency in natural_frequencies(scene):
        multiple = round(min(frequency * decision_period, MOST + 1.0))
        near = 1 <= multiple <= MOST and abs(frequency * decision_period / multiple - 1.0) <= NEAR
        if near and 2.0 * math.pi * frequency * relaxation_time < DAMPED:
            found.append({"frequency": float(f"{frequency:.4g}"), "multiple": multiple})
    return found


def told(resonances: Sequence[Mapping[str, float]], decision_period: float) -> str:
    """Sentence about some resonances; empty for none."""
    modes = [f"{each['frequency']:.4g} Hz (near {each['multiple'] / decision_period:.4g} Hz)" for each in resonances]
    return f"Decisions every {decision_period:g} s drive its modes at {', '.join(modes)}." if modes else ""
