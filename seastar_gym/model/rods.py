"""Coefficients of one robot of a scene for the kernels, and limits of its solver. Every term is one line."""

import math
from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from seastar_gym.der.contact import contact
from seastar_gym.der.rods import Rods
from seastar_gym.der.stepping import scales
from seastar_gym.der.stepping.scales import Limits
from seastar_gym.der.terms import (
    added_mass,
    along,
    bending,
    clamp,
    damping,
    drag,
    gravity,
    hub,
    inertia,
    load,
    own,
    stretching,
)
from seastar_gym.model.body import body_rim, make_body
from seastar_gym.model.currents import current_rows
from seastar_gym.model.mesh import make_mesh
from seastar_gym.scene import Scene
from seastar_gym.scene.along import AlongLimb, Stiffening
from seastar_gym.scene.fluid import Water
from seastar_gym.scene.numerics import ADAPTATION, MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP
from seastar_gym.scene.per_robot import chosen, of_robot
from seastar_gym.scene.shape import natural_hub_angle

VACUUM = Water(density=0.0, drag_coefficient=0.0)


def make_rods(scene: Scene, index: int = 0) -> Rods:
    """Coefficients of robot `index` of a scene for the kernels, see der/rods.py.

    Stretching takes a limb's profile in the middle of its edges, everything else at its nodes. The hub has half of
    every root edge, with the mean of the profiles there.
    """
    robot = chosen(scene.robot, itemgetter(index))
    water = VACUUM if scene.fluid is None else chosen(scene.fluid, itemgetter(index))
    touch = None if scene.contact is None else chosen(scene.contact, itemgetter(index))
    limbs = robot.limb_shapes()
    # Limbs that begin apart have no opening angle that could close: negative angles are not noted.
    hub_angles = [-1.0 if robot.has_body else natural_hub_angle(limb.gap, robot.hub_hinge) for limb in limbs]
    C_d, C_t, C_a = water.drag_coefficient, water.tangential_drag_coefficient, water.added_mass_coefficient
    mesh = make_mesh(limbs, robot.nodes_per_limb, robot.density)
    continuum = robot.discretisation == "continuum"
    C_along = C_d if C_t is None else C_t
    at_nodes, in_middle = drag.coefficients(mesh, water.density, C_along), None
    across, across_middle = drag.cross_coefficients(mesh, water.density, C_d, C_t), None
    if continuum:
        at_nodes, in_middle = drag.simpson_coefficients(mesh, water.density, C_along)
        across, across_middle = drag.simpson_cross_coefficients(mesh, water.density, C_d, C_t)
    stretched = stretching.coefficients(mesh)
    mass = inertia.coefficients(mesh, robot.density)
    weight = gravity.coefficients(mesh, robot.density, water.density, scene.gravity)
    loads = load.total(load.coefficients(mesh, scene.loads), weight)
    on_body, rim = None, None
    if robot.has_body:
        on_body = make_body(robot, mesh, water, scene.gravity)
        if touch is not None:
            rim = body_rim(robot)
            on_body = on_body.with_corners(rim)
        mass, at_nodes = on_body.mass(mass), on_body.drag(mesh, at_nodes)
        loads = on_body.loads(loads)
    inertia.hold(mass, scene.held_nodes)
    terms = own.coefficients([chosen(term, itemgetter(index)) for term in scene.terms], mesh)
    all_scales = scales.coefficients(mesh, stretched, robot.density, water.density, C_d, mass, scene.held_nodes)
    n_free = len(mesh.dl) + robot.has_body
    return Rods(
        n_limbs=mesh.n_limbs,
        edges_per_limb=mesh.nodes_per_limb - 1,
        n_edges=len(mesh.l),
        n_nodes=len(mesh.dl),
        n_free=n_free,
        n_places=len(at_nodes),
        n_points=n_free if on_body is None else n_free + on_body.coefficients.n_arms,
        stretching=stretched,
        bending=with_joints(
            bending.coefficients(mesh, continuum, held_edges(scene)), [limb.joint_stiffness for limb in limbs]
        ),
        hub=hub.coefficients(hub_angles, turning=robot.hub_hinge == "turning"),
        clamp=clamp.coefficients(mesh, [limb.direction for limb in limbs]) if continuum else None,
        along=limb_actuation(scene, index, mesh.natural_turn),
        mass=mass,
        edge_mass=inertia.edge_coefficients(mesh, robot.density) if continuum else None,
        drag=at_nodes,
        middle_drag=in_middle,
        cross_drag=across,
        middle_cross_drag=across_middle,
        added_mass=added_mass.coefficients(mesh, water.density, C_a),
        edge_added_mass=added_mass.edge_coefficients(mesh, water.density, C_a) if continuum else None,
        damping=damping.coefficients(robot.relaxation_time),
        current=None if water.current is None else current_rows(water.current),
        load=loads,
        own=terms,
        contact=None
        if touch is None
        else contact.coefficients(
            mesh, robot.limbs_that_may_touch(), touch.modulus, touch.opening_angle, rim, touch.layer
        ),
        scales=all_scales if terms is None else scales.of_unknown_forces(all_scales),
        body=None if on_body is None else on_body.coefficients,
    )


