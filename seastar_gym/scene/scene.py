"""`Scene`: robot, fluid, actuator, contact and numerics of a simulation.

Each part checks itself, and a `Scene` checks the parts together. What cannot be modelled is refused with a ValueError
that says why in one sentence. Those of the type `Numbers` may be arrays of shape (n_robots,), one for each robot
of a batch.

`Contact`: forces between limbs that touch each other or a body. `load_scene`: a scene of a file of Python or JSON.
"""

from __future__ import annotations

import importlib.util
import math
import runpy
import sys
import traceback
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from operator import itemgetter
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, cast, get_args

import numpy as np

from seastar_gym.files import read_json
from seastar_gym.scene.actuators.base import Actuator, check_actuator, complete, is_actuator
from seastar_gym.scene.actuators.curves import SmaPulse
from seastar_gym.scene.body import Body
from seastar_gym.scene.checks import (
    is_finite_number,
    require_choice,
    require_count,
    require_file,
    require_flag,
    require_numbers,
    shown,
)
from seastar_gym.scene.limb import AlongLimb
from seastar_gym.scene.number import Numbers, as_tuple, batch_size, check_numbers, chosen, make_floats, positive
from seastar_gym.scene.numerics import DEFAULT, DEFAULT_FIDELITY, MAX_STEPS, PRESETS, Fidelity, Numerics
from seastar_gym.scene.robot import Seastar
from seastar_gym.scene.section import Disc
from seastar_gym.scene.serial import FROM_FILES, from_dict, is_term, register_part, scene_html, short_repr, to_dict
from seastar_gym.scene.shape import cross_at_rest, n_hub_hinges, natural_hub_angle, touching_at_rest, turn_per_hinge
from seastar_gym.scene.water import Water

LARGEST_OVERLAP = 0.5
"""Depth over the distance at which limbs touch, beyond which a simulator warns: forces are linear in the depth, and
limbs that meet twice as fast come twice as deep, to each other's centre lines, and would pass through each other. Near
a hub whose clamps turn past each other, coarse meshes see less of it than fine ones."""


@register_part
@dataclass(frozen=True)
class Contact:
    """Contact: limbs that touch push each other apart, without friction, and so do limbs and a body.

    See rods/contact/forces.py. A body is as hard as a limb that touches it. Limbs do not meet it by their root edges.
    `StrokeReport.largest_overlap` has the depth to which they press; beyond LARGEST_OVERLAP a simulator warns, once.

    modulus: Force per length of limb and per depth of overlap [Pa]. None means pi/6 of Young's modulus, the value of
        incompressible elastic cylinders side by side: pi/4 E*, 1/E* = 2 (1 - 0.5^2)/E (Popov, Contact Mechanics and
        Friction).
        It suits any mesh: limbs give way at a point over 1.57 radii.
    layer: Length over which a limb gives way where it is pressed at a point [m], in place of a modulus, for coarse
        meshes that do not resolve the default's. Each limb has the modulus 4 EI/layer^4 of its own bending stiffness:
        a beam on an elastic foundation k decays as exp(-x (k/4 EI)^(1/4)) from where it is pressed, and a force F
        presses it F layer^3/(8 EI) deep (Hetenyi, Beams on Elastic Foundation). Softer than the limbs themselves are,
        it changes where they go, and limbs that press hard pass through each other sooner, which stops their robot.
    opening_angle: Angle between neighbouring limbs at the hub at which they touch [rad]. Since all limbs begin at one
        point, they taper towards it over three radii divided by this angle, along a cubic that is flat at either end:
        limbs that are pressed onto each other near the hub come to stand at this angle. They lie within cones that fit
        into it. On a body they taper likewise from their roots, and must leave its rim at more than half the angle.
    """

    modulus: Annotated[Numbers | None, positive("Pa")] = None
    opening_angle: Annotated[float, positive("rad")] = 0.25
    layer: Annotated[Numbers | None, positive("m")] = None

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.modulus is not None and self.layer is not None:
            raise ValueError("Contact has either a modulus [Pa] or a layer [m], which says the same.")


