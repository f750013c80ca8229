"""The guard in plain Python: the frame that a step is judged in, rigid motions, cuts, hinges beyond their poles."""

import numpy as np
import pytest

import oracle
from continuum_oracle import Continuum
from seastar_gym import Scene, Seastar, UniformCurrent, Water
from seastar_gym.der.contact.contact import add_contact_energy
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.guard import (
    add_held_energy,
    energy_noise,
    frame_velocity,
    hold_to_energy,
    may_gain,
    through_poles,
)
from seastar_gym.der.stepping.rigid_motion import cut_velocities, rigid_motion
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import NO_RODS, nodes, plain, rotated, rows
from stages import turn_limbs
from touching import touching_limbs

ROBOT = Seastar(5, 4)
RODS, STAR = make_rods(Scene(ROBOT, None)), Continuum(5, 4, drag_coefficient=0.0)
STILL, EVERYONE = (Lanes(0.0), Lanes(0.0)), Mask(np.ones(N_LANES, bool))
RNG = np.random.default_rng(0)
Q, V = ROBOT.nodes() + 1e-3 * RNG.standard_normal((ROBOT.n_nodes, 2)), RNG.standard_normal((ROBOT.n_nodes, 2))


def motion_of(v: np.ndarray):
    return rigid_motion.plain(RODS, make_work(RODS, 1), rows(Q), rows(v), STILL)


def test_a_robot_is_judged_as_its_water_sees_it_and_in_vacuum_as_its_own_centre_of_mass_does():
    stream = make_rods(Scene(ROBOT, Water(current=UniformCurrent(0.3, -0.2))))
    found = plain(frame_velocity.plain(stream, rows(Q), rows(V)))
    np.testing.assert_allclose([found[0][0], found[1][0]], [0.3, -0.2])
    alone = plain(frame_velocity.plain(RODS, rows(Q), rows(V)))
    np.testing.assert_allclose([alone[0][0], alone[1][0]], RODS.mass @ V / RODS.mass.sum(), rtol=1e-12)


def test_a_rigid_motion_is_found_again_with_its_energy():
    c = RODS.mass @ Q / RODS.mass.sum()
    rigid = np.array([0.2, -0.1]) + 1.5 * (Q - c) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    x, y, v_x, v_y, omega, energy = (float(np.ravel(part)[0]) for part in plain(motion_of(rigid)))
    np.testing.assert_allclose([x, y, v_x, v_y, omega], [*c, 0.2, -0.1, 1.5], rtol=1e-12)
    assert energy == pytest.approx(oracle.kinetic_energy(STAR, rigid), rel=1e-12)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
def test_a_cut_keeps_that_share_of_what_is_not_rigid_and_all_that_is(share):
    v, motion = rows(V), motion_of(V)
    cut_velocities.plain(RODS, rows(Q), v, STILL, motion, Lanes(share), EVERYONE)
    after = plain(motion_of(nodes(v)[0]))
    np.testing.assert_allclose([part[0] for part in after[2:]], [part[0] for part in plain(motion)[2:]], rtol=1e-11)
    kinetic, before = (oracle.kinetic_energy(STAR, each) for each in (nodes(v)[0], V))
    rigid = float(after[-1][0])
    assert kinetic - rigid == pytest.approx(share**2 * (before - rigid), rel=1e-9, abs=1e-15)


def test_held_nodes_make_no_noise_in_a_robots_energy():
    """Their mass is huge: with it, what a robot may have would depend on where it is."""
    held = make_rods(Scene(ROBOT, None, held_nodes=(0, 3)))
    energy, h = Lanes(1e-5), Lanes(1e-3)
    noise, of_held = (energy_noise.plain(rods, None, rows(Q), h, energy, energy).numbers for rods in (RODS, held))
    assert np.all((of_held > 0.5 * noise) & (of_held < noise))


@pytest.mark.parametrize("degrees, through", [(100.0, False), (-170.0, False), (190.0, True), (-200.0, True)])
def test_a_limb_that_is_folded_over_its_hinge_has_gone_through_its_pole(degrees, through):
    """From 60 degrees towards where it goes, the end of limb 1 beyond its node 2."""
    work, folded = make_work(RODS, 1), []
    for angle in (np.copysign(60.0, degrees), degrees):
        q = ROBOT.nodes()
        q[3] = q[2] + rotated(q[3] - q[2], np.radians(angle))
        folded.append(rows(q))
    work.step[:] = folded[0]
    assert np.all(plain(through_poles.plain(RODS, work, folded[1], EVERYONE)) == through)


