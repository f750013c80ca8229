"""The study of the cost of terms compares scenes with one more term each, in the same round."""

import numpy as np

from seastar_gym import Scene
from seastar_gym.model.rods import make_rods
from studies.speed.terms import THE_CHAPTERS, as_table, in_ten_nodes, measure, scenes


def test_costs_are_relative_to_the_first_scene():
    costs = measure({"this": Scene(), "the same": Scene()}, rounds=3)
    assert [cost.name for cost in costs] == ["this", "the same"]
    assert costs[0].per_iteration == costs[0].per_stroke == 1.0
    assert costs[1].iterations == costs[0].iterations >= 1.0
    assert costs[1].quartiles[0] <= costs[1].per_iteration <= costs[1].quartiles[1]
    assert as_table(costs).row_count == 2


def test_every_scene_has_terms_of_its_own():
    compared = scenes()
    assert next(iter(compared)) == THE_CHAPTERS and compared[THE_CHAPTERS] == in_ten_nodes(Scene())
    assert len({hash(scene) for scene in compared.values()}) == len(compared)
    assert np.isfinite([make_rods(scene).stretching.EA[0] for scene in compared.values()]).all()