@register_part
@dataclass(frozen=True)
class Scene:
    """Description of a simulation: robot, fluid, actuator, contact, forces and numerics.

    robot: Robot of limbs around a hub.
    fluid: Fluid around the robot. None means vacuum.
    actuator: Actuator that turns the limbs at the hub.
    numerics: Settings of time stepping. Without any, they are those of the fidelity "balanced".
    held_nodes: Indices of nodes that do not move. Holding the hub and a limb's first node clamps the limb at the hub,
        and keeps the hub from turning; limbs of two edges, the chapter's, and those with more nodes held are clamped
        in the middle of the last edge that is held.
    loads: Constant forces on nodes, (node, F_x, F_y) [N] each.
    limb_strengths: Factors by which the rotations of the limbs are reduced, from 0 (no rotation) to 1 (full), one per
        limb. () means full rotation.
    contact: Contact between limbs, and with a body. None lets limbs pass through each other, as in the chapter.
    gravity: Gravitational acceleration in the plane (g_x, g_y) [m/s^2]. Limbs feel their weight minus the buoyancy of
        the fluid that they displace. None means no gravity in the plane.
    terms: Forces of your own, of classes that `register_term` has registered.

    >>> from dataclasses import replace
    >>> from seastar_gym import Scene, Seastar, UniformCurrent, Water
    >>> scene = Scene(Seastar(n_limbs=8), Water(current=UniformCurrent(u_x=0.002)))
    >>> scene
    Scene(robot=Seastar(n_limbs=8), fluid=Water(current=UniformCurrent(u_x=0.002)))
    >>> replace(scene, fluid=Water()).robot.n_limbs
    8
    >>> Scene(Seastar(limb_length=-0.1))
    Traceback (most recent call last):
    ValueError: limb_length must be a positive, finite number [m], not -0.1.
    """

    robot: Seastar = field(default_factory=Seastar)
    fluid: Water | None = field(default_factory=Water)
    actuator: Actuator = field(default_factory=SmaPulse)
    numerics: Numerics = field(default_factory=partial(replace, DEFAULT, named=False))
    held_nodes: tuple[int, ...] = ()
    loads: tuple[tuple[int, float, float], ...] = ()
    limb_strengths: tuple[float, ...] = ()
    contact: Contact | None = None
    gravity: tuple[float, float] | None = None
    terms: tuple[Any, ...] = ()

    def __post_init__(self) -> None:
        make_floats(self)
        for name, value, kinds in (
            ("robot", self.robot, Seastar),
            ("fluid", self.fluid, Water | None),
            ("numerics", self.numerics, Numerics),
            ("contact", self.contact, Contact | None),
        ):
            if not isinstance(value, kinds):
                raise ValueError(f"Scene.{name} must be a {kinds}, not {shown(value)}.")
        if not is_actuator(self.actuator):
            raise ValueError(f"Scene.actuator must be an Actuator such as SmaPulse(), not {shown(self.actuator)}.")
        check_actuator(self.actuator)
        self._check_terms()
        batch_size(self)
        self._check_hub_hinges()
        self._check_strengths()
        self._check_holds_and_loads()
        self._check_coefficients()
        self._check_contact()
        self._check_body()

    def __repr__(self) -> str:
        return short_repr(self)

    def _repr_html_(self) -> str:
        return scene_html(self)

    def _check_strengths(self) -> None:
        require_numbers("limb_strengths", self.limb_strengths, "1")
        if len(self.limb_strengths) not in (0, self.robot.n_limbs):
            raise ValueError(f"limb_strengths must be one number per limb, not {shown(self.limb_strengths)}.")
        if not all(0.0 <= strength <= 1.0 for strength in self.limb_strengths):
            raise ValueError(f"limb_strengths must be from 0 to 1, not {shown(self.limb_strengths)}.")

    def _check_holds_and_loads(self) -> None:
        if not isinstance(self.held_nodes, tuple) or not isinstance(self.loads, tuple):
            raise ValueError(
                f"held_nodes and loads must be tuples, not {shown(self.held_nodes)} and {shown(self.loads)}."
            )
        for load in self.loads:
            if not isinstance(load, tuple) or len(load) != 3 or not all(map(is_finite_number, load[1:])):
                raise ValueError(f"A load is (node, F_x, F_y) with finite forces [N], not {shown(load)}.")
        if self.gravity is not None:
            require_numbers("gravity", self.gravity, "m/s^2")
            if len(self.gravity) != 2:
                raise ValueError(f"gravity must be two numbers (g_x, g_y) [m/s^2], not {shown(self.gravity)}.")
        for node in (*self.held_nodes, *(load[0] for load in self.loads)):
            require_count("a held or loaded node", node, 0, self.robot.n_nodes - 1)

    def _check_terms(self) -> None:
        if not isinstance(self.terms, tuple) or not all(map(is_term, self.terms)):
            raise ValueError(
                f"Scene.terms must be a tuple of terms of classes that seastar_gym.register_term has registered, not "
                f"{shown(self.terms)}."
            )
        for term in self.terms:
            check_numbers(term, f"{type(term).__name__}.")
        if self.terms and self.robot.has_body:
            raise ValueError("Own terms act on the nodes of limbs, and know of no body: use a robot whose limbs meet.")

    def _check_contact(self) -> None:
        if self.contact is None:
            return
        if self.contact.layer is not None:
            self._check_layer(as_tuple(self.contact.layer))
        if self.robot.body is not None and self.robot.has_body:
            self._check_contact_with_body(self.robot.body, self.contact)
            return

        robot, pairs = self.robot, self.robot.limbs_that_may_touch()
        if not pairs:
            raise ValueError("Contact is modelled between limbs less than half a turn apart, and this robot has none.")
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

    def _check_layer(self, layers: tuple[float, ...]) -> None:
        """Refuse layers of contact whose modulus overflows or vanishes."""
        robots = [chosen(self.robot, choose) for choose in (min, max)]
        EI = [cut.EI for robot in robots for limb in robot.limb_shapes() for cut in limb.corners(robot.density)]
        with np.errstate(all="ignore"):
            moduli = 4.0 * np.array(EI)[:, None] / np.array(layers) ** 4
        if not (np.isfinite(moduli) & (moduli > 0.0)).all():
            raise ValueError(
                f"Contact.layer={_span(layers)} m has a modulus that overflows or vanishes in double "
                "precision: use a length closer to the limbs' radius."
            )

    def _check_contact_with_body(self, body: Body, contact: Contact) -> None:
        robot, pairs = self.robot, self.robot.limbs_that_may_touch()
        for index in range(batch_size(robot) or 1):
            limbs = robot.limb_shapes(index)
            touching = touching_at_rest(limbs, robot.nodes_per_limb, pairs, body.shape, contact.opening_angle)
            if touching is not None:
                raise ValueError(
                    f"At rest {touching}, so contact cannot keep them apart: attach limbs at the rim, farther from "
                    "each other, or use a smaller Contact.opening_angle."
                )

    def _check_coefficients(self) -> None:
        """Refuse numbers that are finite alone but overflow or vanish together, and too many steps."""
        if self.actuator.period / self.numerics.step > MAX_STEPS:
            raise ValueError(
                f"A step of {self.numerics.step:.4g} s makes more than {MAX_STEPS:,} steps of a stroke of "
                f"{self.actuator.period:.4g} s: use a longer step."
            )
        extremes = (min, max) if self.n_robots else (min,)
        try:
            with np.errstate(all="ignore"):
                sound = all(self._has_sound_coefficients(choose) for choose in extremes)
        except (OverflowError, ZeroDivisionError):
            sound = False
        if not sound:
            raise ValueError(
                f"Stiffnesses or masses overflow or vanish in double precision {self._named_coefficients()}: use "
                "numbers closer to those of a robot."
            )

    def _check_body(self) -> None:
        """Refuse a body whose numbers overflow or vanish together, once those of limbs are known not to."""
        body = self.robot.body
        if body is None or not self.robot.has_body:
            return
        try:
            with np.errstate(all="ignore"):
                sound = all(_has_sound_body(chosen(self.robot, choose)) for choose in (min, max))
        except (OverflowError, ZeroDivisionError):
            sound = False
        if not sound:
            far = max(body.shape.reach, *(math.hypot(*limb.root) for limb in self.robot.limb_shapes()))
            raise ValueError(
                f"Mass, rotational inertia or drag of a body overflow or vanish in double precision: it reaches "
                f"{far:.4g} m from the hub, with mass={shown(body.mass)}, inertia={shown(body.inertia)} and "
                f"centre_of_mass={shown(body.centre_of_mass)}."
            )

    def _named_coefficients(self) -> str:
        """Numbers that stiffnesses and masses are made of, in words."""
        robots = [chosen(self.robot, choose) for choose in (min, max)]
        limbs = [limb for robot in robots for limb in robot.limb_shapes()]
        sections = [limb.section for limb in limbs]
        of_discs = [r for section in sections if isinstance(section, Disc) for r in as_tuple(section.radius)]
        others = {shown(section) for section in sections if not isinstance(section, Disc)}
        named = [f"radii of {_span(of_discs)} m", *others] if of_discs else [*others]
        return (
            f"for limbs {_span(limb.length for limb in limbs)} m long, with {', '.join(named)}, "
            f"Young's moduli of {_span(E for limb in limbs for E in limb.youngs_modulus)} Pa "
            f"and densities of {_span(robot.density for robot in robots)} kg/m^3"
        )

    def _has_sound_coefficients(self, choose: Callable[[tuple[float, ...]], float]) -> bool:
        """Whether squared lengths, stiffnesses and masses of edges, and their reciprocals, are positive and finite."""
        robot = chosen(self.robot, choose)
        numbers = []
        unlike = {(limb.length, limb.section, limb.youngs_modulus): limb for limb in robot.limb_shapes()}
        for limb in unlike.values():
            for squared_length, EA_over_l, EI_over_l, mass in limb.extreme_edges(robot.nodes_per_limb, robot.density):
                numbers += [squared_length, EA_over_l, EI_over_l, 0.5 * mass, robot.n_limbs * mass]
        found = np.array([*numbers, *(1.0 / number for number in numbers)])
        return bool((np.isfinite(found) & (found > 0.0)).all())

    def _check_hub_hinges(self) -> None:
        """Refuse peak angles at which a hub hinge reaches pi, where its curvature is infinite.

        Neighbours that are turned apart turn the hinge between them by two peak angles.
        """
        robot, peak = self.robot, float(np.max(self.actuator.peak_angle))
        if robot.along is not None:
            self._check_along(robot.along, peak)
            return
        if robot.discretisation == "continuum" and (robot.n_limbs > 1 or robot.has_body):
            if peak >= math.pi:
                raise ValueError(f"A peak angle must stay below pi, not {peak:.4g} rad.")
            return
        hinges = robot.limb_shapes()[: n_hub_hinges(robot.n_limbs)]
        if not hinges:
            if peak > 0.0:
                raise ValueError("One limb has no hub hinge for an actuator to turn: use SmaPulse(peak_angle=0.0).")
            return
        widest = max(abs(natural_hub_angle(hinge.gap, robot.hub_hinge)) for hinge in hinges)
        limit = 0.5 * (math.pi - widest)
        if robot.hub_hinge == "turning":
            # Without memory, only some commands reach the limit, and the simulator refuses those.
            limit *= 1.0 - 1e-12 if complete(self.actuator).has_memory else 1.0 + 1e-12
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

    def _check_along(self, along: AlongLimb, peak: float) -> None:
        """Refuse peak angles at which a hinge, or a clamp, reaches pi. Natural curvatures add to the turn of hinges."""
        for choose in (min, max):
            robot = chosen(self.robot, choose)
            at_clamp, *within = peak * np.abs(chosen(along, choose).hinge_shares(robot.nodes_per_limb))
            curved = max(abs(turn_per_hinge(limb, robot.nodes_per_limb)) for limb in robot.limb_shapes())
            turn = max([at_clamp, *(turn + curved for turn in within)])
            if turn >= math.pi:
                raise ValueError(
                    f"A peak angle of {peak:.4g} rad turns a hinge by {turn:.4g} rad, not below pi: use a smaller one, "
                    "or more nodes per limb."
                )

    @classmethod
    def preset(cls, fidelity: Fidelity) -> Scene:
        """The chapter's robot and water with the nodes per limb, discretisation and numerics of a fidelity.

        "chapter" is the chapter's discretisation, the others are of the continuum: "rapid", "fast", "balanced",
        "accurate" and "reference".
        `seastar_gym.accuracy.chapters_certificate().of(scene)` returns the measured errors and speed of each.

        >>> Scene.preset("fast")
        Scene(robot=Seastar(nodes_per_limb=7, discretisation='continuum'))
        """
        require_choice("fidelity", fidelity, get_args(Fidelity))
        discretisation, nodes_per_limb, numerics = PRESETS[fidelity]
        return cls(Seastar(nodes_per_limb=nodes_per_limb, discretisation=discretisation), numerics=numerics)

    def at(self, fidelity: Fidelity | None = None, instead: bool = False) -> Scene:
        """Scene with the nodes per limb, discretisation and numerics of a fidelity, as far as it names none itself.

        Held and loaded nodes are counted on a mesh, so a scene with any keeps its own. ValueError where scene and
        fidelity name different numerics.

        fidelity: None means that of the scene if it names its numerics, otherwise "balanced".
        instead: Whether those of the fidelity replace what the scene names.
        """
        require_flag("instead", instead)
        wanted = DEFAULT_FIDELITY if fidelity is None else fidelity
        require_choice("fidelity", wanted, get_args(Fidelity))
        discretisation, nodes_per_limb, numerics = PRESETS[wanted]
        keeps = self.numerics.named and not instead
        if keeps and fidelity is not None and self.numerics != numerics:
            raise ValueError(
                f'fidelity="{fidelity}" contradicts the numerics that the scene names, {shown(self.numerics)}: '
                "give one of them."
            )
        if self.held_nodes or self.loads:
            discretisation, nodes_per_limb = self.robot.discretisation, self.robot.nodes_per_limb
        if instead:
            robot = replace(self.robot, discretisation=discretisation, nodes_per_limb=nodes_per_limb)
        else:
            robot = self.robot.resolved(discretisation, nodes_per_limb)
        return replace(self, robot=robot, numerics=self.numerics if keeps else numerics)

    @property
    def is_chapters(self) -> bool:
        """Whether all is the chapter's except numerics, nodes per limb and discretisation."""
        chapters = Scene(Seastar(nodes_per_limb=self.robot.nodes_per_limb, discretisation=self.robot.discretisation))
        compared = (each.name for each in fields(self) if each.compare and each.name != "numerics")
        return all(getattr(self, name) == getattr(chapters, name) for name in compared)

    def to_dict(self) -> dict[str, Any]:
        """Scene as plain data for JSON, see serial.py. ValueError if it could not be read back."""
        return to_dict(self)

    @classmethod
    def from_dict(cls, data: object) -> Scene:
        """Scene of the plain data that `to_dict` returned. ValueError for anything else."""
        return from_dict(data, cls)

    @property
    def n_robots(self) -> int | None:
        """Number of robots for which the scene has numbers, or None if it suits any number."""
        return batch_size(self)

    def of_robot(self, index: int) -> Scene:
        """Scene of one robot of a batch."""
        return chosen(self, itemgetter(index))


