"""Difference between the thermal actuator and the pulse of Fig. 13.5b.

Fits the actuator's time constant, steady temperature rise and transformation temperatures to the pulse, over the first
stroke from cold water and the third one, prints the fit and the defaults, and draws both strokes and the hysteresis
loop of the defaults into `thermal.png`.

A richer model gains little. With latent heat, a smooth transformation, natural convection or a shorter pulse, fitted in
the same way, the root mean square difference was 5.3 % at best; with this model it is 6 to 7 %.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from seastar_gym.files import save_figure
from seastar_gym.scene.actuators.pulse import SmaPulse
from seastar_gym.scene.actuators.thermal import ThermalSma
from studies.frame import Floats, Results, Study
from studies.style import subplots

TIMES = np.linspace(0.0, 1.0, 501)
"""Times of the samples in a stroke [s]."""
STROKES = 3
HOTTEST = 70.0
"""Upper bound of the austenite finish temperature in the fit [deg C]; a higher bound gains almost nothing."""


def strokes(actuator: ThermalSma, n: int = STROKES) -> tuple[Floats, Floats]:
    """(rotation / peak angle, temperature [deg C]) in n strokes of command 1 from rest, shape (n, len(TIMES)) each."""
    state, turned, temperature = actuator.rest, [], []
    for _ in range(n):
        before = state
        angle, state = actuator.respond(TIMES, np.ones(()), before)
        turned.append(angle / actuator.peak_angle)
        temperature.append([actuator.respond(TIMES[: k + 1], np.ones(()), before)[1][0] for k in range(len(TIMES))])
    return np.array(turned), np.array(temperature)


def misfit(actuator: ThermalSma) -> Floats:
    """Difference of the first and last stroke from the pulse, over the peak angle, shape (2, len(TIMES))."""
    state, turned = actuator.rest, []
    for _ in range(STROKES):
        angle, state = actuator.respond(TIMES, np.ones(()), state)
        turned.append(angle / actuator.peak_angle)
    return np.array([turned[0], turned[-1]]) - SmaPulse().delta_psi(TIMES) / SmaPulse().peak_angle


def fit() -> ThermalSma:
    """Least-squares fit of the actuator to the pulse, with M_f and M_s at least 2 K below A_s and A_f."""

    def actuator_of(p: Floats) -> ThermalSma:
        tau, rise, A_s, A_f, below_start, below_finish = map(float, p)
        return replace(
            ThermalSma(), time_constant=tau, steady_rise=rise, austenite_start=A_s, austenite_finish=A_f,
            martensite_finish=A_s - below_start, martensite_start=A_f - below_finish,
        )  # fmt: skip

    bounds = ([0.05, 50.0, 22.0, 40.0, 2.0, 2.0], [3.0, 3000.0, 35.0, HOTTEST, 2.0 + 1e-9, 20.0])
    start = [0.4, 200.0, 25.0, 70.0, 2.0 + 5e-10, 10.0]
    return actuator_of(least_squares(lambda p: misfit(actuator_of(p)).ravel(), start, bounds=bounds, diff_step=1e-4).x)


def describe(name: str, actuator: ThermalSma) -> str:
    """Sentence with an actuator's parameters and its difference from the pulse."""
    first, later = (f"{100 * np.sqrt(np.mean(row**2)):.1f}" for row in misfit(actuator))
    return (
        f"{name}: tau = {actuator.time_constant:.3f} s, steady rise {actuator.steady_rise:.0f} K, A_s, A_f, M_s, M_f = "
        f"{actuator.austenite_start:.1f}, {actuator.austenite_finish:.1f}, {actuator.martensite_start:.1f}, "
        f"{actuator.martensite_finish:.1f} deg C; root mean square difference from the pulse, relative to the peak "
        f"angle: first stroke {first} %, third {later} %; largest difference "
        f"{100 * np.abs(misfit(actuator)).max():.0f} %"
    )


def draw(actuator: ThermalSma, file: Path) -> None:
    """Draw the strokes beside the pulse, and the hysteresis loop."""
    turned, temperature = strokes(actuator)
    figure, (angles, loop) = subplots(1, 2, figsize=(9, 3.6))
    angles.plot(TIMES, SmaPulse().delta_psi(TIMES) / SmaPulse().peak_angle, "k--", label="pulse of Fig. 13.5b")
    for k, label in ((0, "first stroke"), (STROKES - 1, "third stroke")):
        angles.plot(TIMES, turned[k], label=label)
        loop.plot(temperature[k], turned[k], label=label)
    angles.set(xlabel="time [s]", ylabel="rotation over the peak angle")
    loop.set(xlabel="temperature [deg C]", ylabel="share of austenite")
    angles.legend()
    loop.legend()
    save_figure(figure, file)


def run(results: Results) -> None:
    """Print the fit and the defaults, and draw the default actuator."""
    print(describe("fitted", fit()), describe("default", ThermalSma()), sep="\n")
    draw(ThermalSma(), results.folder / "thermal.png")


STUDY = Study("scenes.thermal", run, out=Path("runs/thermal"))
