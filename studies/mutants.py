"""Whether the tests of a room notice that one line of it is wrong.

    python -m studies.mutants --count 100 --seed 1 --out runs/mutants

draws lines of Python rooms and changes one thing in each: an operator, a number, a truth, a default, a condition, a
returned value. Messages, docstrings and type hints stay. Every mutant is written into a copy of the repository, never
into the checkout, and meets the tests of its room that execute its line, until one fails. It is killed by a failure or
by the time limit; it survives; or no test executes its line. Those of `EQUIVALENT` behave as the original does, and do
not count. Which tests execute which lines is traced once and kept in OUT. Writes mutants.json.
"""

import ast
import gc
import importlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from studies.frame import Results, Study, require_known

ROOMS = {
    "seastar_gym/envs": "tests/envs", "seastar_gym/controllers": "tests/controllers",
    "seastar_gym/sweep": "tests/sweep", "seastar_gym/accuracy": "tests/accuracy",
    "seastar_gym/identify": "tests/identify", "seastar_gym/evaluation": "tests/evaluation",
}  # fmt: skip
"""Rooms, or single files, and the folders of their tests."""
SECONDS = 600.0
"""Time limit of a mutant."""
KERNELS = "simd.compilation"
"""Named by files whose code is compiled, and tested by differences and oracles. They are left out."""
SWAPS: dict[type, tuple[str, str]] = {
    ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"), ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"),
    ast.Mod: ("%", "*"), ast.FloorDiv: ("//", "*"), ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"),
    ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip
EXACTLY = "A distance that is exactly the limit does not happen."
SHADE = "Nobody sees a 255th of a colour."
EQUIVALENT: dict[tuple[str, str], str] = {
    ("seastar_gym/accuracy/measure.py",
     "for k, (each, space, in_time) in enumerate(zip(settings, swum.space, swum.time, strict=False), start=1):"):
        "There are as many swims as settings.",
    ("seastar_gym/envs/rendering.py", "PLANNED: Colour = (190, 199, 208)"): SHADE,
    ("seastar_gym/envs/canvas.py", "WATER: Colour = (250, 253, 254)"): SHADE,
    ("seastar_gym/envs/waypoint_labels.py",
     "together = np.flatnonzero(np.hypot(*(path - path[waypoint]).T) < same_place)"): EXACTLY,
    ("seastar_gym/envs/tasks/discs.py",
     "is_free = (rims(grid.nodes, discs).min(axis=-1, initial=np.inf) > clearance).ravel()"): EXACTLY,
    ("seastar_gym/envs/rendering.py",
     "place = self.camera.to_pixels(label.place) + distance * label.direction / [1.0, -1.0]"): "1/1 and 1/-1.",
    ("seastar_gym/identify/covariance.py", "remembered = REMEMBERED * (times[-1] - times[1])"):
        "Every time is there for x and for y.",
    ("seastar_gym/envs/tasks/obst_trap.py", "touches = self.clearance(hub) <= 0.0"): EXACTLY,
    ("seastar_gym/envs/waypoint_labels.py", "same_place = 2e-09 + 1e-6 * float(np.ptp(path, axis=0).max())"): EXACTLY,
    ("seastar_gym/envs/swimming.py",
     'if scene.robot.hub_hinge == "turning" and 2 * peak >= scene.robot.opening_angle * (1 - 2e-09):'): EXACTLY,
    ("seastar_gym/envs/commands.py", "return seconds > actuator.period * (1.0 - JUMP)"): EXACTLY,
    ("seastar_gym/envs/tasks/rounds.py", "among = np.flatnonzero(brought > most - 1e-9)"): EXACTLY,
    ("seastar_gym/envs/tasks/miswired.py",
     "return np.where(self.wiring[..., None] < 1.0, of_wires[..., ::-1], of_wires)"): "Wiring is -1 or 1.",
    ("seastar_gym/sweep/designs.py", "return np.zeros((1, 1))"): "No range reads the columns.",
    ("seastar_gym/controllers/planner.py", "first = np.zeros((len(current), 2), np.int64)"):
        "The first decision replaces it.",
    ("seastar_gym/envs/task.py", "self._way_after = np.zeros((n_robots, 2))  # from waypoint k to the last [m]"):
        "The last column is read of no path.",
    ("seastar_gym/envs/rendering.py", "return HEATED_PLUS if command >= 0.0 else HEATED_MINUS"):
        "A command of zero has another colour.",
    ("seastar_gym/envs/symmetry/group.py", "return (2 * k - (first - second) % 2) % (2 * n_turns_of(group))"):
        "Sums and differences are odd together.",
}  # fmt: skip
"""Reasons why mutants, (file, line after the change), behave as the original does."""
PRELOADED = ("numba", "pyarrow.dataset", "scipy.optimize", "scipy.stats")
"""Imported once, for all mutants."""
ANEW = {"seastar_gym", "studies", "agents", "gymnasium", "typeguard"}
"""Imported anew from the copy by every mutant; gymnasium keeps a registry of environments, and pytest warns where it
meets its plugin typeguard, which the command has imported."""
DECLARED = "declared_as_recorded"
"""In the names of tests of all that a room declares. They see what an import executes."""
Touched = dict[str, dict[str, list[int]]]
"""Lines that a test executes, by test and file."""


