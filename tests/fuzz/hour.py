"""The long run: one case after another until time is up, in processes that may hang or crash.

A trial is a promise, a set of terms and a seed, and its name says all three: "bits alone/contact, loads/17".
"""

import contextlib
import itertools
import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from multiprocessing.pool import AsyncResult, Pool
from random import Random
from typing import NamedTuple

from fuzz import odd, swims
from fuzz.promises import PROMISES, TAME_PROMISES, WITHOUT
from fuzz.scenes import (
    BENT,
    CHAPTER,
    COMPILED,
    CONTACT,
    EVERYTHING,
    FLUID,
    N_ROBOTS,
    N_STROKES,
    OWN,
    PLAIN,
    RARE,
    SWIMMER,
    TERMS,
    TOUCHED_BODY,
    Terms,
    draw_case,
)

LIMIT = 120.0
"""Seconds of processor time for a trial, and for machine code that it may have to compile: others may use it, too."""

WAIT = 10.0 * LIMIT
"""Seconds in which one uses less than a second of processor time before it is taken for one that waits for ever."""

BLOCK = 8
"""Cases of a set of terms, which has to be compiled, before the next."""

EVERY = 2
"""Sets of terms, one of which may have rare ones."""

OF_SWIMS: dict[str, Callable[[int], None]] = {
    "odd arguments": lambda seed: odd.check_odd_arguments(Random(seed)),
    "environment": swims.check_environment,
    **{f"preset {name}": lambda seed, name=name: swims.check_preset(name, seed) for name in swims.PRESETS},
}
"""Promises of the chapter's robot, once in a block."""


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
    if trial.promise in OF_SWIMS:
        OF_SWIMS[trial.promise](trial.seed)
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
        for name in OF_SWIMS:
            yield Trial(name, frozenset(), number)


class Workers:
    """One process at a time: a fresh one after a hang, and for every set of terms, whose machine code stays loaded."""

    def __init__(self) -> None:
        self._terms = PLAIN
        self._start()

    def _start(self) -> None:
        self._pool: Pool = multiprocessing.get_context("spawn").Pool(1)
        self._process = self._pool.apply(os.getpid)

    def failure(self, trial: Trial) -> BaseException | None:
        """What the trial raised, TimeoutError for one that hung or crashed."""
        if trial.terms and trial.terms != self._terms:
            self._renew()
            self._terms = trial.terms
        raised: list[BaseException] = []
        answer = self._pool.apply_async(attempt, (trial,), error_callback=raised.append)
        with contextlib.suppress(OSError):  # there is no such process: it crashed
            self._wait(answer)
        if answer.ready():
            return raised[0] if raised else None
        self._renew()
        return TimeoutError(f"no answer within {LIMIT:g} s: it hangs, or its process crashed")

    def _wait(self, answer: AsyncResult) -> None:
        """Wait until there is an answer, or time is up."""
        begin = used = processor_time(self._process)
        since = time.monotonic()
        while not answer.ready() and used < begin + LIMIT and time.monotonic() < since + WAIT:
            answer.wait(0.5)
            now = processor_time(self._process)
            if now > used + 1.0:
                used, since = now, time.monotonic()

    def _renew(self) -> None:
        self.stop()
        self._start()

    def stop(self) -> None:
        self._pool.terminate()
        self._pool.join()


def processor_time(process: int) -> float:
    """Seconds of processor time that a process has used, as Linux counts them (clock_getcpuclockid)."""
    return time.clock_gettime(~process << 3 | 2)


class Tally:
    """Counts of a run, and what it found."""

    def __init__(self) -> None:
        self.tried: Counter[str] = Counter()
        self.failed: Counter[str] = Counter()
        self.cases: set[tuple[Terms, int]] = set()

    def note(self, trial: Trial, failure: BaseException | None) -> None:
        self.tried[trial.promise] += 1
        if trial.promise not in OF_SWIMS:
            self.cases.add((trial.terms, trial.seed))
        if failure is not None:
            self.failed[f"{trial.promise}: {type(failure).__name__}"] += 1
            text = f"{type(failure).__name__}: {' '.join(str(failure).split()):.300}"
            print(f'FAILED pytest tests/fuzz --fuzz-case "{trial}"  # {text}', flush=True)

    def __str__(self) -> str:
        strokes = sum(self.tried[name] for name in (*PROMISES, *TAME_PROMISES)) * N_ROBOTS * N_STROKES
        sets = len({terms for terms, _ in self.cases})
        lines = [f"{len(self.cases)} cases of {sets} sets of terms, at least {strokes} strokes of a robot, tried:"]
        lines += [f"  {name}: {count}" for name, count in sorted(self.tried.items())]
        lines += [f"failures: {sum(self.failed.values())}"]
        lines += [f"  {kind}: {count}" for kind, count in sorted(self.failed.items())]
        return "\n".join(lines)


def run(minutes: float, seed: int) -> Tally:
    """Try until time is up."""
    tally, workers, end = Tally(), Workers(), time.monotonic() + 60.0 * minutes
    for trial in trials(seed):
        if time.monotonic() > end:
            break
        tally.note(trial, workers.failure(trial))
    workers.stop()
    return tally
