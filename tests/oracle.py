"""The physics of the chapter once more: dense, slow and obvious, as the oracle of the fast kernels.

Nothing here is shared with the package, and where there are two ways to write a formula this file takes the one that
the kernels do not take: the turning angle comes from ``arctan2``, its derivatives from those of the edges' directions,
every matrix is dense, and every edge reaches its nodes through its own difference matrix e = D q.

States are arrays of shape (n_nodes, 2): positions q [m] and velocities v [m/s], nodes ordered hub, {1,1}..{1,N-1},
{2,1}... Gradients have that shape too; Hessians and Jacobians are (2 n_nodes, 2 n_nodes), in the order of (13.1).
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Clamp:
    """A limb clamped into a rigid hub: its root edge, the natural direction of that [rad], stiffness K [N m]."""

    edge: int
    direction: float
    stiffness: float


@dataclass(frozen=True)
class Star:
    """A star of limbs in a fluid, with the values of section 13.4; SI units, drag_coefficient = 0 is vacuum.

    tangential_drag_coefficient: Of flow along a limb; None for that of flow across.
    added_mass_coefficient: Fluid accelerated across a limb over that displaced.
    relaxation_time: Of Kelvin-Voigt damping [s].
    current: Velocities of the fluid [m/s] at places [m], both of shape (n, 2), or None if it is at rest.
    loads: Dead loads (node, F_x, F_y) [N]. gravity: Acceleration of free fall [m/s^2], less buoyancy.
    held_nodes: Nodes that keep their velocity.
    strip: Width in the plane and height [m], and area of the fluid that moves along [m2], of limbs that are no discs.
    """

    n_limbs: int = 5
    nodes_per_limb: int = 10
    limb_length: float = 0.1
    rod_radius: float = 1.6e-3
    youngs_modulus: float = 1e6
    density: float = 1000.0
    fluid_density: float = 1000.0
    drag_coefficient: float = 1.0
    hub_hinge: str = "opening"
    tangential_drag_coefficient: float | None = None
    current: Callable[[Array], Array] | None = None
    added_mass_coefficient: float = 0.0
    relaxation_time: float = 0.0
    loads: tuple[tuple[int, float, float], ...] = ()
    gravity: tuple[float, float] = (0.0, 0.0)
    held_nodes: tuple[int, ...] = ()
    strip: tuple[float, float, float] | None = None

    @property
    def n_nodes(self) -> int:
        """The hub and the nodes_per_limb - 1 own nodes of every limb: 46 in the chapter."""
        return 1 + self.n_limbs * (self.nodes_per_limb - 1)

    @property
    def edge_length(self) -> float:
        """Undeformed length l of every edge [m]; also the Voronoi length dl of every hinge (13.3)."""
        return self.limb_length / (self.nodes_per_limb - 1)

    @property
    def area(self) -> float:
        """Area of the cross section [m2]."""
        return np.pi * self.rod_radius**2 if self.strip is None else self.strip[0] * self.strip[1]

    @property
    def diameter(self) -> float:
        """Diameter that flow across sees [m]."""
        return 2.0 * self.rod_radius if self.strip is None else self.strip[1]

    @property
    def EA(self) -> float:
        """Axial stiffness [N] (13.2)."""
        return self.youngs_modulus * self.area

    @property
    def EI(self) -> float:
        """Bending stiffness [N m2] (13.3), with I = pi r0^4 / 4, or h w^3 / 12 of a strip."""
        if self.strip is not None:
            return self.youngs_modulus * self.strip[1] * self.strip[0] ** 3 / 12.0
        return self.youngs_modulus * np.pi * self.rod_radius**4 / 4.0

    @property
    def n_hub_hinges(self) -> int:
        """One per gap between limbs; two limbs share one."""
        return {1: 0, 2: 1}.get(self.n_limbs, self.n_limbs)

    @cached_property
    def edge_lengths(self) -> Array:
        """Undeformed length of every edge [m]."""
        return np.full(len(self.edges), self.edge_length)

    @cached_property
    def edge_EA(self) -> Array:
        """Axial stiffness of every edge [N]."""
        return np.full(len(self.edges), self.EA)

    @cached_property
    def hinge_EI(self) -> Array:
        """Bending stiffness of every hinge [N m2]."""
        return np.full(len(self.hinges), self.EI)

    @cached_property
    def hinge_dl(self) -> Array:
        """Voronoi length of every hinge [m]."""
        return np.full(len(self.hinges), self.edge_length)

    def node_EI(self, limb: int, i: int) -> float:
        """Bending stiffness of a limb at its node {limb, i} [N m2]."""
        return self.EI

    @cached_property
    def limb_directions(self) -> Array:
        """Directions of the limbs at the hub at rest [rad], shape (n_limbs,)."""
        return 2.0 * np.pi * np.arange(self.n_limbs) / self.n_limbs

    @cached_property
    def natural_turns(self) -> Array:
        """Natural angle of the hinges within each limb [rad], shape (n_limbs,)."""
        return np.zeros(self.n_limbs)

    @cached_property
    def clamps(self) -> list[Clamp]:
        """Limbs clamped into a rigid hub; none where hinges join them."""
        return []

    @cached_property
    def gaps(self) -> Array:
        """Angle from every limb to the next at rest [rad], shape (n_limbs,)."""
        return np.full(self.n_limbs, 2.0 * np.pi / self.n_limbs)

    @cached_property
    def inner_angles(self) -> Array:
        """Natural angle of the hinges within the limbs [rad]."""
        return np.repeat(self.natural_turns, self.nodes_per_limb - 2)

    def turned(self, delta_psi: ArrayLike) -> tuple["Star", Array]:
        """(star, rotations of its limbs at the hub) whose actuators turn its limbs by delta_psi [rad]."""
        return self, np.asarray(delta_psi)

    def node(self, limb: int, i: int) -> int:
        """Row of node {limb, i}, limb counted from 0; i = 0 is the hub."""
        return 0 if i == 0 else limb * (self.nodes_per_limb - 1) + i

    def edge(self, limb: int, i: int) -> int:
        """Index of the edge from node {limb, i} to {limb, i + 1}."""
        return limb * (self.nodes_per_limb - 1) + i

    @cached_property
    def edges(self) -> list[tuple[int, int]]:
        """Edges as (tail, head), limb by limb, from the hub outwards."""
        return [(self.node(limb, i), self.node(limb, i + 1)) for limb, i in self.limb_edges]

    @cached_property
    def hinges(self) -> list[tuple[int, int, int]]:
        """Hinges as (edge_a, edge_b, sign): those inside the limbs, then those of the hub.

        The turning angle goes from sign * edge_a to edge_b. sign is -1 at a turning-angle hub alone, where edge_a is
        walked inwards before edge_b is walked outwards.
        """
        inner = [(self.edge(limb, i - 1), self.edge(limb, i), 1) for limb, i in self.limb_edges if i > 0]
        sign = {"opening": 1, "turning": -1}[self.hub_hinge]
        hub = [(self.edge(j, 0), self.edge((j + 1) % self.n_limbs, 0), sign) for j in range(self.n_hub_hinges)]
        return inner + hub

    @property
    def limb_edges(self) -> list[tuple[int, int]]:
        """(limb, number from the hub) of every edge."""
        return [(limb, i) for limb in range(self.n_limbs) for i in range(self.nodes_per_limb - 1)]

    @property
    def edges_before_the_arc(self) -> float:
        """Edges from the hub to where a curved limb has its direction: its root edge has it."""
        return 0.0

    @cached_property
    def rest(self) -> Array:
        """Rest positions [m], shape (n_nodes, 2): limb 1 leaves along +x, the others anti-clockwise."""
        q = np.zeros((self.n_nodes, 2))
        for limb, i in self.limb_edges:
            angle = self.limb_directions[limb] + (i + self.edges_before_the_arc) * self.natural_turns[limb]
            edge = self.edge_lengths[self.edge(limb, i)] * np.array([np.cos(angle), np.sin(angle)])
            q[self.node(limb, i + 1)] = q[self.node(limb, i)] + edge
        return q

    @cached_property
    def voronoi_lengths(self) -> Array:
        """Length that belongs to each node [m], shape (n_nodes,): half of every edge it ends."""
        lengths = np.zeros(self.n_nodes)
        for (tail, head), length in zip(self.edges, self.edge_lengths, strict=True):
            lengths[tail] += length / 2.0
            lengths[head] += length / 2.0
        return lengths

    @cached_property
    def masses(self) -> Array:
        """Lumped masses [kg], shape (n_nodes,)."""
        return self.density * self.area * self.voronoi_lengths

    @cached_property
    def forces(self) -> Array:
        """Constant forces on the nodes [N], shape (n_nodes, 2): loads, and weight less buoyancy."""
        volumes = self.masses / self.density
        forces = np.outer((self.density - self.fluid_density) * volumes, self.gravity)
        for node, *force in self.loads:
            forces[node] += force
        return forces

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which coordinates may move as they like, shape (2 n_nodes,)."""
        return np.repeat(~np.isin(np.arange(self.n_nodes), self.held_nodes), 2)

    @cached_property
    def edge_mass(self) -> Array:
        """mu of every edge [kg], which has mu |v_head - v_tail|^2/2 less energy than its lumped masses: here none."""
        return np.zeros(len(self.edges))

    @property
    def isotropic_coefficient(self) -> float:
        """C_t where there is one, or C_d: drag of flow in any direction."""
        along = self.tangential_drag_coefficient
        return self.drag_coefficient if along is None else along

    @cached_property
    def drag(self) -> Array:
        """1/2 rho_f C_d D dl_i of (13.8) [kg/m], shape (n_nodes,); C_t for C_d where there is one."""
        per_speed = 0.5 * self.fluid_density * self.isotropic_coefficient
        return per_speed * self.diameter * self.voronoi_lengths

    @cached_property
    def drag_places(self) -> tuple[Array, Array]:
        """(A, c): drag c |w|^3/3 acts on each of the velocities w = A v, shape (n_places, n_nodes): of the nodes."""
        return np.eye(self.n_nodes), self.drag

    def cross_places(self, edge: int) -> list[tuple[int, float]]:
        """(row of A, weight) of the velocities across an edge that have drag, weighted by that of half the edge."""
        tail, head = self.edges[edge]
        return [(tail, 1.0), (head, 1.0)]

    @cached_property
    def added_mass_coupling(self) -> Array:
        """Of every edge [kg], times ((v_head - v_tail) n)^2/2 less energy than that of its ends: here none."""
        return np.zeros(len(self.edges))

    @cached_property
    def edge_diameters(self) -> Array:
        """Diameter that flow across sees in the middle of every edge [m]."""
        return np.full(len(self.edges), self.diameter)

    @cached_property
    def edge_areas(self) -> Array:
        """Area of the cross section in the middle of every edge [m2]."""
        return np.full(len(self.edges), self.area)

    @cached_property
    def added_areas(self) -> Array:
        """Area of the fluid that moves along across every edge, for C_a = 1 [m2]."""
        return self.edge_areas if self.strip is None else np.full(len(self.edges), self.strip[2])

    @cached_property
    def cross_drag(self) -> Array:
        """1/2 rho_f (C_d - C_t) D l/2 of half an edge [kg/m]: what flow across it adds to the drag of each end."""
        along = self.tangential_drag_coefficient
        more = 0.0 if along is None else self.drag_coefficient - along
        return 0.5 * self.fluid_density * more * self.edge_diameters * self.edge_lengths / 2.0

    @cached_property
    def added_mass(self) -> Array:
        """rho_f C_a A l/2 of half an edge [kg], A = pi r^2: fluid that each end carries along across the edge."""
        volumes = self.added_areas * self.edge_lengths
        return self.fluid_density * self.added_mass_coefficient * volumes / 2.0

    @cached_property
    def differences(self) -> list[Array]:
        """For each edge the matrix D, shape (2, 2 n_nodes), with e = D q for a flat q."""
        matrices = []
        for tail, head in self.edges:
            D = np.zeros((2, 2 * self.n_nodes))
            D[:, 2 * tail : 2 * tail + 2] = -np.eye(2)
            D[:, 2 * head : 2 * head + 2] = np.eye(2)
            matrices.append(D)
        return matrices


