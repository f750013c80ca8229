"""Robots of other shapes: one limb to twelve, uneven, tapered, curved; against the oracle and closed forms."""

import numpy as np
import pytest

import oracle
from oracle import Star
from seastar_gym import Limb, Numerics, Scene, Seastar, Simulator, SmaPulse, Water
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.symmetry import SymmetryReduction
from seastar_gym.model.rods import make_rods
from seastar_gym.scene.shape import rest_positions
from studies.verification.frequencies import fitted_frequency
from studies.verification.unactuated import let_pass, pause
from unlike import DIFFERENT, robot_and_star

CLAMP = (0, 1)
"""Held nodes: the limb is then clamped in the middle of its root edge, see studies/verification/unactuated.py."""

@pytest.mark.parametrize("name", DIFFERENT)
def test_rest_shape_and_coefficients_are_those_of_the_oracle(name):
    robot, star = robot_and_star(name)
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.0)))
    np.testing.assert_allclose(robot.nodes(), star.rest, atol=1e-15)
    np.testing.assert_allclose(rods.mass, star.masses, rtol=1e-13)
    np.testing.assert_allclose(rods.drag, star.drag, rtol=1e-13)


ACROSS = {"drag_coefficient": 1.3, "tangential_drag_coefficient": 0.2, "added_mass_coefficient": 0.8}
"""Coefficients of the fluid where flow across a limb has drag and mass of its own."""


@pytest.mark.parametrize("name", DIFFERENT)
def test_drag_and_mass_across_tapered_limbs_are_those_of_the_oracle(name):
    """Of half an edge, by the radius in its middle: for every node of its inner edge, then of its outer one."""
    robot, star = robot_and_star(name, **ACROSS)
    rods = make_rods(Scene(robot, Water(**ACROSS), SmaPulse(0.0)))
    for found, of_edges in ((rods.cross_drag, star.cross_drag), (rods.added_mass, star.added_mass)):
        expected = np.zeros((star.n_nodes, 2))
        for (tail, head), of_edge in zip(star.edges, of_edges, strict=True):
            expected[head, 0] = of_edge
            if tail > 0:
                expected[tail, 1] = of_edge
        np.testing.assert_allclose(found.reshape(-1, 2), expected, rtol=1e-13)


@pytest.mark.parametrize("name", DIFFERENT)
def test_a_robot_of_any_shape_rests_without_energy(name):
    robot, star = robot_and_star(name)
    assert oracle.elastic_energy(star, star.rest, np.zeros(star.n_limbs)) < 1e-25
    simulator = Simulator(Scene(robot, actuator=SmaPulse(0.0), numerics=Numerics(step=0.1)))
    simulator.stroke(np.zeros((1, robot.n_limbs)))
    np.testing.assert_allclose(simulator.positions[0], robot.nodes(), atol=1e-12)


def numbers(bundle) -> list:
    """All numbers and arrays of a bundle and of the bundles in it."""
    return [one for field in bundle for one in (numbers(field) if hasattr(field, "_fields") else [field])]


def test_limbs_with_nothing_of_their_own_are_the_robots_to_the_last_bit():
    plain, spelled_out = make_rods(Scene()), make_rods(Scene(Seastar(limbs=(Limb(),) * 5)))
    for one, other in zip(numbers(plain), numbers(spelled_out), strict=True):
        np.testing.assert_array_equal(one, other)
    evenly = tuple(Limb(2 * np.pi * j / 5, 0.1, 1.6e-3, (1e6, 1e6)) for j in range(5))
    for one, other in zip(numbers(plain), numbers(make_rods(Scene(Seastar(limbs=evenly)))), strict=True):
        np.testing.assert_allclose(np.asarray(one, float), np.asarray(other, float), rtol=1e-15)


# --- closed forms ----------------------------------------------------------------------------------------------------


