"""The long run: one case after another until time is up, in processes that may hang or crash.

A trial is a promise, a set of terms and a seed, and its name says all three: "bits alone/contact, loads/17".
"""

import itertools
import multiprocessing
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from random import Random
from typing import NamedTuple

from fuzz import odd
from fuzz.promises import PROMISES, TAME_PROMISES, WITHOUT
from fuzz.scenes import (
    BENT,
    CHAPTER,
    COMPILED,
    CONTACT,
    EVERYTHING,
    FLUID,
    OWN,
    PLAIN,
    RARE,
    SWIMMER,
    TERMS,
    TOUCHED_BODY,
    Terms,
    draw_case,
)

LIMIT = 1200.0
"""Seconds for a trial, and for machine code that it may have to compile: others may use the processor, too."""

BLOCK = 8
"""Cases of a set of terms, which has to be compiled, before the next."""

EVERY = 2
"""Sets of terms, one of which may have rare ones."""

ODD = "odd arguments"
"""Promise of whatever takes arguments, once in a block."""


class Trial(NamedTuple):
    """See the module's first lines."""

    promise: str
    terms: Terms
    seed: int

    def __str__(self) -> str:
        return f"{self.promise}/{', '.join(sorted(self.terms))}/{self.seed}"

    @classmethod
    def named(cls, name: str) -> "Trial":
        promise, terms, seed = name.split("/")
        return cls(promise, frozenset(filter(None, terms.split(", "))), int(seed))


def attempt(trial: Trial) -> None:
    """Raise what the trial finds."""
    if trial.promise == ODD:
        odd.check_odd_arguments(Random(trial.seed))
    elif trial.promise in TAME_PROMISES:
        TAME_PROMISES[trial.promise](draw_case(Random(trial.seed), trial.terms, wild=False))
    else:
        PROMISES[trial.promise](draw_case(Random(trial.seed), trial.terms, wild=trial.seed % 4 != 0))


def sets_of_terms(rng: Random) -> Iterator[Terms]:
    """Those with contact, a body and everything first, then those that tests compile, then any, half with rare ones."""
    yield from (SWIMMER, CONTACT, EVERYTHING, frozenset(TERMS), frozenset({OWN, "contact"}))
    yield from (TOUCHED_BODY, BENT, SWIMMER | FLUID | {OWN})
    yield from (terms for terms in COMPILED if terms not in (CONTACT, frozenset({OWN, "contact"})))
    sets = [frozenset(chosen) for size in range(1, 9) for chosen in itertools.combinations(TERMS, size)]
    rng.shuffle(sets)
    for k, terms in enumerate(itertools.cycle(sets)):
        is_rare = k % EVERY == 0 and CHAPTER not in terms
        yield terms | set(rng.sample(RARE, rng.randint(1, len(RARE)))) if is_rare else terms


def trials(seed: int) -> Iterator[Trial]:
    """Without end; `seed` chooses all of them."""
    numbers = itertools.count(seed * 10_000_000)
    for terms in sets_of_terms(Random(seed)):
        for number in itertools.islice(numbers, BLOCK):
            for name in (*PROMISES, *TAME_PROMISES):
                if not terms & WITHOUT.get(name, frozenset()):
                    yield Trial(name, terms, number)
        yield Trial(ODD, frozenset(), number)


class Workers:
    """One process at a time: a fresh one after a hang, and for every set of terms, whose machine code stays loaded."""

    def __init__(self) -> None:
        self._begin(PLAIN)

    def _begin(self, terms: Terms) -> None:
        self._terms = terms
        self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))

    def failure(self, trial: Trial) -> Exception | None:
        """What the trial raised, or that it hung or crashed."""
        if trial.terms and trial.terms != self._terms:
            self.stop()
            self._begin(trial.terms)
        try:
            self._pool.submit(attempt, trial).result(LIMIT)
        except (TimeoutError, BrokenProcessPool) as lost:
            self.stop()
            self._begin(self._terms)
            return lost
        except Exception as raised:  # whatever a trial finds
            return raised
        return None

    def stop(self) -> None:
        for process in multiprocessing.active_children():
            process.kill()
        self._pool.shutdown()


def run(minutes: float, seed: int) -> tuple[int, list[str]]:
    """Try until time is up; returns the number of trials, and the lines on those that failed, printed as they come."""
    workers, end, tried, failed = Workers(), time.monotonic() + 60.0 * minutes, Counter[str](), list[str]()
    for trial in trials(seed):
        if time.monotonic() > end:
            break
        tried[trial.promise] += 1
        if (failure := workers.failure(trial)) is not None:
            text = f"{type(failure).__name__}: {' '.join(str(failure).split()):.300}"
            failed.append(f'FAILED pytest tests/fuzz --fuzz-case "{trial}"  # {text}')
            print(failed[-1], flush=True)
    workers.stop()
    print(*(f"{name}: {count}" for name, count in sorted(tried.items())), sep="\n")
    return tried.total(), failed
