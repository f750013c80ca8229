"""`Seastar`: a robot of limbs around a hub."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from typing import Annotated, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from seastar_gym.scene.body import Body
from seastar_gym.scene.checks import MOST_LIMBS, require_choice, require_number, shown
from seastar_gym.scene.limb import AlongLimb, Limb, LimbShape, Stiffening
from seastar_gym.scene.number import (
    Numbers,
    UnnamedChoice,
    UnnamedCount,
    as_tuple,
    batch_size,
    check_numbers,
    chosen,
    is_named,
    not_negative,
    positive,
    whole,
)
from seastar_gym.scene.section import Disc
from seastar_gym.scene.serial import register_part
from seastar_gym.scene.shape import PointGroup, limbs_that_may_touch, point_group, rest_positions, turn_per_hinge

HubHinge = Literal["opening", "turning"]
Discretisation = Literal["chapter", "continuum"]

NODES: dict[Discretisation, int] = {"continuum": 12, "chapter": 10}
"""Nodes per limb of a robot that names none, where no fidelity chooses them."""


@register_part
@dataclass(frozen=True)
class Seastar:
    """Robot of limbs around a hub (Fig. 13.4a). Limbs are straight, equal, uniform and evenly spread unless overridden.

    n_limbs: Number of limbs.
    nodes_per_limb: N, the number of nodes of a limb including the hub. None means that a fidelity chooses it; without
        one it is 12, as of "balanced", and 10 in the chapter's discretisation.
    limb_length: L [m]. It is also the unit of length of tolerances and observations.
    rod_radius: r_0 [m], radius of the limbs.
    youngs_modulus: E [Pa].
    density: rho_m [kg/m^3], density of the limbs.
    hub_hinge: Measure of the hinge between two limbs at the hub, which only discretisation="chapter" has. "opening" is
        the angle psi between the limbs, from 0 to pi; for a gap wider than pi it is the gap less a full turn. "turning"
        is the interior turning angle pi - psi, as in the published codes of the chapter's authors.
    limbs: Overrides, one `Limb` for each limb, or () for none.
    relaxation_time: Relaxation time of Kelvin-Voigt damping [s], see rods/terms/damping.py and `relaxation_time`. None
        means no damping, as in the chapter.
    discretisation: "continuum" clamps limbs into a rigid hub that turns freely, with consistent masses, Simpson's rule
        for drag and Gregory's weights for bending. With ten nodes, the chapter's robot is within a per cent of
        infinitely many.
        "chapter" joins neighbouring limbs by hinges at the hub, and lumps mass and drag at the nodes, as the chapter
        does: with ten nodes that robot is 26 % off. With infinitely many nodes the two are the same robot.
        None means that a fidelity chooses it; without one it is "continuum".
    along: How an actuator's rotation is spread along its limb. None means that it turns the limb at the hub.
    stiffening: How much stiffer a limb is while its actuator is hot. None means that heat does not stiffen it.
    body: Body between the limbs, which are clamped to it, instead of the point hub. None means a point.

    A single limb swings freely about the hub, and no actuator turns it there. In the chapter's discretisation two limbs
    have one hub hinge; straight limbs with hub_hinge="turning" then form a plain rod.
    """

    n_limbs: Annotated[int, whole(1, MOST_LIMBS)] = 5
    nodes_per_limb: Annotated[int | Any, whole(2, 10_000)] = None  # a number once it is constructed
    limb_length: Annotated[Numbers, positive("m")] = 0.1
    rod_radius: Annotated[Numbers, positive("m")] = 1.6e-3
    youngs_modulus: Annotated[Numbers, positive("Pa")] = 1e6
    density: Annotated[Numbers, positive("kg/m^3")] = 1000.0
    hub_hinge: HubHinge = "opening"
    limbs: tuple[Limb, ...] = ()
    relaxation_time: Annotated[Numbers | None, not_negative("s")] = None
    discretisation: Discretisation | Any = None  # a choice once it is constructed
    along: AlongLimb | None = None
    stiffening: Stiffening | None = None
    body: Body | None = None

    def __post_init__(self) -> None:
        self._fill_in_resolution()
        check_numbers(self)
        require_choice("hub_hinge", self.hub_hinge, get_args(HubHinge))
        if self.discretisation == "continuum" and self.hub_hinge != "opening":
            raise ValueError(
                f'hub_hinge="{self.hub_hinge}" measures hinges at the hub, which only discretisation="chapter" has: '
                "name that, too."
            )
        if self.n_limbs == 1 and self.hub_hinge != "opening":
            raise ValueError("One limb has no hub hinge that could be measured by its turning angle.")
        self._check_limbs()
        self._check_along()

    def _fill_in_resolution(self) -> None:
        if not is_named(self.discretisation):
            object.__setattr__(self, "discretisation", UnnamedChoice("continuum"))
        require_choice("discretisation", self.discretisation, get_args(Discretisation))
        if not is_named(self.nodes_per_limb):
            object.__setattr__(self, "nodes_per_limb", UnnamedCount(NODES[self.discretisation]))

    def resolved(self, discretisation: Discretisation, nodes_per_limb: int) -> Seastar:
        """Robot with a discretisation and its nodes per limb as far as it names none itself."""
        named, nodes = self.named_resolution
        own = discretisation if named is None else named
        others = nodes_per_limb if own == discretisation else NODES[own]
        return replace(self, discretisation=str(own), nodes_per_limb=int(others if nodes is None else nodes))

    @property
    def named_resolution(self) -> tuple[Discretisation | None, int | None]:
        """Discretisation and nodes per limb, None for what was not named."""
        discretisation, nodes = self.discretisation, self.nodes_per_limb
        return discretisation if is_named(discretisation) else None, nodes if is_named(nodes) else None

    def _check_along(self) -> None:
        for name, kind in (("along", AlongLimb), ("stiffening", Stiffening)):
            value = getattr(self, name)
            if not isinstance(value, kind | None):
                raise ValueError(f"{name} must be {kind.__name__}(...) or None, not {shown(value)}.")
            if value is not None and self.discretisation == "chapter":
                raise ValueError(
                    f'{name} acts on limbs along their length, which only discretisation="continuum" models.'
                )
        if self.stiffening is not None and any(limb.joint_stiffness is not None for limb in self.limbs):
            raise ValueError("Heat would stiffen the joints of limbs, too, which is not modelled: leave one out.")

    def _check_limbs(self) -> None:
        if not isinstance(self.limbs, tuple) or not all(isinstance(limb, Limb) for limb in self.limbs):
            raise ValueError(f"limbs must be a tuple of Limb, not {shown(self.limbs)}.")
        if len(self.limbs) not in (0, self.n_limbs):
            raise ValueError(f"limbs must be one Limb for each of the {self.n_limbs}, or none, not {len(self.limbs)}.")
        directions = [limb.direction for limb in self.limbs if limb.direction is not None]
        if len(directions) not in (0, self.n_limbs):
            raise ValueError("Either every limb has a direction or none has.")
        if directions and (directions[0] != 0.0 or (np.diff(directions) <= 0.0).any()):
            raise ValueError(f"Directions of limbs must begin at 0 and increase [rad], not {shown(directions)}.")
        self._check_body()
        most = chosen(self, partial(max, key=abs))
        turn = max(abs(turn_per_hinge(shape, self.nodes_per_limb)) for shape in most.limb_shapes())
        if turn >= math.pi:
            raise ValueError(
                f"A natural curvature that turns neighbouring edges by {turn:.4g} rad, not below pi, is too much for "
                f"{self.nodes_per_limb} nodes per limb."
            )

    def _check_body(self) -> None:
        if self.discretisation != "continuum" and any(limb.joint_stiffness is not None for limb in self.limbs):
            raise ValueError('discretisation="chapter" joins limbs to each other, so they have no joint_stiffness.')
        if not isinstance(self.body, Body | None):
            raise ValueError(f"body must be a Body or None, not {shown(self.body)}.")
        if self.body is None:
            return
        if self.discretisation != "continuum":
            raise ValueError('discretisation="chapter" joins limbs in one point, so it has no room for a body.')
        if len(self.body.attachments) not in (0, self.n_limbs):
            raise ValueError(
                f"attachments must be one Attachment for each of the {self.n_limbs} limbs, or none, not "
                f"{len(self.body.attachments)}."
            )
        if self.body.attachments and any(limb.direction is not None for limb in self.limbs):
            raise ValueError("Directions of limbs are named by their attachments to the body or by Limb, not by both.")
        if not self.has_body and abs(sum(self._gaps(self.limbs)) - 2.0 * math.pi) > 1e-6:
            raise ValueError(
                "Limbs attached at the hub itself must leave it in different directions and be named anti-clockwise, "
                f"not in the directions {shown([at.direction for at in self.body.attachments])}."
            )

    def limb_shapes(self, index: int = 0) -> tuple[LimbShape, ...]:
        """Limbs with all values filled in, for robot `index` of a batch."""
        robot = chosen(self, itemgetter(index))
        limbs = robot.limbs or (Limb(),) * self.n_limbs
        directions = [limb.direction for limb in limbs if limb.direction is not None]
        directions = directions or [2.0 * math.pi * j / self.n_limbs for j in range(self.n_limbs)]
        roots = [(0.0, 0.0)] * self.n_limbs
        if robot.body is not None:
            attached = robot.body.attached(directions)
            directions, roots = [at.direction for at in attached], [(at.x, at.y) for at in attached]
        return tuple(
            LimbShape(
                direction=direction,
                gap=gap,
                length=robot.limb_length if limb.length is None else limb.length,
                section=limb.section or Disc(robot.rod_radius if limb.radius is None else limb.radius),
                youngs_modulus=as_tuple(robot.youngs_modulus if limb.youngs_modulus is None else limb.youngs_modulus),
                natural_curvature=limb.natural_curvature,
                root=root,
                joint_stiffness=limb.joint_stiffness,
            )
            for limb, direction, gap, root in zip(limbs, directions, self._gaps(limbs), roots, strict=True)
        )

    def _gaps(self, limbs: Sequence[Limb]) -> list[float]:
        """Angle from every limb to the next [rad]."""
        if self.body is not None and self.body.attachments:
            attached = np.array([at.direction for at in self.body.attachments])
            gaps = ((np.roll(attached, -1) - attached) % (2.0 * math.pi)).tolist()
            return [gap or 2.0 * math.pi for gap in gaps]
        directions = [limb.direction for limb in limbs if limb.direction is not None]
        return np.diff(directions, append=2.0 * math.pi).tolist() or [2.0 * math.pi / self.n_limbs] * self.n_limbs

    def limbs_that_may_touch(self) -> list[tuple[int, int]]:
        """Pairs of limbs that may touch, (right, left), counted from 0; on a body in any order."""
        alike, shapes = all(limb.length is None for limb in self.limbs), self.limb_shapes()
        if self.body is None or not self.has_body:
            return limbs_that_may_touch([shape.gap for shape in shapes], alike)
        if not alike or self.body.attachments or self.body.outline:
            return list(itertools.combinations(range(self.n_limbs), 2))
        return limbs_that_may_touch([shape.gap for shape in shapes], alike)

    def point_group(self, directed: bool = False) -> PointGroup:
        """Turns and mirrors that leave the robot unchanged; in a batch, every robot.

        directed: Whether the body feels flow along x and along y differently, whatever its outline is.
        """
        robots = [self.limb_shapes(index) for index in range(batch_size(self) or 1)]
        return point_group(robots, self.body, directed)

    @property
    def has_body(self) -> bool:
        """Whether there is a body that is more than the point hub."""
        return self.body is not None and not self.body.is_point

    @property
    def n_nodes(self) -> int:
        """Number of nodes, n_limbs (N - 1) + 1."""
        return self.n_limbs * (self.nodes_per_limb - 1) + 1

    @property
    def edge_length(self) -> Numbers:
        """Natural length of an edge [m], for a limb of length L."""
        return np.divide(self.limb_length, self.nodes_per_limb - 1)

    @property
    def lengths(self) -> tuple[Numbers, ...]:
        """Numbers on which the shape at rest depends: lengths [m] and natural curvatures [1/m]."""
        of_limbs = [number for limb in self.limbs for number in (limb.length, limb.natural_curvature)]
        return self.limb_length, *(number for number in of_limbs if number is not None)

    @property
    def opening_angle(self) -> float:
        """Smallest angle between neighbouring limbs at rest [rad]; pi with a body, as in a `StrokeReport`."""
        return math.pi if self.has_body else min(shape.gap for shape in self.limb_shapes())

    def nodes(self, index: int = 0) -> NDArray[np.float64]:
        """Node positions at rest [m], shape (n_nodes, 2). Order: hub, {1,1}..{1,N-1}, {2,1}..; limb 1 along +x.

        index: Robot of a batch, where numbers differ from robot to robot.
        """
        return rest_positions(self.limb_shapes(index), self.nodes_per_limb, self.discretisation == "continuum")


def relaxation_time(loss_factor: float, frequency: float) -> float:
    """Relaxation time tau [s] of a material with a loss factor eta = omega tau at a frequency [Hz]."""
    require_number("loss_factor", loss_factor, "1", zero_allowed=True)
    require_number("frequency", frequency, "Hz")
    return loss_factor / (2.0 * math.pi * frequency)


SILICONE = relaxation_time(0.1, 10.0)
"""Relaxation time of soft silicone [s], 1.59 ms: a loss factor of 0.1 at 10 Hz (docs/numerics.md)."""