class Mutant(NamedTuple):
    """A change of one line. begin, end: Bytes of the line that `new` replaces. scope: Lines whose tests are asked."""

    file: str
    line: int
    begin: int
    end: int
    new: str
    scope: tuple[int, int]


def between(left: Any, right: Any, operator: ast.AST, lines: list[bytes]) -> tuple[int, int, int, str] | None:
    """(line, begin, end, new) of an operator between two operands on one line."""
    if type(operator) not in SWAPS or left.end_lineno != right.lineno:
        return None
    old, new = SWAPS[type(operator)]
    begin = lines[left.end_lineno - 1].find(old.encode(), left.end_col_offset, right.col_offset)
    return None if begin < 0 else (left.end_lineno, begin, begin + len(old), new)


def whole(node: Any, new: str) -> tuple[int, int, int, str] | None:
    """(line, begin, end, new) of a node on one line."""
    one_line = node.lineno == node.end_lineno
    return (node.lineno, node.col_offset, node.end_col_offset, new) if one_line else None


def changes(node: Any, lines: list[bytes]) -> Iterator[tuple[int, int, int, str] | None]:
    """What may be changed at a node."""
    match node:
        case ast.Compare():
            for left, operator, right in zip((node.left, *node.comparators), node.ops, node.comparators, strict=False):
                yield between(left, right, operator, lines)
        case ast.BinOp(left=left, right=right) if not (isinstance(node.op, ast.BitOr) and is_type(left)):
            yield between(left, right, node.op, lines)
        case ast.BoolOp(values=[*values]):
            yield between(values[0], values[1], node.op, lines)
        case ast.AugAssign(target=target, value=value):
            yield between(target, value, node.op, lines)
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand) if node.lineno == operand.lineno:
            yield node.lineno, node.col_offset, operand.col_offset, ""
        case ast.Constant(value=bool(value)):
            yield whole(node, str(not value))
        case ast.Constant(value=int(value)):
            yield whole(node, str(value + 1))
        case ast.Constant(value=float(value)):
            yield whole(node, repr(2.0 * value or 1.0))
        case ast.Return(value=value) if value is not None and not isinstance(value, ast.Constant):
            yield whole(value, "None")
        case ast.If(test=test) | ast.IfExp(test=test):
            yield whole(test, "False")


def is_type(node: Any) -> bool:
    """Whether an operand of | seems to be a type, such as int or Scene."""
    name = getattr(node, "id", getattr(node, "attr", ""))
    return name[:1].isupper() or name in {"int", "float", "str", "bool", "list", "dict", "tuple"} or (
        isinstance(node, ast.BinOp) and is_type(node.left)
    )  # fmt: skip


def walk(node: Any, scope: tuple[int, int]) -> Iterator[tuple[Any, tuple[int, int]]]:
    """Nodes that may be changed, with the lines of the function, or of the file, around them."""
    if isinstance(node, ast.FunctionDef):
        scope = node.body[0].lineno, node.end_lineno or node.lineno
    yield node, scope
    for name, field in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list"}:
            continue
        for child in field if isinstance(field, list) else [field]:
            if isinstance(child, ast.AST) and not isinstance(child, ast.Raise | ast.JoinedStr | ast.Import):
                yield from walk(child, scope)


