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

from seastar_gym import DomainRandomization, Scene, Seastar, Simulator, SmaPulse, ThermalSma, Uniform
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import Coefficients
from seastar_gym.process import held_back, let_through
from seastar_gym.scene import Numerics
from seastar_gym.simulator import batch as module
from seastar_gym.simulator.state import Clock
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

    def at(self, form):
        return self

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


def fail() -> None:
    raise MemoryError


HOOKS = {
    f"{when} {nth}, {bars}": ({when: interrupt}, KeyboardInterrupt, nth, bars == "error bars", SmaPulse())
    for when in ("before", "after")
    for nth, bars in ((1, "plain"), (3, "plain"), (1, "error bars"), (12, "error bars"))
} | {
    "a part that fails": ({"before": fail}, MemoryError, 3, False, SmaPulse()),
    "before 3, thermal": ({"before": interrupt}, KeyboardInterrupt, 3, False, ThermalSma()),
    "after 12, thermal": ({"after": interrupt}, KeyboardInterrupt, 12, True, ThermalSma()),
}


@THREADS
@pytest.mark.parametrize("hooks, error, nth, bars, actuator", HOOKS.values(), ids=HOOKS)
def test_an_interrupted_stroke_is_as_if_it_had_not_begun(monkeypatch, threads, hooks, error, nth, bars, actuator):
    """In the twin of error bars, too, and after it: its eleven parts come first."""
    scene = Scene(numerics=FAST, actuator=actuator)
    simulator = swimmers(threads, scene, bars)
    with interrupted(simulator, Kernel(monkeypatch, nth=nth, **hooks), error):
        simulator.stroke(COMMANDS[1])
    assert_not_begun(simulator, swimmers(1, scene, bars))


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


@contextlib.contextmanager
def swimming_elsewhere(monkeypatch, simulator: Simulator):
    """Another thread is in the middle of a stroke; it ends afterwards."""
    begun, go_on = threading.Event(), threading.Event()

    def wait():
        begun.set()
        assert go_on.wait(60.0)

    kernel, swimmer = Kernel(monkeypatch, before=wait), threading.Thread(target=simulator.stroke, args=[COMMANDS[1]])
    swimmer.start()
    try:
        assert begun.wait(60.0)
        yield kernel
    finally:
        go_on.set()
        swimmer.join()


@contextlib.contextmanager
def paused(monkeypatch, simulator: Simulator):
    parts = simulator.stroke_in_parts(COMMANDS[1], 3)
    next(parts)
    yield parts
    for _ in parts:
        pass


@pytest.mark.parametrize("call", IN_THE_MIDDLE.values(), ids=IN_THE_MIDDLE)
@pytest.mark.parametrize("threads, how", [(1, paused), (1, swimming_elsewhere), (3, swimming_elsewhere)])
def test_whatever_comes_in_the_middle_of_a_stroke_is_refused_and_changes_nothing(monkeypatch, threads, how, call):
    simulator, other = swimmers(threads), swimmers()
    told = r"^A stroke_in_parts .* under way: .*\.$" if how is paused else r"^Another thread .*\.$"
    with how(monkeypatch, simulator):
        with pytest.raises(RuntimeError, match=told):
            call(simulator)
        if how is swimming_elsewhere:  # not even read
            with pytest.raises(RuntimeError, match=told):
                simulator.get_state()
    other.stroke(COMMANDS[1])
    assert_same(simulator, other)
    call(simulator)


def break_off(monkeypatch, what: str, change: Callable[[], Any]) -> None:
    def interrupted(*_):
        raise KeyboardInterrupt

    owner, name = {"reset": (Clock, "put"), "set_scene": (Coefficients, "set_scene")}[what]
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, interrupted)
        with pytest.raises(KeyboardInterrupt):
            change()


