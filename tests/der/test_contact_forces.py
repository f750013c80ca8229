"""Contact between limbs: its forces are the slopes of its energy, cancel, and come from those alone that touch."""

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Scene
from seastar_gym.der.contact.broad_phase import freeze_contact, share_of_edge
from seastar_gym.der.contact.contact import (
    SLOT_ROWS,
    STIFFNESS,
    add_contact,
    add_contact_energy,
    add_gap_gradient,
    contact_force,
    gap,
    members,
    n_listed,
    not_touching,
)
from seastar_gym.der.contact.crossing import edges_cross
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import NO_RODS, NO_WORK, nodes, plain, rows, slope
from touching import touching_limbs

EVERYONE = Mask(np.ones(N_LANES, bool))


def energy(touching, q=None) -> np.ndarray:
    work, own = touching.work, touching.work.q.copy()
    work.q[:] = own if q is None else q
    found = plain(add_contact.plain(touching.rods, work, touching.stage, None, Lanes(0.0)))
    work.q[:] = own
    return found


@pytest.mark.parametrize("ahead", [False, True])
def test_forces_are_the_slopes_of_the_energy(ahead):
    touching = touching_limbs(ahead)
    assert np.all(energy(touching) > 0.0)
    force = touching.work.contact.force.copy()
    q, direction = touching.work.q.copy(), np.random.default_rng(1).standard_normal(force.shape)
    along = slope(lambda s: energy(touching, q + s * direction), 0.0, 1e-7)
    np.testing.assert_allclose(-(force * direction).sum(axis=0), along, rtol=1e-5)


def test_forces_neither_push_nor_turn_the_robot():
    touching = touching_limbs()
    energy(touching)
    force, q = (x.T.reshape(N_LANES, -1, 2) for x in (touching.work.contact.force, touching.work.q))
    size = np.abs(force).max()
    np.testing.assert_allclose(force.sum(axis=1), 0.0, atol=1e-12 * size)
    spin = q[..., 0] * force[..., 1] - q[..., 1] * force[..., 0]
    assert np.all(np.abs(spin.sum(axis=1)) <= 1e-12 * np.abs(spin).sum(axis=1))
    assert np.abs(force[:, 7:]).max() == 0.0  # nodes of the limbs that touch nobody


def listed_stiffness(touching, q) -> np.ndarray:
    """Stiffness of all listed pairs of every node at positions q [N/m], shape (n_nodes, N_LANES)."""
    rods, work = touching.rods, touching.work
    work.q[:] = rows(q)
    freeze_contact.plain(rods, work, touching.stage, rows(q))
    total = np.zeros((rods.n_nodes, N_LANES))
    for slot in range(n_listed.plain(work)):
        total[members.plain(rods, work, slot)[0]] += work.contact.slots[SLOT_ROWS * slot + STIFFNESS]
    return total


@pytest.mark.parametrize("shift", [0.0, 0.04, 0.2, 0.25, 0.5, 0.7, 0.75, 0.97])
def test_a_node_counts_once_wherever_along_a_limb_it_stands(shift):
    """Limb 2 lies beside limb 1, so many edges nearer to the hub; both of its nodes meet edges of limb 1."""
    touching = touching_limbs()
    q = nodes(touching.q_0)[0]
    length = 0.1 / 3.0
    q[1:4] = np.outer([1.0, 2.0, 3.0], [length, 0.0])
    q[4:7] = q[1:4] + [-shift * length, 3e-3]
    found = listed_stiffness(touching, q)
    whole = touching.rods.contact.stiffness
    np.testing.assert_allclose(found[5:7], np.broadcast_to(whole[5:7, None], (2, N_LANES)), rtol=1e-9)


def test_edges_of_a_hinge_share_a_node_and_a_limb_ends_beyond_its_ends():
    rods = touching_limbs().rods

    def share(edge, s):
        return max(0.0, float(plain(share_of_edge.plain(rods, edge, Lanes(s)))))

    for s in np.linspace(-0.5, 0.5, 21):
        assert share(0, 1.0 + s) + share(1, s) == pytest.approx(1.0)
    assert [share(2, 1.0), share(2, 1.125), share(2, 1.25)] == pytest.approx([1.0, 0.5, 0.0])
    assert [share(0, 0.0), share(0, -0.125), share(0, -0.25)] == pytest.approx([1.0, 0.5, 0.0])


def test_a_gap_is_linear_and_its_gradient_what_is_added_to_rows():
    touching = touching_limbs()
    rods, work = touching.rods, touching.work
    direction = np.random.default_rng(2).standard_normal(work.q.shape)
    assert n_listed.plain(work) > 0
    for slot in range(n_listed.plain(work)):
        gradient = np.zeros_like(work.q)
        add_gap_gradient.plain(rods, work, slot, Lanes(1.0), gradient)
        one, two = (plain(gap.plain(rods, work, slot, work.q + share * direction)) for share in (1.0, 2.0))
        start = plain(gap.plain(rods, work, slot, work.q))
        np.testing.assert_allclose(two - start, 2.0 * (one - start), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(one - start, (gradient * direction).sum(axis=0), rtol=1e-9, atol=1e-12)
        i, j, k = members.plain(rods, work, slot)
        assert len({i, j, k}) == 3 and set(np.flatnonzero(gradient.any(axis=1)) // 2) <= {i, j, k}


def test_robots_apart_have_no_forces_whoever_touches_beside_them():
    touching = touching_limbs(apart=2)
    found = energy(touching)
    assert not found[:2].any() and np.all(found[2:] > 0.0)
    assert not touching.work.contact.force[:, :2].any()
    np.testing.assert_array_equal(plain(not_touching.plain(touching.work, EVERYONE)), np.arange(N_LANES) < 2)


def test_where_the_stage_is_asked_and_where_the_state_ends_is_the_same_energy_without_looking_ahead():
    touching = touching_limbs()
    args = touching.rods, touching.work, touching.work.q, Lanes(0.0)
    np.testing.assert_allclose(plain(add_contact_energy.plain(*args)), energy(touching), rtol=1e-9)


def test_edges_cross_where_each_cuts_the_other_and_not_at_their_ends():
    rods = make_rods(Scene(TEN))
    q = np.zeros((46, 2))
    q[1], q[2], q[10] = [0.0, 0.0], [1.0, 0.0], [0.5, 1.0]
    for y, crossing in ((-0.5, True), (0.5, False), (0.0, False)):
        q[11] = [0.5, y]
        found = plain(edges_cross.plain(rods, rows(q), 1, 10))
        assert np.all(found == crossing)


def test_without_contact_nothing_is_added():
    assert add_contact.plain(NO_RODS, NO_WORK, None, None, 3.0) == 3.0
    assert add_contact_energy.plain(NO_RODS, NO_WORK, None, 3.0) == 3.0
    assert plain(contact_force.plain(NO_WORK, 1)) == (0.0, 0.0)
    assert not_touching.plain(NO_WORK, EVERYONE) is EVERYONE
