"""Time stepping: scheme, step and tolerances, by hand, by a preset's name or by the error that is asked for."""

from dataclasses import dataclass, field
from typing import Literal, cast, get_args

from seastar_gym.scene.checks import is_finite_number, require_choice, require_count, require_flag, require_number
from seastar_gym.scene.fidelity import cheapest
from seastar_gym.scene.serial import register_part

SchemeName = Literal["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
Fidelity = Literal["fast", "balanced", "accurate", "reference", "chapter"]

MAX_STEPS = 10_000_000
"""Most time steps of a stroke: more take minutes even for one robot."""


MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP = 200_000, 100
"""Newton iterations that a robot has for a stroke, and for each of its steps besides: seconds of computing.

Four times what any stroke of the atlas of stability needs; strokes of adapted steps in vacuum may need half of it.
"""


@register_part
@dataclass(frozen=True)
class Numerics:
    """Time stepping.

    scheme: "implicit-euler" is the chapter's (13.9). step: h [s]; the last step before a corner of the pulse is
        shortened.
    newton_tolerance: Largest node move of the last Newton update, or of the one that is left out because it can be
        foreseen, over the limb length.
    max_iterations: Newton iterations per stage before the robot's step is halved, down to 1/4096. For a whole stroke a
        robot has 200,000 and 100 for every step besides; if it needs more, it fails with
        SolverStatus.ITERATION_LIMIT.
    path_tolerance: Adapt the steps, up to `step`, so that the hub's path errs by about this share of its length at
        most, from 0.001 to 0.02; for scheme "implicit-midpoint". None for steps of one length.
    named: Whether somebody chose these numerics. False for those of a `Scene` that was given none: a `Simulator` steps
        by them, an environment by its fidelity. Equal numerics may differ in it; changed ones are named.
    """

    scheme: SchemeName = "implicit-euler"
    step: float = 3e-3
    newton_tolerance: float = 1e-8
    max_iterations: int = 60
    path_tolerance: float | None = None
    named: bool = field(default=True, kw_only=True, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_flag("named", self.named)
        require_choice("scheme", self.scheme, get_args(SchemeName))
        require_number("step", self.step, "s")
        require_number("newton_tolerance", self.newton_tolerance, "limb lengths")
        require_count("max_iterations", self.max_iterations, 2, 10_000)
        if self.newton_tolerance > 1e-2:
            raise ValueError(f"newton_tolerance must be at most 0.01 limb lengths, not {self.newton_tolerance!r}.")
        if self.path_tolerance is not None:
            if not is_finite_number(self.path_tolerance) or not 1e-3 <= self.path_tolerance <= 0.02:
                raise ValueError(f"path_tolerance must be from 0.001 to 0.02, not {self.path_tolerance!r}.")
            if self.scheme != "implicit-midpoint":
                raise ValueError(f'path_tolerance needs the scheme "implicit-midpoint", not {self.scheme!r}.')
        if not self.named and self != Numerics():
            object.__setattr__(self, "named", True)

    @classmethod
    def preset(cls, fidelity: Fidelity) -> "Numerics":
        """The numerics that a fidelity stands for: "chapter" is the chapter's, the others go from fast to exact.

        `seastar_gym.scene.fidelity.promise` tells how far off each is, and how fast.
        """
        require_choice("fidelity", fidelity, get_args(Fidelity))
        return _PRESETS[fidelity]

    @classmethod
    def for_error(cls, error: float, any_gait: bool = False) -> "Numerics":
        """The fastest measured setting whose path error is at most `error`, a share of the path's length.

        ValueError if none can promise it. Measured for the chapter's robot, see `seastar_gym.scene.fidelity`; any_gait
        asks it of any command that is repeated, too, the hardest that a robot can be asked.
        """
        best = cheapest(error, any_gait)
        return cls(cast(SchemeName, best.scheme), best.step, best.newton_tolerance, path_tolerance=best.path_tolerance)


ADAPTATION = (0.04, 2.0)
"""(c, p): steps with an error rate of (tolerance/c)^p limb lengths per stroke keep the path's tolerance."""

_PRESETS: dict[Fidelity, Numerics] = {
    "fast": Numerics("sdirk2", 20e-3, newton_tolerance=1e-6),
    "balanced": Numerics("implicit-midpoint", 5e-3, newton_tolerance=1e-6),
    "accurate": Numerics("implicit-midpoint", 5e-3, path_tolerance=0.015),
    "reference": Numerics("implicit-midpoint", 0.3e-3, newton_tolerance=1e-9),
    "chapter": Numerics("implicit-euler", 3e-3),
}
