"""Whole scenes with fluids, gravity and material damping, in their limits and against closed forms."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from seastar_gym import Numerics, Scene, Seastar, Simulator, SmaPulse, UniformCurrent, Water, relaxation_time

# Closed forms


@pytest.mark.parametrize("along", [0.0, 0.3, 1.2])
def test_a_robot_at_rest_drifts_until_it_moves_with_the_current(along):
    """Quadratic drag: 1 - v/u = 1/(1 + k u t). A stiff cross has half its length along the current, half across."""
    u, time = 0.1, 2.0
    robot = Seastar(n_limbs=4, nodes_per_limb=10, youngs_modulus=1e9, relaxation_time=0.0)
    scene = Scene(
        robot, Water(1000.0, 1.2, along, UniformCurrent(u, 0.0), 0.0),
        SmaPulse(0.0, 1.0, 1.0), Numerics("implicit-midpoint", 2e-3, newton_tolerance=1e-11),
    )  # fmt: skip
    simulator = Simulator(scene)
    simulator.stroke(np.zeros((1, 4)))
    k = 1000.0 * 0.5 * (along + 1.2) / (np.pi * 1.6e-3 * 1000.0)
    assert simulator.hub_velocity()[0, 0] == pytest.approx(u - u / (1.0 + k * u * time), rel=1e-4)


VACUUM = Water(0.0, 1.0, 1.0, UniformCurrent(), 1.0)
CLAMP = (0, 1)


def ring(water: Water, robot: Seastar, time: float) -> tuple[np.ndarray, np.ndarray]:
    """(times, deflections) of the tip of limb 1, clamped, after a sideways blow in its first mode, relative to L."""
    pauses = round(time / 1e-3)
    scene = Scene(
        robot, water, SmaPulse(0.0, time / 2.0, time / 2.0),
        Numerics("implicit-midpoint", 2.5e-4, newton_tolerance=1e-12), held_nodes=CLAMP,
    )  # fmt: skip
    simulator = Simulator(scene)
    edges = robot.nodes_per_limb - 1
    free = np.arange(1, edges + 1) / edges  # from the clamp at the hub
    simulator.v[0, 3 : 2 * edges + 2 : 2] = (1e-3 * free**2)[:, None]
    simulator.v[0, 3] = 0.0
    times, tips = [], []
    for t in simulator.stroke_in_parts(np.zeros((1, 5)), pauses):
        times.append(t)
        tips.append(simulator.positions[0, edges, 1] / robot.limb_length)
    return np.array(times), np.array(tips)


def frequency_and_decrement(times: np.ndarray, tips: np.ndarray) -> tuple[float, float]:
    """Frequency and logarithmic decrement of an oscillation, from a fit of exp(-delta t) (a cos + b sin)."""

    def misfit(unknowns):
        delta, omega, *_ = unknowns
        shapes = np.exp(-delta * times)[:, None] * np.stack([np.cos(omega * times), np.sin(omega * times)], axis=1)
        return shapes @ np.linalg.lstsq(shapes, tips, rcond=None)[0] - tips

    crossings = times[1:][np.diff(np.sign(tips)) != 0]
    guess = np.pi / np.diff(crossings).mean()
    delta, omega = least_squares(misfit, [1.0, guess], x_scale=[1.0, guess]).x
    return omega / (2.0 * np.pi), 2.0 * np.pi * delta / omega


@pytest.mark.parametrize("tau", [1e-3, 5e-3])
def test_the_decrement_of_a_damped_limb_is_that_of_kelvin_and_voigt(tau):
    """A mode of frequency omega has the damping ratio omega tau/2, and the decrement 2 pi z/sqrt(1 - z^2)."""
    plain = frequency_and_decrement(*ring(VACUUM, Seastar(relaxation_time=0.0), 1.0))[0]
    frequency, decrement = frequency_and_decrement(*ring(VACUUM, Seastar(relaxation_time=tau), 1.0))
    ratio = np.pi * plain * tau
    assert decrement == pytest.approx(2.0 * np.pi * ratio / np.sqrt(1.0 - ratio**2), rel=0.05)
    assert frequency == pytest.approx(plain * np.sqrt(1.0 - ratio**2), rel=0.01)
    assert relaxation_time(2.0 * np.pi * plain * tau, plain) == pytest.approx(tau)


def test_added_mass_lowers_the_frequency_as_a_heavier_limb_would():
    """omega falls with 1/sqrt(rho_m + C_a rho_f): no drag, so that nothing else is at work."""
    robot = Seastar(density=1200.0, relaxation_time=0.0)
    plain = frequency_and_decrement(*ring(VACUUM, robot, 1.0))[0]
    loaded = frequency_and_decrement(*ring(Water(900.0, 0.0, 0.0, UniformCurrent(), 0.7), robot, 1.0))[0]
    assert loaded / plain == pytest.approx(np.sqrt(1200.0 / (1200.0 + 0.7 * 900.0)), rel=2e-3)


STILL = Water(1000.0, 1.0, 0.1, UniformCurrent(), 1.0)
"""Water with drag along limbs and added mass of its own."""