@dataclass(frozen=True)
class Shaped(Star):
    """A star whose limbs differ; per limb its direction [rad], length [m], radius [m] and Young's modulus [Pa] at the
    hub and at the tip, linear in between, and natural curvature [1/m]."""

    directions: tuple[float, ...] = ()
    lengths: tuple[float, ...] = ()
    radii: tuple[tuple[float, float], ...] = ()
    moduli: tuple[tuple[float, float], ...] = ()
    curvatures: tuple[float, ...] = ()

    def radius(self, limb: int, i: float) -> float:
        """Radius [m] of a limb, i edges from the hub."""
        return self._between(self.radii[limb], i)

    def modulus(self, limb: int, i: float) -> float:
        """Young's modulus [Pa] of a limb, i edges from the hub."""
        return self._between(self.moduli[limb], i)

    def _between(self, ends: tuple[float, float], i: float) -> float:
        return ends[0] + (ends[1] - ends[0]) * i / (self.nodes_per_limb - 1)

    @cached_property
    def edge_lengths(self) -> Array:
        return np.array([self.lengths[limb] / (self.nodes_per_limb - 1) for limb, _ in self.limb_edges])

    @cached_property
    def edge_diameters(self) -> Array:
        return np.array([2.0 * self.radius(limb, i + 0.5) for limb, i in self.limb_edges])

    @cached_property
    def edge_areas(self) -> Array:
        return np.pi * self.edge_diameters**2 / 4.0

    @cached_property
    def edge_EA(self) -> Array:
        return np.array([self.modulus(limb, i + 0.5) for limb, i in self.limb_edges]) * self.edge_areas

    def node_EI(self, limb: int, i: int) -> float:
        return self.modulus(limb, i) * np.pi * self.radius(limb, i) ** 4 / 4.0

    @cached_property
    def limb_directions(self) -> Array:
        return np.array(self.directions)

    @cached_property
    def natural_turns(self) -> Array:
        return np.array(self.curvatures) * np.array(self.lengths) / (self.nodes_per_limb - 1)

    @cached_property
    def hinge_dl(self) -> Array:
        return np.array([0.5 * (self.edge_lengths[a] + self.edge_lengths[b]) for a, b, _ in self.hinges])

    @cached_property
    def hinge_EI(self) -> Array:
        """At a hub hinge the compliances of half a root edge of each limb add up."""
        stiffness = []
        for (a, b, _), dl in zip(self.hinges, self.hinge_dl, strict=True):
            (limb_a, i_a), (limb_b, i_b) = self.limb_edges[a], self.limb_edges[b]
            at_a, at_b = (limb_b, i_b) if i_b > 0 else (limb_a, i_a), (limb_b, i_b)
            halves = 0.5 * self.edge_lengths[a] / self.node_EI(*at_a) + 0.5 * self.edge_lengths[b] / self.node_EI(*at_b)
            stiffness.append(dl / halves)
        return np.array(stiffness)

    @cached_property
    def gaps(self) -> Array:
        return np.diff([*self.directions, 2.0 * np.pi])

    def _per_node(self, value: Any) -> Array:
        """What each half edge brings to its node, by the profile at that node."""
        total = np.zeros(self.n_nodes)
        for (limb, i), (tail, head), length in zip(self.limb_edges, self.edges, self.edge_lengths, strict=True):
            total[tail] += 0.5 * length * value(self.radius(limb, i))
            total[head] += 0.5 * length * value(self.radius(limb, i + 1))
        return total

    @cached_property
    def masses(self) -> Array:
        return self._per_node(lambda r: self.density * np.pi * r**2)

    @cached_property
    def drag(self) -> Array:
        return self._per_node(lambda r: 0.5 * self.fluid_density * self.isotropic_coefficient * 2.0 * r)


