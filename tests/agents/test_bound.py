"""The searches leave nothing out that symmetry does not bring back, and find what is known."""

import itertools
import json

import numpy as np
import pytest

from seastar_gym import Numerics, Scene
from seastar_gym.controllers.scripted import to_actions
from seastar_gym.envs.commands import command_table
from seastar_gym.envs.symmetry import action_table
from seastar_gym.gaits import pair_gait
from studies.command import main
from studies.learning.bound import (
    all_directions,
    distinct_gaits,
    draw,
    measure,
    mixed_speed,
    search_path,
)

FAST = Scene(numerics=Numerics.preset("fast"))


@pytest.mark.parametrize(("period", "actions", "classes"), [(1, "pairs", 5), (1, "joint", 30), (2, "pairs", 35)])
def test_every_gait_is_the_image_of_exactly_one(period, actions, classes):
    gaits = distinct_gaits(period, actions)
    assert len(gaits) == classes
    images = [
        {tuple(np.roll(carried[gait], shift)) for carried in action_table(actions, 5) for shift in range(period)}
        for gait in gaits
    ]
    n_actions = len(command_table(actions, 5))
    assert set().union(*images) == set(itertools.product(range(n_actions), repeat=period))
    assert sum(map(len, images)) == n_actions**period


def test_the_alternation_is_faster_than_either_pair():
    pairs = to_actions(np.concatenate([pair_gait(3, 4), pair_gait(2, 5)]), "pairs", 5)
    gaits = np.array([[pairs[0], pairs[0]], [pairs[1], pairs[1]], pairs])
    first, second, both = np.linalg.norm(measure(FAST, gaits, "pairs").hub, axis=1)
    assert both > 1.05 * max(first, second)


def test_gaits_in_turns_make_the_speeds_of_their_convex_hull():
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [0.5, 0.0]])
    np.testing.assert_allclose(mixed_speed(square, np.radians([0.0, 45.0, 180.0])), [1.0, np.sqrt(2.0), 1.0])


def test_directions_are_turned_and_mirrored():
    ten = all_directions(np.array([[np.cos(0.1), np.sin(0.1)]]))
    angles = np.sort(np.arctan2(ten[:, 1], ten[:, 0]))
    expected = np.concatenate([k * 0.4 * np.pi + np.array([-0.1, 0.1]) for k in (-2, -1, 0, 1, 2)])
    np.testing.assert_allclose(angles, expected, atol=1e-12)


def test_the_path_search_visits_all_waypoints_or_says_that_it_did_not():
    corner = np.array([[0.03, 0.0], [0.03, 0.03]])
    assert 8 <= len(search_path(FAST, corner, "pairs", beam=4)) <= 12
    assert len(search_path(FAST, corner, "pairs", beam=1, max_strokes=3)) == 0


def test_the_pentagon_alone_can_be_searched_at_any_fidelity_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["learning.bound", "--only-pentagon", "--pentagon-beam", "1"]) == 0
    strokes = int(capsys.readouterr().out.split()[1])
    assert 145 < strokes < 180 and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_study_writes_numbers_and_a_picture(tmp_path):
    file = tmp_path / "bound.json"
    assert main(["learning.bound", "--pentagon-beam", "1", "--agents", "greedy", "--out", str(file)]) == 0
    results = json.loads(file.read_text(encoding="utf-8"))
    assert results["fastest_gaits"][0]["searched"] == 30
    assert len(results["pentagon"]["gait"]) == results["pentagon"]["strokes"] > 150
    draw(results, tmp_path / "again.png")
    assert file.with_suffix(".png").stat().st_size > 10_000
