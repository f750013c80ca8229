"""What a plain `pytest` runs, the core: tests that need no machine code, or that of a few kinds of scenes.

Most of a first run is compilation, 8 to 10 s for each kind of scene, and most kinds serve one file. A test that asks
for machine code of another kind than `KINDS` is left to `--all` as it asks, and so is one that starts a process.
`times.json` names the tests that take longer than `LONG`, and what each file takes, so that the longest begin first;
`--record` writes it, of a run with the code on disk. Files named on the command line run whole, but with `--core`.
After a core, `--all --left` runs what it left and nothing else.
"""

import hashlib
import json
import multiprocessing.process
import os
import resource
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

LONG = 2.0
"""Processor time of a test from which on it is left to --all [s]."""
TIMES = Path(__file__).parent / "times.json"
LEFT = "runs with --all"
HELPERS = {"fc-list", "ldconfig", "lscpu", "uname"}
"""Programs that libraries start to look around."""
IMPORTS = """
import gymnasium as gym
import numpy as np
import seastar_gym
from seastar_gym import Body, Contact, Limb, Scene, Seastar, Simulator, SmaWires, UniformCurrent, Water
from seastar_gym.gradients import differentiate, record

def stroke(n=1, **parts):
    simulator = Simulator(Scene(**parts), n)
    simulator.stroke(np.ones((n, simulator.scene.robot.n_limbs)))
    simulator.elastic_energy(), simulator.kinetic_energy()

def swim(env):
    env.reset(seed=0)
    for _ in range(12):  # beyond a second, from which on growth of energy is measured
        env.step(env.action_space.sample())

def forward_and_back():
    scene, commands = Scene.preset('fast'), np.ones((1, 5))
    differentiate(scene, commands, ['commands'])
    swum = record(scene, commands)
    swum.gradient({'positions': np.ones(swum.swim.positions.shape)}, ['commands', 'robot.density'])
"""
KINDS = {
    "gradients": "forward_and_back()",
    "environments": "swim(gym.make('SeastarSwim-v0')), swim(gym.make('SeastarFailBlind-v0'))",
    "a batch": "swim(gym.make_vec('SeastarSwimTimed-v0', 3, vectorization_mode='vector_entry_point'))",
    "wires": "stroke(actuator=SmaWires()), stroke(8, actuator=SmaWires())",
    "hub hinges": "stroke(robot=Seastar(discretisation='chapter'))",
    "current": "stroke(fluid=Water(current=UniformCurrent(0.01, 0.0)))",
    "contact": "stroke(contact=Contact())",
    "body": "stroke(robot=Seastar(body=Body(radius=0.02, mass=0.01)))",
    "sections": "stroke(3, robot=Seastar(limbs=(Limb(radius=1e-3 * np.array([1.0, 1.1, 1.2])),) * 5))",
}
"""Scenes whose code is compiled before the tests begin, side by side, that of the first for longest."""


def wanted_by(code: str) -> set[str]:
    """Kinds of machine code that Python code asks for, in this process."""
    from seastar_gym.lanes.compile import _DigestCache

    found, load = set(), _DigestCache.load_overload

    def load_overload(cache, sig, context):
        found.add(cache.kind(sig))
        return load(cache, sig, context)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_DigestCache, "load_overload", load_overload)
        exec(IMPORTS + code, {})
    return found


def run(code: str) -> list[str]:
    """Lines that Python code prints in a process of its own, and a last one of what `wanted_by` finds, as JSON."""
    from seastar_gym.lanes.compile import PACKAGE

    program = f"import json, core; print(json.dumps(sorted(core.wanted_by({code!r}))))"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(PACKAGE.parent), str(Path(__file__).parent)])}
    done = subprocess.run([sys.executable, "-c", program], env=env, stdout=subprocess.PIPE, text=True)
    return done.stdout.splitlines()


def core_kinds() -> set[str]:
    """Kinds of machine code of the core, compiled by processes side by side where it is not yet on the disk."""
    from seastar_gym.lanes.compile import PACKAGE, kept_code

    def compile_all() -> bytes:
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:
            kinds = {kind for lines in threads.map(run, KINDS.values()) for kind in json.loads(lines[-1])}
        return json.dumps(sorted(kinds)).encode()

    digest = hashlib.sha256(Path(__file__).read_bytes())
    for source in sorted(PACKAGE.rglob("*.py")):
        digest.update(source.read_bytes())
    return set(json.loads(kept_code(f"core-{digest.hexdigest()[:16]}.json", compile_all)))