def direction_gradient(e: Array) -> Array:
    """Gradient of theta(e) = atan2(e_y, e_x) [rad/m], shape (2,)."""
    return np.array([-e[1], e[0]]) / (e @ e)


def direction_hessian(e: Array) -> Array:
    """Hessian of theta(e) = atan2(e_y, e_x) [rad/m2], shape (2, 2)."""
    x, y = e
    return np.array([[2.0 * x * y, y * y - x * x], [y * y - x * x, -2.0 * x * y]]) / (e @ e) ** 2


def turning_angle(a: Array, b: Array) -> float:
    """Angle from a to b [rad], in (-pi, pi] (13.4)."""
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def curvature(phi: float, dl: float) -> float:
    """kappa = 2 tan(phi/2) / dl [1/m], below (13.3)."""
    return float(2.0 * np.tan(phi / 2.0) / dl)


def natural_angles(star: Star, delta_psi: ArrayLike) -> Array:
    """Natural angle of every hinge [rad], shape (n_hinges,), for limbs turned by delta_psi [rad], shape (n_limbs,).

    Zero inside a limb. At the hub psi_bar = 2 pi / n_limbs + delta_psi_{j+1} - delta_psi_j, or psi_bar - pi when the
    hinge is measured by its turning angle.
    """
    delta = np.asarray(delta_psi, dtype=float)
    psi_bar = (star.gaps + np.roll(delta, -1) - delta)[: star.n_hub_hinges]
    hub = psi_bar if star.hub_hinge == "opening" else psi_bar - np.pi
    return np.concatenate([star.inner_angles, hub])


