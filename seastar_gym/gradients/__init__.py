"""Derivatives of swims.

In come a scene of one robot, commands and names of unknowns; out go the swim, to the bits of `Simulator`, and its
derivatives or a gradient. `swim.py` and `adjoint.py` have the two ways, the other files what they do with kernels.

    from seastar_gym.gradients import differentiate, gradient

    found = differentiate(Scene(), commands, by=["fluid.drag_coefficient", "commands"])
    found.swim.hub, found.by["commands"].hub

Forward differentiation, exact to rounding: the kernels are compiled on lanes that carry slopes (lanes/dual.py).

    found = gradient(Scene(), commands, lambda swim: (swim.hub[-1, 0], {"hub": slopes}), by=["commands"])
    found.by["commands"]

Reverse differentiation, whose cost does not depend on the number of unknowns: they write down what they do
(lanes/tape.py). docs/gradients.md says how far derivatives of swims can be trusted.
"""

from seastar_gym.gradients.adjoint import Gradient as Gradient
from seastar_gym.gradients.adjoint import Record as Record
from seastar_gym.gradients.adjoint import gradient as gradient
from seastar_gym.gradients.adjoint import record as record
from seastar_gym.gradients.swim import Derivatives as Derivatives
from seastar_gym.gradients.swim import Motion as Motion
from seastar_gym.gradients.swim import differentiate as differentiate
