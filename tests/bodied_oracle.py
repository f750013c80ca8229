"""The oracle of robots with a body: the stars of oracle.py, whose limbs begin at nodes of their own.

Nodes are those of the star, then one per limb, its root on the body. Unknowns are the star's nodes, flat, and the
body's angle [rad]. Roots follow from hub and angle; clamps, the rigid mass and the drag of strips are added here.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import oracle
from continuum_oracle import Continuum
from oracle import Array, Clamp


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


def turned(angle: float, points: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


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
        return np.concatenate([nodes, nodes[0] + turned(u[-1], self.arms)])

    def rates(self, u: Array, rate: Array) -> Array:
        """Velocities of nodes and roots [m/s]."""
        nodes = rate[:-1].reshape(-1, 2)
        return np.concatenate([nodes, nodes[0] + rate[-1] * crossed(turned(u[-1], self.arms))])

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
        arms, frozen = turned(first[-1], self.arms), self.places(first)
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
        S = turned(first[-1], self.moment)
        total = 0.5 * self.mass * d @ d + 0.5 * self.inertia * turn**2 + turn * d @ crossed(S)
        total -= gamma * omega**2 * d @ S
        u_fluid = np.zeros(2) if self.star.current is None else self.star.current(first[:2][None])[0]
        w, w_guess = rate[:2] - u_fluid, guess[:2] - u_fluid
        R = turned(first[-1], np.eye(2)).T
        P = R @ self.added_mass @ R.T
        K = np.array([[0.0, -1.0], [1.0, 0.0]])
        P_turns = K @ P - P @ K
        total += 0.5 * d @ P @ d + gamma * omega * d @ P_turns @ w_guess
        total -= gamma * turn * 0.5 * w_guess @ P_turns @ w_guess
        flows = turned(first[-1], self.strips[:, :2]) @ w + self.strips[:, 2] * rate[-1]
        total += gamma * (self.isotropic * np.linalg.norm(w) ** 3 + self.strips[:, 3] @ np.abs(flows) ** 3) / 3.0
        fallen = turned(u[-1], self.weight_moment) - turned(u_hat[-1], self.weight_moment)
        return float(total - self.fall @ fallen - gamma * self.weight * self.fall @ d)
