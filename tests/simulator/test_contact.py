"""Limbs that meet: they do not cross, push each other alike, and come to rest where statics says."""

import itertools
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import oracle
from currents import NONE
from hubs import TEN
from momenta import cross
from seastar_gym import (
    Attachment,
    Body,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    Strip,
    UniformCurrent,
    Water,
)
from seastar_gym.model import make_mesh, make_rods
from seastar_gym.rods.contact.forces import tapered
from seastar_gym.scene.scene import LARGEST_OVERLAP
from seastar_gym.scene.shape import rest_positions
from seastar_gym.simulator.report import report_of_pieces
from simulator.test_conservation import CURLED
from strokes import finished

COMMANDS = np.array(list(itertools.product([-1.0, 0.0, 1.0], repeat=5)))
CLOSING = COMMANDS[((COMMANDS == 1.0) & (np.roll(COMMANDS, -1, axis=1) == -1.0)).any(axis=1)]
"""Commands that turn neighbours towards each other."""


DEEP = pytest.mark.filterwarnings("ignore:Limbs of robot:RuntimeWarning")
"""Of tests whose limbs press each other too deep."""


def images(command: np.ndarray) -> list[tuple[float, ...]]:
    """A command turned by the pentagon's five rotations, and mirrored."""
    mirrored = -np.roll(command[::-1], 1)
    return [tuple(np.roll(one, k).tolist()) for one in (command, mirrored) for k in range(5)]


DISTINCT = CLOSING[[tuple(command) == min(images(command)) for command in CLOSING]]
"""One of each class of closing commands that are the same but for a rotation or a mirror."""


def crossings(positions: np.ndarray, n_limbs: int = 5, pairs: list[tuple[int, int]] | None = None) -> np.ndarray:
    """Pairs of edges of different limbs that cross, per robot; of these pairs of limbs, by default of all."""
    n_robots = len(positions)
    limbs = positions[:, 1:].reshape(n_robots, n_limbs, -1, 2)
    limbs = np.concatenate([np.broadcast_to(positions[:, None, :1], (n_robots, n_limbs, 1, 2)), limbs], axis=2)
    count = np.zeros(n_robots, dtype=int)
    for a, b in pairs or itertools.combinations(range(n_limbs), 2):
        tail, head = limbs[:, a, :-1, None], limbs[:, a, 1:, None]
        other_tail, other_head = limbs[:, b, None, :-1], limbs[:, b, None, 1:]
        e, o = head - tail, other_head - other_tail
        parted = cross(e, other_tail - tail) * cross(e, other_head - tail) < 0.0
        other_parted = cross(o, tail - other_tail) * cross(o, head - other_tail) < 0.0
        count += (parted & other_parted).sum(axis=(1, 2))
    return count


def worst_commands(n_robots: int, n_strokes: int) -> np.ndarray:
    """Closing commands that are repeated stroke after stroke, and others drawn among all that follow each other."""
    drawn = np.random.default_rng(0).integers(len(CLOSING), size=(n_strokes, n_robots - len(DISTINCT)))
    return np.concatenate([np.tile(DISTINCT, (n_strokes, 1, 1)), CLOSING[drawn]], axis=1)


CROSSING = {"rigid": (TEN, 0.75), "hinges": (Seastar(discretisation="chapter"), np.pi / 5)}
"""Where limbs would cross: the default's need to be driven past each other, the chapter's hub overshoots."""


def closings() -> Iterator[Any]:
    """Scene, commands, pauses of a stroke, and the share of robots that may fail."""

    def case(name, robot, commands, parts=40, share=0.0, slow=False, **scene):
        numerics = Numerics.preset(name.split(",")[0])
        given = Scene(robot, numerics=numerics, **{"contact": Contact(), **scene}), commands, parts, share
        return pytest.param(*given, id=name, marks=[pytest.mark.slow] * slow)

    for name, (robot, peak) in CROSSING.items():
        actuator = SmaPulse(peak)
        # The others would show nothing if limbs did not cross without.
        yield case(f"balanced, without contact, {name}", robot, CLOSING[None], contact=None, actuator=actuator)
        for fidelity in ("fast", "balanced", "chapter"):
            yield case(f"{fidelity}, worst, {name}", robot, worst_commands(64, 4), actuator=actuator)
    # Up to the largest peak angle that a scene accepts; where hub hinges come near pi, robots may fail, and say so.
    for fidelity, peak, layer in itertools.product(("fast", "balanced", "chapter"), (0.75, 0.85, 0.94), (None, 10e-3)):
        parts, share = {"actuator": SmaPulse(peak), "contact": Contact(layer=layer)}, 0.0 if peak < 0.8 else 0.2
        twice = np.tile(DISTINCT, (2, 1, 1))
        yield case(f"{fidelity}, past each other, {peak}, {layer}", TEN, twice, share=share, **parts)
    for fidelity in ("fast", "balanced"):
        yield case(f"{fidelity}, a thousand strokes", TEN, worst_commands(32, 1000), 20, slow=True)
    # Added mass, drag along limbs, damping and a current are terms beside it.
    water = Water(tangential_drag_coefficient=0.1, added_mass_coefficient=1.0)
    robot = Seastar(nodes_per_limb=10, relaxation_time=1.6e-3)
    yield case("balanced, beside other terms", robot, CLOSING[None], 20, slow=True, fluid=water)