def edge_vectors(star: Star, q: Array) -> list[Array]:
    """Edge vectors e = D q [m]."""
    return [D @ q.ravel() for D in star.differences]


def strains(star: Star, q: Array, curved: bool = True) -> Iterator[tuple[float, float, Array, Array]]:
    """Of every edge (EA l, eps, grad eps, Hess eps), of every hinge (EI dl, kappa, grad kappa, Hess kappa).

    curved: Whether the Hessians are asked for; else they are empty.
    """
    D, e, hessian = star.differences, edge_vectors(star, q), np.zeros(0)
    for D_e, e_i, EA, length in zip(D, e, star.edge_EA, star.edge_lengths, strict=True):
        size = float(np.linalg.norm(e_i))
        along = e_i / size
        if curved:
            hessian = D_e.T @ (np.eye(2) - np.outer(along, along)) @ D_e / (size * length)
        yield EA * length, size / length - 1.0, D_e.T @ along / length, hessian
    for (a, b, sign), EI, dl in zip(star.hinges, star.hinge_EI, star.hinge_dl, strict=True):
        phi = turning_angle(sign * e[a], e[b])
        t = np.tan(phi / 2.0)
        slope = (1.0 + t**2) / dl
        phi_q = D[b].T @ direction_gradient(e[b]) - D[a].T @ direction_gradient(e[a])
        if curved:
            phi_qq = D[b].T @ direction_hessian(e[b]) @ D[b] - D[a].T @ direction_hessian(e[a]) @ D[a]
            hessian = slope * (phi_qq + t * np.outer(phi_q, phi_q))
        yield EI * dl, curvature(phi, dl), slope * phi_q, hessian


