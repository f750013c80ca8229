"""The study of mutants, on a toy package: what it changes, what it leaves alone, and what its verdicts are."""

import subprocess

from studies import mutants
from studies.mutants import changed, drawn, mutants_of, study

CODE = '''
"""A message of 3."""
LIMIT: int = 3


def larger(x: int | None, y):
    if x is None:
        raise ValueError(f"not {1 + 1}")
    return x < y


def unused(x):
    return x + 1
'''
TEST = """
from toy.code import larger


def test_larger():
    assert larger(1, 2) and not larger(2, 1)
"""
ROOMS = {"toy": "tests/toy"}


def make_checkout(root):
    for name, text in (("toy/code.py", CODE), ("tests/toy/test_code.py", TEST)):
        (root / name).parent.mkdir(parents=True)
        (root / name).write_text(text)
    for command in (["init", "-q"], ["add", "."]):
        subprocess.run(["git", *command], cwd=root, check=True)


def test_operators_numbers_conditions_and_results_change_and_words_and_types_do_not(tmp_path):
    make_checkout(tmp_path)
    found = {changed(tmp_path, mutant)[1] for mutant in mutants_of(tmp_path, "toy/code.py")}
    assert found == {
        "LIMIT: int = 4", "if x is not None:", "if False:", "return x <= y", "return None", "return x - 1",
        "return x + 2",
    }  # fmt: skip


def test_a_seed_draws_the_same_mutants_and_another_seed_others(tmp_path):
    make_checkout(tmp_path)
    first = drawn(tmp_path, ROOMS, 3, 0)
    assert first == drawn(tmp_path, ROOMS, 3, 0) != drawn(tmp_path, ROOMS, 3, 1)
    assert len(set(first)) == 3


def test_mutants_are_killed_survive_are_not_covered_or_are_equivalent_and_the_checkout_stays(tmp_path, monkeypatch):
    make_checkout(tmp_path)
    monkeypatch.setattr(mutants, "PRELOADED", ())
    monkeypatch.setenv("PYTEST_ADDOPTS", "--numprocesses=2")
    monkeypatch.setitem(mutants.EQUIVALENT, ("toy/code.py", "LIMIT: int = 4"), "Nobody reads it.")
    found = study(tmp_path, ROOMS, 8, 0, 60.0, tmp_path / "out")
    said = {(each["before"], each["after"]): verdict for verdict, some in found["mutants"].items() for each in some}
    assert said["if x is None:", "if x is not None:"] == said["return x < y", "return None"] == "killed"
    assert said["return x < y", "return x <= y"] == said["if x is None:", "if False:"] == "survived"
    assert said["return x + 1", "return x - 1"] == "not covered"
    assert said["LIMIT: int = 3", "LIMIT: int = 4"] == "equivalent"
    assert found["killed"] == 2 and found["share_killed"] == round(2 / 7, 4)
    assert (tmp_path / "toy/code.py").read_text() == CODE
