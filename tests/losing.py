"""Executors that lose workers, or during whose run somebody presses Ctrl-C."""

import itertools
from concurrent.futures import Executor, Future

LOST = "NodeDied."


class Losing(Executor):
    """An executor that loses the workers of some tasks. is_lost: Whether it loses that of a task."""

    def __init__(self, is_lost):
        self.is_lost = is_lost

    def submit(self, work, *arguments):
        future = Future()
        if self.is_lost(arguments[-1]):
            future.set_exception(RuntimeError(LOST))
        else:
            future.set_result(work(*arguments))
        return future


def first(number):
    """`is_lost` of the first tasks."""
    asked = itertools.count()
    return lambda task: next(asked) < number


class Interrupted(Losing):
    """An executor during whose run somebody presses Ctrl-C, after so many tasks."""

    def __init__(self, after):
        self.left = itertools.count(after, -1)
        super().__init__(lambda task: False)

    def submit(self, work, *arguments):
        if next(self.left) == 0:
            raise KeyboardInterrupt
        return super().submit(work, *arguments)