@DEEP
@pytest.mark.parametrize("scene, commands, parts, share", [*closings()])
def test_limbs_in_contact_do_not_cross(scene, commands, parts, share):
    simulator = Simulator(scene, commands.shape[1])
    for given in commands:
        stroke = simulator.stroke_in_parts(given, parts)
        crossed, report = finished(stroke, lambda time: crossings(simulator.positions) > 0)
        assert (np.any(crossed, axis=0).sum() >= 10) if scene.contact is None else not np.any(crossed)
        assert (report.status != 0).sum() <= share * len(given)


def test_pressed_limbs_rest_where_statics_says():
    """All nodes are held but the tip of limb 1, and a load F presses it against limb 2: where it comes to rest, contact
    pushes with what bending of the last hinge leaves of F, EI/dl over the edge length squared times the tip's way."""
    gap, force, opening = 0.04, 0.02, 0.0385
    limbs = Limb(direction=0.0), Limb(direction=gap)
    robot = Seastar(nodes_per_limb=10, n_limbs=2, limbs=limbs, relaxation_time=0.0)
    tip, nodes = robot.nodes_per_limb - 1, robot.nodes()
    push = np.array([-np.sin(gap), np.cos(gap)])
    scene = Scene(
        robot,
        NONE,
        SmaPulse(peak_angle=0.0),
        Numerics(step=20e-3, newton_tolerance=1e-10),
        held_nodes=tuple(node for node in range(robot.n_nodes) if node != tip),
        loads=((tip, *(force * push)),),
        contact=Contact(opening_angle=opening),
    )
    simulator = Simulator(scene, 1)
    for _ in range(3):
        simulator.stroke(np.zeros((1, 2)))
    positions = simulator.positions[0]
    assert np.abs(simulator.velocities).max() < 1e-9
    contact = np.zeros(2)
    for touch in oracle.touches(oracle.Star(n_limbs=2), positions, nodes, opening):
        contact += touch.stiffness * touch.depth(positions) * touch.gradient.reshape(-1, 2)[tip]
    way = (positions[tip] - nodes[tip]) @ push
    bending = float(make_rods(scene).bending.EI_over_dl[tip - 1]) / robot.edge_length**2
    assert way > 5e-4
    assert -contact @ push == pytest.approx(force - bending * way, rel=0.02)


@pytest.mark.parametrize("damping", [0.0, 0.003])
def test_paths_of_pressed_limbs_converge_with_the_nodes(damping):
    """With 10 nodes within 2 % of the path and with 19 within 1 %; contact itself feeds no energy to the limbs."""
    commands = np.array([[0.0, 1.0, -1.0, 1.0, -1.0], [1.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0, 1.0]])

    def swim(nodes):
        numerics = Numerics("implicit-midpoint", 1e-3, newton_tolerance=1e-8, damping=damping)
        simulator = Simulator(Scene(Seastar(nodes_per_limb=nodes), numerics=numerics, contact=Contact()), 3)
        for _ in range(2):
            simulator.stroke(commands)
        return simulator.hub_position()

    limit = swim(37)
    coarse, fine = (np.linalg.norm(swim(nodes) - limit, axis=1) for nodes in (10, 19))
    assert np.all(coarse < 0.02 * np.linalg.norm(limit, axis=1)) and np.all(fine < 0.01 * np.linalg.norm(limit, axis=1))


@pytest.mark.parametrize("angle", [0.3, 0.2])
def test_limbs_pressed_onto_each_other_come_to_stand_at_the_opening_angle(angle):
    """Two neighbours turned slowly until their clamps have one direction: beyond where they touch they are straight."""
    scene = Scene(
        Seastar(nodes_per_limb=37), actuator=SmaPulse(heating_time=20.0, cooling_time=20.0),
        numerics=Numerics("sdirk2", 0.02), contact=Contact(opening_angle=angle),
    )  # fmt: skip
    simulator = Simulator(scene)

    stroke = simulator.stroke_in_parts(np.array([[1.0, -1.0, 0.0, 0.0, 0.0]]), 2)
    next(stroke)
    first, second = (simulator.positions[0, tip] - simulator.positions[0, tip - 1] for tip in (36, 72))
    assert np.arctan2(cross(first, second), first @ second) == pytest.approx(angle, rel=0.05)


