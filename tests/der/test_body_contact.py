"""Contact of limbs with a body and with each other around it: potential, Newton direction and forces of the oracle."""

from types import SimpleNamespace

import numpy as np
import pytest

from bodied_oracle import Apart, Touching, turned
from fuzz.frames import mirrored_body, swapped
from seastar_gym import Attachment, Body, Contact, Scene, Seastar, SmaPulse, Water
from seastar_gym.der.body.body import begin_body, place_roots
from seastar_gym.der.contact.broad_phase import freeze_contact
from seastar_gym.der.contact.contact import add_contact, n_listed
from seastar_gym.der.contact.coupled import solve_coupled
from seastar_gym.der.contact.crossing import without_new_crossings
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.newton import move_along
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import gradient, plain, slope
from stages import begun_on_body, unknown_rows, unknowns

ANGLE, N_LIMBS, N, LENGTH = 0.3, 3, 4, 0.06
UNEVEN = Body(
    outline=((0.03, -0.01), (0.02, 0.02), (-0.02, 0.015), (-0.025, -0.02)), mass=4e-3, centre_of_mass=(4e-3, -3e-3),
    attachments=(Attachment(0.03, -0.01, -0.3), Attachment(-0.02, 0.015, 2.4), Attachment(-0.0205, 0.012, 2.9)),
)  # fmt: skip
BODIES = {"disc": Body(radius=0.02), "polygon": UNEVEN}
EVERYONE = Mask(np.ones(N_LANES, bool))


def make(name: str, ahead: bool = False, relaxation_time: float | None = None):
    """(rods, oracle) of a robot of three short limbs around a body, in water."""
    body = BODIES[name]
    robot = Seastar(N_LIMBS, N, LENGTH, body=body, relaxation_time=relaxation_time)
    scene = Scene(robot, Water(), SmaPulse(0.3), contact=Contact(opening_angle=ANGLE))
    rods = make_rods(scene)
    star = Apart(N_LIMBS, N, LENGTH, relaxation_time=relaxation_time or 0.0)
    on = rods.body
    corners = np.array(body.outline) if body.outline else np.zeros((1, 2))
    oracle = Touching(
        star=star, arms=on.arm.reshape(-1, 2)[:N_LIMBS], corners=corners, radius=body.radius,
        directions=np.array([limb.direction for limb in robot.limb_shapes()]), mass=float(rods.mass[0]),
        moment=on.moment, inertia=float(on.inertia[0]), isotropic=float(rods.drag[0]), strips=on.strips.reshape(-1, 4),
        added_mass=np.zeros((2, 2)), fall=np.zeros(2), weight_moment=np.zeros(2), weight=0.0,
        limbs=tuple(robot.limbs_that_may_touch()), opening_angle=ANGLE, ahead=ahead,
    )  # fmt: skip
    return rods, oracle


def folded(oracle: Touching, rng: np.random.Generator, kind: str) -> np.ndarray:
    """Nodes of limbs around a body that is not turned.

    Limb 1 meets the outline with a node (kind "side"), or meets a corner, or a disc, with an edge between its nodes
    ("corner"); limbs 2 and 3 meet each other ("limb").
    """
    nodes = [np.zeros((1, 2))]
    for limb, (arm, direction) in enumerate(zip(oracle.arms, oracle.directions, strict=True)):
        turns = 0.03 * rng.standard_normal((1, N - 1))
        if limb == 0 and kind != "limb":
            turns = rng.uniform([-1.4, -1.9, -1.9], [1.4, 1.9, 1.9], (40_000, N - 1))
        elif limb > 0 and kind == "limb":
            turns[:, 0] += 0.27 if limb == 1 else -0.27
        angles = direction + np.cumsum(turns, axis=1)
        steps = oracle.star.edge_length * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        shapes = arm + np.cumsum(steps, axis=1)
        if len(shapes) > 1:
            shapes = shapes[meets(oracle, shapes, arm, kind)]
        nodes.append(shapes[0])
    return np.concatenate(nodes)


