"""Frames from which a robot can be seen: what is drawn there is the same physics in other numbers."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fuzz.scenes import Case
from seastar_gym import (
    Attachment,
    Body,
    GridCurrent,
    Limb,
    Scene,
    ShearCurrent,
    State,
    UniformCurrent,
    Vortex,
    Water,
)
from seastar_gym.scene.actuators.actuator import complete, mirrored

Floats = np.ndarray


def same(thing: Any, *_: Any) -> Any:
    return thing


@dataclass(frozen=True)
class Frame:
    """What becomes of places [m], velocities [m/s] and other vectors, of currents, and whether limbs swap sides.

    drift: Velocity at which robots are seen to move along [m/s]. angle: By which all is turned [rad].
    """

    name: str
    places: Callable[[Floats], Floats] = same
    velocities: Callable[[Floats], Floats] = same
    vectors: Callable[[Floats], Floats] = same
    current: Callable[[Any], Any] = same
    mirrored: bool = False
    drift: tuple[float, float] = (0.0, 0.0)
    angle: float = 0.0

    def scene(self, scene: Scene) -> Scene:
        loads = tuple((self.node(scene, node), *self.vectors(np.array(force)).tolist()) for node, *force in scene.loads)
        fluid = scene.fluid
        if isinstance(fluid, Water):
            fluid = replace(fluid, current=self.current(fluid.current))
        held = tuple(self.node(scene, node) for node in scene.held_nodes)
        seen = replace(scene, fluid=fluid, loads=loads, held_nodes=held)
        return mirrored_limbs(seen) if self.mirrored else seen

    def node(self, scene: Scene, node: int) -> int:
        """Its number where limbs have swapped sides."""
        per_limb = scene.robot.nodes_per_limb - 1
        if not self.mirrored or node == 0:
            return node
        limb, place = divmod(node - 1, per_limb)
        return 1 + (-limb % scene.robot.n_limbs) * per_limb + place

    def state(self, state: State, scene: Scene) -> State:
        order = [self.node(scene, node) for node in range(scene.robot.n_nodes)]
        q, v = (array[:, order] for array in (state.positions, state.velocities))
        actuators = state.actuators
        if self.mirrored and actuators is not None:
            actuators = mirrored_actuators(actuators[:, swapped(scene.robot.n_limbs)], scene)
        commands = state.commands
        if self.mirrored and commands is not None:
            commands = -commands[:, swapped(scene.robot.n_limbs)]
        moved = self.places(q) + np.multiply.outer(state.time, self.drift)[:, None]
        sign = -1.0 if self.mirrored else 1.0
        orientation = None if state.orientation is None else sign * state.orientation + self.angle
        spin = None if state.spin is None else sign * state.spin
        return State(moved, self.velocities(v), state.time, actuators, commands, state.phase, orientation, spin)

    def case(self, case: Case) -> Case:
        commands = -case.commands[..., swapped(case.scene.robot.n_limbs)] if self.mirrored else case.commands
        return Case(self.scene(case.scene), case.n_robots, self.state(case.state, case.scene), commands)


def swapped(n_limbs: int) -> list[int]:
    """Limbs in the order in which a mirror at limb 1 shows them."""
    return [-limb % n_limbs for limb in range(n_limbs)]


def mirrored_limbs(scene: Scene) -> Scene:
    order, robot = swapped(scene.robot.n_limbs), scene.robot
    limbs = tuple(mirrored_limb(robot.limbs[limb]) for limb in order) if robot.limbs else ()
    strengths = tuple(scene.limb_strengths[limb] for limb in order) if scene.limb_strengths else ()
    body = None if robot.body is None else mirrored_body(robot.body)
    return replace(scene, robot=replace(robot, limbs=limbs, body=body), limb_strengths=strengths)


def mirrored_body(body: Body) -> Body:
    centre, at = body.centre_of_mass, body.attachments
    order = swapped(len(at)) if at else []
    return replace(
        body,
        outline=tuple((x, -y) for x, y in reversed(body.outline)),
        centre_of_mass=None if centre is None else (centre[0], -centre[1]),
        attachments=tuple(Attachment(at[limb].x, -at[limb].y, -at[limb].direction) for limb in order),
    )


def mirrored_limb(limb: Limb) -> Limb:
    direction = limb.direction if not limb.direction else 2.0 * math.pi - limb.direction
    return replace(limb, direction=direction, natural_curvature=np.multiply(-1.0, limb.natural_curvature)[()])


def mirrored_actuators(remembered: Floats, scene: Scene) -> Floats:
    """As the actuator says, if it remembers anything."""
    return mirrored(complete(scene.actuator), remembered) if remembered.shape[-1] else remembered


# --- currents --------------------------------------------------------------------------------------------------------


def turned_current(current: Any, angle: float) -> Any:
    c, s = math.cos(angle), math.sin(angle)
    match current:
        case UniformCurrent(u_x, u_y):
            u_x, u_y = np.asarray(u_x), np.asarray(u_y)
            return UniformCurrent((c * u_x - s * u_y)[()], (s * u_x + c * u_y)[()])
        case ShearCurrent(rate, direction):
            return ShearCurrent(rate, np.add(direction, angle)[()])
        case Vortex(circulation, x, y, core):
            x, y = np.asarray(x), np.asarray(y)
            return Vortex(circulation, (c * x - s * y)[()], (s * x + c * y)[()], core)
    return current


def mirrored_current(current: Any) -> Any:
    match current:
        case UniformCurrent(u_x, u_y):
            return UniformCurrent(u_x, np.negative(u_y)[()])
        case ShearCurrent(rate, direction):
            return ShearCurrent(np.negative(rate)[()], np.negative(direction)[()])
        case Vortex(circulation, x, y, core):
            return Vortex(np.negative(circulation)[()], x, np.negative(y)[()], core)
    return current


def shifted_current(current: Any, way: Floats) -> Any:
    match current:
        case Vortex(circulation, x, y, core):
            return Vortex(circulation, np.add(x, way[0])[()], np.add(y, way[1])[()], core)
        case GridCurrent(corner, spacing, velocities):
            return GridCurrent(tuple((np.array(corner) + way).tolist()), spacing, velocities)
    return current


# --- frames ----------------------------------------------------------------------------------------------------------


def turn(angle: float) -> Frame:
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c, s], [-s, c]])

    def carried(vectors: Floats) -> Floats:
        return vectors @ matrix

    return Frame(f"turned by {angle} rad", carried, carried, carried,
                 lambda current: turned_current(current, angle), angle=angle)  # fmt: skip


def shift(way: Floats) -> Frame:
    return Frame(f"moved by {way} m", lambda q: q + way, current=lambda current: shifted_current(current, way))


def mirror() -> Frame:
    def carried(vectors: Floats) -> Floats:
        return vectors * np.array([1.0, -1.0])

    return Frame("mirrored", carried, carried, carried, mirrored_current, mirrored=True)


REST = Frame("at rest")
TURN, SHIFT, MIRROR = turn(1.1), shift(np.array([0.3, -0.2])), mirror()
FRAMES = (TURN, SHIFT, MIRROR)


def moving(velocity: tuple[float, float]) -> Frame:
    """The frame from which everything is seen to move at a velocity [m/s] more."""

    def current(found: Any) -> Any:
        if isinstance(found, UniformCurrent):
            return UniformCurrent(np.add(found.u_x, velocity[0])[()], np.add(found.u_y, velocity[1])[()])
        return found

    return Frame(f"moving at {velocity} m/s", velocities=lambda v: v + velocity, current=current, drift=velocity)


MOVING = moving((0.03, -0.02))
"""At a speed at which nodes swim, and currents flow."""


def can_be_seen_from(frame: Frame, scene: Scene) -> bool:
    """Whether a scene can say what is seen from there: turned grids and moved shears are other currents."""
    current = None if scene.fluid is None else scene.fluid.current
    if isinstance(current, GridCurrent):
        return frame is SHIFT
    if frame is SHIFT:
        return not isinstance(current, ShearCurrent)
    if frame in (TURN, MIRROR):
        return True
    return not scene.held_nodes and (scene.fluid is None or isinstance(current, UniformCurrent))
