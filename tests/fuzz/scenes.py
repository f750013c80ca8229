"""Random scenes, states and commands: what the promises in promises.py are tried on.

Everything is drawn from a `random.Random`, so that a set of terms and a seed are all that reproduces a case:

    draw_case(Random(seed), terms)
"""

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Any, NamedTuple, get_args

import numpy as np
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from seastar_gym import (
    AlongLimb,
    Attachment,
    Body,
    Contact,
    GridCurrent,
    Limb,
    Limited,
    MeasuredCurve,
    Numerics,
    Scene,
    Seastar,
    Section,
    ShearCurrent,
    Simulator,
    SmaLimb,
    SmaPulse,
    SmaWires,
    State,
    Stiffening,
    Strip,
    ThermalSma,
    Tube,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.scene.actuators.base import Actuator
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.scene.robot import Discretisation, HubHinge
from seastar_gym.scene.shape import n_hub_hinges, natural_hub_angle
from seastar_gym.scene.water import AnyCurrent
from seastar_gym.simulator.state import best_fit_heading

Terms = frozenset[str]

OWN = "numbers of each robot"
ROTATIONS = "rotations of each limb"
CHAPTER = "chapter's discretisation"
IN_WATER = ("drag along limbs", "added mass", "current")
TERMS = (*IN_WATER, "damping", "loads", "contact", OWN, ROTATIONS, CHAPTER)
"""What a scene has or has not: every set of them is machine code of its own, 20 to 40 s to compile."""

BODY, ALONG, STIFFENING = RARE = ("body", "bent along", "stiffening")
"""Terms that not all sets of terms are drawn with: each doubles them. The last two have machine code in common."""

PLAIN: Terms = frozenset()
CONTACT: Terms = frozenset({"contact"})
FLUID: Terms = frozenset({*IN_WATER, "damping"})
EVERYTHING: Terms = frozenset(TERMS) - {OWN, CHAPTER}
TOUCHED_BODY: Terms = frozenset({BODY, "contact"})
BENT: Terms = frozenset({ALONG, STIFFENING})
SWIMMER: Terms = frozenset({BODY, ALONG, STIFFENING, "contact", ROTATIONS})
"""A body, limbs that wires bend along their length and stiffen (`SmaLimb` and the others), and contact."""
COMPILED: tuple[Terms, ...] = (
    PLAIN, CONTACT, frozenset({ROTATIONS}), frozenset({OWN}), frozenset({OWN, ROTATIONS}), frozenset({OWN, "contact"}),
    FLUID, frozenset({"loads"}), frozenset({CHAPTER}),
)  # fmt: skip
"""The sets that other tests compile, too."""

MOST_STEPS = 10
"""Of half a stroke."""

TAME_PEAK = 1.0
"""Largest peak angle [rad] of scenes that are not wild."""

N_ROBOTS, N_STROKES = 4, 2
SEEDS = st.integers(0, 2**32 - 1)


class Case(NamedTuple):
    """A batch of robots before its strokes; commands: shape (n_strokes, n_robots, n_limbs)."""

    scene: Scene
    n_robots: int
    state: State
    commands: np.ndarray


@dataclass(frozen=True)
class Draw:
    """How numbers are drawn.

    n_robots: Robots that have numbers of their own, or None. wild: Far beyond what anybody swims with.
    """

    rng: Random
    n_robots: int | None = None
    wild: bool = True

    def maybe(self, share: float) -> bool:
        return self.rng.random() < share

    def power(self, low: float, high: float) -> float:
        """From 10^low to 10^high, any magnitude now and then if wild."""
        if self.wild and self.maybe(0.005):
            low, high = -40.0, 40.0
        return float(10.0 ** self.rng.uniform(low, high))

    def around(self, value: float, decades: float) -> float:
        """A number of the order of `value`: as many decades away at most, six times fewer if not wild."""
        decades = decades if self.wild else decades / 6.0
        return value * self.power(-decades, decades)

    def or_zero(self, value: float) -> float:
        """A term that is there, and shows or not."""
        return 0.0 if self.maybe(0.4) else value

    def each(self, draw: Callable[[], float], always: bool = False) -> Any:
        """A number, or those of each robot."""
        if self.n_robots is None or not (always or self.maybe(0.5)):
            return draw()
        return np.array([draw() for _ in range(self.n_robots)])


# --- parts of a scene ------------------------------------------------------------------------------------------------


def draw_robot(draw: Draw, terms: Terms) -> Seastar:
    robot = draw_star(draw, terms)
    if CHAPTER in terms:
        return robot
    if ALONG in terms:
        robot = replace(robot, along=draw_along(draw))
    if STIFFENING in terms:
        ratio, rng = draw.each(lambda: draw.around(2.0, 1.0)), draw.rng
        robot = replace(robot, stiffening=Stiffening(ratio, rng.uniform(0.1, 0.9), rng.uniform(0.03, 0.5)))
    return replace(robot, body=draw_body(draw, robot)) if BODY in terms else robot


def draw_along(draw: Draw) -> AlongLimb:
    profile = tuple(draw.rng.uniform(0.1, 1.0) for _ in range(draw.rng.randint(2, 4))) if draw.maybe(0.5) else 1.0
    return AlongLimb(draw.each(lambda: draw.rng.choice([1.0, draw.rng.random()])), profile)


def draw_body(draw: Draw, robot: Seastar) -> Body:
    """A disc, a rectangle or a polygon with corners on a circle; limbs at its rim, somewhat across it."""
    rng, size = draw.rng, draw.around(0.02, 1.0)
    named = any(limb.direction is not None for limb in robot.limbs)
    given: dict[str, Any] = {"height": draw.each(lambda: draw.around(0.01, 1.0))}
    if draw.maybe(0.5):
        given["mass"] = draw.each(lambda: draw.around(0.02, 1.5))
    if draw.maybe(0.3):
        given["centre_of_mass"] = (rng.uniform(-0.3, 0.3) * size, rng.uniform(-0.3, 0.3) * size)
    if draw.maybe(0.3):
        given[rng.choice(["drag_along", "drag_across", "drag_turning"])] = draw.each(lambda: draw.around(1.0, 1.0))
    corners = sorted(rng.uniform(0.0, 2.0 * math.pi) for _ in range(rng.randint(3, 8)))
    match rng.choice(["disc", "rectangle", "polygon"]):
        case "disc":
            body = Body(radius=size, **given)
        case "rectangle":
            body = Body.rectangle(size, size * rng.uniform(0.2, 1.0), **given)
        case _:
            body = Body(outline=tuple((size * math.cos(a), size * math.sin(a)) for a in corners), **given)
    if named or draw.maybe(0.5):
        return body
    places = [2.0 * math.pi * (limb + rng.uniform(-0.3, 0.3)) / robot.n_limbs for limb in range(robot.n_limbs)]
    leans = [rng.uniform(-0.5, 0.5) for _ in places]
    at_rim = zip(map(body.shape.rim, places), places, leans, strict=True)
    return replace(body, attachments=tuple(Attachment(*rim, place + lean) for rim, place, lean in at_rim))


def draw_star(draw: Draw, terms: Terms) -> Seastar:
    rng = draw.rng
    discretisation: Discretisation = "chapter" if CHAPTER in terms else "continuum"
    if not draw.wild and draw.n_robots is None and draw.maybe(0.3):
        return Seastar(relaxation_time=0.0 if "damping" in terms else None, discretisation=discretisation)
    n_limbs = rng.choice([1, 2, 3, 5, 5, 8, 12]) if draw.wild else rng.choice([3, 4, 5, 6])
    if "contact" in terms:
        n_limbs = max(n_limbs, 3)
    hub_hinge: HubHinge = "turning" if n_limbs > 1 and CHAPTER in terms and draw.maybe(0.2) else "opening"
    return Seastar(
        n_limbs=n_limbs,
        nodes_per_limb=rng.randint(2, 12) if draw.wild else rng.randint(4, 10),
        limb_length=draw.each(lambda: draw.around(0.1, 1.0)),
        rod_radius=draw.each(lambda: draw.around(1.6e-3, 1.5)),
        youngs_modulus=draw.each(lambda: draw.around(1e6, 4.5), always=True),
        density=draw.each(lambda: draw.around(1e3, 1.5)),
        hub_hinge=hub_hinge,
        limbs=draw_limbs(draw, n_limbs) if draw.maybe(0.4) else (),
        relaxation_time=draw.each(lambda: draw.or_zero(draw.power(-6.0, -1.0))) if "damping" in terms else None,
        discretisation=discretisation,
    )


def draw_limbs(draw: Draw, n_limbs: int) -> tuple[Limb, ...]:
    """Of other lengths, tapers, stiffnesses and curvatures, in directions of their own or not."""
    rng, directions = draw.rng, [None] * n_limbs
    if draw.maybe(0.5):
        steps = [rng.uniform(0.6, 1.4) for _ in range(n_limbs)]
        directions = [2.0 * math.pi * sum(steps[:j]) / sum(steps) for j in range(n_limbs)]
    return tuple(draw_limb(draw, direction) for direction in directions)


def draw_limb(draw: Draw, direction: float | None) -> Limb:
    def profile(value: float, decades: float) -> Any:
        if draw.maybe(0.5):
            return draw.each(lambda: draw.around(value, decades))
        return tuple(draw.around(value, decades) for _ in range(draw.rng.randint(1, 4)))

    def section() -> Strip | Tube | Section:
        kind, tube = draw.rng.choice(["strip", "tube", "measured"]), draw.around(2e-3, 0.5)
        if kind == "strip":
            return Strip(profile(2e-3, 0.5), profile(4e-3, 0.7))
        if kind == "tube":
            return Tube(tube, draw.each(lambda: tube * draw.rng.uniform(0.2, 0.95)))
        mass = draw.each(lambda: draw.around(8e-3, 0.5)) if draw.maybe(0.5) else None
        EI = draw.each(lambda: draw.around(5e-6, 1.0))
        return Section(profile(8e-6, 0.5), None, profile(4e-3, 0.5), bending_stiffness=EI, mass_per_length=mass)

    round_limb = draw.maybe(0.3)
    return Limb(
        direction=direction,
        length=draw.each(lambda: draw.around(0.1, 0.5)) if draw.maybe(0.3) else None,
        radius=profile(1.6e-3, 0.7) if round_limb else None,
        section=section() if not round_limb and draw.maybe(0.4) else None,
        youngs_modulus=profile(1e6, 2.0) if draw.maybe(0.3) else None,
        natural_curvature=draw.each(lambda: draw.rng.uniform(-8.0, 8.0)) if draw.maybe(0.3) else 0.0,
    )


def draw_current(draw: Draw) -> AnyCurrent:
    def speed() -> float:
        return draw.rng.choice([-1.0, 1.0]) * draw.around(1e-2, 1.5)

    match draw.rng.choice(["uniform", "uniform", "shear", "vortex", "grid"]):
        case "uniform":
            return UniformCurrent(draw.each(speed), draw.each(speed))
        case "shear":
            return ShearCurrent(draw.each(speed), draw.each(lambda: draw.rng.uniform(-math.pi, math.pi)))
        case "vortex":
            return Vortex(draw.each(speed), draw.each(speed), draw.each(speed), draw.each(lambda: draw.around(0.05, 1)))
    shape = draw.rng.randint(2, 4), draw.rng.randint(2, 4), 2
    velocities = [[[speed() for _ in range(2)] for _ in range(shape[1])] for _ in range(shape[0])]
    return GridCurrent((draw.rng.uniform(-0.3, 0.0), draw.rng.uniform(-0.3, 0.0)), draw.around(0.1, 0.5), velocities)


def draw_fluid(draw: Draw, terms: Terms) -> Water | None:
    if not terms & {*IN_WATER} and draw.maybe(0.3):
        return None
    share = draw.rng.choice([0.0, draw.rng.random(), 1.0])
    coefficient = draw.each(lambda: draw.around(1.0, 3.0))
    return Water(
        density=draw.rng.choice([0.0, 1000.0]) if draw.wild and draw.maybe(0.1) else draw.around(1e3, 1.0),
        drag_coefficient=coefficient,
        tangential_drag_coefficient=share * float(np.min(coefficient)) if "drag along limbs" in terms else None,
        current=draw_current(draw) if "current" in terms else None,
        added_mass_coefficient=draw.each(lambda: draw.or_zero(draw.around(1, 1))) if "added mass" in terms else None,
    )


def largest_peak(robot: Seastar) -> float:
    """Largest angle [rad] by which a scene lets limbs of the robot turn, and any command be given."""
    if robot.n_limbs == 1:
        return 0.0
    if robot.discretisation == "continuum":
        return 0.999 * math.pi
    hinges = robot.limb_shapes()[: n_hub_hinges(robot.n_limbs)]
    widest = max(abs(natural_hub_angle(hinge.gap, robot.hub_hinge)) for hinge in hinges)
    return 0.499 * (math.pi - widest)


def draw_actuator(draw: Draw, terms: Terms, robot: Seastar, step: float) -> Actuator:
    """Whose stroke takes some steps; not all of them of whole steps."""
    share = draw.rng.choice([0.0, 1.0, draw.rng.random()]) if draw.wild else draw.rng.uniform(0.2, 0.8)
    peak = share * (largest_peak(robot) if draw.wild else min(largest_peak(robot), TAME_PEAK))
    heating, cooling = (step * (draw.rng.randint(1, MOST_STEPS) - 0.3 * draw.maybe(0.2)) for _ in range(2))
    own = draw if ROTATIONS in terms else replace(draw, n_robots=None)
    if draw.maybe(0.7):
        simple: Actuator = SmaPulse(own.each(lambda: peak * draw.rng.uniform(0.5, 1.0)), heating, cooling)
    else:
        period = heating + cooling
        times = (0.0, *sorted({draw.rng.uniform(0.05, 0.95) * period for _ in range(draw.rng.randint(1, 3))}), period)
        angles = (0.0, *(peak * draw.rng.uniform(-1.0, 1.0) for _ in times[2:]), 0.0)
        simple = MeasuredCurve(times, angles, own.each(lambda: draw.rng.random()))
    if ROTATIONS not in terms:
        return simple
    kind = draw.rng.choice(["wires", "thermal", "limb", "limited"])
    if kind == "wires":
        return draw_wires(draw, own.each(lambda: peak), heating, cooling)
    if kind == "thermal":
        cold = draw.each(lambda: draw.rng.uniform(0.0, 21.0))
        return ThermalSma(own.each(lambda: peak), heating, cooling, draw.each(lambda: draw.around(2.0 * heating, 0.9)),
                          draw.each(lambda: draw.around(220.0, 1.0)), cold)  # fmt: skip
    if kind == "limb":
        tau, rise = (draw.each(lambda middle=middle: draw.around(middle, 0.9)) for middle in (2.0 * heating, 9.0))
        delay = draw.or_zero(draw.rng.uniform(0.1, 1.0) * heating)
        return SmaLimb(own.each(lambda: peak), rise, 7.0, tau, heating, delay, heating + cooling)
    angle = own.each(lambda: (peak or 1.0) * draw.rng.uniform(0.1, 1.5)) if draw.maybe(0.5) else None
    rate = own.each(lambda: draw.around((peak or 1.0) / heating, 1.0)) if draw.maybe(0.7) else None
    return Limited(simple, angle, rate)


def draw_wires(draw: Draw, peak: Any, heating: float, cooling: float) -> SmaWires:
    """Whose stroke ends before its wires are cold, then, or later."""
    period = draw.rng.choice([None, draw.rng.uniform(0.3, 2.0) * (heating + cooling)])
    return SmaWires(peak, heating, cooling, period, draw.maybe(0.3))


def draw_numerics(draw: Draw) -> Numerics:
    if not draw.wild and draw.maybe(0.5):
        return Numerics.preset(draw.rng.choice(get_args(Fidelity)))
    scheme = draw.rng.choice(["implicit-euler", "sdirk2", "implicit-midpoint", "implicit-midpoint"])
    tolerance = draw.power(-14.0, -2.0) if draw.wild else draw.power(-9.0, -6.0)
    return Numerics(
        scheme,
        step=draw.power(-5.0, 0.0) if draw.wild else draw.power(-3.0, -2.0),
        newton_tolerance=min(tolerance, 1e-2),
        max_iterations=draw.rng.choice([2, 5, 60, 60, 60]) if draw.wild else 60,
        damping=draw.rng.choice([0.0, 0.002, 0.5]) if scheme == "implicit-midpoint" else 0.0,
    )


def draw_held(draw: Draw, robot: Seastar) -> tuple[int, ...]:
    if not draw.maybe(0.2):
        return ()
    return tuple(draw.rng.sample(range(robot.n_nodes), draw.rng.randint(1, robot.n_nodes)))


def draw_loads(draw: Draw, robot: Seastar) -> tuple[tuple[int, float, float], ...]:
    """Of the size that bends a limb of the chapter, more or less."""
    nodes = [draw.rng.randrange(robot.n_nodes) for _ in range(draw.rng.randint(1, 3))]
    return tuple((node, *(draw.rng.uniform(-1.0, 1.0) * draw.around(1e-3, 3.0) for _ in range(2))) for node in nodes)


def draw_contact(draw: Draw, robot: Seastar) -> Contact:
    angle = draw.rng.uniform(0.02, 0.98 if draw.wild else 0.4) * robot.opening_angle
    if draw.maybe(0.3):
        return Contact(opening_angle=angle, layer=draw.each(lambda: draw.around(5e-3, 2.0)))
    return Contact(draw.each(lambda: draw.around(1e5, 2.0)) if draw.maybe(0.5) else None, angle)


def draw_parts(draw: Draw, terms: Terms) -> Scene:
    robot, numerics = draw_robot(draw, terms), draw_numerics(draw)
    return Scene(
        robot=robot,
        fluid=draw_fluid(draw, terms),
        actuator=draw_actuator(draw, terms, robot, numerics.step),
        numerics=numerics,
        held_nodes=draw_held(draw, robot),
        loads=draw_loads(draw, robot) if "loads" in terms else (),
        limb_strengths=tuple(draw.rng.choice([0.0, 0.5, 1.0]) for _ in range(robot.n_limbs)) if draw.maybe(0.2) else (),
        contact=draw_contact(draw, robot) if "contact" in terms else None,
    )


def draw_scene(rng: Random, terms: Terms, n_robots: int, wild: bool = True) -> Scene:
    """The first of the scenes drawn that is not refused."""
    draw = Draw(rng, n_robots if OWN in terms else None, wild)
    while True:
        with contextlib.suppress(ValueError):
            return draw_parts(draw, terms)


# --- states and commands ---------------------------------------------------------------------------------------------

TAME = ("rest", "noise", "velocities", "moved")
WILD = (*TAME, "noise of an edge", "hub", "twins", "folded", "far", "fast", "huge")
"""Where nodes of a robot are: see `disturb`."""


def disturb(kind: str, edge: float, q: np.ndarray, v: np.ndarray, rng: np.random.Generator) -> None:
    """Disturb a robot at rest, in place; q, v: [m], [m/s], shape (n_nodes, 2)."""
    noise = rng.uniform(-1.0, 1.0, q.shape)
    match kind:
        case "noise":
            q += 0.5 * edge * noise * rng.random()
        case "noise of an edge":
            q += edge * noise
        case "velocities":
            v += rng.standard_normal(v.shape) * 10.0 ** rng.uniform(-3.0, -1.0)
        case "fast":
            v += rng.standard_normal(v.shape) * 10.0 ** rng.uniform(-1.0, 2.0)
        case "moved":
            q[:], v[:] = moved(q, rng)
        case "hub":
            q[:] = q[0]
        case "twins":
            q[rng.integers(len(q))] = q[rng.integers(len(q))]
        case "folded":
            q[:] = q[0] - (q - q[0]) * rng.integers(0, 2, (len(q), 1))
        case "far":
            q += 10.0 ** rng.uniform(0.0, 8.0) * noise[0]
        case "huge":
            q *= 10.0 ** rng.uniform(1.0, 100.0)
            v += 10.0 ** rng.uniform(1.0, 100.0) * noise


def moved(q: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Turned and moved like a rigid body that moves."""
    angle, way, velocity = rng.uniform(-math.pi, math.pi), rng.uniform(-1.0, 1.0, 2), 0.05 * rng.standard_normal(2)
    c, s = math.cos(angle), math.sin(angle)
    return q @ np.array([[c, s], [-s, c]]) + way, np.zeros_like(q) + velocity


def draw_state(rng: Random, simulator: Simulator, kinds: tuple[str, ...]) -> State:
    """Every robot disturbed in a way of its own; held nodes stand."""
    numbers, scene = np.random.default_rng(rng.getrandbits(32)), simulator.scene
    simulator.reset()
    state = simulator.get_state()
    for robot, (q, v) in enumerate(zip(state.positions, state.velocities, strict=True)):
        edge = min(limb.length for limb in scene.robot.limb_shapes(robot % (scene.n_robots or 1)))
        disturb(rng.choice(kinds), edge / (scene.robot.nodes_per_limb - 1), q, v, numbers)
        v[list(scene.held_nodes)] = 0.0
    if state.orientation is None:
        return state
    orientation = best_fit_heading(state.positions, simulator.coefficients.rest_shapes())
    spin = rng.choice([0.0, 1.0]) * numbers.standard_normal(len(orientation)) * 10.0 ** rng.uniform(-1.0, 1.0)
    return state._replace(orientation=orientation, spin=spin)


def draw_commands(rng: Random, n_strokes: int, n_robots: int, n_limbs: int) -> np.ndarray:
    """Those of the chapter, alternating ones, and any in between."""
    numbers = np.random.default_rng(rng.getrandbits(32))
    shape = n_strokes, n_robots, n_limbs
    ternary = numbers.integers(-1, 2, shape).astype(float)
    opposed = np.broadcast_to(np.resize([1.0, -1.0], n_limbs), shape)
    kind = numbers.integers(0, 3, (1, n_robots, 1))
    return np.select([kind == 0, kind == 1], [ternary, opposed], numbers.uniform(-1.0, 1.0, shape))


def draw_case(rng: Random, terms: Terms, wild: bool = True) -> Case:
    """Wild cases are for promises that hold whatever happens; the others for those that hold to a tolerance."""
    scene = draw_scene(rng, terms, N_ROBOTS, wild)
    state = draw_state(rng, Simulator(scene, N_ROBOTS, threads=1), WILD if wild else TAME)
    return Case(scene, N_ROBOTS, state, draw_commands(rng, N_STROKES, N_ROBOTS, scene.robot.n_limbs))


def drawn(count: int, terms: Sequence[Terms] = COMPILED) -> Callable[[Any], Any]:
    """Run a test for so many (terms, seed); there is nothing to shrink: a smaller seed is no simpler case."""
    phases = [Phase.explicit, Phase.reuse, Phase.generate]

    def decorate(test: Any) -> Any:
        return settings(max_examples=count, phases=phases)(given(terms=st.sampled_from(terms), seed=SEEDS)(test))

    return decorate
