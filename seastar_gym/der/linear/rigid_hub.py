"""Root nodes and a rigid hub: root nodes couple with the hub's place and orientation, not with each other.

The hub has three unknowns, its place and its orientation Phi; Phi stands in the first row of a 2 x 2 block whose second
row is a dummy. A root node couples with Phi by -C grad theta, the hub by the sum of +C grad theta, Phi with itself by
the sum of C (see terms/clamp.py).
"""

import numpy as np

from seastar_gym.der.linear.star_matrix import eliminate_node, load_root, smaller, store_pair, substitute_node
from seastar_gym.der.star import load_root_edge
from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import add_product, load, splat


@kernel
def solve_rigid_hub(rods, work, D_hub, r_hub):
    """Eliminate root nodes and hub, and solve for them; solutions as solve_ring leaves them, in work.root_solution.

    Returns the part of the Newton decrement and the smallest pivot.
    """
    edges, zero, one = rods.nodes_per_limb - 1, splat(0.0), splat(1.0)
    nothing = (zero, zero, zero, zero)
    B_hub, r_phi = nothing, (zero, zero)
    D_phi = (zero, zero, one)
    decrement, pivot = zero, splat(np.inf)
    for limb in range(rods.n_limbs):
        D, H, r = load_root(work, limb)
        edge, C = load_root_edge(work, limb), load(work.hub_stiffness, limb)
        # grad theta = (-u_y, u_x) in the root node, its opposite in the hub.
        x, y = C * edge.uy, -C * edge.ux
        B_hub = (B_hub[0] - x, B_hub[1], B_hub[2] - y, B_hub[3])
        D_phi = (D_phi[0] + C, D_phi[1], D_phi[2])
        D_hub, B_hub, D_phi, r_hub, r_phi, part, root_pivot = eliminate_node(
            work, limb * edges + 1, D, H, (x, zero, y, zero), r, D_hub, B_hub, D_phi, r_hub, r_phi
        )
        decrement += part
        pivot = smaller(pivot, root_pivot)
    D_phi, _, _, r_phi, _, part, hub_pivot = eliminate_node(
        work, 0, D_hub, B_hub, nothing, r_hub, D_phi, nothing, (zero, zero, zero), r_phi, (zero, zero)
    )
    decrement += part
    phi = r_phi[0] / D_phi[0]
    substitute_rigid_hub(rods, work, phi)
    return add_product(decrement, phi, r_phi[0]), smaller(smaller(pivot, hub_pivot), D_phi[0])


@kernel
def substitute_rigid_hub(rods, work, phi):
    """Solutions of the hub and of the root nodes, into work.root_solution, from that of Phi."""
    edges, zero = rods.nodes_per_limb - 1, splat(0.0)
    hub = substitute_node(work, 0, phi, zero, zero, zero)
    store_pair(work.root_solution, 2 * rods.n_limbs, hub)
    for limb in range(rods.n_limbs):
        store_pair(work.root_solution, 2 * limb, substitute_node(work, limb * edges + 1, hub[0], hub[1], phi, zero))
