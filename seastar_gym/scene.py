"""What is modelled: robot, fluid, actuator and numerics, as frozen dataclasses in SI units with the chapter's values.

Each part checks itself, and a `Scene` checks what the parts can be together; what cannot be modelled is refused with
a sentence that says why.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.actuation.sma import pulse
from seastar_gym.checks import is_finite_number
from seastar_gym.checks import require_choice as require_choice
from seastar_gym.checks import require_count as require_count
from seastar_gym.checks import require_number as require_number
from seastar_gym.der.rods import Limits, Rods
from seastar_gym.fidelity import cheapest
from seastar_gym.fluids import Water as Water
from seastar_gym.morphology.seastar import make_rods, rest_positions

HubHinge = Literal["opening", "turning"]
SchemeName = Literal["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
Fidelity = Literal["fast", "balanced", "accurate", "reference", "chapter"]


MAX_STEPS = 10_000_000
"""Of a stroke: more take minutes even for one robot."""


@dataclass(frozen=True)
class Seastar:
    """A robot of straight, equal, uniform limbs around a hub (Fig. 13.4a).

    n_limbs: Number of limbs. nodes_per_limb: N, with the hub. limb_length: L [m]. rod_radius: r_0 [m].
    youngs_modulus: E [Pa]. density: rho_m [kg/m^3].
    hub_hinge: "opening" measures a hub hinge by the angle psi between its two limbs; "turning" by the interior
        turning angle pi - psi, as the published codes of the chapter's authors do.
    """

    n_limbs: int = 5
    nodes_per_limb: int = 10
    limb_length: float = 0.1
    rod_radius: float = 1.6e-3
    youngs_modulus: float = 1e6
    density: float = 1000.0
    hub_hinge: HubHinge = "opening"

    def __post_init__(self) -> None:
        require_count("n_limbs", self.n_limbs, 3, 12)
        require_count("nodes_per_limb", self.nodes_per_limb, 2, 10_000)
        require_number("limb_length", self.limb_length, "m")
        require_number("rod_radius", self.rod_radius, "m")
        require_number("youngs_modulus", self.youngs_modulus, "Pa")
        require_number("density", self.density, "kg/m^3")
        require_choice("hub_hinge", self.hub_hinge, get_args(HubHinge))

    @property
    def n_nodes(self) -> int:
        """Number of nodes, n_limbs (N - 1) + 1."""
        return self.n_limbs * (self.nodes_per_limb - 1) + 1

    @property
    def edge_length(self) -> float:
        """Natural length of an edge [m]."""
        return self.limb_length / (self.nodes_per_limb - 1)

    @property
    def opening_angle(self) -> float:
        """Angle between neighbouring limbs at rest [rad]."""
        return 2.0 * math.pi / self.n_limbs

    def nodes(self) -> NDArray[np.float64]:
        """Node positions at rest [m], shape (n_nodes, 2): hub, {1,1}..{1,N-1}, {2,1}.. ; limb 1 along +x."""
        return rest_positions(self.n_limbs, self.nodes_per_limb, self.limb_length)


@dataclass(frozen=True)
class SmaPulse:
    """The actuator of Fig. 13.5b. peak_angle [rad], heating_time: Delta t_1 [s], cooling_time: Delta t_2 [s]."""

    peak_angle: float = math.pi / 5
    heating_time: float = 0.1
    cooling_time: float = 0.9

    def __post_init__(self) -> None:
        require_number("peak_angle", self.peak_angle, "rad", zero_allowed=True)
        require_number("heating_time", self.heating_time, "s")
        require_number("cooling_time", self.cooling_time, "s")

    @property
    def period(self) -> float:
        """Delta t_0 [s], the length of a stroke."""
        return self.heating_time + self.cooling_time

    @property
    def corners(self) -> tuple[float, float, float]:
        """Times within a stroke [s] that no time step may straddle."""
        return 0.0, self.heating_time, self.period

    def delta_psi(self, t: ArrayLike) -> NDArray[np.float64]:
        """Rotation of a limb with command 1 at time t [s] of a stroke [rad]; t of any shape."""
        return self.peak_angle * pulse(t, self.heating_time, self.cooling_time)


@dataclass(frozen=True)
class Numerics:
    """Time stepping.

    scheme: "implicit-euler" is the chapter's (13.9). step: h [s]; the last step before a corner of the pulse is
        shortened.
    newton_tolerance: Largest node move of the last Newton update, or of the one that is left out because it can be
        foreseen, over the limb length.
    max_iterations: Newton iterations per stage before the robot's step is halved.
    path_tolerance: Adapt the steps, up to `step`, so that the hub's path errs by about this share of its length at
        most, from 0.001 to 0.02; for scheme "implicit-midpoint". None for steps of one length.
    """

    scheme: SchemeName = "implicit-euler"
    step: float = 3e-3
    newton_tolerance: float = 1e-8
    max_iterations: int = 60
    path_tolerance: float | None = None

    def __post_init__(self) -> None:
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


@dataclass(frozen=True)
class Scene:
    """A robot, the fluid around it (None: vacuum), its actuator and the numerics.

    held_nodes: Indices of nodes that stay where they are; hub and root node held clamp a limb.
    loads: Dead loads on nodes, (node, F_x, F_y) [N] each.
    """

    robot: Seastar = field(default_factory=Seastar)
    fluid: Water | None = field(default_factory=Water)
    actuator: SmaPulse = field(default_factory=SmaPulse)
    numerics: Numerics = field(default_factory=Numerics)
    held_nodes: tuple[int, ...] = ()
    loads: tuple[tuple[int, float, float], ...] = ()

    def __post_init__(self) -> None:
        for name, value, kinds in (
            ("robot", self.robot, Seastar),
            ("fluid", self.fluid, Water | None),
            ("actuator", self.actuator, SmaPulse),
            ("numerics", self.numerics, Numerics),
        ):
            if not isinstance(value, kinds):
                raise ValueError(f"Scene.{name} must be a {kinds}, not {value!r}.")
        self._check_hub_hinges()
        self._check_holds_and_loads()
        self._check_coefficients()

    def _check_holds_and_loads(self) -> None:
        if not isinstance(self.held_nodes, tuple) or not isinstance(self.loads, tuple):
            raise ValueError(f"held_nodes and loads must be tuples, not {self.held_nodes!r} and {self.loads!r}.")
        for load in self.loads:
            if not isinstance(load, tuple) or len(load) != 3 or not all(map(is_finite_number, load[1:])):
                raise ValueError(f"A load is (node, F_x, F_y) with finite forces [N], not {load!r}.")
        for node in (*self.held_nodes, *(load[0] for load in self.loads)):
            require_count("a held or loaded node", node, 0, self.robot.n_nodes - 1)

    def _check_coefficients(self) -> None:
        """What is finite alone may overflow or vanish together."""
        if self.actuator.period / self.numerics.step > MAX_STEPS:
            raise ValueError(
                f"A step of {self.numerics.step:.4g} s makes more than {MAX_STEPS:,} steps of a stroke of "
                f"{self.actuator.period:.4g} s: use a longer step."
            )
        try:
            with np.errstate(all="ignore"):
                rods, squared_edge = self.rods(), np.array(self.robot.edge_length**2)
            coefficients = (rods.EA_over_l, rods.l_over_EA, rods.EI_over_dl, rods.dl_over_EI, rods.mass, squared_edge)
            sound = all(np.isfinite(one).all() and (one > 0.0).all() for one in coefficients)
        except (OverflowError, ZeroDivisionError):
            sound = False
        if not sound:
            raise ValueError(
                f"The stiffnesses or masses of {self.robot!r} overflow or vanish in double precision: use numbers "
                "closer to those of a robot."
            )

    def _check_hub_hinges(self) -> None:
        """Neighbours turned apart open their hub hinge by two peak angles; at pi its curvature is infinite."""
        rest, peak = self.robot.opening_angle, self.actuator.peak_angle
        limit = 0.5 * (math.pi - rest)
        if peak >= limit:
            raise ValueError(
                f"A peak angle of {peak:.4g} rad lets the natural angle of a hub hinge reach pi, where its curvature "
                f"is infinite: for {self.robot.n_limbs} limbs the peak angle must stay below {limit:.4g} rad."
            )
        if self.robot.hub_hinge == "turning" and 2.0 * peak > rest * (1.0 + 1e-12):
            raise ValueError(
                f'With hub_hinge="turning" the natural opening angle must stay above zero: for {self.robot.n_limbs} '
                f"limbs the peak angle must be at most {0.5 * rest:.4g} rad, not {peak:.4g} rad."
            )

    def limits(self) -> Limits:
        """What a solution has to keep, for the kernels.

        The error that a step may make per second is `error_rate` limb lengths per stroke; how it follows from the
        tolerance on the path was measured, see ADAPTATION.
        """
        numerics, speed = self.numerics, self.robot.limb_length / self.actuator.period
        tolerance = numerics.path_tolerance
        return Limits(
            tolerance=numerics.newton_tolerance * self.robot.limb_length,
            max_iterations=numerics.max_iterations,
            adaptive=tolerance is not None,
            error_rate=0.0 if tolerance is None else speed * (tolerance / ADAPTATION[0]) ** ADAPTATION[1],
        )

    def rods(self) -> Rods:
        """The scene's coefficients for the kernels, see der/rods.py."""
        robot, fluid = self.robot, self.fluid
        return make_rods(
            n_limbs=robot.n_limbs,
            nodes_per_limb=robot.nodes_per_limb,
            limb_length=robot.limb_length,
            rod_radius=robot.rod_radius,
            youngs_modulus=robot.youngs_modulus,
            density=robot.density,
            hub_hinge=robot.hub_hinge,
            fluid_density=0.0 if fluid is None else fluid.density,
            drag_coefficient=0.0 if fluid is None else fluid.drag_coefficient,
            tangential_drag_coefficient=None if fluid is None else fluid.tangential_drag_coefficient,
            current=None if fluid is None or fluid.current is None else fluid.current.rows(),
            held_nodes=self.held_nodes,
            loads=self.loads,
        )
