"""Potential and Newton direction of robots with a body are those of a dense oracle; steps end where Phi is least."""

from types import SimpleNamespace

import numpy as np
import pytest

from bodied_oracle import Apart, Rigid, crossed, turned
from currents import CURRENTS, velocity
from seastar_gym import Attachment, Body, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.der.body.body import freeze_body, place_roots
from seastar_gym.der.geometry import rotation
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.momentum import correct_momentum
from seastar_gym.der.stepping.newton import minimise, take_step
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.der.terms.fluid import freeze_fluid
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import gradient, hessian, plain, slope
from stages import begun_on_body, unknown_rows, unknowns

UNEVEN = Body(
    outline=((0.03, -0.01), (0.02, 0.02), (-0.02, 0.015), (-0.025, -0.02)), mass=4e-3, centre_of_mass=(4e-3, -3e-3),
    attachments=(Attachment(0.03, 0.005, 0.3), Attachment(-0.01, 0.018, 1.4), Attachment(-0.02, -0.01, 3.6)),
)  # fmt: skip
SCENES = {
    "disc in vacuum": {"body": Body(radius=0.02), "fluid": None},
    "disc in water": {"body": Body(radius=0.02), "fluid": Water()},
    "coefficients": {"body": Body(radius=0.02, drag_along=0.5, drag_across=2.0, drag_turning=0.7), "fluid": Water()},
    "uneven body": {"body": UNEVEN, "fluid": Water(950.0, 1.3, 0.2, None, 0.8)},
    "uneven body in a current": {"body": UNEVEN, "fluid": Water(950.0, 1.3, 0.2, CURRENTS["shear"], 0.8)},
    "damping": {"body": UNEVEN, "fluid": Water(), "relaxation_time": 4e-3},
    "weight": {"body": UNEVEN, "fluid": Water(950.0), "gravity": (1.0, -9.81)},
}
N_LIMBS, N = 3, 3
EVERYONE = Mask(np.ones(N_LANES, bool))


def make(body, fluid, relaxation_time=None, gravity=None):
    """(scene, rods, oracle) of a robot of three limbs around a body."""
    robot = Seastar(N_LIMBS, N, body=body, relaxation_time=relaxation_time)
    scene = Scene(robot, fluid, SmaPulse(0.3), gravity=gravity)
    rods = make_rods(scene)
    water = fluid or Water(drag_coefficient=0.0)
    star = Apart(
        N_LIMBS, N, fluid_density=water.density, drag_coefficient=water.drag_coefficient,
        tangential_drag_coefficient=water.tangential_drag_coefficient,
        added_mass_coefficient=water.added_mass_coefficient or 0.0, relaxation_time=relaxation_time or 0.0,
        current=None if water.current is None else lambda places: velocity("shear", places),
        gravity=gravity or (0.0, 0.0),
    )  # fmt: skip
    on = rods.body
    P = on.added_mass if on.added_mass is not None else np.zeros(3)
    weight = on.weight if on.weight is not None else np.zeros(4)
    rigid = Rigid(
        star=star, arms=on.arm.reshape(-1, 2), directions=np.array([limb.direction for limb in robot.limb_shapes()]),
        mass=float(rods.mass[0]), moment=on.moment, inertia=float(on.inertia[0]), isotropic=float(rods.drag[0]),
        strips=on.strips.reshape(-1, 4), added_mass=np.array([[P[0], P[1]], [P[1], P[2]]]), fall=weight[:2],
        weight_moment=weight[2:],
        weight=0.0 if gravity is None else float(rods.load[1] / gravity[1]),
    )  # fmt: skip
    return scene, rods, rigid


def random_stage(rods, rigid, gamma, seed):
    """Iterate, start, velocity and first guess, each the nodes, flat, and the angle [rad]; rotations of limbs [rad]."""
    rng = np.random.default_rng(seed)
    at_rest = np.concatenate([turned_limbs(rigid, rng).ravel(), [0.0]])
    angle = rng.uniform(-9.0, 9.0)
    c, s = np.cos(angle), np.sin(angle)
    nodes = at_rest[:-1].reshape(-1, 2) @ np.array([[c, s], [-s, c]]) + 0.05 * rng.standard_normal(2)
    u = np.append(nodes.ravel(), angle)
    wild = np.append(np.full(len(u) - 1, 0.1), 2.0)
    return SimpleNamespace(
        u=u,
        u_hat=u - gamma * wild * rng.standard_normal(len(u)),
        v_hat=wild * rng.standard_normal(len(u)),
        first=u + 1e-4 * wild * rng.standard_normal(len(u)),
        delta_psi=rng.uniform(-0.3, 0.3, N_LIMBS),
        gamma=gamma,
    )


