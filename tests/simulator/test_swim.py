"""The physics of whole strokes: the chapter's statements, symmetry, convergence, other codes' figures, work."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import AlongLimb, Numerics, Scene, Seastar, Simulator, SmaPulse, Stiffening, Vortex, Water
from slopes import rotated

CHAPTER = Seastar(discretisation="chapter")
SCHEMES = ["implicit-euler", "sdirk2", "implicit-midpoint"]
STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])


def swimmer(scheme, step, n_robots=1, robot=TEN) -> Simulator:
    return Simulator(Scene(robot, numerics=Numerics(scheme, step)), n_robots)


def swim(simulator: Simulator, commands, n_strokes: int = 10) -> np.ndarray:
    """Hub positions [m] after every stroke, shape (n_strokes, n_robots, 2)."""
    path = []
    for _ in range(n_strokes):
        assert not simulator.stroke(commands).status.any()
        path.append(simulator.hub_position())
    return np.array(path)


# The straight swim


@pytest.mark.parametrize("step, distance", [(1e-3, 38.178e-3), (1e-2, 36.025e-3), (2e-2, 34.197e-3)])
def test_the_chapters_straight_swim_by_implicit_euler_goes_as_far_as_the_reference(step, distance):
    path = swim(swimmer("implicit-euler", step, robot=CHAPTER), STRAIGHT)
    assert path[-1, 0, 0] == pytest.approx(distance, rel=1e-3)
    assert np.abs(path[..., 1]).max() < 1e-10


CONVERGED = {"chapter": (CHAPTER, 4.91276e-3, 38.4133e-3), "new": (TEN, 4.70556e-3, 34.3600e-3)}
"""Distances of ten nodes after one stroke and after ten, with h to 0 [m]."""
ERRORS = {
    **{f"{scheme}, 0.1 ms": (Numerics(scheme, 1e-4), 5e-5) for scheme in ("sdirk2", "implicit-midpoint")},
    **{fidelity: (Numerics.preset(fidelity), error)
       for fidelity, error in (("fast", 0.02), ("balanced", 0.01), ("accurate", 3e-3), ("chapter", 0.03))},
}  # fmt: skip


@pytest.mark.parametrize("robot, one, ten", CONVERGED.values(), ids=CONVERGED)
@pytest.mark.parametrize("numerics, error", ERRORS.values(), ids=ERRORS)
def test_schemes_agree_on_the_converged_distance_and_fidelities_are_as_far_off_as_their_names_say(
    numerics, error, robot, one, ten
):
    path = swim(Simulator(Scene(robot, numerics=numerics)), STRAIGHT)
    assert path[-1, 0, 0] == pytest.approx(ten, rel=error)
    assert error > 5e-5 or path[0, 0, 0] == pytest.approx(one, rel=2e-5)


# Convergence

BENDING = Scene(Seastar(3, 4, youngs_modulus=1e4), Water(), SmaPulse(0.1, 0.02, 0.02))
CORNERS = Scene(Seastar(3, 3, youngs_modulus=1e3), None, SmaPulse(0.3, 0.03, 0.07))
LAGGED = Scene(
    Seastar(nodes_per_limb=4, youngs_modulus=3e3, relaxation_time=0.0),
    Water(1000.0, 1.0, 0.05, Vortex(0.05, 0.15, 0.1), 1.0), SmaPulse(0.4, 0.1, 0.1),
)  # fmt: skip
ORDERS = {"implicit-euler": 1, "sdirk2": 2, "implicit-midpoint": 2}
CONVERGING = {
    # From a smooth bend. It drifts, so that no node's drag passes through zero, where it is not smooth.
    **{f"water, {scheme}": (BENDING, scheme, [0.0] * 3, (512, 1024, 2048) if order == 1 else (64, 128, 256), 8192)
       for scheme, order in ORDERS.items()},
    # Steps that do not divide the ramps: none straddles a corner.
    **{f"corners, {scheme}": (CORNERS, scheme, [1.0, -1.0, 0.5], (23, 43, 97), 2048) for scheme in ORDERS},
    "lagged currents, normals and added mass": (
        LAGGED, "implicit-midpoint", [0.0, 1.0, 0.0, -0.5, -1.0], (50, 100, 200), 1600
    ),
}  # fmt: skip
"""Scene, scheme, commands, steps of a stroke, and those of sdirk2 that tell the limit."""


@cache
def end_of_a_stroke(scene: Scene, scheme: str, commands: tuple[float, ...], n_steps: int) -> np.ndarray:
    """Node positions, in the scene BENDING from a bend and drifting."""
    numerics = Numerics(scheme, scene.actuator.period / n_steps, newton_tolerance=1e-13)
    simulator, robot = Simulator(replace(scene, numerics=numerics)), scene.robot
    if scene is BENDING:
        nodes, arc = robot.nodes(), np.arange(1, 4) * robot.edge_length
        bent = np.stack([np.sin(3.0 * arc) / 3.0, (1.0 - np.cos(3.0 * arc)) / 3.0], axis=1)
        nodes[1:] = np.concatenate([rotated(bent, limb * robot.opening_angle) for limb in range(3)])
        simulator.set_state((nodes[None], np.tile([0.3, 0.1], (1, robot.n_nodes, 1)), np.zeros(1)))
    report = simulator.stroke([commands])
    assert report.status[0] == 0 and report.halvings[0] == 0
    return simulator.positions


@pytest.mark.parametrize("scene, scheme, commands, counts, many", CONVERGING.values(), ids=CONVERGING)
def test_error_falls_with_the_order_of_the_scheme(scene, scheme, commands, counts, many):
    """Slope of log error over log h."""
    exact = end_of_a_stroke(scene, scheme if scene is LAGGED else "sdirk2", tuple(commands), many)
    errors = [np.linalg.norm(end_of_a_stroke(scene, scheme, tuple(commands), n) - exact) for n in counts]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(ORDERS[scheme], abs=0.3 if scene is LAGGED else 0.15)


# Mechanical work of the actuators, and the largest moment that limbs resist them with.


PEAK, HEATING = 0.3, 0.1
COMMAND = [[1.0, -1.0, 0.0, 0.5, 0.0]]
EI = 1e6 * np.pi * 1.6e-3**4 / 4.0


CLAMP = EI / (5.0 / 12.0 * 0.1 / 5)
RESISTING = {
    "a clamp, by the sine of its rotation": (Seastar(2, 6), CLAMP * np.sin(PEAK), CLAMP * (1.0 - np.cos(PEAK)), 1e-9),
    "a limb that is to bend along, by its curvature": (
        Seastar(2, 20, along=AlongLimb()), EI * PEAK / 0.1, 0.5 * EI * PEAK**2 / 0.1, 0.03
    ),
}  # fmt: skip


@pytest.mark.parametrize("robot, moment, work_of_each, error", RESISTING.values(), ids=RESISTING)
def test_what_cannot_follow_resists_by_its_stiffness(robot, moment, work_of_each, error):
    """Two straight limbs whose nodes are all held."""
    nodes, numerics = tuple(range(robot.n_nodes)), Numerics("implicit-midpoint", 1e-3)
    simulator = Simulator(Scene(robot, None, SmaPulse(PEAK, HEATING), numerics, held_nodes=nodes), effort=True)
    turned = simulator.advance(HEATING, [[1.0, -1.0]])
    assert turned.peak_moment[0] == pytest.approx(moment, rel=error)
    assert turned.work[0] == pytest.approx(2.0 * work_of_each, rel=max(error, 1e-4))
    back = simulator.advance(0.9)
    assert back.work[0] == pytest.approx(-turned.work[0], rel=1e-3)  # what limbs give back is negative


@pytest.mark.parametrize(
    "robot, share", [(Seastar(5, 4), 1e-6), (Seastar(5, 4, along=AlongLimb(0.8), stiffening=Stiffening(2.5)), 1e-5)]
)
def test_in_vacuum_work_becomes_elastic_and_kinetic_energy_to_second_order_of_the_step(robot, share):
    lacking = []
    for step in (5e-4, 2.5e-4):
        numerics = Numerics("implicit-midpoint", step)
        simulator = Simulator(Scene(robot, None, SmaPulse(PEAK), numerics), effort=True)
        work = simulator.advance(0.05, COMMAND).work[0]
        lacking.append(work - (simulator.elastic_energy() + simulator.kinetic_energy())[0])
    assert abs(lacking[1]) < share * work
    assert lacking[0] / lacking[1] == pytest.approx(4.0, rel=0.1)