def held_edges(scene: Scene) -> list[int]:
    """Limbs whose root edge is held, by the hub and node 1, and no more of which is."""
    robot, held = scene.robot, set(scene.held_nodes)
    roots = [1 + limb * (robot.nodes_per_limb - 1) for limb in range(robot.n_limbs)]
    return [limb for limb, root in enumerate(roots) if {0, root} <= held and root + 1 not in held]


def limb_actuation(scene: Scene, index: int, natural_turn: list[float]) -> along.Along | None:
    """How actuators act on limbs along their length; None where they act at the hub only."""
    robot, actuator = chosen(scene.robot, itemgetter(index)), chosen(scene.actuator, itemgetter(index))
    if robot.along is None and robot.stiffening is None:
        return None
    spread, hot = robot.along or AlongLimb(share=0.0), robot.stiffening or Stiffening(ratio=1.0)
    shares = spread.hinge_shares(robot.nodes_per_limb)
    return along.coefficients(natural_turn, shares, float(actuator.peak_angle), hot.ratio, hot.middle, hot.width)


def with_joints(hinges: bending.Bending, stiffnesses: Sequence[float | None]) -> bending.Bending:
    """Bending with joints of these stiffnesses [N m/rad], springs at the hub in a row with the clamps; None for none.

    Exact for small turns; a joint and its clamp share larger ones as the clamp alone does, K (1 - cos(turn)).
    """
    EI_over_dl, dl_over_EI = hinges.EI_over_dl.copy(), hinges.dl_over_EI.copy()
    roots = np.arange(len(stiffnesses)) * (len(EI_over_dl) // len(stiffnesses))
    for root, stiffness in zip(roots.tolist(), stiffnesses, strict=True):
        if stiffness is not None:
            dl_over_EI[root] += 1.0 / stiffness
            EI_over_dl[root] = 1.0 / dl_over_EI[root]
    return hinges._replace(EI_over_dl=EI_over_dl, dl_over_EI=dl_over_EI)


def make_limits(scene: Scene, index: int = 0) -> Limits:
    """Tolerances and limits of the solver for robot `index` of a scene.

    The largest error of a step per second follows from the tolerance of the path, as was measured, see ADAPTATION.
    """
    numerics, length = scene.numerics, of_robot(scene.robot.limb_length, index)
    speed, tolerance = length / scene.actuator.period, numerics.path_tolerance
    error_rate = 0.0 if tolerance is None else speed * (tolerance / ADAPTATION[0]) ** ADAPTATION[1]
    n_steps = math.ceil(scene.actuator.period / numerics.step)
    return Limits(
        tolerance=np.array([numerics.newton_tolerance * length]),
        max_iterations=numerics.max_iterations,
        most_iterations=MOST_ITERATIONS + MOST_ITERATIONS_PER_STEP * n_steps,
        adaptive=tolerance is not None,
        error_rate=np.array([error_rate]),
    )
