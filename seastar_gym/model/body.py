"""Coefficients of a body, for the kernels in der/body/body.py."""

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.der.body import body as term
from seastar_gym.der.contact.contact import Rim
from seastar_gym.der.mesh import Mesh
from seastar_gym.der.terms.gravity import heaviness
from seastar_gym.scene.body import GIVEN_DRAG, Body
from seastar_gym.scene.fluid import Water
from seastar_gym.scene.outline import Outline
from seastar_gym.scene.robot import Seastar

Floats = NDArray[np.float64]

GAUSS = np.polynomial.legendre.leggauss(4)
"""Places and weights of strips along a side: the torque of a plate that turns is off by 1 %."""


class Drag(NamedTuple):
    """Drag of a body: coefficient of all directions alike [kg/m], and strips as in der/body/forces.py."""

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
