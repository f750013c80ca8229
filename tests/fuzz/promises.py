"""What the simulator promises of any scene that it accepts, as checks of a case; see scenes.py."""

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fuzz.frames import FRAMES, MOVING, REST, Frame, can_be_seen_from
from fuzz.scenes import IN_WATER, Case, Terms
from momenta import turned
from seastar_gym import Numerics, Scene, Simulator, SolverStatus, State, StrokeReport, UniformCurrent
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_limits, make_rods
from seastar_gym.rods.bundles import Rods
from seastar_gym.rods.step import SCHEMES
from seastar_gym.scene.number import side_by_side
from seastar_gym.simulator.drive import interval_times
from seastar_gym.simulator.report import MEASURED_IF_ASKED

FINEST = 4096
"""Steps are not cut finer than the nominal one over this."""

EPSILON = float(np.finfo(float).eps)

MOMENTUM_ROUNDING = 1e-11
"""Of a robot's mass times the largest speed of its nodes, and that at which they pass edges in a step."""

MOMENTUM_PER_TOLERANCE = 1e-5
"""Of a robot's mass times the speed that a Newton tolerance over a step is."""

ENERGY_ROUNDING = 1e-11
"""Growth in a step, of the energy before."""

FRAME_TOLERANCE = 100.0
"""Newton tolerances by which a robot may differ where it is seen from another frame."""

NUDGE, STEADY = 1e-13, 1e-8
"""Limb lengths by which nodes are nudged, and what a stroke that does not depend on rounding makes of it at most."""

FEW, MANY = 2, 16
"""Nudged twins. A step that the guard just takes or just refuses parts half of them, so two may miss it."""


def make(case: Case, robots: Iterable[int] | None = None, threads: int = 1) -> Simulator:
    """A simulator of the whole case, or of some of its robots, in their order; numbers of each robot go along."""
    chosen = np.arange(case.n_robots) if robots is None else np.asarray(list(robots))
    scene = case.scene
    if scene.n_robots is not None and robots is not None:
        scene = side_by_side([scene.of_robot(robot) for robot in chosen])
    simulator = Simulator(scene, len(chosen), threads, effort=True)
    simulator.set_state(case.state.of_robots(chosen))
    return simulator


def swim(case: Case, robots: Iterable[int] | None = None, threads: int = 1) -> tuple[list[np.ndarray], list[str]]:
    """All that is seen of robots after every stroke, arrays over robots, and the names of these arrays."""
    chosen = list(range(case.n_robots)) if robots is None else list(robots)
    simulator = make(case, robots, threads)
    seen, names = [], []
    for k, commands in enumerate(case.commands):
        report = simulator.stroke(commands[chosen])
        state = {name: part for name, part in simulator.get_state()._asdict().items() if part is not None}
        seen += [*state.values(), simulator.elastic_energy(), simulator.kinetic_energy(), *report]
        fields = (*state, "elastic energy", "kinetic energy", *StrokeReport._fields)
        names += [f"{name} after stroke {k + 1}" for name in fields]
    return seen, names


# --- any scene -------------------------------------------------------------------------------------------------------


def assert_told(simulator: Simulator, report: StrokeReport) -> None:
    """The state is finite, and every robot has arrived, or has failed with a sentence."""
    assert np.isfinite(simulator.positions).all() and np.isfinite(simulator.velocities).all()
    for name, values in report._asdict().items():
        assert np.isfinite(values).all() or name in MEASURED_IF_ASKED, name
    arrived, period = report.status == SolverStatus.CONVERGED, simulator.scene.actuator.period
    np.testing.assert_allclose(report.covered[arrived], period, rtol=1e-9)
    assert np.all(report.covered[~arrived] < period)
    np.testing.assert_array_equal(simulator.failed, ~arrived)
    for status in report.status:
        assert SolverStatus(status).sentence.endswith(".")


def assert_bounded(scene: Scene, report: StrokeReport) -> None:
    """No step is cut finer than documented, and no robot iterates for ever: a step that is begun is ended."""
    actuator = scene.actuator
    n_steps = len(interval_times(actuator.corners, scene.numerics.step, 0.0, actuator.period)) - 1
    last_step = 14 * scene.numerics.max_iterations * SCHEMES[scene.numerics.scheme].n_stages
    assert np.all(report.steps <= FINEST * n_steps)
    assert np.all(report.newton_iterations <= make_limits(scene).most_iterations + last_step)


def check_strokes_end(case: Case) -> None:
    """Every stroke ends in finite, converged states, or with a robot that is told to have failed; a reset heals it."""
    simulator = make(case)
    for commands in case.commands:
        report = simulator.stroke(commands)
        assert_told(simulator, report)
        assert_bounded(case.scene, report)
    failed = simulator.failed
    simulator.reset(failed)
    assert not simulator.failed.any()
    report = simulator.stroke(case.commands[0])
    assert_told(simulator, report)
    assert_bounded(case.scene, report)


