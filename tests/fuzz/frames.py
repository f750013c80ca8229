"""Frames from which a robot can be seen: what is drawn there is the same physics in other numbers."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fuzz.scenes import Case
from seastar_gym import Attachment, Body, GridCurrent, Limb, Scene, ShearCurrent, State, UniformCurrent, Vortex, Water
from seastar_gym.scene.actuators.base import complete
from symmetries import mirrored

Floats = np.ndarray


@dataclass(frozen=True)
class Frame:
    """A frame whose axes are turned or mirrored, that lies elsewhere, or moves.

    angle: By which all is turned [rad]. is_mirror: Whether sides are swapped. way: By which all is moved [m].
    drift: Velocity at which robots are seen to move along [m/s].
    """

    name: str
    angle: float = 0.0
    is_mirror: bool = False
    way: tuple[float, float] = (0.0, 0.0)
    drift: tuple[float, float] = (0.0, 0.0)

    @property
    def sign(self) -> float:
        """Of turns and other pseudoscalars."""
        return -1.0 if self.is_mirror else 1.0

    def vectors(self, vectors: Floats) -> Floats:
        """Vectors, shape (..., 2), as they are seen."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return vectors @ np.array([[c, s], [-s, c]]) * [1.0, self.sign]

    def current(self, current: Any) -> Any:
        """Current as it is seen; one that cannot be said stays, see `can_be_seen_from`."""

        def seen(x: Any, y: Any) -> list[Any]:
            found = self.vectors(np.stack(np.broadcast_arrays(x, y), axis=-1).astype(float))
            return [found[..., 0], found[..., 1]]

        match current:
            case UniformCurrent(u_x, u_y):
                return UniformCurrent(*(np.add(u, by)[()] for u, by in zip(seen(u_x, u_y), self.drift, strict=True)))
            case ShearCurrent(rate, direction):
                turned = np.multiply(self.sign, direction) + self.angle
                return ShearCurrent(np.multiply(self.sign, rate)[()], turned[()])
            case Vortex(circulation, x, y, core):
                places = (np.add(at, by)[()] for at, by in zip(seen(x, y), self.way, strict=True))
                return Vortex(np.multiply(self.sign, circulation)[()], *places, core)
            case GridCurrent(corner, spacing, velocities):
                return GridCurrent(tuple(np.add(corner, self.way).tolist()), spacing, velocities)
        return current

    def scene(self, scene: Scene) -> Scene:
        loads = tuple((self.node(scene, node), *self.vectors(np.array(force)).tolist()) for node, *force in scene.loads)
        fluid = scene.fluid
        if isinstance(fluid, Water):
            fluid = replace(fluid, current=self.current(fluid.current))
        held = tuple(self.node(scene, node) for node in scene.held_nodes)
        seen = replace(scene, fluid=fluid, loads=loads, held_nodes=held)
        return mirrored_limbs(seen) if self.is_mirror else seen

    def node(self, scene: Scene, node: int) -> int:
        """Its number where limbs have swapped sides."""
        per_limb = scene.robot.nodes_per_limb - 1
        if not self.is_mirror or node == 0:
            return node
        limb, place = divmod(node - 1, per_limb)
        return 1 + (-limb % scene.robot.n_limbs) * per_limb + place

    def state(self, state: State, scene: Scene) -> State:
        order = [self.node(scene, node) for node in range(scene.robot.n_nodes)]
        q, v = (array[:, order] for array in (state.positions, state.velocities))
        actuators = state.actuators
        if self.is_mirror and actuators is not None:
            actuators = mirrored_actuators(actuators[:, swapped(scene.robot.n_limbs)], scene)
        commands = state.commands
        if self.is_mirror and commands is not None:
            commands = -commands[:, swapped(scene.robot.n_limbs)]
        moved = self.vectors(q) + self.way + np.multiply.outer(state.time, self.drift)[:, None]
        orientation = None if state.orientation is None else self.sign * state.orientation + self.angle
        spin = None if state.spin is None else self.sign * state.spin
        velocities = self.vectors(v) + self.drift
        return State(moved, velocities, state.time, actuators, commands, state.phase, orientation, spin)

    def case(self, case: Case) -> Case:
        commands = -case.commands[..., swapped(case.scene.robot.n_limbs)] if self.is_mirror else case.commands
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


REST = Frame("at rest")
TURN, SHIFT, MIRROR = Frame("turned", angle=1.1), Frame("moved", way=(0.3, -0.2)), Frame("mirrored", is_mirror=True)
FRAMES = (TURN, SHIFT, MIRROR)
MOVING = Frame("moving", drift=(0.03, -0.02))
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
