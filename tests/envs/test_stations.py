"""Stations lie on the limbs' curve, and are nodes where a node lies there."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from seastar_gym import Attachment, Body, Seastar
from seastar_gym.envs.stations import (
    at_stations,
    body_heading,
    node_weights,
    of_beginning,
    stations,
    stations_of,
    weights,
)

MESHES = (2, 3, 4, 5, 7, 9, 10, 11, 19, 37, 10_000)
PLACES = np.arange(1, 10) / 9


@pytest.mark.parametrize("n", MESHES)
def test_a_station_where_a_node_lies_is_the_node(n):
    known = [k for k in range(1, 10) if k * (n - 1) % 9 == 0]
    for k in known:
        np.testing.assert_array_equal(weights(n, 10)[k - 1], np.arange(1, n) == k * (n - 1) // 9)
    assert np.count_nonzero((weights(n, 10) != 0.0).sum(axis=1) == 1) == (len(known) if n > 2 else 9)


@pytest.mark.parametrize("n", MESHES)
def test_polynomials_up_to_cubic_are_exact(n):
    nodes = np.arange(1, n) / (n - 1)
    for power in range(1, min(3, n - 1) + 1):
        np.testing.assert_allclose(weights(n, 10) @ nodes**power, PLACES**power, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("n", [4, 5, 7, 12, 100])
def test_stations_lie_on_the_spline_through_the_nodes(n):
    nodes, curve = np.arange(n) / (n - 1), np.random.default_rng(n).normal(size=n)
    expected = CubicSpline(nodes, curve)(PLACES) - curve[0]
    np.testing.assert_allclose(weights(n, 10) @ (curve[1:] - curve[0]), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("n", range(2, 11))
def test_up_to_ten_nodes_follow_from_their_stations(n):
    nodes = np.random.default_rng(n).normal(size=(n - 1, 2))
    np.testing.assert_allclose(node_weights(n) @ (weights(n, 10) @ nodes), nodes, rtol=0.0, atol=1e-14)


def test_more_nodes_lie_on_the_spline_through_the_stations():
    curve = np.concatenate([[0.0], np.random.default_rng(0).normal(size=9)])
    expected = CubicSpline(np.arange(10) / 9, curve)(np.arange(1, 24) / 23)
    np.testing.assert_allclose(node_weights(24) @ curve[1:], expected, rtol=0.0, atol=1e-13)
    np.testing.assert_array_equal(node_weights(10), np.eye(9))


@pytest.mark.parametrize("n", MESHES)
def test_kernels_are_given_every_weight_that_is_not_zero(n):
    given, rows = stations(n), np.zeros((9, n - 1))
    assert (given.n_stations, given.n_nodes) == rows.shape
    for row, first, last, own in zip(rows, given.first, given.last, given.weights.reshape(rows.shape), strict=True):
        used = slice(int(first), int(last))
        row[used] = own[used]
    np.testing.assert_array_equal(rows, weights(n, 10))


@pytest.mark.parametrize("n", [2, 4, 7, 10, 19])
def test_a_straight_robot_has_its_stations_on_its_limbs_and_its_heading_turns_with_it(n):
    robot, angle = Seastar(nodes_per_limb=n), 2.5
    ten = Seastar(nodes_per_limb=10)
    np.testing.assert_allclose(at_stations(robot.nodes(), robot), ten.nodes(), rtol=0.0, atol=1e-15)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned = robot.nodes() @ turn + [3.0, -1.0]
    np.testing.assert_allclose(body_heading(turned[None], robot), angle, atol=1e-13)


FRAME = Body.rectangle(0.06, 0.03, attachments=tuple(
    Attachment(x, y, np.arctan2(y, x)) for x, y in ((0.03, 0.015), (-0.03, 0.015), (-0.03, -0.015), (0.03, -0.01))
))  # fmt: skip


@pytest.mark.parametrize("n", [2, 4, 7, 10, 19])
def test_stations_on_a_body_begin_at_the_roots_and_its_heading_turns_with_it(n):
    robot, angle = Seastar(4, n, body=FRAME), 2.5
    rest = at_stations(robot.nodes(), robot, np.zeros(()))
    np.testing.assert_allclose(rest, Seastar(4, 10, body=FRAME).nodes(), rtol=0.0, atol=1e-15)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    turned = robot.nodes() @ turn + [3.0, -1.0]
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


def test_with_ten_nodes_and_without_a_body_roots_have_no_part():
    assert not of_beginning(weights(10, 10)).any() and not stations_of(Seastar(4, 10, body=FRAME)).root_weights.any()
    assert stations_of(Seastar(4, 7)).root_weights is None
    assert stations_of(Seastar(4, 7, body=Body())).root_weights is None


def test_cached_weights_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        weights(7, 10)[0] = 0.0