# --- bits ------------------------------------------------------------------------------------------------------------


def assert_same_bits(found: list[np.ndarray], wanted: list[np.ndarray], names: list[str], where: str) -> None:
    for name, one, other in zip(names, found, wanted, strict=True):
        np.testing.assert_array_equal(one, other, err_msg=f"{name}, {where}")


def check_bits_alone(case: Case) -> None:
    """A robot alone and in the company of the others."""
    together, names = swim(case)
    for robot in range(case.n_robots):
        alone, _ = swim(case, [robot])
        assert_same_bits(alone, [values[robot : robot + 1] for values in together], names, f"robot {robot} alone")


def check_bits_in_other_lanes(case: Case) -> None:
    """A robot in another lane, beside others, and in a batch of several lane groups."""
    together, names = swim(case)
    order = [*np.roll(np.arange(case.n_robots), 1)[::-1], *np.arange(case.n_robots)] * 2
    shuffled, _ = swim(case, order[: 2 * N_LANES + 1])
    expected = [values[order[: 2 * N_LANES + 1]] for values in together]
    assert_same_bits(shuffled, expected, names, "in other lanes")


def check_bits_on_threads(case: Case) -> None:
    """A batch on one thread, on two and on three."""
    robots = np.resize(np.arange(case.n_robots), 2 * N_LANES + 1)
    one, names = swim(case, robots)
    for threads in (2, 3):
        assert_same_bits(swim(case, robots, threads)[0], one, names, f"on {threads} threads")


def check_bits_in_parts(case: Case) -> None:
    """A stroke that pauses, and one that goes on from a state that was kept."""
    whole, cut, kept = make(case), make(case), make(case)
    for commands in case.commands:
        whole.stroke(commands)
        for _ in cut.stroke_in_parts(commands, 7):
            pass
        if not kept.failed.any():
            kept.set_state(kept.get_state())
        kept.stroke(commands)
        np.testing.assert_array_equal(cut.failed, whole.failed)
        for simulator in (cut, kept):
            for name, one, other in zip(State._fields, simulator.get_state(), whole.get_state(), strict=True):
                np.testing.assert_array_equal(one, other, err_msg=name)


def check_bits_of_pieces(case: Case) -> None:
    """A stroke in two pieces, and one of which the second piece goes on from a state that was kept."""
    cut, kept = make(case), make(case)
    period = case.scene.actuator.period
    for commands, share in zip(case.commands, np.resize([0.31, 0.05, 0.77], len(case.commands)), strict=True):
        for simulator in (cut, kept):
            simulator.advance(share * period, commands)
        if not kept.failed.any():
            kept.set_state(kept.get_state())
        reports = [simulator.advance(period - share * period) for simulator in (cut, kept)]
        for name, one, other in zip(StrokeReport._fields, *reports, strict=True):
            np.testing.assert_array_equal(one, other, err_msg=name)
        for name, one, other in zip(State._fields, cut.get_state(), kept.get_state(), strict=True):
            if name != "time":  # the kept clock begins to count at the cut
                np.testing.assert_array_equal(one, other, err_msg=name)


# --- what stays ------------------------------------------------------------------------------------------------------


def in_vacuum(case: Case) -> Case:
    """The same robots, free and in vacuum."""
    scene = replace(case.scene, fluid=None, held_nodes=(), loads=())
    return case._replace(scene=scene)


def momenta(simulator: Simulator) -> tuple[np.ndarray, np.ndarray]:
    """Of every robot [kg m/s], shape (n_robots, 2), and its mass [kg]."""
    scene = simulator.scene
    rods = [make_rods(scene, robot if scene.n_robots else 0) for robot in range(simulator.n_robots)]
    masses = np.array([each.inertia.node[: scene.robot.n_nodes] for each in rods])
    of_nodes = np.einsum("rn,rnd->rd", masses, simulator.velocities)
    return of_nodes + turning_momenta(simulator, rods), masses.sum(axis=1)


def turning_momenta(simulator: Simulator, rods: list[Rods]) -> np.ndarray:
    """Of bodies that turn about their hubs [kg m/s], shape (n_robots, 2); zero without."""
    if not simulator.scene.robot.has_body:
        return np.zeros((len(rods), 2))
    turns = zip(rods, simulator.orientation(), simulator.spin(), strict=True)
    arms = [spin * turned(each.body.moment, angle) for each, angle, spin in turns]
    return np.array([(-y, x) for x, y in arms])


