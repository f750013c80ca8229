"""Random stages for the kernels and for the oracle."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from hubs import robot_with
from oracle import Star
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.der.body.body import freeze_body, move_roots, place_roots
from seastar_gym.der.contact.broad_phase import freeze_contact
from seastar_gym.der.contact.coupled import solve_coupled
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import Rods, Work, make_work
from seastar_gym.der.stepping.newton import move_along
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.damping import freeze_strains
from seastar_gym.der.terms.fluid import freeze_fluid
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, any_lane, borrow, load, splat, store
from seastar_gym.simd.numpy_lanes import Lanes


@entry_point
def direction(rods, work, q, q_0, gamma, ahead, convex, result):
    """What the terms keep is taken at work.q, in a step from q_0; the potential and its slopes are those at q."""
    rods_rows, memory, out = borrow(rods), borrow(work), borrow(result)
    h, mask = splat(gamma), load(borrow(convex), 0) > 0.0
    stage = Stage(memory.q_hat, memory.v_hat, h, 1.0 / h, ahead)
    freeze_fluid(rods_rows, memory)
    freeze_contact(rods_rows, memory, stage, borrow(q_0))
    freeze_strains(rods_rows, memory, memory.q_hat)
    for row in range(q.shape[0]):
        store(memory.q, row, load(borrow(q), row))
    if any_lane(mask):
        phi, decrement, pivot = factorise(rods_rows, memory, stage, mask)
    else:
        phi, decrement, pivot = factorise(rods_rows, memory, stage, None)
    store(out, 0, phi)
    store(out, 1, solve_coupled(rods_rows, memory, h > 0.0, decrement))
    store(out, 2, pivot)
    store(out, 3, move_along(rods_rows, memory, h > 0.0, h < 0.0, splat(1.0)))


def robot_and_star(n_limbs=5, nodes_per_limb=10, hub="rigid", fluid=True):
    """The same robot for the kernels and for the oracle."""
    shape, drag = {"n_limbs": n_limbs, "nodes_per_limb": nodes_per_limb}, 1.0 if fluid else 0.0
    robot = robot_with(hub, **shape)
    if hub == "rigid":
        return robot, Continuum(**shape, drag_coefficient=drag)
    return robot, Star(**shape, hub_hinge=hub, drag_coefficient=drag)


def rods_of(robot: Seastar, fluid: bool = True) -> Rods:
    pulse = SmaPulse(peak_angle=0.1 if robot.n_limbs > 1 else 0.0)  # one limb has nothing to turn against
    return make_rods(Scene(robot=robot, fluid=Water() if fluid else None, actuator=pulse))


def turn_limbs(work: Work, star: Star, delta_psi: np.ndarray) -> None:
    """Fill `work` with what is natural at the hub of limbs turned by delta_psi [rad], shape (N_LANES, n_limbs)."""
    if star.clamps:
        natural = np.array([clamp.direction for clamp in star.clamps]) + delta_psi
        work.hub_direction[:] = np.stack([np.cos(natural), np.sin(natural)], axis=2).reshape(N_LANES, -1).T
    else:
        natural = np.array([oracle.natural_angles(star, one)[-star.n_limbs :] for one in delta_psi])
        work.hub_EI_kappa_bar[:] = star.EI * 2.0 * np.tan(natural.T / 2.0) / star.edge_length


class RandomStages:
    """One random stage per lane, moderate: limbs bent by some degrees, edges strained by some per mille."""

    def __init__(self, star: Star, gamma: float, bend=0.15, stretch=2e-3, speed=0.1, seed=0):
        rng = np.random.default_rng(seed)
        self.star, self.gamma = star, gamma
        self.q = np.array([random_shape(star, bend, stretch, rng) for _ in range(N_LANES)])
        self.v_hat = speed * rng.standard_normal(self.q.shape)
        self.frozen = self.q + 1e-4 * speed * np.random.default_rng(seed).standard_normal(self.q.shape)
        self.q_hat = self.q - gamma * speed * rng.standard_normal(self.q.shape)
        self.delta_psi = rng.uniform(-0.1, 0.1, (N_LANES, star.n_limbs))

    def data(self, lane: int):
        return self.q_hat[lane], self.v_hat[lane], self.gamma, self.delta_psi[lane], self.frozen[lane]

    def phi(self, lane: int) -> float:
        return oracle.incremental_potential(self.star, self.q[lane], *self.data(lane))

    def gradient(self, lane: int) -> np.ndarray:
        return oracle.incremental_gradient(self.star, self.q[lane], *self.data(lane))

    def assert_step(self, found: SimpleNamespace, lane: int, hessian: np.ndarray, accuracy: float) -> None:
        """Newton's direction and its decrement are those of a Hessian."""
        gradient = self.gradient(lane)
        direction = np.linalg.solve(hessian, gradient.ravel()).reshape(-1, 2)
        assert found.decrement[lane] == pytest.approx(np.sum(gradient * direction), rel=accuracy)
        size = np.abs(direction).max()
        np.testing.assert_allclose(found.direction[lane], direction, rtol=0.0, atol=accuracy * size)

    def assert_agree(self, found: SimpleNamespace, accuracy: float = 1e-11) -> None:
        """Potential, Newton's direction and its decrement are those of the oracle in every lane."""
        for lane in range(N_LANES):
            assert found.phi[lane] == pytest.approx(self.phi(lane), rel=1e-12)
            self.assert_step(found, lane, self.hessian(lane), accuracy)

    def hessian(self, lane: int) -> np.ndarray:
        q_hat, _, gamma, delta_psi, frozen = self.data(lane)
        return oracle.incremental_hessian(self.star, self.q[lane], q_hat, gamma, delta_psi, frozen)

    def convex_hessian(self, lane: int) -> np.ndarray:
        """The Hessian without what may be negative: compression, curvature of the angles, bending's second part."""
        star, q = self.star, self.q[lane]
        hessian = oracle.inertia_matrix(star) / self.gamma**2
        hessian -= oracle.drag_jacobian(star, (q - self.q_hat[lane]) / self.gamma) / self.gamma
        D, edges = star.differences, oracle.edge_vectors(star, q)
        for D_e, e, EA, length in zip(D, edges, star.edge_EA, star.edge_lengths, strict=True):
            size = np.linalg.norm(e)
            along = np.outer(e, e) / size**2
            pull = max(EA * (size / length - 1.0), 0.0) / size
            hessian += D_e.T @ (EA / length * along + pull * (np.eye(2) - along)) @ D_e
        hinges = zip(oracle.hinge_terms(star, q, self.delta_psi[lane]), star.hinge_EI, star.hinge_dl, strict=True)
        for (a, b, phi, _), EI, dl in hinges:
            kappa_q = D[b].T @ oracle.direction_gradient(edges[b]) - D[a].T @ oracle.direction_gradient(edges[a])
            kappa_q *= (1.0 + np.tan(phi / 2.0) ** 2) / dl
            hessian += EI * dl * np.outer(kappa_q, kappa_q)
        return hessian + self.convex_clamps(lane) if star.clamps else hessian

    def convex_clamps(self, lane: int) -> np.ndarray:
        """Clamps without the curvature of angles, and those turned by more than a quarter without stiffness."""
        star, edges = self.star, oracle.edge_vectors(self.star, self.q[lane])
        turns = oracle.clamp_turns(star, self.q[lane], self.delta_psi[lane])
        K = np.array([clamp.stiffness for clamp in star.clamps])
        C = np.maximum(K * np.cos(turns - oracle.hub_orientation(turns, K)), 0.0)
        roots = [clamp.edge for clamp in star.clamps]
        theta_q = np.array([star.differences[e].T @ oracle.direction_gradient(edges[e]) for e in roots])
        return theta_q.T @ (np.diag(C) - np.outer(C, C) / C.sum()) @ theta_q

    def run(self, rods: Rods, convex=0.0, q=None, q_0=None, ahead=False):
        """Phi, decrement and pivot per lane, and the Newton direction, shape (N_LANES, n_nodes, 2)."""
        star, q = self.star, self.q if q is None else q
        work = make_work(rods, 1)
        for rows, nodes in ((work.q, self.frozen), (work.q_hat, self.q_hat), (work.v_hat, self.v_hat)):
            rows[:] = nodes.reshape(N_LANES, -1).T
        turn_limbs(work, star, self.delta_psi)
        result = np.zeros((4, N_LANES))
        rows, rows_0 = (np.ascontiguousarray(x.reshape(N_LANES, -1).T) for x in (q, self.q if q_0 is None else q_0))
        direction(rods, work, rows, rows_0, self.gamma, ahead, np.full((1, N_LANES), convex), result)
        return SimpleNamespace(
            phi=result[0],
            decrement=result[1],
            pivot=result[2],
            largest=result[3],
            direction=-work.step.T.reshape(N_LANES, -1, 2),
            moved=work.q.T.reshape(N_LANES, -1, 2) - q,
        )


