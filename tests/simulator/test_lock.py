"""The lock of a simulator refuses a second change, and knows which one was interrupted."""

import threading

import pytest

from seastar_gym.simulator.lock import BROKEN_OFF, ELSEWHERE, PAUSED, StrokeLock


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
