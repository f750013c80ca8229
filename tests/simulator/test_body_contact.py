"""Limbs that are pressed onto a body: they stay outside, push it as it pushes them, and come to the same bits."""

import math

import numpy as np
import pytest

from momenta import bodied_momenta
from refusals import assert_refused
from seastar_gym import Attachment, Body, Contact, Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.scene.numerics import SchemeName
from seastar_gym.scene.shape import rest_positions
from strokes import finished

PEAK = 0.8
DISC = Body(radius=0.02, attachments=tuple(
    Attachment(0.02 * math.cos(a), 0.02 * math.sin(a), a + 1.0) for a in (0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0)
))  # fmt: skip

PLATE = Body.rectangle(0.06, 0.03, attachments=(Attachment(0.03, 0.0, 0.6), Attachment(-0.03, 0.0, 0.6 + math.pi)))
ROBOTS = {
    "disc": Seastar(3, 7, 0.06, limbs=(Limb(natural_curvature=45.0),) * 3, body=DISC),
    "plate": Seastar(2, 7, 0.06, limbs=(Limb(natural_curvature=50.0),) * 2, body=PLATE),
}
"""Limbs that are curled around a body, at some distance at rest; + turns them onto it."""


def scene(name: str, scheme: SchemeName, step: float, fluid: Water | None) -> Scene:
    numerics = Numerics(scheme, step, newton_tolerance=1e-9)
    return Scene(ROBOTS[name], fluid, SmaPulse(PEAK), numerics, contact=Contact())


def heights(simulator: Simulator) -> np.ndarray:
    """Smallest distance of edges, but for root edges, from the rim of every robot's body [m], negative inside."""
    angle, q, robot = simulator.orientation(), simulator.positions, simulator.scene.robot
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    x, y = np.moveaxis(q[:, 1:] - q[:, :1], -1, 0)
    limbs = np.stack([c * x + s * y, c * y - s * x], axis=-1).reshape(len(q), robot.n_limbs, -1, 2)
    share = np.linspace(0.0, 1.0, 9)[:, None, None, None, None]
    places = (1.0 - share) * limbs[:, :, :-1] + share * limbs[:, :, 1:]
    of_robots = np.moveaxis(places, 1, 0).reshape(len(q), -1, 2)
    return np.array([robot.body.shape.height_over(each).min() for each in of_robots])


def commands(name: str) -> np.ndarray:
    """Of four robots; of the second, all limbs are turned onto the body."""
    each = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [0.5, 1.0, -1.0]])
    return each[:, : ROBOTS[name].n_limbs]


@pytest.mark.parametrize("name", ROBOTS)
def test_limbs_would_be_turned_into_the_body(name):
    """The other tests would show nothing if they were not: limbs of the natural shape end inside."""
    limbs = [limb._replace(direction=limb.direction + PEAK) for limb in ROBOTS[name].limb_shapes()]
    nodes = rest_positions(limbs, 7, tangent=True)[1:]
    assert ROBOTS[name].body.shape.height_over(nodes).min() < -1e-3
    assert ROBOTS[name].body.shape.height_over(ROBOTS[name].nodes()[1:]).min() > 1.6e-3


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint", "sdirk2"])
@pytest.mark.parametrize("name", ROBOTS)
def test_pressed_limbs_stay_outside_of_the_body(name, scheme):
    simulator = Simulator(scene(name, scheme, 5e-3, Water()), 4)
    for _ in range(2):
        stroke = simulator.stroke_in_parts(commands(name), 50)
        found, report = finished(stroke, lambda time: heights(simulator))
        found = np.array(found)
        assert (report.status == 0).all()
        assert found.min() > 0.0 and found[:, :3].min() < 1.6e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_body_and_limbs_push_each_other_alike(name):
    """In vacuum momentum stays, and angular momentum but for the slip of a step, of which it is of first order."""
    changes = []
    for step in (4e-3, 1e-3):
        simulator = Simulator(scene(name, "implicit-midpoint", step, None))
        turned = []
        for _ in simulator.stroke_in_parts(commands(name)[1:2], 50):
            momentum, spin = bodied_momenta(simulator)
            assert np.abs(momentum).max() < 1e-10 * simulator.coefficients.rods(0).mass.sum()
            turned.append((spin, abs(simulator.spin()[0]) * simulator.coefficients.rods(0).body.inertia[0]))
        changes.append(np.abs(np.array(turned)).max(axis=0))
    assert changes[1][0] < 0.02 * changes[1][1] and changes[1][0] < 0.6 * changes[0][0]