def thrown(speed: float, numerics: Numerics, contact: Contact, n_robots: int = 1) -> Simulator:
    """Two limbs turn towards each other, their tips so fast [m/s]."""
    simulator = Simulator(Scene(TEN, None, numerics=numerics, contact=contact), n_robots)
    state = simulator.get_state()
    arms = state.positions[0, 1:].reshape(5, -1, 2) - state.positions[0, 0]
    across = np.stack([-arms[..., 1], arms[..., 0]], axis=-1) * np.array([speed, -speed, 0, 0, 0])[:, None, None] / 0.1
    state.velocities[:, 1:] = across.reshape(-1, 2)
    simulator.set_state(state)
    return simulator


@DEEP
@pytest.mark.parametrize("angle", [0.05, 0.1, 0.2, 0.31])
def test_straight_limbs_that_are_held_an_angle_apart_overlap_by_what_is_left_of_their_thickness(angle):
    """Largest of 1 - distance/thickness, of nodes from the other limb's nodes and from feet on its edges."""
    limbs, opening = (Limb(direction=0.0), Limb(direction=1.0)), 0.3
    robot = Seastar(nodes_per_limb=10, n_limbs=2, limbs=limbs)
    held = Scene(robot, None, held_nodes=tuple(range(robot.n_nodes)), contact=Contact(opening_angle=opening))
    simulator = Simulator(held)
    x = np.arange(10) * robot.edge_length
    state = simulator.get_state()
    state.positions[0, 1:10] = np.stack([x, 0.0 * x], axis=1)[1:]
    state.positions[0, 10:] = np.outer(x, [np.cos(angle), np.sin(angle)])[1:]
    simulator.set_state(state)
    report = simulator.stroke(np.zeros((1, 2)))
    thickness = np.array([tapered(robot.rod_radius, each, opening) for each in x])
    feet = 1.0 - (x * np.sin(angle))[1:] / (thickness + np.interp(x * np.cos(angle), x, thickness))[1:]
    nodes = 1.0 - (x * np.sin(0.5 * angle))[1:] / thickness[1:]
    assert report.largest_overlap[0] == pytest.approx(max(0.0, feet.max(), nodes.max()), rel=1e-6)


@DEEP
@pytest.mark.parametrize(("speed", "stopped"), [(5.0, False), (100.0, True)])
@pytest.mark.parametrize("numerics", [Numerics("sdirk2", 0.02), Numerics("implicit-midpoint", 5e-3)], ids=str)
def test_neighbours_thrown_at_each_other_bounce_or_stop_but_never_cross(numerics, speed, stopped):
    """Surfaces that yield hold them up to about 25 m/s."""
    simulator = thrown(speed, numerics, Contact())
    report = simulator.stroke(np.zeros((1, 5)))
    assert bool(report.status[0]) == stopped
    assert not crossings(simulator.positions, pairs=simulator.scene.robot.limbs_that_may_touch()).any()


@DEEP
@pytest.mark.parametrize("share", [-0.2, 0.2, 0.6])
def test_the_overlap_with_a_body_is_over_the_limb_s_part_of_the_distance(share):
    """A limb that is held around a disc, with its tip in it. In a current, for which a body's code is there anyway."""
    robot = Seastar(nodes_per_limb=10, n_limbs=1, limbs=(Limb(direction=0.0),), body=Body(radius=0.02))
    held = tuple(range(robot.n_nodes))
    fluid = Water(current=UniformCurrent())
    simulator = Simulator(Scene(robot, fluid, contact=Contact(), held_nodes=held))
    state = simulator.get_state()
    angles, radii = np.linspace(0.0, np.pi, len(held) - 1), np.full(len(held) - 1, 0.03)
    radii[0], radii[-1] = state.positions[0, 1, 0], 0.02 + robot.rod_radius * (1.0 - share)
    state.positions[0, 1:] = (radii * [np.cos(angles), np.sin(angles)]).T
    simulator.set_state(state)
    assert simulator.stroke(np.zeros((1, 1))).largest_overlap[0] == pytest.approx(max(share, 0.0), rel=1e-6)


def test_thrown_limbs_that_overlap_too_much_warn_once_and_come_to_rest_before_they_cross_at_twice_the_speed():
    numerics, contact, still = Numerics("sdirk2", 1e-3), Contact(layer=10e-3), np.zeros((2, 5))
    simulator = thrown(1.0, numerics, contact, 2)
    start = simulator.get_state()
    with pytest.warns(RuntimeWarning, match=r"Limbs of robot 0 overlap by 0\.[5-9]"):
        first = simulator.stroke(still)
    again = pickle.loads(pickle.dumps(simulator))
    again.set_state(start)
    for report in (first, again.stroke(still)):
        assert not report.status.any()
        assert np.all(report.largest_overlap > LARGEST_OVERLAP) and np.all(report.largest_overlap < 1.0)
    with pytest.warns(RuntimeWarning, match="overlap"):
        report = thrown(2.0, numerics, contact).stroke(still[:1])
    assert report.status[0] == 0 and report.energy_cuts[0] > 0 and 0.9 < report.largest_overlap[0] <= 1.0