def meets(oracle: Touching, shapes: np.ndarray, arm: np.ndarray, kind: str) -> np.ndarray:
    """Mask of limbs, shape (n, N - 1, 2), outside of the body that meet it by the kind alone."""
    shares = np.linspace(0.0, 1.0, 21)[1:-1, None, None, None]
    edges = (1.0 - shares) * shapes[None, :, :-1] + shares * shapes[None, :, 1:]
    root = (1.0 - shares[3:]) * arm + shares[3:] * shapes[None, :, :1]
    at_nodes, at_edges = clearance(oracle, shapes).min(axis=-1), clearance(oracle, edges).min(axis=(0, 2))
    meeting = (at_nodes < 1.2e-3) if kind == "side" else (at_edges < 1.2e-3) & (at_nodes > 2e-3)
    clear = np.minimum(np.minimum(at_nodes, at_edges), clearance(oracle, root).min(axis=(0, 2)))
    return meeting & (clear > 3e-4)


def clearance(oracle: Touching, points: np.ndarray) -> np.ndarray:
    """Distance of points from the rim of a body that is not turned [m], at most, negative within."""
    a = oracle.corners
    if len(a) == 1:
        return np.linalg.norm(points, axis=-1) - oracle.radius
    e = np.roll(a, -1, axis=0) - a
    normals = np.stack([e[:, 1], -e[:, 0]], axis=1) / np.linalg.norm(e, axis=1)[:, None]
    return ((points[..., None, :] - a) * normals).sum(axis=-1).max(axis=-1)


def random_stage(oracle: Touching, gamma: float, seed: int, kind: str) -> SimpleNamespace:
    """A stage with limbs folded so that pairs of a kind press each other."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-9.0, 9.0)
    u = np.append((turned(angle, folded(oracle, rng, kind)) + 0.05 * rng.standard_normal(2)).ravel(), angle)
    assert kind in pressed(oracle, u)
    wild = np.append(np.full(len(u) - 1, 0.1), 2.0)
    return SimpleNamespace(
        u=u, u_hat=u - 1e-5 * wild * rng.standard_normal(len(u)), v_hat=0.1 * wild * rng.standard_normal(len(u)),
        first=u + 1e-4 * wild * rng.standard_normal(len(u)), delta_psi=rng.uniform(-0.3, 0.3, N_LIMBS), gamma=gamma,
    )  # fmt: skip


def pressed(oracle: Touching, u: np.ndarray) -> set[str]:
    """Kinds of the pairs that press each other at u."""
    points, n = oracle.points(u), oracle.star.n_nodes
    pairs = [pair for pair in oracle.pairs(points, points) if pair.depth(points) > 0.0]
    return {"corner" if pair.i >= n else "side" if pair.k >= n else "limb" for pair in pairs}


CASES = [
    ("disc", False, "side", None),
    ("disc", True, "corner", None),
    ("polygon", False, "corner", None),
    ("polygon", False, "limb", None),
    ("polygon", False, "side", 4e-3),
    ("polygon", True, "side", None),
]


@pytest.mark.parametrize("name, ahead, kind, relaxation_time", CASES)
def test_potential_and_newton_direction_are_those_of_the_oracle(name, ahead, kind, relaxation_time):
    """Slopes of the potential by differences; the Hessian of contact is in the coupled step alone."""
    rods, oracle = make(name, ahead, relaxation_time)
    stage = random_stage(oracle, 2e-3, 1, kind)
    work, kernel_stage = begun_on_body(rods, oracle.directions, stage, oracle.ahead)
    energy, decrement, pivot = factorise.plain(rods, work, kernel_stage, None)
    assert n_listed.plain(work) > 0 and np.isfinite(plain(pivot)).all()
    decrement = solve_coupled.plain(rods, work, EVERYONE, decrement)
    move_along.plain(rods, work, EVERYONE, None, Lanes(1.0))
    direction = -unknowns(rods, work.step)

    def phi(u):
        return oracle.phi(u, stage.u_hat, stage.v_hat, stage.gamma, stage.delta_psi, stage.first)

    assert plain(energy)[0] == pytest.approx(phi(stage.u), rel=1e-9)
    slopes = gradient(phi, stage.u, 1e-7)
    size = np.abs(direction).max()
    along = slope(lambda share: gradient(phi, stage.u + share * direction / size, 1e-6), 0.0, 1e-6)
    np.testing.assert_allclose(size * along, slopes, rtol=0.0, atol=1e-4 * np.abs(slopes).max())
    assert plain(decrement)[0] == pytest.approx(slopes @ direction, rel=1e-4)


@pytest.mark.parametrize("kind", ["side", "corner"])
@pytest.mark.parametrize("name", BODIES)
def test_forces_neither_push_nor_turn_robot_and_body_together(name, kind):
    """What limbs feel is what the body gets, in the hub's force and in the residual of its angle."""
    rods, oracle = make(name)
    stage = random_stage(oracle, 2e-3, 3, kind)
    stage.first = stage.u
    work, kernel_stage = begun_on_body(rods, oracle.directions, stage, oracle.ahead)
    begin_body.plain(rods, work)
    energy = add_contact.plain(rods, work, kernel_stage, None, Lanes(0.0))
    n = 2 * oracle.star.n_nodes - 2 * N_LIMBS
    force, q = (rows[:n, 0].reshape(-1, 2) for rows in (work.contact.force, work.q))
    assert plain(energy)[0] > 0.0 and not work.contact.force[n + 2 :].any() and n_listed.plain(work) > 0
    size = np.abs(force).max()
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * size)
    torque = -work.body.system[3, 0]
    arms = q - q[0]
    assert torque == pytest.approx(-(arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]).sum(), abs=1e-9 * size)
    assert (name == "disc") == (abs(torque) < 1e-9 * size)