def test_growth_is_seen_from_the_share_on_that_is_rounding():
    """That of the kinetic energy, of robots at rest in shape that move at 1 m/s: half of it is not, five times is."""
    work, q, v = make_work(RODS, 1), rows(ROBOT.nodes()), rows(V)
    turn_limbs(work, STAR, np.zeros((N_LANES, 5)))
    kinetic = oracle.kinetic_energy(STAR, V)
    for growth, seen in ((0.5, False), (5.0, True)):
        allowed = Lanes(kinetic * (1.0 - growth * 1e-12))
        args = RODS, work, SCHEMES["implicit-euler"], q, v.copy(), Lanes(10.0), STILL, EVERYONE, allowed, Lanes(1.0)
        _, cut = plain(hold_to_energy.plain(*args))
        assert np.all(cut == seen)


def test_noise_is_that_of_positions_that_are_all_rounded_the_same_way():
    """By one unit in the last place, in their difference over a step, a kilometre away; several units are allowed."""
    h, far, v = 1e-3, ROBOT.nodes() + 1e3, np.ones((ROBOT.n_nodes, 2))
    before, after = (oracle.kinetic_energy(STAR, each) for each in (v, v + np.spacing(far) / h))
    noise = plain(energy_noise.plain(RODS, None, rows(far), Lanes(h), Lanes(0.0), Lanes(before)))
    assert np.all((0.05 * noise < after - before) & (after - before < 0.5 * noise))


LOADS = tuple((node, *force) for node, force in enumerate(RNG.standard_normal((ROBOT.n_nodes, 2)).tolist()))


@pytest.mark.parametrize("loads", [(), LOADS], ids=["free", "with loads"])
def test_a_step_may_gain_energy_where_what_newton_knows_does_not_rule_it_out(loads):
    """Phi + v_0 M (v_1 - v_0) - h F v_0 - U(q_0), from the oracle, just above zero or just below."""
    rods, h = make_rods(Scene(ROBOT, None, loads=loads)), 0.01
    q_1, v_0 = Q + 1e-3 * RNG.standard_normal(Q.shape), V
    force = np.array([force for _, *force in loads]) if loads else np.zeros_like(V)
    change = (q_1 - Q) / h - v_0
    gained = v_0.ravel() @ oracle.mass_matrix(STAR, Q) @ change.ravel()
    least = oracle.elastic_energy(STAR, Q, np.zeros(5)) - gained
    least += h * np.sum(force * v_0)
    work = make_work(rods, 1)
    turn_limbs(work, STAR, np.zeros((N_LANES, 5)))
    work.q[:] = rows(q_1)
    stage = Stage(rows(Q), rows(v_0), Lanes(h), Lanes(1.0 / h), False)
    above = np.arange(N_LANES) % 2 == 0
    phi = Lanes(least + np.where(above, 1e-9, -1e-9) * abs(least))
    found = plain(may_gain.plain(rods, work, stage, phi, EVERYONE))
    np.testing.assert_array_equal(found, above)
    assert not plain(may_gain.plain(rods, work, stage, phi, ~EVERYONE)).any()


def test_with_a_body_or_in_fluid_that_moves_or_moves_along_any_step_may_gain():
    for named in ("current", "added_mass", "body"):
        rods = NO_RODS._replace(**{named: object()})
        assert may_gain.plain(rods, None, None, None, EVERYONE) is EVERYONE


def test_what_limbs_that_press_each_other_store_counts_where_the_scheme_gives_it_back():
    touching = touching_limbs()
    args = touching.rods, touching.work
    stored = plain(add_contact_energy.plain(*args, touching.work.q, Lanes(2.0)))
    assert np.all(stored > 2.0)
    for name, scheme in SCHEMES.items():
        found = plain(add_held_energy.plain(*args, scheme, touching.work.q, Lanes(2.0)))
        np.testing.assert_array_equal(found, stored if name == "implicit-euler" else 2.0)
    assert add_held_energy.plain(NO_RODS, None, SCHEMES["sdirk2"], None, 2.0) == 2.0
