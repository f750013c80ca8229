"""The physics of whole strokes: the chapter's statements, conservation, symmetry, convergence, other codes' figures."""

import pickle

import numpy as np
import pytest

import oracle
from exact.solutions import published_swim
from hubs import HUBS, TEN, robot_with
from momenta import momenta
from seastar_gym import AlongLimb, Numerics, Scene, Seastar, Simulator, SmaPulse, SmaWires, Water, relaxation_time
from seastar_gym.model.rods import make_rods
from seastar_gym.scene.actuators.actuator import Actuator
from stages import robot_and_star
from strokes import finished

CHAPTER = Seastar(discretisation="chapter")
SCHEMES = ["implicit-euler", "sdirk2", "sdirk3", "implicit-midpoint"]
STRAIGHT = np.array([[0.0, 1.0, 0.0, 0.0, -1.0]])
FIFTH_OF_TURN = 2.0 * np.pi / 5.0


def swimmer(scheme, step, n_robots=1, fluid=Water(), robot=TEN, **numerics) -> Simulator:
    return Simulator(Scene(robot, fluid, numerics=Numerics(scheme, step, **numerics)), n_robots)


def swim(simulator: Simulator, commands, n_strokes: int = 10) -> np.ndarray:
    """Hub positions [m] after every stroke, shape (n_strokes, n_robots, 2)."""
    path = []
    for _ in range(n_strokes):
        assert not simulator.stroke(commands).status.any()
        path.append(simulator.hub_position())
    return np.array(path)


def rattled(simulator: Simulator, speed: float, bend: float = 0.0, seed: int = 0) -> Simulator:
    """Give every node a random velocity of about `speed` [m/s] and turn every edge by about `bend` [rad]."""
    rng, state = np.random.default_rng(seed), simulator.get_state()
    robot = simulator.scene.robot
    shape = (simulator.n_robots, robot.n_limbs, robot.nodes_per_limb - 1)
    angles = np.arange(robot.n_limbs)[:, None] * robot.opening_angle + bend * rng.standard_normal(shape)
    edges = robot.edge_length * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    state.positions[:, 1:] = np.cumsum(edges, axis=2).reshape(simulator.n_robots, -1, 2)
    state.velocities[:] = speed * rng.standard_normal(state.velocities.shape)
    simulator.set_state(state)
    return simulator


def energy(simulator: Simulator) -> np.ndarray:
    return simulator.elastic_energy() + simulator.kinetic_energy()


# The straight swim


@pytest.mark.parametrize("step, distance", [(1e-3, 38.178e-3), (1e-2, 36.025e-3), (2e-2, 34.197e-3)])
def test_the_chapters_straight_swim_by_implicit_euler_goes_as_far_as_the_reference(step, distance):
    path = swim(swimmer("implicit-euler", step, robot=CHAPTER), STRAIGHT)
    assert path[-1, 0, 0] == pytest.approx(distance, rel=1e-3)
    assert np.abs(path[..., 1]).max() < 1e-10


@pytest.mark.parametrize("scheme", SCHEMES)
def test_symmetric_gait_does_not_drift_sideways(scheme):
    path = swim(swimmer(scheme, 5e-3), STRAIGHT)
    assert path[-1, 0, 0] > 0.03
    assert np.abs(path[..., 1]).max() < 1e-10


CONVERGED = pytest.mark.parametrize(
    "robot, one, ten", [(CHAPTER, 4.91276e-3, 38.4133e-3), (TEN, 4.70556e-3, 34.3600e-3)], ids=["chapter", "new"]
)
"""Distances of ten nodes after one stroke and after ten, with h to 0 [m]."""


@CONVERGED
def test_schemes_of_different_order_agree_on_the_converged_distance(robot, one, ten):
    for scheme, step in (("sdirk2", 1e-4), ("implicit-midpoint", 1e-4)):
        path = swim(swimmer(scheme, step, robot=robot), STRAIGHT)
        assert path[0, 0, 0] == pytest.approx(one, rel=2e-5)
        assert path[-1, 0, 0] == pytest.approx(ten, rel=5e-5)