def test_a_straight_limb_with_natural_curvature_relaxes_to_an_arc():
    curvature, robot = 8.0, Seastar(1, 21, limbs=(Limb(natural_curvature=8.0),))
    scene = Scene(robot, actuator=pause(8.0), numerics=Numerics(step=0.5, newton_tolerance=1e-12), held_nodes=CLAMP)
    simulator = Simulator(scene)
    straight = Seastar(1, 21).nodes()
    simulator.set_state((straight[None], np.zeros((1, 21, 2)), np.zeros(1)))
    let_pass(simulator)
    found = simulator.positions[0]
    # The circle through the middles of the edges has the curvature's radius, to second order in the edges.
    middles = 0.5 * (found[1:] + found[:-1])
    centre = np.array([middles[0, 0], 1.0 / curvature])
    np.testing.assert_allclose(np.linalg.norm(middles - centre, axis=1), 1.0 / curvature, rtol=2e-4)
    turn = np.diff(np.unwrap(np.arctan2(*np.diff(found, axis=0).T[::-1])))
    np.testing.assert_allclose(turn, curvature * 0.1 / 20, rtol=1e-6)


def test_a_tapered_cantilever_bends_as_a_cone_does():
    """A cone of root radius R and tip radius r under a tip load F: deflection F L^3/(3 E I_root) R/r, I of the root.

    The chapter's: a held edge clamps its limb in the middle. A rigid hub clamps limbs at their ends, see the next test.
    """
    load, errors = 1e-6, []
    for n in (6, 11, 21):
        robot = Seastar(1, n, limbs=(Limb(radius=(2e-3, 1e-3)),), discretisation="chapter")
        numerics = Numerics(step=0.5, newton_tolerance=1e-12)
        scene = Scene(robot, Water(), pause(8.0), numerics, held_nodes=CLAMP, loads=((n - 1, 0.0, load),))
        simulator = Simulator(scene)
        let_pass(simulator)
        clamp = 0.5 / (n - 1)  # of the length
        root, length = 2e-3 - 1e-3 * clamp, 0.1 * (1 - clamp)
        expected = load * length**3 / (3.0 * 1e6 * np.pi * root**4 / 4.0) * (root / 1e-3)
        errors.append(simulator.positions[0, -1, 1] / expected - 1.0)
    # Second order or better: with the clamp in the middle of an edge the hinges are midpoints of the integral.
    assert abs(errors[0]) < 2e-3 and abs(errors[1]) < abs(errors[0]) / 4 and abs(errors[2]) < abs(errors[1]) / 4


def test_limbs_in_line_bend_as_cantilevers_that_a_held_hub_clamps():
    """Both tips are loaded alike, so the hub does not turn; and the error is of second order or better."""
    load, errors = 1e-6, []
    for n in (6, 11, 21):
        robot = Seastar(2, n, limbs=(Limb(radius=(2e-3, 1e-3)),) * 2)
        numerics = Numerics(step=0.5, newton_tolerance=1e-12)
        loads = tuple((tip, 0.0, load) for tip in (n - 1, 2 * n - 2))
        simulator = Simulator(Scene(robot, Water(), pause(8.0), numerics, held_nodes=(0,), loads=loads))
        let_pass(simulator)
        expected = load * 0.1**3 / (3.0 * 1e6 * np.pi * 2e-3**4 / 4.0) * 2.0
        errors.append(simulator.positions[0, -1, 1] / expected - 1.0)
    assert abs(errors[0]) < 2e-3 and abs(errors[1]) < abs(errors[0]) / 4 and abs(errors[2]) < abs(errors[1]) / 4


IN_LINE = [Seastar(2, 21), Seastar(2, 21, hub_hinge="turning", discretisation="chapter")]


