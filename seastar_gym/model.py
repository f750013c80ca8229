"""Coefficients of a scene for the kernels of `rods`: the way from what a user says to what kernels read.

Limbs are divided into edges and nodes (`make_mesh`), every term makes its coefficients of that mesh, one line each, and
`Coefficients` joins those of a batch: one set for all lane groups, or one for each where robots have numbers of their
own. Bodies and currents are made likewise, and a scheme of time steps is found by its name.
"""

import math
from collections.abc import Iterable, Sequence
from functools import partial, singledispatch
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.lanes.plain import Lanes
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.lanes.rows import put_robot, side_by_side
from seastar_gym.rods import body as term
from seastar_gym.rods import newton as scales
from seastar_gym.rods.bundles import Rods
from seastar_gym.rods.contact import forces as contact
from seastar_gym.rods.contact.forces import Rim
from seastar_gym.rods.newton import Limits
from seastar_gym.rods.star import Mesh, Sections, mean
from seastar_gym.rods.step import OWN_SCHEMES, SCHEMES, Scheme, scheme_of, tableau
from seastar_gym.rods.terms import (
    added_mass,
    along,
    bending,
    clamp,
    damping,
    drag,
    gravity,
    hub,
    inertia,
    load,
    own,
    stretching,
)
from seastar_gym.rods.terms.current import GRID, LINEAR, VORTEX, Current, current_velocity
from seastar_gym.rods.terms.gravity import heaviness
from seastar_gym.scene import Scene, numerics
from seastar_gym.scene.body import GIVEN_DRAG, Body, Outline
from seastar_gym.scene.checks import shown
from seastar_gym.scene.limb import AlongLimb, LimbShape, Stiffening
from seastar_gym.scene.number import chosen, frame_of, of_robot, profile_at
from seastar_gym.scene.numerics import MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP
from seastar_gym.scene.robot import Seastar
from seastar_gym.scene.shape import natural_hub_angle, turn_per_hinge
from seastar_gym.scene.water import AnyCurrent, GridCurrent, ShearCurrent, UniformCurrent, Vortex, Water

Floats = NDArray[np.float64]


def make_mesh(limbs: Sequence[LimbShape], nodes_per_limb: int, density: float) -> Mesh:
    """Mesh of limbs of a density [kg/m^3] with nodes_per_limb - 1 edges of equal lengths each."""
    n_limbs, n_edges = len(limbs), nodes_per_limb - 1
    root_edges = np.array([limb.length / n_edges for limb in limbs])
    l = np.repeat(root_edges, n_edges)  # noqa: E741
    edges_at_node = np.where(np.arange(n_edges) < n_edges - 1, 1.0, 0.5)
    # Middles of edges, and nodes, as fractions of the length from hub to tip.
    at_edges, at_nodes = (np.arange(n_edges) + 0.5) / n_edges, np.arange(nodes_per_limb) / n_edges
    return Mesh(
        n_limbs=n_limbs,
        nodes_per_limb=int(nodes_per_limb),
        l=l,
        dl=np.concatenate([[0.5 * n_limbs * mean(root_edges)], l * np.tile(edges_at_node, n_limbs)]),
        root_edges=root_edges,
        limb_lengths=[limb.length for limb in limbs],
        at_edges=sections(limbs, density, at_edges, (-1,)),
        at_nodes=sections(limbs, density, at_nodes, (n_limbs, nodes_per_limb)),
        modulus_at_edges=np.concatenate([profile_at(limb.youngs_modulus, at_edges) for limb in limbs]),
        modulus_at_nodes=np.array([profile_at(limb.youngs_modulus, at_nodes) for limb in limbs]),
        natural_turn=[turn_per_hinge(limb, nodes_per_limb) for limb in limbs],
    )


def sections(limbs: Sequence[LimbShape], density: float, share: Floats, shape: tuple[int, ...]) -> Sections:
    """Cross sections of all limbs at fractions of their lengths, as arrays of a shape."""
    unlike = {(limb.section, limb.youngs_modulus): limb for limb in limbs}
    found = {each: limb.cuts(density, share) for each, limb in unlike.items()}
    columns = np.array([cut for limb in limbs for cut in found[limb.section, limb.youngs_modulus]]).T
    return Sections(*columns.reshape(len(columns), *shape))


