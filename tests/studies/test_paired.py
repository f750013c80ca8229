"""A scene without a term runs the code of a package that never had it."""

import ast
import json
from contextlib import nullcontext

import numpy as np
import pytest

from refusals import assert_refused
from seastar_gym import Numerics, Scene
from seastar_gym.der.rods import Rods
from seastar_gym.studies import paired
from seastar_gym.studies.operations import count_operations
from seastar_gym.studies.removal import ABSENT, copy_without, cut_out, optional_terms

TERMS = optional_terms()
CUTS = {**{term: (term,) for term in TERMS}, "all": TERMS}


@pytest.fixture(scope="module", params=CUTS)
def copy(request, tmp_path_factory):
    """(the terms that are cut out, the copy without them)"""
    cut = CUTS[request.param]
    return cut, copy_without(cut, tmp_path_factory.mktemp(request.param))


def test_terms_are_the_fields_that_scenes_may_go_without():
    assert {"cross_drag", "added_mass", "relaxation_time", "current", "load"} <= set(TERMS) < set(Rods._fields)
    assert all(getattr(Scene().rods(), term) is None for term in TERMS)


def test_a_scene_without_a_term_computes_what_it_would_had_there_never_been_one(copy):
    kernels = copy[1] / "der"
    for numerics in (Numerics.preset("chapter"), Numerics.preset("balanced")):
        scene = Scene(numerics=numerics)
        ours, theirs = count_operations(scene), count_operations(scene, kernels)
        for part in ours:
            # Numbers that are loaded for a term alone are left out by the compiler.
            assert {**ours[part], "load": 0} == {**theirs[part], "load": 0}


def test_nothing_of_a_term_is_left_in_the_copy(copy):
    cut, package = copy
    kernels = [
        node
        for file in sorted((package / "der").glob("*.py"))
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.FunctionDef) and any("kernel" in ast.unparse(each) for each in node.decorator_list)
    ]
    source = "\n".join(map(ast.unparse, kernels))
    assert ABSENT not in source
    assert not [term for term in cut if f"rods.{term}" in source.replace("rods.load_", "")]
    assert ("is None" in source) == (cut != TERMS)


SOURCE = """
class Rods:
    mass: object
    term: object | None

@kernel
def add_term(term, row, energy):
    if term is None:
        return energy
    return helper(energy, load(term, row))

@kernel
def helper(a, b):
    return a + b

@kernel
def term_or_zero(term, row):
    if term is None:
        return splat(0.0)
    return load(term, row)

@kernel
def potential(rods, row):
    return add_term(rods.term, row, load(rods.mass, row) - term_or_zero(rods.term, row))

made = Rods(mass=1, term=2)
"""

WITHOUT = """
class Rods:
    mass: object

@kernel
def potential(rods, row):
    return load(rods.mass, row)

made = Rods(mass=1)
"""


def test_what_is_cut_out_is_the_term_its_zeros_and_its_helpers():
    tree = ast.parse(SOURCE)
    cut_out(("term",), [tree])
    assert ast.unparse(tree) == ast.unparse(ast.parse(WITHOUT))


def test_instructions_that_differ_are_counted_on_both_sides():
    ours, theirs = {"a": {"add": 3, "mul": 1}}, {"a": {"add": 1}, "b": {"add": 2}}
    assert paired.differing(ours, theirs) == paired.differing(theirs, ours) == 5
    assert paired.differing(ours, ours) == 0


def test_a_folder_without_the_package_is_refused_though_another_package_is_found(tmp_path, monkeypatch):
    build, answer, script = tmp_path / "build", tmp_path / "answer.json", tmp_path / "worker.py"
    script.write_text(f"print(open({str(answer)!r}).read())")
    monkeypatch.setattr(paired.paired_worker, "__file__", str(script))
    for found, is_refused in ((build, False), (tmp_path, True), (build / "deeper", True)):
        answer.write_text(json.dumps({"package": str(found / "seastar_gym" / "__init__.py")}))
        expected = assert_refused("no package seastar_gym", str(build)) if is_refused else nullcontext()
        with paired.Worker(build, tmp_path, []) as worker, expected:
            worker.wait()


@pytest.mark.parametrize("counts", [(0, 1), (1, 0)])
def test_nothing_to_compare_is_refused(tmp_path, counts):
    with assert_refused("must be a whole number from 1", "not 0"):
        paired.compare({}, tmp_path, *counts)


@pytest.mark.slow
def test_builds_without_terms_end_strokes_with_the_same_bits(tmp_path):
    build = copy_without(TERMS, tmp_path / "without").parent
    (one,) = paired.compare({"without": build}, tmp_path, processes=1, rounds=2)
    assert one.same_bits
    assert one.others < 0.02 * one.instructions
    assert one.ratios.shape == (len(paired.SETTINGS), 1) and np.isfinite(one.ratios).all()
    assert paired.as_table([one]).row_count == 1 and paired.as_table([one, one]).row_count == 3