@CONVERGED
def test_sdirk3_is_near_the_converged_distance_at_20_ms(robot, one, ten):
    assert swim(swimmer("sdirk3", 20e-3, robot=robot), STRAIGHT)[-1, 0, 0] == pytest.approx(ten, rel=2e-3)


@CONVERGED
@pytest.mark.parametrize("fidelity, error", [("fast", 0.02), ("balanced", 0.01), ("accurate", 3e-3), ("chapter", 0.03)])
def test_fidelities_are_as_far_off_as_their_names_say(fidelity, error, robot, one, ten):
    simulator = Simulator(Scene(robot, numerics=Numerics.preset(fidelity)))
    assert swim(simulator, STRAIGHT)[-1, 0, 0] == pytest.approx(ten, rel=error)


def test_robot_swims_forward_while_heated_and_back_while_cooling():
    """It gains way while it is heated, glides on, and loses most of it again in the second half, as in Fig. 13.6."""
    simulator = swimmer("implicit-midpoint", 1e-3)
    simulator.stroke(STRAIGHT)
    start = simulator.hub_position()[0, 0]
    way = {round(t, 3): simulator.hub_position()[0, 0] - start for t in simulator.stroke_in_parts(STRAIGHT, 20)}
    assert 0.0 < way[0.05] < way[0.1]
    assert way[0.1] > 2e-3
    assert max(way.values()) > 2.0 * way[1.0] > 0.0
    assert np.all(np.diff([x for t, x in way.items() if t >= 0.5]) < 0.0)


# The pairs of Fig. 13.8

PAIRS = np.array(
    [[-1.0, 1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0, 1.0]]
)
BISECTORS = [36.0, 72.0, 108.0, 144.0]


@pytest.mark.parametrize("robot, third_goes_farther", [(CHAPTER, False), (TEN, True)], ids=["chapter", "new"])
def test_every_pair_of_figure_13_8_moves_along_its_bisector_and_1_4_goes_farthest(robot, third_goes_farther):
    """That {1-,5+} goes farther than {1-,3+} is the chapter's discretisation, not mechanics."""
    hub = swim(swimmer("implicit-midpoint", 0.5e-3, 4, robot=robot), PAIRS)[-1]
    np.testing.assert_allclose(np.degrees(np.arctan2(hub[:, 1], hub[:, 0])), BISECTORS, rtol=0.0, atol=0.01)
    minus_1_plus_2, minus_1_plus_3, minus_1_plus_4, minus_1_plus_5 = np.hypot(*hub.T)
    assert minus_1_plus_4 > max(minus_1_plus_5, minus_1_plus_3) > min(minus_1_plus_5, minus_1_plus_3) > minus_1_plus_2
    assert (minus_1_plus_3 > minus_1_plus_5) == third_goes_farther


def test_adapted_steps_keep_their_tolerance_on_every_pair():
    """The loosest with the longest steps, too."""
    exact = swim(swimmer("implicit-midpoint", 2e-4, 4), PAIRS)[-1]
    for step, tolerance, error in ((0.01, 0.01, 0.015), (0.05, 0.01, 0.015), (0.05, 0.02, 0.02)):
        found = swim(swimmer("implicit-midpoint", step, 4, path_tolerance=tolerance), PAIRS)[-1]
        assert (np.hypot(*(found - exact).T) / np.hypot(*exact.T)).max() < error


# Other codes

PUBLISHED_DISTANCE = 36.28272e-3
"""Hub x [m] of both codes after ten strokes."""


def test_first_stroke_with_a_turning_hub_is_that_of_two_published_codes():
    """Their own disagreement is 3e-7: Newton to a force residual of 1e-8."""
    simulator = swimmer("implicit-euler", 0.01, robot=robot_with("turning"), newton_tolerance=1e-11)
    found = {}
    for time in simulator.stroke_in_parts(STRAIGHT, 100):
        found[round(time, 2)] = simulator.hub_position()[0]
    for time, *figures in np.transpose(published_swim())[:10]:
        np.testing.assert_allclose(found[round(time, 2)][0], figures, rtol=4e-7)
    assert max(abs(y) for _, y in found.values()) < 1e-13