def _has_sound_body(robot: Seastar) -> bool:
    """Whether mass, inertia about the hub, with halves of root edges, and drag of turning are finite, of one robot."""
    body, limbs = cast(Body, robot.body), robot.limb_shapes()
    mass, (x, y), widest = body.mass_at(robot.density), body.centre, max(body.shape.widths)
    roots = [0.5 * limb.extreme_edges(robot.nodes_per_limb, robot.density)[0][3] for limb in limbs]
    arms = [limb.root[0] * limb.root[0] + limb.root[1] * limb.root[1] for limb in limbs]
    inertia = body.inertia_at(robot.density) + mass * (x * x + y * y) + float(np.dot(roots, arms))
    numbers = np.array([mass, inertia, 1.0 / inertia, *arms, widest**4 * body.height])
    return bool(np.isfinite(numbers).all())


def _span(numbers: Iterable[float]) -> str:
    """The smallest and the largest number, or the only one."""
    found = sorted(numbers)
    ends = dict.fromkeys(f"{end:.4g}" for end in (found[0], found[-1]))
    return " to ".join(ends)


def load_scene(file: str | PathLike[str] | None) -> Scene:
    """Scene of a file of Python or JSON, the chapter's for none.

    A file of Python is executed and defines `scene`; it may import modules of its folder and of the current one. One of
    JSON is as `Scene.to_dict` writes it.
    """
    if file is None:
        return Scene()
    require_file("file", file)
    file = Path(file)
    if not file.is_file():
        raise ValueError(f"{file} is no file.")
    if file.suffix == ".json":
        try:
            return Scene.from_dict(read_json(file))
        except ValueError as wrong:
            raise ValueError(f"{file} is no scene: {str(wrong).rstrip('.')}.") from wrong
    find_modules_in(file.parent, Path.cwd())
    try:
        found = _run(file).get("scene")
    except SyntaxError as wrong:
        raise ValueError(f"{file}, line {wrong.lineno}, is not Python: {wrong.msg}.") from wrong
    except Exception as wrong:  # the file is anybody's code
        if isinstance(wrong, ValueError) and is_ours(wrong):
            raise  # a sentence, as of a robot without limbs
        raise ValueError(failure_in(file, wrong)) from wrong
    if not isinstance(found, Scene):
        raise ValueError(f"{file} must define `scene`, a Scene.")
    return found


