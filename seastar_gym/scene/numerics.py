"""`Numerics`: scheme, step and tolerances of time stepping, chosen by value or by preset."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Annotated, Literal, NamedTuple, get_args

from seastar_gym.scene.checks import require_choice, require_flag, require_number, shown
from seastar_gym.scene.number import check_numbers, positive, whole, within
from seastar_gym.scene.robot import NODES, Discretisation
from seastar_gym.scene.serial import html_table, register_part, short_repr

SchemeName = Literal["implicit-euler", "sdirk2", "implicit-midpoint"]
SCHEME_NAMES: list[str] = [*get_args(SchemeName)]
"""Schemes that a scene may name: those of the package, and what `register_scheme` adds."""
Fidelity = Literal["rapid", "fast", "balanced", "accurate", "reference", "chapter"]

MAX_STEPS = 10_000_000
"""Largest number of time steps in a stroke. More would take minutes even for one robot."""
SHORTEST = 1e-6
"""Shortest interval, as a fraction of a step: rounding of times is far below it."""

MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP = 200_000, 100
"""Limit of a robot's Newton iterations in a stroke: a constant, and an allowance for every time step.

The limit amounts to seconds of computing. It is four times what any stroke in the study of stability needs.
"""


@register_part
@dataclass(frozen=True)
class Numerics:
    """Settings of time stepping.

    scheme: Implicit Runge-Kutta scheme: "implicit-euler" (the chapter's, (13.9)), "sdirk2", "implicit-midpoint",
        or the name of one of your own, see `register_scheme`.
    step: Time step h [s]. The last step before a corner of the actuation is shortened.
    newton_tolerance: Newton stops when the largest displacement of a node in an update is below this fraction of the
        limb length. If quadratic convergence foretells that the next update would be, it is skipped.
    max_iterations: Limit of Newton iterations per stage. Beyond it, the step is halved, down to 1/4096. A stroke has a
        limit of its own, 200,000 iterations and 100 more per time step; a robot beyond it fails with
        SolverStatus.ITERATION_LIMIT. Where limbs touch, those of the linear solver (contact/coupled.py) count, too.
    damping: Numerical damping of the scheme "implicit-midpoint", from 0 to 0.5. Without any, oscillations that are too
        fast for the steps never decay, and on fine meshes they may gather energy. Their amplitude falls by a fraction
        of twice the damping in every step, slow oscillations are hardly damped, see rods/step.py.
    named: Whether these numerics were chosen. False only for those of a `Scene` that was given none, which a fidelity
        may replace. It does not count in comparisons.
    """

    scheme: SchemeName | str = "implicit-euler"
    step: Annotated[float, positive("s")] = 3e-3
    newton_tolerance: Annotated[float, positive("limb lengths")] = 1e-8
    max_iterations: Annotated[int, whole(2, 10_000)] = 60
    damping: Annotated[float, within(0.0, 0.5)] = 0.0
    named: bool = field(default=True, kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_flag("named", self.named)
        require_choice("scheme", self.scheme, tuple(SCHEME_NAMES))
        check_numbers(self)
        if self.newton_tolerance > 1e-2:
            raise ValueError(f"newton_tolerance must be at most 0.01 limb lengths, not {shown(self.newton_tolerance)}.")
        if self.damping > 0.0 and self.scheme != "implicit-midpoint":
            raise ValueError(f'damping needs the scheme "implicit-midpoint", not {shown(self.scheme)}.')
        if not self.named and self != DEFAULT:
            object.__setattr__(self, "named", True)

    def __repr__(self) -> str:
        return short_repr(self)

    def _repr_html_(self) -> str:
        rows = [(each.name, shown(getattr(self, each.name))) for each in fields(self) if each.compare]
        return html_table("Numerics", ("setting", "value"), rows)

    @classmethod
    def preset(cls, fidelity: Fidelity) -> Numerics:
        """Numerics of a fidelity: "rapid", "fast", "balanced", "accurate", "reference", or "chapter" for the chapter's.

        What a fidelity promises holds with its nodes per limb and its discretisation: `Scene.preset` chooses them, too.
        """
        require_choice("fidelity", fidelity, get_args(Fidelity))
        return PRESETS[fidelity].numerics


class Resolution(NamedTuple):
    """Discretisation and nodes per limb, see `Seastar`, and numerics: what errors of a scene depend on."""

    discretisation: Discretisation
    nodes_per_limb: int
    numerics: Numerics


DAMPING = 0.003
"""`Numerics.damping` of all fidelities but "chapter": the least that was tried with which energies of long swims do not
grow (docs/stability.md, "Long-run energy drift")."""


def _midpoint(step: float, newton_tolerance: float, damping: float = DAMPING) -> Numerics:
    return Numerics("implicit-midpoint", step, newton_tolerance, damping=damping)


PRESETS: dict[Fidelity, Resolution] = {
    "rapid": Resolution("continuum", 7, _midpoint(10e-3, 1e-4, 0.05)),
    "fast": Resolution("continuum", 7, _midpoint(5e-3, 1e-5)),
    "balanced": Resolution("continuum", NODES["continuum"], _midpoint(5e-3, 1e-5)),
    "accurate": Resolution("continuum", 19, _midpoint(1e-3, 1e-6)),
    "reference": Resolution("continuum", 37, _midpoint(0.3e-3, 1e-8)),
    "chapter": Resolution("chapter", NODES["chapter"], Numerics("implicit-euler", 3e-3)),
}
"""They lie on or near the front of strokes that `python -m studies.front` finds. For decisions, `scene_for` knows
settings that reach the errors of `accurate` and `reference` faster."""

DEFAULT_FIDELITY: Fidelity = "balanced"
DEFAULT = PRESETS[DEFAULT_FIDELITY].numerics
"""Numerics of a `Scene` that is given none."""


def require_duration(duration: float, step: float, name: str = "duration") -> None:
    """Refuse the length of an interval [s] if it is no time, or too short or too long for steps of this length [s]."""
    require_number(name, duration, "s")
    if not SHORTEST * step <= duration <= MAX_STEPS * step:
        raise ValueError(
            f"{name} must be from {SHORTEST * step:.4g} to {MAX_STEPS * step:.4g} s, with steps of {step:.4g} s, not "
            f"{duration:.4g} s."
        )