def natural_strains(star: Star, delta_psi: ArrayLike) -> list[float]:
    """eps of every edge and kappa_bar of every hinge without stress."""
    hinges = zip(natural_angles(star, delta_psi), star.hinge_dl, strict=True)
    return [0.0] * len(star.edges) + [curvature(angle, dl) for angle, dl in hinges]


def elastic_energy(star: Star, q: Array, delta_psi: ArrayLike) -> float:
    """Total elastic energy [J] (13.14), each hub hinge with the length dl that (13.13) lacks; or that of clamps."""
    springs = zip(strains(star, q, curved=False), natural_strains(star, delta_psi), strict=True)
    energy = sum(0.5 * stiffness * (strain - natural) ** 2 for (stiffness, strain, *_), natural in springs)
    return float(energy + clamp_slopes(star, q, clamp_turns(star, q, delta_psi))[0])


def elastic_gradient(star: Star, q: Array, delta_psi: ArrayLike) -> Array:
    """Gradient of (13.14) [N], shape (n_nodes, 2): minus the internal force (13.6)."""
    springs = zip(strains(star, q, curved=False), natural_strains(star, delta_psi), strict=True)
    gradient = sum(stiffness * (strain - natural) * slope for (stiffness, strain, slope, _), natural in springs)
    gradient = gradient + clamp_slopes(star, q, clamp_turns(star, q, delta_psi))[1]
    return gradient.reshape(-1, 2)


def elastic_hessian(star: Star, q: Array, delta_psi: ArrayLike, convex: bool = False) -> Array:
    """Hessian of (13.14) [N/m], shape (2 n_nodes, 2 n_nodes): the second term of (13.12).

    convex: Without what may be negative: compression, the curvature of hinges' angles, clamps beyond a quarter turn.
    """
    hessian = clamp_slopes(star, q, clamp_turns(star, q, delta_psi), convex)[2]
    springs = zip(strains(star, q), natural_strains(star, delta_psi), strict=True)
    for k, ((stiffness, strain, slope, bend), natural) in enumerate(springs):
        stress = strain - natural
        if convex:
            stress = max(stress, 0.0) if k < len(star.edges) else 0.0
        hessian += stiffness * (np.outer(slope, slope) + stress * bend)
    return hessian


def root_angles(star: Star, q: Array) -> Array:
    """theta [rad] of the root edges that are clamped."""
    e = edge_vectors(star, q)
    return np.array([np.arctan2(e[clamp.edge][1], e[clamp.edge][0]) for clamp in star.clamps])


def clamp_turns(star: Star, q: Array, delta_psi: ArrayLike) -> Array:
    """Angles [rad] of clamped root edges from their natural directions, on a hub that is not turned."""
    natural = (
        np.array([clamp.direction for clamp in star.clamps]) + np.asarray(delta_psi, dtype=float)[: len(star.clamps)]
    )
    return root_angles(star, q) - natural


def hub_orientation(turns: Array, K: Array) -> float:
    """Phi [rad] with the least sum of K (1 - cos(turn - Phi)): the best of many, then Newton's method."""
    tried = np.linspace(-np.pi, np.pi, 360)
    phi = tried[np.argmin(np.sum(K * (1.0 - np.cos(turns - tried[:, None])), axis=1))]
    for _ in range(6):
        phi += np.sum(K * np.sin(turns - phi)) / np.sum(K * np.cos(turns - phi))
    return float(phi)


def clamp_slopes(star: Star, q: Array, turns: Array, convex: bool = False) -> tuple[float, Array, Array]:
    """min over Phi of sum K (1 - cos(turn - Phi)) [J] with its gradient, flat, and Hessian, of root edges so turned.

    At the least energy Phi adds nothing to the gradient, and takes its Schur complement from the Hessian.
    """
    n = 2 * star.n_nodes
    energy, gradient, hessian = 0.0, np.zeros(n), np.zeros((n, n))
    if not star.clamps:
        return energy, gradient, hessian
    K, e = np.array([clamp.stiffness for clamp in star.clamps]), edge_vectors(star, q)
    off = turns - hub_orientation(turns, K)
    moments, stiffnesses = K * np.sin(off), K * np.cos(off)
    if convex:
        stiffnesses = np.maximum(stiffnesses, 0.0)
    coupling = np.zeros(n)
    for clamp, moment, stiffness in zip(star.clamps, moments, stiffnesses, strict=True):
        D = star.differences[clamp.edge]
        theta_q = D.T @ direction_gradient(e[clamp.edge])
        gradient += moment * theta_q
        hessian += stiffness * np.outer(theta_q, theta_q)
        if not convex:
            hessian += moment * D.T @ direction_hessian(e[clamp.edge]) @ D
        coupling -= stiffness * theta_q
    energy = float(np.sum(2.0 * K * np.sin(off / 2.0) ** 2))
    return energy, gradient, hessian - np.outer(coupling, coupling) / np.sum(stiffnesses)


