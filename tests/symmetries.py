"""Symmetries of robots as tests want them."""

from seastar_gym.envs.layout import Layout
from seastar_gym.envs.symmetry import Symmetry
from seastar_gym.envs.symmetry.group import n_limbs_of


def symmetry_for(group, mirror=(), mode="limbs", entries=()):
    """Symmetry of a robot with this group and numbers of its limbs, whose tasks show these entries."""
    return Symmetry(group, mirror, Layout(n_limbs_of(group), len(mirror), entries), mode)