@pytest.mark.parametrize("robot", IN_LINE, ids=["rigid hub", "hub hinge"])
def test_two_limbs_in_line_ring_as_a_plain_free_rod(robot):
    """Lowest frequency of a free beam of length 2 L: 4.7300^2/(2 pi (2 L)^2) sqrt(EI/(rho A))."""
    expected = 4.73004**2 / (2 * np.pi * 0.2**2) * np.sqrt(1e6 * (1.6e-3) ** 2 / 4.0 / 1000.0)
    scene = Scene(robot, None, pause(4.0 / expected), Numerics("implicit-midpoint", 1 / (200 * expected)))
    simulator = Simulator(scene)
    q = simulator.positions
    q[0, :, 1] = 1e-5 * np.cos(np.pi * q[0, :, 0] / 0.2)
    simulator.set_state((q, np.zeros_like(q), np.zeros(1)))
    mass, signal, times = make_rods(scene).mass, [], []
    shape = np.cos(np.pi * robot.nodes()[:, 0] / 0.2) * mass
    shape -= mass * shape.sum() / mass.sum()
    for time in simulator.stroke_in_parts(np.zeros((1, 2)), 100):
        times.append(time)
        signal.append(shape @ simulator.positions[0, :, 1])
    assert fitted_frequency(np.array(times), np.array(signal), expected) == pytest.approx(expected, rel=3e-3)


def test_one_limb_swings_as_a_pendulum_about_its_held_hub():
    """A stiff limb under dead loads in vacuum, small angle: the period of a rigid body on a pin."""
    robot = Seastar(1, 6, youngs_modulus=1e9)
    rods = make_rods(Scene(robot, actuator=SmaPulse(0.0)))
    mass, edge_mass = rods.mass, rods.edge_mass.sum()
    loads = tuple((node, 9.81 * float(mass[node]), 0.0) for node in range(6))  # gravity along +x, the limb hangs
    x = robot.nodes()[:, 0]
    inertia = np.sum(mass * x**2) - edge_mass * robot.edge_length**2
    period = 2 * np.pi * np.sqrt(inertia / (9.81 * np.sum(mass * x)))
    numerics = Numerics("implicit-midpoint", period / 400, newton_tolerance=1e-10)
    simulator = Simulator(Scene(robot, None, pause(0.25 * period), numerics, held_nodes=(0,), loads=loads))
    angle = 0.01
    q = robot.nodes() @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    simulator.set_state((q[None], np.zeros((1, 6, 2)), np.zeros(1)))
    let_pass(simulator)
    assert abs(simulator.positions[0, -1, 1]) < 2e-3 * angle * 0.1  # a quarter period later it hangs straight


def test_a_gap_wider_than_pi_is_never_the_smallest_opening_angle():
    robot, _ = robot_and_star("a gap wider than pi")
    report = Simulator(Scene(robot, actuator=SmaPulse(0.1), numerics=Numerics(step=0.01))).stroke(np.zeros((1, 3)))
    assert report.smallest_opening_angle[0] == pytest.approx(1.0)


def test_a_mirrored_robot_swims_the_mirrored_way():
    lengths = (0.1, 0.08, 0.06, 0.06, 0.08)
    limbs = tuple(Limb(length=length, radius=(2e-3, 1e-3), natural_curvature=k)
                  for length, k in zip(lengths, (0.0, 3.0, -2.0, 2.0, -3.0), strict=True))  # fmt: skip
    simulator = Simulator(Scene(Seastar(limbs=limbs), numerics=Numerics("implicit-midpoint", 0.01)), 2)
    simulator.stroke([[0, 1, 0, 0, 0], [0, 0, 0, 0, -1]])
    np.testing.assert_allclose(simulator.positions[1, 0], simulator.positions[0, 0] * [1, -1], atol=1e-13)


# --- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"limbs": [Limb()] * 5}, "tuple of Limb"),
        ({"limbs": (Limb(),) * 4}, "one Limb for each"),
        ({"limbs": (Limb(direction=0.0), *(Limb(),) * 4)}, "Either every limb"),
        ({"limbs": tuple(Limb(direction=x) for x in (0.0, 2.0, 1.0, 3.0, 4.0))}, "increase"),
        ({"limbs": tuple(Limb(direction=x) for x in (0.5, 1.0, 2.0, 3.0, 4.0))}, "begin at 0"),
        ({"limbs": (Limb(natural_curvature=400.0),) * 5}, "too much for 12 nodes"),
        ({"n_limbs": 1, "hub_hinge": "turning", "discretisation": "chapter"}, "One limb"),
        ({"n_limbs": 0}, "from 1 to 12"),
    ],
)
def test_robots_that_cannot_be_are_refused_with_a_sentence(arguments, words):
    with pytest.raises(ValueError, match=words):
        Seastar(**arguments)


