"""Every term of a stage, alone and with others, in plain Python: potential, slopes and Hessian are a dense oracle's.

The oracle is shown to have the derivatives of its energies in tests/test_oracle.py; here, the kernels have those of
theirs. Rows of other rooms: test_body.py, test_contact.py.
"""

from typing import Any, NamedTuple

import numpy as np
import pytest

import oracle
from continuum_oracle import Bent, Continuum, ContinuumShaped
from currents import CURRENTS, velocity
from hubs import HUBS, robot_with
from oracle import Star
from seastar_gym import AlongLimb, Body, Limb, Scene, Seastar, SmaPulse, Stiffening, Water
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.body import place_roots
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.linear import solve_again, substitute_star
from seastar_gym.rods.potential import elastic_energy, energies, factorise, fill_moments
from seastar_gym.rods.terms.along import add_moved_energy
from seastar_gym.rods.terms.current import GRID, Current, current_velocity
from seastar_gym.rods.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.rods.terms.inertia import kinetic_energy
from slopes import gradient, plain, rows
from stages import RandomStages, robot_and_star, rods_of
from unlike import DIFFERENT
from unlike import robot_and_star as unlike_limbs

ACROSS = {"drag_coefficient": 1.3, "tangential_drag_coefficient": 0.1}
MASS, DAMPING = {"added_mass_coefficient": 0.8}, {"relaxation_time": 4e-3}
PULLED = {"gravity": (1.0, -9.81), "loads": ((3, 1e-3, -2e-3), (3, 1e-3, 0.0), (1, 0.0, 1e-3))}
SHAPES = [(5, 10), (5, 2), (3, 3), (4, 4), (6, 5), (12, 3)]
"""(n_limbs, nodes_per_limb)"""


class Term(NamedTuple):
    """A scene for the kernels and for the oracle."""

    scene: Scene
    star: Star


def scene_of(robot: Seastar, water: dict[str, Any] | None, gravity=None, loads=()) -> Scene:
    fluid = None if water is None else Water(**water)
    pulse = SmaPulse(0.1 if robot.n_limbs > 1 else 0.0)  # one limb has nothing to turn against
    return Scene(robot, fluid, pulse, gravity=gravity, loads=loads)


def alike(hub="rigid", n_limbs=5, nodes_per_limb=4, current=None, relaxation_time=None, vacuum=False, **terms) -> Term:
    """Equal limbs. terms: Of `Water`, gravity and loads."""
    shape = {"n_limbs": n_limbs, "nodes_per_limb": nodes_per_limb}
    pull = {name: terms.pop(name) for name in PULLED if name in terms}
    flow = {} if current is None else {"current": lambda places: velocity(current, places)}
    of_hub = {} if hub == "rigid" else {"hub_hinge": hub}
    star = (Continuum if hub == "rigid" else Star)(
        **shape, **of_hub, **flow, **pull, relaxation_time=relaxation_time or 0.0,
        **{"fluid_density" if name == "density" else name: value for name, value in terms.items()},
        **{"drag_coefficient": 0.0, "fluid_density": 0.0} if vacuum else {},
    )  # fmt: skip
    water = None if vacuum else {"current": CURRENTS.get(current)} | terms
    return Term(scene_of(robot_with(hub, **shape, relaxation_time=relaxation_time), water, **pull), star)


def unlike(name: str) -> Term:
    """Limbs that taper, bend and differ, with the chapter's hinges, and terms that look at each edge's radius."""
    robot, star = unlike_limbs(name, 4, fluid_density=950.0, **ACROSS, **MASS, **PULLED)
    return Term(scene_of(robot, {"density": 950.0} | ACROSS | MASS, **PULLED), star)


