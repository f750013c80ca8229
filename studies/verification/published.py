"""Straight swim against two published codes."""

from pathlib import Path

import numpy as np

from seastar_gym.gaits import straight_gait
from seastar_gym.scene import Numerics, Scene, Seastar
from seastar_gym.simulator import Simulator
from studies.frame import Floats
from studies.style import MM
from studies.verification.page import Row, Section

PUBLISHED_SWIM = Path(__file__).resolve().parents[2] / "tests" / "data" / "straight_turning_hub_10ms.csv"
PUBLISHED_FINALS = {10e-3: 36.2827089e-3, 1e-3: 38.2752941e-3}
"""Hub x [m] after ten strokes by time step h [s], in both C++ codes with Newton converged tightly."""


def straight_swim(step: float, parts: int = 10) -> Floats:
    """Hub x [m] in ten strokes of {2+,5-}, at the ends of `parts` equal parts of each stroke, shape (10 parts,).

    The discretisation is the chapter's, whose hub hinges bend by their turning angle. The scheme is implicit Euler with
    time step [s] `step` and a tight Newton tolerance.
    """
    numerics = Numerics("implicit-euler", step, newton_tolerance=1e-12)
    simulator = Simulator(Scene(Seastar(hub_hinge="turning", discretisation="chapter"), numerics=numerics))
    return np.array(
        [simulator.hub_position()[0, 0] for _ in range(10) for _ in simulator.stroke_in_parts(straight_gait(), parts)]
    )


def published_swim(file: Path = PUBLISHED_SWIM) -> tuple[Floats, Floats, Floats]:
    """Times [s] and hub x [m] of codes A and B: every 0.1 s of ten strokes, h = 10 ms, Newton to a residual of 1e-8."""
    if not file.exists():
        raise FileNotFoundError(f"{file} is missing: the published codes' figures are part of a checkout only.")
    time, x_a, x_b = np.genfromtxt(file, delimiter=",", names=True, skip_header=4, unpack=True)
    return time, x_a, x_b


def published_codes() -> Section:
    """Section on the straight swim in two codes by groups of the chapter's authors."""
    rows = []
    for step, final in PUBLISHED_FINALS.items():
        what = f"x after ten strokes, h = {MM * step:g} ms, codes A and B tight"
        rows.append(Row(what, MM * final, MM * straight_swim(step, 1)[-1], "mm", 2e-8 * MM * final, digits=9))
    time, *codes = published_swim()
    ours = straight_swim(10e-3)
    stopping_errors = [abs(x[-1] - PUBLISHED_FINALS[10e-3]) for x in codes]
    for name, x, stopping_error in zip("AB", codes, stopping_errors, strict=True):
        worst = int(np.argmax(np.abs(ours - x)))
        what = f"x at {time[worst]:.1f} s, the worst of 100 times, code {name}"
        rows.append(Row(what, MM * x[worst], MM * ours[worst], "mm", 2.0 * MM * stopping_error, digits=9))
    return Section(
        "Published codes",
        "Hub x in the straight swim {2+,5-} with implicit Euler, on the chapter's discretisation with turning "
        "angles at the hub. Code A is dismech-rods in its planar mode, code B DDG_Tutorial_Fast (2d_curve). First "
        "with Newton converged tightly in all codes, then every 0.1 s at h = 10 ms, where Newton of A and B stops "
        "at a force residual of 1e-8.",
        rows,
    )
