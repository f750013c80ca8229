"""Jobs of a benchmark: episodes of an agent on a task, swum side by side, in this process or on any executor."""

import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.controllers.registry import load_agent
from seastar_gym.evaluation.measures import measure_of
from seastar_gym.evaluation.rollout import Episodes
from seastar_gym.evaluation.tasks import env_of, held_out, swim_episodes
from seastar_gym.executors import KNOWN_FAILURES, Executor, sentence_of
from seastar_gym.scene.numerics import Fidelity

ATTEMPTS = 3
"""How often a job is tried whose worker is lost."""
Row = dict[str, Any]
"""Results of an episode by their names, as plain numbers."""


class Job(NamedTuple):
    """Episodes with these seeds. agent: As the command names it. policy: Name of the policy, see the registry.

    fidelity: None means the task's own. decisions: Time limit, None means the task's. threads: Of the simulator; None
    means one per processor.
    """

    task: str
    agent: str
    policy: str
    seeds: tuple[int, ...]
    fidelity: Fidelity | None
    decisions: int | None
    threads: int | None


class Answer(NamedTuple):
    """What came of a job: rows of its episodes, or why there are none. is_lost: Whether that is its workers' fault."""

    job: Job
    rows: list[Row]
    problem: str = ""
    is_lost: bool = False


def swim_job(job: Job) -> bytes:
    """Rows of a job, or the sentence of an agent that does not fit, as JSON."""
    try:
        env = env_of(job.task, **held_out(job.task, job.fidelity))
        policy = load_agent(job.policy, env, job.seeds[0])
        swum = swim_episodes(
            job.task, policy, list(job.seeds), fidelity=job.fidelity, max_decisions=job.decisions, threads=job.threads
        )
    except (ValueError, FileNotFoundError) as unfit:
        return json.dumps({"rows": [], "problem": str(unfit)}).encode()
    except KNOWN_FAILURES:  # of the machine, which may be over when the job is run again
        raise
    except Exception as failure:
        return json.dumps({"rows": [], "problem": f"{type(failure).__name__}: {sentence_of(failure)}"}).encode()
    return json.dumps({"rows": _rows(swum, measure_of(env).of(swum))}).encode()


def _rows(swum: Episodes, scores: np.ndarray[Any, Any]) -> list[Row]:
    names = ("scores", "success", "returns", "decisions")
    columns = (scores, swum.success, swum.returns, swum.decisions)
    return [dict(zip(names, row, strict=True)) for row in zip(*(column.tolist() for column in columns), strict=True)]


def answers(jobs: list[Job], executor: Executor) -> Iterator[Answer]:
    """Answers to all jobs, as they come. Jobs whose workers are lost are run again."""
    waiting, problems = jobs, dict[Job, str]()
    for _ in range(ATTEMPTS):
        problems = {}
        for outcome in executor.run(swim_job, iter(waiting)):
            if outcome.part is None:
                problems[outcome.task] = outcome.problem
            else:
                yield Answer(outcome.task, **json.loads(outcome.part))
        waiting = list(problems)
        if not waiting:
            return
    yield from (Answer(job, [], problem, True) for job, problem in problems.items())
