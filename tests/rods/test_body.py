"""Robots with a body, whose outline limbs may meet: potential, Newton direction and forces are those of a dense oracle;
steps end where Phi is least."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bodied_oracle import Apart, Rigid, Touching
from currents import CURRENTS, velocity
from fuzz.frames import mirrored_body, swapped
from seastar_gym import Attachment, Body, Contact, Numerics, Scene, Seastar, SmaPulse, Water
from seastar_gym.lanes.plain import Lanes
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_limits, make_rods
from seastar_gym.rods.body import begin_body, move_roots, place_roots
from seastar_gym.rods.bundles import Rods, make_work
from seastar_gym.rods.contact.coupled import solve_coupled
from seastar_gym.rods.contact.forces import add_contact, n_listed
from seastar_gym.rods.contact.pairs import freeze_contact, without_new_crossings
from seastar_gym.rods.newton import move_along
from seastar_gym.rods.potential import factorise
from seastar_gym.rods.step import REPORT_ROWS, SCHEMES, Stage, Step, share_of_body, try_step
from seastar_gym.rods.terms.hub import Actuation
from slopes import gradient, hessian, plain, rotated, slope
from stages import EVERYONE, begun_on_body, unknown_rows, unknowns

ANGLE, N_LIMBS = 0.3, 3
UNEVEN = Body(
    outline=((0.03, -0.01), (0.02, 0.02), (-0.02, 0.015), (-0.025, -0.02)), mass=4e-3, centre_of_mass=(4e-3, -3e-3),
    attachments=(Attachment(0.03, -0.01, -0.3), Attachment(-0.02, 0.015, 2.4), Attachment(-0.0205, 0.012, 2.9)),
)  # fmt: skip
DISC = Body(radius=0.02)
BODIES = {"disc": DISC, "polygon": UNEVEN}
TERMS = Water(950.0, 1.3, 0.2, None, 0.8)
SHEAR = Water(950.0, 1.3, 0.2, CURRENTS["shear"], 0.8)
SCENES: dict[str, dict[str, Any]] = {
    "disc in vacuum": {"body": DISC, "fluid": None},
    "disc in water": {"body": DISC},
    "coefficients": {"body": Body(radius=0.02, drag_along=0.5, drag_across=2.0, drag_turning=0.7)},
    "uneven body": {"body": UNEVEN, "fluid": TERMS},
    "uneven body in a current": {"body": UNEVEN, "fluid": SHEAR},
    "damping": {"body": UNEVEN, "relaxation_time": 4e-3},
    "weight": {"body": UNEVEN, "fluid": Water(950.0), "gravity": (1.0, -9.81)},
}
MEETINGS: list[tuple[dict[str, Any], str]] = [
    ({"body": DISC}, "side"),
    ({"body": DISC, "ahead": True}, "corner"),
    ({"body": UNEVEN}, "corner"),
    ({"body": UNEVEN}, "limb"),
    ({"body": UNEVEN, "relaxation_time": 4e-3}, "side"),
    ({"body": UNEVEN, "ahead": True}, "side"),
]
"""Scenes with contact, and what their limbs meet, see `folded`."""
CASES = [
    *(pytest.param(scene, gamma, None, id=f"{name} {gamma}") for name, scene in SCENES.items() for gamma in (1e-2,)),
    pytest.param(SCENES["uneven body"], 1e-3, None, id="uneven body 0.001"),
    *(pytest.param(scene, 2e-3, kind, id=f"contact {k} {kind}") for k, (scene, kind) in enumerate(MEETINGS)),
]


def make(body, fluid=Water(), relaxation_time=None, gravity=None, contact=False, ahead=False):
    """(scene, rods, oracle) of a robot of three limbs around a body; short ones, of four nodes, where they may meet."""
    shape = (N_LIMBS, 4, 0.06) if contact else (N_LIMBS, 3, 0.1)
    robot = Seastar(*shape, body=body, relaxation_time=relaxation_time)
    meeting = Contact(opening_angle=ANGLE) if contact else None
    scene = Scene(robot, fluid, SmaPulse(0.3), contact=meeting, gravity=gravity)
    rods, water = make_rods(scene), fluid or Water(drag_coefficient=0.0)
    star = Apart(
        *shape, fluid_density=water.density, drag_coefficient=water.drag_coefficient,
        tangential_drag_coefficient=water.tangential_drag_coefficient,
        added_mass_coefficient=water.added_mass_coefficient or 0.0, relaxation_time=relaxation_time or 0.0,
        current=None if water.current is None else lambda places: velocity("shear", places),
        gravity=gravity or (0.0, 0.0),
    )  # fmt: skip
    on = rods.body
    P = on.added_mass if on.added_mass is not None else np.zeros(3)
    weight = on.weight if on.weight is not None else np.zeros(4)
    rigid = {
        "star": star, "arms": on.arm.reshape(-1, 2)[:N_LIMBS], "mass": float(rods.inertia.node[0]), "moment": on.moment,
        "directions": np.array([limb.direction for limb in robot.limb_shapes()]), "inertia": float(on.inertia[0]),
        "isotropic": float(rods.drag.node[0]), "strips": on.strips.reshape(-1, 4), "fall": weight[:2],
        "added_mass": np.array([[P[0], P[1]], [P[1], P[2]]]), "weight_moment": weight[2:],
        "weight": 0.0 if gravity is None else float(rods.load[1] / gravity[1]),
    }  # fmt: skip
    if not contact:
        return scene, rods, Rigid(**rigid)
    corners = np.array(body.outline) if body.outline else np.zeros((1, 2))
    limbs = tuple(robot.limbs_that_may_touch())
    met = {"corners": corners, "radius": body.radius, "limbs": limbs, "opening_angle": ANGLE}
    return scene, rods, Touching(**rigid, **met, ahead=ahead)


def random_stage(oracle: Rigid, gamma: float, seed: int, kind: str | None = None) -> SimpleNamespace:
    """Iterate, start, velocity and first guess, each the nodes, flat, and the angle [rad]; rotations of limbs [rad].

    kind: Of the pairs that press each other.
    """
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-9.0, 9.0)
    u = np.append((rotated(folded(oracle, rng, kind), angle) + 0.05 * rng.standard_normal(2)).ravel(), angle)
    assert kind is None or kind in pressed(oracle, u)
    wild = np.append(np.full(len(u) - 1, 0.1), 2.0)
    back, speed = (gamma, 1.0) if kind is None else (1e-5, 0.1)
    return SimpleNamespace(
        u=u, u_hat=u - back * wild * rng.standard_normal(len(u)), v_hat=speed * wild * rng.standard_normal(len(u)),
        first=u + 1e-4 * wild * rng.standard_normal(len(u)), delta_psi=rng.uniform(-0.3, 0.3, N_LIMBS), gamma=gamma,
    )  # fmt: skip


def folded(oracle: Rigid, rng: np.random.Generator, kind: str | None) -> np.ndarray:
    """Nodes of limbs around a body that is not turned, bent and stretched a little.

    Limb 1 meets the outline with a node (kind "side"), or meets a corner, or a disc, with an edge between its nodes
    ("corner"); limbs 2 and 3 meet each other ("limb").
    """
    star, nodes = oracle.star, [np.zeros((1, 2))]
    for limb, (arm, direction) in enumerate(zip(oracle.arms, oracle.directions, strict=True)):
        turns = (0.15 if kind is None else 0.03) * rng.standard_normal((1, star.nodes_per_limb - 1))
        lengths = star.edge_length * (1.0 + (kind is None) * 2e-3 * rng.standard_normal(turns.shape))
        if limb == 0 and kind in ("side", "corner"):
            turns = rng.uniform([-1.4, -1.9, -1.9], [1.4, 1.9, 1.9], (40_000, 3))
        elif limb > 0 and kind == "limb":
            turns[:, 0] += 0.27 if limb == 1 else -0.27
        angles = direction + np.cumsum(turns, axis=1)
        steps = lengths[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        shapes = arm + np.cumsum(steps, axis=1)
        if len(shapes) > 1:
            shapes = shapes[meets(oracle, shapes, arm, kind)]
        nodes.append(shapes[0])
    return np.concatenate(nodes)


def meets(oracle: Touching, shapes: np.ndarray, arm: np.ndarray, kind: str) -> np.ndarray:
    """Mask of limbs, shape (n, nodes_per_limb - 1, 2), outside of the body that meet it by the kind alone."""
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


def pressed(oracle: Touching, u: np.ndarray) -> set[str]:
    """Kinds of the pairs that press each other at u."""
    points, n = oracle.points(u), oracle.star.n_nodes
    pairs = [pair for pair in oracle.pairs(points, points) if pair.depth(points) > 0.0]
    return {"corner" if pair.i >= n else "side" if pair.k >= n else "limb" for pair in pairs}


def phi_of(oracle: Rigid, stage: SimpleNamespace, delta_psi=None):
    """Phi [J] of unknowns in a stage."""
    turns = stage.delta_psi if delta_psi is None else delta_psi
    return lambda u: oracle.phi(u, stage.u_hat, stage.v_hat, stage.gamma, turns, stage.first)


def run(rods, oracle, stage, convex=None):
    """(Phi, decrement, pivot, Newton direction in the unknowns) by the kernels."""
    work, kernel_stage = begun_on_body(rods, oracle.directions, stage, getattr(oracle, "ahead", False))
    phi, decrement, pivot = factorise(rods, work, kernel_stage, convex)
    assert rods.contact is None or n_listed(work) > 0
    decrement = solve_coupled(rods, work, EVERYONE, decrement)
    move_along(rods, work, EVERYONE, None, Lanes(1.0))
    return *(plain(x)[0] for x in (phi, decrement, pivot)), -unknowns(rods, work.step)


@pytest.mark.parametrize("scene, gamma, kind", CASES)
def test_potential_and_newton_direction_are_those_of_the_oracle(scene, gamma, kind):
    """Slopes of the potential by differences; the Hessian of contact is in the coupled step alone."""
    _, rods, oracle = make(**scene, contact=kind is not None)
    stage = random_stage(oracle, gamma, 1, kind)
    step, close = (1e-6, 3e-5) if kind is None else (1e-7, 1e-4)
    phi = phi_of(oracle, stage)
    found, decrement, _, direction = run(rods, oracle, stage)
    assert found == pytest.approx(phi(stage.u), rel=1e-9)
    slopes, size = gradient(phi, stage.u, step), np.abs(direction).max()
    along = slope(lambda share: gradient(phi, stage.u + share * direction / size, 10 * step), 0.0, 10 * step)
    np.testing.assert_allclose(size * along, slopes, rtol=0.0, atol=close * np.abs(slopes).max())
    assert decrement == pytest.approx(slopes @ direction, rel=close)


@pytest.mark.parametrize("seed", range(3))
def test_a_regularised_matrix_is_positive_definite_however_limbs_press(seed):
    """With limbs pushed into a disc, the curvature of their roots' circles is negative."""
    _, rods, oracle = make(Body(radius=0.05), None)
    stage = random_stage(oracle, 1.0, seed)
    stage.u[2:-1] *= 0.7  # compressed by a third
    assert not run(rods, oracle, stage)[2] > 0.0
    _, decrement, pivot, _ = run(rods, oracle, stage, EVERYONE)
    assert pivot > 0.0 and decrement > 0.0


