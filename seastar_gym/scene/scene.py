"""What is modelled: robot, fluid, actuator, contact and numerics, as frozen dataclasses in SI units.

Each part checks itself, and a `Scene` checks what the parts can be together; what cannot be modelled is refused with
a sentence that says why. Numbers named in a part's `PER_ROBOT` may be arrays of shape (n_robots,), one for each robot
of a batch.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from seastar_gym.scene.actuators.actuator import Actuator, StatefulActuator, check_actuator, is_actuator
from seastar_gym.scene.actuators.pulse import SmaPulse
from seastar_gym.scene.checks import is_finite_number, require_count, require_numbers
from seastar_gym.scene.contact import Contact
from seastar_gym.scene.fluid import Water
from seastar_gym.scene.numerics import MAX_STEPS, Numerics
from seastar_gym.scene.per_robot import batch_size, chosen
from seastar_gym.scene.robot import Seastar
from seastar_gym.scene.serial import from_dict, register_part, to_dict
from seastar_gym.scene.shape import cross_at_rest, n_hub_hinges, natural_hub_angle


@register_part
@dataclass(frozen=True)
class Scene:
    """A robot, the fluid around it (None: vacuum), its actuator and the numerics.

    numerics: The chapter's where none are named; environments then take those of their fidelity.
    held_nodes: Indices of nodes that stay where they are; hub and root node held clamp a limb.
    loads: Dead loads on nodes, (node, F_x, F_y) [N] each.
    limb_strengths: Share of its rotation that every limb still makes, from 0 (failed) to 1; () for all of it.
    contact: What limbs do to each other where they touch; None lets them pass through each other, as in the chapter.
    gravity: Acceleration of free fall in the plane (g_x, g_y) [m/s^2]; limbs feel their weight less the buoyancy of the
        fluid that they displace. None for none: limbs as dense as the fluid, or a plane that lies level.
    """

    robot: Seastar = field(default_factory=Seastar)
    fluid: Water | None = field(default_factory=Water)
    actuator: Actuator = field(default_factory=SmaPulse)
    numerics: Numerics = field(default_factory=partial(Numerics, named=False))
    held_nodes: tuple[int, ...] = ()
    loads: tuple[tuple[int, float, float], ...] = ()
    limb_strengths: tuple[float, ...] = ()
    contact: Contact | None = None
    gravity: tuple[float, float] | None = None

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
        if self.gravity is not None:
            require_numbers("gravity", self.gravity, "m/s^2")
            if len(self.gravity) != 2:
                raise ValueError(f"gravity must be two numbers (g_x, g_y) [m/s^2], not {self.gravity!r}.")
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
        """Whether squared lengths, stiffnesses and masses of edges, and their reciprocals, are positive and finite."""
        robot = chosen(self.robot, choose)
        numbers = []
        for limb in robot.limb_shapes():
            for squared_length, EA_over_l, EI_over_l, volume in limb.extreme_edges(robot.nodes_per_limb):
                half, hub = 0.5 * robot.density * volume, robot.n_limbs * robot.density * volume
                numbers += [squared_length, EA_over_l, EI_over_l, half, hub]
        found = np.array([*numbers, *(1.0 / number for number in numbers)])
        return bool((np.isfinite(found) & (found > 0.0)).all())

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
