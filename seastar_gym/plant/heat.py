"""`Heat`: how hot wires can be by now, and which of them may be heated.

A wire's rise above the water tends to the steady rise while it is heated and to zero while it cools, see `ThermalSma`;
latent heat, which would keep it cooler, is left out. Where numbers differ from robot to robot, the hottest wire counts:
it heats with the smallest time constant and cools with the largest.
"""

import math
import time

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.actuators.thermal import ThermalSma

LATENESS = 0.03
"""By how much lines to a plant may be late [s]: so much sooner may pulses follow each other there than here."""
OVERTIME = 0.005
"""By how much a pulse may be too long before it is turned off [s]."""
LONGEST_STEP = 0.1
"""Longest time between two looks that is believed [s], unless this computer's clock says that it has passed."""
START = 0.5
"""Time that whoever heats or asks takes to start at least [s], for which wires of earlier drives have cooled."""
WIRE = ThermalSma()
"""Whose numbers wires have unless somebody says others."""
ROUNDING = 1e-9


class Heat:
    """Heat of the wires + and - of every limb, shape (n_limbs, 2), and the limits of `Limits`.

    wire: Whose thermal numbers wires have. margin: By how much pulses may follow each other sooner [s] where they heat
    than they do here. A wire is taken to cool no sooner than so long after its pulse.

    The clock of heat is that of the plant, but it stands still where that goes back, or on by more than `LONGEST_STEP`
    and than this computer's clock: no jump is a rest.
    """

    def __init__(
        self,
        n_limbs: int,
        wire: ThermalSma,
        *,
        hottest: float,
        longest_pulse: float,
        shortest_rest: float,
        antagonists: bool,
        margin: float = 0.0,
    ):
        self._steady = float(np.max(wire.steady_rise))
        self._water = float(np.max(wire.water_temperature))
        self._heats, self._cools = float(np.min(wire.time_constant)), float(np.max(wire.time_constant))
        self._hottest, self._longest, self._shortest_rest = hottest, longest_pulse, shortest_rest
        self._antagonists, self._margin = antagonists, margin
        self._rise = np.full((n_limbs, 2), min(hottest - self._water, self._steady) * math.exp(-START / self._cools))
        self._left, self._rested = np.zeros((n_limbs, 2)), np.full((n_limbs, 2), shortest_rest)
        self._clock, self._wall, self._passed = math.nan, time.monotonic(), 0.0

    def tick(self, now: float) -> None:
        """Say the time of the plant's clock [s]."""
        wall = time.monotonic()
        step = now - self._clock
        if step > LONGEST_STEP:
            step = min(step, wall - self._wall)
        self._passed += step if step > 0.0 else 0.0  # nothing, where a clock says no number
        self._clock, self._wall = now, wall

    def _settle(self) -> None:
        """Let the time pass that has gone by."""
        passed, self._passed = self._passed, 0.0
        if not passed:
            return
        heated = np.minimum(self._left, passed)
        self._rise = self._after(heated)
        before = np.where(heated > 0.0, 0.0, self._rested)
        self._left, self._rested = self._left - heated, before + passed - heated
        cooled = np.maximum(self._rested - self._margin, 0.0) - np.maximum(before - self._margin, 0.0)
        self._rise *= np.exp(-cooled / self._cools)

    def _after(self, seconds: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Rises of wires that are heated for so long from now on [K]."""
        return self._steady + (self._rise - self._steady) * np.exp(-np.asarray(seconds) / self._heats)

    def hottest_after(self, seconds: float) -> NDArray[np.float64]:
        """Temperatures that pulses of this length would reach now [deg C], shape (n_limbs, 2)."""
        self._settle()
        return self._water + self._after(seconds + OVERTIME if seconds else 0.0)

    def from_cold(self, seconds: float) -> float:
        """Temperature that a pulse of this length reaches in a cold wire [deg C]."""
        return self._water - self._steady * math.expm1(-(seconds + OVERTIME) / self._heats)

    def _within(self, seconds: float) -> NDArray[np.bool_]:
        """Wires that are heated, or were so long ago or less."""
        return (self._left > ROUNDING) | (self._rested < seconds - ROUNDING)

    def _restless(self) -> NDArray[np.bool_]:
        return self._within(self._shortest_rest)

    def _opposed(self) -> NDArray[np.bool_]:
        """Wires whose antagonist is heated, or was just now."""
        return self._within(self._margin)[:, ::-1] & (not self._antagonists)

    def resting(self, seconds: float) -> NDArray[np.bool_]:
        """Wires that may not be heated for so long now, shape (n_limbs, 2)."""
        too_hot = self.hottest_after(seconds) > self._hottest + ROUNDING
        return np.asarray(too_hot | self._restless() | self._opposed())

    def refusal(self, wires: NDArray[np.bool_], seconds: float) -> str | None:
        """Why wires in a mask of shape (n_limbs, 2) may not be heated for so long, without a stop; None if they may."""
        if not 0.0 <= seconds <= self._longest * (1.0 + ROUNDING):
            return f"A pulse must be from 0 to {self._longest:g} s, not {seconds:.3g} s"
        reached = self.hottest_after(seconds)[wires].max(initial=-np.inf)
        if (wires & self._restless()).any():
            return f"A wire was to be heated within {self._shortest_rest:g} s of its last pulse"
        if (wires & self._opposed()).any():
            return "Both wires of a limb were to be heated at once"
        if reached > self._hottest + ROUNDING:
            return f"A wire would be {reached:.0f} deg C hot, more than {self._hottest:g} deg C"
        return None

    def heat(self, wires: NDArray[np.bool_], seconds: float) -> None:
        """Wires in a mask of shape (n_limbs, 2) are heated for so long from now on."""
        if seconds > 0.0:
            self._settle()
            self._left[wires], self._rested[wires] = seconds, 0.0

    def stop(self) -> None:
        """No wire is heated any more."""
        self._settle()
        self._left[:] = 0.0
