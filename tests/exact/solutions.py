"""Exact solutions for rods, beams and drag, computed without the simulator, and robots that nothing drives."""

from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

from seastar_gym import SmaPulse

CANTILEVER_ROOTS = np.array([1.8751040687119611, 4.6940911329741745, 7.8547574382376126])
"""First three wavenumbers beta_n L of a clamped-free beam: roots of cos(x) cosh(x) = -1."""


def stiffness(robot):
    """Bending stiffness EI [N m^2] of a limb, with I = pi r_0^4 / 4, and its stretching stiffness EA [N]."""
    EA = robot.youngs_modulus * np.pi * robot.rod_radius**2
    return 0.25 * EA * robot.rod_radius**2, EA


def elastica_tip(load, EI, length, EA=np.inf):
    """Tip (x, y) [m] of a rod clamped along +x at the origin under a dead tip load in +y [N].

    EI theta'' = -(1 + epsilon) P cos(theta) with the strain epsilon = P sin(theta) / EA; EA infinite is the classical,
    inextensible elastica. Integrated from the tip, whose angle is found by bisection, to the clamp, where theta = 0.
    """
    k, strain = load * length**2 / EI, load / EA

    def slopes(_, state):
        theta, kappa = state[:2]
        stretch = 1.0 + strain * np.sin(theta)
        return [kappa, -k * stretch * np.cos(theta), stretch * np.cos(theta), stretch * np.sin(theta)]

    def at_clamp(tip_angle):
        """State at the clamp: theta, kappa L, and minus the tip's (x, y) / L."""
        return solve_ivp(slopes, (1.0, 0.0), [tip_angle, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]

    tip_angle = brentq(lambda angle: at_clamp(angle)[0], 0.0, 0.5 * np.pi, xtol=1e-14)
    return -length * at_clamp(tip_angle)[2:]


def beam_constant(robot):
    """Constant sqrt(EI / (rho_m A)) [m^2/s] of a limb: a bending wave of wavenumber k has omega = k^2 times this."""
    return np.sqrt(robot.youngs_modulus * robot.rod_radius**2 / (4.0 * robot.density))


def cantilever_frequencies(robot):
    """First three natural frequencies [Hz] of a limb as a clamped-free Euler-Bernoulli beam."""
    return (CANTILEVER_ROOTS / robot.limb_length) ** 2 * beam_constant(robot) / (2.0 * np.pi)


def cantilever_shape(root, s):
    """Mode shape of a clamped-free beam, 1 at the tip. root: beta_n L. s: From the clamp (0) to the tip (1)."""
    ratio = (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))

    def shape(x):
        return np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x))

    return shape(root * np.asarray(s)) / shape(root)


def fitted_frequency(time, signal, guess):
    """Frequency [Hz], within 30 % of a guess, of the sinusoid that fits samples of a signal at times [s] best."""

    def misfit(frequency):
        phase = 2.0 * np.pi * frequency * time
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        rest = signal - waves @ np.linalg.lstsq(waves, signal)[0]
        return rest @ rest

    # Local minima lie about 1 / duration apart: a grid finds the deepest one, then a bounded search its bottom.
    width = 0.25 / (time[-1] - time[0])
    coarse = np.arange(0.7 * guess, 1.3 * guess, width)
    valley = coarse[np.argmin([misfit(frequency) for frequency in coarse])]
    bounds = valley - width, valley + width
    return minimize_scalar(misfit, bounds=bounds, method="bounded", options={"xatol": 1e-10}).x


def falling_speed(k, acceleration, time):
    """Speed [m/s] after a time [s] from rest under an acceleration [m/s^2] of dv/dt = a - k v^2."""
    terminal = np.sqrt(acceleration / k)
    return terminal * np.tanh(acceleration * time / terminal)


def coasting(k, speed, time):
    """(speed [m/s], distance [m]) after coasting for a time [s] from an initial speed [m/s]."""
    return np.array([speed / (1.0 + k * speed * time), np.log1p(k * speed * time) / k])


def published_swim():
    """Times [s] and hub x [m] of two published codes: every 0.1 s of ten strokes, h = 10 ms, Newton to 1e-8."""
    file = Path(__file__).parents[1] / "data" / "straight_turning_hub_10ms.csv"
    return np.genfromtxt(file, delimiter=",", names=True, skip_header=4, unpack=True)


def pause(duration):
    """Actuator that stays at rest, so that a stroke simulates a duration [s] without actuation."""
    return SmaPulse(0.0, heating_time=0.5 * duration, cooling_time=0.5 * duration)


def let_pass(simulator):
    """Simulate one stroke without commands."""
    report = simulator.stroke(np.zeros((simulator.n_robots, simulator.scene.robot.n_limbs)))
    assert not report.status.any()
