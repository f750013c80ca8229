"""What is modelled: robot, fluid, actuator and numerics, as frozen dataclasses in SI units with the chapter's values.

Each part checks itself, and a `Scene` checks what the parts can be together; what cannot be modelled is refused with
a sentence that says why. Numbers named in a part's `PER_ROBOT` may be arrays of shape (n_robots,), one for each robot
of a batch.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from typing import Any, ClassVar, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.actuation.actuator import Actuator, StatefulActuator, check_actuator, is_actuator
from seastar_gym.actuation.sma import SmaPulse as SmaPulse
from seastar_gym.checks import is_finite_number, require_numbers
from seastar_gym.checks import require_choice as require_choice
from seastar_gym.checks import require_count as require_count
from seastar_gym.checks import require_flag as require_flag
from seastar_gym.checks import require_number as require_number
from seastar_gym.contact import Contact as Contact
from seastar_gym.der.rods import Limits, Rods
from seastar_gym.fidelity import cheapest
from seastar_gym.fluids import Water as Water
from seastar_gym.morphology.contact import cross_at_rest, limbs_that_may_touch
from seastar_gym.morphology.limb import Limb, LimbShape, as_tuple
from seastar_gym.morphology.seastar import make_rods, n_hub_hinges, natural_hub_angle, rest_positions, turn_per_hinge
from seastar_gym.per_robot import Numbers, batch_size, chosen, of_robot, require_each
from seastar_gym.serial import from_dict, register_part, to_dict

HubHinge = Literal["opening", "turning"]
SchemeName = Literal["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
Fidelity = Literal["fast", "balanced", "accurate", "reference", "chapter"]


MAX_STEPS = 10_000_000
"""Of a stroke: more take minutes even for one robot."""


MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP = 200_000, 100
"""Newton iterations that a robot has for a stroke, and for each of its steps besides: seconds of computing.

