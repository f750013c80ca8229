"""Old names of this release's changes still work, and say what the new ones are."""

import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym import HeadingTargets, SmaWires, renamed
from seastar_gym.envs.options import SwimOptions
from seastar_gym.envs.task import SwimTask
from seastar_gym.scene.actuators.actuator import complete
from seastar_gym.scene.serial import from_dict, to_dict


def attribute_of(path: str):
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)


@pytest.mark.parametrize("old, new", renamed.MODULES.items())
def test_a_module_is_imported_by_its_old_name(old, new, monkeypatch):
    monkeypatch.delitem(sys.modules, old, raising=False)
    with pytest.warns(DeprecationWarning, match=f"{old} is called {new} now"):
        assert importlib.import_module(old) is importlib.import_module(new)
    monkeypatch.delitem(sys.modules, old)


@pytest.mark.parametrize("old, new", renamed.NAMES.items())
def test_a_class_or_function_is_found_by_its_old_name(old, new):
    with pytest.warns(DeprecationWarning, match=f"{old} is called {new} now"):
        assert attribute_of(old) is attribute_of(new)


@pytest.mark.parametrize("module", ["seastar_gym", *dict.fromkeys(old.rpartition(".")[0] for old in renamed.NAMES)])
def test_names_that_never_were_are_not_there(module):
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        attribute_of(f"{module}.nothing")


def test_options_are_taken_by_their_old_names():
    with pytest.warns(DeprecationWarning, match="--ship is called --publish now"):
        assert renamed.options(["--ship", "--out", "ship"]) == ["--publish", "--out", "ship"]
    with pytest.warns(DeprecationWarning, match="--ship-anyway"):
        assert renamed.option("--ship-anyway=True") == "--publish-anyway=True"


def test_actuators_take_and_have_their_old_names():
    with pytest.warns(DeprecationWarning, match=r"SmaWires\(deaf=...\) is called SmaWires\(refractory=...\) now"):
        wires = SmaWires(deaf=True)
    assert wires == SmaWires(refractory=True) and SmaWires.__init__.__name__ == "__init__"
    with pytest.warns(DeprecationWarning, match="SmaWires.deaf is called refractory now"):
        assert wires.deaf
    with pytest.warns(DeprecationWarning, match="SmaWires.deaf_wires is called refractory_wires now"):
        assert not wires.deaf_wires(wires.rest).any()
    with pytest.warns(DeprecationWarning, match="deaf"):
        assert replace(wires, deaf=False) == SmaWires()


def test_scenes_of_before_are_read_without_a_warning():
    for part in (SmaWires(refractory=True), HeadingTargets("random")):
        kinds = {now: before for before, now in renamed.KINDS.items()}
        old = {now: before for before, now in renamed.ARGUMENTS[type(part).__name__].items()}
        data = {old.get(name, name): value for name, value in to_dict(part).items()}
        assert from_dict({**data, "kind": kinds.get(data["kind"], data["kind"])}, type(part)) == part


def test_actuators_of_ones_own_answer_by_their_old_names():
    with pytest.warns(DeprecationWarning, match="ActuatorBase.can_be_deaf is called can_be_refractory now"):

        class Derived(SmaWires):
            can_be_deaf = True

    class Alone:
        peak_angle, period, corners, can_be_deaf = 0.3, 1.0, (0.0, 1.0), True

        def delta_psi(self, t):
            return np.zeros_like(t)

    assert Derived().can_be_refractory
    with pytest.warns(DeprecationWarning, match="can_be_deaf"):
        assert complete(Alone()).can_be_refractory


def test_tasks_of_ones_own_score_by_their_old_names():
    with pytest.warns(DeprecationWarning, match="Swimming._score is called _reward_terms now"):

        class Older(SwimTask):
            def _score(self, hub, pulses):
                with pytest.warns(DeprecationWarning, match="SwimTask._score is called _reward_terms now"):
                    score = super()._score(hub, pulses)
                return score._replace(terms={**score.terms, "reward_more": np.ones(self.n_robots)})

    class Newer(Older):
        def _reward_terms(self, hub, pulses):
            score = super()._reward_terms(hub, pulses)
            return score._replace(terms={**score.terms, "reward_last": np.ones(self.n_robots)})

    task = Newer(SwimOptions(fidelity="fast"), 1, 1)
    task.reset(np.ones(1, bool), [np.random.default_rng(0)])
    names = [*task._reward_terms(np.zeros((1, 2)), np.zeros(1)).terms]
    assert names[-2:] == ["reward_more", "reward_last"] and len(names) == len(set(names))
