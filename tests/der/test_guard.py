"""The guard's parts: energies and work are the oracle's, seen from any frame; cuts keep the momenta; hinges that go
through their poles are seen."""

from types import SimpleNamespace

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from hubs import HUBS, TEN
from momenta import momenta
from oracle import Star
from seastar_gym import Scene, SmaPulse, Vortex, Water
from seastar_gym.der.rods import Rods, make_work
from seastar_gym.der.stepping.guard import (
    LARGEST_CUT,
    add_work_of_loads,
    allowed_energy,
    hold_to_energy,
    restore,
    rigid_motion,
    save,
    through_poles,
)
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.terms.fluid import add_work_of_current, freeze_fluid
from seastar_gym.der.terms.hub import Actuation
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, borrow, load, select, splat, store
from seastar_gym.simd.rows import aligned_rows
from stages import robot_and_star, turn_limbs

STAR = Continuum()
RODS = make_rods(Scene(TEN, actuator=SmaPulse(0.5)))


def circling(places: np.ndarray) -> np.ndarray:
    """A vortex of 0.4 m^2/s about (0.1, 0.2) m with a core of 60 mm, from its definition."""
    x, y = (places - [0.1, 0.2]).T
    return 0.4 / (2.0 * np.pi) * np.stack([-y, x], axis=1) / (x**2 + y**2 + 0.06**2)[:, None]


STREAM = Continuum(tangential_drag_coefficient=0.2, added_mass_coefficient=0.7, current=circling)
PULL = np.random.default_rng(5).standard_normal((STAR.n_nodes, 2))
STREAM_RODS = make_rods(Scene(
    TEN, fluid=Water(tangential_drag_coefficient=0.2, added_mass_coefficient=0.7, current=Vortex(0.4, 0.1, 0.2, 0.06)),
    actuator=SmaPulse(0.5),
    loads=tuple((node, *force) for node, force in enumerate(PULL.tolist())),
))
FRAME = np.random.default_rng(6).uniform(-1.0, 1.0, (2, N_LANES))
"""Velocity that every lane is seen from [m/s]."""


@entry_point
def allowed(rods, work, scheme, actuation, q, v, frame, result):
    rows, memory, tableau, rotation = borrow(rods), borrow(work), borrow(scheme), borrow(actuation)
    start, end = splat(0.25), splat(0.75)
    seen_from = (load(borrow(frame), 0), load(borrow(frame), 1))
    q_rows, v_rows = borrow(q), borrow(v)
    store(borrow(result), 0, allowed_energy(rows, memory, tableau, rotation, start, end, q_rows, v_rows, seen_from))


@entry_point
def hold(rods, work, scheme, q, v, frame, robots, limit, largest_cut, result):
    rows, memory, tableau = borrow(rods), borrow(work), borrow(scheme)
    out, one = borrow(result), splat(1.0)
    mask = load(borrow(robots), 0) > 0.0
    q_rows, v_rows = borrow(q), borrow(v)
    seen_from, h = (load(borrow(frame), 0), load(borrow(frame), 1)), splat(0.01)
    store(out, 0, rigid_motion(rows, memory, q_rows, v_rows, seen_from)[5])
    refused, cut = hold_to_energy(
        rows, memory, tableau, q_rows, v_rows, h, seen_from, mask, load(borrow(limit), 0), splat(largest_cut)
    )
    store(out, 1, select(refused, one, 0.0))
    store(out, 2, select(cut, one, 0.0))


@entry_point
def worked(rods, work, q, v, frame, result):
    """Work of the current, then of loads, in a step of 10 ms to (q, v); the fluid is frozen at work.q."""
    rows, memory, out, h = borrow(rods), borrow(work), borrow(result), splat(0.01)
    seen_from = (load(borrow(frame), 0), load(borrow(frame), 1))
    freeze_fluid(rows, memory)
    store(out, 0, add_work_of_current(rows, memory, borrow(v), h, seen_from, splat(0.0)))
    store(out, 1, add_work_of_loads(rows, memory, borrow(q), h, seen_from, splat(0.0)))