def test_ten_strokes_with_a_turning_hub_go_as_far_as_in_two_published_codes():
    for tolerance, error in ((1e-8, 1e-5), (1e-11, 1e-6)):
        simulator = swimmer("implicit-euler", 0.01, robot=robot_with("turning"), newton_tolerance=tolerance)
        assert swim(simulator, STRAIGHT)[-1, 0, 0] == pytest.approx(PUBLISHED_DISTANCE, rel=error)


# Conservation


def momentum(simulator: Simulator) -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s] of every robot."""
    return momenta(make_rods(simulator.scene), simulator.positions, simulator.velocities)


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_keeps_linear_momentum_to_rounding_without_fluid(scheme, hub):
    """Even at a loose tolerance: every Newton step solves a linear equation to the last bit."""
    simulator = swimmer(scheme, 0.01, 8, None, robot_with(hub), newton_tolerance=1e-5)
    rattled(simulator, 0.05)
    before, _ = momentum(simulator)
    swim(simulator, np.tile([0.0, 1.0, 0.0, 0.0, -0.5], (8, 1)), 3)
    after, _ = momentum(simulator)
    size = np.sum(make_rods(simulator.scene).mass) * 0.05
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-11 * size)


@pytest.mark.parametrize("hub", HUBS[:2])
def test_implicit_midpoint_keeps_angular_momentum_and_no_other_scheme_does(hub):
    """Its stages are symplectic, so they keep quadratic invariants; actuators turn limbs against each other only."""
    change = {}
    for scheme in SCHEMES:
        simulator = rattled(swimmer(scheme, 5e-3, 8, None, robot_with(hub), newton_tolerance=1e-12), 0.05)
        _, before = momentum(simulator)
        swim(simulator, np.tile([0.0, 1.0, 0.0, 0.0, -0.5], (8, 1)), 1)
        _, after = momentum(simulator)
        change[scheme] = np.abs(after - before).max() / np.abs(before).max()
    assert change.pop("implicit-midpoint") < 1e-8
    assert min(change.values()) > 1e-3


def test_hub_of_a_robot_without_fluid_stays_where_its_mass_allows():
    """From rest the centre of mass stays at rest, whatever the limbs do."""
    simulator = swimmer("sdirk2", 0.01, 2, None)
    swim(simulator, np.array([[1.0, -1.0, 0.0, 0.5, 0.0], [0.0, 0.0, 1.0, 1.0, 1.0]]), 3)
    centre = np.einsum("n,rnd->rd", make_rods(simulator.scene).mass, simulator.positions)
    assert np.abs(simulator.positions - TEN.nodes()).max() > 1e-3
    np.testing.assert_allclose(centre / make_rods(simulator.scene).mass.sum(), 0.0, atol=1e-10)


# Held and loaded robots


@pytest.mark.slow  # scenes with loads have kernels of their own, to be compiled
@pytest.mark.parametrize("hub", HUBS)
def test_a_loaded_robot_comes_to_rest_where_its_elastic_forces_carry_the_load(hub):
    """Limb 1 clamped at the hub, a dead load at the tip of limb 3; implicit Euler's long steps end the swinging."""
    held, (tip, *force) = (0, 1, 2), (27, 2e-4, -1e-4)
    robot, star = robot_and_star(hub=hub)
    numerics = Numerics("implicit-euler", 0.05, newton_tolerance=1e-12)
    simulator = Simulator(Scene(robot, numerics=numerics, held_nodes=held, loads=((tip, *force),)))
    for _ in range(60):
        assert simulator.stroke(np.zeros((1, 5))).status[0] == 0
    q = simulator.positions[0]
    np.testing.assert_allclose(q[list(held)], robot.nodes()[list(held)], rtol=0.0, atol=1e-10)
    assert np.abs(q - robot.nodes()).max() > 1e-3
    forces = -oracle.elastic_gradient(star, q, np.zeros(5))
    forces[tip] += force
    free = np.setdiff1d(np.arange(46), held)
    np.testing.assert_allclose(forces[free], 0.0, atol=1e-3 * np.hypot(*force))


# Energy