@pytest.mark.parametrize(
    "arguments",
    [
        {"direction": 7.0}, {"direction": -0.1}, {"radius": (1e-3, 0.0)}, {"radius": ()},
        {"youngs_modulus": (1e6, np.nan)},
    ],
)  # fmt: skip
def test_limbs_that_cannot_be_are_refused_with_a_sentence(arguments):
    with pytest.raises(ValueError, match=next(iter(arguments))):
        Limb(**arguments)


@pytest.mark.parametrize(
    "robot, peak, words",
    [
        (Seastar(1), 0.1, "One limb has no hub hinge"),
        (Seastar(2, discretisation="chapter"), 0.0, "turning"),
        (Seastar(2, hub_hinge="turning", discretisation="chapter"), 1.6, "above zero"),
        (robot_and_star("a gap wider than pi")[0], 0.5, "so spread"),  # 4.08 rad wide: -2.2 rad, 0.94 rad from the pole
    ],
)
def test_peak_angles_that_a_hub_cannot_follow_are_refused(robot, peak, words):
    with pytest.raises(ValueError, match=words):
        Scene(robot, actuator=SmaPulse(peak))


def test_the_rest_shape_of_the_plain_robot_is_that_of_the_oracle_for_one_limb_to_twelve():
    for n_limbs in range(1, 13):
        robot = Seastar(n_limbs)
        np.testing.assert_allclose(rest_positions(robot.limb_shapes(), 10, False), Star(n_limbs).rest, atol=1e-16)


# --- the environment -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n_limbs", [2, 4, 9, 12])
def test_the_environment_takes_robots_of_any_number_of_limbs(n_limbs):
    scene = Scene(Seastar(n_limbs, 4), actuator=SmaPulse(0.1), numerics=Numerics.preset("fast"))
    for actions in ("limbs", "pairs"):
        env = SeastarSwimEnv(scene=scene, actions=actions, render_mode="rgb_array")
        observation, _ = env.reset(seed=0)
        env.action_space.seed(0)
        assert env.observation_space.contains(observation) and observation.size == 36 * n_limbs + 6
        for _ in range(2):
            observation, reward, *_ = env.step(env.action_space.sample())
        assert np.isfinite(observation).all() and np.isfinite(reward)
        assert env.render().std() > 1.0
        env.close()


def test_one_limb_is_drawn_and_drifts():
    scene = Scene(Seastar(1), actuator=SmaPulse(0.0), numerics=Numerics.preset("fast"))
    env = SeastarSwimEnv(scene=scene, render_mode="rgb_array")
    env.reset(seed=0)
    env.step([0])
    assert env.render().std() > 1.0
    env.close()


def test_whole_commands_of_more_than_eight_limbs_are_refused():
    scene = Scene(Seastar(9), actuator=SmaPulse(0.1))
    with pytest.raises(ValueError, match="19,683 actions"):
        SeastarSwimEnv(scene=scene, actions="joint")


@pytest.mark.parametrize(
    "limbs",
    [
        (Limb(length=0.08), Limb(length=0.09), *(Limb(),) * 3),
        (Limb(natural_curvature=1.0), *(Limb(),) * 4),
        tuple(Limb(direction=j) for j in (0.0, 1.0, 2.0, 3.5, 4.0)),
    ],
)
def test_symmetry_is_refused_for_robots_without_it(limbs):
    robot = Seastar(limbs=limbs)
    assert not robot.is_symmetric
    with pytest.raises(ValueError, match="neither the symmetry of the regular polygon nor a lesser one"):
        SymmetryReduction(SeastarSwimEnv(scene=Scene(robot, actuator=SmaPulse(0.1))))


def test_robots_whose_limbs_taper_alike_are_symmetric():
    assert Seastar(limbs=(Limb(radius=(2e-3, 1e-3)),) * 5).is_symmetric and Seastar(4).is_symmetric