GAUSS = np.polynomial.legendre.leggauss(4)
"""Places and weights of strips along a side: the torque of a plate that turns is off by 1 %."""


class Drag(NamedTuple):
    """Drag of a body: coefficient of all directions alike [kg/m], and strips as in rods/body_forces.py."""

    isotropic: float
    strips: Floats


class OnBody(NamedTuple):
    """A body's coefficients, and what it changes of the numbers per node, which become numbers per place (star.py).

    weight: Weight less buoyancy, (x, y) [N]; None without gravity.
    """

    coefficients: term.Body
    own_mass: float
    isotropic_drag: float
    weight: Floats | None
    n_limbs: int

    def with_corners(self, rim: Rim) -> "OnBody":
        """Coefficients of the body together with the corners of its outline, which contact needs."""
        return self._replace(coefficients=term.with_corners(self.coefficients, rim.corners))

    def mass(self, per_node: Floats) -> Floats:
        """Masses [kg]: the hub's with the body's."""
        return self._with_hub(per_node, per_node[0] + self.own_mass, np.zeros(self.n_limbs))

    def drag(self, mesh: Mesh, per_node: Floats) -> Floats:
        """Drag coefficients [kg/m]: the hub's are the body's, and those of half root edges belong to the roots."""
        halves = mesh.at_nodes.width[:, 0] * mesh.root_edges
        return self._with_hub(per_node, self.isotropic_drag, per_node[0] * halves / halves.sum())

    def loads(self, per_node: Floats | None) -> Floats | None:
        """Constant forces [N], rows of (x, y): the hub's with the body's weight."""
        if per_node is None:
            return None
        rows = np.concatenate([per_node, np.zeros(2 * (1 + self.n_limbs))])
        if self.weight is not None:
            rows[:2] += self.weight
        return rows

    def _with_hub(self, per_node: Floats, hub: float, at_roots: Floats) -> Floats:
        return np.concatenate([[hub], per_node[1:], [0.0], at_roots])


def make_body(robot: Seastar, mesh: Mesh, water: Water, gravity: tuple[float, float] | None) -> OnBody:
    """Coefficients of a robot's body."""
    body = robot.body
    assert body is not None
    arms = [limb.root for limb in robot.limb_shapes()]
    mass, drag = body.mass_at(robot.density), body_drag(body, water)
    fluid, turning = added_mass_of_body(body, water)
    coefficients = term.coefficients(
        mesh,
        robot.density,
        arms,
        mass=mass,
        centre=body.centre,
        inertia=body.inertia_at(robot.density) + turning,
        scale=power_of_two(max(robot.limb_length, body.shape.reach, *(float(np.hypot(*arm)) for arm in arms))),
        added_mass=fluid,
        strips=drag.strips,
        weight=None if gravity is None else weight_moment(robot, mesh, water, gravity, np.array(arms)),
    )
    weight = None if gravity is None else (mass - water.density * body.volume) * np.array(gravity)
    return OnBody(coefficients, mass, drag.isotropic, weight, mesh.n_limbs)


def body_rim(robot: Seastar) -> Rim:
    """Outline of a robot's body for contact; none for a body without a size."""
    assert robot.body is not None
    shape = robot.body.shape
    if shape.points:
        return Rim(np.array(shape.points), 0.0)
    return Rim(np.zeros((1 if shape.radius else 0, 2)), shape.radius)


def power_of_two(length: float) -> float:
    """The power of two above a length [m]: arcs over it are angles to the last bit."""
    return float(2.0 ** np.ceil(np.log2(length)))


def weight_moment(robot: Seastar, mesh: Mesh, water: Water, gravity: tuple[float, float], arms: Floats) -> Floats:
    """Free fall [m/s^2], and the moment of mass less that of displaced fluid about the hub [kg m], (x, y) each."""
    body = robot.body
    assert body is not None
    own = body.mass_at(robot.density) * np.array(body.centre)
    displaced = water.density * body.volume * np.array(body.shape.centre)
    of_roots = heaviness(mesh.at_nodes, partial(term.half_volumes, mesh), robot.density, water.density) @ arms
    return np.concatenate([gravity, own - displaced + of_roots])