def random_shape(star: Star, bend: float, stretch: float, rng: np.random.Generator) -> np.ndarray:
    """Limbs whose hinges turn by about `bend` [rad] and whose edges are strained by about `stretch`."""
    q = np.zeros((star.n_nodes, 2)) + 0.05 * rng.standard_normal(2)
    for limb in range(star.n_limbs):
        angle = 2.0 * np.pi * limb / star.n_limbs
        for i in range(1, star.nodes_per_limb):
            angle += bend * rng.standard_normal()
            length = star.edge_length * (1.0 + stretch * rng.standard_normal())
            step = length * np.array([np.cos(angle), np.sin(angle)])
            q[star.node(limb, i)] = q[star.node(limb, i - 1)] + step
    return q


# Robots with a body, whose unknowns u are their nodes, flat, and the angle [rad]


def unknown_rows(rods: Rods, u: np.ndarray) -> np.ndarray:
    """Unknowns of every robot as rows; roots and corners left out."""
    n = len(u) - 1
    rows = np.zeros((n + 2 + 2 * rods.body.n_arms, N_LANES))
    rows[:n], rows[n] = u[:-1, None], u[-1] * rods.body.scale[0]
    return rows


def unknowns(rods: Rods, rows: np.ndarray) -> np.ndarray:
    """Those of the first robot."""
    n = 2 * rods.n_nodes
    return np.append(rows[:n, 0], rows[n, 0] / rods.body.scale[0])


