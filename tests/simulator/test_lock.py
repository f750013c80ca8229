"""The lock of a simulator refuses a second change, and knows which one was interrupted."""

import os
import signal
import threading

import pytest

from seastar_gym.envs.swimming import first_after
from seastar_gym.simulator.lock import BROKEN_OFF, ELSEWHERE, PAUSED, StrokeLock
from seastar_gym.simulator.pauses import completed, pausing
from seastar_gym.simulator.workers import Workers


def refused(call, sentence: str) -> None:
    with pytest.raises(RuntimeError) as error:
        call()
    assert str(error.value) == sentence


def in_a_thread(call) -> None:
    thread = threading.Thread(target=call)
    thread.start()
    thread.join()


def test_one_change_follows_another():
    lock = StrokeLock()
    for _ in range(2):
        lock.acquire()
        lock.release()
    with lock.change():
        pass
    lock.require_intact()


def test_a_paused_stroke_refuses_changes_and_may_be_read_and_resumed_by_any_thread():
    lock = StrokeLock()
    stroke = lock.acquire()
    lock.pause()
    refused(lock.acquire, PAUSED)
    lock.require_intact()
    in_a_thread(lambda: (lock.resume(stroke), lock.release()))
    lock.acquire()


def test_another_threads_change_refuses_changes_and_readers():
    lock = StrokeLock()
    in_a_thread(lock.acquire)
    refused(lock.acquire, ELSEWHERE)
    refused(lock.require_intact, ELSEWHERE)


def test_a_change_that_was_interrupted_is_known_until_it_is_repaired():
    lock = StrokeLock()
    with pytest.raises(KeyboardInterrupt), lock.change():
        raise KeyboardInterrupt
    refused(lock.require_intact, BROKEN_OFF)
    with lock.change():
        assert lock.broken
    assert lock.broken
    with lock.change(repairs=True):
        pass
    lock.require_intact()


def test_a_change_that_is_refused_leaves_the_lock_intact():
    lock = StrokeLock()
    with pytest.raises(ValueError, match="no"), lock.change():
        raise ValueError("no")
    lock.require_intact()


def test_a_stroke_whose_lock_was_taken_does_not_resume():
    lock = StrokeLock()
    stroke = lock.acquire()
    lock.release()
    lock.acquire()
    assert not lock.resume(stroke)


def passes_in_a_fork(promise) -> bool:
    """Whether a promise holds, within half a minute, in a forked process, which has no other threads."""
    child = os.fork()
    if child == 0:
        signal.alarm(30)
        try:
            promise()
        except BaseException:
            os._exit(1)
        os._exit(0)
    return os.waitpid(child, 0)[1] == 0


def test_a_change_by_a_thread_that_a_fork_does_not_have_is_an_interrupted_one():
    """Nobody in the fork would end it: it takes the lock over, and knows that robots have to be repaired."""
    lock = StrokeLock()
    in_a_thread(lock.acquire)

    def is_taken_over():
        refused(lock.require_intact, BROKEN_OFF)
        with lock.change(repairs=True):
            assert lock.broken
        lock.require_intact()

    assert passes_in_a_fork(is_taken_over)
    refused(lock.acquire, ELSEWHERE)  # the parent's thread goes on


def test_a_paused_stroke_is_paused_in_a_fork_too():
    lock = StrokeLock()
    stroke = lock.acquire()
    lock.pause()

    def goes_on():
        refused(lock.acquire, PAUSED)
        assert lock.resume(stroke)
        lock.release()
        lock.require_intact()

    assert passes_in_a_fork(goes_on)
    refused(lock.acquire, PAUSED)


def work_on_two_threads(workers: Workers) -> None:
    """Both of them, for each waits for the other."""
    both = threading.Barrier(2, timeout=20.0)
    workers.run(lambda thread, part: both.wait() and None, [slice(0, 1), slice(1, 2)])


@pytest.mark.parametrize("closes", [False, True])
def test_a_fork_has_threads_of_its_own_to_work_with_and_to_close(closes):
    workers = Workers(2)
    work_on_two_threads(workers)

    def works():
        if closes:
            workers.close()  # those of the parent, which do not run here
        for _ in range(3):
            work_on_two_threads(workers)
        assert threading.active_count() == 3
        workers.close()
        assert threading.active_count() == 1

    assert passes_in_a_fork(works)
    work_on_two_threads(workers)
    workers.close()


# Intervals that pause are seen at every pause, return what they return, and are closed whatever happens.


def interval(closed):
    """Pauses at 1, 2 and 3; notes that it was closed."""
    try:
        yield from (1.0, 2.0, 3.0)
    finally:
        closed.append(True)
    return "report"


def test_an_interval_is_seen_at_every_pause_and_returns_its_report():
    seen, closed = [], []
    assert completed(interval(closed), seen.append) == "report" and seen == [1.0, 2.0, 3.0] and closed == [True]
    assert completed(interval([])) == "report"


def test_only_what_is_made_of_a_time_is_yielded():
    assert list(pausing(interval([]), lambda time: 10.0 * time if time != 2.0 else None)) == [10.0, 30.0]


@pytest.mark.parametrize(
    "ends, expected", [([], []), ([1.5, 3.0], [2.0, 3.0]), ([0.5, 0.6, 1.0], [1.0]), ([2.0 + 1e-10], [2.0])]
)
def test_the_first_time_after_each_end_is_yielded(ends, expected):
    assert list(pausing(interval([]), first_after(ends))) == expected


def test_an_interval_is_closed_with_its_pauses_and_by_what_goes_wrong_in_them():
    closed = []
    pauses = pausing(interval(closed), float)
    next(pauses)
    pauses.close()
    assert closed == [True]

    def broken(time):
        raise ZeroDivisionError

    for run in (completed, lambda *given: list(pausing(*given))):
        closed = []
        with pytest.raises(ZeroDivisionError):
            run(interval(closed), broken)
        assert closed == [True]
