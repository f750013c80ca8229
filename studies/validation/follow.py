"""A swimmer whose limbs follow their curves whatever the load, so that only its forward speed is unknown.

It is some twenty times cheaper than the simulator, and laws of drag that the package does not have are one line each.
With the momentum m U + P of robot and carried water, where P is that of limbs which bend at a frame at rest,

    d(m U + P)/dt = -drag,

with the drag and added mass per length of a strip's elements, explicit steps, and limbs mirrored left to right.
"""

from typing import NamedTuple

import numpy as np

from studies.frame import Floats
from studies.validation.priors import SWEEPS
from studies.validation.speeds import Condition
from studies.validation.swimmer import ELASTOMER, FIRST, FRAME, LIQUID_METAL, STROKES, TYPICAL, WATER, How, bending

LIMBS, ELEMENTS, STEPS = 4, 8, 250
"""Limbs, elements of one, and steps of a period."""
SMOOTH = 6e-3
"""Standard deviation of the window that rounds corners of the curves [s]."""
VISCOSITY = 1e-6
"""Kinematic viscosity of water [m^2/s]."""
BODY = 0.05
"""Speed at which the frame's drag of another power has the samples' coefficient [m/s]."""


class Law(NamedTuple):
    """What limbs do, and how the water acts on them.

    bending, lag: As of `swimmer.Variant`. frame: Power of the speed to which the frame's drag goes.
    reynolds: Reynolds number at which drag across a limb is twice that of fast flow.
    keulegan: Power of the change of curvature to which drag across limbs goes.
    wake: Speed of the water behind a limb over that of the limb, which it takes on while the limb moves its width.
    """

    bending: How = "measured"
    lag: float = 0.0
    frame: float = 2.0
    reynolds: float = 0.0
    keulegan: float = 0.0
    wake: float = 0.0


LAWS = {
    "limbs follow the fits": Law("fitted"),
    "limbs follow the measured curves": Law(),
    "that, straightening in 80 ms": Law("80 ms"),
    "that, rear pair half a period later": Law(lag=0.5),
    "that, laminar drag of the frame: v^1.5": Law(frame=1.5),
    "that, drag across limbs by 1 + 30/Re": Law(reynolds=30.0),
    "that, drag across limbs by dk^(-1/3), as of sharp edges": Law(keulegan=-1.0 / 3.0),
    "that, limbs in the wake of their own stroke": Law(wake=0.5),
}
"""Laws by their names in the page; "that" has the measured curves."""


def speeds(conditions: list[Condition], values: dict[str, Floats], law: Law) -> Floats:
    """Mean speeds of strokes 5 to 8 [m/s], shape (n_samples, n_conditions)."""
    return np.stack([Swimmers(values, law, condition).speeds() for condition in conditions], axis=1)


class Swimmers:
    """Samples of the unknowns in one condition; arrays of limbs have the shape (n_samples, ELEMENTS)."""

    def __init__(self, values: dict[str, Floats], law: Law, condition: Condition):
        self.law, self.width, self.dt = law, values["limb width"][:, None], 1.0 / (condition.frequency * STEPS)
        self.k, self.rate = rounded(condition, law.bending, self.dt)
        self.root = 0.5 * np.pi + np.resize(SWEEPS, len(self.width))[:, None]
        self.length = values["limb length"][:, None] / ELEMENTS
        self.place = self.length * (np.arange(ELEMENTS) + 0.5)
        density = ELASTOMER + (LIQUID_METAL - ELASTOMER) * 0.01 * condition.liquid_metal
        self.mass = density * self.length * self.width * values["limb thickness"][:, None]
        self.added = values["added mass"][:, None] * 0.25 * np.pi * self.width**2 * WATER * self.length
        self.frame_mass, self.frame_coefficient = values["body mass"], values["body drag"]
        across = 0.5 * WATER * self.width * self.length * values["limb drag across"][:, None]
        self.across = across * (np.ptp(self.k) / TYPICAL) ** law.keulegan
        self.along = self.across * values["limb drag along"][:, None]

    def speeds(self) -> Floats:
        """Mean forward speeds of strokes 5 to 8 [m/s], shape (n_samples,)."""
        turns = sorted({0, round(self.law.lag * STEPS)})
        U, way, momentum = np.zeros((3, len(self.width)))
        flows = np.zeros((len(turns), len(self.width), ELEMENTS))
        for step in range(STROKES * STEPS):
            drag, mass, own = self.frame_drag(U), self.frame_mass, np.zeros_like(U)
            for flow, at in zip(flows, (step - turn for turn in turns), strict=True):
                k, rate = (self.k[at % STEPS], self.rate[at % STEPS]) if at >= 0 else (self.k[0], 0.0)
                more = self.limbs(LIMBS / len(turns), k, rate, U, flow)
                drag, mass, own = drag + more[0], mass + more[1], own + more[2]
            momentum -= drag * self.dt
            U = (momentum - own) / mass
            way += U * (step >= FIRST * STEPS)
        return way / ((STROKES - FIRST) * STEPS)

    def frame_drag(self, U: Floats) -> Floats:
        """Drag of the frame [N] at speeds U [m/s]."""
        area = 0.5 * WATER * FRAME[1] * FRAME[2] * self.frame_coefficient
        return np.asarray(area * BODY ** (2.0 - self.law.frame) * np.abs(U) ** (self.law.frame - 1.0) * U)

    def limbs(self, count: float, k: float, rate: float, U: Floats, flow: Floats) -> tuple[Floats, Floats, Floats]:
        """Drag of limbs [N], their mass with the water's along x [kg], and their momentum at U = 0 [kg m/s].

        k, rate: Curvature [1/m] and its rate. flow: Velocity of the water across the elements, which is moved on [m/s].
        """
        angle = self.root + k * self.place
        tx, ty = np.cos(angle), np.sin(angle)
        turning = rate * self.place * self.length
        x, y = (np.cumsum(turning * part, axis=1) - 0.5 * turning * part for part in (-ty, tx))
        normal, ahead = y * tx - x * ty, U[:, None] + x
        across = y * tx - ahead * ty - flow
        push = (self.across - self.along) * np.abs(across) * across
        if self.law.reynolds:
            push *= 1.0 + self.law.reynolds * VISCOSITY / (np.abs(across) * self.width + VISCOSITY)
        if self.law.wake:
            flow += (self.law.wake * (across + flow) - flow) * np.minimum(1.0, np.abs(across) * self.dt / self.width)
        mass, momentum = self.mass + self.added * ty**2, self.mass * x - self.added * normal * ty
        drag, mass, momentum = (
            count * of_one.sum(axis=1)
            for of_one in (self.along * ahead * np.hypot(ahead, y) - push * ty, mass, momentum)
        )
        return drag, mass, momentum


def rounded(condition: Condition, how: How, dt: float) -> tuple[Floats, Floats]:
    """Curvatures [1/m] and their rates [1/(m s)] at the steps of a period."""
    wave = np.fft.rfft(np.interp(np.arange(STEPS) * dt, *bending(condition, how)))
    turns = np.fft.rfftfreq(STEPS, dt)
    wave *= np.exp(-0.5 * (2.0 * np.pi * turns * SMOOTH) ** 2)
    return np.fft.irfft(wave, STEPS), np.fft.irfft(2j * np.pi * turns * wave, STEPS)