def begun_on_body(rods: Rods, directions: np.ndarray, stage: SimpleNamespace, ahead: bool) -> tuple[Work, Stage]:
    """(work, stage) of kernels where the first guess of a stage is frozen, and the iterate is at its u.

    stage: u, u_hat, v_hat and first, unknowns; gamma [s]; delta_psi, rotations of limbs [rad]. directions: Of limbs at
        rest [rad].
    """
    work, gamma = make_work(rods, 1), Lanes(stage.gamma)
    q_hat, v_hat = unknown_rows(rods, stage.u_hat), unknown_rows(rods, stage.v_hat)
    move_roots.plain(rods, q_hat, v_hat)
    begun = Stage(q_hat, v_hat, gamma, 1.0 / gamma, ahead)
    rates = (stage.first - stage.u_hat) / stage.gamma
    work.q[:] = unknown_rows(rods, stage.first)
    place_roots.plain(rods, work.q)
    freeze_contact.plain(rods, work, begun, q_hat)
    freeze_body.plain(rods, work, begun, tuple(Lanes(rates[k]) for k in (0, 1, -1)))
    freeze_fluid.plain(rods, work)
    freeze_strains.plain(rods, work, q_hat)
    natural = directions + stage.delta_psi
    work.hub_direction[:] = np.stack([np.cos(natural), np.sin(natural)], axis=1).reshape(-1, 1)
    work.q[:] = unknown_rows(rods, stage.u)
    place_roots.plain(rods, work.q)
    return work, begun