@pytest.mark.parametrize("cure", ["reset", "set_state"])
@pytest.mark.parametrize("what", ["reset", "set_scene"])
def test_a_change_that_was_broken_off_asks_for_a_reset_or_a_state_which_cures_it(monkeypatch, what, cure):
    simulator = swimmers()
    break_off(monkeypatch, what, lambda: IN_THE_MIDDLE[what](simulator))
    some = np.arange(N_ROBOTS) < 2
    for _ in range(2):
        for refused in (lambda: simulator.stroke(COMMANDS[0]), simulator.get_state, lambda: simulator.reset(some)):
            with pytest.raises(RuntimeError, match=r"^This simulator was interrupted .* reset\(\) .*\.$"):
                refused()
    if cure == "reset":
        simulator.reset()
        simulator.stroke(COMMANDS[0])
    else:
        simulator.set_state(swimmers().get_state())
    assert_not_begun(simulator, swimmers())


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


def make(kind: str) -> gym.Env | gym.vector.VectorEnv:
    if kind == "batch":
        return gym.make_vec("SeastarSwim-v0", 3 * N_LANES, fidelity="fast", threads=2, randomization=RANDOM)
    render_mode = None if kind == "one" else kind
    return gym.make("SeastarSwim-v0", fidelity="fast", render_mode=render_mode, randomization=RANDOM)


@pytest.mark.parametrize("first", [True, False], ids=["before the first success", "later"])
@pytest.mark.parametrize("kind", ["one", "rgb_array_list", "batch"])
@pytest.mark.parametrize("what", ["step", "reset", "set_scene"])
def test_an_interrupted_environment_asks_for_a_reset_which_cures_it_and_a_refused_step_for_nothing(
    monkeypatch, kind, what, first
):
    env, fresh = make(kind), make(kind)
    action = env.action_space.sample()
    if what == "step" or not first:
        env.reset(seed=0)
    if not first:
        with pytest.raises(ValueError, match="7"):
            env.step(np.full_like(action, 7))
        env.step(action)
    if what == "step":
        with interrupted(env.unwrapped.simulator, Kernel(monkeypatch, before=interrupt, nth=1)):
            env.step(action)
    else:
        break_off(monkeypatch, what, lambda: env.reset(seed=6))
    with pytest.raises(gym.error.ResetNeeded, match=r"interrupted: call reset\(\)"):
        env.step(action)
    np.testing.assert_array_equal(env.reset(seed=1)[0], fresh.reset(seed=1)[0])
    np.testing.assert_array_equal(env.step(action)[0], fresh.step(action)[0])


# Ctrl-C while numba is imported, compiles or loads code


@contextlib.contextmanager
def handled_by(handler):
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
        assert signal.getsignal(signal.SIGINT) is handler
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("ends", [contextlib.nullcontext, lambda: pytest.raises(MemoryError)], ids=["well", "badly"])
@pytest.mark.parametrize("depth", [1, 3])
def test_ctrl_c_waits_for_the_end_of_what_holds_it_back_and_goes_to_whoever_handles_it_then(depth, ends):
    told = []
    with handled_by(lambda number, frame: told.append(number)), ends(), contextlib.ExitStack() as held:
        for _ in range(depth):
            held.enter_context(held_back())
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert not told
        if ends is not contextlib.nullcontext:
            raise MemoryError
    assert told == [signal.SIGINT]
    with handled_by(signal.default_int_handler):
        with pytest.raises(KeyboardInterrupt), held_back():
            signal.raise_signal(signal.SIGINT)
        with held_back(), pytest.raises(KeyboardInterrupt), let_through():  # while it waits for another process
            signal.raise_signal(signal.SIGINT)
    with handled_by(signal.SIG_IGN), held_back():
        signal.raise_signal(signal.SIGINT)


INTERRUPTED_AT_FIRST = """
import time
import gymnasium as gym, seastar_gym
begun, env = time.monotonic(), None
try:
    print("begun", flush=True)
    env = gym.make("SeastarSwim-v0", fidelity="fast")
    env.reset(seed=0)
    env.step([1, 0, 0, 2, 0])
    print(time.monotonic() - begun, flush=True)
    time.sleep(60.0)
except KeyboardInterrupt:
    env = env or gym.make("SeastarSwim-v0", fidelity="fast")
    env.reset(seed=0)
    print(env.step([1, 0, 0, 2, 0])[1], flush=True)
"""


