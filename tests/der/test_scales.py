"""Scales of a robot and sizes of its memory: which steps are looked at, and how many pairs of nodes may be near."""

import numpy as np
import pytest

from seastar_gym import Contact, Scene, Seastar, SmaPulse, Water
from seastar_gym.der.contact.contact import SLOT_ROWS
from seastar_gym.der.rods import make_work
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.lanes import N_LANES

THICK = Seastar(4, 5, limb_length=0.08, rod_radius=2e-3, density=1200.0, youngs_modulus=5e5)
EDGE, AREA = 0.02, np.pi * 2e-3**2
RODS = make_rods(Scene(THICK, Water(900.0, 1.5)))


def test_drag_takes_more_than_a_step_creates_up_to_a_share_of_the_predictable_energy():
    """Drag of a limb that moves by its length over its inertia: 1/2 rho_f C_d 2 r l/(rho A)."""
    share = 0.5 * 900.0 * 1.5 * 2.0 * 2e-3 * 0.08 / (1200.0 * AREA)
    assert share > 1.0 and RODS.scales.damped == pytest.approx(RODS.scales.predictable)
    thin_water = make_rods(Scene(THICK, Water(9.0, 1.5))).scales
    assert thin_water.damped == pytest.approx(float(RODS.scales.predictable[0]) * 0.01 * share)


def test_edges_are_stiffer_than_inertia_by_the_square_of_their_number_and_of_the_speed_of_sound_over_their_length():
    """Most at the tips, which have half an edge; in vacuum every step is looked at."""
    rate = 5e5 / (1200.0 * EDGE**2) * 2.0 * 4**2
    assert RODS.scales.stiffness_ratio == pytest.approx(rate)
    vacuum = make_rods(Scene(THICK, None)).scales
    assert vacuum.stiffness_ratio == np.inf and vacuum.damped == 0.0
    assert not vacuum.held and make_rods(Scene(THICK, held_nodes=(0,))).scales.held


@pytest.mark.parametrize("edges, near", [(23, 23), (24, 24), (25, 3)])
def test_every_node_has_room_for_all_edges_of_another_limb_or_for_three_where_they_are_many(edges, near):
    rods = make_rods(Scene(Seastar(5, edges + 1), actuator=SmaPulse(0.1), contact=Contact()))
    work, nodes = make_work(rods, 1).contact, 2 * rods.contact.n_pairs * edges
    assert work.share == nodes * near
    assert len(work.slots) == SLOT_ROWS * nodes * min(edges, near * N_LANES)
