"""Pictures of swims: robots on their paths, as arrays or in a window.

Lengths are in metres, y is up; pixels count from the upper left corner, y down.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.canvas import INK, WATER, Camera, Canvas, Colour, Window, mixed
from seastar_gym.envs.robots import Robots
from seastar_gym.envs.scenery import NOTHING, Flow, Scenery, flow_of
from seastar_gym.scene import Seastar
from seastar_gym.scene.number import chosen
from seastar_gym.scene.water import AnyCurrent
from seastar_gym.simulator import Simulator

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Frame:
    """State of a swim that one picture shows."""

    positions: FloatArray
    """Node positions [m], shape (n_nodes, 2)."""
    command: FloatArray
    """Command of the current decision in [-1, 1], shape (n_limbs,); + is anti-clockwise."""
    trail: FloatArray
    """Former positions of the hub [m], shape (k, 2), oldest first; k may be 0."""
    waypoint_index: int
    """The waypoint that the robot swims to; the number of waypoints once all are reached."""
    time: float
    """Simulated time [s]."""
    wire_state: FloatArray | None = None
    """How warm wires + and - of every limb are, from 0 to 1, shape (n_limbs, 2); None without wires."""
    scenery: Scenery = NOTHING
    """What the task shows besides."""
    roots: FloatArray | None = None
    """Places where limbs begin on a body [m], shape (n_limbs, 2); None where they begin at the hub."""
    outline: FloatArray | None = None
    """Outline of the body [m], shape (n, 2); None without one."""
    current: AnyCurrent | None = None
    """Current of the water; None for water at rest."""


def body_of(simulator: Simulator) -> tuple[FloatArray | None, FloatArray | None]:
    """Roots of limbs, shape (n_robots, n_limbs, 2), and outlines, shape (n_robots, n, 2) [m]; None without a body."""
    body = simulator.scene.robot.body
    if body is None or body.is_point:
        return None, None
    x, y = body.shape.drawn().T if body.shape.area else np.zeros((2, 0))
    angles = simulator.orientation()[:, None]
    c, s = np.cos(angles), np.sin(angles)
    outline = np.stack([c * x - s * y, s * x + c * y], axis=-1)
    return simulator.root_positions(), simulator.hub_position()[:, None] + outline


def frames_of(robots: Robots, trails: Mapping[int, FloatArray]) -> Iterator[Frame]:
    """Frames of robots at present. trails: As in `Frame`, by the numbers of the robots that are shown."""
    simulator = robots.simulator
    positions, time, wire_state = simulator.positions, simulator.time, robots.wire_state()
    roots, outlines = body_of(simulator)
    fluid = simulator.scene.fluid
    for robot, trail in trails.items():
        yield Frame(
            positions=positions[robot],
            command=robots.last_commands[robot],
            trail=trail,
            waypoint_index=int(robots.waypoint_index[robot]),
            time=float(time[robot]),
            wire_state=None if wire_state is None else wire_state[robot],
            scenery=robots.task.scenery(robots, robot),
            roots=None if roots is None else roots[robot],
            outline=None if outlines is None else outlines[robot],
            current=None if fluid is None else chosen(fluid.current, itemgetter(robot)),
        )


@dataclass(frozen=True, eq=False)
class Label:
    """Label of a waypoint, or of several at one place, and where there is room to write it."""

    indices: tuple[int, ...]
    """Waypoints at this place, counted from 0."""
    place: FloatArray
    """Position [m], shape (2,)."""
    direction: FloatArray
    """Unit vector, y up, to the middle of the widest sector that is free of the path."""


def waypoint_labels(path: FloatArray) -> list[Label]:
    """Labels of the waypoints of a path [m], shape (n + 1, 2), that begins with its start."""
    same_place = 1e-9 + 1e-6 * float(np.ptp(path, axis=0).max())
    labels, labelled = [], set()
    for waypoint in range(1, len(path)):
        if waypoint in labelled:
            continue
        together = np.flatnonzero(np.hypot(*(path - path[waypoint]).T) <= same_place)
        labelled.update(together.tolist())
        neighbours = path[[n for node in together for n in (node - 1, node + 1) if 0 <= n < len(path)]]
        direction = _widest_free_direction(neighbours - path[waypoint])
        labels.append(Label(tuple(int(node) - 1 for node in together if node > 0), path[waypoint], direction))
    return labels


def _widest_free_direction(legs: FloatArray) -> FloatArray:
    """Unit vector to the middle of the widest sector between legs, shape (n, 2)."""
    angles = np.sort(np.arctan2(legs[:, 1], legs[:, 0]))
    sectors = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    # Sectors that differ only by rounding count as equal.
    widest = int(np.argmax(np.round(sectors, 6)))
    middle = angles[widest] + 0.5 * sectors[widest]
    return np.array([np.cos(middle), np.sin(middle)])


FAINT_INK: Colour = (128, 136, 148)
LIMB: Colour = (70, 77, 88)
BODY: Colour = (205, 210, 217)
HEATED_PLUS: Colour = (23, 62, 196)
HEATED_MINUS: Colour = (38, 148, 240)
TRAIL: Colour = (212, 120, 130)
PLANNED: Colour = (190, 198, 208)
ROCK: Colour = (176, 168, 158)
CURRENT_WATER: Colour = (96, 160, 186)
FLOW: Colour = (176, 209, 224)

DONE, TO_COME, CURRENT = range(3)
"""States of a waypoint."""
STATE_COLOURS: tuple[Colour, Colour, Colour] = ((46, 157, 98), (150, 158, 170), (232, 119, 10))

LEGEND = (
    ("\u2212 clockwise", HEATED_MINUS),
    ("+ anti-clockwise", HEATED_PLUS),
    ("next", STATE_COLOURS[CURRENT]),
    ("reached", STATE_COLOURS[DONE]),
    ("way", TRAIL),
)
"""Words and colours of the legend from right to left: the heated limbs, the waypoints, the way of the hub."""

LARGEST, SMALLEST = (960, 720), (320, 240)
"""Width and height of a picture [px]: of one robot alone, and the smallest that can be read."""
VIEW_MARGIN = 1.1
"""Room [limb lengths] around the start and the waypoints, so that a robot that rests on one of them is in view."""
REFIT_MARGIN = 0.5
"""Room [limb lengths] gained beyond a robot that left the view, so that the view moves in few steps."""

FLOW_SPACING = 4.5
"""Distance of the arrows of a current [heights of letters]."""
POINTER = 0.3
"""Length of the arrow of an asked heading [limb lengths]."""
ROOT = 0.34
"""Share of a limb, from the hub on, whose colour shows how warm its wires are."""


def limb_nodes(n_limbs: int, nodes_per_limb: int) -> NDArray[np.int_]:
    """Numbers of the nodes of every limb from hub to tip, shape (n_limbs, nodes_per_limb)."""
    beyond_the_hub = 1 + np.arange(n_limbs * (nodes_per_limb - 1)).reshape(n_limbs, -1)
    return np.hstack([np.zeros((n_limbs, 1), int), beyond_the_hub])


class Renderer:
    """Renderer of a robot on its path.

    `draw` returns an array and needs no display; `show` draws into a window. The view is fitted to the path, and
    widened in steps where a robot leaves it; `reset` takes a new path and fits the view to it.
    """

    def __init__(
        self,
        robot: Seastar,
        waypoints: ArrayLike,
        waypoint_radius: float,
        size: tuple[int, int] = LARGEST,
        headings: ArrayLike | None = None,
    ) -> None:
        """
        robot: One, of numbers. waypoints: Planned path from the origin [m], shape (n, 2).
        waypoint_radius: Radius of the waypoints [m]. size: Width and height of the picture [px].
        headings: Asked headings at the waypoints [rad], shape (n,). None draws none.
        """
        if size[0] < SMALLEST[0] or size[1] < SMALLEST[1]:
            smallest = f"{SMALLEST[0]} x {SMALLEST[1]}"
            raise ValueError(f"A picture must be at least {smallest} pixels, not {size[0]} x {size[1]}.")
        self._robot, self._waypoint_radius = robot, waypoint_radius
        self._limb_nodes = limb_nodes(robot.n_limbs, robot.nodes_per_limb)
        self.size = size
        self._text_height = max(12, round(0.027 * min(size)))
        self._canvas = Canvas(size, self._text_height)
        self._window = Window()
        self._flow: tuple[Camera, AnyCurrent | None, Flow] | None = None
        self.reset(waypoints, headings=headings)

    def reset(
        self,
        waypoints: ArrayLike,
        robot: Seastar | None = None,
        headings: ArrayLike | None = None,
        waypoint_radius: float | None = None,
    ) -> None:
        """Take a new path [m], shape (n, 2), and fit the view to it.

        robot: With as many nodes, and other sizes perhaps. None means the same.
        headings: Asked headings at the waypoints [rad], shape (n,). None draws none.
        waypoint_radius: [m]. None means the same.
        """
        self._waypoint_radius = self._waypoint_radius if waypoint_radius is None else waypoint_radius
        self._headings = None if headings is None else np.array(headings, dtype=np.float64)
        self._robot = robot or self._robot
        self._waypoints = np.array(waypoints, dtype=np.float64)
        self._path = np.concatenate([np.zeros((1, 2)), self._waypoints])
        self._labels = waypoint_labels(self._path)
        width, height = self.size
        strip = round(2.0 * self._text_height)
        margin = VIEW_MARGIN * self._robot.limb_length
        corners = np.concatenate([self._path - margin, self._path + margin])
        self.camera = Camera(corners, (0, strip, width, height - 2 * strip))

    def draw(self, frame: Frame) -> NDArray[np.uint8]:
        """Picture of a frame: red, green, blue, shape (height, width, 3), a fresh array."""
        self._paint(frame)
        return self._canvas.pixels()

    def show(self, frame: Frame, fps: float | None = None) -> bool:
        """Draw a frame into the window, which the first call opens; False, and no drawing, once the user closed it.

        fps: Largest number of frames per second; None for no limit.
        """
        if not self._window.is_wanted(self.size):
            return False
        self._paint(frame)
        self._window.show(self._canvas.picture, fps)
        return True

    def close(self) -> None:
        """Close the window, if one is open; may be called again."""
        self._window.close()

    def _paint(self, frame: Frame) -> None:
        self._check(frame)
        for points in (frame.positions, frame.roots, frame.outline, frame.scenery.points):
            if points is not None and len(points) and not self.camera.sees(points):
                self.camera = self.camera.widened(points, REFIT_MARGIN * self._robot.limb_length)
        self._paint_background(frame)
        if len(frame.trail) > 1:
            self._canvas.polyline(self.camera.to_pixels(frame.trail), TRAIL, width=2)
        self._number_waypoints(frame.waypoint_index)
        self._paint_robot(frame)
        self._mark_limb_1(frame)
        self._name_limbs(frame)
        self._write_header(frame)
        self._write_footer(", ".join(filter(None, (self._flow_in(frame.current).words, frame.scenery.note))))
        self._canvas.finish()

    def _paint_background(self, frame: Frame) -> None:
        """Everything below the trail, which stays from picture to picture where there is no scenery."""
        shows = (self.camera, frame.waypoint_index, frame.current) if frame.scenery is NOTHING else None
        if self._canvas.begin(WATER, shows):
            return
        for arrow in self._flow_in(frame.current).arrows:
            self._paint_flow(self.camera.to_pixels(arrow))
        self._paint_scenery(frame.scenery)
        self._paint_planned_path()
        self._paint_waypoints(frame.waypoint_index)
        self._paint_headings(frame.waypoint_index)
        self._canvas.keep()

    def _check(self, frame: Frame) -> None:
        n_limbs, nodes_per_limb = self._limb_nodes.shape
        n_nodes = n_limbs * (nodes_per_limb - 1) + 1
        if frame.positions.shape != (n_nodes, 2) or not np.isfinite(frame.positions).all():
            raise ValueError(f"Positions to draw must be finite and of shape ({n_nodes}, 2).")
        if frame.command.shape != (n_limbs,):
            raise ValueError(f"A command to draw must have shape ({n_limbs},), not {frame.command.shape}.")
        if frame.trail.ndim != 2 or frame.trail.shape[1] != 2 or not np.isfinite(frame.trail).all():
            raise ValueError("A trail to draw must be finite and of shape (k, 2).")

    def _paint_scenery(self, scenery: Scenery) -> None:
        for line in scenery.lines:
            self._canvas.polyline(self.camera.to_pixels(line), PLANNED, width=2)
        for obstacle in scenery.obstacles:
            self._canvas.dot(self.camera.to_pixels(obstacle.centre), ROCK, obstacle.radius * self.camera.scale)
        for ring in scenery.rings:
            centre = self.camera.to_pixels(ring.centre)
            self._paint_ring(centre, max(4.0, ring.radius * self.camera.scale), CURRENT)
            if ring.label:
                self._canvas.write(ring.label, centre, INK, (0.5, 0.5))
        for arrow in scenery.arrows:
            self._paint_arrow(self.camera.to_pixels(arrow))

    def _flow_in(self, current: AnyCurrent | None) -> Flow:
        """Arrows of a current over the whole view, kept until it or the view changes."""
        if self._flow is None or self._flow[0] is not self.camera or self._flow[1] != current:
            low, high = self.camera.in_view
            spacing = FLOW_SPACING * self._text_height / self.camera.scale
            self._flow = self.camera, current, flow_of(current, low, high, spacing)
        return self._flow[2]

    def _paint_flow(self, ends: FloatArray) -> None:
        """Faint arrow from ends[0] to ends[1] [px]."""
        along = ends[1] - ends[0]
        back = -min(1.0, 0.45 * self._text_height / float(np.hypot(*along))) * along
        across = 0.6 * back[::-1] * [-1.0, 1.0]
        self._canvas.polyline(ends, FLOW, width=2)
        self._canvas.polyline(ends[1] + np.array([back + across, [0.0, 0.0], back - across]), FLOW, width=2)

    def _paint_arrow(self, ends: FloatArray) -> None:
        """Arrow from ends[0] to ends[1] [px]; as a dot where it is short."""
        along = ends[1] - ends[0]
        length, head = float(np.hypot(*along)), 0.6 * self._text_height
        self._canvas.stroke(ends, CURRENT_WATER, width=3.0)
        if length > 0.0:
            for turn in np.radians([150.0, -150.0]):
                c, s = np.cos(turn), np.sin(turn)
                back = np.array([c * along[0] - s * along[1], s * along[0] + c * along[1]]) * (head / length)
                self._canvas.stroke(np.array([ends[1], ends[1] + back]), CURRENT_WATER, width=3.0)

    def _paint_ring(self, centre: FloatArray, radius: float, state: int) -> None:
        line = 3.0 if state == CURRENT else 2.0
        self._canvas.dot(centre, STATE_COLOURS[state], radius + line / 2)
        self._canvas.dot(centre, mixed(STATE_COLOURS[state], WATER, 0.15), radius - line / 2)

    def _paint_planned_path(self) -> None:
        for start, end in zip(self._path[:-1], self._path[1:], strict=True):
            for dash in _dashes(self.camera.to_pixels([start, end]), 0.45 * self._text_height):
                self._canvas.stroke(dash, PLANNED, width=2.0)
        self._canvas.dot(self.camera.to_pixels([0.0, 0.0]), PLANNED, radius=max(2.5, 0.16 * self._text_height))

    def _waypoints_to_paint(self, waypoint_index: int) -> list[tuple[int, int]]:
        """States and numbers: where a path passes a point twice, the current one covers one to come, that one done."""
        return sorted((_state(index, waypoint_index), index) for index in range(len(self._waypoints)))

    def _paint_waypoints(self, waypoint_index: int) -> None:
        radius = self._ring_radius()
        for state, index in self._waypoints_to_paint(waypoint_index):
            self._paint_ring(self.camera.to_pixels(self._waypoints[index]), radius, state)

    def _paint_headings(self, waypoint_index: int) -> None:
        """Arrows from the waypoints in the directions of their asked headings."""
        if self._headings is None:
            return
        radius, length = self._ring_radius(), POINTER * self._robot.limb_length * self.camera.scale
        for state, index in self._waypoints_to_paint(waypoint_index):
            towards = np.array([np.cos(self._headings[index]), -np.sin(self._headings[index])])
            tip = self.camera.to_pixels(self._waypoints[index]) + (radius + length) * towards
            barbs = tip - 0.35 * length * (towards + np.outer([0.6, -0.6], towards[::-1] * [-1.0, 1.0]))
            line = 3.5 if state == CURRENT else 2.5
            self._canvas.stroke(np.array([tip - length * towards, tip]), STATE_COLOURS[state], line)
            self._canvas.stroke(np.array([barbs[0], tip, barbs[1]]), STATE_COLOURS[state], line)

    def _mark_limb_1(self, frame: Frame) -> None:
        """Mark on the tip of limb 1, which the heading is that of, where headings are asked for."""
        if self._headings is None:
            return
        tip = self.camera.to_pixels(frame.positions[self._limb_nodes[0, -1]])
        radius = max(3.5, 0.3 * self._text_height)
        self._canvas.dot(tip, WATER, radius + 1.5)
        self._canvas.dot(tip, STATE_COLOURS[CURRENT], radius)

    def _ring_radius(self) -> float:
        return max(4.0, self._waypoint_radius * self.camera.scale)

    def _paint_robot(self, frame: Frame) -> None:
        nodes = frame.positions[self._limb_nodes]
        if frame.roots is not None:
            nodes[:, 0] = frame.roots
        limbs = self.camera.to_pixels(nodes)
        width = max(0.16 * self._text_height, 2 * self._robot.rod_radius * self.camera.scale)
        widths = width * np.where(frame.command == 0.0, 1.0, 1.6)
        self._paint_body(frame, width)
        for limb, limb_width in zip(limbs, widths, strict=True):
            self._canvas.stroke(limb, WATER, limb_width + 3.0)  # a rim that lifts the robot off its trail
        for limb, limb_width, command in sorted(
            zip(limbs, widths, frame.command, strict=True), key=lambda drawn: abs(drawn[2])
        ):
            self._canvas.stroke(limb, _limb_colour(command), limb_width)
        if frame.wire_state is not None:
            for limb, limb_width, wire_state in zip(limbs, widths, frame.wire_state, strict=True):
                self._canvas.stroke(limb[: 1 + round(ROOT * (len(limb) - 1))], _warm_colour(wire_state), limb_width)
        self._canvas.dot(self.camera.to_pixels(frame.positions[0]), LIMB, radius=1.3 * width)

    def _paint_body(self, frame: Frame, width: float) -> None:
        if frame.outline is not None and len(frame.outline):
            corners = self.camera.to_pixels(frame.outline)
            rim = np.concatenate([corners, corners[:1]])
            self._canvas.stroke(rim, WATER, width + 3.0)
            self._canvas.area(corners, BODY)
            self._canvas.stroke(rim, LIMB, 0.5 * width)

    def _number_waypoints(self, waypoint_index: int) -> None:
        for label in self._labels:
            text = ", ".join(str(index + 1) for index in label.indices)
            half_extent = 0.5 * np.abs(label.direction) @ self._canvas.text_size(text)
            distance = self._ring_radius() + 0.1 * self._text_height + half_extent
            place = self.camera.to_pixels(label.place) + distance * label.direction * [1.0, -1.0]
            colour = STATE_COLOURS[max(_state(index, waypoint_index) for index in label.indices)]
            self._canvas.write(text, place, mixed(colour, INK, 0.6), (0.5, 0.5))

    def _name_limbs(self, frame: Frame) -> None:
        """Numbers of the limbs beyond their tips, as commands name them, with the sign of those that are heated."""
        last_edges = frame.positions[self._limb_nodes[:, -1]] - frame.positions[self._limb_nodes[:, -2]]
        angles = np.arctan2(last_edges[:, 1], last_edges[:, 0])
        outward = np.column_stack([np.cos(angles), -np.sin(angles)])
        places = self.camera.to_pixels(frame.positions[self._limb_nodes[:, -1]]) + 1.1 * self._text_height * outward
        for limb, (command, place) in enumerate(zip(frame.command, places, strict=True), start=1):
            name = f"{limb}{_sign(command) if command else ''}"
            self._canvas.write(name, place, _limb_colour(command), (0.5, 0.5))

    def _write_header(self, frame: Frame) -> None:
        width, _ = self.size
        middle = 1.1 * self._text_height
        self._canvas.write(f"t = {frame.time:.1f} s", (self._text_height, middle), INK, (0.0, 0.5))
        told = frame.scenery.progress
        progress = self._progress(frame.waypoint_index) if told is None else told
        self._canvas.write(progress, (width - self._text_height, middle), INK, (1.0, 0.5))
        heated = [(f" {limb + 1}{_sign(c)}", _limb_colour(c)) for limb, c in enumerate(frame.command) if c != 0.0]
        words = [("heated:", INK), *(heated or [(" none", FAINT_INK)])]
        x = 0.5 * (width - sum(self._canvas.text_size(text)[0] for text, _ in words))
        for text, colour in words:
            x = self._canvas.write(text, (x, middle), colour, (0.0, 0.5))

    def _progress(self, waypoint_index: int) -> str:
        n_waypoints = len(self._waypoints)
        if waypoint_index < n_waypoints:
            return f"waypoint {waypoint_index + 1} of {n_waypoints}"
        return "path completed"

    def _write_footer(self, note: str) -> None:
        width, height = self.size
        gap, middle = self._text_height, height - 1.1 * self._text_height
        length = _round_length(0.13 * width / self.camera.scale)
        end = gap + length * self.camera.scale
        self._scale_bar(gap, end, middle)
        end = self._canvas.write(f"{1000.0 * length:g} mm", (end + 0.5 * gap, middle), INK, (0.0, 0.5))
        room, x = width - end - gap, float(width)
        legend = sum(self._canvas.text_size(text)[0] + 2.9 * gap for text, _ in LEGEND)
        if note and legend + self._canvas.text_size(note)[0] + 1.5 * gap > room:  # no room between scale and legend
            self._canvas.write(note, (gap, middle - 1.6 * self._text_height), FAINT_INK, (0.0, 0.5))
        elif note:
            self._canvas.write(note, (end + 1.5 * gap, middle), FAINT_INK, (0.0, 0.5))
        for text, colour in LEGEND:
            x -= self._canvas.text_size(text)[0] + 2.9 * gap
            if width - x > room:
                return  # the picture is too narrow for more of the legend
            self._canvas.stroke(np.array([[x, middle], [x + 1.2 * gap, middle]]), colour, width=0.4 * gap)
            self._canvas.write(text, (x + 1.9 * gap, middle), INK, (0.0, 0.5))

    def _scale_bar(self, start: float, end: float, middle: float) -> None:
        tick = 0.3 * self._text_height
        self._canvas.stroke(np.array([[start, middle], [end, middle]]), INK, width=2.0)
        for x in (start, end):
            self._canvas.stroke(np.array([[x, middle - tick], [x, middle + tick]]), INK, width=2.0)


def _dashes(ends: FloatArray, length: float) -> FloatArray:
    """Dashes of about a length [px] along a segment [px], shape (2, 2): shape (n, 2, 2); both ends begin a dash."""
    start, end = ends
    n_dashes = max(1, round((float(np.hypot(*(end - start))) / length + 1.0) / 2.0))
    fractions = np.arange(2 * n_dashes).reshape(n_dashes, 2) / (2 * n_dashes - 1)
    dashes: FloatArray = start + fractions[..., None] * (end - start)
    return dashes


def _round_length(longest: float) -> float:
    """Longest length [m] among 1, 2, 5, 10, ... times a power of ten that is not above `longest` [m]."""
    decade = 10.0 ** np.floor(np.log10(longest))
    return float(decade * max(digit for digit in (1.0, 2.0, 5.0) if digit * decade <= longest))


def _state(index: int, waypoint_index: int) -> int:
    if index == waypoint_index:
        return CURRENT
    return TO_COME if index > waypoint_index else DONE


def _limb_colour(command: float) -> Colour:
    if command == 0.0:
        return LIMB
    return HEATED_PLUS if command > 0.0 else HEATED_MINUS


def _warm_colour(wire_state: FloatArray) -> Colour:
    """Colour of the warmer wire, the stronger the warmer; wire_state: Of wires + and -, shape (2,)."""
    plus, minus = wire_state
    return mixed(HEATED_PLUS if plus >= minus else HEATED_MINUS, LIMB, float(max(plus, minus)))


def _sign(command: float) -> str:
    return "+" if command > 0.0 else "\u2212"


Picture = NDArray[np.uint8]

SHEET_WIDTH = 1920
"""Width [px] of a sheet of pictures side by side, as long as they are no smaller than SMALLEST."""


def picture_size(n_pictures: int) -> tuple[int, int]:
    """Width and height [px] of each of `n_pictures` pictures, for a sheet that can still be looked at."""
    width = min(LARGEST[0], max(SMALLEST[0], SHEET_WIDTH // math.ceil(math.sqrt(n_pictures))))
    width -= width % 4  # videos need even numbers
    return width, width * 3 // 4


class Trail:
    """Places of a hub [m], in an array that grows: a copy for every frame would cost the square of their number."""

    def __init__(self, *places: FloatArray):
        self._kept, self._length = np.empty((64, 2)), 0
        for place in places:
            self.append(place)

    def append(self, place: FloatArray) -> None:
        """Add a place. Those that were seen stay."""
        if self._length == len(self._kept):
            self._kept = np.concatenate([self._kept, np.empty_like(self._kept)])
        self._kept[self._length] = place
        self._length += 1

    @property
    def places(self) -> FloatArray:
        """Those up to now, shape (k, 2)."""
        return self._kept[: self._length]


class BatchPictures:
    """Trails and views of all robots, drawn one after the other by one renderer when they are asked for."""

    def __init__(self, robots: Robots):
        self._robots = robots
        self._trails = [Trail() for _ in range(robots.n_robots)]
        self._cameras: dict[int, Camera] = {}
        self._renderer: Renderer | None = None
        self._shown: int | None = None
        """Robot whose path and view the renderer has."""

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_renderer": None, "_shown": None}

    def begin(self, begun: NDArray[np.bool_]) -> None:
        """Forget the trails and views of the robots in a mask, shape (n_robots,): they begin an episode."""
        hub = self._robots.simulator.hub_position()
        for robot in np.flatnonzero(begun).tolist():
            self._trails[robot] = Trail(hub[robot])
            self._cameras.pop(robot, None)
        self._shown = None

    def follow(self) -> None:
        """Extend all trails to the present positions of the hubs."""
        for trail, hub in zip(self._trails, self._robots.simulator.hub_position(), strict=True):
            trail.append(hub)

    def frames(self, wanted: Iterable[int]) -> list[Frame]:
        """What pictures of the robots of these numbers show now."""
        return list(frames_of(self._robots, {robot: self._trails[robot].places for robot in wanted}))

    def draw(self, wanted: Iterable[int]) -> tuple[Picture, ...]:
        """Pictures of the robots of these numbers, shape (height, width, 3) each."""
        numbers = list(wanted)
        frames = dict(zip(dict.fromkeys(numbers), self.frames(numbers), strict=True))
        return tuple(self._draw(robot, frames[robot]) for robot in numbers)

    def _draw(self, robot: int, frame: Frame) -> Picture:
        picture = self.renderer_of(robot).draw(frame)
        self._cameras[robot] = self.renderer_of(robot).camera
        return picture

    def show(self, fps: float) -> None:
        """Show the picture of robot 0 in a window, no faster than `fps` pictures per second."""
        self.renderer_of(0).show(self.frames([0])[0], fps=fps)
        self._cameras[0] = self.renderer_of(0).camera

    def renderer_of(self, robot: int) -> Renderer:
        """The renderer, with the path and the view of a robot."""
        if self._renderer is not None and self._shown == robot:
            return self._renderer
        robots, task = self._robots, self._robots.task
        body, waypoints = robots.simulator.scene.of_robot(robot).robot, task.waypoints_of(robots, robot)
        headings, radius = task.headings_of(robots, robot), task.radius_of(robots, robot)
        if self._renderer is None:
            self._renderer = Renderer(body, waypoints, radius, picture_size(robots.n_robots))
        self._renderer.reset(waypoints, body, headings, radius)
        self._renderer.camera = self._cameras.get(robot, self._renderer.camera)
        self._shown = robot
        return self._renderer

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = self._shown = None