def turned_limbs(rigid, rng):
    """Nodes of limbs that are bent and stretched a little, on a body that is not turned."""
    star, nodes = rigid.star, [np.zeros((1, 2))]
    for arm, direction in zip(rigid.arms, rigid.directions, strict=True):
        angles = direction + np.cumsum(0.15 * rng.standard_normal(N - 1))
        lengths = star.edge_length * (1.0 + 2e-3 * rng.standard_normal(N - 1))
        steps = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        nodes.append(arm + np.cumsum(steps, axis=0))
    return np.concatenate(nodes)


def run(rods, rigid, stage, convex=None):
    """(Phi, decrement, pivot, Newton direction in the unknowns) by the kernels."""
    work, kernel_stage = begun_on_body(rods, rigid.directions, stage, ahead=False)
    phi, decrement, pivot = plain(factorise.plain(rods, work, kernel_stage, convex))
    take_step.plain(rods, work, EVERYONE, None, Lanes(1.0))
    return phi[0], decrement[0], pivot[0], -unknowns(rods, work.step)


@pytest.mark.parametrize("name, gamma", [*((name, 1e-2) for name in SCENES), ("uneven body", 1e-3)])
def test_potential_and_newton_direction_are_those_of_the_oracle(name, gamma):
    _, rods, rigid = make(**SCENES[name])
    stage = random_stage(rods, rigid, gamma, seed=len(name))

    def phi(u):
        return rigid.phi(u, stage.u_hat, stage.v_hat, gamma, stage.delta_psi, stage.first)

    found, decrement, _, direction = run(rods, rigid, stage)
    assert found == pytest.approx(phi(stage.u), rel=1e-10)
    slopes, size = gradient(phi, stage.u, 1e-6), np.abs(direction).max()
    along = slope(lambda share: gradient(phi, stage.u + share * direction / size, 1e-5), 0.0, 1e-5)
    np.testing.assert_allclose(size * along, slopes, rtol=0.0, atol=3e-5 * np.abs(slopes).max())
    assert decrement == pytest.approx(slopes @ direction, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_a_regularised_matrix_is_positive_definite_however_limbs_press(seed):
    """With limbs pushed into a disc, the curvature of their roots' circles is negative."""
    _, rods, rigid = make(Body(radius=0.05), None)
    stage = random_stage(rods, rigid, 1.0, seed)
    stage.u[2:-1] *= 0.7  # compressed by a third
    _, _, pivot, _ = run(rods, rigid, stage)
    assert not pivot > 0.0
    _, decrement, pivot, _ = run(rods, rigid, stage, EVERYONE)
    assert pivot > 0.0 and decrement > 0.0


@pytest.mark.parametrize("scheme, share", [("implicit-euler", 1.0), ("implicit-midpoint", 0.5)])
@pytest.mark.parametrize("name", ["disc in water", "uneven body in a current", "weight"])
def test_a_step_ends_where_the_oracle_has_its_minimum(name, scheme, share):
    scene, rods, rigid = make(**SCENES[name])
    scene = Scene(
        scene.robot, scene.fluid, SmaPulse(0.0), Numerics(scheme, 0.01, newton_tolerance=1e-12), gravity=scene.gravity
    )
    start, h = random_stage(rods, rigid, 0.01, seed=1), 0.01
    start.v_hat *= 0.1
    simulator = Simulator(scene)
    nodes, rates = start.u[:-1].reshape(1, -1, 2), start.v_hat[:-1].reshape(1, -1, 2)
    turning = (start.u[-1:], start.v_hat[-1:])
    simulator.set_state((nodes, rates, np.zeros(1), None, None, None, *turning))
    simulator.advance(h, np.zeros((1, N_LIMBS)))
    end = np.append(simulator.positions.ravel(), simulator.orientation())
    u, gamma = start.u + share * (end - start.u), share * h
    first = start.u + gamma * start.v_hat

    def phi(u):
        return rigid.phi(u, start.u, start.v_hat, gamma, np.zeros(N_LIMBS), first)

    off = np.linalg.solve(hessian(lambda many: [phi(x) for x in many], u, 1e-5), gradient(phi, u, 1e-6))
    assert np.abs(off).max() < 1e-6 * np.abs(end - start.u).max()


def turning_momentum(rigid, u, rates):
    """What a body's turning adds to the momentum [kg m/s]."""
    return rates[-1] * crossed(turned(u[-1], rigid.moment))


@pytest.mark.parametrize("scheme", list(SCHEMES))
def test_in_vacuum_a_step_leaves_the_oracle_s_minimum_by_a_move_of_the_whole_robot_that_keeps_its_momentum(scheme):
    """As far as the first guess is off. Schemes of several stages are tried at their first one."""
    _, rods, rigid = make(UNEVEN, None)
    tableau, h = SCHEMES[scheme], 0.01
    gamma = h * tableau.a[0]
    start = random_stage(rods, rigid, h, seed=1)
    start.v_hat *= 0.1
    first = start.u + gamma * start.v_hat
    u = settled(rods, rigid, tableau, start, gamma, h)

    def phi(x):
        return rigid.phi(x, start.u, start.v_hat, gamma, np.zeros(N_LIMBS), first)

    off = np.linalg.solve(hessian(lambda many: [phi(x) for x in many], u, 1e-5), gradient(phi, u, 1e-6))
    move = np.append(np.tile(off[:2], len(u) // 2), 0.0)
    way = np.abs(u - start.u).max()
    assert np.abs(off[:2]).max() > 1e-6 * way
    np.testing.assert_allclose(off, move, rtol=0.0, atol=1e-7 * way)
    rates = (u - start.u) / gamma
    end = start.u + h * rates if scheme == "implicit-midpoint" else u
    end_rates = start.v_hat + (rates - start.v_hat) * (end - start.u)[-1] / (u - start.u)[-1]
    masses = np.append(rods.mass[: len(u) // 2], 0.0)
    change = masses[:-1] @ (end_rates - start.v_hat)[:-1].reshape(-1, 2)
    change += turning_momentum(rigid, end, end_rates) - turning_momentum(rigid, start.u, start.v_hat)
    assert np.abs(change).max() < 1e-12 * masses.sum() * np.abs(rates).max()


def settled(rods, rigid, tableau, start, gamma, h):
    """Where the first stage of a step in vacuum ends, by the kernels."""
    work = make_work(rods, tableau.n_stages)
    q_hat, v_hat = unknown_rows(rods, start.u), unknown_rows(rods, start.v_hat)
    stage = Stage(q_hat, v_hat, Lanes(gamma), Lanes(1.0 / gamma), not tableau.stiffly_accurate)
    work.q[:] = unknown_rows(rods, start.u + gamma * start.v_hat)
    for rows in (work.q, q_hat):
        place_roots.plain(rods, rows)
    freeze_body.plain(rods, work, stage, tuple(map(Lanes, (*start.v_hat[:2], start.v_hat[-1]))))
    freeze_fluid.plain(rods, work)
    work.hub_direction[:] = np.stack([np.cos(rigid.directions), np.sin(rigid.directions)], axis=1).reshape(-1, 1)
    minimise.plain(rods, work, stage, EVERYONE, Lanes(1e-13), Lanes(60.0))
    correct_momentum.plain(rods, work, tableau, 0, stage, q_hat, v_hat, Lanes(h), EVERYONE)
    return unknowns(rods, work.q)


@pytest.mark.parametrize("turns", [0.0, 1e-9, 0.3, 3.1, 3.2, -7.0, 100.0, -1e4])
def test_rotations_are_those_of_any_angle(turns):
    c, s = plain(rotation.plain(Lanes(np.array([turns]))))
    assert c[0] == pytest.approx(np.cos(turns), abs=1e-12) and s[0] == pytest.approx(np.sin(turns), abs=1e-12)
    assert c[0] ** 2 + s[0] ** 2 == pytest.approx(1.0, abs=1e-15)