def mutants_of(root: Path, file: str) -> Iterator[Mutant]:
    """All mutants of a file."""
    source = (root / file).read_bytes()
    lines = source.splitlines()
    if KERNELS.encode() in source:
        return
    for node, scope in walk(ast.parse(source), (1, len(lines))):
        for change in changes(node, lines):
            if change is not None:
                yield Mutant(file, *change, scope)


def drawn(root: Path, rooms: dict[str, str], count: int, seed: int) -> list[Mutant]:
    """Mutants drawn from the rooms, without replacement."""
    places = [root / room for room in rooms]
    files = [file for place in places for file in (place.rglob("*.py") if place.is_dir() else [place])]
    names = sorted(str(file.relative_to(root)) for file in files)
    return random.Random(seed).sample([mutant for name in names for mutant in mutants_of(root, name)], count)


def changed(root: Path, mutant: Mutant) -> tuple[str, str]:
    """(line before, line after) the change, without what surrounds them."""
    line = (root / mutant.file).read_bytes().splitlines()[mutant.line - 1]
    return line.decode().strip(), (line[: mutant.begin] + mutant.new.encode() + line[mutant.end :]).decode().strip()


def apply(root: Path, mutant: Mutant) -> None:
    """Write a mutant into its file."""
    lines = (root / mutant.file).read_bytes().splitlines(keepends=True)
    line = lines[mutant.line - 1]
    lines[mutant.line - 1] = line[: mutant.begin] + mutant.new.encode() + line[mutant.end :]
    (root / mutant.file).write_bytes(b"".join(lines))


class Tracer:
    """Plugin of pytest that notes which lines of the rooms every test executes that passes."""

    def __init__(self, root: Path, rooms: dict[str, str]):
        self.root, self.rooms = f"{root}/", tuple(f"{root}/{room}" for room in rooms)
        self.touched: dict[str, dict[str, set[int]]] = {}

    def pytest_runtest_protocol(self, item: Any) -> None:
        """Begin with the lines of a test."""
        self._lines = self.touched.setdefault(item.nodeid, {})
        sys.settrace(self._call)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """Forget a test that fails without any change."""
        if report.failed:
            self.touched.pop(report.nodeid, None)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """End with them."""
        sys.settrace(None)

    def _call(self, frame: Any, event: str, argument: Any) -> Any:
        file = frame.f_code.co_filename
        if not file.startswith(self.rooms):
            return None
        lines = self._lines.setdefault(file.removeprefix(self.root), set())

        def line(frame: Any, event: str, argument: Any) -> Any:
            lines.add(frame.f_lineno)
            return line

        return line(frame, event, argument)

    def as_lists(self) -> Touched:
        """What was touched."""
        return {test: {file: sorted(lines) for file, lines in files.items()} for test, files in self.touched.items()}


def in_child(root: Path, arguments: list[str], seconds: float, tracer: Tracer | None = None, out: str = "") -> int:
    """Exit code of pytest in a child process, which has all that was imported here; -1 where its time was over."""
    gc.freeze()  # in the child, a collection would write to every page of what was imported here
    child = os.fork()
    if child == 0:
        import pytest

        os.setpgid(0, 0)
        os.chdir(root)
        os.environ["PYTHONPATH"], sys.dont_write_bytecode = str(root), True
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        os.environ["PYTEST_ADDOPTS"] = "--numprocesses=0"  # others would run the tests, unseen by the tracer
        sys.path.insert(0, str(root))
        for name in [name for name in sys.modules if name.partition(".")[0] in ANEW]:
            del sys.modules[name]
        with open(os.devnull if not out else f"{out}.log", "w", encoding="utf-8") as log:
            os.dup2(log.fileno(), 1)
            os.dup2(log.fileno(), 2)
            code = pytest.main([*arguments, "-q", "-p", "no:cacheprovider"], [tracer] if tracer else [])
            if tracer:
                Path(out).write_text(json.dumps(tracer.as_lists()), encoding="utf-8")
        sys.stdout.flush()
        os._exit(int(code))
    gc.unfreeze()
    return waited_for(child, seconds)