def test_nodes_that_entered_a_body_belong_to_the_side_that_they_came_from():
    """However deep the first guess has carried them."""
    rods, oracle = make("polygon")
    stage = random_stage(oracle, 2e-3, 1, "limb")
    node = oracle.star.node(0, N - 1)
    top = 0.5 * (oracle.corners[1] + oracle.corners[2])
    out = np.array([0.005, 0.04]) / np.hypot(0.005, 0.04)
    for at, place in (("u_hat", top + 1e-3 * out), ("first", top - 0.012 * out)):
        nodes = turned(-stage.u[-1], stage.u[:-1].reshape(-1, 2) - stage.u[:2])
        nodes[node] = place
        moved = turned(stage.u[-1], nodes) + stage.u[:2]
        setattr(stage, at, np.append(moved.ravel(), stage.u[-1]))
    stage.u = stage.first
    work, kernel_stage = begun_on_body(rods, oracle.directions, stage, oracle.ahead)
    begin_body.plain(rods, work)
    add_contact.plain(rods, work, kernel_stage, None, Lanes(0.0))
    force = turned(-stage.u[-1], work.contact.force[2 * node : 2 * node + 2, 0])
    np.testing.assert_allclose(force / np.linalg.norm(force), [-0.005 / 0.0403112887, 0.04 / 0.0403112887], atol=1e-3)


def forces(body: Body, began: np.ndarray, guessed: np.ndarray) -> np.ndarray:
    """Forces of contact [N] where nodes are nearer to the hub than in the first guess of a step that began at others.

    Nodes and forces have the shape (N_LANES, n_nodes, 2). The hub is at the origin, and the body is not turned.
    """
    rods = make_rods(Scene(Seastar(N_LIMBS, N, LENGTH, body=body), contact=Contact(opening_angle=ANGLE)))
    work, n = make_work(rods, 1), 2 * began.shape[1]
    q_0, still = np.zeros_like(work.q), np.zeros_like(work.q)
    for rows, nodes in ((q_0, began), (work.q, guessed)):
        rows[:n] = nodes.reshape(N_LANES, n).T
        place_roots.plain(rods, rows)
    stage = Stage(q_0, still, Lanes(1.0), Lanes(1.0), False)
    freeze_contact.plain(rods, work, stage, q_0)
    work.q[:n] *= 0.8
    begin_body.plain(rods, work)
    add_contact.plain(rods, work, stage, None, Lanes(0.0))
    return work.contact.force[:n].T.reshape(began.shape)


