"""The oracle of robots with a body: the stars of oracle.py, whose limbs begin at nodes of their own.

Nodes are those of the star, then one per limb, its root on the body. Unknowns are the star's nodes, flat, and the
body's angle [rad]. Roots follow from hub and angle; clamps, the rigid mass and the drag of strips are added here.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

import oracle
from continuum_oracle import Continuum
from oracle import Array, Clamp
from slopes import rotated


class Apart(Continuum):
    """Limbs that begin apart from the hub and from each other, with no masses and no weight at their roots."""

    @property
    def n_nodes(self) -> int:
        return 1 + self.n_limbs * self.nodes_per_limb

    def node(self, limb: int, i: int) -> int:
        return 1 + self.n_limbs * (self.nodes_per_limb - 1) + limb if i == 0 else super().node(limb, i)

    @cached_property
    def clamps(self) -> list[Clamp]:
        return []

    @cached_property
    def masses(self) -> Array:
        masses = np.array(self.density * np.pi * self.rod_radius**2 * self.voronoi_lengths)
        masses[[self.node(limb, 0) for limb in range(self.n_limbs)]] = 0.0
        return masses


def crossed(points: Array) -> Array:
    """A quarter turn on: the derivative of points that turn."""
    return points @ np.array([[0.0, 1.0], [-1.0, 0.0]])


@dataclass(frozen=True)
class Rigid:
    """A body: arms (n_limbs, 2) [m], natural directions [rad], mass [kg] with that of the roots, its moment [kg m] and
    inertia [kg m^2] about the hub, isotropic drag [kg/m], strips (n_x, n_y, m, c), added mass (2, 2) [kg] in its frame,
    and free fall [m/s^2] with the moment of weight [kg m]."""

    star: Apart
    arms: Array
    directions: Array
    mass: float
    moment: Array
    inertia: float
    isotropic: float
    strips: Array
    added_mass: Array
    fall: Array
    weight_moment: Array
    weight: float

    def places(self, u: Array) -> Array:
        """Positions of nodes and roots [m]."""
        nodes = u[:-1].reshape(-1, 2)
        return np.concatenate([nodes, nodes[0] + rotated(self.arms, u[-1])])

    def rates(self, u: Array, rate: Array) -> Array:
        """Velocities of nodes and roots [m/s]."""
        nodes = rate[:-1].reshape(-1, 2)
        return np.concatenate([nodes, nodes[0] + rate[-1] * crossed(rotated(self.arms, u[-1]))])

    def directions_of_roots(self, q: Array) -> Array:
        e = oracle.edge_vectors(self.star, q)
        return np.array([np.arctan2(*e[self.star.edge(limb, 0)][::-1]) for limb in range(self.star.n_limbs)])

    def clamp_stiffnesses(self) -> Array:
        star = self.star
        return np.full(star.n_limbs, star.EI / (5.0 / 12.0 * star.edge_length))

    def phi(self, u: Array, u_hat: Array, v_hat: Array, gamma: float, delta_psi: Array, first: Array) -> float:
        """Phi(u) [J] of a stage whose first guess is `first`."""
        star = self.star
        guess = (first - u_hat) / gamma
        omega = guess[-1]
        arms, frozen = rotated(self.arms, first[-1]), self.places(first)
        q, q_hat = self.places(u), self.places(u_hat)
        # Where roots would have come from, straight on with the velocities of the guess, and what they should have.
        from_where = frozen - gamma * self.rates(first, guess)
        roots = slice(len(q) - star.n_limbs, None)
        hat = np.concatenate([q_hat[: roots.start], from_where[roots]])
        v_star = np.concatenate([v_hat[:-1].reshape(-1, 2), np.zeros((star.n_limbs, 2))])
        v_star[roots] = v_star[0] + v_hat[-1] * crossed(arms) + gamma * omega**2 * arms
        v = (q - hat) / gamma
        d = (v - v_star).ravel()
        total = 0.5 * d @ oracle.mass_matrix(star, frozen) @ d + gamma * oracle.drag_potential(star, v, frozen)
        total += oracle.elastic_energy(star, q, delta_psi) - gamma * float(np.sum(star.forces * (v - v_star)))
        total += oracle.damping_potential(star, q, q_hat, gamma)[0]
        return float(total + self.clamps(u, u_hat, gamma, delta_psi) + self.own(u, u_hat, v_hat, gamma, first))

    def clamps(self, u: Array, u_hat: Array, gamma: float, delta_psi: Array) -> float:
        K, ratio = self.clamp_stiffnesses(), self.star.relaxation_time / gamma
        now, before = self.directions_of_roots(self.places(u)), self.directions_of_roots(self.places(u_hat))
        turns = now - self.directions - delta_psi - u[-1]
        turned_more = now - before - (u[-1] - u_hat[-1])
        return float(K @ (1.0 - np.cos(turns)) + ratio * K @ (1.0 - np.cos(turned_more)))

    def own(self, u: Array, u_hat: Array, v_hat: Array, gamma: float, first: Array) -> float:
        """Inertia, drag and weight of the body itself [J]."""
        rate, guess = (u - u_hat) / gamma, (first - u_hat) / gamma
        d, turn, omega = (rate - v_hat)[:2], (rate - v_hat)[-1], guess[-1]
        S = rotated(self.moment, first[-1])
        total = 0.5 * self.mass * d @ d + 0.5 * self.inertia * turn**2 + turn * d @ crossed(S)
        total -= gamma * omega**2 * d @ S
        u_fluid = np.zeros(2) if self.star.current is None else self.star.current(first[:2][None])[0]
        w, w_guess = rate[:2] - u_fluid, guess[:2] - u_fluid
        R = rotated(np.eye(2), first[-1]).T
        P = R @ self.added_mass @ R.T
        K = np.array([[0.0, -1.0], [1.0, 0.0]])
        P_turns = K @ P - P @ K
        total += 0.5 * d @ P @ d + gamma * omega * d @ P_turns @ w_guess
        total -= gamma * turn * 0.5 * w_guess @ P_turns @ w_guess
        flows = rotated(self.strips[:, :2], first[-1]) @ w + self.strips[:, 2] * rate[-1]
        total += gamma * (self.isotropic * np.linalg.norm(w) ** 3 + self.strips[:, 3] @ np.abs(flows) ** 3) / 3.0
        fallen = rotated(self.weight_moment, u[-1]) - rotated(self.weight_moment, u_hat[-1])
        return float(total - self.fall @ fallen - gamma * self.weight * self.fall @ d)


@dataclass(frozen=True)
class Pair:
    """Point i near the place (1 - share) j + share k, with the normal to it; thickness [m], stiffness [N/m]."""

    i: int
    j: int
    k: int
    share: float
    normal: Array
    thickness: float
    stiffness: float

    def depth(self, points: Array) -> float:
        y = (1.0 - self.share) * points[self.j] + self.share * points[self.k]
        return max(0.0, self.thickness - float(self.normal @ (points[self.i] - y)))


@dataclass(frozen=True)
class Touching(Rigid):
    """A body whose outline limbs meet: corners (n, 2) [m], anti-clockwise, and their radius [m]; one for a disc.

    limbs: Pairs of limbs that may touch. ahead: Whether contact is looked for half a step after a step's end.
    """

    corners: Array
    radius: float
    limbs: tuple[tuple[int, int], ...]
    opening_angle: float
    ahead: bool

    def points(self, u: Array) -> Array:
        """Places, then corners [m]."""
        return np.concatenate([self.places(u), u[:2] + rotated(self.corners, u[-1])])

    def looked_at(self, u: Array, u_hat: Array, v_hat: Array, gamma: float) -> Array:
        if not self.ahead:
            return self.points(u)
        rates = v_hat[-1] * crossed(rotated(np.concatenate([self.arms, self.corners]), u_hat[-1]))
        velocities = np.concatenate([v_hat[:-1].reshape(-1, 2), v_hat[:2] + rates])
        return self.points(u_hat) + 4.0 * (self.points(u) - self.points(u_hat)) - gamma * velocities

    @cached_property
    def thickness(self) -> Array:
        star, thick = self.star, np.zeros(self.star.n_nodes + len(self.corners))
        for limb in range(star.n_limbs):
            for i in range(1, star.nodes_per_limb):
                thick[star.node(limb, i)] = oracle.tapered(star.rod_radius, star.edge_length * i, self.opening_angle)
        thick[star.n_nodes :] = self.radius
        return thick

    def stiffness(self, node: int, share: float) -> float:
        """Share of the contact modulus times the node's Voronoi length [N/m]."""
        star = self.star
        is_tip = (node - 1) % (star.nodes_per_limb - 1) == star.nodes_per_limb - 2
        return np.pi / 6.0 * star.youngs_modulus * share * star.edge_length * (0.5 if is_tip else 1.0)

    def pairs(self, ends: Array, start: Array) -> list[Pair]:
        """Who is near whom at `ends`, in a step that began at `start`; nobody may be within the body there."""
        star = self.star
        found = [self.node_at_body(ends, node) for node in range(1, 1 + star.n_limbs * (star.nodes_per_limb - 1))]
        for limb in range(star.n_limbs):
            for edge in range(2, star.nodes_per_limb):
                tail, head = star.node(limb, edge - 1), star.node(limb, edge)
                for corner in range(star.n_nodes, len(ends)):
                    side = 1.0 if height(start, corner, tail, head) > 0.0 else -1.0
                    share = along(ends, corner, tail, head)
                    if 0.0 < share < 1.0:
                        found.append(self.pair(ends, corner, tail, head, share, side, self.stiffness(head, 0.5)))
        for one, other in self.limbs:
            found += self.limb_at_limb(ends, start, one, other) + self.limb_at_limb(ends, start, other, one)
        return found

    def pair(self, ends: Array, i: int, j: int, k: int, share: float, side: float, stiffness: float) -> Pair:
        e = ends[k] - ends[j]
        normal, t, near = side * np.array([-e[1], e[0]]) / np.linalg.norm(e), self.thickness, min(max(share, 0.0), 1.0)
        return Pair(i, j, k, near, normal, t[i] + (1.0 - near) * t[j] + near * t[k], stiffness)

    def limb_at_limb(self, ends: Array, start: Array, limb: int, other: int) -> list[Pair]:
        """Nodes on the side of an edge on which they were, if they were beside it, and in front of its end."""
        star, found = self.star, []
        for edge in range(1, star.nodes_per_limb):
            tail, head = star.node(other, edge - 1), star.node(other, edge)
            is_last = edge == star.nodes_per_limb - 1  # its tip is round
            for i in range(1, star.nodes_per_limb):
                node = star.node(limb, i)
                share = along(ends, node, tail, head)
                before = start if -1.0 <= along(start, node, tail, head) <= 1.0 else ends
                side = 1.0 if height(before, node, tail, head) > 0.0 else -1.0
                along_edge = min(share, 1.0) if is_last else share
                weight = oracle.share_of_edge(along_edge, edge, star.nodes_per_limb - 1, 0.05)
                pair = self.pair(ends, node, tail, head, share, side, weight * self.stiffness(node, 0.5))
                if share > 1.0:
                    way = ends[node] - ends[head]
                    pair = replace(pair, normal=way / np.linalg.norm(way))
                if weight > 0.0:
                    found.append(pair)
        return found

    def node_at_body(self, ends: Array, node: int) -> Pair:
        """A node and the point of the outline that is nearest to it."""
        m, best = self.star.n_nodes, None
        for c in range(len(self.corners)):
            j, k = m + c, m + (c + 1) % len(self.corners)
            share = min(max(along(ends, node, j, k), 0.0), 1.0) if j != k else 0.0
            way = ends[node] - (1.0 - share) * ends[j] - share * ends[k]
            if best is None or np.linalg.norm(way) < best[0]:
                best = np.linalg.norm(way), Pair(
                    node, j, k, share, way / np.linalg.norm(way), self.thickness[node] + self.radius,
                    self.stiffness(node, 1.0),
                )  # fmt: skip
        assert best is not None
        return best[1]

    def phi(self, u: Array, u_hat: Array, v_hat: Array, gamma: float, delta_psi: Array, first: Array) -> float:
        found = self.pairs(self.looked_at(first, u_hat, v_hat, gamma), self.points(u_hat))
        looked = self.looked_at(u, u_hat, v_hat, gamma)
        stored = sum(0.5 * pair.stiffness * pair.depth(looked) ** 2 for pair in found)
        return super().phi(u, u_hat, v_hat, gamma, delta_psi, first) + stored / (4.0 if self.ahead else 1.0)


def along(points: Array, i: int, j: int, k: int) -> float:
    """Share of the way from j to k of the foot of i."""
    e = points[k] - points[j]
    return float((points[i] - points[j]) @ e / (e @ e))


def height(points: Array, i: int, j: int, k: int) -> float:
    """Distance of i from the line from j to k, on its left [m]."""
    e, d = points[k] - points[j], points[i] - points[j]
    return float((e[0] * d[1] - e[1] * d[0]) / np.linalg.norm(e))