Four times what any stroke of the atlas of stability needs; strokes of adapted steps in vacuum may need half of it.
"""


@register_part
@dataclass(frozen=True)
class Seastar:
    """A robot of limbs around a hub (Fig. 13.4a): straight, equal, uniform and evenly spread, but for `limbs`.

    n_limbs: Number of limbs. nodes_per_limb: N, with the hub. limb_length: L [m], the unit of a robot's
        tolerances and observations, too. rod_radius: r_0 [m]. youngs_modulus: E [Pa]. density: rho_m [kg/m^3].
    hub_hinge: "opening" measures a hub hinge by the angle psi between its two limbs, from 0 to pi, a wider gap by what
        is missing to a full turn; "turning" by the interior turning angle pi - psi, as the published codes of the
        chapter's authors do.
    limbs: What limbs have of their own, one Limb each, or () for nothing.
    relaxation_time: Of material damping after Kelvin and Voigt [s], see der/damping.py and `relaxation_time`; None for
        none, as in the chapter.

    Two limbs have one hub hinge; straight ones, with hub_hinge="turning", make a plain rod. One limb has none: it
    swings freely about the hub, and no actuator turns it.
    """

    PER_ROBOT: ClassVar = ("limb_length", "rod_radius", "youngs_modulus", "density", "relaxation_time")
    n_limbs: int = 5
    nodes_per_limb: int = 10
    limb_length: Numbers = 0.1
    rod_radius: Numbers = 1.6e-3
    youngs_modulus: Numbers = 1e6
    density: Numbers = 1000.0
    hub_hinge: HubHinge = "opening"
    limbs: tuple[Limb, ...] = ()
    relaxation_time: Numbers | None = None

    def __post_init__(self) -> None:
        require_count("n_limbs", self.n_limbs, 1, 12)
        require_count("nodes_per_limb", self.nodes_per_limb, 2, 10_000)
        require_each(self, "limb_length", partial(require_number, unit="m"))
        require_each(self, "rod_radius", partial(require_number, unit="m"))
        require_each(self, "youngs_modulus", partial(require_number, unit="Pa"))
        require_each(self, "density", partial(require_number, unit="kg/m^3"))
        if self.relaxation_time is not None:
            require_each(self, "relaxation_time", partial(require_number, unit="s", zero_allowed=True))
        require_choice("hub_hinge", self.hub_hinge, get_args(HubHinge))
        if self.n_limbs == 1 and self.hub_hinge != "opening":
            raise ValueError("One limb has no hub hinge that could be measured by its turning angle.")
        self._check_limbs()

    def _check_limbs(self) -> None:
        if not isinstance(self.limbs, tuple) or not all(isinstance(limb, Limb) for limb in self.limbs):
            raise ValueError(f"limbs must be a tuple of Limb, not {self.limbs!r}.")
        if len(self.limbs) not in (0, self.n_limbs):
            raise ValueError(f"limbs must be one Limb for each of the {self.n_limbs}, or none, not {len(self.limbs)}.")
        directions = [limb.direction for limb in self.limbs if limb.direction is not None]
        if len(directions) not in (0, self.n_limbs):
            raise ValueError("Either every limb has a direction or none has.")
        if directions and (directions[0] != 0.0 or (np.diff(directions) <= 0.0).any()):
            raise ValueError(f"Directions of limbs must begin at 0 and increase [rad], not {directions!r}.")
        most = chosen(self, partial(max, key=abs))
        turn = max(abs(turn_per_hinge(shape, self.nodes_per_limb)) for shape in most.limb_shapes())
        if turn >= math.pi:
            raise ValueError(
                f"A natural curvature that turns neighbouring edges by {turn:.4g} rad, not below pi, is too much for "
                f"{self.nodes_per_limb} nodes per limb."
            )

    def limb_shapes(self, index: int = 0) -> tuple[LimbShape, ...]:
        """Every limb with nothing left open; of robot `index`, where numbers differ from robot to robot."""
        robot = chosen(self, itemgetter(index))
        limbs = robot.limbs or (Limb(),) * self.n_limbs
        directions = [limb.direction for limb in limbs if limb.direction is not None]
        gaps = np.diff(directions, append=2.0 * math.pi).tolist() or [2.0 * math.pi / self.n_limbs] * self.n_limbs
        return tuple(
            LimbShape(
                direction=2.0 * math.pi * j / self.n_limbs if limb.direction is None else limb.direction,
                gap=gap,
                length=robot.limb_length if limb.length is None else limb.length,
                radius=as_tuple(robot.rod_radius if limb.radius is None else limb.radius),
                youngs_modulus=as_tuple(robot.youngs_modulus if limb.youngs_modulus is None else limb.youngs_modulus),
                natural_curvature=limb.natural_curvature,
            )
            for j, (limb, gap) in enumerate(zip(limbs, gaps, strict=True))
        )

    def limbs_that_may_touch(self) -> list[tuple[int, int]]:
        """(right, left) limbs, counted from 0."""
        alike = all(limb.length is None for limb in self.limbs)
        return limbs_that_may_touch([shape.gap for shape in self.limb_shapes()], alike)

    @property
    def is_symmetric(self) -> bool:
        """Whether a turn by one limb and a mirror at limb 1 leave the robot, or all of them, as it is."""
        robots = [self.limb_shapes(index) for index in range(batch_size(self) or 1)]
        alike = all(len({shape._replace(direction=0.0, gap=0.0) for shape in shapes}) == 1 for shapes in robots)
        straight = not any(shape.natural_curvature for shapes in robots for shape in shapes)
        return alike and straight and float(np.ptp([shape.gap for shape in robots[0]])) < 1e-12

    @property
    def n_nodes(self) -> int:
        """Number of nodes, n_limbs (N - 1) + 1."""
        return self.n_limbs * (self.nodes_per_limb - 1) + 1

    @property
    def edge_length(self) -> Numbers:
        """Natural length of an edge of a limb of length L [m]."""
        return np.divide(self.limb_length, self.nodes_per_limb - 1)

    @property
    def lengths(self) -> tuple[Numbers, ...]:
        """Numbers that the shape at rest depends on."""
        of_limbs = [number for limb in self.limbs for number in (limb.length, limb.natural_curvature)]
        return self.limb_length, *(number for number in of_limbs if number is not None)

    @property
    def opening_angle(self) -> float:
        """Smallest angle between neighbouring limbs at rest [rad]."""
        return min(shape.gap for shape in self.limb_shapes())

    def nodes(self, index: int = 0) -> NDArray[np.float64]:
        """Node positions at rest [m], shape (n_nodes, 2): hub, {1,1}..{1,N-1}, {2,1}.. ; limb 1 along +x.

        index: Of which robot, where numbers differ from robot to robot.
        """
        return rest_positions(self.limb_shapes(index), self.nodes_per_limb)


def relaxation_time(loss_factor: float, frequency: float) -> float:
    """Relaxation time [s] of a material whose loss factor is known at a frequency [Hz]: eta = omega tau."""
    require_number("loss_factor", loss_factor, "1", zero_allowed=True)
    require_number("frequency", frequency, "Hz")
    return loss_factor / (2.0 * math.pi * frequency)


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

        `seastar_gym.fidelity.promise` tells how far off each is, and how fast.
        """
        require_choice("fidelity", fidelity, get_args(Fidelity))
        return _PRESETS[fidelity]

    @classmethod
    def for_error(cls, error: float, any_gait: bool = False) -> "Numerics":
        """The fastest measured setting whose path error is at most `error`, a share of the path's length.

        ValueError if none can promise it. Measured for the chapter's robot, see `seastar_gym.fidelity`; any_gait asks
        it of any command that is repeated, too, the hardest that a robot can be asked.
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


@register_part
@dataclass(frozen=True)
class Scene:
    """A robot, the fluid around it (None: vacuum), its actuator and the numerics.

    numerics: The chapter's where none are named; environments then take those of their fidelity.
    held_nodes: Indices of nodes that stay where they are; hub and root node held clamp a limb.
    loads: Dead loads on nodes, (node, F_x, F_y) [N] each.
    limb_strengths: Share of its rotation that every limb still makes, from 0 (failed) to 1; () for all of it.
    contact: What limbs do to each other where they touch; None lets them pass through each other, as in the chapter.
    """

    robot: Seastar = field(default_factory=Seastar)
    fluid: Water | None = field(default_factory=Water)
    actuator: Actuator = field(default_factory=SmaPulse)
    numerics: Numerics = field(default_factory=partial(Numerics, named=False))
    held_nodes: tuple[int, ...] = ()
    loads: tuple[tuple[int, float, float], ...] = ()
    limb_strengths: tuple[float, ...] = ()
    contact: Contact | None = None

    def __post_init__(self) -> None:
        for name, value, kinds in (
            ("robot", self.robot, Seastar),
            ("fluid", self.fluid, Water | None),
            ("numerics", self.numerics, Numerics),
            ("contact", self.contact, Contact | None),
        ):
            if not isinstance(value, kinds):
                raise ValueError(f"Scene.{name} must be a {kinds}, not {value!r}.")
        if not is_actuator(self.actuator):
            raise ValueError(f"Scene.actuator must be an Actuator such as SmaPulse(), not {self.actuator!r}.")
        check_actuator(self.actuator)
        batch_size(self)
        self._check_hub_hinges()
        self._check_strengths()
        self._check_holds_and_loads()
        self._check_contact()
        self._check_coefficients()

    def _check_strengths(self) -> None:
        require_numbers("limb_strengths", self.limb_strengths, "1")
        if len(self.limb_strengths) not in (0, self.robot.n_limbs):
            raise ValueError(f"limb_strengths must be one number per limb, not {self.limb_strengths!r}.")
        if not all(0.0 <= strength <= 1.0 for strength in self.limb_strengths):
            raise ValueError(f"limb_strengths must be from 0 to 1, not {self.limb_strengths!r}.")

    def _check_holds_and_loads(self) -> None:
        if not isinstance(self.held_nodes, tuple) or not isinstance(self.loads, tuple):
            raise ValueError(f"held_nodes and loads must be tuples, not {self.held_nodes!r} and {self.loads!r}.")
        for load in self.loads:
            if not isinstance(load, tuple) or len(load) != 3 or not all(map(is_finite_number, load[1:])):
                raise ValueError(f"A load is (node, F_x, F_y) with finite forces [N], not {load!r}.")
        for node in (*self.held_nodes, *(load[0] for load in self.loads)):
            require_count("a held or loaded node", node, 0, self.robot.n_nodes - 1)

    def _check_contact(self) -> None:
        if self.contact is None:
            return
        robot, pairs = self.robot, self.robot.limbs_that_may_touch()
        if not pairs:
            raise ValueError("Contact is modelled between limbs less than half a turn apart, which this robot has not.")
        if self.contact.opening_angle >= robot.opening_angle:
            raise ValueError(
                f"Limbs that touch at an opening angle of {self.contact.opening_angle:.4g} rad touch at rest, where "
                f"they are {robot.opening_angle:.4g} rad apart: use a smaller Contact.opening_angle."
            )
        bent = any(np.any(limb.natural_curvature) for limb in robot.limbs)
        for index in range((batch_size(robot) or 1) if bent else 0):
            if cross_at_rest(robot.nodes(index), robot.n_limbs, pairs):
                raise ValueError(
                    "Limbs of this robot cross at rest, so contact cannot keep them apart: bend them less."
                )

    def _check_coefficients(self) -> None:
        """What is finite alone may overflow or vanish together."""
        if self.actuator.period / self.numerics.step > MAX_STEPS:
            raise ValueError(
                f"A step of {self.numerics.step:.4g} s makes more than {MAX_STEPS:,} steps of a stroke of "
                f"{self.actuator.period:.4g} s: use a longer step."
            )
        try:
            with np.errstate(all="ignore"):
                sound = all(self._has_sound_coefficients(choose) for choose in (min, max))
        except (OverflowError, ZeroDivisionError):
            sound = False
        if not sound:
            raise ValueError(
                f"The stiffnesses or masses of {self.robot!r} overflow or vanish in double precision: use numbers "
                "closer to those of a robot."
            )

    def _has_sound_coefficients(self, choose: Callable[[tuple[float, ...]], float]) -> bool:
        rods = self._rods(choose)
        missing = (rods.nodes_per_limb - 1) * np.arange(n_hub_hinges(rods.n_limbs), rods.n_limbs)
        bending = (np.delete(stiffness, missing) for stiffness in (rods.EI_over_dl, rods.dl_over_EI))
        coefficients = (rods.EA_over_l, rods.l_over_EA, *bending, rods.mass, rods.shortest_edge**2)
        return all(np.isfinite(one).all() and (one > 0.0).all() for one in coefficients)

    def _check_hub_hinges(self) -> None:
        """Neighbours turned apart turn their hub hinge by two peak angles; at pi its curvature is infinite."""
        robot, peak = self.robot, float(np.max(self.actuator.peak_angle))
        hinges = robot.limb_shapes()[: n_hub_hinges(robot.n_limbs)]
        if not hinges:
            if peak > 0.0:
                raise ValueError("One limb has no hub hinge for an actuator to turn: use SmaPulse(peak_angle=0.0).")
            return
        widest = max(abs(natural_hub_angle(hinge.gap, robot.hub_hinge)) for hinge in hinges)
        limit = 0.5 * (math.pi - widest)
        if robot.hub_hinge == "turning":
            # A stroke that remembers nothing comes to the limit for some commands only: the simulator refuses those.
            limit *= 1.0 - 1e-12 if isinstance(self.actuator, StatefulActuator) else 1.0 + 1e-12
            if peak > limit:
                raise ValueError(
                    f'With hub_hinge="turning" the natural opening angle must stay above zero: for {robot.n_limbs} '
                    f"limbs so spread the peak angle must be at most {limit:.4g} rad, not {peak:.4g} rad."
                )
        elif peak >= limit:
            raise ValueError(
                f"A peak angle of {peak:.4g} rad lets the natural angle of a hub hinge reach pi, where its curvature "
                f"is infinite: for {robot.n_limbs} limbs so spread the peak angle must stay below {limit:.4g} rad"
                + (', or use hub_hinge="turning".' if robot.n_limbs == 2 else ".")
            )

    def limits(self, index: int = 0) -> Limits:
        """What a robot's solution has to keep, for the kernels.

        The error that a step may make per second is `error_rate` limb lengths per stroke; how it follows from the
        tolerance on the path was measured, see ADAPTATION.
        """
        numerics, length = self.numerics, of_robot(self.robot.limb_length, index)
        speed, tolerance = length / self.actuator.period, numerics.path_tolerance
        error_rate = 0.0 if tolerance is None else speed * (tolerance / ADAPTATION[0]) ** ADAPTATION[1]
        n_steps = math.ceil(self.actuator.period / numerics.step)
        return Limits(
            tolerance=np.array([numerics.newton_tolerance * length]),
            max_iterations=numerics.max_iterations,
            most_iterations=MOST_ITERATIONS + MOST_ITERATIONS_PER_STEP * n_steps,
            adaptive=tolerance is not None,
            error_rate=np.array([error_rate]),
        )

    def to_dict(self) -> dict[str, Any]:
        """The scene as plain data for JSON, see serial.py. ValueError: an actuator that could not be read back."""
        return to_dict(self)

    @classmethod
    def from_dict(cls, data: object) -> "Scene":
        """The scene that `to_dict` wrote. ValueError, with one sentence, for everything else."""
        return from_dict(data, cls)

    @property
    def n_robots(self) -> int | None:
        """Robots that the scene is for, or None if no number differs from robot to robot."""
        return batch_size(self)

    def of_robot(self, index: int) -> "Scene":
        """The scene of one robot of a batch."""
        return chosen(self, itemgetter(index))

    def rods(self, index: int = 0) -> Rods:
        """The coefficients of a robot for the kernels, see der/rods.py."""
        return self._rods(itemgetter(index))

    def _rods(self, choose: Callable[[tuple[float, ...]], float]) -> Rods:
        robot, fluid = chosen(self.robot, choose), None if self.fluid is None else chosen(self.fluid, choose)
        contact = None if self.contact is None else chosen(self.contact, choose)
        return make_rods(
            limbs=robot.limb_shapes(),
            nodes_per_limb=robot.nodes_per_limb,
            density=robot.density,
            hub_hinge=robot.hub_hinge,
            fluid_density=0.0 if fluid is None else fluid.density,
            drag_coefficient=0.0 if fluid is None else fluid.drag_coefficient,
            tangential_drag_coefficient=None if fluid is None else fluid.tangential_drag_coefficient,
            added_mass_coefficient=None if fluid is None else fluid.added_mass_coefficient,
            relaxation_time=robot.relaxation_time,
            current=None if fluid is None or fluid.current is None else fluid.current.rows(),
            held_nodes=self.held_nodes,
            loads=self.loads,
            touching=None if contact is None else self.robot.limbs_that_may_touch(),
            contact_modulus=None if contact is None else contact.modulus,
            contact_angle=0.0 if contact is None else contact.opening_angle,
        )
