"""An interrupted stroke is as if it had not begun, and what comes in the middle of one is refused in a sentence."""

import _thread
import contextlib
import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from seastar_gym import DomainRandomization, Scene, Seastar, Simulator, SmaPulse, State, ThermalSma, Uniform
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.model.coefficients import Coefficients
from seastar_gym.scene import Numerics
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator import batch as module
from seastar_gym.simulator.clock import Clock
from strokes import assert_same

FAST = Numerics.preset("fast")
N_ROBOTS = 20 * N_LANES + 1
COMMANDS = np.random.default_rng(0).integers(-1, 2, (3, N_ROBOTS, 5)).astype(float)
THREADS = pytest.mark.parametrize("threads", [1, 3])
BARS = pytest.mark.parametrize("bars", [False, True], ids=["plain", "error bars"])


def swimmers(threads: int = 1, scene: Scene = Scene(numerics=FAST), bars: bool = False) -> Simulator:
    """Robots after their first stroke."""
    simulator = Simulator(scene, N_ROBOTS, threads, error_bars=bars)
    simulator.stroke(COMMANDS[0])
    return simulator


def interrupt() -> None:
    """Interrupt the main thread as Ctrl-C does. It notices at its next call."""
    _thread.interrupt_main()
    time.sleep(0.001)


class Kernel:
    """`advance` as the simulator calls it, with something done before or after every `nth` call."""

    def __init__(self, monkeypatch, before=lambda: None, after=lambda: None, nth: int = 3):
        self.advance, self.before, self.after, self.nth, self.calls = module.advance, before, after, nth, 0
        self.at_work, self.patch = 0, monkeypatch
        monkeypatch.setattr(module, "advance", self)

    def __call__(self, *arguments):
        self.calls += 1
        hooked = self.calls % self.nth == 0
        self.at_work += 1
        try:
            if hooked:
                self.before()
            self.advance(*arguments)
            if hooked:
                self.after()
        finally:
            self.at_work -= 1

    def remove(self) -> None:
        """From now on kernels run as they are."""
        self.patch.setattr(module, "advance", self.advance)


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    """Many parts, so that an interrupt finds some done and some not."""
    monkeypatch.setattr(module, "LARGEST_PART", 2)


@contextlib.contextmanager
def interrupted(simulator: Simulator, kernel: Kernel, error=KeyboardInterrupt):
    """Expect the error, and that nothing moves any more afterwards."""
    with pytest.raises(error):  # noqa: PT012
        yield
        time.sleep(1.0)  # an interrupt that is on its way
    assert kernel.at_work == 0
    calls, ends = kernel.calls, simulator.q.copy()
    time.sleep(0.02)
    assert kernel.calls == calls
    np.testing.assert_array_equal(simulator.q, ends)
    kernel.remove()


def assert_not_begun(simulator: Simulator, other: Simulator) -> None:
    """The same now, and after another stroke, in which what is not seen shows, such as the twin of error bars."""
    assert_same(simulator, other)
    simulator.stroke(COMMANDS[2])
    other.stroke(COMMANDS[2])
    assert_same(simulator, other)


@THREADS
@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("nth, bars", [(1, False), (3, False), (1, True), (12, True)])
@pytest.mark.parametrize("actuator", [SmaPulse(), ThermalSma()], ids=["pulse", "thermal"])
def test_an_interrupted_stroke_is_as_if_it_had_not_begun(monkeypatch, threads, when, nth, bars, actuator):
    """In the twin of error bars, too, and after it: its eleven parts come first."""
    scene = Scene(numerics=FAST, actuator=actuator)
    simulator = swimmers(threads, scene, bars)
    with interrupted(simulator, Kernel(monkeypatch, nth=nth, **{when: interrupt})):
        simulator.stroke(COMMANDS[1])
    assert_not_begun(simulator, swimmers(1, scene, bars))


@THREADS
def test_a_part_that_fails_undoes_the_stroke(monkeypatch, threads):
    def fail():
        raise MemoryError

    simulator = swimmers(threads)
    with interrupted(simulator, Kernel(monkeypatch, before=fail), MemoryError):
        simulator.stroke(COMMANDS[1])
    assert_same(simulator, swimmers())


@BARS
@THREADS
@pytest.mark.parametrize("where", ["_begin_interval", "_end_interval"])
def test_an_interrupt_before_or_after_the_kernels_undoes_the_stroke(monkeypatch, threads, where, bars):
    simulator, whole = swimmers(threads, bars=bars), getattr(Simulator, where)

    def broken_off(self, *arguments):
        report = whole(self, *arguments)
        if self is simulator:
            raise KeyboardInterrupt
        return report  # of its twin

    monkeypatch.setattr(Simulator, where, broken_off)
    with pytest.raises(KeyboardInterrupt):
        simulator.stroke(COMMANDS[1])
    monkeypatch.undo()
    assert_not_begun(simulator, swimmers(bars=bars))


