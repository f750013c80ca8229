"""Settings that the accuracy study measures, and its size."""

import itertools
from dataclasses import dataclass

from seastar_gym.scene import Numerics
from seastar_gym.scene.numerics import SchemeName
from studies.accuracy.rows import presets

MS = 1e-3
"""Seconds per millisecond."""
STEPS: dict[SchemeName, tuple[float, ...]] = {
    "implicit-euler": (20, 10, 5, 3, 2, 1, 0.5, 0.25),
    "sdirk2": (50, 30, 20, 15, 10, 5, 2, 1, 0.5, 0.2),
    "sdirk3": (50, 30, 20, 10, 5, 2, 1, 0.5, 0.2),
    "implicit-midpoint": (10, 8, 5, 4, 3, 2, 1.5, 1, 0.8, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.1),
}
"""Time steps [ms] of every scheme, each combined with every Newton tolerance."""
ADAPTED = (0.02, 0.015, 0.01, 0.007, 0.005, 0.003, 0.002, 0.001)
"""Path tolerances of the settings with adapted steps."""
LARGEST_ADAPTED = 5 * MS
"""Largest adapted time step [s]."""
FINE_NODES = (10, 19, 37, 73)
"""Nodes per limb for the extrapolation N -> infinity: each number halves the edge length of the one before."""


@dataclass(frozen=True)
class Plan:
    """Size of the study.

    n_random: Number of random sequences.
    side: Strokes of swimming and of rest on a side of the pentagon.
    converged: The two schemes and time steps [s] whose solutions have to agree.
    shortest: Shortest time step of the settings [s].
    tolerances: Newton tolerances of the settings.
    nodes: Nodes per limb N, besides 10, whose settings are measured.
    fine: Time step of the converged solutions for other N [s].
    coarse_nodes: Further N in the picture of convergence.
    n_fine: How many of FINE_NODES are computed.
    n_spatial: Number of robots for other N.
    rounds: Rounds of timing.
    """

    n_random: int = 64
    side: tuple[int, int] = (9, 1)
    converged: tuple[tuple[SchemeName, float], ...] = (("sdirk3", 0.01 * MS), ("implicit-midpoint", 0.005 * MS))
    shortest: float = 0.1 * MS
    tolerances: tuple[float, ...] = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    nodes: tuple[int, ...] = (5, 19, 37)
    fine: float = 0.02 * MS
    coarse_nodes: tuple[int, ...] = (4, 5, 7)
    n_fine: int = 4
    n_spatial: int = 16
    rounds: int = 5


QUICK = Plan(
    n_random=8, side=(4, 1), converged=(("sdirk3", 0.05 * MS), ("implicit-midpoint", 0.025 * MS)), shortest=0.25 * MS,
    tolerances=(1e-6, 1e-8), nodes=(), fine=0.1 * MS, coarse_nodes=(5,), n_fine=3, n_spatial=8, rounds=2,
)  # fmt: skip


def settings(plan: Plan) -> list[Numerics]:
    """All settings that are measured for N = 10."""
    fixed = [
        Numerics(scheme, step * MS, tolerance)
        for scheme, steps in STEPS.items()
        for step, tolerance in itertools.product(steps, plan.tolerances)
        if step * MS >= plan.shortest
    ]
    adapted = [
        Numerics("implicit-midpoint", LARGEST_ADAPTED, tolerance, path_tolerance=path_tolerance)
        for path_tolerance, tolerance in itertools.product(ADAPTED, plan.tolerances)
        if tolerance <= 1e-6
    ]
    return list(dict.fromkeys([*presets().values(), *fixed, *adapted]))


def settings_for_other_nodes() -> list[Numerics]:
    """The smaller selection of settings that is measured for other N."""
    steps: dict[SchemeName, tuple[float, ...]] = {
        "implicit-euler": (20, 3), "sdirk2": (20, 5, 1), "sdirk3": (20, 5), "implicit-midpoint": (5, 2, 1, 0.5),
    }  # fmt: skip
    fixed = [Numerics(scheme, step * MS) for scheme, each in steps.items() for step in each]
    return list(dict.fromkeys([*presets().values(), *fixed]))
