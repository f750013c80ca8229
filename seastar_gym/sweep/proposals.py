"""Designs that an Optuna study proposes, by ask and tell, from any number of processes that share its storage.

Proposals whose process was lost stay "running" in the storage: Optuna's heartbeats are of `study.optimize` only. So
proposals that have been running for too long are put back here: they count as failed, and are proposed once more.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from concurrent.futures import Executor
from datetime import datetime
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from seastar_gym.process import processors
from seastar_gym.scene.checks import require_choice, require_count, require_number
from seastar_gym.sweep.designs import Batch, Range, Sweep
from seastar_gym.sweep.executors import Done, Work, outcomes, sentence_of
from seastar_gym.sweep.run import (
    COUNTING,
    IN_A_ROW,
    OnProgress,
    Progress,
    ResultFiles,
    result_file_of,
    units_of,
    worth,
)

if TYPE_CHECKING:
    import optuna
    from optuna.trial import TrialState


class Search(NamedTuple):
    """What is searched. objective: Column of results. is_largest_best: Whether it is to be large. seed: Of proposals.

    stale_after: Time after which a proposal without result is put back [s]: longer than a batch waits and takes.
    """

    objective: str = "speed"
    is_largest_best: bool = True
    seed: int = 0
    stale_after: float = 600.0


def study_of(sweep: Sweep, search: Search, storage: str) -> optuna.Study:
    """Study of a sweep in a storage, such as "sqlite:///study.db"; the one that is there if there is one.

    It is another study where anything that results depend on is other, such as the file of one of the controllers.
    """
    import optuna  # takes a second, as sqlalchemy does
    from sqlalchemy.exc import SQLAlchemyError

    first = next(sweep.configurations())
    require_choice("objective", search.objective, tuple(name for name in units_of(first) if name != "status"))
    require_number("stale_after", search.stale_after, "s")
    if not sweep.axes:
        raise ValueError("A search needs something to vary, such as robot.limb_length=0.05:0.15.")
    axes = [(axis.name, axis if isinstance(axis, Range) else axis.labels) for axis in sweep.axes]
    told = f"{''.join(_texts(sweep))}{axes}{search.objective}{search.is_largest_best}"
    name = hashlib.sha256(told.encode()).hexdigest()[:16]
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        return optuna.create_study(
            storage=storage, study_name=name, load_if_exists=True,
            sampler=optuna.samplers.TPESampler(seed=search.seed),
            direction="maximize" if search.is_largest_best else "minimize",
        )  # fmt: skip
    except (SQLAlchemyError, optuna.exceptions.StorageInternalError, ImportError) as refused:
        raise ValueError(f"The storage {storage} cannot be used: {sentence_of(refused)[:200]}.") from None


def _texts(sweep: Sweep) -> Iterator[str]:
    """Texts of frames that have, between them, every value of every axis."""
    counts = [len(axis.values) for axis in sweep.of_configurations]
    for place in range(max(counts, default=1)):
        yield sweep.configuration(tuple(min(place, count - 1) for count in counts)).text


def explore(
    sweep: Sweep, search: Search, storage: str, designs: int, folder: str | os.PathLike[str],
    executor: Executor | None = None, progress: OnProgress | None = None, work: Work = result_file_of,
    at_once: int | None = None,
) -> optuna.Study:  # fmt: skip
    """Propose and simulate until a study has results of so many designs. Every batch has `sweep.robots` at most.

    ValueError if IN_A_ROW batches in a row have no result: the next ones would have none, either.

    executor, work, at_once: As of `run`, but proposals depend on results: None means a batch for every processor.
    """
    require_count("designs", designs, 1, 10_000_000)
    proposals = Proposals(sweep, study_of(sweep, search, storage), search, designs)
    parts, tally, in_a_row = ResultFiles(folder), Progress(), 0
    for outcome in outcomes(executor, work, proposals.batches(), at_once or processors()):
        if outcome.part is None:
            tally.losses, in_a_row = tally.losses + 1, in_a_row + 1
        else:
            parts.write(outcome.task.name, outcome.part)
            tally.count(outcome.task)
            in_a_row = 0
        proposals.tell(outcome)
        if in_a_row == IN_A_ROW:
            raise ValueError(f"{IN_A_ROW} batches in a row have no result, the last one so: {outcome.problem}")
        if progress is not None:
            progress(tally)
    return proposals.study


def batches_of(study: optuna.Study) -> set[str]:
    """Names of the batches in which the proposals of a study were simulated."""
    return {trial.user_attrs[BATCH] for trial in study.get_trials(deepcopy=False) if BATCH in trial.user_attrs}


BATCH = "batch"
"""Attribute of a proposal: the name of its batch."""


class Proposals:
    """Proposals of a study as batches, and their results. designs: Results that the study is to have."""

    def __init__(self, sweep: Sweep, study: optuna.Study, search: Search, designs: int):
        self.study, self._sweep, self._search, self._designs = study, sweep, search, designs
        self._waiting: dict[str, list[optuna.Trial]] = {}

    def batches(self) -> Iterator[Batch]:
        """Batches of proposals, made as they are asked for, while results are missing."""
        from optuna.trial import TrialState

        while True:
            put_back_stale(self.study, self._search.stale_after, {trial.number for trial in self._ours()})
            missing = self._designs - _count(self.study, TrialState.COMPLETE) - len(self._ours())
            if missing <= 0:
                return
            yield from self._asked(min(missing, self._sweep.robots))

    def _ours(self) -> list[optuna.Trial]:
        return [trial for trials in self._waiting.values() for trial in trials]

    def _asked(self, n: int) -> list[Batch]:
        """Batches of n proposals, one for every frame among them."""
        groups: dict[tuple[int, ...], list[tuple[optuna.Trial, dict[str, float]]]] = {}
        for _ in range(n):
            trial = self.study.ask()
            places, numbers = self._suggested(trial)
            groups.setdefault(places, []).append((trial, numbers))
        batches = []
        for places, group in groups.items():
            columns = {name: np.array([numbers[name] for _, numbers in group]) for name in group[0][1]}
            batch = Batch(self._sweep.configuration(places), columns, len(group))
            for trial, _ in group:
                trial.set_user_attr(BATCH, batch.name)
                self._waiting.setdefault(batch.name, []).append(trial)
            batches.append(batch)
        return batches

    def _suggested(self, trial: optuna.Trial) -> tuple[tuple[int, ...], dict[str, float]]:
        """Which values the frame has, and the numbers of the robot."""
        sweep = self._sweep
        numbers = {axis.name: trial.suggest_float(axis.name, axis.low, axis.high, log=axis.is_log) for axis in
                   sweep.ranges}  # fmt: skip
        places = {axis.name: axis.labels.index(trial.suggest_categorical(axis.name, axis.labels)) for axis in
                  (*sweep.of_robots, *sweep.of_configurations)}  # fmt: skip
        numbers |= {axis.name: float(axis.values[places[axis.name]]) for axis in sweep.of_robots}
        return tuple(places[axis.name] for axis in sweep.of_configurations), numbers

    def tell(self, outcome: Done) -> None:
        """Tell the study what came of a batch. Proposals of a lost one are put back."""
        trials = self._waiting.pop(outcome.task.name)
        if outcome.part is None:
            for trial in trials:
                put_back(self.study, trial.number)
            return
        objective, sign = self._search.objective, 1.0 if self._search.is_largest_best else -1.0
        table = pa.parquet.read_table(pa.BufferReader(outcome.part), columns=[*{objective, *COUNTING}])
        for trial, value in zip(trials, worth(table, objective, sign), strict=True):
            _tell(self.study, trial.number, sign * float(value))


def _count(study: optuna.Study, state: TrialState) -> int:
    return len(study.get_trials(deepcopy=False, states=(state,)))


def _tell(study: optuna.Study, number: int, value: float | None) -> bool:
    """Tell a result, or a failure for None; whether the proposal still waited for it."""
    from optuna.exceptions import UpdateFinishedTrialError
    from optuna.trial import TrialState

    try:
        study.tell(number, value, TrialState.FAIL if value is None else TrialState.COMPLETE)
    except (ValueError, UpdateFinishedTrialError):  # another process was faster
        return False
    return True


def put_back(study: optuna.Study, number: int) -> bool:
    """Count a proposal as failed and propose it once more; whether it was still running."""
    if not _tell(study, number, None):
        return False
    params: dict[str, Any] = study.get_trials(deepcopy=False)[number].params
    study.enqueue_trial(params, user_attrs={"put back": number})
    return True


def put_back_stale(study: optuna.Study, stale_after: float, ours: set[int] | None = None) -> int:
    """Put back proposals that have been running for so long [s], except ours; returns how many."""
    from optuna.trial import TrialState

    found, now = 0, datetime.now()
    for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
        started = trial.datetime_start or now
        if trial.number not in (ours or set()) and (now - started).total_seconds() > stale_after:
            found += put_back(study, trial.number)
    return found