def stepped(scene: Scene, rods: Rods, start: SimpleNamespace, h: float) -> np.ndarray:
    """Unknowns after a step of the scene's scheme, by the kernels."""
    tableau, limits = SCHEMES[scene.numerics.scheme], make_limits(scene)
    q, v, still = unknown_rows(rods, start.u), unknown_rows(rods, start.v_hat), np.zeros((N_LIMBS, N_LANES))
    move_roots(rods, q, v)
    memory = np.zeros((share_of_body(rods, tableau, tableau.n_stages), N_LANES))
    step = Step(Lanes(0.0), Lanes(1.0), Lanes(h), Lanes(60.0), ~EVERYONE)
    args = rods, make_work(rods, tableau.n_stages), tableau, Actuation(still, still), q, v, memory, step
    accepted = try_step(*args, EVERYONE, limits, np.zeros((len(REPORT_ROWS), N_LANES)))
    assert plain(accepted).all()
    return unknowns(rods, q)


@pytest.mark.parametrize("scheme, share", [("implicit-euler", 1.0), ("implicit-midpoint", 0.5)])
@pytest.mark.parametrize("name", ["disc in water", "uneven body in a current", "weight"])
def test_a_step_ends_where_the_oracle_has_its_minimum(name, scheme, share):
    scene, rods, oracle = make(**SCENES[name])
    numerics, h = Numerics(scheme, 0.01, newton_tolerance=1e-12), 0.01
    start = random_stage(oracle, share * h, seed=1)
    start.v_hat *= 0.1
    end = stepped(Scene(scene.robot, scene.fluid, numerics=numerics, gravity=scene.gravity), rods, start, h)
    start.u_hat, start.first, u = start.u, start.u + share * h * start.v_hat, start.u + share * (end - start.u)
    phi = phi_of(oracle, start, np.zeros(N_LIMBS))
    off = np.linalg.solve(hessian(lambda many: [phi(x) for x in many], u, 1e-5), gradient(phi, u, 1e-6))
    assert np.abs(off).max() < 1e-6 * np.abs(end - start.u).max()