@pytest.mark.parametrize("fluid", [None, Water()])
@pytest.mark.parametrize("hub", HUBS)
def test_energy_never_grows_in_an_unactuated_implicit_euler_run(fluid, hub):
    simulator = swimmer("implicit-euler", 0.01, 8, fluid, robot_with(hub))
    rattled(simulator, 0.05, bend=0.05)
    energies = [energy(simulator)]
    for _ in range(3):
        for _ in simulator.stroke_in_parts(np.zeros((8, 5)), 100):
            energies.append(energy(simulator))
    change = np.diff(energies, axis=0)
    assert np.all(change <= 1e-12 * energies[0])
    assert np.all(np.sum(change, axis=0) < -0.1 * energies[0])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_water_takes_energy_out_of_an_unactuated_robot(scheme):
    simulator = rattled(swimmer(scheme, 1e-3, 4), 0.05, bend=0.02)
    energies = [energy(simulator)]
    for _ in simulator.stroke_in_parts(np.zeros((4, 5)), 20):
        energies.append(energy(simulator))
    assert np.all(np.diff(energies, axis=0) < 0.0)


def test_implicit_midpoint_keeps_the_energy_of_ringing_that_the_other_schemes_damp():
    """Without fluid, over one second; design.md, "ringing matters"."""
    left = {}
    for scheme in SCHEMES:
        simulator = rattled(swimmer(scheme, 1e-3, 8, None), 0.0, bend=0.02)
        before = energy(simulator)
        swim(simulator, np.zeros((8, 5)), 1)
        left[scheme] = energy(simulator) / before
    assert np.all(np.abs(left["implicit-midpoint"] - 1.0) < 0.05)
    for scheme in ("sdirk2", "sdirk3", "implicit-euler"):
        assert np.all(left[scheme] < 1.0)
    assert np.all(left["implicit-euler"] < 0.5)


# Symmetry


def random_commands(n_robots: int, n_strokes: int = 2) -> np.ndarray:
    return np.random.default_rng(4).uniform(-1.0, 1.0, (n_strokes, n_robots, 5))


def turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return vectors @ np.array([[c, s], [-s, c]])