def body_drag(body: Body, water: Water) -> Drag:
    """Drag from the outline, or of the coefficients that the body gives."""
    per_area = 0.5 * water.density * float(body.height)
    shape, C_d = body.shape, water.drag_coefficient if body.drag_coefficient is None else float(body.drag_coefficient)
    along, across = shape.widths
    if all(getattr(body, name) is None for name in GIVEN_DRAG):
        if not shape.points:
            return Drag(per_area * C_d * along, np.zeros((0, 4)))
        return Drag(0.0, outline_strips(shape, per_area * C_d))
    of_turning = C_d if shape.points else 0.0
    C_x, C_y, C_r = (
        default if given is None else float(given)
        for given, default in zip(
            (body.drag_along, body.drag_across, body.drag_turning), (C_d, C_d, of_turning), strict=True
        )
    )
    plate = max(along, across) ** 4 / 32.0
    strips = [[1.0, 0.0, 0.0, C_x * across], [0.0, 1.0, 0.0, C_y * along], [0.0, 0.0, 1.0, C_r * plate]]
    return Drag(0.0, np.array(strips) * [1.0, 1.0, 1.0, per_area])


def outline_strips(shape: Outline, per_area: float) -> Floats:
    """Strips of a polygon's sides, shape (n, 4); opposite ones that feel the same flow are one."""
    found: dict[tuple[float, ...], float] = {}
    for normal, length, middle in zip(*shape.sides(), strict=True):
        along = np.array([-normal[1], normal[0]])
        for place, weight in zip(*GAUSS, strict=True):
            x, y = middle + 0.5 * length * place * along
            flow = np.array([*normal, x * normal[1] - y * normal[0]])
            sign = next((np.sign(number) for number in flow if abs(number) > 1e-9), 1.0)
            key = tuple((np.round(sign * flow, 12) + 0.0).tolist())
            found[key] = found.get(key, 0.0) + 0.5 * per_area * 0.5 * length * weight
    return np.array([[*key, c] for key, c in found.items()])


def added_mass_of_body(body: Body, water: Water) -> tuple[Floats | None, float]:
    """(xx, xy, yy) [kg] of fluid that moves along with a body, and its moment of inertia [kg m^2]; None, 0 for none."""
    if water.added_mass_coefficient is None:
        return None, 0.0
    C_x, C_y, C_r = (
        water.added_mass_coefficient if given is None else float(given)
        for given in (body.added_mass_along, body.added_mass_across, body.added_mass_turning)
    )
    along, across = body.shape.widths
    per_area = water.density * float(body.height) * np.pi
    turning = C_r * per_area * (along**2 - across**2) ** 2 / 128.0
    return per_area * 0.25 * np.array([C_x * across**2, 0.0, C_y * along**2]), turning


@singledispatch
def current_rows(current: AnyCurrent) -> Current:
    """Kind and numbers of a current for the kernels."""
    raise TypeError(f"No kernel knows the current {current!r}.")


@current_rows.register
def _(current: UniformCurrent) -> Current:
    return Current(LINEAR, np.array([current.u_x, current.u_y, 0.0, 0.0, 0.0, 0.0]))


@current_rows.register
def _(current: ShearCurrent) -> Current:
    c, s = math.cos(current.direction), math.sin(current.direction)
    gradient = current.rate * np.outer([c, s], [-s, c])
    return Current(LINEAR, np.concatenate([np.zeros(2), gradient.ravel()]))


@current_rows.register
def _(current: Vortex) -> Current:
    strength = current.circulation / (2.0 * math.pi)
    return Current(VORTEX, np.array([current.x, current.y, strength, current.core_radius**2]))


@current_rows.register
def _(current: GridCurrent) -> Current:
    array = np.array(current.velocities)
    n_x, n_y, _ = array.shape
    return Current(GRID, np.array([*current.corner, 1.0 / current.spacing]), n_x, n_y, array.reshape(-1))