def curved(bent: bool = False) -> Term:
    """Limbs that taper, curve and differ on a rigid hub; bent: Whose actuators bend them along their length."""
    profile = (1.0, 3.0, 0.5)
    shapes = [(2.0 * k, 0.1 - 0.01 * k, (2e-3, 1e-3 + 2e-4 * k), (1e6, 8e5), (4.0, 0.0, -3.0)[k]) for k in range(3)]
    directions, lengths, radii, moduli, curvatures = zip(*shapes, strict=True)
    own, actuators = {}, {}
    if bent:
        actuators = {"along": AlongLimb(0.8, profile), "stiffening": Stiffening(2.5, 0.4, 0.1)}
        own = {"profile": lambda s: np.interp(s, (0.0, 0.5, 1.0), profile), "share": 0.8, "peak": 0.1}
        own |= {"ratio": 2.5, "middle": 0.4, "width": 0.1}
    star = (Bent if bent else ContinuumShaped)(
        3, 4, directions=directions, lengths=lengths, radii=radii, moduli=moduli, curvatures=curvatures,
        **ACROSS, **MASS, **DAMPING, **own,
    )  # fmt: skip
    robot = Seastar(3, 4, limbs=tuple(Limb(*shape) for shape in shapes), **DAMPING, **actuators)
    return Term(scene_of(robot, ACROSS | MASS), star)


EVERYTHING = {"density": 950.0, "drag_coefficient": 1.3, **MASS, **DAMPING, **PULLED}
TERMS = {
    **{f"{hub} hub, {n} x {m}": alike(hub, n, m) for hub in HUBS for n, m in SHAPES},
    **{f"rigid hub, {n} x {m}": alike("rigid", n, m) for n, m in ((1, 4), (2, 3), (3, 2))},
    **{f"{hub} hub in vacuum": alike(hub, 5, 10, vacuum=True) for hub in HUBS},
    **{f"damping, {hub} hub": alike(hub, 3, **DAMPING) for hub in HUBS},
    "damping that is none": alike(n_limbs=3, relaxation_time=0.0),
    "drag along limbs": alike(n_limbs=3, **ACROSS),
    "drag across limbs alone": alike(n_limbs=3, tangential_drag_coefficient=0.0),
    "added mass": alike(n_limbs=3, **MASS),
    "weight and loads": alike(n_limbs=3, density=950.0, **PULLED),
    **{
        f"everything, {current}, {hub} hub": alike(hub, current=current, tangential_drag_coefficient=C_t, **EVERYTHING)
        for hub in HUBS[:2]
        for current, C_t in (("uniform", 0.0), ("shear", 0.02), ("vortex", 0.1), ("grid", 1.3))
    },
    "everything, 2 x 3": alike("rigid", 2, 3, current="shear", tangential_drag_coefficient=0.02, **EVERYTHING),
    "everything, 3 x 2": alike("rigid", 3, 2, current="vortex", tangential_drag_coefficient=1.3, **EVERYTHING),
    **{name: unlike(name) for name in DIFFERENT},
    "curved limbs": curved(),
    "limbs bent along": curved(bent=True),
}  # fmt: skip
EVERY_TERM, EVERY_HUB = pytest.mark.parametrize("name", TERMS), pytest.mark.parametrize("hub", HUBS)


# The table