@pytest.mark.parametrize("how", ["interrupted", "closed", "dropped", "interrupted by whoever looks"])
@THREADS
@BARS
def test_a_stroke_in_parts_that_does_not_come_to_its_end_has_not_begun(monkeypatch, threads, how, bars):
    simulator = swimmers(threads, bars=bars)
    parts = simulator.stroke_in_parts(COMMANDS[1], 4)
    next(parts)
    assert simulator.time[0] > 1.0
    match how:
        case "interrupted":
            with interrupted(simulator, Kernel(monkeypatch, before=interrupt)):
                next(parts)
        case "closed":
            parts.close()
        case "dropped":
            del parts
        case _:
            with pytest.raises(KeyboardInterrupt), contextlib.closing(parts):
                raise KeyboardInterrupt
    assert_not_begun(simulator, swimmers(bars=bars))


IN_THE_MIDDLE = {
    "stroke": lambda simulator: simulator.stroke(COMMANDS[1]),
    "stroke_in_parts": lambda simulator: next(simulator.stroke_in_parts(COMMANDS[1], 2)),
    "reset": lambda simulator: simulator.reset(),
    "reset of some": lambda simulator: simulator.reset(np.arange(N_ROBOTS) < 2),
    "set_state": lambda simulator: simulator.set_state(Simulator(Scene(numerics=FAST), N_ROBOTS).get_state()),
    "set_scene": lambda simulator: simulator.set_scene(Scene(Seastar(density=900.0), numerics=FAST)),
    "set_limb_strengths": lambda simulator: simulator.set_limb_strengths(0.5),
}


@pytest.mark.parametrize("call", IN_THE_MIDDLE.values(), ids=IN_THE_MIDDLE)
def test_whatever_comes_in_the_middle_of_a_stroke_in_parts_is_refused_and_changes_nothing(call):
    simulator, other = swimmers(), swimmers()
    parts = simulator.stroke_in_parts(COMMANDS[1], 3)
    next(parts)
    with pytest.raises(RuntimeError, match=r"^A stroke_in_parts .* under way: .*\.$"):
        call(simulator)
    for _ in parts:
        pass
    other.stroke(COMMANDS[1])
    assert_same(simulator, other)
    call(simulator)


@pytest.mark.parametrize("call", IN_THE_MIDDLE.values(), ids=IN_THE_MIDDLE)
@THREADS
def test_whatever_another_thread_asks_in_the_middle_of_a_stroke_is_refused(monkeypatch, threads, call):
    simulator, other = swimmers(threads), swimmers()
    begun, go_on = threading.Event(), threading.Event()

    def wait():
        begun.set()
        assert go_on.wait(60.0)

    Kernel(monkeypatch, before=wait)
    swimmer = threading.Thread(target=simulator.stroke, args=[COMMANDS[1]])
    swimmer.start()
    try:
        assert begun.wait(60.0)
        with pytest.raises(RuntimeError, match=r"^Another thread .*\.$"):
            call(simulator)
        with pytest.raises(RuntimeError, match="Another thread"):
            simulator.get_state()
    finally:
        go_on.set()
        swimmer.join()
    other.stroke(COMMANDS[1])
    assert_same(simulator, other)


def break_off(monkeypatch, what: str, change: Callable[[], Any]) -> None:
    def interrupted(*_):
        raise KeyboardInterrupt

    owner, name = {"reset": (Clock, "set"), "set_scene": (Coefficients, "set_scene")}[what]
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, interrupted)
        with pytest.raises(KeyboardInterrupt):
            change()


@pytest.mark.parametrize("what", ["reset", "set_scene"])
def test_a_change_that_was_broken_off_asks_for_a_reset_which_cures_it(monkeypatch, what):
    simulator = swimmers()
    break_off(monkeypatch, what, lambda: IN_THE_MIDDLE[what](simulator))
    some = np.arange(N_ROBOTS) < 2
    for _ in range(2):
        for refused in (lambda: simulator.stroke(COMMANDS[0]), simulator.get_state, lambda: simulator.reset(some)):
            with pytest.raises(RuntimeError, match=r"^This simulator was interrupted .* reset\(\) .*\.$"):
                refused()
    simulator.reset()
    simulator.stroke(COMMANDS[0])
    assert_same(simulator, swimmers())


def test_a_state_that_is_set_cures_a_reset_that_was_broken_off(monkeypatch):
    simulator, other = swimmers(), swimmers()
    break_off(monkeypatch, "reset", lambda: IN_THE_MIDDLE["reset"](simulator))
    simulator.set_state(other.get_state())
    simulator.stroke(COMMANDS[1])
    other.stroke(COMMANDS[1])
    assert_same(simulator, other)


def test_what_is_refused_breaks_nothing_off():
    simulator = swimmers()
    for name, refused in {
        "set_scene": lambda: simulator.set_scene(Scene(Seastar(4), numerics=FAST)),
        "limb_strengths": lambda: simulator.set_limb_strengths(2.0),
        "heading": lambda: simulator.reset(heading=np.nan),
        "State": lambda: simulator.set_state(State(*(np.zeros(1),) * 3)),
    }.items():
        with pytest.raises(ValueError, match=name):
            refused()
    assert_same(simulator, swimmers())