# Contact


def forces(body: Body, began: np.ndarray, guessed: np.ndarray, angle: float = 0.0) -> np.ndarray:
    """Forces of contact [N] where nodes are nearer to the hub than in the first guess of a step that began at others.

    Nodes and forces have the shape (N_LANES, n_nodes, 2). The hub is at the origin, the body turned by an angle.
    """
    _, rods, _ = make(body, contact=True)
    work, n = make_work(rods, 1), 2 * began.shape[1]
    q_0, still = np.zeros_like(work.q), np.zeros_like(work.q)
    for rows, nodes in ((q_0, began), (work.q, guessed)):
        rows[:n], rows[n] = nodes.reshape(N_LANES, n).T, angle * rods.body.scale[0]
        place_roots(rods, rows)
    stage = Stage(q_0, still, Lanes(1.0), Lanes(1.0), False)
    freeze_contact(rods, work, stage, q_0)
    work.q[:n] *= 0.8
    begin_body(rods, work)
    add_contact(rods, work, stage, None, Lanes(0.0))
    return work.contact.force[:n].T.reshape(began.shape)


def directions(forces: np.ndarray) -> np.ndarray:
    return forces / np.linalg.norm(forces, axis=-1, keepdims=True)


FAR = np.array([[0.5, 0.5], [0.5, 0.6], [0.5, 0.7]])
LINE = np.array([[-0.05, 0.0], [-0.07, 0.0], [-0.09, 0.0]])
"""Nodes of a limb [m]. `MEETING` has those of another whose tip meets it, and where to that is pushed."""
MEETING = {
    "tip": ([[-0.17, 0.0005], [-0.13, 0.0005], [-0.092, 0.0005]], (-0.002, 0.0005)),
    "left": ([[-0.08, -0.05], [-0.08, -0.03], [-0.08, -0.001]], (0.0, -1.0)),
    "right": ([[-0.08, 0.05], [-0.08, 0.03], [-0.08, 0.001]], (0.0, 1.0)),
}