@EVERY_TERM
@pytest.mark.parametrize("gamma", [1e-3, 1e-2])
def test_potential_step_and_decrement_are_those_of_the_oracle(name, gamma):
    """The potential falls along the step, which is taken whole, as fast as the decrement says: its own slope, too."""
    (scene, star), stages = TERMS[name], RandomStages(TERMS[name].star, gamma, bend=0.05)
    rods = make_rods(scene)
    found, few = stages.run(rods), star.n_limbs < 3 or star.nodes_per_limb < 3
    for lane in range(N_LANES):
        assert found.phi[lane] == pytest.approx(stages.phi(lane), rel=1e-12)
        stages.assert_step(found, lane, stages.hessian(lane), 1e-10 if few else 1e-11)
    np.testing.assert_allclose(found.moved, -found.direction, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose(found.largest, np.linalg.norm(found.direction, axis=2).max(axis=1), rtol=1e-14)
    ahead, behind = (stages.run(rods, q=stages.q + share * found.direction).phi for share in (-1e-4, 1e-4))
    np.testing.assert_allclose((behind - ahead) / 2e-4, found.decrement, rtol=1e-4)


@EVERY_TERM
def test_other_right_hand_sides_are_solved_with_the_oracles_matrix(name):
    """As sensitivities are, and contact; the solution found last is the one that is written."""
    rods, stages = make_rods(TERMS[name].scene), RandomStages(TERMS[name].star, 1e-3, bend=0.05)
    work, stage = stages.begin(rods, again=True)
    factorise(rods, work, stage, None)
    r, (x, written) = np.random.default_rng(0).standard_normal(work.q.shape), np.zeros((2, *work.q.shape))
    solve_again(rods, work, r, x)
    for lane in range(N_LANES):
        expected = np.linalg.solve(stages.hessian(lane), r[:, lane])
        np.testing.assert_allclose(x[:, lane], expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())
    substitute_star(rods, work, written)
    np.testing.assert_array_equal(written, x)


@EVERY_TERM
def test_energies_of_a_state_are_those_of_the_oracle_at_the_rotations_of_its_limbs(name):
    scene, star = TERMS[name]
    rods, stages = make_rods(scene), RandomStages(star, 1.0, bend=0.3)
    v, (elastic, kinetic) = np.random.default_rng(1).standard_normal(stages.q.shape), np.zeros((2, 1, N_LANES))
    actuation = Actuation(np.zeros((star.n_limbs, N_LANES)), stages.delta_psi.T.copy())
    getattr(energies, "py_func", energies)(
        rods, make_work(rods, 1), actuation, rows(stages.q), rows(v), elastic, kinetic
    )
    for lane in range(N_LANES):
        expected = oracle.elastic_energy(stages.star_of(lane)[0], stages.q[lane], stages.star_of(lane)[1])
        assert elastic[0, lane] == pytest.approx(expected, rel=1e-10)
        assert kinetic[0, lane] == pytest.approx(oracle.kinetic_energy(star, v[lane]), rel=1e-12)
    frame = (0.3, -0.7)
    seen = plain(kinetic_energy(rods, rows(v), frame))
    np.testing.assert_allclose(seen, [oracle.kinetic_energy(star, one - frame) for one in v], rtol=1e-12)


@EVERY_TERM
def test_a_robot_that_rests_stays(name):
    """With no flow past it, whose drag has no direction; but for weight and currents."""
    scene, star = TERMS[name]
    stages = RandomStages(star, 1e-2)
    stages.q[:] = stages.frozen[:] = stages.q_hat[:] = scene.robot.nodes()
    stages.v_hat[:], stages.delta_psi[:] = 0.0, 0.0
    found = stages.run(make_rods(scene))
    assert np.isfinite(found.direction).all() and np.all(found.pivot > 0.0)
    if star.current is None and not np.any(star.gravity):
        assert np.abs(found.phi).max() < 1e-25 and found.largest.max() < 1e-13


@EVERY_TERM
def test_a_regularised_matrix_is_positive_definite_however_wild_robots_are(name):
    """It is the sum of the convex parts, of the robots that are asked about alone; damping has none of its own."""
    scene, star = TERMS[name]
    stages = RandomStages(star, 0.05, bend=0.8, stretch=0.2, speed=1.0)
    asked = np.arange(N_LANES) % 2 == 0
    found = stages.run(make_rods(scene), Mask(asked))
    assert np.all(found.pivot[asked] > 0.0) and np.all(found.decrement[asked] > 0.0)
    if star.relaxation_time == 0.0:
        for lane in range(N_LANES):
            if found.pivot[lane] > 0.0:
                stages.assert_step(found, lane, stages.hessian(lane, convex=asked[lane]), 1e-8)


@EVERY_HUB
@pytest.mark.parametrize("gamma", [3e-3, 4e-3, 5e-3])
def test_smallest_pivot_is_positive_exactly_where_the_hessian_is_positive_definite(hub, gamma):
    robot, star = robot_and_star(5, 4, hub)
    definite = []
    for seed in range(64 // N_LANES):
        stages = RandomStages(star, gamma, bend=0.3, stretch=0.02, seed=seed)
        found = stages.run(rods_of(robot))
        smallest = [np.linalg.eigvalsh(stages.hessian(lane))[0] for lane in range(N_LANES)]
        np.testing.assert_array_equal(found.pivot > 0.0, np.array(smallest) > 0.0)
        definite += list(found.pivot > 0.0)
    assert 0 < sum(definite) < len(definite)


def test_a_matrix_that_is_not_a_number_does_not_pass_for_positive_definite():
    robot, star = robot_and_star(5, 4)
    for node in range(star.n_nodes):
        stages = RandomStages(star, 1e-3)
        stages.q[1, node] = np.nan
        found = stages.run(rods_of(robot))
        assert not found.pivot[1] > 0.0
        others = np.arange(N_LANES) != 1
        assert np.all(found.pivot[others] > 0.0) and np.isfinite(found.direction[others]).all()


# Actuators


ACTUATED = {
    "rigid hub": Seastar(3, 4),
    "limbs bent": Seastar(3, 4, limbs=tuple(Limb(natural_curvature=k) for k in (4.0, 0.0, -3.0))),
    "bent along": Seastar(3, 4, along=AlongLimb(0.7, (1.0, 3.0, 0.5))),
    "bent along and stiffer": Seastar(3, 4, along=AlongLimb(0.7), stiffening=Stiffening(2.5, 0.4, 0.1)),
    "stiffer only": Seastar(3, 4, stiffening=Stiffening(2.5, 0.4, 0.1)),
    "body": Seastar(3, 4, body=Body(radius=0.02)),
    "opening": robot_with("opening", n_limbs=4, nodes_per_limb=4),
    "turning": robot_with("turning", nodes_per_limb=4),
    "one hub hinge": robot_with("turning", n_limbs=2, nodes_per_limb=4),
}


@pytest.mark.parametrize("name", ACTUATED)
def test_the_moment_that_resists_an_actuator_is_the_slope_of_the_energy_in_its_rotation(name):
    robot = ACTUATED[name]
    rods, rng = make_rods(Scene(robot, actuator=SmaPulse(0.3))), np.random.default_rng(0)
    q = rows(robot.nodes() + 2e-3 * rng.standard_normal((robot.n_nodes, 2)))
    if robot.has_body:
        q = np.vstack([q, np.full((1, N_LANES), 2e-3), np.zeros((1 + 2 * robot.n_limbs, N_LANES))])
        place_roots(rods, q)
    work, turns, moments = make_work(rods, 1), rng.uniform(-0.2, 0.2, robot.n_limbs), np.zeros((robot.n_limbs, N_LANES))

    def actuation(turns):
        return Actuation(*(np.tile(turns[:, None], N_LANES) for _ in range(2)))

    def energy(turns):
        set_natural_hub_angles(rods, work, actuation(turns), Lanes(0.0))
        return plain(elastic_energy(rods, work, q))[0]

    fill_moments(rods, work, actuation(turns), q, moments)
    np.testing.assert_allclose(moments[:, 0], gradient(energy, turns, 1e-3), rtol=1e-6)


# Currents: velocities of the fluid at places, from the numbers of each kind


PLACES = np.random.default_rng(0).uniform(-0.4, 0.4, (2, 80))


def current_at(current: Current, places: np.ndarray) -> np.ndarray:
    return np.array(plain(current_velocity(current, *map(Lanes, places))))


def grid(function, n_x: int = 9, n_y: int = 7, spacing: float = 0.125) -> Current:
    """Samples of a current on points from (-0.5, -0.375) on."""
    x, y = -0.5 + spacing * np.arange(n_x), -0.375 + spacing * np.arange(n_y)
    samples = np.stack(function(*np.meshgrid(x, y, indexing="ij")), axis=-1)
    return Current(GRID, np.array([-0.5, -0.375, 1.0 / spacing]), n_x, n_y, samples.ravel())


def bilinear(x, y):
    return 0.1 + 0.3 * x - 0.5 * y + 2.0 * x * y, 0.2 * x + 0.05 * y


def test_a_grid_is_bilinear_between_its_samples_and_that_of_the_nearest_edge_beyond():
    """It is continuous across its cells, and what is no place is the first point."""
    current, inside = grid(bilinear), PLACES[:, np.abs(PLACES[1]) < 0.375]
    np.testing.assert_allclose(current_at(current, inside), bilinear(*inside), rtol=0.0, atol=1e-14)
    outside = np.array([[-9.0, 0.2, 9.0, np.nan], [0.1, 9.0, -9.0, np.nan]])
    nearest = np.array([[-0.5, 0.2, 0.5, -0.5], [0.1, 0.375, -0.375, -0.375]])
    np.testing.assert_allclose(current_at(current, outside), bilinear(*nearest), rtol=0.0, atol=1e-14)

    def rough(x, y):
        return np.sin(40.0 * x + y), np.cos(30.0 * y)

    border = np.array([np.full(7, 0.125), np.linspace(-0.375, 0.375, 7)])
    beside = np.array([[1e-12], [0.0]])
    for side in (border - beside, border, border + beside):
        np.testing.assert_allclose(current_at(grid(rough), side), rough(*border), atol=1e-9)


# Actuators that act along limbs: natural curvature, stiffness, and the energy that moving them stores


PEAK, RATIO, CURVATURES = 1.1, 2.5, (4.0, 0.0, -3.0)
PROFILE = (1.0, 3.0, 0.5)
ROBOT = Seastar(
    3, 5, limbs=tuple(Limb(natural_curvature=k) for k in CURVATURES),
    along=AlongLimb(0.8, PROFILE), stiffening=Stiffening(RATIO, 0.4, 0.1),
)  # fmt: skip
RODS = make_rods(Scene(ROBOT, actuator=SmaPulse(PEAK)))
STAR = Bent(
    3, 5, directions=(0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0), lengths=(0.1,) * 3, radii=((1.6e-3,) * 2,) * 3,
    moduli=((1e6,) * 2,) * 3, curvatures=CURVATURES, share=0.8, ratio=RATIO, middle=0.4, width=0.1, peak=PEAK,
    profile=lambda s: np.interp(s, (0.0, 0.5, 1.0), PROFILE),
)  # fmt: skip
BEGIN, END = np.array([0.2, -1.0, 0.0]), np.array([0.9, -0.4, 0.5])


def actuation(begin: np.ndarray, end: np.ndarray) -> Actuation:
    return Actuation(*(np.tile(turns[:, None], N_LANES) for turns in (begin, end)))


def memory(turns: np.ndarray):
    work = make_work(RODS, 1)
    set_natural_hub_angles(RODS, work, actuation(0.0 * turns, turns), Lanes(1.0))
    return work


# Profiles


@pytest.mark.parametrize("profile", [1.0, (1.0, 0.0), PROFILE, (0.0, 1.0, 2.0, 1.0, 0.0, -0.2), (1.0, *(0.0,) * 9)])
@pytest.mark.parametrize("nodes", [2, 5, 11])
def test_hinges_turn_by_the_hat_functions_of_the_profile(profile, nodes):
    points = profile if isinstance(profile, tuple) else (profile, profile)
    star = Bent(1, nodes, share=0.6, profile=lambda s: np.interp(s, np.linspace(0.0, 1.0, len(points)), points))
    found = AlongLimb(0.6, profile).hinge_shares(nodes)
    np.testing.assert_allclose(found, star.shares, rtol=0.0, atol=1e-9)


# Energy


def test_what_moving_natural_curvature_stores_is_the_energy_of_the_hinges_left_behind():
    work = memory(0.0 * END)
    moved = plain(add_moved_energy(RODS, work, actuation(BEGIN, END), Lanes(0.0), Lanes(1.0), 0.0))
    begin, end = STAR.at(BEGIN), STAR.at(END)
    expected = sum(
        0.5 * max(f) / f[1] * EI * dl * (oracle.curvature(b, dl) - oracle.curvature(a, dl)) ** 2
        for a, b, EI, dl, f in zip(
            begin.inner_angles, end.inner_angles, end.hinge_EI, end.hinge_dl,
            np.repeat(np.stack([begin.factors, end.factors], axis=1), 3, axis=0), strict=True,
        )
    )  # fmt: skip
    np.testing.assert_allclose(moved, expected, rtol=1e-9)
    np.testing.assert_allclose(work.along.EI_kappa_bar, memory(END).along.EI_kappa_bar, rtol=1e-14)


# Coefficients


@pytest.mark.parametrize("nodes", [2, 3, 5, 10])
def test_kinetic_energy_is_positive_however_limbs_taper(nodes):
    """Coarse limbs of very different radii once had a negative one."""
    rng = np.random.default_rng(nodes)
    for _ in range(50):
        limbs = tuple(Limb(radius=tuple(10.0 ** rng.uniform(-4, -2, rng.integers(2, 6)))) for _ in range(3))
        rods = make_rods(Scene(Seastar(n_limbs=3, nodes_per_limb=nodes, limbs=limbs)))
        matrix = np.diag(rods.inertia.node.copy())  # lumped masses, less what edges have less
        for e, mu in enumerate(rods.inertia.edge):
            matrix[np.ix_(*[[0 if e % (nodes - 1) == 0 else e, e + 1]] * 2)] -= mu * np.array(
                [[1.0, -1.0], [-1.0, 1.0]]
            )
        assert matrix.sum() == pytest.approx(rods.inertia.node.sum())
        assert np.linalg.eigvalsh(matrix).min() > 0.0