SWIM_UNTIL_INTERRUPTED = """
import sys, numpy as np
from seastar_gym import Numerics, Scene, Simulator
threads, n_robots = int(sys.argv[1]), 2048
scene, command = Scene(numerics=Numerics.preset("fast")), np.zeros((n_robots, 5))
command[:, 1], command[:, 4] = 1.0, -1.0
simulator, other = Simulator(scene, n_robots, threads), Simulator(scene, N_LANES := 8)
simulator.stroke(command)
print("swimming", flush=True)
try:
    while True:
        simulator.stroke(command)
except KeyboardInterrupt:
    n_strokes = round(simulator.time[0])
    if len(set(simulator.time)) > 1:
        print("clocks differ", flush=True)
for _ in range(n_strokes):
    other.stroke(command[:N_LANES])
print(n_strokes, (simulator.positions == other.positions[:1]).all(), flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent otherwise on Windows")
@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_leaves_all_robots_where_their_clock_says(threads):
    """In a process of its own, at no time in particular."""
    with subprocess.Popen(
        [sys.executable, "-c", SWIM_UNTIL_INTERRUPTED, str(threads)], stdout=subprocess.PIPE, text=True
    ) as swimmer:
        assert swimmer.stdout.readline() == "swimming\n"
        time.sleep(0.1)
        swimmer.send_signal(signal.SIGINT)
        n_strokes, whole = swimmer.communicate(timeout=300.0)[0].split()
    assert int(n_strokes) >= 1 and whole == "True"


# Environments

RANDOM = DomainRandomization({"robot.youngs_modulus": Uniform(0.5e6, 2e6)})


def make(kind: str) -> SeastarSwimEnv | SeastarSwimVectorEnv:
    if kind == "batch":
        return SeastarSwimVectorEnv(3 * N_LANES, fidelity="fast", threads=2, randomization=RANDOM)
    return SeastarSwimEnv(fidelity="fast", render_mode=None if kind == "one" else kind, randomization=RANDOM)


KINDS = pytest.mark.parametrize("kind", ["one", "rgb_array_list", "batch"])


@KINDS
def test_an_interrupted_step_asks_for_a_reset_which_cures_it(monkeypatch, kind):
    env, fresh = make(kind), make(kind)
    action = env.action_space.sample()
    env.reset(seed=0)
    env.step(action)
    kernel = Kernel(monkeypatch, before=interrupt, nth=1)
    try:
        env.step(action)
        time.sleep(1.0)
    except KeyboardInterrupt:
        kernel.remove()
        with pytest.raises(gym.error.ResetNeeded, match=r"interrupted: call reset\(\)"):
            env.step(action)
        seen = env.reset(seed=1)[0]
    np.testing.assert_array_equal(seen, fresh.reset(seed=1)[0])
    np.testing.assert_array_equal(env.step(action)[0], fresh.step(action)[0])


@KINDS
def test_an_interrupted_reset_asks_for_another_which_cures_it(monkeypatch, kind):
    env, fresh = make(kind), make(kind)
    action = env.action_space.sample()
    for what in ("reset", "set_scene"):
        env.reset(seed=5)
        break_off(monkeypatch, what, lambda: env.reset(seed=6))
        with pytest.raises(gym.error.ResetNeeded, match=r"interrupted: call reset\(\)"):
            env.step(action)
    np.testing.assert_array_equal(env.reset(seed=1)[0], fresh.reset(seed=1)[0])
    np.testing.assert_array_equal(env.step(action)[0], fresh.step(action)[0])


@KINDS
def test_an_action_that_is_refused_interrupts_nothing(kind):
    env = make(kind)
    env.reset(seed=0)
    action = env.action_space.sample()
    with pytest.raises(ValueError, match="7"):
        env.step(np.full_like(action, 7))
    env.step(action)


# Threads


def others() -> set[threading.Thread]:
    gc.collect()  # simulators of other tests
    return set(threading.enumerate())


def test_close_ends_the_threads_and_a_stroke_starts_them_again():
    before = others()
    simulator = swimmers(2)
    for _ in range(2):
        assert 1 <= len(others() - before) <= 2  # a pool starts its second thread when the first is busy
        simulator.close()
        simulator.close()
        assert not others() - before
        simulator.stroke(COMMANDS[1])
    simulator.close()


def test_threads_that_are_closed_within_a_stroke_in_parts_start_again():
    simulator, other = swimmers(2), swimmers()
    for _ in simulator.stroke_in_parts(COMMANDS[1], 3):
        simulator.close()
    other.stroke(COMMANDS[1])
    assert_same(simulator, other)


def test_close_of_the_batch_ends_its_threads_however_often_it_is_used_again():
    before, env = others(), make("batch")
    env.reset(seed=0)
    for _ in range(2):
        env.step(env.action_space.sample())
        assert 1 <= len(others() - before) <= 2  # a pool starts its second thread when the first is busy
        env.close()
        env.close()
        assert not others() - before


def test_an_environment_of_one_robot_has_no_threads():
    before, env = others(), make("one")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    assert not others() - before
    env.close()