def limbs_of(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The hubs and the limbs' own nodes, shape (n_robots, 5, 9, 2)."""
    return nodes[:, :1], nodes[:, 1:].reshape(-1, 5, 9, 2)


@pytest.mark.parametrize("hub", HUBS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_commanding_the_next_limb_turns_the_swim_by_72_degrees_and_mirrored_commands_mirror_it(scheme, hub):
    robot, mirror = robot_with(hub), [0, 4, 3, 2, 1]
    simulators = [Simulator(Scene(robot, actuator=SmaPulse(0.5), numerics=Numerics(scheme, 0.01)), 8) for _ in range(3)]
    for commands in random_commands(8):
        carried = commands, np.roll(commands, 1, axis=1), -commands[:, mirror]
        for simulator, its_commands in zip(simulators, carried, strict=True):
            simulator.stroke(its_commands)
    plain, next_limb, mirrored = (simulator.positions for simulator in simulators)
    hub, limbs = limbs_of(plain)
    expected = turned(np.concatenate([hub, np.roll(limbs, 1, axis=1).reshape(8, -1, 2)], axis=1), FIFTH_OF_TURN)
    assert np.abs(plain - robot.nodes()).max() > 1e-3
    np.testing.assert_allclose(next_limb, expected, rtol=0.0, atol=1e-13)
    expected = np.concatenate([hub, limbs[:, mirror].reshape(8, -1, 2)], axis=1) * [1.0, -1.0]
    np.testing.assert_allclose(mirrored, expected, rtol=0.0, atol=1e-13)


def test_the_water_is_the_same_everywhere_and_in_every_direction():
    """A robot that begins elsewhere under another heading swims the same swim there."""
    here, there = (swimmer("implicit-midpoint", 5e-3, 8) for _ in range(2))
    heading, place = 0.7, np.array([0.4, -0.3])
    there.reset(heading=heading)
    state = there.get_state()
    there.set_state(state._replace(positions=state.positions + place))
    for commands in random_commands(8):
        here.stroke(commands)
        there.stroke(commands)
    np.testing.assert_allclose(there.positions, turned(here.positions, heading) + place, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(there.velocities, turned(here.velocities, heading), rtol=0.0, atol=1e-6)


# Convergence


@pytest.mark.parametrize(
    "scheme, order", [("implicit-euler", 1), ("sdirk2", 2), ("sdirk3", 3), ("implicit-midpoint", 2)]
)
@pytest.mark.parametrize("fluid", [None, Water()], ids=["vacuum", "water"])
def test_error_falls_with_the_order_of_the_scheme(scheme, order, fluid):
    """Slope of log error over log h, for a robot that drifts and swings back from a smooth bend.

    In water it drifts, so that no node's drag passes through zero, where it is not smooth.
    """
    robot = Seastar(n_limbs=3, nodes_per_limb=4, youngs_modulus=1e4)

    def end(scheme: str, n_steps: int) -> np.ndarray:
        actuator = SmaPulse(0.1, heating_time=0.02, cooling_time=0.02)
        numerics = Numerics(scheme, 0.04 / n_steps, newton_tolerance=1e-13)
        simulator = Simulator(Scene(robot, fluid, actuator, numerics))
        nodes, arc = robot.nodes(), np.arange(1, 4) * robot.edge_length
        bent = np.stack([np.sin(3.0 * arc) / 3.0, (1.0 - np.cos(3.0 * arc)) / 3.0], axis=1)
        for limb in range(3):
            nodes[1 + 3 * limb : 4 + 3 * limb] = turned(bent, limb * robot.opening_angle)
        simulator.set_state((nodes[None], np.tile([0.3, 0.1], (1, robot.n_nodes, 1)), np.zeros(1)))
        report = simulator.stroke(np.zeros((1, 3)))
        assert report.status[0] == 0 and report.halvings[0] == 0
        return simulator.positions

    exact = end("sdirk3", 4096)
    counts = np.array([512, 1024, 2048] if order == 1 else [64, 128, 256])
    errors = [np.linalg.norm(end(scheme, n) - exact) for n in counts]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.15)


def test_damped_swims_converge_in_the_time_step_where_undamped_ones_ring():
    """Of the straight swim, the pairs and random commands: two schemes at 1 ms agree, and 10 ms err by less."""
    commands = np.vstack([STRAIGHT, PAIRS, np.random.default_rng(0).uniform(-1.0, 1.0, (1, 5))])
    agreement, errors, far = {}, {}, {}
    for name, tau in (("undamped", None), ("silicone", relaxation_time(0.1, 10.0))):

        def hubs(scheme: str, step: float, tolerance: float, tau=tau) -> np.ndarray:
            robot = Seastar(nodes_per_limb=10, relaxation_time=tau)
            return swim(swimmer(scheme, step, len(commands), robot=robot, newton_tolerance=tolerance), commands)

        def error(found: np.ndarray, exact: np.ndarray) -> float:
            way = np.linalg.norm(np.diff(exact, axis=0, prepend=0.0), axis=2).sum(axis=0)
            return float((np.linalg.norm(found - exact, axis=2).max(axis=0) / way).max())

        exact = hubs("implicit-midpoint", 1e-3, 1e-11)
        agreement[name] = error(hubs("sdirk3", 1e-3, 1e-11), exact)
        schemes = ("sdirk2", "sdirk3", "implicit-midpoint")
        errors[name] = np.array([error(hubs(scheme, 0.01, 1e-7), exact) for scheme in schemes])
        far[name] = np.linalg.norm(exact[-1], axis=1)[1:5]
    assert agreement["silicone"] < 0.1 * agreement["undamped"]
    assert np.all(errors["silicone"] < 0.3 * errors["undamped"])
    np.testing.assert_allclose(far["silicone"], far["undamped"], rtol=0.2)


# Mechanical work of the actuators, and the largest moment that limbs resist them with.


PEAK, HEATING = 0.3, 0.1
COMMAND = [[1.0, -1.0, 0.0, 0.5, 0.0]]
EI = 1e6 * np.pi * 1.6e-3**4 / 4.0


def powered(step: float = 5e-3, actuator: Actuator = SmaPulse(PEAK), **scene: object) -> Simulator:
    numerics = Numerics("implicit-midpoint", step)
    return Simulator(Scene(Seastar(5, 8), actuator=actuator, numerics=numerics, **scene), effort=True)


def held(robot: Seastar) -> Simulator:
    """A robot of two limbs whose nodes all stay where they are."""
    nodes = tuple(range(robot.n_nodes))
    numerics = Numerics("implicit-midpoint", 1e-3)
    return Simulator(Scene(robot, None, SmaPulse(PEAK, HEATING), numerics, held_nodes=nodes), effort=True)


def test_a_clamp_that_cannot_follow_resists_by_its_stiffness_times_the_sine_of_its_rotation():
    robot = Seastar(2, 6)
    simulator, K = held(robot), EI / (5.0 / 12.0 * robot.limb_length / 5)
    turned = simulator.advance(HEATING, [[1.0, -1.0]])
    assert turned.peak_moment[0] == pytest.approx(K * np.sin(PEAK), rel=1e-9)
    assert turned.work[0] == pytest.approx(2.0 * K * (1.0 - np.cos(PEAK)), rel=1e-4)
    back = simulator.advance(0.9)
    assert back.work[0] == pytest.approx(-turned.work[0], rel=1e-3)  # what limbs give back is negative


def test_a_straight_limb_that_is_to_bend_along_resists_by_its_stiffness_times_its_curvature():
    robot = Seastar(2, 20, along=AlongLimb())
    turned = held(robot).advance(HEATING, [[1.0, -1.0]])
    assert turned.peak_moment[0] == pytest.approx(EI * PEAK / robot.limb_length, rel=0.03)
    assert turned.work[0] == pytest.approx(EI * PEAK**2 / robot.limb_length, rel=0.03)


def lack(step: float) -> tuple[float, float]:
    """Work less what it became in vacuum, and the work [J], while limbs turn."""
    numerics = Numerics("implicit-midpoint", step)
    simulator = Simulator(Scene(Seastar(5, 4), None, SmaPulse(PEAK), numerics), effort=True)
    work = simulator.advance(0.05, COMMAND).work[0]
    return work - (simulator.elastic_energy() + simulator.kinetic_energy())[0], work


def test_in_vacuum_work_becomes_elastic_and_kinetic_energy_to_second_order_of_the_step():
    (coarse, _), (fine, work) = lack(5e-4), lack(2.5e-4)
    assert abs(fine) < 1e-6 * work
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


def test_work_in_water_converges_and_most_of_it_is_lost_to_drag():
    coarse, middle, fine = powered(4e-3), powered(2e-3), powered(1e-3)
    work = [simulator.stroke(COMMAND).work[0] for simulator in (coarse, middle, fine)]
    assert abs(work[1] - work[2]) < 0.5 * abs(work[0] - work[1]) < 0.01 * work[2]
    assert 0.0 < (fine.elastic_energy() + fine.kinetic_energy())[0] < 0.1 * work[2]


@pytest.mark.parametrize("actuator", [SmaPulse(PEAK), SmaWires(PEAK)], ids=["pulse", "wires"])
def test_who_asks_for_the_effort_changes_no_bit_and_who_does_not_is_told_nothing(actuator):
    asked, silent = powered(actuator=actuator), Simulator(powered(actuator=actuator).scene)
    for _ in range(2):
        told, untold = asked.stroke(COMMAND), silent.stroke(COMMAND)
    assert told.work[0] > 0.0 and told.peak_moment[0] > 0.0
    assert np.isnan(untold.work).all() and np.isnan(untold.peak_moment).all()
    np.testing.assert_array_equal(asked.q, silent.q)
    np.testing.assert_array_equal(asked.v, silent.v)


def test_pauses_copies_and_company_change_no_bit_of_the_effort():
    whole, parts = powered(), powered()
    copied, crowd = pickle.loads(pickle.dumps(whole)), Simulator(whole.scene, 11, 3, effort=True)
    _, in_parts = finished(parts.stroke_in_parts(COMMAND, 7))
    found = [in_parts, copied.stroke(COMMAND), crowd.stroke(np.repeat(COMMAND, 11, axis=0))]
    expected = whole.stroke(COMMAND)
    for report in found:
        assert (report.work == expected.work[0]).all() and (report.peak_moment == expected.peak_moment[0]).all()