def interrupted_at_first(after: float | None, cache) -> list[float]:
    """What a process prints that makes its first environment and is interrupted after a time [s], None: at its end."""
    command, variables = [sys.executable, "-c", INTERRUPTED_AT_FIRST], {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=variables, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        took = [process.stdout.readline()] if after is None else time.sleep(after) or []
        process.send_signal(signal.SIGINT)
        return [float(line) for line in [*took, *process.communicate(timeout=500.0)[0].split()]]


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C is sent otherwise on Windows")
def test_the_first_environment_can_be_interrupted_at_any_time(tmp_path):
    """While numba is imported, compiles, loads and runs code: the next reset works, and swims the same."""
    rng = np.random.default_rng(0)
    reward = interrupted_at_first(rng.uniform(3.0, 10.0), tmp_path)[-1]  # compilation alone takes 10 s
    loading, again = interrupted_at_first(None, tmp_path)
    assert again == reward
    for _ in range(3):
        assert interrupted_at_first(rng.uniform(0.0, loading), tmp_path)[-1:] == [reward]


# Threads and processes


def others() -> set[threading.Thread]:
    gc.collect()  # simulators of other tests
    return set(threading.enumerate())


@pytest.mark.parametrize("kind", ["simulator", "batch", "one"])
def test_close_ends_the_threads_and_a_stroke_starts_them_again_and_one_robot_has_none(kind):
    before = others()
    user = Simulator(Scene(numerics=FAST), N_ROBOTS, 2) if kind == "simulator" else make(kind)
    user.reset(**{} if kind == "simulator" else {"seed": 0})
    for _ in range(3):
        if kind == "simulator":
            user.stroke(COMMANDS[1])
        else:
            user.step(user.action_space.sample())
        # A pool starts its second thread when the first is busy.
        assert (kind != "one") <= len(others() - before) <= 2 * (kind != "one")
        user.close()
        user.close()
        assert not others() - before


def passes_in_a_fork(promise: Callable[[], None]) -> bool:
    """Whether a promise holds, within a minute, in a forked process, which has no other threads."""
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        try:
            promise()
        except BaseException:  # the child must not go on to the parent's other tests
            os._exit(1)
        os._exit(0)
    return os.waitpid(child, 0)[1] == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:This process.*is multi-threaded:DeprecationWarning")
def test_a_fork_swims_with_threads_of_its_own_and_knows_strokes_that_are_under_way(monkeypatch):
    """A paused one goes on. What another thread of the parent does nobody would end there: a reset repairs it."""
    simulator, other = swimmers(2), swimmers()

    def swims_on(closes):
        if closes:
            simulator.close()  # threads of the parent, which do not run here
        assert_not_begun(simulator, other)
        assert threading.active_count() > 1
        simulator.close()
        assert threading.active_count() == 1

    def goes_on(parts):
        with pytest.raises(RuntimeError, match="under way"):
            simulator.stroke(COMMANDS[1])
        thread = threading.Thread(target=lambda: [*parts])  # any thread resumes it
        thread.start()
        thread.join()
        other.stroke(COMMANDS[1])
        assert_not_begun(simulator, other)

    def repaired(kernel):
        kernel.remove()
        with pytest.raises(RuntimeError, match="interrupted"):
            simulator.stroke(COMMANDS[1])
        simulator.reset()
        simulator.stroke(COMMANDS[0])
        assert_not_begun(simulator, swimmers())

    for closes in (False, True):
        assert passes_in_a_fork(lambda closes=closes: swims_on(closes))
    with paused(monkeypatch, simulator) as parts:
        assert passes_in_a_fork(lambda: goes_on(parts))
    with swimming_elsewhere(monkeypatch, simulator) as kernel:
        assert passes_in_a_fork(lambda: repaired(kernel))
    for _ in range(2):
        other.stroke(COMMANDS[1])
    assert_same(simulator, other)