def _run(file: Path) -> dict[str, Any]:
    """Names that a file of Python defines. It is run as the module of its name, where Python would find that module.

    Other processes find the classes of a scene by the names of their modules.
    """
    name, spec = file.stem, None
    with suppress(ImportError, ValueError):  # no module has such a name
        spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None or Path(spec.origin).resolve() != file.resolve():
        return runpy.run_path(str(file))
    module, before = importlib.util.module_from_spec(spec), sys.modules.get(name)
    sys.modules[name] = module
    FROM_FILES.add(name)
    try:
        exec(compile(file.read_bytes(), str(file), "exec"), vars(module))
    except BaseException:
        sys.modules.pop(name)
        sys.modules.update({} if before is None else {name: before})
        raise
    return vars(module)


def find_modules_in(*folders: Path) -> None:
    """Have modules of folders found, after all others."""
    for folder in map(str, map(Path.absolute, folders)):
        if folder not in sys.path:
            sys.path.append(folder)
            importlib.invalidate_caches()


PACKAGE = Path(__file__).parents[1]


def is_ours(wrong: Exception) -> bool:
    """Whether this package raised an exception, so that it is a sentence, and not a library below somebody's code."""
    return Path(traceback.extract_tb(wrong.__traceback__)[-1].filename).is_relative_to(PACKAGE)


def failure_in(file: Path, wrong: Exception) -> str:
    """Sentence on an exception in a file of somebody's code, with the last line of it that was at work."""
    lines = [frame.lineno for frame in traceback.extract_tb(wrong.__traceback__) if frame.filename == str(file)]
    place = f"line {lines[-1]}: " if lines else ""
    return f"{file}, {place}{type(wrong).__name__}: {' '.join(str(wrong).split()).rstrip('.')}."
