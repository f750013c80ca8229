"""Derivatives of swims.

    from seastar_gym.gradients import differentiate

    found = differentiate(Scene(), commands, by=["fluid.drag_coefficient", "commands"])
    found.swim.hub, found.by["commands"].hub

Forward differentiation, exact to rounding: the kernels are compiled on lanes that carry slopes (simd/dual_lanes.py).
docs/gradients.md says how far derivatives of swims can be trusted.
"""

from seastar_gym.gradients.swim import Derivatives as Derivatives
from seastar_gym.gradients.swim import Motion as Motion
from seastar_gym.gradients.swim import differentiate as differentiate