def check_momentum(case: Case) -> None:
    """Free robots in vacuum keep their momentum to rounding and the Newton tolerance, whatever a step needed."""
    case = in_vacuum(case)
    simulator, numerics = make(case), case.scene.numerics
    lengths = np.broadcast_to(np.asarray(case.scene.robot.limb_length, float), (case.n_robots,))
    for commands in case.commands:
        before, mass = momenta(simulator)
        speed, extent = (np.abs(one).max(axis=(1, 2)) for one in (simulator.velocities, simulator.positions))
        if simulator.scene.robot.has_body:
            speed = speed + np.abs(simulator.spin()) * simulator.scene.robot.body.shape.reach
        report = simulator.stroke(commands)
        after, _ = momenta(simulator)
        h = numerics.step / np.exp2(np.minimum(report.halvings, 12))
        rounding = MOMENTUM_ROUNDING * (speed + (lengths + extent + speed * simulator.stroke_time) / h)
        tolerated = MOMENTUM_PER_TOLERANCE * numerics.newton_tolerance * lengths / numerics.step
        drift = np.abs(after - before).max(axis=1) / mass
        assert np.all(drift <= rounding + tolerated), f"{drift} m/s"


PUT_BACK = 1e-11
"""Way of held nodes that a stroke's end takes back, of a limb's length: their mass is not infinite (HELD)."""


def energy_noise(simulator: Simulator, robot: int, energy: float, h: float) -> float:
    """What rounding of positions changes an energy by [J]: its slope times a move, and its curvature (guard.py).

    Newton's method stops at moves below its tolerance, which store energy, too: a robot without weight, whose drag
    has no curvature where it stands still, comes to rest in as many steps as halve its move.

    h: Of the shortest step [s]; velocities are differences of positions over it.
    """
    rods = make_rods(simulator.scene, robot if simulator.scene.n_robots else 0)
    length, mass = float(rods.scales.shortest_edge[0]), float(rods.scales.free_mass[0])
    stretching, bending = rods.stretching.EA_over_l.max(), rods.bending.EI_over_dl.max()
    stiffness = (len(rods.inertia.node) - 1) * float(stretching + 4.0 * bending / length**2)
    move = 10.0 * EPSILON * (float(np.abs(simulator.positions[robot]).max()) + (rods.edges_per_limb + 1) * length)
    if simulator.scene.held_nodes:
        move += PUT_BACK * (rods.edges_per_limb + 1) * length
    curvature = max(stiffness, mass / h**2)
    left = simulator.scene.numerics.newton_tolerance * (rods.edges_per_limb + 1) * length
    of_rounding = move * math.sqrt(2.0 * curvature) * math.sqrt(energy) + 0.5 * curvature * move**2
    return of_rounding + 0.5 * stiffness * left**2


def check_energy(case: Case) -> None:
    """Implicit Euler creates no energy in any step without commands, in vacuum or in water at rest.

    What contact and moving water store is not in the energies that a simulator tells of. Newton tolerances as loose as
    a thousandth of a limb leave residual forces that do work, so they are at most the default here. A robot that begins
    with a hinge folded to pi has no energy to begin with: the least nudge makes another one of it. Robots with a body
    are tried in vacuum: in water the guard looks at steps with much energy alone, as was measured without a body.
    """
    scene, fluid = case.scene, None if case.scene.robot.has_body else case.scene.fluid
    if fluid is not None:
        fluid = replace(fluid, current=None, added_mass_coefficient=None)
    tolerance = min(scene.numerics.newton_tolerance, Numerics().newton_tolerance)
    kept = {"step": scene.numerics.step, "max_iterations": scene.numerics.max_iterations}
    numerics = Numerics("implicit-euler", newton_tolerance=tolerance, **kept)
    scene = replace(scene, fluid=fluid, numerics=numerics, loads=(), contact=None)
    simulator = make(case._replace(scene=scene))
    at_rest = np.zeros_like(case.commands[0])
    before = simulator.elastic_energy() + simulator.kinetic_energy()
    robots, shortest = range(case.n_robots), numerics.step / FINEST
    nudge = make(nudged(case._replace(scene=scene), 0)).elastic_energy()
    rounding = np.array([energy_noise(simulator, robot, before[robot], shortest) for robot in robots])
    is_folded = nudge > 10.0 * before + 1000.0 * rounding
    for _ in simulator.stroke_in_parts(at_rest, 100):
        after = simulator.elastic_energy() + simulator.kinetic_energy()
        for robot in robots:
            noise = energy_noise(simulator, robot, before[robot], shortest)
            grown = after[robot] - before[robot] * (1.0 + ENERGY_ROUNDING)
            told = f"robot {robot}: from {before[robot]} to {after[robot]} J, noise {noise} J"
            assert is_folded[robot] or not grown > noise, told
        before = after


# --- frames ----------------------------------------------------------------------------------------------------------


