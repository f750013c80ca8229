"""Settings that the accuracy study measures, and its size."""

from dataclasses import dataclass

from seastar_gym.scene import Numerics
from seastar_gym.scene.numerics import DAMPING, PRESETS, Resolution, SchemeName
from seastar_gym.scene.robot import Discretisation

MILLI = 1e-3
"""Seconds per millisecond."""
STEPS: dict[SchemeName, tuple[float, ...]] = {
    "implicit-euler": (20, 10, 5, 3, 1),
    "sdirk2": (50, 30, 20, 15, 10, 5),
    "sdirk3": (30, 20, 10),
    "implicit-midpoint": (10, 8, 6, 5, 4, 3, 2, 1.5, 1, 0.7, 0.5, 0.3, 0.1),
}
"""Time steps [ms] of every scheme."""
UNDAMPED = (5, 1)
"""Time steps [ms] at which the midpoint rule is measured without `Numerics.damping`, too."""
ADAPTED = (0.02, 0.01, 0.005)
"""Path tolerances of the settings with adapted steps."""
LARGEST_ADAPTED = 5 * MILLI
"""Largest adapted time step [s]."""
Mesh = tuple[Discretisation, int]
"""Discretisation and nodes per limb N."""


@dataclass(frozen=True)
class Plan:
    """Size of the study.

    n_random, n_slow: Numbers of random and of slow sequences.
    n_gaits: Number of robots of each kind in `random_gaits`.
    side: Strokes of swimming and of rest on a side of the pentagon.
    limit: Nodes per limb and time step [s] of the swims that stand for the continuum.
    fine: Time step [s] of the swims that stand for infinitely short steps, with fewer nodes than `limit`. The chapter's
        discretisation with more than `finest` nodes, whose error is one of space, has four times that.
    opinion: Nodes per limb and time step [s] with which SDIRK3 gives a second opinion.
    meshes: Discretisations and nodes per limb that are measured.
    shortest: Shortest time step of the settings [s].
    finest: Most nodes per limb with which settings are measured at all tolerances, and adapted steps.
    rounds: Rounds of timing.
    """

    n_random: int = 51
    n_slow: int = 8
    n_gaits: int = 20
    side: tuple[int, int] = (6, 1)
    limit: tuple[int, float] = (73, 0.1 * MILLI)
    fine: float = 0.05 * MILLI
    opinion: tuple[int, float] = (37, 0.1 * MILLI)
    meshes: tuple[Mesh, ...] = (
        *(("continuum", n) for n in (6, 7, 8, 10, 11, 12, 13, 19, 25, 28, 37)), *(("chapter", n) for n in (10, 37, 73)),
    )  # fmt: skip
    shortest: float = 0.1 * MILLI
    finest: int = 19
    rounds: int = 3


QUICK = Plan(
    n_random=6, n_slow=2, n_gaits=2, side=(1, 0), limit=(37, 0.4 * MILLI), fine=0.4 * MILLI, opinion=(10, 1 * MILLI),
    meshes=(("continuum", 7), ("continuum", 10), ("chapter", 10)), shortest=2 * MILLI, rounds=1,
)  # fmt: skip


def tolerances(step: float) -> tuple[float, ...]:
    """Newton tolerances that are measured with a time step [s]: short steps bring small updates, so need small ones."""
    if step >= 5 * MILLI:
        return 3e-5, 1e-5, 1e-6
    return (1e-6, 1e-7) if step >= 1 * MILLI else (1e-8,)


def dampings(discretisation: Discretisation, scheme: SchemeName, step: float) -> tuple[float, ...]:
    """Numbers `Numerics.damping` that are measured with a scheme and a time step [ms]: schemes that damp have none."""
    if discretisation == "chapter" or scheme != "implicit-midpoint":
        return (0.0,)
    return (DAMPING, 0.0) if step in UNDAMPED else (DAMPING,)


def settings(plan: Plan) -> list[Resolution]:
    """All settings that are measured, and the presets whatever the plan leaves out."""
    found = [Resolution(*mesh, each) for mesh in plan.meshes for each in _numerics(plan, mesh)]
    return list(dict.fromkeys([*found, *PRESETS.values()]))


def _numerics(plan: Plan, mesh: Mesh) -> list[Numerics]:
    """Numerics that are measured with a mesh: fewer with many nodes, which are dear."""
    discretisation, nodes = mesh
    allowed = 0.1 if nodes == 10 else 0.3 if discretisation == "continuum" else 1
    shortest = max(plan.shortest, allowed * MILLI)
    fixed = [
        Numerics(scheme, step * MILLI, tolerance, damping=damping)
        for scheme, steps in STEPS.items()
        for step in steps
        for damping in dampings(discretisation, scheme, step)
        for tolerance in tolerances(step * MILLI)
        if step * MILLI >= shortest and (nodes <= plan.finest or tolerance == tolerances(step * MILLI)[-1])
    ]
    damping = dampings(discretisation, "implicit-midpoint", LARGEST_ADAPTED / MILLI)[0]
    adapted = [
        Numerics("implicit-midpoint", LARGEST_ADAPTED, 1e-7, path_tolerance=tolerance, damping=damping)
        for tolerance in ADAPTED
    ]
    return fixed + (adapted if nodes <= plan.finest else [])
