"""Random stages for the kernels, in plain Python, and for the oracle."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from hubs import robot_with
from oracle import Star
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.body import freeze_body, move_roots, place_roots
from seastar_gym.rods.bundles import Rods, Work, make_work
from seastar_gym.rods.contact.coupled import solve_coupled
from seastar_gym.rods.contact.pairs import freeze_contact
from seastar_gym.rods.newton import move_along
from seastar_gym.rods.potential import factorise
from seastar_gym.rods.step import Stage
from seastar_gym.rods.terms.damping import freeze_strains
from seastar_gym.rods.terms.fluid import freeze_fluid
from seastar_gym.rods.terms.hub import Actuation, set_natural_hub_angles
from slopes import nodes, plain, rows

EVERYONE = Mask(np.ones(N_LANES, bool))


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


def turn_limbs(rods: Rods, work: Work, delta_psi: np.ndarray) -> None:
    """Fill `work` with what is natural of limbs turned by delta_psi [rad], shape (N_LANES, n_limbs) or (n_limbs,)."""
    turns = np.broadcast_to(delta_psi, (N_LANES, rods.n_limbs)).T.copy()
    set_natural_hub_angles(rods, work, Actuation(0.0 * turns, turns), Lanes(1.0))


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

    def star_of(self, lane: int) -> tuple[Star, np.ndarray]:
        """(star, rotations of its limbs at the hub [rad])."""
        return self.star.turned(self.delta_psi[lane])

    def data(self, lane: int):
        return self.q_hat[lane], self.v_hat[lane], self.gamma, self.star_of(lane)[1], self.frozen[lane]

    def phi(self, lane: int) -> float:
        return oracle.incremental_potential(self.star_of(lane)[0], self.q[lane], *self.data(lane))

    def gradient(self, lane: int) -> np.ndarray:
        return oracle.incremental_gradient(self.star_of(lane)[0], self.q[lane], *self.data(lane))

    def hessian(self, lane: int, convex: bool = False) -> np.ndarray:
        q_hat, _, gamma, delta_psi, frozen = self.data(lane)
        star, _ = self.star_of(lane)
        return oracle.incremental_hessian(star, self.q[lane], q_hat, gamma, delta_psi, frozen, convex)

    def assert_step(self, found: SimpleNamespace, lane: int, hessian: np.ndarray, accuracy: float) -> None:
        """Newton's direction and its decrement are those of a Hessian."""
        gradient = self.gradient(lane)
        direction = np.linalg.solve(hessian, gradient.ravel()).reshape(-1, 2)
        assert found.decrement[lane] == pytest.approx(np.sum(gradient * direction), rel=accuracy)
        size = np.abs(direction).max()
        np.testing.assert_allclose(found.direction[lane], direction, rtol=0.0, atol=accuracy * size)

    def begin(self, rods: Rods, q: np.ndarray | None = None, q_0=None, ahead=False, again=False) -> tuple[Work, Stage]:
        """(work, stage): what the terms keep is taken at the frozen places, in a step from q_0; the iterate is at q."""
        work, gamma = make_work(rods, 1, again), Lanes(self.gamma)
        work.q[:], work.q_hat[:], work.v_hat[:] = map(rows, (self.frozen, self.q_hat, self.v_hat))
        turn_limbs(rods, work, self.delta_psi)
        stage = Stage(work.q_hat, work.v_hat, gamma, 1.0 / gamma, ahead)
        freeze_fluid(rods, work)
        freeze_contact(rods, work, stage, rows(self.q if q_0 is None else q_0))
        freeze_strains(rods, work, work.q_hat)
        work.q[:] = rows(self.q if q is None else q)
        return work, stage

    def run(self, rods: Rods, convex: Mask | None = None, **places: Any) -> SimpleNamespace:
        """Phi, decrement and pivot per lane, and the Newton direction, shape (N_LANES, n_nodes, 2)."""
        work, stage = self.begin(rods, **places)
        before = work.q.copy()
        phi, decrement, pivot = factorise(rods, work, stage, convex)
        decrement = solve_coupled(rods, work, EVERYONE, decrement)
        largest = move_along(rods, work, EVERYONE, None, Lanes(1.0))
        phi, decrement, pivot, largest = (np.broadcast_to(plain(x), N_LANES) for x in (phi, decrement, pivot, largest))
        return SimpleNamespace(
            phi=phi, decrement=decrement, pivot=pivot, largest=largest, direction=-nodes(work.step),
            moved=nodes(work.q - before),
        )  # fmt: skip


def random_shape(star: Star, bend: float, stretch: float, rng: np.random.Generator) -> np.ndarray:
    """Limbs whose hinges turn by about `bend` [rad] and whose edges are strained by about `stretch`."""
    q = np.zeros((star.n_nodes, 2)) + 0.05 * rng.standard_normal(2)
    for limb, direction in enumerate(star.limb_directions):
        angle = direction
        for i in range(1, star.nodes_per_limb):
            angle += bend * rng.standard_normal() + (i > 1) * star.natural_turns[limb]
            length = star.edge_lengths[star.edge(limb, i - 1)] * (1.0 + stretch * rng.standard_normal())
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
    move_roots(rods, q_hat, v_hat)
    begun = Stage(q_hat, v_hat, gamma, 1.0 / gamma, ahead)
    rates = (stage.first - stage.u_hat) / stage.gamma
    work.q[:] = unknown_rows(rods, stage.first)
    place_roots(rods, work.q)
    freeze_contact(rods, work, begun, q_hat)
    freeze_body(rods, work, begun, tuple(Lanes(rates[k]) for k in (0, 1, -1)))
    freeze_fluid(rods, work)
    freeze_strains(rods, work, q_hat)
    natural = directions + stage.delta_psi
    work.clamp.direction[:] = np.stack([np.cos(natural), np.sin(natural)], axis=1).reshape(-1, 1)
    work.q[:] = unknown_rows(rods, stage.u)
    place_roots(rods, work.q)
    return work, begun