def velocities_at(current: AnyCurrent, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocities of the fluid [m/s] at points [m], both of shape (..., 2), in a current of one robot."""
    x, y = (Lanes(points[..., axis]) for axis in (0, 1))
    found = np.empty(points.shape)
    for axis, velocity in enumerate(current_velocity(current_rows(current), x, y)):
        found[..., axis] = velocity.numbers
    return found


VACUUM = Water(density=0.0, drag_coefficient=0.0)


def make_rods(scene: Scene, index: int = 0) -> Rods:
    """Coefficients of robot `index` of a scene for the kernels, see rods/bundles.py.

    Stretching takes a limb's profile in the middle of its edges, everything else at its nodes. The hub has half of
    every root edge, with the mean of the profiles there.
    """
    robot = chosen(scene.robot, itemgetter(index))
    water = VACUUM if scene.fluid is None else chosen(scene.fluid, itemgetter(index))
    touch = None if scene.contact is None else chosen(scene.contact, itemgetter(index))
    limbs = robot.limb_shapes()
    # Limbs that begin apart have no opening angle that could close: negative angles are not noted.
    hub_angles = [-1.0 if robot.has_body else natural_hub_angle(limb.gap, robot.hub_hinge) for limb in limbs]
    C_d, C_t, C_a = water.drag_coefficient, water.tangential_drag_coefficient, water.added_mass_coefficient
    mesh = make_mesh(limbs, robot.nodes_per_limb, robot.density)
    continuum = robot.discretisation == "continuum"
    drags = drag.coefficients(mesh, water.density, C_d, C_t, simpson=continuum)
    stretched = stretching.coefficients(mesh)
    masses = inertia.coefficients(mesh, robot.density, consistent=continuum)
    weight = gravity.coefficients(mesh, robot.density, water.density, scene.gravity)
    loads = load.total(load.coefficients(mesh, scene.loads), weight)
    on_body, rim = None, None
    if robot.has_body:
        on_body = make_body(robot, mesh, water, scene.gravity)
        if touch is not None:
            rim = body_rim(robot)
            on_body = on_body.with_corners(rim)
        masses = masses._replace(node=on_body.mass(masses.node))
        drags = drags._replace(node=on_body.drag(mesh, drags.node))
        loads = on_body.loads(loads)
    inertia.hold(masses.node, scene.held_nodes)
    terms = own.coefficients([chosen(term, itemgetter(index)) for term in scene.terms], mesh)
    all_scales = scales.coefficients(mesh, stretched, robot.density, water.density, C_d, masses.node, scene.held_nodes)
    n_free = len(mesh.dl) + robot.has_body
    return Rods(
        n_limbs=mesh.n_limbs,
        edges_per_limb=mesh.nodes_per_limb - 1,
        n_edges=len(mesh.l),
        n_nodes=len(mesh.dl),
        n_free=n_free,
        n_places=len(drags.node),
        n_points=n_free if on_body is None else n_free + on_body.coefficients.n_arms,
        stretching=stretched,
        bending=with_joints(
            bending.coefficients(mesh, continuum, held_edges(scene)), [limb.joint_stiffness for limb in limbs]
        ),
        hub=hub.coefficients(hub_angles, turning=robot.hub_hinge == "turning"),
        clamp=clamp.coefficients(mesh, [limb.direction for limb in limbs]) if continuum else None,
        along=limb_actuation(scene, index, mesh.natural_turn),
        inertia=masses,
        drag=drags,
        added_mass=added_mass.coefficients(mesh, water.density, C_a, consistent=continuum),
        damping=damping.coefficients(robot.relaxation_time),
        current=None if water.current is None else current_rows(water.current),
        load=loads,
        own=terms,
        contact=None
        if touch is None
        else contact.coefficients(
            mesh, robot.limbs_that_may_touch(), touch.modulus, touch.opening_angle, rim, touch.layer
        ),
        scales=all_scales if terms is None else scales.of_unknown_forces(all_scales),
        body=None if on_body is None else on_body.coefficients,
    )


def held_edges(scene: Scene) -> list[int]:
    """Limbs whose root edge is held, by the hub and node 1, and no more of which is."""
    robot, held = scene.robot, set(scene.held_nodes)
    roots = [1 + limb * (robot.nodes_per_limb - 1) for limb in range(robot.n_limbs)]
    return [limb for limb, root in enumerate(roots) if {0, root} <= held and root + 1 not in held]


def limb_actuation(scene: Scene, index: int, natural_turn: list[float]) -> along.Along | None:
    """How actuators act on limbs along their length; None where they act at the hub only."""
    robot, actuator = chosen(scene.robot, itemgetter(index)), chosen(scene.actuator, itemgetter(index))
    if robot.along is None and robot.stiffening is None:
        return None
    spread, hot = robot.along or AlongLimb(share=0.0), robot.stiffening or Stiffening(ratio=1.0)
    shares = spread.hinge_shares(robot.nodes_per_limb)
    return along.coefficients(natural_turn, shares, float(actuator.peak_angle), hot.ratio, hot.middle, hot.width)


def with_joints(hinges: bending.Bending, stiffnesses: Sequence[float | None]) -> bending.Bending:
    """Bending with joints of these stiffnesses [N m/rad], springs at the hub in a row with the clamps; None for none.

    Exact for small turns; a joint and its clamp share larger ones as the clamp alone does, K (1 - cos(turn)).
    """
    EI_over_dl, dl_over_EI = hinges.EI_over_dl.copy(), hinges.dl_over_EI.copy()
    roots = np.arange(len(stiffnesses)) * (len(EI_over_dl) // len(stiffnesses))
    for root, stiffness in zip(roots.tolist(), stiffnesses, strict=True):
        if stiffness is not None:
            dl_over_EI[root] += 1.0 / stiffness
            EI_over_dl[root] = 1.0 / dl_over_EI[root]
    return hinges._replace(EI_over_dl=EI_over_dl, dl_over_EI=dl_over_EI)


def make_limits(scene: Scene, index: int = 0) -> Limits:
    """Tolerances and limits of the solver for robot `index` of a scene."""
    numerics, length = scene.numerics, of_robot(scene.robot.limb_length, index)
    n_steps = math.ceil(scene.actuator.period / numerics.step)
    return Limits(
        tolerance=np.array([numerics.newton_tolerance * length]),
        max_iterations=numerics.max_iterations,
        most_iterations=MOST_ITERATIONS + MOST_ITERATIONS_PER_STEP * n_steps,
    )


class Coefficients:
    """Coefficients of a batch of robots of one scene.

    If no number differs from robot to robot, all lane groups share one set. Otherwise each has its own, with one robot
    per lane.

    are_shared: Whether all lane groups share one set.
    n_changes: How often `set_scene` has changed them.
    rest: Node positions at rest [m], shape (n_sets, 2 n_nodes, N_LANES). With a body, its angle and the roots of its
        limbs follow, see rods/star.py: 2 + 2 n_limbs rows more.
    limb_length: Limb length L of the robot [m], shape (n_sets, 1, N_LANES).
    """

    def __init__(self, scene: Scene, n_robots: int):
        self.n_robots = n_robots
        self.n_changes = 0
        self._make(scene)

    def _make(self, scene: Scene) -> None:
        if scene.n_robots not in (None, self.n_robots):
            raise ValueError(f"The scene has numbers for {scene.n_robots} robots, the batch {self.n_robots}.")
        self._scene, self.are_shared = scene, scene.n_robots is None
        n_sets = 1 if self.are_shared else -(-self.n_robots // N_LANES)
        if self.are_shared:
            self._rods, self._limits = [make_rods(scene)], [make_limits(scene)]
        else:
            # Lanes left over repeat the last robot.
            robots = np.minimum(np.arange(n_sets * N_LANES), self.n_robots - 1).reshape(n_sets, N_LANES).tolist()
            self._rods = [side_by_side([make_rods(scene, robot) for robot in group]) for group in robots]
            self._limits = [side_by_side([make_limits(scene, robot) for robot in group]) for group in robots]
        robot, n_rows = scene.robot, 2 * scene.robot.n_nodes
        self.rest = np.zeros((n_sets, n_rows + (2 + 2 * robot.n_limbs if robot.has_body else 0), N_LANES))
        if robot.has_body:
            self.rest[:, n_rows + 2 :] = np.reshape([limb.root for limb in robot.limb_shapes()], (-1, 1))
        self.limb_length = np.zeros((n_sets, 1, N_LANES))
        self._put_lengths(range(n_sets * N_LANES))

    def _put_lengths(self, places: Iterable[int]) -> None:
        """Write rest positions and limb lengths of robots, by place (lane group times N_LANES plus lane)."""
        shapes: dict[tuple[float, ...], Floats] = {}  # robots of equal lengths have equal shapes
        for place in places:
            (group, lane), robot = divmod(place, N_LANES), min(place, self.n_robots - 1)
            lengths = tuple(of_robot(numbers, robot) for numbers in self._scene.robot.lengths)
            if lengths not in shapes:
                shapes[lengths] = self._scene.robot.nodes(robot).reshape(-1)
            self.rest[group, : len(shapes[lengths]), lane] = shapes[lengths]
            self.limb_length[group, 0, lane] = lengths[0]

    def set_scene(self, scene: Scene, chosen: NDArray[np.bool_]) -> None:
        """Continue with a scene that differs only in numbers that may differ from robot to robot.

        chosen: Robots whose numbers have changed, shape (n_robots,).
        """
        if not isinstance(scene, Scene) or frame_of(scene) != frame_of(self._scene):
            raise ValueError("set_scene needs a scene of the same terms that differs in numbers of each robot alone.")
        self.n_changes += 1
        if self.are_shared or scene.n_robots != self.n_robots:
            self._make(scene)
            return
        self._scene = scene
        robots = np.flatnonzero(chosen).tolist()
        for robot in robots:
            group, lane = divmod(robot, N_LANES)
            put_robot(self._rods[group], lane, make_rods(scene, robot))
            put_robot(self._limits[group], lane, make_limits(scene, robot))
        self._put_lengths(robots)

    def rods(self, group: int) -> Rods:
        """Coefficients of a lane group."""
        return self._rods[group % len(self._rods)]

    def limits(self, group: int) -> Limits:
        """Tolerances and limits of the solver for a lane group."""
        return self._limits[group % len(self._limits)]

    def nodes(self, robot: int | np.intp) -> Floats:
        """Node positions of a robot at rest [m], shape (n_nodes, 2)."""
        group, lane = divmod(int(robot), N_LANES)
        return self.rest[group % len(self.rest), : 2 * self._scene.robot.n_nodes, lane].reshape(-1, 2)

    def rest_shapes(self) -> Floats:
        """Node positions at rest [m], shape (n_nodes, 2) if no number differs, else (n_robots, n_nodes, 2)."""
        return self.nodes(0) if self.are_shared else np.array([self.nodes(robot) for robot in range(self.n_robots)])


# Schemes


def register_scheme(name: str, A: ArrayLike, b: ArrayLike) -> None:
    """Register a diagonally implicit Runge-Kutta scheme of your own, for `Numerics(scheme=name)`.

    A: Shape (n, n), zero above the diagonal, positive on it. b: Shape (n,), adding up to 1. Where b is the last row of
    A, the last stage is the step's result. Stages that would have to be solved together, or one that is explicit, and
    tableaux that are not A-stable, raise a ValueError in one sentence, as does a name that another tableau has.
    """
    if not isinstance(name, str) or not (name and name.isprintable()):
        raise ValueError(f"A scheme's name must be a text, not {shown(name)}.")
    own = tableau(A, b)
    known = {**SCHEMES, **OWN_SCHEMES}.get(name, own)
    if not (np.array_equal(known.a, own.a) and np.array_equal(known.b, own.b)):
        raise ValueError(f"There is a scheme {name!r} with other numbers already: give this one another name.")
    if name not in SCHEMES:
        OWN_SCHEMES[name] = own
    if name not in numerics.SCHEME_NAMES:
        numerics.SCHEME_NAMES.append(name)


def scheme_for(scene: Scene) -> Scheme:
    """Scheme of a scene. ValueError where its terms cannot follow an own scheme."""
    found = scheme_of(scene.numerics.scheme, scene.numerics.damping)
    if found.n_stages > 1 and not found.stiffly_accurate and (scene.contact is not None or scene.robot.has_body):
        raise ValueError(
            f"The scheme {scene.numerics.scheme!r} does not end with its last stage, as contact and bodies need it of "
            "several stages: use one whose b is the last row of A."
        )
    return found
