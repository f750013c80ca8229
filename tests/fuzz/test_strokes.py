"""Whatever is drawn, strokes end, robots keep their bits in any company, and what is conserved stays."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random
from typing import NamedTuple

import numpy as np
import pytest

from fuzz import hour
from fuzz.promises import PROMISES, TAME_PROMISES, in_vacuum
from fuzz.scenes import (
    BENT,
    CHAPTER,
    COMPILED,
    CONTACT,
    EVERYTHING,
    FLUID,
    OWN,
    PLAIN,
    TERMS,
    TOUCHED_BODY,
    Case,
    Draw,
    Terms,
    draw_case,
    draw_parts,
    drawn,
)
from odd_values import REFUSED, TAKEN, outcome
from seastar_gym import Limited, SmaPulse, Water

pytestmark = pytest.mark.filterwarnings("ignore:Limbs of robot:RuntimeWarning")


@drawn(200, [*COMPILED, TOUCHED_BODY, BENT])
def test_a_scene_is_accepted_or_refused_in_one_sentence(terms, seed):
    draw = Draw(Random(seed), 4 if OWN in terms else None)
    found = outcome(draw_parts, {"draw": draw, "terms": terms})
    assert found in (TAKEN, REFUSED), found


def in_water(case: Case) -> Case:
    return case._replace(scene=replace(case.scene, fluid=case.scene.fluid or Water()))


def limited(case: Case) -> Case:
    """The same robots, whose actuators are too slow and too short, and begin at rest: they may remember otherwise."""
    peak, period = float(np.max(case.scene.actuator.peak_angle)), case.scene.actuator.period
    pulse = SmaPulse(peak, 0.4 * period, 0.6 * period)
    actuator = Limited(pulse, 0.8 * peak or None, 2.0 * peak / period or None)
    return case._replace(scene=replace(case.scene, actuator=actuator), state=case.state._replace(actuators=None))


class Trial(NamedTuple):
    """What is tried: promises by name, of so many cases of these terms in turn, tame ones, changed and slow."""

    promises: tuple[str, ...]
    count: int
    terms: Sequence[Terms] = COMPILED
    wild: bool = True
    change: Callable[[Case], Case] = lambda case: case
    slow: bool = False


SEEN = [PLAIN, CONTACT, FLUID, frozenset({CHAPTER})]
EVERYWHERE = ("strokes end", "bits alone", "bits in other lanes")
TRIALS = {
    "strokes end finite or with a failure that is told and in bounded work": Trial(("strokes end",), 27),
    "a robot has the same bits alone and beside robots in trouble": Trial(("bits alone",), 18),
    "in every lane and batch": Trial(("bits in other lanes",), 15),
    "on any number of threads": Trial(("bits on threads",), 5),
    "in parts and from a state that is set again": Trial(("bits in parts",), 15),
    "from a state that is set again within a stroke": Trial(("bits of pieces",), 15),
    "free robots in vacuum keep their momentum": Trial(("momentum",), 30, [PLAIN, CONTACT]),
    "implicit euler without commands creates no energy": Trial(("energy",), 30, [PLAIN]),
    "alike turned, mirrored and elsewhere": Trial(("frames",), 32, SEEN, wild=False),
    "alike seen from a moving frame": Trial(("moving frame",), 45, [PLAIN, CONTACT, FLUID], wild=False),
    "water with contact and nothing else": Trial(EVERYWHERE, 10, [CONTACT], change=in_water),
    "contact in vacuum": Trial(EVERYWHERE, 10, [CONTACT], change=in_vacuum),
    "chapter-like robots with contact": Trial(EVERYWHERE, 15, [CONTACT], wild=False, change=in_water),
    "robots with numbers of their own": Trial(EVERYWHERE, 12, [terms for terms in COMPILED if OWN in terms]),
    "all terms with limited actuators": Trial(EVERYWHERE, 20, [EVERYTHING], change=limited, slow=True),
    "all terms with numbers of each robot": Trial(EVERYWHERE, 20, [frozenset(TERMS)], slow=True),
    "hub hinges of the chapter that touch": Trial(EVERYWHERE, 20, [CONTACT | {CHAPTER}], slow=True),
    "limbs on a body, and limbs that bend": Trial(EVERYWHERE, 15, [TOUCHED_BODY, BENT], slow=True),
    "free robots with a body keep their momentum": Trial(("momentum",), 30, [TOUCHED_BODY], slow=True),
    "they swim alike in every frame": Trial(("frames",), 10, [TOUCHED_BODY, BENT], wild=False, slow=True),
}


@pytest.mark.parametrize(
    "trial", [pytest.param(trial, id=name, marks=[pytest.mark.slow] * trial.slow) for name, trial in TRIALS.items()]
)
def test_promises_are_kept(trial):
    for each in trial.terms:

        @drawn(-(-trial.count // len(trial.terms)), [each])
        def kept(terms, seed):
            case = trial.change(draw_case(Random(seed), terms, wild=trial.wild))
            for name in trial.promises:
                (PROMISES | TAME_PROMISES)[name](case)

        kept()


@pytest.mark.parametrize("terms, seed", [(CONTACT, 26_110_000_015), (CONTACT | {OWN}, 892_955_996)])
def test_overlaps_are_a_robot_s_own(terms, seed):
    """Not of pairs that only others have on the list, nor of slopes that others need once more."""
    PROMISES["bits alone"](draw_case(Random(seed), terms, wild=True))


@pytest.mark.parametrize("seed", [21, 7396])
def test_energy_of_limbs_unlike_each_other(seed):
    """A slender limb beside a thick one, which has little of the energy; one with a huge node that comes to rest."""
    PROMISES["energy"](draw_case(Random(seed), PLAIN, wild=True))


# The long run: `pytest tests/fuzz --fuzz-minutes 60 -s`, and its failures one by one, by `--fuzz-case`.


def test_what_is_drawn_for_as_long_as_asked_keeps_every_promise(request, capsys):
    minutes, seed = request.config.getoption("--fuzz-minutes"), request.config.getoption("--fuzz-seed")
    if not minutes:
        pytest.skip("runs with --fuzz-minutes")
    with capsys.disabled():
        tried, failed = hour.run(minutes, seed)
    assert tried and not failed


def test_a_case_keeps_its_promise(request):
    name = request.config.getoption("--fuzz-case")
    if not name:
        pytest.skip("runs with --fuzz-case, as the long run prints it")
    hour.attempt(hour.Trial.named(name))


def test_every_promise_is_tried():
    assert {name for trial in TRIALS.values() for name in trial.promises} == {*PROMISES, *TAME_PROMISES}
