"""Exact solutions for rods, beams and drag, computed without the simulator."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from seastar_gym.scene import Seastar, Water
from studies.frame import Floats


def bending_stiffness(robot: Seastar) -> float:
    """Bending stiffness EI [N m^2] of a limb, with I = pi r_0^4 / 4."""
    return robot.youngs_modulus * np.pi * robot.rod_radius**4 / 4.0


def stretching_stiffness(robot: Seastar) -> float:
    """Stretching stiffness EA [N] of a limb, with A = pi r_0^2."""
    return robot.youngs_modulus * np.pi * robot.rod_radius**2


def elastica_tip(load: float, EI: float, length: float, EA: float = np.inf) -> Floats:
    """Tip (x, y) [m] of a rod clamped along +x at the origin under a dead tip load in +y [N].

    EI theta'' = -(1 + epsilon) P cos(theta) with the strain epsilon = P sin(theta) / EA; EA infinite is the classical,
    inextensible elastica. Integrated from the tip, whose angle is found by bisection, to the clamp, where theta = 0.
    """
    k, strain = load * length**2 / EI, load / EA

    def slopes(_: float, state: Floats) -> list[float]:
        theta, kappa = state[:2]
        stretch = 1.0 + strain * np.sin(theta)
        return [kappa, -k * stretch * np.cos(theta), stretch * np.cos(theta), stretch * np.sin(theta)]

    def at_clamp(tip_angle: float) -> Floats:
        """State at the clamp: theta, kappa L, and minus the tip's (x, y) / L."""
        solution = solve_ivp(slopes, (1.0, 0.0), [tip_angle, 0, 0, 0], method="DOP853", rtol=1e-12, atol=1e-14)
        end: Floats = solution.y[:, -1]
        return end

    tip_angle = brentq(lambda angle: at_clamp(angle)[0], 0.0, 0.5 * np.pi, xtol=1e-14)
    return -length * at_clamp(tip_angle)[2:]


CANTILEVER_ROOTS = np.array([1.8751040687119611, 4.6940911329741745, 7.8547574382376126])
"""First three wavenumbers beta_n L of a clamped-free beam: roots of cos(x) cosh(x) = -1."""


def beam_constant(robot: Seastar) -> float:
    """Constant sqrt(EI / (rho_m A)) [m^2/s] of a limb: a bending wave of wavenumber k has omega = k^2 times this."""
    return float(np.sqrt(robot.youngs_modulus * robot.rod_radius**2 / (4.0 * robot.density)))


def cantilever_frequencies(robot: Seastar, length: float) -> Floats:
    """First three natural frequencies [Hz] of a clamped-free Euler-Bernoulli beam; length: Its length [m]."""
    frequencies: Floats = (CANTILEVER_ROOTS / length) ** 2 * beam_constant(robot) / (2.0 * np.pi)
    return frequencies


def cantilever_shape(root: float, s: ArrayLike) -> Floats:
    """Mode shape of a clamped-free beam, scaled to 1 at the tip.

    root: Wavenumber beta_n L of the mode. s: Positions from the clamp (0) to the tip (1).
    """
    ratio = (np.cosh(root) + np.cos(root)) / (np.sinh(root) + np.sin(root))

    def shape(x: Floats) -> Floats:
        return np.asarray(np.cosh(x) - np.cos(x) - ratio * (np.sinh(x) - np.sin(x)))

    return shape(root * np.asarray(s, float)) / shape(np.asarray(root))


def drag_over_mass(robot: Seastar, fluid: Water) -> float:
    """Constant k [1/m] of dv/dt = a - k |v| v for a robot that only translates, the same for every node (13.8)."""
    return fluid.density * fluid.drag_coefficient / (np.pi * robot.rod_radius * robot.density)


def falling_speed(k: float, acceleration: float, time: float) -> float:
    """Speed [m/s] after a time [s] from rest under an acceleration [m/s^2]."""
    terminal = np.sqrt(acceleration / k)
    return float(terminal * np.tanh(acceleration * time / terminal))


def coasting(k: float, speed: float, time: float) -> Floats:
    """(speed [m/s], distance [m]) after coasting for a time [s] from an initial speed [m/s]."""
    return np.array([speed / (1.0 + k * speed * time), np.log1p(k * speed * time) / k])
