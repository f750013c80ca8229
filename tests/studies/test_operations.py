"""The operations of a Newton iteration grow in proportion to the nodes and stay below a bound."""

import re

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Numerics, Scene, Seastar, der
from studies.speed.operations import count_operations, flops

THE_CHAPTERS = Seastar(discretisation="chapter")


def iteration_flops(**robot):
    return flops(count_operations(Scene(robot=Seastar(**robot)))["iteration"])


@pytest.mark.parametrize(
    ("robot", "iteration", "divisions", "roots", "step"),
    [(THE_CHAPTERS, 11_600, 227, 91, 1_300), (TEN, 13_720, 276, 137, 1_310)],
    ids=["chapter", "continuum"],
)
def test_an_iteration_costs_no_more_than_when_it_was_tuned(robot, iteration, divisions, roots, step):
    # These bounds show on any machine when kernels become slower. Lower them when kernels become faster.
    parts = count_operations(Scene(robot, numerics=Numerics.preset("chapter")))
    assert flops(parts["iteration"]) <= iteration
    assert parts["iteration"]["divide"] <= divisions
    assert parts["iteration"]["root"] <= roots
    assert flops(parts["step"]) <= step


def test_parts_add_up_to_the_iteration():
    parts = count_operations(Scene())
    names = ("hub hinges", "limbs", "ring", "substitution")
    assert sum(flops(parts[name]) for name in names) == flops(parts["iteration"])


def test_every_node_of_a_limb_costs_the_same():
    counts = [iteration_flops(nodes_per_limb=n) for n in (10, 20, 40)]
    assert counts[2] - counts[1] == 2 * (counts[1] - counts[0])


def test_every_limb_costs_the_same():
    counts = [iteration_flops(n_limbs=n, nodes_per_limb=4) for n in (4, 6, 8)]
    assert counts[2] - counts[1] == counts[1] - counts[0]


def test_a_count_does_not_depend_on_the_scenes_numbers():
    assert iteration_flops(youngs_modulus=1e4, limb_length=0.2) == iteration_flops()


@pytest.mark.parametrize("fluid_scene", [Scene(), Scene(fluid=None)], ids=["water", "vacuum"])
def test_counting_leaves_the_real_kernels_as_they_are(fluid_scene):
    import seastar_gym.der.potential as potential

    before = potential.factorise
    count_operations(fluid_scene)
    import seastar_gym.der.potential as again

    assert again.factorise is before
    assert np.isfinite(flops(count_operations(fluid_scene)["iteration"]))


def test_the_table_of_the_rods_says_what_is_counted():
    parts = count_operations(Scene(THE_CHAPTERS, numerics=Numerics.preset("chapter")))
    for part in ("hub hinges", "limbs", "ring", "substitution"):
        (kflop,) = re.findall(rf"^{part} +([\d.]+) ", der.__doc__, flags=re.MULTILINE)
        assert float(kflop) == round(flops(parts[part]) / 1e3, 1)
    nodes = 45
    per_node = [round(parts["limbs"][kind] / nodes) for kind in ("multiply", "fused", "add")]
    per_node += [round(parts["limbs"][kind] / nodes, 1) for kind in ("divide", "root")]
    kinds = ("products", "fused products", "sums", "divisions", "roots")
    said = [re.search(rf"([\d.]+) {kind}", der.__doc__.partition("A node of a limb")[2]) for kind in kinds]
    assert [float(number[1]) for number in said] == per_node
    assert f"{flops(parts['limbs']) / nodes:.0f} flop per node" in der.__doc__
