"""Whatever is given as an argument is taken, as a file says, or refused with a ValueError of one sentence."""

import time

import numpy as np
import pytest

import documented
from fuzz import odd
from odd_values import ODD, taken
from refusals import assert_refused
from seastar_gym import AlongLimb, Body, Limb, MeasuredCurve, Scene, Seastar, Strip
from seastar_gym.controllers.open_loop import OpenLoopPolicy
from seastar_gym.envs.commands import to_commands
from seastar_gym.envs.paths import make_path
from seastar_gym.identify import Measurement
from seastar_gym.scene.serial import from_dict

FUNCTIONS = ("watch", "on_step", "make", "function")
"""Arguments that are functions of the caller's: what they raise is theirs."""


TOP_LEVEL = odd.PARTS | odd.SIMULATOR_CALLS | odd.ENV_CALLS
DOCUMENTED = sorted(documented.documented().keys() - documented.UNCALLED)


def calls_of(name):
    """Functions to call with odd values, and arguments that each accepts. Those of the top level have no other ones."""
    if name not in TOP_LEVEL:
        return [(call, arguments) for known, call, arguments in documented.calls() if known == name]
    call, arguments = TOP_LEVEL[name]
    return [(call, documented.complete(call, arguments))]


@pytest.fixture(autouse=True)
def folder_of_ones_own(tmp_path, monkeypatch):
    """Odd names of files are names of files."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", [*TOP_LEVEL, *DOCUMENTED])
def test_odd_values_are_taken_as_before_or_refused_in_a_sentence(name, golden):
    found = [line for call, arguments in calls_of(name) for line in taken(call, arguments, FUNCTIONS)]
    assert found
    golden(f"{name}.txt", "\n".join(found))


MANY = 10**6
MILLIONS = {
    "loads": lambda: Scene(loads=((9, 0.0, 1e-9),) * MANY),
    "held nodes": lambda: Scene(held_nodes=(9,) * MANY),
    "loads of a file": lambda: Scene.from_dict({**Scene().to_dict(), "loads": [[9, 0.0, 1e-9]] * MANY}),
    "limbs of a file": lambda: from_dict({"version": 1, "kind": "Seastar", "limbs": [{}] * MANY}, Seastar),
    "a profile": lambda: Limb(radius=(1e-3,) * MANY),
    "a section": lambda: Strip((1e-3,) * MANY, 1e-2),
    "an actuator along a limb": lambda: AlongLimb(0.3, (1.0,) * MANY),
    "an outline": lambda: Body(outline=((0.1, 0.1),) * MANY),
    "a curve": lambda: MeasuredCurve((0.0,) * MANY, (0.0,) * MANY),
    "a path": lambda: make_path([(0.1, 0.1)] * MANY, np.random.default_rng(0)),
    "a gait": lambda: OpenLoopPolicy([[1.0, -1.0, 0.0, 0.0, 0.0]] * MANY, "joint"),
    "nodes": lambda: Measurement(np.zeros(1), np.zeros((1, 1, 2)), (0,) * MANY, np.zeros((1, 5))),
}


@pytest.mark.parametrize("name", MILLIONS)
def test_a_million_entries_are_refused_before_each_is_looked_at(name):
    begin = time.process_time()
    with assert_refused("entries", "are the most"):
        MILLIONS[name]()
    assert time.process_time() - begin < 6.0


def test_a_million_robots_are_read_and_long_gaits_known_without_a_table_for_each_command():
    gait, data = np.random.default_rng(0).integers(-1, 2, (100_000, 5)).astype(float), Scene().to_dict()
    data["robot"]["youngs_modulus"] = {"kind": "per robot", "items": [1e6] * MANY}
    begin = time.process_time()
    assert Scene.from_dict(data).n_robots == MANY
    actions = OpenLoopPolicy(gait, "joint").predict(np.zeros(1))[0]
    assert time.process_time() - begin < 4.0
    np.testing.assert_array_equal(to_commands("joint", 5, [actions], 1)[0], gait[0])


# Whatever a simulator or an environment is given, it is taken or refused in one sentence, and loses nothing.


CHECKS = (odd.check_odd_call, odd.SIMULATOR_CALLS), (odd.check_odd_env_call, odd.ENV_CALLS)


@pytest.mark.parametrize(
    "check, name, argument",
    [(check, name, argument) for check, calls in CHECKS for name, (_, given) in calls.items() for argument in given],
)
def test_what_has_a_state_refuses_in_one_sentence_and_loses_nothing(check, name, argument):
    odd.begin()
    for value in ODD.values():
        check(name, argument, value)
