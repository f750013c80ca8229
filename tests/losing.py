"""Executors that lose workers, or during whose run somebody presses Ctrl-C."""

import itertools

from seastar_gym.executors import Outcome
from seastar_gym.executors.here import Here

LOST = "Its worker was lost: NodeDied."


class Losing:
    """An executor that loses the workers of some tasks. is_lost: Whether it loses that of a task."""

    def __init__(self, is_lost):
        self.is_lost = is_lost

    def run(self, work, tasks):
        for outcome in Here().run(work, tasks):
            yield Outcome(outcome.task, None, LOST) if self.is_lost(outcome.task) else outcome


def first(number):
    """`is_lost` of the first tasks."""
    asked = itertools.count()
    return lambda task: next(asked) < number


class Interrupted:
    """An executor during whose run somebody presses Ctrl-C, after so many tasks."""

    def __init__(self, after):
        self.after = after

    def run(self, work, tasks):
        yield from Here().run(work, itertools.islice(tasks, self.after))
        raise KeyboardInterrupt