@pytest.mark.slow
def test_a_robot_on_its_body_swims_alike_in_any_company():
    together = Simulator(scene("plate", "implicit-midpoint", 5e-3, Water()), 4)
    together.stroke(commands("plate"))
    for robot, command in enumerate(commands("plate")[:2]):
        alone = Simulator(scene("plate", "implicit-midpoint", 5e-3, Water()))
        alone.stroke(command[None])
        np.testing.assert_array_equal(alone.positions[0], together.positions[robot])


@pytest.mark.slow
def test_limbs_that_meet_head_on_or_go_round_each_others_tips_swim_on():
    """Pairs of parallel limbs at the long sides of a body, whose tips come to each other from either side."""
    corners = [(x, y, math.copysign(0.5 * math.pi, y)) for x, y in ((3, 1.5), (-3, 1.5), (-3, -1.5), (3, -1.5))]
    frame = tuple(Attachment(0.01 * x, 0.01 * y, direction) for x, y, direction in corners)
    robot = Seastar(4, 8, 0.06, body=Body.rectangle(0.06, 0.03, attachments=frame))
    simulator = Simulator(Scene(robot, contact=Contact(), numerics=Numerics("implicit-midpoint", 1e-2)), 64)
    rng = np.random.default_rng(0)
    for _ in range(5):
        assert (simulator.stroke(rng.integers(-1, 2, (64, 4))).status == 0).all()


def test_a_point_body_meets_nobody():
    """The kernels are those without a body, to the last bit."""
    ends = []
    for body in (None, Body()):
        simulator = Simulator(Scene(Seastar(nodes_per_limb=5, body=body), contact=Contact()))
        simulator.stroke([[1.0, -1.0, 0.0, 1.0, -1.0]])
        ends.append(simulator.q)
    np.testing.assert_array_equal(*ends)


def test_who_may_touch_around_a_body():
    """All limbs, however they are attached; of equal limbs around a disc, those beside each other."""
    leaning = Body.rectangle(0.06, 0.03, attachments=(Attachment(0.02, -0.015, -1.8), Attachment(-0.02, -0.015, -1.3)))
    assert Seastar(2, 4, 0.03, body=leaning).limbs_that_may_touch() == [(0, 1)]
    assert set(Seastar(4, 4, body=Body(radius=0.02)).limbs_that_may_touch()) == {(0, 1), (1, 2), (2, 3), (3, 0)}


def test_what_touches_at_rest_is_refused():
    inside = Body(radius=0.02, attachments=(Attachment(0.0, 0.0, 0.0), Attachment(-0.02, 0.0, math.pi)))
    with assert_refused("limb 1 touches the body"):
        Scene(Seastar(2, 5, body=inside), contact=Contact())
    near = Body(radius=0.02, attachments=(Attachment(0.02, 0.0, 0.0), Attachment(0.02, 2e-3, 0.0)))
    with assert_refused("limbs 1 and 2 touch each other"):
        Scene(Seastar(2, 5, body=near), contact=Contact())
    across = Body.rectangle(0.06, 0.03, attachments=(Attachment(0.03, 0.015, 2.4), Attachment(-0.03, 0.015, 0.7)))
    with assert_refused("limbs 1 and 2 touch each other"):
        Scene(Seastar(2, 5, 2.0, body=across), contact=Contact())
    through = Body.rectangle(0.06, 1e-4, attachments=(Attachment(0.0, 5e-5, -1.6), Attachment(-0.03, 0.0, math.pi)))
    with assert_refused("limb 1 touches the body"):
        Scene(Seastar(2, 5, body=through), contact=Contact())
