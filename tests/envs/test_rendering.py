"""Pictures show what the robot does, need no display, and depend on nothing but what they are given."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from seastar_gym import Body, Scene, Seastar, Simulator, Water
from seastar_gym.envs.frame import Frame, body_of
from seastar_gym.envs.paths import PATHS, make_path
from seastar_gym.envs.rendering import (
    CURRENT,
    FLOW,
    HEATED_MINUS,
    HEATED_PLUS,
    LARGEST,
    LEGEND,
    SMALLEST,
    STATE_COLOURS,
    Renderer,
)
from seastar_gym.envs.scenery import LONGEST, Ring, Scenery, flow_of
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.waypoint_labels import waypoint_labels
from seastar_gym.scene.currents import GridCurrent, ShearCurrent, UniformCurrent, Vortex

pygame = pytest.importorskip("pygame")

ROBOT = Seastar(nodes_per_limb=10)
LIMB_NODES = np.array([[0, *range(1 + 9 * limb, 10 + 9 * limb)] for limb in range(5)])


def resting_robot(hub=(0.0, 0.0)):
    along = np.linspace(0.1 / 9, 0.1, 9)
    angles = 2 * np.pi / 5 * np.arange(5)
    limbs = along[None, :, None] * np.column_stack([np.cos(angles), np.sin(angles)])[:, None, :]
    return np.concatenate([np.zeros((1, 2)), limbs.reshape(45, 2)]) + hub


def frame_of(hub=(0.0, 0.0), command=(0, 0, 0, 0, 0), trail=((0.0, 0.0),), waypoint_index=0, time=0.0):
    return Frame(resting_robot(hub), np.array(command, dtype=float), np.array(trail, dtype=float), waypoint_index, time)


def renderer_of(path="pentagon", size=(480, 360)):
    waypoints = make_path(path, np.random.default_rng(0)) if isinstance(path, str) else np.array(path)
    return Renderer(ROBOT, waypoints, 0.01, size)


def colour_at(picture, renderer, point):
    column, row = np.floor(renderer.camera.to_pixels(point)).astype(int)
    return picture[row, column].astype(int)


def mid_limb(limb):
    return resting_robot()[LIMB_NODES[limb - 1, 5]]


@pytest.mark.parametrize("size, most", [(LARGEST, 5), (SMALLEST, 4)])
def test_the_legend_names_as_many_colours_as_there_is_room_for(size, most):
    """Heated limbs come first: a colour is named only if those before it are."""
    strip = renderer_of(size=size).draw(frame_of())[-(size[1] // 14) :].astype(int)
    named = [bool((np.abs(strip - np.array(colour)) < 8).all(axis=-1).any()) for _, colour in LEGEND]
    assert named == sorted(named, reverse=True) and 1 <= sum(named) <= most
    assert all(named) == (size == LARGEST)


@pytest.mark.parametrize("width", range(360, 800, 40))
def test_the_legend_leaves_a_gap_behind_what_stands_left_of_it(width, monkeypatch):
    renderer = renderer_of(size=(width, 360))
    renderer.draw(frame_of())
    strokes, write, note_ends = [], renderer._canvas.write, []
    monkeypatch.setattr(renderer._canvas, "stroke", lambda points, colour, width: strokes.append(points[0, 0]))
    monkeypatch.setattr(renderer._canvas, "write", lambda text, *given: _noted(note_ends, text, write(text, *given)))
    renderer._write_footer("a note")
    assert all(x >= note_ends[0] + renderer._text_height for x in strokes[3:])


def _noted(ends, text, end):
    if text == "a note":
        ends.append(end)
    return end


def test_the_scale_bar_has_a_tick_at_either_end(monkeypatch):
    strokes, renderer = [], renderer_of()
    renderer.draw(frame_of())
    monkeypatch.setattr(renderer._canvas, "stroke", lambda points, colour, width: strokes.append(points.tolist()))
    renderer._scale_bar(10.0, 50.0, 90.0)
    (_, *ticks) = strokes
    assert strokes[0] == [[10.0, 90.0], [50.0, 90.0]] and [start[0] for start, _ in ticks] == [10.0, 50.0]
    assert all(start[0] == end[0] and start[1] + end[1] == 180.0 and end[1] - start[1] > 4.0 for start, end in ticks)


def is_blue(colour):
    red, green, blue = colour
    return blue > 150 and blue > red + 100 and blue > green + 50


@pytest.mark.parametrize("size", [(480, 360), (960, 720), (321, 247)])
def test_a_picture_is_rgb_of_the_size_asked_for(size):
    picture = renderer_of(size=size).draw(frame_of())
    assert picture.dtype == np.uint8
    assert picture.shape == (size[1], size[0], 3)
    assert picture.flags.writeable


def test_drawing_needs_no_display():
    script = (
        "import numpy as np; import pygame\n"
        "from seastar_gym.envs.frame import Frame\n"
        "from seastar_gym.envs.rendering import Renderer\n"
        "from seastar_gym.scene import Seastar\n"
        "renderer = Renderer(Seastar(2, 2), [[0.1, 0.0]], 0.01)\n"
        "positions = np.array([[0.0, 0.0], [0.1, 0.0], [-0.1, 0.0]])\n"
        "picture = renderer.draw(Frame(positions, np.array([1.0, 0.0]), positions[:1], 0, 0.0))\n"
        "assert not pygame.display.get_init()\n"
        "print(picture.shape, len(np.unique(picture)) > 20)\n"
    )
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY")
    }
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    result = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    assert result.stdout.split("\n")[-2] == "(720, 960, 3) True"


def test_importing_the_module_does_not_import_pygame():
    script = "import sys; import seastar_gym.envs.rendering; print('pygame' in sys.modules)"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "False"


@pytest.mark.parametrize("size", [(480, 360), (960, 720)])
def test_heated_limbs_are_blue_and_the_others_are_not(size):
    renderer = renderer_of(size=size)
    picture = renderer.draw(frame_of(command=(0, 1, 0, 0, -1)))
    colours = {limb: colour_at(picture, renderer, mid_limb(limb)) for limb in range(1, 6)}
    assert [limb for limb, colour in colours.items() if is_blue(colour)] == [2, 5]
    np.testing.assert_allclose(colours[2], HEATED_PLUS, atol=30)
    np.testing.assert_allclose(colours[5], HEATED_MINUS, atol=30)
    for limb in (1, 3, 4):
        assert np.ptp(colours[limb]) < 40 and colours[limb].max() < 170  # dark grey
    picture = renderer.draw(frame_of(command=(0, 0, 0.25, 0, 0)))
    assert is_blue(colour_at(picture, renderer, mid_limb(3)))  # a fraction of a command is heat, too


def test_heated_limbs_are_bolder():
    renderer = renderer_of("line", size=(960, 720))

    def thickness(command):
        column, row = np.floor(renderer.camera.to_pixels(mid_limb(1))).astype(int)
        picture = renderer.draw(frame_of(command=command)).astype(int)
        return (picture[row - 12 : row + 13, column, 0] < 150).sum()

    assert thickness((1, 0, 0, 0, 0)) >= 1.3 * thickness((0, 0, 0, 0, 0))


def test_limbs_are_equally_thick_in_every_direction():
    renderer = renderer_of("line", size=(960, 720))
    background = renderer.draw(frame_of(hub=(0.3, 0.0))).astype(int)
    picture = renderer.draw(frame_of(hub=(0.0, 0.0))).astype(int)
    ink = []
    for limb in (2, 3, 4, 5):  # limb 1 lies on the dashed line
        columns, rows = np.meshgrid(np.arange(960), np.arange(720))
        middle = renderer.camera.to_pixels(mid_limb(limb))
        near = np.hypot(columns - middle[0], rows - middle[1]) < 30
        ink.append((background - picture)[..., 0][near].sum())
    assert np.ptp(ink) < 0.06 * np.mean(ink)


def test_the_same_frame_gives_the_same_pixels_in_memory_of_their_own():
    renderer, frame = renderer_of(), frame_of(hub=(0.02, 0.01), command=(1, 0, -1, 0, 0), time=3.0)
    first = renderer.draw(frame)
    kept = first.copy()
    assert (renderer.draw(frame_of(hub=(0.05, 0.05))) != first).any()
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(renderer.draw(frame), first)
    np.testing.assert_array_equal(renderer_of().draw(frame), first)


DRAWN = Path(__file__).parent / "everything.png"
"""Picture of everything that a picture may show. Where it is to look otherwise: delete it, run its test, look at it."""


@pytest.mark.skipif(pygame.version.ver != "2.5.8", reason="another version draws letters otherwise")
def test_everything_looks_as_it_did_when_somebody_looked_at_it():
    angles = np.linspace(0.0, 6.0, 30)
    scenery = Scenery(
        rings=(Ring(np.array([-0.2, 0.25]), 0.02, "3"), Ring(np.array([0.3, 0.3]), 1e-4)),
        obstacles=(Ring(np.array([0.33, 0.1]), 0.04),),
        lines=(0.1 * np.column_stack([np.cos(angles), np.sin(2.0 * angles)]) + [-0.25, 0.0],),
        arrows=(np.array([[-0.3, -0.2], [-0.2, -0.15]]), np.array([[0.3, -0.2], [0.3, -0.2]])),
        note="wires 1 and 2 swapped",
    )  # fmt: skip
    path = np.array([[0.15, 0.0], [0.15, 0.2], [0.0, 0.2], [0.15, 0.2], [-0.1, 0.3]])
    renderer = Renderer(ROBOT, path, 0.01, (640, 480), [0.0, 1.0, 2.0, -1.0, 3.0])
    roots = 0.02 * np.exp(0.4j * np.pi * np.arange(5)) + 0.1
    frame = frame_of((0.1, 0.0), (1, -1, 0.5, 0, -0.2), [(0.0, 0.0), (0.06, 0.03), (0.1, 0.0)], 1, 3.25)
    frame = replace(
        frame, scenery=scenery, wire_state=np.linspace(0.0, 1.0, 10).reshape(5, 2),
        roots=np.column_stack([roots.real, roots.imag]), outline=np.column_stack([roots.real, roots.imag]),
    )  # fmt: skip
    picture = renderer.draw(frame).astype(float)
    if not DRAWN.exists():
        pygame.image.save(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), DRAWN)
        pytest.fail(f"{DRAWN} is drawn: look at it.")
    expected = pygame.surfarray.array3d(pygame.image.load(DRAWN)).swapaxes(0, 1).astype(float)
    assert picture.shape == expected.shape and np.abs(picture - expected).max() <= 2.0


@pytest.mark.parametrize(
    "change",
    [
        {"time": 1.0},
        {"waypoint_index": 1},
        {"waypoint_index": 5},
        {"command": np.array([1.0, 0, 0, 0, 0])},
        {"trail": np.array([[0.0, 0.0], [0.1, 0.1]])},
        {"positions": resting_robot((0.01, 0.0))},
    ],
    ids=lambda change: "-".join(change),
)
def test_everything_in_a_frame_shows(change):
    renderer = renderer_of()
    assert not np.array_equal(renderer.draw(frame_of()), renderer.draw(replace(frame_of(), **change)))


CORNERS = np.array([-0.2, -0.1]), np.array([0.2, 0.3])


def test_arrows_of_a_current_lie_along_it_and_are_as_long_as_it_is_fast():
    vortex = Vortex(1e-3, 0.05, 0.1, 0.03)
    arrows, words = flow_of(vortex, *CORNERS, 0.04)
    way, middle = np.diff(arrows, axis=1)[:, 0], arrows.mean(axis=1)
    from_centre = middle - [0.05, 0.1]
    speed = 1e-3 / (2 * np.pi) * np.hypot(*from_centre.T) / (0.03**2 + (from_centre**2).sum(axis=1))
    np.testing.assert_allclose((way * from_centre).sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*way.T), LONGEST * 0.04 * speed / speed.max())
    assert len(arrows) == 100 and words == f"current up to {1e3 * speed.max():.3g} mm/s"
    assert (middle > CORNERS[0]).all() and (middle < CORNERS[1]).all()


def test_arrows_of_every_current_show_its_velocity():
    grid = GridCurrent.from_function(lambda x, y: (0.01 * y, 0.0 * x), (-1.0, 1.0), (-1.0, 1.0), 0.1)
    np.testing.assert_allclose(
        flow_of(grid, *CORNERS, 0.05).arrows, flow_of(ShearCurrent(0.01), *CORNERS, 0.05).arrows, atol=1e-12
    )
    assert flow_of(UniformCurrent(3e-3, -4e-3), *CORNERS, 0.1).words == "current 5 mm/s"
    for none in (None, UniformCurrent()):
        assert flow_of(none, *CORNERS, 0.1).words == "" and not len(flow_of(none, *CORNERS, 0.1).arrows)


def test_a_picture_of_a_swim_in_a_current_has_its_arrows():
    drawn = {}
    for current in (None, UniformCurrent(u_x=2e-3)):
        env = SeastarSwimEnv(scene=Scene(fluid=Water(current=current)), render_mode="rgb_array")
        env.reset(seed=0)
        drawn[current] = int((np.abs(env.render().astype(int) - FLOW).max(axis=-1) < 8).sum())
    still, flowing = drawn.values()
    assert still == 0 and flowing > 2000


def test_a_body_is_where_its_robot_is_and_turns_with_it():
    scene = Scene(Seastar(3, 4, body=Body.rectangle(0.06, 0.02)))
    simulator, angles = Simulator(scene, 2), np.array([0.0, 0.7])
    simulator.reset(heading=angles)
    roots, outlines = body_of(simulator)
    corners = scene.robot.body.shape.drawn() @ [1.0, 1.0j]
    np.testing.assert_allclose(outlines @ [1.0, 1.0j], corners * np.exp(1j * angles)[:, None], atol=1e-12)
    np.testing.assert_array_equal(roots, simulator.root_positions())
    assert body_of(Simulator(Scene(Seastar(3, 4)))) == (None, None)


def test_the_current_waypoint_has_its_own_colour():
    renderer = renderer_of("square", size=(960, 720))
    picture = renderer.draw(frame_of(waypoint_index=1))
    ring = {
        index: colour_at(picture, renderer, waypoint + np.array([0.0, 0.01]))
        for index, waypoint in enumerate(make_path("square", np.random.default_rng(0))[:3])
    }
    for index, expected in enumerate(STATE_COLOURS[state] for state in (0, CURRENT, 1)):
        np.testing.assert_allclose(ring[index], expected, atol=40)


@pytest.mark.parametrize("name", PATHS)
@pytest.mark.parametrize("size", [(480, 360), (960, 720)])
def test_the_robot_is_in_view_at_the_start_and_at_every_waypoint(name, size):
    renderer = renderer_of(name, size)
    for waypoint in [[0.0, 0.0], *make_path(name, np.random.default_rng(0))]:
        assert renderer.camera.sees(resting_robot(waypoint))


def test_the_view_keeps_proportions_and_has_y_up():
    camera = renderer_of().camera
    origin, right, above = camera.to_pixels([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
    np.testing.assert_allclose(right - origin, [0.1 * camera.scale, 0.0], atol=1e-9)
    np.testing.assert_allclose(above - origin, [0.0, -0.1 * camera.scale], atol=1e-9)


def test_the_view_follows_a_robot_that_leaves_it_and_still_shows_the_path():
    renderer = renderer_of("line")
    before, far_away = renderer.camera, frame_of(hub=(-1.0, 2.0))
    assert not before.sees(far_away.positions)
    renderer.draw(far_away)
    assert renderer.camera.sees(far_away.positions)
    assert renderer.camera.sees(np.array([[0.0, 0.0], [0.3, 0.0]]))


def test_the_view_shows_all_of_a_body_that_reaches_farther_than_the_limbs():
    renderer = renderer_of("line")
    outline = np.array([[-2.0, -1.0], [1.0, -1.0], [1.0, 1.5]])
    assert not renderer.camera.sees(outline)
    renderer.draw(replace(frame_of(), outline=outline, roots=np.full((5, 2), 2.5)))
    assert renderer.camera.sees(outline) and renderer.camera.sees(np.full((1, 2), 2.5))


def test_the_view_stands_still_while_the_robot_is_in_it():
    renderer = renderer_of()
    before = renderer.camera
    renderer.draw(frame_of(hub=(0.1, 0.1)))
    assert renderer.camera is before


def test_a_new_path_is_drawn_as_by_a_new_renderer():
    renderer = renderer_of("line")
    renderer.draw(frame_of(hub=(2.0, 2.0)))
    renderer.reset(make_path("square", np.random.default_rng(0)))
    np.testing.assert_array_equal(renderer.draw(frame_of()), renderer_of("square").draw(frame_of()))


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


def test_a_place_visited_twice_carries_both_numbers():
    path = np.concatenate([np.zeros((1, 2)), make_path("figure-eight", np.random.default_rng(0))])
    numbers = [[index + 1 for index in label.indices] for label in waypoint_labels(path)]
    assert [8, 16] in numbers
    assert sorted(index for together in numbers for index in together) == list(range(1, 17))


def test_corners_are_numbered_on_their_outer_side():
    path = np.concatenate([np.zeros((1, 2)), make_path("pentagon", np.random.default_rng(0))])
    for label in waypoint_labels(path):
        outward = label.place - path[1:].mean(axis=0)
        assert label.direction @ outward > 0.99 * np.hypot(*outward)


@pytest.mark.parametrize("path", [[[0.0, 0.0]], [[0.1, 0.0], [0.1, 0.0]], [[0.0, 0.0], [0.1, 0.1], [0.0, 0.0]]])
def test_paths_that_stay_in_place_are_drawn(path):
    assert renderer_of(path).draw(frame_of()).any()


def test_long_and_empty_trails_are_drawn():
    renderer = renderer_of()
    assert renderer.draw(frame_of(trail=np.zeros((0, 2)))).any()
    assert renderer.draw(frame_of(trail=np.random.default_rng(0).normal(0.0, 0.1, (5000, 2)))).any()


def test_drawing_survives_a_stranger_who_quits_pygame():
    renderer = renderer_of()
    before = renderer.draw(frame_of())
    pygame.quit()
    np.testing.assert_array_equal(renderer.draw(frame_of()), before)


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"positions": np.full((46, 2), np.nan)}, r"Positions to draw must be finite and of shape \(46, 2\)"),
        ({"positions": np.zeros((45, 2))}, r"Positions to draw must be finite and of shape \(46, 2\)"),
        ({"command": np.zeros(4)}, r"command to draw must have shape \(5,\), not \(4,\)"),
        ({"trail": np.full((3, 2), np.inf)}, r"trail to draw must be finite and of shape \(k, 2\)"),
        ({"trail": np.zeros(2)}, r"trail to draw must be finite and of shape \(k, 2\)"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_a_sentence(change, sentence):
    with pytest.raises(ValueError, match=sentence):
        renderer_of().draw(replace(frame_of(), **change))


def test_a_picture_too_small_to_read_is_refused():
    assert renderer_of(size=SMALLEST)._text_height == 12
    with pytest.raises(ValueError, match="at least 320 x 240 pixels, not 100 x 100"):
        renderer_of(size=(100, 100))


def test_without_pygame_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(ImportError, match=r'pip install "seastar-gym\[render\]"'):
        renderer_of()


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
    assert not renderer.show(frame_of())
    assert not pygame.display.get_init()
    assert not renderer.show(frame_of())
    assert not pygame.display.get_init()


def test_a_window_survives_a_stranger_who_quits_pygame(dummy_window):
    renderer = renderer_of()
    renderer.show(frame_of())
    pygame.quit()
    assert renderer.show(frame_of())
    renderer.close()


def test_two_renderers_may_take_turns_in_the_window(dummy_window):
    small, large = renderer_of(), renderer_of(size=(640, 480))
    assert small.show(frame_of()) and large.show(frame_of()) and small.show(frame_of())
    small.close()
    assert large.show(frame_of())
    large.close()


def test_frames_are_shown_no_faster_than_asked(dummy_window):
    renderer = renderer_of()
    renderer.show(frame_of(), fps=20)
    start = pygame.time.get_ticks()
    for _ in range(4):
        renderer.show(frame_of(), fps=20)
    assert pygame.time.get_ticks() - start >= 190
    renderer.close()


def test_a_window_where_nobody_looks_is_refused(monkeypatch):
    """SDL has a driver without a display, and takes it without being asked."""
    pygame.display.quit()
    for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    monkeypatch.setattr(pygame.display, "init", lambda: None)
    with pytest.warns(UserWarning, match=r"there is no display.*seastar swim --film"):
        assert renderer_of().show(frame_of())
    pygame.display.quit()


def test_no_display_for_a_window_is_one_warning(monkeypatch):
    pygame.display.quit()
    monkeypatch.setenv("SDL_VIDEODRIVER", "no-such-driver")
    renderer = renderer_of()
    with pytest.warns(UserWarning, match=r'No window can be opened here .*render_mode="rgb_array"') as told:
        assert renderer.show(frame_of()) and renderer.show(frame_of(), fps=0.001)
    assert len(told) == 1
    renderer.close()