def relative_velocities(star: Star, v: Array, frozen: Array | None) -> Array:
    """v - u [m/s], shape (n_nodes, 2), with the current u at the places `frozen` [m] (of no account without one)."""
    return v if star.current is None else v - star.current(frozen)


def edge_normals(star: Star, frozen: Array | None) -> list[Array]:
    """Unit normals of the edges, where flow across a limb has drag or mass of its own; else none."""
    if not (star.cross_drag.any() or star.added_mass.any()):
        return []
    return [np.array([-e[1], e[0]]) / np.linalg.norm(e) for e in edge_vectors(star, frozen)]


def flows(star: Star, v: Array, frozen: Array | None) -> Array:
    """Velocities [m/s] relative to the fluid where drag acts, shape (n_places, 2)."""
    return star.drag_places[0] @ relative_velocities(star, v, frozen)


def cross_flows(star: Star, frozen: Array | None) -> Iterator[tuple[int, float, Array]]:
    """(place, coefficient, unit normal) of the flows across edges that have drag of their own."""
    for i, normal in enumerate(edge_normals(star, frozen)):
        for place, weight in star.cross_places(i):
            yield place, weight * star.cross_drag[i], normal


def drag_potential(star: Star, v: Array, frozen: Array | None = None) -> float:
    """Dissipation potential 1/6 rho_f C_d D |w|^3 dl, summed over the places [W], and that of flow across edges."""
    w, c = flows(star, v, frozen), star.drag_places[1]
    across = sum(c_n * abs(w[place] @ normal) ** 3 for place, c_n, normal in cross_flows(star, frozen))
    return float(np.sum(c * np.linalg.norm(w, axis=1) ** 3 / 3.0) + across / 3.0)


def drag_force(star: Star, v: Array, frozen: Array | None = None) -> Array:
    """Drag force on every node [N], shape (n_nodes, 2) (13.8)."""
    w, (A, c) = flows(star, v, frozen), star.drag_places
    speed: Array = np.linalg.norm(w, axis=1)
    force: Array = -(c * speed)[:, None] * w
    for place, c_n, normal in cross_flows(star, frozen):
        across = w[place] @ normal
        force[place] -= c_n * abs(across) * across * normal
    return A.T @ force