def test_the_largest_overlap_is_of_any_time_step_and_zero_apart():
    scene = Scene(TEN, actuator=SmaPulse(0.75), numerics=Numerics.preset("balanced"), contact=Contact(layer=10e-3))
    found = Simulator(scene, len(CLOSING)).stroke(CLOSING).largest_overlap
    assert 0.1 < found.max() < LARGEST_OVERLAP
    halves = Simulator(scene, len(CLOSING))
    pieces = [halves.advance(0.5, CLOSING), halves.advance(0.5)]
    np.testing.assert_allclose(report_of_pieces(pieces).largest_overlap, found, rtol=1e-3)
    assert (pieces[1].largest_overlap < found).any()
    assert (Simulator(scene, 1).stroke(np.zeros((1, 5))).largest_overlap == 0.0).all()
    assert (Simulator(Scene(TEN), 2).stroke(CLOSING[:2]).largest_overlap == 0.0).all()


def test_the_modulus_of_a_layer_is_that_of_a_beam_on_an_elastic_foundation():
    """k = 4 EI/layer^4 of every limb's own bending stiffness; the default's layer is the fourth root of six radii."""
    limbs = (Limb(), Limb(youngs_modulus=2e6), Limb(section=Strip(3e-3, 8e-3)), Limb(radius=(2e-3, 1e-3)), Limb())
    robot, layer = Seastar(nodes_per_limb=10, limbs=limbs), 5e-3
    mesh = make_mesh(robot.limb_shapes(), 10, robot.density)
    found = make_rods(Scene(robot, contact=Contact(layer=layer))).contact.stiffness[1:].reshape(5, 9)
    modulus = 2.0 * found / mesh.dl[1:].reshape(5, 9)
    np.testing.assert_allclose(4.0 * mesh.at_nodes.EI[:, 1:] / modulus, layer**4, rtol=1e-12)
    assert modulus[2] == pytest.approx(4.0 * 1e6 * 8e-3 * 3e-3**3 / 12.0 / layer**4)
    by_layer, default = (
        make_rods(Scene(TEN, contact=each)).contact.stiffness
        for each in (Contact(layer=6.0**0.25 * TEN.rod_radius), Contact())
    )
    np.testing.assert_allclose(by_layer, default, rtol=1e-12)


# Limbs that are pressed onto a body


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


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["implicit-euler", "implicit-midpoint", "sdirk2"])
def test_pressed_limbs_stay_outside_of_the_body(scheme):
    """Into which they would be turned if it were not for contact: limbs of the natural shape end inside."""
    peak, numerics = 0.8, Numerics(scheme, 5e-3, newton_tolerance=1e-9)
    limbs = [limb._replace(direction=limb.direction + peak) for limb in CURLED.limb_shapes()]
    assert CURLED.body.shape.height_over(rest_positions(limbs, 7, tangent=True)[1:]).min() < -1e-3
    assert CURLED.body.shape.height_over(CURLED.nodes()[1:]).min() > 1.6e-3
    simulator = Simulator(Scene(CURLED, Water(), SmaPulse(peak), numerics, contact=Contact()), 4)
    for _ in range(2):
        stroke = simulator.stroke_in_parts(np.array([[1.0, 0.0], [1.0, 1.0], [1.0, -1.0], [0.5, 1.0]]), 50)
        found, report = finished(stroke, lambda time: heights(simulator))
        found = np.array(found)
        assert (report.status == 0).all()
        assert found.min() > 0.0 and found[:, :3].min() < 1.6e-3


def test_who_may_touch():
    """Neighbours, of equal limbs; if lengths differ, every pair: limbs 1 and 3 reach over a short limb 2."""

    def pairs(robot):
        found = make_rods(Scene(robot, contact=Contact())).contact.pairs
        return {*map(tuple, found.reshape(-1, 2).tolist())}

    short = Seastar(nodes_per_limb=10, limbs=(Limb(), Limb(length=0.03), Limb(), Limb(), Limb()))
    assert {(0, 1), (0, 2), (4, 1)} <= pairs(short) and len(pairs(TEN)) == 5
    leaning = Body.rectangle(0.06, 0.03, attachments=(Attachment(0.02, -0.015, -1.8), Attachment(-0.02, -0.015, -1.3)))
    assert Seastar(2, 4, 0.03, body=leaning).limbs_that_may_touch() == [(0, 1)]
    assert set(Seastar(4, 4, body=Body(radius=0.02)).limbs_that_may_touch()) == {(0, 1), (1, 2), (2, 3), (3, 0)}
