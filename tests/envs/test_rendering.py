"""Pictures show what the robot does, need no display, and depend on nothing but what they are given."""

from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import Body, Scene, Seastar, Simulator
from seastar_gym.envs.paths import PATHS, make_path
from seastar_gym.envs.rendering import SMALLEST, Frame, Renderer, body_of
from seastar_gym.envs.scenery import Ring, Scenery
from seastar_gym.scene.water import ShearCurrent, UniformCurrent, Vortex

pygame = pytest.importorskip("pygame")

ROBOT = Seastar(nodes_per_limb=10)


def frame_of(hub=(0.0, 0.0), command=(0, 0, 0, 0, 0), trail=((0.0, 0.0),), waypoint_index=0, time=0.0, robot=ROBOT):
    nodes = robot.nodes() + hub
    return Frame(nodes, np.array(command, dtype=float), np.array(trail, dtype=float), waypoint_index, time)


def renderer_of(path="pentagon", size=(480, 360), headings=None, robot=ROBOT):
    waypoints = make_path(path, np.random.default_rng(0)) if isinstance(path, str) else np.array(path)
    return Renderer(robot, waypoints, 0.01, size, headings)


# What is painted


class Recording:
    """Canvas that writes down what it is told to paint; its letters are half as wide as high."""

    def __init__(self, renderer: Renderer):
        self.size, self.height, self.lines = renderer.size, renderer._text_height, []

    def begin(self, background, shows=None):
        self.lines.append(f"{self.size} on {background}")
        return False

    def keep(self):
        self.lines.append("keep")

    def finish(self):
        self.lines.append("finish")

    def painted(self, what, points, colour, width=0.0):
        places = " ".join(f"{x + 1e-7:.1f}" for x in np.ravel(points))
        self.lines.append(f"{what} {bytes(colour).hex()} {width:.2f}: {places}")

    def polyline(self, points, colour, width):
        self.painted("line", points, colour, width)

    def stroke(self, points, colour, width):
        self.painted("stroke", points, colour, width)

    def area(self, corners, colour):
        self.painted("area", corners, colour)

    def dot(self, centre, colour, radius):
        self.painted("dot", centre, colour, radius)

    def text_size(self, text):
        return np.array([0.5 * self.height * len(text), self.height])

    def write(self, text, place, colour, anchor):
        self.painted(f"{text!r} {anchor}", place, colour)
        width, _ = self.text_size(text)
        return place[0] - anchor[0] * width + width


FEW = Seastar(nodes_per_limb=3)
SCENERY = Scenery(
    rings=(Ring(np.array([-0.2, 0.25]), 0.02, "3"), Ring(np.array([0.3, 0.3]), 1e-4)),
    obstacles=(Ring(np.array([0.33, 0.1]), 0.04),),
    lines=(np.array([[-0.3, 0.0], [-0.2, 0.1], [-0.1, 0.0]]),),
    arrows=(np.array([[-0.3, -0.2], [-0.2, -0.15]]), np.array([[0.3, -0.2], [0.3, -0.2]])),
    note="wires 1 and 2 swapped",
)  # fmt: skip
CROSSING = [[0.15, 0.0], [0.15, 0.2], [0.0, 0.2], [0.15, 0.2], [-0.1, 0.3]]
FRAMES = {
    "rest": ({}, {}, {}),
    "large": ({"size": (960, 720)}, {"command": (1, -1, 0.5, 0, -0.2), "waypoint_index": 3, "time": 12.34}, {}),
    "small": ({"path": "line", "size": SMALLEST}, {"waypoint_index": 1}, {}),
    "wide": ({"path": "square", "size": (640, 360)}, {}, {"current": ShearCurrent(0.02)}),
    "vortex": ({}, {}, {"current": Vortex(1e-3, 0.05, 0.1, 0.03)}),
    "uniform": ({}, {}, {"current": UniformCurrent(3e-3, -4e-3)}),
    "far": ({"path": "line"}, {"hub": (-1.0, 2.0), "trail": [(0.0, 0.0), (-0.5, 1.0), (-1.0, 2.0)]}, {}),
    "scenery": ({"path": CROSSING, "headings": [0.0, 1.0, 2.0, -1.0, 3.0]}, {"waypoint_index": 1},
                {"scenery": SCENERY, "wire_state": np.linspace(0.0, 1.0, 10).reshape(5, 2)}),
    "body": ({"path": "line"}, {"hub": (0.05, 0.0)}, {
        "roots": FEW.nodes()[1::2] / 5.0, "outline": np.array([[-2.0, -1.0], [1.0, -1.0], [1.0, 1.5]]),
        "scenery": Scenery(progress="3 caught", note="a note")}),
}  # fmt: skip
"""Arguments of a renderer and of a frame, and what else the frame has."""


@pytest.mark.parametrize("name", FRAMES)
def test_what_is_painted_is_what_was_painted(name, golden):
    of_renderer, of_frame, more = FRAMES[name]
    renderer = renderer_of(**of_renderer, robot=FEW)
    renderer._canvas = canvas = Recording(renderer)
    renderer._paint(replace(frame_of(**of_frame, robot=FEW), **more))
    golden(f"{name}.txt", "\n".join(canvas.lines) + "\n")


# Pictures


