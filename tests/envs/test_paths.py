"""Paths visit what their names say, refuse what is no path, and measure distance along and across themselves."""

from functools import partial

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from refusals import assert_refused
from seastar_gym import Attachment, Body, Seastar
from seastar_gym.envs import paths
from seastar_gym.envs.paths import PATHS, cross_track_error, make_path, path_length, register_path, shortest_way
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.stations import (
    at_stations,
    body_heading,
    node_weights,
    of_beginning,
    stations,
    stations_of,
    weights,
)
from slopes import rotated

ORIGIN = np.zeros(2)


def path_of(path, seed=0):
    return make_path(path, np.random.default_rng(seed))


def legs_and_turns(waypoints):
    legs = np.diff(np.vstack([ORIGIN, waypoints]), axis=0)
    headings = np.arctan2(legs[:, 1], legs[:, 0])
    turns = (np.diff(np.concatenate([[0.0], headings])) + np.pi) % (2 * np.pi) - np.pi
    return np.hypot(*legs.T), turns


@pytest.mark.parametrize("name, n_sides, side", [("pentagon", 5, 0.1437), ("square", 4, 0.2), ("triangle", 3, 0.25)])
def test_polygons_have_equal_sides_equal_left_turns_and_close_exactly(name, n_sides, side):
    waypoints = path_of(name)
    lengths, turns = legs_and_turns(waypoints)
    assert len(waypoints) == n_sides
    np.testing.assert_allclose(lengths, side, rtol=1e-12)
    np.testing.assert_allclose(turns[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(turns[1:], 2 * np.pi / n_sides, rtol=1e-12)
    np.testing.assert_array_equal(waypoints[-1], ORIGIN)
    np.testing.assert_allclose(path_length(np.zeros((6, 2)), np.tile(waypoints, (6, 1, 1))), [n_sides * side] * 6)
    assert path_length([0.3, 0.4], path_of("line")) == pytest.approx(0.4, rel=1e-12)


def test_the_other_paths_are_the_documented_ones_and_only_random_ones_draw():
    assert tuple(PATHS) == ("pentagon", "square", "triangle", "line", "figure-eight", "random")
    np.testing.assert_array_equal(path_of("line"), [[0.3, 0.0]])
    waypoints, (lengths, turns) = path_of("figure-eight"), legs_and_turns(path_of("figure-eight"))
    assert len(waypoints) == 16 and lengths.min() > 0.03 and np.abs(np.degrees(turns[1:])).max() < 60.0
    np.testing.assert_array_equal(waypoints[[7, 15]], np.zeros((2, 2)))
    np.testing.assert_allclose(np.ptp(waypoints[:, 0]), 0.4, rtol=1e-12)
    np.testing.assert_allclose(waypoints[8:] * [-1, 1], waypoints[:8], atol=1e-15)
    rng = np.random.default_rng(3)
    before = rng.bit_generator.state
    for name in PATHS:
        make_path(name, rng)
        assert (rng.bit_generator.state == before) == (name != "random")


def test_random_legs_and_turns_fill_their_ranges_and_follow_their_seed():
    drawn = [path_of("random", seed) for seed in range(200)]
    lengths, turns = np.swapaxes([legs_and_turns(waypoints) for waypoints in drawn], 0, 1)
    turns = np.degrees(turns)
    assert lengths.shape == (200, 5) and 0.1 - 1e-12 <= lengths.min() < 0.101 and 0.199 < lengths.max() <= 0.2 + 1e-12
    assert np.abs(turns).max() <= 120.0 + 1e-9 and turns.min() < -115.0 and turns.max() > 115.0
    assert abs(turns.mean()) < 3 * 240.0 / np.sqrt(12 * turns.size)
    np.testing.assert_array_equal(path_of("random", 7), drawn[7])


def test_cross_track_error_is_the_least_distance_over_the_segment_whichever_way_it_is_seen():
    position, start, end = np.random.default_rng(0).normal(size=(3, 100, 2))
    on_segment = start + np.linspace(0.0, 1.0, 20001)[:, None, None] * (end - start)
    least = np.hypot(*np.moveaxis(position - on_segment, -1, 0)).min(axis=0)
    np.testing.assert_allclose(cross_track_error(position, start, end), least, atol=1e-4)
    assert cross_track_error([3.0, 5.0], [0.0, 1.0], [0.0, 1.0]) == 5.0  # from a point
    assert cross_track_error(np.zeros((4, 2)), [1.0, -1.0], [1.0, 1.0]).tolist() == [1.0] * 4
    c, s = np.cos(1.234), np.sin(1.234)
    turn = np.array([[c, s], [s, -c]])
    turned = cross_track_error(position @ turn.T, start @ turn.T, end @ turn.T)
    np.testing.assert_allclose(turned, cross_track_error(position, start, end), atol=1e-14)
    np.testing.assert_allclose(turned, cross_track_error(position @ turn.T, end @ turn.T, start @ turn.T), atol=1e-14)


# The way through a waypoint's circle


def test_one_point_and_few_are_measured_to_the_bits_of_many():
    rng = np.random.default_rng(0)
    begin, waypoint, after = rng.normal(scale=0.2, size=(3, 320, 2))
    after[::3], begin[::4] = waypoint[::3], 2.0 * waypoint[::4] - after[::4]  # straight ways, and mirrored ones
    begin[::7] = after[::7]
    for measure in (cross_track_error, partial(shortest_way, radius=0.02)):
        many = measure(begin, waypoint, after)
        few = [measure(*each) for each in zip(*(np.split(part, 40) for part in (begin, waypoint, after)), strict=True)]
        assert np.concatenate(few).tobytes() == many.tobytes()
        each = [measure(*points) for points in zip(begin, waypoint, after, strict=True)]
        assert np.array(each).tobytes() == many.tobytes()


def test_the_shortest_way_is_the_shortest_of_those_by_any_point_of_the_circle():
    rng, radius = np.random.default_rng(0), 0.01
    away = radius + rng.exponential([0.001, 0.01, 0.1], size=(2, 200, 3)).reshape(2, 600)
    angles = rng.uniform(-np.pi, np.pi, size=(2, 600))
    angles[1, ::7], angles[1, 3::7] = angles[0, ::7], angles[0, 3::7] + np.pi  # in one direction, and in opposite ones
    away[1, ::5] = away[0, ::5]
    waypoints = rng.normal(size=(600, 2))
    begin, end = waypoints + away[..., None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    circle = 2.0 * np.pi * np.arange(5000)[:, None] / 5000
    touch = waypoints + radius * np.stack([np.cos(circle), np.sin(circle)], axis=-1)
    by_touch = (np.linalg.norm(touch - begin, axis=-1) + np.linalg.norm(touch - end, axis=-1)).min(axis=0)
    ways = shortest_way(begin, waypoints, end, radius)
    straight = np.linalg.norm(end - begin, axis=1)
    near = cross_track_error(waypoints, begin, end) <= radius
    assert 20 < near.sum() < 580
    np.testing.assert_allclose(ways[near], straight[near], rtol=1e-14)
    np.testing.assert_allclose(ways[~near], by_touch[~near], atol=2e-6)
    assert (ways >= straight * (1.0 - 1e-14)).all()


# Paths of one's own


def test_a_registered_path_can_be_asked_for_by_its_name_and_is_checked(monkeypatch):
    monkeypatch.setattr(paths, "PATHS", dict(PATHS))

    @register_path("zigzag")
    def zigzag(rng):
        return [[0.1, 0.1], [0.2, 0.0]]

    env = SeastarSwimEnv("zigzag", fidelity="fast")
    env.reset(seed=0)
    np.testing.assert_array_equal(env.waypoints, [[0.1, 0.1], [0.2, 0.0]])
    register_path("nowhere")(lambda rng: np.zeros((1, 2)))
    with assert_refused("must lead away from the origin"):
        path_of("nowhere")


# Stations lie on the limbs' curve, and are nodes where a node lies there.


MESHES = (2, 3, 4, 5, 7, 9, 10, 11, 19, 37, 10_000)
PLACES = np.arange(1, 10) / 9


@pytest.mark.parametrize("n", MESHES)
def test_a_station_where_a_node_lies_is_the_node_and_kernels_are_given_every_weight_that_is_not_zero(n):
    known = [k for k in range(1, 10) if k * (n - 1) % 9 == 0]
    for k in known:
        np.testing.assert_array_equal(weights(n, 10)[k - 1], np.arange(1, n) == k * (n - 1) // 9)
    assert np.count_nonzero((weights(n, 10) != 0.0).sum(axis=1) == 1) == (len(known) if n > 2 else 9)
    nodes = np.arange(1, n) / (n - 1)
    for power in range(1, min(3, n - 1) + 1):  # polynomials up to cubic are exact
        np.testing.assert_allclose(weights(n, 10) @ nodes**power, PLACES**power, rtol=0.0, atol=1e-11)
    given, rows = stations(n), np.zeros((9, n - 1))
    assert (given.n_stations, given.n_nodes) == rows.shape
    for row, first, last, own in zip(rows, given.first, given.last, given.weights.reshape(rows.shape), strict=True):
        used = slice(int(first), int(last))
        row[used] = own[used]
    np.testing.assert_array_equal(rows, weights(n, 10))


@pytest.mark.parametrize("n", range(2, 11))
def test_up_to_ten_nodes_follow_from_their_stations_and_more_lie_on_the_spline_through_them(n):
    rng = np.random.default_rng(n)
    nodes, curve = rng.normal(size=(n - 1, 2)), np.concatenate([[0.0], rng.normal(size=9)])
    np.testing.assert_allclose(node_weights(n) @ (weights(n, 10) @ nodes), nodes, rtol=0.0, atol=1e-14)
    expected = CubicSpline(np.arange(10) / 9, curve)(np.arange(1, 24) / 23)
    np.testing.assert_allclose(node_weights(24) @ curve[1:], expected, rtol=0.0, atol=1e-13)
    np.testing.assert_array_equal(node_weights(10), np.eye(9))


FRAME = Body.rectangle(0.06, 0.03, attachments=tuple(
    Attachment(x, y, np.arctan2(y, x)) for x, y in ((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015), (0.03, -0.01))
))  # fmt: skip


@pytest.mark.parametrize("body", [None, FRAME])
@pytest.mark.parametrize("n", [2, 4, 7, 10, 19])
def test_stations_begin_at_the_roots_of_straight_limbs_and_the_heading_turns_with_them(n, body):
    robot, ten, angle = (*(Seastar(4 if body else 5, nodes, body=body) for nodes in (n, 10)), 2.5)
    rest = at_stations(robot.nodes(), robot, np.zeros(()))
    np.testing.assert_allclose(rest, ten.nodes(), rtol=0.0, atol=1e-15)
    turned = rotated(robot.nodes(), angle) + [3.0, -1.0]
    for orientation in (None, np.array([angle])):
        np.testing.assert_allclose(body_heading(turned[None], robot, orientation), angle, atol=1e-13)


@pytest.mark.parametrize("n", [4, 7, 12])
def test_stations_on_a_body_lie_on_the_spline_from_the_root(n):
    robot, rng = Seastar(4, n, body=FRAME), np.random.default_rng(n)
    positions, orientation = rng.normal(size=(2, robot.n_nodes, 2)), np.array([0.7, -2.0])
    found = at_stations(positions, robot, orientation)[:, 1:].reshape(2, 4, 9, 2)
    for k, limb in np.ndindex(2, 4):
        c, s = np.cos(orientation[k]), np.sin(orientation[k])
        root = np.array([[c, -s], [s, c]]) @ robot.limb_shapes()[limb].root
        nodes = positions[k, 1:].reshape(4, n - 1, 2)[limb] - positions[k, 0]
        curve = CubicSpline(np.arange(n) / (n - 1), np.concatenate([[root], nodes]))
        np.testing.assert_allclose(found[k, limb], curve(PLACES), rtol=0.0, atol=1e-11)
    assert not of_beginning(weights(10, 10)).any() and not stations_of(Seastar(4, 10, body=FRAME)).root_weights.any()
    assert stations_of(Seastar(4, n)).root_weights is stations_of(Seastar(4, n, body=Body())).root_weights is None
