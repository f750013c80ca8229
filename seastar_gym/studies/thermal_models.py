"""Whether more physics in the thermal actuator would bring it nearer to the pulse: `thermal --models`.

The wire of `actuation/thermal.py`, integrated in time, with what it leaves out: transformation that begins and ends
gently (the cosine of Liang and Rogers), latent heat, heat that natural convection takes away, and a shorter pulse. All
of a wire's numbers are fitted to the pulse anew, from many starts.

Latent heat over heat capacity is that of Flexinol, 5.78 cal/g over 0.20 cal/(g K) (Dynalloy, Technical Characteristics
of Flexinol Actuator Wires, F1140).
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.optimize import least_squares

from seastar_gym.actuation.sma import SmaPulse

Floats = NDArray[np.float64]

SAMPLES, SUBSTEPS, STROKES = 500, 8, 3
LATENT_HEAT = 5.78 / 0.20
"""Over the heat capacity [K]."""
CONVECTION_SCALE = 30.0
"""Warmth [K] at which natural convection, in proportion to its power of 5/4, takes what the linear law takes."""


class Model(NamedTuple):
    """gentle: Cosines for lines. latent: Latent heat over heat capacity [K]. convection: Power by which the loss of
    heat grows faster than the warmth. shortest: Pulse [s]."""

    gentle: bool = False
    latent: float = 0.0
    convection: float = 0.0
    shortest: float = 0.1


MODELS = {
    "as it is": Model(),
    "gentle": Model(gentle=True),
    "latent heat": Model(latent=LATENT_HEAT),
    "gentle, latent heat": Model(gentle=True, latent=LATENT_HEAT),
    "natural convection": Model(convection=0.25),
    "a shorter pulse": Model(shortest=0.04),
}


class Wire(NamedTuple):
    """time_constant [s], steady_rise [K], and above the water [K] M_f, and from there A_s - M_f, A_f - A_s, A_f - M_s;
    pulse: Heating time [s]."""

    time_constant: float
    steady_rise: float
    martensite_finish: float
    start_gap: float
    width: float
    finish_gap: float
    pulse: float


LOWEST = Wire(0.05, 50.0, 1.0, 2.0, 5.0, 2.0, 0.1)
HIGHEST = Wire(3.0, 3000.0, 40.0, 30.0, 80.0, 40.0, 0.1)


@numba.njit
def share(x: float, gentle: bool) -> float:
    """Of austenite, at the share x of the way from one transformation temperature to the other."""
    x = min(max(x, 0.0), 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * x) if gentle else x


@numba.njit
def slope(x: float, gentle: bool) -> float:
    """Its derivative."""
    if x <= 0.0 or x >= 1.0:
        return 0.0
    return 0.5 * np.pi * np.sin(np.pi * x) if gentle else 1.0


@numba.njit
def strokes(wire: Wire, model: Model, n: int) -> Floats:
    """Share of austenite in n full commands from cold water, shape (n, SAMPLES + 1)."""
    M_f = wire.martensite_finish
    A_s = M_f + wire.start_gap
    A_f = A_s + wire.width
    M_s = A_f - wire.finish_gap
    h = 1.0 / (SAMPLES * SUBSTEPS)
    warmth, austenite = 0.0, 0.0
    found = np.zeros((n, SAMPLES + 1))
    for stroke in range(n):
        found[stroke, 0] = austenite
        for k in range(SAMPLES * SUBSTEPS):
            heated = min(max((wire.pulse - k * h) / h, 0.0), 1.0)
            loss = warmth * (max(warmth, 0.0) / CONVECTION_SCALE) ** model.convection
            rate = (heated * wire.steady_rise - loss) / wire.time_constant
            up, down, capacity = (warmth - A_s) / (A_f - A_s), (warmth - M_f) / (M_s - M_f), 1.0
            if rate > 0.0 and share(up, model.gentle) >= austenite - 1e-6:
                capacity += model.latent * slope(up, model.gentle) / (A_f - A_s)
            if rate < 0.0 and share(down, model.gentle) <= austenite + 1e-6:
                capacity += model.latent * slope(down, model.gentle) / (M_s - M_f)
            warmth += rate * h / capacity
            austenite = max(austenite, share((warmth - A_s) / (A_f - A_s), model.gentle))
            austenite = min(austenite, share((warmth - M_f) / (M_s - M_f), model.gentle))
            if (k + 1) % SUBSTEPS == 0:
                found[stroke, (k + 1) // SUBSTEPS] = austenite
    return found


def misfit(wire: Wire, model: Model) -> Floats:
    """Of the first and the last stroke from the pulse, over the peak angle, shape (2, SAMPLES + 1)."""
    pulse = SmaPulse()
    found = strokes(wire, model, STROKES)
    return found[[0, -1]] - pulse.delta_psi(np.linspace(0.0, 1.0, SAMPLES + 1)) / pulse.peak_angle


def fit(model: Model, starts: int = 40) -> Wire:
    """The wire that comes nearest to the pulse, of fits from random starts."""
    low, high, rng = np.array(LOWEST), np.array(HIGHEST), np.random.default_rng(0)
    low[-1] = model.shortest
    free = high > low

    def wire_of(numbers: Floats) -> Wire:
        whole = low.copy()
        whole[free] = numbers
        return Wire(*whole)

    def distance(numbers: Floats) -> Floats:
        wire = wire_of(numbers)
        # M_s stays above M_f; where it would not, nothing is fitted.
        sound = wire.start_gap + wire.width - wire.finish_gap > 1.0
        return misfit(wire, model).ravel() if sound else np.ones(2 * (SAMPLES + 1))

    fits = [
        least_squares(
            distance, low[free] + rng.uniform(0.05, 0.95, free.sum()) * (high - low)[free],
            bounds=(low[free], high[free]), diff_step=1e-3, max_nfev=150,
        )
        for _ in range(starts)
    ]  # fmt: skip
    return wire_of(min(fits, key=lambda one: one.cost).x)


def as_table(starts: int = 40) -> Table:
    """How near every model comes."""
    table = Table(title="Distance from the pulse over the peak angle, root mean square")
    for header in (
        "wire",
        "first stroke",
        "later ones",
        "at most",
        "time constant [s]",
        "M_f, A_s, M_s, A_f over water",
    ):
        table.add_column(header, justify="left" if header == "wire" else "right")
    for name, model in MODELS.items():
        wire = fit(model, starts)
        rows = misfit(wire, model)
        A_s = wire.martensite_finish + wire.start_gap
        temperatures = (wire.martensite_finish, A_s, A_s + wire.width - wire.finish_gap, A_s + wire.width)
        table.add_row(
            name,
            *(f"{100 * np.sqrt(np.mean(row**2)):.1f} %" for row in rows),
            f"{100 * np.abs(rows).max():.0f} %",
            f"{wire.time_constant:.2f}",
            ", ".join(f"{one:.0f}" for one in temperatures) + " K",
        )
    return table