def drag_jacobian(star: Star, v: Array, frozen: Array | None = None) -> Array:
    """Derivative of (13.8) in the velocities [N s/m], shape (2 n_nodes, 2 n_nodes); zero for a node at rest."""
    w, (A, c) = flows(star, v, frozen), star.drag_places
    jacobian = np.zeros((2 * len(w), 2 * len(w)))
    for i, w_i in enumerate(w):
        speed = np.linalg.norm(w_i)
        if speed > 0.0:
            block = -c[i] * (speed * np.eye(2) + np.outer(w_i, w_i) / speed)
            jacobian[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = block
    for i, c_n, normal in cross_flows(star, frozen):
        across = 2.0 * c_n * abs(w[i] @ normal)
        jacobian[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] -= across * np.outer(normal, normal)
    at_places = np.kron(A, np.eye(2))
    return at_places.T @ jacobian @ at_places


def kinetic_energy(star: Star, v: Array) -> float:
    """1/2 v M v [J]."""
    return float(0.5 * v.ravel() @ inertia_matrix(star) @ v.ravel())


def inertia_matrix(star: Star) -> Array:
    """Lumped masses less what consistent ones take [kg], shape (2 n_nodes, 2 n_nodes)."""
    matrix = np.diag(np.repeat(star.masses, 2))
    for mu, D in zip(star.edge_mass, star.differences, strict=True):
        if mu:
            matrix -= mu * D.T @ D
    return matrix


def mass_matrix(star: Star, frozen: Array | None) -> Array:
    """Masses and added mass [kg], shape (2 n_nodes, 2 n_nodes)."""
    matrix = inertia_matrix(star)
    for i, normal in enumerate(edge_normals(star, frozen)):
        across, D = np.outer(normal, normal), star.differences[i]
        for node in star.edges[i]:
            matrix[2 * node : 2 * node + 2, 2 * node : 2 * node + 2] += star.added_mass[i] * across
        matrix -= star.added_mass_coupling[i] * D.T @ across @ D
    return matrix


def damping_potential(star: Star, q: Array, q_hat: Array, gamma: float) -> tuple[float, Array, Array]:
    """gamma R [J] with its gradient, flat, and Hessian: 1/2 tau EA l (d eps/dt)^2 + 1/2 tau EI dl (d kappa/dt)^2.

    Clamped root edges are damped as they are held, with the directions that they had before for natural ones.
    """
    n = 2 * star.n_nodes
    potential, gradient, hessian = 0.0, np.zeros(n), np.zeros((n, n))
    if star.relaxation_time > 0.0:
        for (stiffness, now, slope, bend), (_, before, _, _) in zip(
            strains(star, q), strains(star, q_hat), strict=True
        ):
            rate = (now - before) / gamma
            potential += gamma * 0.5 * star.relaxation_time * stiffness * rate**2
            gradient += star.relaxation_time * stiffness * rate * slope
            hessian += star.relaxation_time * stiffness * (np.outer(slope, slope) / gamma + rate * bend)
        at_hub = clamp_slopes(star, q, root_angles(star, q) - root_angles(star, q_hat))
        ratio = star.relaxation_time / gamma
        potential, gradient, hessian = (
            x + ratio * y for x, y in zip((potential, gradient, hessian), at_hub, strict=True)
        )
    return potential, gradient, hessian


def incremental_potential(
    star: Star, q: Array, q_hat: Array, v_hat: Array, gamma: float, delta_psi: ArrayLike, frozen: Array | None = None
) -> float:
    """Phi(q) [J], whose stationary point solves (13.9) for v = (q - q_hat) / gamma.

    frozen: Places [m] where normals of edges and the current are taken, shape (n_nodes, 2), if the star has such terms.
    """
    d = ((q - q_hat) / gamma - v_hat).ravel()
    inertia = float(0.5 * d @ mass_matrix(star, frozen) @ d) + damping_potential(star, q, q_hat, gamma)[0]
    forced = elastic_energy(star, q, delta_psi) - gamma * float(star.forces.ravel() @ d)
    return inertia + forced + gamma * drag_potential(star, (q - q_hat) / gamma, frozen)


def incremental_gradient(
    star: Star, q: Array, q_hat: Array, v_hat: Array, gamma: float, delta_psi: ArrayLike, frozen: Array | None = None
) -> Array:
    """Gradient of Phi [N], shape (n_nodes, 2): the residual f of (13.9)."""
    v = (q - q_hat) / gamma
    drag = drag_force(star, v, frozen)
    inertia = mass_matrix(star, frozen) @ (v - v_hat).ravel() / gamma + damping_potential(star, q, q_hat, gamma)[1]
    return inertia.reshape(-1, 2) + elastic_gradient(star, q, delta_psi) - drag - star.forces


def incremental_hessian(
    star: Star,
    q: Array,
    q_hat: Array,
    gamma: float,
    delta_psi: ArrayLike,
    frozen: Array | None = None,
    convex: bool = False,
) -> Array:
    """Hessian of Phi [N/m], shape (2 n_nodes, 2 n_nodes): the Jacobian J of (13.12). convex: See elastic_hessian."""
    inertia = mass_matrix(star, frozen) / gamma**2 + damping_potential(star, q, q_hat, gamma)[2]
    drag = drag_jacobian(star, (q - q_hat) / gamma, frozen) / gamma
    return inertia + elastic_hessian(star, q, delta_psi, convex) - drag


def descent(hessian: Array, gradient: Array) -> Array:
    """Newton's update (13.11) [m], shape (n_nodes, 2); the diagonal is raised until a Cholesky factor exists."""
    smallest = 1e-3 * np.min(np.abs(np.diag(hessian)))
    for shift in (0.0, *smallest * 10.0 ** np.arange(20)):
        shifted = hessian + shift * np.eye(len(hessian))
        try:
            np.linalg.cholesky(shifted)
        except np.linalg.LinAlgError:
            continue
        update: Array = -np.linalg.solve(shifted, gradient.ravel())
        return update.reshape(-1, 2)
    raise RuntimeError("no diagonal shift makes the Hessian of the incremental potential positive definite")


def stage(
    star: Star, q_hat: Array, v_hat: Array, gamma: float, delta_psi: ArrayLike, max_iterations: int = 50
) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] of one implicit stage: the minimum of Phi, from the guess (13.10).

    Newton's method, until an update moves no node by more than 1e-12 limb lengths.
    """
    q = frozen = q_hat + gamma * v_hat
    data = q_hat, v_hat, gamma, delta_psi, frozen
    for _ in range(max_iterations):
        gradient = incremental_gradient(star, q, *data)
        hessian = incremental_hessian(star, q, q_hat, gamma, delta_psi, frozen)
        update = np.zeros_like(q)
        free = star.free.reshape(-1, 2)
        update[free] = descent(hessian[np.ix_(star.free, star.free)], gradient[free]).ravel()
        q = q + update
        if np.max(np.abs(update)) <= 1e-12 * star.limb_length:
            return q, (q - q_hat) / gamma
    raise RuntimeError(f"the stage with gamma = {gamma} s did not converge in {max_iterations} Newton iterations")


G2 = 1.0 - 1.0 / np.sqrt(2.0)
TABLEAUS: dict[str, list[list[float]]] = {
    "implicit-euler": [[1.0]],
    "sdirk2": [[G2], [1.0 - G2, G2]],
    "implicit-midpoint": [[0.5]],
}
"""Rows of the Runge-Kutta matrix of each scheme; a row's sum is the time c of its stage."""


