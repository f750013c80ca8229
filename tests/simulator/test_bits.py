"""A robot has the same bits alone, in any company, lane and thread, with pauses, from a copy and on another device;
every kind of scene and every option is asked once, by name. Random scenes are asked the same in tests/fuzz."""

import os
import pickle
import subprocess
import sys
from dataclasses import replace
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest

from currents import NONE
from hubs import TEN
from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    Limb,
    Numerics,
    Scene,
    Seastar,
    ShearCurrent,
    Simulator,
    SmaPulse,
    SmaWires,
    SolverStatus,
    State,
    Stiffening,
    Strip,
    ThermalSma,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.scene.number import side_by_side
from seastar_gym.simulator import batch
from seastar_gym.simulator.report import MEASURED_IF_ASKED
from simulator.test_conservation import CURLED
from simulator.test_intervals import ALL
from strokes import finished

pytestmark = pytest.mark.filterwarnings("ignore:Limbs of robot:RuntimeWarning")

SCHEMES = "implicit-euler", "sdirk2", "implicit-midpoint"
MIDPOINT = Numerics("implicit-midpoint", 0.01)
FAST = Scene.preset("fast")
NASTY = "at rest", "shifted", "coinciding", "fast", "crossed", "crumpled", "far out", "no number"


class Row(NamedTuple):
    """A scene, states of its robots at the start, in turn, and whether errors are estimated, from rest."""

    scene: Scene
    starts: tuple[str, ...] = ("moving",)
    error_bars: bool = False
    n_robots: int = 2 * N_LANES + 3


def brief(numerics: Numerics, robot: Seastar = TEN, **terms) -> Scene:
    """A scene whose strokes take four steps."""
    pulse = SmaPulse(0.5, 2.0 * numerics.step, 2.0 * numerics.step)
    return Scene(robot, actuator=pulse, numerics=replace(numerics, max_iterations=20), **terms)


def corners(*places: tuple[float, float]) -> tuple[Attachment, ...]:
    """Limbs that leave a body away from its hub."""
    return tuple(Attachment(x, y, float(np.arctan2(y, x))) for x, y in places)


FLUID = Water(1000.0, 1.0, 0.1, UniformCurrent(0.1, -0.05), 1.0)
ON_BODY = Seastar(4, 5, body=Body.rectangle(
    0.06, 0.03, attachments=corners((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015), (0.03, -0.015))
))  # fmt: skip
OF_EACH = replace(FAST.robot, youngs_modulus=np.geomspace(5e5, 1.9e6, 2 * N_LANES + 3))
TERMS = {
    "plain": {},
    "touching": {"contact": Contact()},
    "every term": {
        "robot": Seastar(n_limbs=4, nodes_per_limb=6, relaxation_time=1e-4),
        "fluid": FLUID, "contact": Contact(), "loads": ((7, 1e-3, 2e-3),),
    },
}  # fmt: skip
LONG = brief(Numerics("implicit-euler", 5e-3), Seastar(nodes_per_limb=40), contact=Contact())
ROWS = {
    "default strokes": Row(Scene(TEN, numerics=MIDPOINT)),
    "wires": Row(Scene(TEN, actuator=SmaWires(), numerics=MIDPOINT)),
    "contact": Row(Scene(TEN, actuator=SmaPulse(0.75), numerics=MIDPOINT, contact=Contact(layer=10e-3))),
    "body": Row(Scene(ON_BODY, numerics=MIDPOINT)),
    "current": Row(Scene(Seastar(nodes_per_limb=10, relaxation_time=1e-4), FLUID, numerics=MIDPOINT)),
    "sections": Row(Scene(Seastar(nodes_per_limb=10, limbs=(Limb(section=Strip(2e-3, 8e-3)),) * 5), numerics=MIDPOINT)),
    **{f"{name} actuator": Row(replace(FAST, actuator=each)) for name, each in ALL.items() if name != "wires"},
    "error bars": Row(FAST, (), True),
    "error bars, contact": Row(replace(FAST, contact=Contact()), (), True),
    "error bars, thermal": Row(replace(FAST, actuator=ThermalSma()), (), True),
    "error bars, body": Row(Scene(ON_BODY, numerics=FAST.numerics), (), True),
    "error bars, each its own": Row(replace(FAST, robot=OF_EACH), (), True),
    **{f"nasty, {name}, {scheme}": Row(brief(Numerics(scheme, 5e-3), **terms), NASTY)
       for (name, terms), scheme in product(TERMS.items(), SCHEMES)},
    "nasty, long steps": Row(brief(Numerics("sdirk2", 0.02)), NASTY),
    # Chains too long for all pairs of node and edge at once; pairs near a robot are counted robot by robot.
    "long chains that touch": Row(LONG, ("shifted", *["crumpled"] * (N_LANES - 2), "crossed"), n_robots=N_LANES),
    "limbs pressed onto a body": Row(
        Scene(CURLED, actuator=SmaPulse(0.8), numerics=Numerics("implicit-midpoint", 5e-3, 1e-9), contact=Contact())
    ),
    # A device's code is that of one mesh: `python -m studies.gpu` has all others. Its last group of robots is not full.
    "small mesh": Row(
        Scene(Seastar(nodes_per_limb=4), actuator=SmaPulse(0.4), numerics=FAST.numerics), (), True, n_robots=35
    ),
}  # fmt: skip
SLOW = ("limbs pressed onto a body",)