def waited_for(child: int, seconds: float) -> int:
    """Exit code of a child process, which is killed, with its own children, where its time is over: -1."""
    end = time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                child = 0
                return os.waitstatus_to_exitcode(status)
            time.sleep(0.02)
        return -1
    finally:
        if child:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)


def asked(mutant: Mutant, tests: str, touched: Touched) -> list[str]:
    """Tests of a folder that execute the line, or the lines around a line that is executed by an import, only."""
    of_room = {test: files.get(mutant.file, []) for test, files in touched.items() if test.startswith(f"{tests}/")}
    exact = [test for test, lines in of_room.items() if mutant.line in lines]
    low, high = mutant.scope
    if mutant.line < low or low == 1:  # such as a constant, or the default of an argument
        around = [test for test, lines in of_room.items() if any(low <= line <= high for line in lines)]
        exact = [test for test in of_room if DECLARED in test] + (exact or around)
    own = f"test_{Path(mutant.file).stem}.py"
    return sorted({*exact}, key=lambda test: (DECLARED not in test, own not in test, len(touched[test]), test))


def verdict(root: Path, mutant: Mutant, tests: str, touched: Touched, seconds: float) -> str:
    """killed, survived, or not covered."""
    chosen = asked(mutant, tests, touched)
    if not chosen:
        return "not covered"
    original = (root / mutant.file).read_bytes()
    apply(root, mutant)
    code = in_child(root, ["-x", *chosen], seconds)
    (root / mutant.file).write_bytes(original)
    return "survived" if code == 0 else "killed"


def study(checkout: Path, rooms: dict[str, str], count: int, seed: int, seconds: float, out: Path) -> dict[str, Any]:
    """Verdicts on mutants drawn from rooms of a checkout."""
    out.mkdir(parents=True, exist_ok=True)
    for name in PRELOADED:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        for name in subprocess.check_output(["git", "ls-files"], cwd=checkout, text=True).splitlines():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(checkout / name, root / name)
        kept, tests = out.resolve() / "touched.json", sorted(set(rooms.values()))
        if not kept.exists() and in_child(root, tests, 7200.0, Tracer(root, rooms), str(kept)) not in (0, 1):
            raise ValueError(f"The tests could not be traced, see {kept}.log.")
        touched = json.loads(kept.read_text(encoding="utf-8"))
        found: dict[str, list[dict[str, Any]]] = {}
        for mutant in drawn(root, rooms, count, seed):
            of_room = next(tests for room, tests in rooms.items() if mutant.file.startswith(room))
            before, after = changed(root, mutant)
            reason = EQUIVALENT.get((mutant.file, after))
            said = "equivalent" if reason else verdict(root, mutant, of_room, touched, seconds)
            found.setdefault(said, []).append(
                {"file": mutant.file, "line": mutant.line, "before": before, "after": after, "reason": reason}
            )
            if said != "killed":
                print(f"{said}: {mutant.file}:{mutant.line}\n  {before}\n  {after}", flush=True)
    counts = {said: len(mutants) for said, mutants in found.items()}
    share = counts.get("killed", 0) / max(1, count - counts.get("equivalent", 0))
    return {"seed": seed, "count": count, **counts, "share_killed": round(share, 4), "mutants": found}


@dataclass(frozen=True)
class Options:
    """Which mutants are drawn."""

    count: int = 100
    """Number of mutants."""
    seed: int = 0
    """Which are drawn."""
    rooms: tuple[str, ...] = tuple(ROOMS)
    """Rooms."""
    seconds: float = SECONDS
    """Time limit of a mutant."""

    def __post_init__(self) -> None:
        require_known("room", self.rooms, ROOMS)


def run(options: Options, results: Results) -> None:
    """Draw mutants and say which survive."""
    rooms = {room: ROOMS[room] for room in options.rooms}
    results.update(study(Path.cwd(), rooms, options.count, options.seed, options.seconds, results.out))
    print(json.dumps({name: value for name, value in results.items() if name != "mutants"}))


STUDY = Study("mutants", run, Options, "mutants.json", Path("runs/mutants"))