def pulse(t: float, peak_angle: float = np.pi / 5.0, heating_time: float = 0.1, cooling_time: float = 0.9) -> float:
    """delta_psi [rad] of a limb with command 1 at the time t [s] (Fig. 13.5b), repeated every period."""
    t = t % (heating_time + cooling_time)
    if t < heating_time:
        return peak_angle * t / heating_time
    return peak_angle * (heating_time + cooling_time - t) / cooling_time


def step(
    star: Star,
    q: Array,
    v: Array,
    t: float,
    h: float,
    command: ArrayLike,
    scheme: str,
    damping: float = 0.0,
    **pulse_shape: float,
) -> tuple[Array, Array]:
    """State at t + h from the state (q, v) at t [s], with delta_psi taken at the times of the stages.

    ``pulse_shape`` goes to ``pulse``. A stage starts from q_hat, v_hat, the state advanced by the velocities and
    accelerations of the stages before it. The last stage is the new state; the implicit midpoint extrapolates it, from
    theta = (1 + damping)/2 of the step.
    """
    velocities: list[Array] = []
    accelerations: list[Array] = []
    for *row, diagonal in TABLEAUS[scheme] if damping == 0.0 else [[0.5 * (1.0 + damping)]]:
        q_hat = q + h * sum(a * v_j for a, v_j in zip(row, velocities, strict=True))
        v_hat = v + h * sum(a * a_j for a, a_j in zip(row, accelerations, strict=True))
        now = star.turned(np.asarray(command) * pulse(t + (sum(row) + diagonal) * h, **pulse_shape))
        q_new, v_new = stage(now[0], q_hat, v_hat, diagonal * h, now[1])
        velocities.append(v_new)
        accelerations.append((v_new - v_hat) / (diagonal * h))
    if scheme == "implicit-midpoint":
        return q + (q_new - q) / diagonal, v + (v_new - v) / diagonal
    return q_new, v_new


@dataclass(frozen=True)
class Touch:
    """A node near an edge, and the gap between them as a linear function of all coordinates."""

    gradient: Array
    thickness: float
    stiffness: float

    def depth(self, ends: Array) -> float:
        return max(0.0, self.thickness - float(self.gradient @ ends.ravel()))


def share_of_edge(s: float, edge: int, last: int, overhang: float = 0.25) -> float:
    """Share of a node's stiffness at edges 1 to `last` of a limb, s along the edge: it passes on around hinges."""
    full = 0.0 if edge == 1 else overhang, 1.0 if edge == last else 1.0 - overhang
    return float(np.interp(s, [-overhang, *full, 1.0 + overhang], [0.0, 1.0, 1.0, 0.0]))


def tapered(radius: float, distance: float, opening_angle: float) -> float:
    """Thickness of a limb near its root: Hermite's cubic, whose slope in the middle is half the opening angle."""
    slope = 0.5 * opening_angle
    s = np.clip(distance * slope / (1.5 * radius), 0.0, 1.0)
    return float(radius * (3.0 * s**2 - 2.0 * s**3))


def touches(star: Star, ends: Array, start: Array, opening_angle: float) -> list[Touch]:
    """Nodes of a limb that meet edges of its neighbours, at `ends`, in a step that began at `start`."""
    thickness = np.zeros(star.n_nodes)
    for limb in range(star.n_limbs):
        for i in range(1, star.nodes_per_limb):
            thickness[star.node(limb, i)] = tapered(star.rod_radius, star.edge_length * i, opening_angle)
    found = []
    for right in range(star.n_limbs):
        left = (right + 1) % star.n_limbs
        for limb, other, side in ((right, left, -1.0), (left, right, 1.0)):
            for edge, i in itertools.product(range(1, star.nodes_per_limb), range(1, star.nodes_per_limb)):
                node, tail, head = star.node(limb, i), star.node(other, edge - 1), star.node(other, edge)
                e, d = ends[head] - ends[tail], ends[node] - ends[tail]
                normal = side * np.array([-e[1], e[0]]) / np.linalg.norm(e)
                s = float(d @ e) / float(e @ e)
                share = min(max(s, 0.0), 1.0)
                wide = thickness[node] + (1.0 - share) * thickness[tail] + share * thickness[head]
                o, before = start[head] - start[tail], start[node] - start[tail]
                began = side * (o[0] * before[1] - o[1] * before[0]) / np.linalg.norm(o)
                weight = share_of_edge(s, edge, star.nodes_per_limb - 1)
                if weight > 0.0 and began > -wide:
                    gradient = np.zeros((star.n_nodes, 2))
                    gradient[node] += normal
                    gradient[tail] -= (1.0 - s) * normal
                    gradient[head] -= s * normal
                    k = weight * np.pi / 6.0 * star.youngs_modulus * 0.5 * star.voronoi_lengths[node]
                    found.append(Touch(gradient.ravel(), wide, k))
    return found