LINE = np.array([[-0.05, 0.0], [-0.07, 0.0], [-0.09, 0.0]])
"""Nodes of a limb [m]. `MEETING` has those of another whose tip meets it, and where to that is pushed."""
MEETING = {
    "tip": ([[-0.17, 0.0005], [-0.13, 0.0005], [-0.092, 0.0005]], (-0.002, 0.0005)),
    "left": ([[-0.08, -0.05], [-0.08, -0.03], [-0.08, -0.001]], (0.0, -1.0)),
    "right": ([[-0.08, 0.05], [-0.08, 0.03], [-0.08, 0.001]], (0.0, 1.0)),
}


@pytest.mark.parametrize("side", MEETING)
@pytest.mark.parametrize("limb", [1, 2])
def test_limbs_on_a_body_meet_where_they_are(side, limb):
    """On either side and in front of a tip, however they are numbered, since they may go round each other's tips."""
    nodes, away = MEETING[side]
    limbs = [np.array([[0.5, 0.5], [0.5, 0.6], [0.5, 0.7]]), LINE, np.array(nodes)]
    if limb == 1:
        limbs[1:] = limbs[:0:-1]
    places = np.tile(np.concatenate([np.zeros((1, 2)), *limbs]), (N_LANES, 1, 1))
    force = forces(UNEVEN, places, places)[0, (N - 1) * (limb + 1)]
    np.testing.assert_allclose(force / np.linalg.norm(force), away / np.linalg.norm(away), atol=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_who_meets_a_body_is_alike_in_a_mirror_however_far_a_step_goes(name):
    """A corner that a node comes to from beside one side of an outline or the other is met from both."""
    body, rng = BODIES[name], np.random.default_rng(0)
    order = [0] + [1 + limb * (N - 1) + place for limb in swapped(N_LIMBS) for place in range(N - 1)]
    n_met = 0
    for _ in range(20):
        began, guessed = rng.uniform(-0.06, 0.06, (2, N_LANES, 1 + N_LIMBS * (N - 1), 2))
        began[:, 0] = guessed[:, 0] = 0.0
        own = forces(body, began, guessed)
        other = forces(mirrored_body(body), *(nodes[:, order] * [1.0, -1.0] for nodes in (began, guessed)))
        np.testing.assert_allclose(other[:, order] * [1.0, -1.0], own, atol=1e-9 * np.abs(own).max())
        n_met += np.count_nonzero(own[:, 1:].any(axis=-1))
    assert n_met > 100


@pytest.mark.parametrize("name", BODIES)
def test_steps_whose_ends_are_in_the_body_are_seen_in_their_own_robot(name):
    rods, oracle = make(name)
    outside = random_stage(oracle, 2e-3, 1, "side").u
    inside = outside.copy()
    node = oracle.star.node(1, N - 1)
    inside[2 * node : 2 * node + 2] = outside[:2] + 1e-3
    through = outside.copy()
    across = turned(outside[-1], np.array([[0.0, -0.025], [0.0, 0.024]]))
    through[2 * node - 2 : 2 * node + 2] = (outside[:2] + across).ravel()
    for end, start, good in ((outside, outside, True), (inside, outside, False), (through, outside, False),
                             (inside, inside, True), (outside, inside, True)):  # fmt: skip
        work = make_work(rods, 1)
        work.q[:], q_0 = unknown_rows(rods, end), unknown_rows(rods, start)
        for rows in (work.q, q_0):
            place_roots.plain(rods, rows)
        stage = Stage(q_0, q_0, Lanes(1.0), Lanes(1.0), False)
        found = plain(without_new_crossings.plain(rods, work, stage, q_0, EVERYONE))
        assert found.all() == good and found.any() == good
