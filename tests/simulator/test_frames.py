"""A robot that is seen from a moving frame, in a current that moves likewise, moves as it does at home."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Contact, Numerics, Scene, Seastar, Simulator, State, UniformCurrent, Water
from seastar_gym.simd.lanes import N_LANES

NUMERICS = {
    **{name: Numerics.preset(name) for name in ("fast", "balanced", "accurate", "chapter")},
    "sdirk3": Numerics("sdirk3", 10e-3),
    "loose": Numerics("implicit-midpoint", 5e-3, newton_tolerance=5e-4),
}
STILL = Water(1000.0, 1.0, 0.1, UniformCurrent(), 1.0)
"""Water with drag along limbs and added mass of its own."""
PARTS, FORESEEABLE = 100, 10
"""Pauses of a stroke, and those until which rounding has not grown to what is seen."""


def seen_from(boost: np.ndarray, scene: Scene, noise: float, shake: float = 0.0) -> tuple[np.ndarray, int]:
    """Positions during a stroke, seen from the frame [m], and the number of steps that were halved or cut.

    Positions have the shape (PARTS, n_robots, n_nodes, 2). boost: Velocity added to all motion [m/s]. noise, shake:
    Sizes of two random displacements of the nodes [m].
    """
    if scene.fluid is not None:
        scene = replace(scene, fluid=replace(scene.fluid, current=UniformCurrent(*boost)))
    simulator, rng = Simulator(scene, N_LANES), np.random.default_rng(0)
    moved, velocities, shaken = rng.standard_normal((3, N_LANES, scene.robot.n_nodes, 2))
    positions = scene.robot.nodes() + noise * moved + shake * shaken
    simulator.set_state(State(positions, 50.0 * noise * velocities + boost, np.zeros(N_LANES)))
    stroke = simulator.stroke_in_parts(rng.integers(-1, 2, (N_LANES, scene.robot.n_limbs)).astype(float), PARTS)
    way, report = [], None

    def swim():
        nonlocal report
        report = yield from stroke

    for time in swim():
        way.append(-boost * time + simulator.positions)
    assert np.median(report.status) == 0
    return np.array(way), int(report.halvings.sum() + report.energy_cuts.sum())


def assert_seen_alike(scene: Scene, noise: float = 1e-3) -> int:
    """Another frame moves robots no farther than shaking them by rounding does, in the median.

    Robots that ring wildly are chaotic. Returns the number of steps that were halved or cut.
    """
    home, needed = seen_from(np.zeros(2), scene, noise)
    moving, _ = seen_from(np.array([0.31, -0.17]), scene, noise)
    shaken, _ = seen_from(np.zeros(2), scene, noise, 1e-15)
    by_rounding, by_frame = (np.median(np.abs(other - home).max(axis=(2, 3)), axis=1) for other in (shaken, moving))
    assert np.all(by_frame[:FORESEEABLE] < 1e-13 + 1e3 * by_rounding[:FORESEEABLE])
    return needed


@pytest.mark.parametrize("numerics", NUMERICS)
@pytest.mark.parametrize("fluid", [STILL, None], ids=["water", "vacuum"])
def test_a_robot_moves_alike_in_every_frame(numerics, fluid):
    needed = assert_seen_alike(Scene(fluid=fluid, numerics=NUMERICS[numerics]))
    # With a rigid hub no step of "fast" needs it in vacuum.
    assert needed > 0 or numerics in ("accurate", "chapter") or (fluid is None and numerics == "fast")


@pytest.mark.parametrize("numerics", ["fast", "balanced", "chapter"])
def test_a_loaded_robot_whose_limbs_touch_moves_alike_in_every_frame(numerics):
    """Dead loads do work on the frame's way, too."""
    robot, loads = Seastar(relaxation_time=1e-4), ((9, 2e-4, -1e-4), (20, 0.0, 3e-4))
    assert_seen_alike(Scene(robot, STILL, numerics=NUMERICS[numerics], loads=loads, contact=Contact()), 1e-4)