def on_hub(*limbs: Any) -> np.ndarray:
    """Nodes of all lanes, of three limbs around a hub at the origin."""
    return np.tile(np.concatenate([np.zeros((1, 2)), *limbs]), (N_LANES, 1, 1))


def test_nodes_that_entered_a_body_belong_to_the_side_that_they_came_from():
    """However deep the first guess has carried them."""
    side, out = 0.5 * np.sum(UNEVEN.outline[1:3], axis=0), np.array([-0.005, 0.04]) / np.hypot(0.005, 0.04)
    other = FAR - [0.2, 0.0]
    began, guessed = (on_hub([*FAR[:2], side + depth * out], other, -other) for depth in (1e-3, -0.012))
    pushed = forces(UNEVEN, began, guessed)[0, 3]
    np.testing.assert_allclose(directions(pushed), out, atol=1e-9)


@pytest.mark.parametrize("side", MEETING)
@pytest.mark.parametrize("limb", [1, 2])
def test_limbs_on_a_body_meet_where_they_are(side, limb):
    """On either side and in front of a tip, however they are numbered, since they may go round each other's tips."""
    nodes, away = MEETING[side]
    places = on_hub(FAR, LINE, nodes) if limb == 2 else on_hub(FAR, nodes, LINE)
    found = forces(UNEVEN, places, places)[0, 3 * (limb + 1)]
    np.testing.assert_allclose(directions(found), directions(np.array(away)), atol=1e-9)


@pytest.mark.parametrize("name", BODIES)
def test_who_meets_a_body_is_alike_in_a_mirror_however_far_a_step_goes(name):
    """A corner that a node comes to from beside one side of an outline or the other is met from both."""
    body, rng = BODIES[name], np.random.default_rng(0)
    order = [0] + [1 + 3 * limb + place for limb in swapped(N_LIMBS) for place in range(3)]
    n_met = 0
    for _ in range(20):
        began, guessed = rng.uniform(-0.06, 0.06, (2, N_LANES, 1 + 3 * N_LIMBS, 2))
        began[:, 0] = guessed[:, 0] = 0.0
        own = forces(body, began, guessed)
        other = forces(mirrored_body(body), *(nodes[:, order] * [1.0, -1.0] for nodes in (began, guessed)))
        np.testing.assert_allclose(other[:, order] * [1.0, -1.0], own, atol=1e-9 * np.abs(own).max())
        n_met += np.count_nonzero(own[:, 1:].any(axis=-1))
    assert n_met > 100


@pytest.mark.parametrize("name", BODIES)
def test_steps_whose_ends_are_in_the_body_are_seen_in_their_own_robot(name):
    _, rods, oracle = make(BODIES[name], contact=True)
    outside = random_stage(oracle, 2e-3, 1, "side").u
    node, inside, through = oracle.star.node(1, 3), outside.copy(), outside.copy()
    inside[2 * node : 2 * node + 2] = outside[:2] + 1e-3
    across = rotated(np.array([[0.0, -0.025], [0.0, 0.024]]), outside[-1])
    through[2 * node - 2 : 2 * node + 2] = (outside[:2] + across).ravel()
    for end, start, good in ((outside, outside, True), (inside, outside, False), (through, outside, False),
                             (inside, inside, True), (outside, inside, True)):  # fmt: skip
        work = make_work(rods, 1)
        work.q[:], q_0 = unknown_rows(rods, end), unknown_rows(rods, start)
        for rows in (work.q, q_0):
            place_roots(rods, rows)
        stage = Stage(q_0, q_0, Lanes(1.0), Lanes(1.0), False)
        found = plain(without_new_crossings(rods, work, stage, q_0, EVERYONE))
        assert found.all() == good and found.any() == good