@entry_point
def jump(rods, work, scheme, q, v, q_1, robots, result):
    """Put (q, v) aside, move to q_1, look for poles, and put the robots back that came through one."""
    rows, memory, tableau, q_rows, v_rows = borrow(rods), borrow(work), borrow(scheme), borrow(q), borrow(v)
    save(rows, memory, tableau, q_rows, v_rows)
    for row in range(q.shape[0]):
        store(q_rows, row, load(borrow(q_1), row))
        store(v_rows, row, splat(0.0))
    through = through_poles(rows, memory, q_rows, load(borrow(robots), 0) > 0.0)
    restore(rows, memory, tableau, q_rows, v_rows, through)
    store(borrow(result), 0, select(through, splat(1.0), 0.0))


def rows_of(nodes: np.ndarray) -> np.ndarray:
    """Nodes of N_LANES robots as rows of lanes."""
    rows = aligned_rows(2 * STAR.n_nodes, N_LANES)
    rows[:] = nodes.reshape(N_LANES, -1).T
    return rows


def nodes_of(rows: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(rows.T).reshape(N_LANES, -1, 2)


def moving_robots(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Bent robots away from the origin that fly, spin and ring: (q, v), shape (N_LANES, n_nodes, 2)."""
    rng = np.random.default_rng(seed)
    shape = (N_LANES, STAR.n_nodes, 2)
    q = STAR.rest + 1e-3 * rng.standard_normal(shape) + 0.3
    return q, 0.2 * rng.standard_normal(shape) + [0.5, -0.2] + 2.0 * (q - 0.3) @ [[0.0, 1.0], [-1.0, 0.0]]


def work_at(delta_psi: np.ndarray, scheme: str = "implicit-euler", rods: Rods = RODS):
    """Memory with what is natural at the hub at these rotations [rad], shape (N_LANES, 5)."""
    work = make_work(rods, SCHEMES[scheme].n_stages)
    turn_limbs(work, STAR, delta_psi)
    return work


# Energies


def stored_by_moving(star: Star, first: np.ndarray, last: np.ndarray) -> float:
    """Energy at the hub of a robot natural at the rotations `first` [rad], at those of `last` [J]."""
    if star.clamps:
        return oracle.clamp_slopes(star, star.rest, first - last)[0]
    kappa = [2.0 * np.tan(oracle.natural_angles(star, one)[-5:] / 2.0) / star.edge_length for one in (first, last)]
    return 0.5 * star.EI * star.edge_length * np.sum((kappa[1] - kappa[0]) ** 2)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("hub", HUBS)
def test_allowed_energy_is_that_of_the_robot_standing_still_while_its_actuators_move(hub, scheme):
    """At a step from a quarter to three quarters of an interval; from the larger end and with what moving stores."""
    robot, star = robot_and_star(hub=hub)
    rods, (q, v) = make_rods(Scene(robot, actuator=SmaPulse(0.5))), moving_robots()
    begin, end = np.random.default_rng(1).uniform(-0.4, 0.4, (2, N_LANES, 5))
    result = np.zeros((1, N_LANES))
    tableau, actuation = SCHEMES[scheme], Actuation(begin.T.copy(), end.T.copy())
    allowed(rods, make_work(rods, tableau.n_stages), tableau, actuation, rows_of(q), rows_of(v), FRAME, result)
    for lane in range(N_LANES):
        first, last = (begin[lane] + share * (end[lane] - begin[lane]) for share in (0.25, 0.75))
        at_start, at_end = (oracle.elastic_energy(star, q[lane], one) for one in (first, last))
        moved = stored_by_moving(star, first, last)
        expected = at_end if tableau.dissipative else max(at_start, at_end) + moved
        seen = v[lane] - FRAME[:, lane]
        assert result[0, lane] == pytest.approx(expected + oracle.kinetic_energy(star, seen), rel=1e-12)


def test_work_of_currents_and_loads_is_force_times_way_as_the_frame_sees_it():
    """Drag and the current are those where the stage began; the load's way is that of its node."""
    h, (q, v), (begin, _) = 0.01, moving_robots(), moving_robots(seed=2)
    work, result = make_work(STREAM_RODS, 1), np.zeros((2, N_LANES))
    work.q[:], work.step[:] = rows_of(begin), rows_of(begin)
    worked(STREAM_RODS, work, rows_of(q), rows_of(v), FRAME, result)
    for lane in range(N_LANES):
        drag, fluid = oracle.drag_force(STREAM, v[lane], begin[lane]), circling(begin[lane]) - FRAME[:, lane]
        assert result[0, lane] == pytest.approx(h * np.sum(drag * fluid), rel=1e-12)
        way = q[lane] - begin[lane] - h * FRAME[:, lane]
        assert result[1, lane] == pytest.approx(np.sum(PULL * way), rel=1e-12)


def inertia(star: Star, lane_q: np.ndarray) -> np.ndarray:
    """Mass matrix of robot and fluid carried along, shape (n_nodes, 2, n_nodes, 2)."""
    return oracle.mass_matrix(star, lane_q).reshape(star.n_nodes, 2, star.n_nodes, 2)


def held(
    share: float, largest_cut: float = LARGEST_CUT, robots: np.ndarray | None = None, star: Star = STAR
) -> SimpleNamespace:
    """Robots held to their potential energy, that of their rigid motion, and `share` of the rest, seen from FRAME."""
    q, v = moving_robots()
    rods = RODS if star is STAR else STREAM_RODS
    rows, work, result = (rows_of(q), rows_of(v)), work_at(np.zeros((N_LANES, 5)), rods=rods), np.zeros((3, N_LANES))
    work.q[:] = rows[0]
    if star is not STAR:
        worked(rods, work, *rows, FRAME, np.zeros((2, N_LANES)))
    chosen, limit = np.ones((1, N_LANES)) if robots is None else robots[None], np.full((1, N_LANES), 1e9)
    hold(
        rods, work, SCHEMES["implicit-midpoint"], *rows, FRAME, chosen, limit, largest_cut, result
    )  # high above: says the rigid energy, changes nothing
    assert not result[1:].any()
    np.testing.assert_array_equal(nodes_of(rows[1]), v)

    def kinetic_energies(velocities: np.ndarray) -> np.ndarray:
        seen = velocities - FRAME.T[:, None]
        return np.array(
            [0.5 * np.einsum("nd,ndme,me", one, inertia(star, at), one) for at, one in zip(q, seen, strict=True)]
        )

    rigid, kinetic = result[0].copy(), kinetic_energies(v)
    potential = np.array([oracle.elastic_energy(STAR, one, np.zeros(5)) for one in q])
    limit[0] = potential + rigid + share * (kinetic - rigid)
    hold(rods, work, SCHEMES["implicit-midpoint"], *rows, FRAME, chosen, limit, largest_cut, result)
    np.testing.assert_array_equal(nodes_of(rows[0]), q)
    after = nodes_of(rows[1])
    return SimpleNamespace(
        q=q, v=v, after=after, rigid=rigid, refused=result[1] > 0.0, cut=result[2] > 0.0,
        allowed=limit[0] - potential, kinetic=kinetic_energies(after),
    )  # fmt: skip


def rigid_motions(q: np.ndarray) -> np.ndarray:
    """Along x, along y, and about the centre of mass, shape (3, n_nodes, 2)."""
    r = q - STAR.masses @ q / STAR.masses.sum()
    motions = np.zeros((3, *q.shape))
    motions[0, :, 0], motions[1, :, 1], motions[2] = 1.0, 1.0, np.stack([-r[:, 1], r[:, 0]], axis=1)
    return motions


STARS = pytest.mark.parametrize("star", [STAR, STREAM], ids=["alone", "with added mass"])


@STARS
def test_rigid_motion_has_the_least_energy_with_the_same_momenta(star):
    found = held(0.995, star=star)
    for lane in range(N_LANES):
        q, v = found.q[lane], found.v[lane] - FRAME[:, lane]
        motions, masses = rigid_motions(q), inertia(star, q)
        inner = np.einsum("and,ndme,bme->ab", motions, masses, motions)
        projected = np.linalg.solve(inner, np.einsum("and,ndme,me->a", motions, masses, v))
        assert found.rigid[lane] == pytest.approx(0.5 * projected @ inner @ projected, rel=1e-12)


# Cuts and refusals


@STARS
def test_a_small_excess_of_energy_is_cut_and_the_momenta_stay(star):
    """Those of the robot and of fluid that moves along."""
    found = held(0.995, star=star)
    assert found.cut.all() and not found.refused.any()
    np.testing.assert_allclose(found.kinetic, found.allowed, rtol=1e-9)
    for q, v, cut in zip(found.q, found.v, found.after, strict=True):
        carried = np.einsum("and,ndme->ame", rigid_motions(q), inertia(star, q)).reshape(3, -1)
        np.testing.assert_allclose(carried @ cut.ravel(), carried @ v.ravel(), rtol=1e-12)
    assert np.abs(found.after - found.v).max() > 1e-4


@pytest.mark.parametrize("share, refused", [(0.98, True), (-0.01, True), (1.0 + 1e-9, False)])
def test_more_than_the_largest_cut_is_refused_and_what_is_allowed_left_alone(share, refused):
    found = held(share)
    assert not found.cut.any() and np.all(found.refused == refused)
    np.testing.assert_array_equal(found.after, found.v)


def test_at_the_last_halving_any_share_may_be_cut():
    found = held(0.2, largest_cut=1.0)
    assert found.cut.all()
    np.testing.assert_allclose(found.kinetic, found.allowed, rtol=1e-9)
    for before, after in zip(momenta(RODS, found.q, found.v), momenta(RODS, found.q, found.after), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-13)


def test_robots_that_are_not_held_keep_their_bits():
    chosen = np.arange(N_LANES) % 2.0
    found = held(0.995, robots=chosen)
    np.testing.assert_array_equal(found.cut, chosen > 0.0)
    np.testing.assert_array_equal(found.after[chosen == 0.0], found.v[chosen == 0.0])


# Poles


def turned_about(q: np.ndarray, node: int, nodes: slice, angle: float) -> np.ndarray:
    """The robot with some nodes turned about another one by an angle [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    result = np.array(q)
    result[nodes] = q[node] + (q[nodes] - q[node]) @ [[c, s], [-s, c]]
    return result


TIP, LIMB = (3, slice(4, 10)), (0, slice(1, 10))
"""What turns about which node: the end of limb 1 about a hinge within it, and limb 1 about the hub."""
TURNS = [
    ("rigid", TIP, 0, 170, False),
    ("rigid", TIP, 160, 200, True),
    ("rigid", TIP, -160, -200, True),
    ("rigid", LIMB, 60, 200, False),  # a clamp has no pole
    ("opening", TIP, 0, 170, False),
    ("opening", TIP, 160, 170, False),
    ("opening", TIP, 160, 200, True),
    ("opening", TIP, -160, -200, True),
    ("opening", LIMB, 0, 100, False),  # from 72 degrees, on either side of limb 1
    ("opening", LIMB, 60, 80, False),
    ("opening", LIMB, 100, 120, True),
    ("turning", LIMB, 50, 70, False),
    ("turning", LIMB, 50, 80, True),
    ("turning", LIMB, -60, -90, True),
]


@pytest.mark.parametrize("scheme", ["implicit-euler", "sdirk3"])
@pytest.mark.parametrize("hub, part, before, after, through", TURNS)
def test_a_hinge_that_turned_through_its_pole_is_seen_and_the_robot_put_back(
    hub, part, before, after, through, scheme
):
    """The last lane holds a robot that nobody asks about."""
    rods, tableau = make_rods(Scene(robot_and_star(hub=hub)[0], actuator=SmaPulse(0.5))), SCHEMES[scheme]
    q, q_1 = (turned_about(STAR.rest, *part, np.radians(angle)) for angle in (before, after))
    everywhere, v = np.ones((N_LANES, STAR.n_nodes, 2)), np.ones((N_LANES, STAR.n_nodes, 2))
    rows, v_rows, result = rows_of(q * everywhere), rows_of(v), np.zeros((1, N_LANES))
    asked = np.arange(N_LANES) < N_LANES - 1
    work = make_work(rods, tableau.n_stages)
    jump(rods, work, tableau, rows, v_rows, rows_of(q_1 * everywhere), 1.0 * asked[None], result)
    np.testing.assert_array_equal(result[0] > 0.0, asked & through)
    back = (asked & through)[:, None, None]
    np.testing.assert_array_equal(nodes_of(rows), np.where(back, q, q_1))
    np.testing.assert_array_equal(nodes_of(v_rows), np.where(back, v, 0.0))