def start(kind: str, robot: Seastar, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """(positions, velocities) of a robot, shape (n_nodes, 2)."""
    q, edge = robot.nodes(), robot.edge_length
    v = 0.05 * rng.standard_normal(q.shape)
    match kind:
        case "shifted":
            q = q + edge * rng.uniform(-1.0, 1.0, q.shape)
        case "coinciding":
            first, second = rng.permutation(len(q))[: 2 * (len(q) // 4)].reshape(2, -1)
            q[first] = q[second]
        case "fast":
            v *= 10.0 ** rng.uniform(0.0, 5.0)
        case "crossed":
            limb, angle = slice(1, robot.nodes_per_limb), rng.uniform(1.0, 2.0)
            q[limb] = q[limb] @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        case "crumpled":
            q = edge * rng.uniform(-1.0, 1.0, q.shape)
        case "far out":
            q = q + 10.0 ** rng.uniform(0.0, 8.0) * rng.standard_normal(q.shape)
    return q, v


def make(row: Row, robots: np.ndarray, threads: int = 1, measured: bool = True, device: str = "cpu") -> Simulator:
    """Some of the row's robots, in this order, at rest. measured: Whether errors, work and energies are."""
    scene = row.scene
    if scene.n_robots is not None:
        scene = side_by_side([scene.of_robot(robot) for robot in robots])
    try:
        simulator = Simulator(scene, len(robots), threads, row.error_bars and measured, measured, device)
    except ValueError as no_gpu:
        if device != "cuda":
            raise
        pytest.skip(str(no_gpu))
    assert simulator.threads == min(threads, -(-len(robots) // N_LANES))
    if not measured:
        simulator._watches.pop("energy_growth", None)
    return simulator


def swim(row: Row, robots=None, advance=Simulator.advance, between=lambda simulator: simulator, used=False, **options):
    """All that is seen of robots after a stroke, one in two pieces, and another, arrays over robots by name.

    used: Whether the simulator swam before, and was reset. between: What is done after each of these intervals.
    """
    n, n_limbs, period = row.n_robots, row.scene.robot.n_limbs, row.scene.actuator.period
    robots, rng = np.arange(n) if robots is None else robots, np.random.default_rng(0)
    simulator = make(row, robots, **options)
    whole = rng.integers(-1, 2, (3, n, n_limbs)).astype(float)
    commands = np.where(rng.random(whole.shape) < 0.5, whole, rng.uniform(-1.0, 1.0, whole.shape))
    if used:
        simulator.stroke(commands[2][robots])
        simulator.reset()
    if row.starts:
        kinds = np.resize(row.starts, n)
        q, v = (np.stack(part)[robots] for part in zip(*(start(k, row.scene.robot, rng) for k in kinds), strict=True))
        simulator.set_state(State(q, v, np.zeros(len(robots))))
        for k in np.flatnonzero(kinds[robots] == "no number"):
            simulator.q[k // N_LANES, 3, k % N_LANES] = np.nan
    found = []
    for duration, given in (
        (period, commands[0]), (0.3 * period, commands[1]), (period - 0.3 * period, None), (period, commands[2]),
    ):  # fmt: skip
        report = advance(simulator, duration, None if given is None else given[robots])
        simulator = between(simulator)
        state = {name: part for name, part in simulator.get_state()._asdict().items() if part is not None}
        energies = {"elastic": simulator.elastic_energy(), "kinetic": simulator.kinetic_energy()}
        found.append({**state, **energies, "failed": simulator.failed, **report._asdict()})
    return found


@cache
def expected(name):
    """What a row's robots do, who would show nothing if all did the same, or failed, or none that should fail did."""
    row, found = ROWS[name], swim(ROWS[name])
    last = found[-1]
    assert len(np.unique(last["positions"], axis=0)) > 1 and (last["status"] == 0).any()
    assert ("no number" in row.starts) == (last["status"] == SolverStatus.NOT_FINITE).any()
    assert len(row.starts) > 1 or not last["failed"].any()
    return found


def in_parts(simulator, duration, commands):
    times, report = finished(simulator.advance_in_parts(duration, commands, 7))
    assert times[-1] == pytest.approx(duration)
    return report


def at_times(simulator, duration, commands):
    """Threads that are closed meanwhile start again."""
    pauses = simulator.advance_pausing(duration, commands, [0.5 * duration, 0.123 * duration])
    return finished(pauses, lambda time: simulator.close())[1]


def copied(simulator):
    return pickle.loads(pickle.dumps(simulator))


def in_another(simulator):
    """The same state in one that swam elsewhere."""
    other = copied(simulator)
    other.reset()
    other.stroke(np.full((other.n_robots, other.scene.robot.n_limbs), 0.2))
    other.set_state(simulator.get_state())
    return other


WAYS = {
    "alone": lambda n: ({"robots": np.array([robot])} for robot in range(n)),
    "in other lanes": lambda n: [{"robots": np.random.default_rng(1).permutation(n)}],
    "on threads": lambda n: ({"threads": threads} for threads in (2, 7)),
    "with pauses": lambda n: [{"advance": in_parts}, {"advance": at_times, "threads": 2}],
    "after a reset": lambda n: [{"used": True}],
    "pickled": lambda n: [{"between": copied, "threads": 2}],
    "from states": lambda n: [{"between": in_another}],
    "unmeasured": lambda n: [{"measured": False}],
    "scalar": lambda n: [{"device": "scalar"}],
    "cuda": lambda n: [{"device": "cuda"}],
}
"""Ways in which robots of a row swim, each a few times with other options of `swim`."""
LEFT_OUT = {
    "from states": ("time", "error_estimate", "energy_growth"),  # a set clock counts from there
    "unmeasured": MEASURED_IF_ASKED,
    "scalar": ("energy_growth",),
    "cuda": ("energy_growth",),
}
ASKED = [
    (name, way) for name, way in product(ROWS, WAYS)
    if (way not in ("scalar", "cuda") or name == "small mesh") and (way == "alone" or name != "long chains that touch")
]  # fmt: skip


@pytest.mark.parametrize(
    "name, way", [pytest.param(*asked, marks=[pytest.mark.slow] * (asked[0] in SLOW)) for asked in ASKED]
)
def test_a_robot_has_its_bits(name, way):
    for options in WAYS[way](ROWS[name].n_robots):
        robots = options.get("robots", np.arange(ROWS[name].n_robots))
        found = swim(ROWS[name], **options)
        # With a new state, robots that have failed swim again.
        same = ~expected(name)[-1]["failed"][robots] if way == "from states" else np.full(len(robots), True)
        for k, (one, wanted) in enumerate(zip(found, expected(name), strict=True)):
            assert one.keys() == wanted.keys()
            for field in set(one) - set(LEFT_OUT.get(way, ())):
                told = f"{field} after interval {k + 1}"
                np.testing.assert_array_equal(one[field][same], wanted[field][robots][same], err_msg=told)


# Another width of lanes


NARROWED = ROWS | {"held, along limbs": Row(
    Scene(replace(TEN, along=AlongLimb(0.7), stiffening=Stiffening(2.0)), numerics=MIDPOINT, held_nodes=(9,))
)}  # fmt: skip


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name != "default strokes")) for name in NARROWED]
)
def test_few_robots_on_narrow_lanes_have_their_bits(monkeypatch, name):
    """The last ones are a row and a rest."""
    row = NARROWED[name]
    whole = swim(row)
    monkeypatch.setattr(batch, "FEW", N_LANES // 2)
    for robots in ([0], range(1, 1 + N_LANES // 2), range(min(N_LANES + 1, row.n_robots))):
        for one, wanted in zip(swim(row, np.array(robots)), whole, strict=True):
            for field in one:
                np.testing.assert_array_equal(one[field], wanted[field][robots], err_msg=field)


@pytest.mark.parametrize(
    "width, n",
    [(4 if N_LANES == 8 else 8, 9), (8, 3), *(pytest.param(width, 9, marks=pytest.mark.slow) for width in (2, 16))],
)
def test_a_simulator_that_travels_to_another_lane_width_swims_on_to_the_same_bits(tmp_path, width, n):
    """To a processor without AVX-512, say, or to one that has it, where few robots take half a row. Some fly about."""
    simulator, rng = Simulator(Scene(TEN, numerics=Numerics("sdirk2", 0.02)), n), np.random.default_rng(0)
    state, commands = simulator.get_state(), rng.integers(-1, 2, (2, n, 5)).astype(float)
    state.velocities[n // 3 :] = 0.1 * rng.standard_normal((n - n // 3, 46, 2))
    simulator.set_state(state)
    (tmp_path / "before").write_bytes(pickle.dumps((simulator, commands)))
    code = """
import pickle, sys
from pathlib import Path
simulator, commands = pickle.loads((Path(sys.argv[1]) / "before").read_bytes())
reports = [simulator.stroke(command) for command in commands]
(Path(sys.argv[1]) / "after").write_bytes(pickle.dumps((simulator.get_state(), reports)))
"""
    width_of_its_own = {**os.environ, "SEASTAR_LANES": str(width)}
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], env=width_of_its_own, check=True)
    found, reports = pickle.loads((tmp_path / "after").read_bytes())
    for report, command in zip(reports, commands, strict=True):
        np.testing.assert_array_equal(report, simulator.stroke(command))
    for one, wanted in zip(found[:6], simulator.get_state()[:6], strict=True):
        np.testing.assert_array_equal(one, wanted)


# What is not there changes no bit


def at_5_ms(robot: Seastar = Seastar(nodes_per_limb=6), **parts) -> Scene:
    return Scene(robot, numerics=Numerics("implicit-midpoint", 5e-3), **parts)


SIX = Seastar(nodes_per_limb=6)
SAME = {
    **{f"a body without size, {contact}": (
        at_5_ms(contact=contact), at_5_ms(replace(SIX, body=Body()), contact=contact),
        at_5_ms(replace(SIX, body=Body(mass=0.0, inertia=0.0, height=1.0)), contact=contact)
    ) for contact in (None, Contact())},
    **{f"nothing along limbs, damping {tau}": (at_5_ms(replace(SIX, relaxation_time=tau)), *(
        at_5_ms(replace(SIX, relaxation_time=tau, along=along, stiffening=stiffening)) for along, stiffening in
        ((AlongLimb(0.0), None), (None, Stiffening(1.0)), (AlongLimb(0.0), Stiffening(1.0)))
    )) for tau in (None, 1e-3)},
    # Equal drag along and across, a current that stands still, no added mass, no relaxation time.
    "fluid": (at_5_ms(TEN), *(
        at_5_ms(replace(TEN, relaxation_time=0.0), fluid=replace(NONE, current=still))
        for still in (UniformCurrent(), ShearCurrent(0.0), Vortex(0.0))
    )),
    "vacuum": (at_5_ms(fluid=None), at_5_ms(fluid=Water(density=0.0))),
    **{f"what wires remember, {scheme}": tuple(
        Scene(SIX, actuator=actuator, numerics=Numerics(scheme, 0.01)) for actuator in (SmaPulse(), SmaWires())
    ) for scheme in SCHEMES},
    **{f"what a step beyond a ramp would be, {scheme}": tuple(
        Scene(TEN, actuator=SmaPulse(0.2), numerics=Numerics(scheme, step)) for step in (0.9, 5.0)
    ) for scheme in SCHEMES},
}  # fmt: skip
SLOW_SAME = ("nothing along limbs, damping 0.001",)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW_SAME)) for name in [*SAME, "contact"]]
)
def test_what_is_not_there_changes_no_bit(name):
    scenes, commands = SAME.get(name), np.random.default_rng(0).integers(-1, 2, (3, 3, 5)).astype(float)
    if name == "contact":
        scenes, commands[:] = (at_5_ms(), at_5_ms(contact=Contact())), [0.0, 1.0, 0.0, 0.0, -1.0]  # none meet
    first, *others = (Simulator(scene, 3) for scene in scenes)
    for command in commands:
        report = first.stroke(command)
        for other in others:
            np.testing.assert_array_equal(other.stroke(command), report)
            np.testing.assert_array_equal(other.positions, first.positions)
            np.testing.assert_array_equal(other.velocities, first.velocities)
    assert np.abs(first.positions - first.scene.robot.nodes()).max() > 1e-3 and not first.failed.any()