class Core:
    """Plugin of pytest: leaves to --all what is not of the core."""

    def __init__(self, kinds: set[str], long: set[str]):
        self.kinds, self.long = kinds, long
        self.left = ""  # why the present test is left to --all

    def leave(self, why: str) -> None:
        """End the present test."""
        self.left = f"{why}: {LEFT}"
        pytest.skip(self.left)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        self.left = ""
        with pytest.MonkeyPatch.context() as patch:
            self._watch(patch)
            return (yield)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item):
        if item.nodeid in self.long:
            self.leave("takes long")

    def _watch(self, patch: pytest.MonkeyPatch) -> None:
        from seastar_gym.lanes import compile as compilation
        from seastar_gym.lanes import cuda, scalar

        start, load = subprocess.Popen.__init__, compilation._DigestCache.load_overload

        def popen(process, args, *more, **named):
            if Path(args if isinstance(args, str) else os.fsdecode(args[0])).name not in HELPERS:
                self.leave("starts a process")
            start(process, args, *more, **named)

        def load_overload(cache, sig, context):
            if cache.is_of_package and (kind := cache.kind(sig)) not in self.kinds:
                self.leave(f"compiles another kind of scene, {kind.partition('.py3')[0]}")
            return load(cache, sig, context)

        def leave(*_, **__):
            self.leave("starts a process, or compiles for a device")

        patch.setattr(subprocess.Popen, "__init__", popen)
        patch.setattr(multiprocessing.process.BaseProcess, "start", leave)
        patch.setattr(os, "fork", leave)
        patch.setattr(compilation._DigestCache, "load_overload", load_overload)
        patch.setattr(cuda, "kept_code", leave)
        patch.setattr(scalar, "kept_code", leave)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        if self.left and report.failed:  # it was left in a thread, or behind an except
            report.outcome, report.longrepr = "skipped", (str(item.path), item.location[1] or 0, self.left)
        return report


class Left:
    """Plugin of pytest: keeps in its cache which tests the core left, and deselects all others if it is asked to."""

    def __init__(self, config: pytest.Config, is_core: bool):
        self.config, self.is_core, self.tests = config, is_core, list[str]()
        self.cache = getattr(config, "cache", None)

    def pytest_collection_modifyitems(self, config, items):
        if config.getoption("--left") and self.cache:
            wanted = set(self.cache.get("core/left", None) or [item.nodeid for item in items])
            config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in wanted])
            items[:] = [item for item in items if item.nodeid in wanted]

    def pytest_runtest_logreport(self, report):
        if report.skipped and LEFT in str(report.longrepr):
            self.tests.append(report.nodeid)

    def pytest_sessionfinish(self):
        if self.is_core and self.cache and not hasattr(self.config, "workerinput"):
            self.cache.set("core/left", self.tests)


class Times:
    """Plugin of pytest: has the longest files begin first, and writes what tests take if it is asked to."""

    def __init__(self, which: str, record: bool):
        self.which, self.record = which, record  # "core" or "all"
        self.kept = json.loads(TIMES.read_text(encoding="utf-8")) if TIMES.exists() else {}
        self.started = 0.0
        self.tests: dict[str, float] = {}

    def pytest_collection_modifyitems(self, config, items):
        seconds = Counter(self.kept.get(self.which, {}))
        if config.getoption("--left"):
            seconds.subtract(self.kept.get("core", {}))
        items.sort(key=lambda item: -seconds[file_of(item.nodeid)])

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        self.started = processor_time()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        report.processor_time = processor_time() - self.started
        return report

    def pytest_runtest_logreport(self, report):
        self.tests[report.nodeid] = report.processor_time

    def pytest_sessionfinish(self, session):
        if not self.record or hasattr(session.config, "workerinput"):
            return
        files: Counter[str] = Counter()
        for test, seconds in self.tests.items():
            files[file_of(test)] += seconds
        self.kept[self.which] = {file: round(seconds, 1) for file, seconds in sorted(files.items()) if seconds > 0.05}
        if self.which == "all":
            self.kept["long"] = sorted(test for test, seconds in self.tests.items() if seconds > LONG)
        TIMES.write_text(json.dumps(self.kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def file_of(test: str) -> str:
    """File of a test."""
    return test.partition("::")[0]


def processor_time() -> float:
    """Processor time of this process and of those that it started and that have ended [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


class Start:
    """Plugin of pytest: decides what runs, and tells the processes that share the tests."""

    def __init__(self, config: pytest.Config):
        named = config.args_source is not config.ArgsSource.TESTPATHS
        everything = config.getoption("--all") or (named and not config.getoption("--core"))
        self.kinds = None if everything else sorted(core_kinds())

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node):
        node.workerinput["kinds"] = self.kinds


def register(config: pytest.Config) -> None:
    """Register the plugins that this run needs."""
    if config.getoption("collectonly"):
        return
    if hasattr(config, "workerinput"):
        kinds = config.workerinput["kinds"]
    else:
        start = Start(config)
        config.pluginmanager.register(start)
        kinds = start.kinds
    times = Times("all" if kinds is None else "core", config.getoption("--record"))
    config.pluginmanager.register(times)
    config.pluginmanager.register(Left(config, kinds is not None))
    if kinds is not None:
        config.pluginmanager.register(Core(set(kinds), set(times.kept.get("long", ()))))