@pytest.mark.parametrize("size", [(480, 360), (960, 720), (321, 247)])
def test_a_picture_is_rgb_of_the_size_asked_for_and_the_same_for_the_same_frame_in_memory_of_its_own(size):
    renderer, frame = renderer_of(size=size), frame_of(hub=(0.02, 0.01), command=(1, 0, -1, 0, 0), time=3.0)
    first = renderer.draw(frame)
    kept = first.copy()
    assert first.dtype == np.uint8 and first.shape == (size[1], size[0], 3) and first.flags.writeable
    assert (renderer.draw(frame_of(hub=(0.05, 0.05))) != first).any()
    np.testing.assert_array_equal(first, kept)
    for again in (renderer, renderer_of(size=size)):
        np.testing.assert_array_equal(again.draw(frame), first)


def test_what_is_kept_of_a_picture_shows_in_no_other():
    """A renderer that has drawn others draws every picture as a new one does."""
    renderer, far = renderer_of(), frame_of(hub=(0.5, 0.3))
    scenery = Scenery(rings=(Ring(np.array([0.1, 0.1]), 0.02),), note="a note")
    frames = [frame_of(), frame_of(command=(1, 0, 0, 0, -1)), frame_of(hub=(0.02, 0.01), trail=((0, 0), (0.02, 0.01)))]
    flowing = replace(frame_of(), current=ShearCurrent(0.02))
    frames += [frame_of(waypoint_index=2), far, frame_of(waypoint_index=2), replace(frame_of(), scenery=scenery)]
    frames += [flowing, frame_of(), replace(flowing, scenery=scenery)]
    for frame in [*frames, *frames[::-1], frames[0], frames[0]]:
        picture, new = renderer.draw(frame), renderer_of()
        new.camera = renderer.camera
        np.testing.assert_array_equal(picture, new.draw(frame))


def test_a_body_is_where_its_robot_is_and_turns_with_it():
    scene = Scene(Seastar(3, 4, body=Body.rectangle(0.06, 0.02)))
    simulator, angles = Simulator(scene, 2), np.array([0.0, 0.7])
    simulator.reset(heading=angles)
    roots, outlines = body_of(simulator)
    corners = scene.robot.body.shape.drawn() @ [1.0, 1.0j]
    np.testing.assert_allclose(outlines @ [1.0, 1.0j], corners * np.exp(1j * angles)[:, None], atol=1e-12)
    np.testing.assert_array_equal(roots, simulator.root_positions())
    assert body_of(Simulator(Scene(Seastar(3, 4)))) == (None, None)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("size", [(480, 360), (960, 720)])
def test_the_robot_is_in_view_at_the_start_and_at_every_waypoint(name, size):
    renderer = renderer_of(name, size)
    for waypoint in [[0.0, 0.0], *make_path(name, np.random.default_rng(0))]:
        assert renderer.camera.sees(frame_of(hub=waypoint).positions)


def test_the_view_keeps_proportions_stands_still_and_follows_a_robot_that_leaves_it():
    """It has y up, and still shows the path."""
    renderer = renderer_of("line")
    before, far_away = renderer.camera, frame_of(hub=(-1.0, 2.0))
    origin, right, above = before.to_pixels([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
    np.testing.assert_allclose(right - origin, [0.1 * before.scale, 0.0], atol=1e-9)
    np.testing.assert_allclose(above - origin, [0.0, -0.1 * before.scale], atol=1e-9)
    renderer.draw(frame_of(hub=(0.1, 0.0)))
    assert renderer.camera is before and not before.sees(far_away.positions)
    renderer.draw(far_away)
    assert renderer.camera.sees(far_away.positions) and renderer.camera.sees(np.array([[0.0, 0.0], [0.3, 0.0]]))
    outline = np.array([[-2.0, -1.0], [1.0, -1.0], [1.0, 3.5]])  # of a body that reaches farther than the limbs
    assert not renderer.camera.sees(outline)
    renderer.draw(replace(frame_of(), outline=outline, roots=np.full((5, 2), 4.5)))
    assert renderer.camera.sees(outline) and renderer.camera.sees(np.full((1, 2), 4.5))
    renderer.reset(make_path("square", np.random.default_rng(0)))  # a new path is drawn as by a new renderer
    np.testing.assert_array_equal(renderer.draw(frame_of()), renderer_of("square").draw(frame_of()))


@pytest.mark.parametrize("path", [[[0.0, 0.0]], [[0.1, 0.0], [0.1, 0.0]], [[0.0, 0.0], [0.1, 0.1], [0.0, 0.0]]])
def test_paths_that_stay_in_place_and_empty_and_long_trails_are_drawn(path):
    for trail in (np.zeros((0, 2)), np.random.default_rng(0).normal(0.0, 0.1, (5000, 2))):
        assert renderer_of(path).draw(frame_of(trail=trail)).any()


# Windows


def test_a_window_opens_shows_the_picture_and_closes(dummy_window):
    renderer, frame = renderer_of(), frame_of(command=(1, -1, 0, 0, 0))
    assert renderer.show(frame)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    np.testing.assert_array_equal(shown, renderer.draw(frame))
    for _ in range(2):  # and may be shown again
        renderer.close()
        assert not pygame.display.get_init()
        renderer.close()
        assert renderer.show(frame)
    renderer.close()


def test_a_window_closed_by_the_user_stays_closed(dummy_window):
    renderer = renderer_of()
    assert renderer.show(frame_of())
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for _ in range(2):
        assert not renderer.show(frame_of())
        assert not pygame.display.get_init()


def test_no_display_for_a_window_is_one_warning(monkeypatch):
    pygame.display.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    renderer = renderer_of()
    with pytest.warns(UserWarning, match=r'No window can be opened here .*render_mode="rgb_array"') as told:
        assert renderer.show(frame_of()) and renderer.show(frame_of(), fps=0.001)
    assert len(told) == 1
    renderer.close()