class Swim(NamedTuple):
    """Positions over limb lengths after every stroke, shape (n_strokes, n_robots, n_nodes, 2), and every status."""

    positions: np.ndarray
    status: np.ndarray


def seen_from(frame: Frame, case: Case) -> Swim:
    """How the case swims, seen from the frame."""
    simulator, positions, status = make(case), [], []
    for commands in case.commands:
        status.append(simulator.stroke(commands).status)
        positions.append(frame.state(simulator.get_state(), case.scene).positions)
    lengths = np.broadcast_to(np.asarray(case.scene.robot.limb_length, float), (case.n_robots,))[:, None, None]
    return Swim(np.array(positions) / lengths, np.array(status))


def nudged(case: Case, seed: int) -> Case:
    """The same with rounding errors on its nodes, as other frames make."""
    noise = NUDGE * np.random.default_rng(seed).uniform(-1.0, 1.0, case.state.positions.shape)
    lengths = np.broadcast_to(np.asarray(case.scene.robot.limb_length, float), (case.n_robots,))[:, None, None]
    return case._replace(state=case.state._replace(positions=case.state.positions + lengths * noise))


def assert_alike(case: Case, frame: Frame) -> None:
    """The case as it would be in another frame swims as it does, seen from there, as far as rounding is not amplified.

    Robots whose stroke depends on rounding, as that of a compressed edge does that may give way to either side, are
    looked at until they do. Rounding may send one swim of a hundred another way, which is then either of the two: twins
    of both are asked.
    """
    own, other = seen_from(frame, case), seen_from(REST, frame.case(case))
    off = np.abs(other.positions - own.positions).max(axis=(2, 3))
    twins: list[Swim] = []
    for n_twins in (FEW, MANY):  # many only where few do not tell
        twins += [seen_from(frame, nudged(case, seed)) for seed in range(len(twins), n_twins)]
        allowed = FRAME_TOLERANCE * case.scene.numerics.newton_tolerance + 1000.0 * amplification(own, twins)
        is_alike = (other.status == own.status) & (off <= allowed) | ~steady(own, twins)
        if is_alike.all():
            return
    is_alike |= ~steady(other, [seen_from(REST, frame.case(nudged(case, seed))) for seed in range(MANY)])
    assert np.all((other.status == own.status) | is_alike), f"{frame.name}: {other.status} instead of {own.status}"
    assert is_alike.all(), f"{frame.name}: off by {off} limb lengths, allowed are {allowed}"


def amplification(swim: Swim, twins: list[Swim]) -> np.ndarray:
    """Largest distance of a twin from the swim over limb lengths, shape (n_strokes, n_robots)."""
    return np.max([np.abs(twin.positions - swim.positions) for twin in twins], axis=(0, 3, 4))


def steady(swim: Swim, twins: list[Swim]) -> np.ndarray:
    """Mask of the strokes up to which all twins swim as the swim does, shape (n_strokes, n_robots)."""
    is_alike = (amplification(swim, twins) < STEADY) & np.all([twin.status == swim.status for twin in twins], axis=0)
    return np.logical_and.accumulate(is_alike, axis=0)


def check_frames(case: Case) -> None:
    """Turned, mirrored with relabelled limbs, or elsewhere, a robot swims alike."""
    for frame in FRAMES:
        if can_be_seen_from(frame, case.scene):
            assert_alike(case, frame)


def check_moving_frame(case: Case) -> None:
    """Seen from a frame that moves, with the fluid and all velocities, free robots swim alike (Galilei).

    What does not flow is left out: a fluid at rest is none, any current a uniform one.
    """
    scene, fluid = case.scene, case.scene.fluid
    if fluid is not None:
        fluid = None if fluid.current is None else replace(fluid, current=UniformCurrent())
    case = case._replace(scene=replace(scene, fluid=fluid, held_nodes=()))
    if can_be_seen_from(MOVING, case.scene):
        assert_alike(case, MOVING)


PROMISES = {
    "strokes end": check_strokes_end,
    "bits alone": check_bits_alone,
    "bits in other lanes": check_bits_in_other_lanes,
    "bits on threads": check_bits_on_threads,
    "bits in parts": check_bits_in_parts,
    "bits of pieces": check_bits_of_pieces,
    "momentum": check_momentum,
    "energy": check_energy,
}
"""Of any case."""

TAME_PROMISES = {"frames": check_frames, "moving frame": check_moving_frame}
"""Of cases that are not wild: to a tolerance."""

WITHOUT: dict[str, Terms] = {
    "momentum": frozenset({*IN_WATER, "loads"}),
    "energy": frozenset({"current", "added mass", "loads", "contact"}),
}
"""Terms that a promise leaves out: with them, other machine code would be tried than that of the case."""
