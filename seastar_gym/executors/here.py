"""`Here`: tasks in this process, one after the other."""

from collections.abc import Iterator

from seastar_gym.executors import KNOWN_FAILURES, Outcome, Task, Work, sentence_of


class Here:
    """Runs tasks in this process."""

    def run(self, work: Work[Task], tasks: Iterator[Task]) -> Iterator[Outcome[Task]]:
        """Run all tasks."""
        for task in tasks:
            yield outcome_of(work, task)


def outcome_of(work: Work[Task], task: Task) -> Outcome[Task]:
    """Outcome of a task that is run now."""
    try:
        return Outcome(task, work(task))
    except KNOWN_FAILURES as failure:
        return Outcome(task, None, sentence_of(failure))
