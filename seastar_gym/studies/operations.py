"""Counts the floating-point operations of the kernels by running their own source on numbers that count.

The modules of `seastar_gym.der` are loaded a second time, with `Lanes` replaced by `Counted` and compilation left out,
so the count is that of the code that runs, robot by robot, in whatever scene it is asked for. It does not depend on
the machine, which makes it the measure that tests hold the kernels to.
"""

import importlib.util
import math
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import seastar_gym.der
from seastar_gym.der.schemes import SCHEMES
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator

COUNTED = "seastar_gym.der"
KERNELS = Path(seastar_gym.der.__file__).parent
FLOPS = {"add": 1, "multiply": 1, "fused": 2, "divide": 1, "root": 1}
"""Floating-point operations of what is counted; comparisons, selections, loads and stores are none."""

_counts: Counter[str] = Counter()


class Counted:
    """A float64 that counts what is done with it: one lane of `Lanes`."""

    __slots__ = ("value",)

    def __init__(self, value: float):
        self.value = float(value)

    def __add__(self, other: Any) -> "Counted":
        return _result("add", self.value + _value(other))

    def __sub__(self, other: Any) -> "Counted":
        if isinstance(other, Constant) and other.value == 0.0:
            return self  # the compiler leaves it out, too
        return _result("add", self.value - _value(other))

    def __rsub__(self, other: Any) -> "Counted":
        return _result("add", _value(other) - self.value)

    def __mul__(self, other: Any) -> "Counted":
        return _result("multiply", self.value * _value(other))

    def __truediv__(self, other: Any) -> "Counted":
        return _result("divide", _divide(self.value, _value(other)))

    def __rtruediv__(self, other: Any) -> "Counted":
        return _result("divide", _divide(_value(other), self.value))

    def __neg__(self) -> "Counted":
        return Counted(-self.value)  # folded into the operation that uses it

    def __lt__(self, other: Any) -> bool:
        return _compared(self.value < _value(other))

    def __le__(self, other: Any) -> bool:
        return _compared(self.value <= _value(other))

    def __gt__(self, other: Any) -> bool:
        return _compared(self.value > _value(other))

    def __ge__(self, other: Any) -> bool:
        return _compared(self.value >= _value(other))

    __radd__ = __add__
    __rmul__ = __mul__


class Constant(Counted):
    """A number that the compiler knows."""

    __slots__ = ()


def _value(x: Any) -> float:
    return x.value if isinstance(x, Counted) else float(x)


def _result(kind: str, value: float) -> Counted:
    _counts[kind] += 1
    return Counted(value)


def _divide(a: float, b: float) -> float:
    return a / b if b else math.nan


def _compared(answer: bool) -> bool:
    _counts["compare"] += 1
    return answer


def _load(rows: Any, row: int) -> Counted:
    _counts["load"] += 1
    return Counted(rows[row] if rows.ndim == 1 else rows[row, 0])


def _load_at(rows: Any, row: Counted) -> Counted:
    return _load(rows, int(row.value))


def _store(rows: Any, row: int, value: Any) -> None:
    _counts["store"] += 1
    rows[row, 0] = _value(value)


def _select(condition: bool | None, when_true: Any, when_false: Any) -> Any:
    if condition is None:
        return when_false
    _counts["select"] += 1
    return Counted(_value(when_true if condition else when_false))


def _counting_lanes() -> ModuleType:
    """A stand-in for der/lanes.py with one counting lane. Masks are plain booleans."""
    module = ModuleType("lanes")
    vars(module).update(
        N_LANES=1,
        borrow=lambda bundle: bundle,
        load=_load,
        load_at=_load_at,
        load_number=lambda rows, row: float(rows[row]),
        store=_store,
        store_number=lambda rows, row, value: rows.__setitem__(row, value),
        splat=Constant,
        select=_select,
        sqrt=lambda x: _result("root", math.sqrt(x.value)),
        absolute=lambda x: Counted(abs(x.value)),
        floor=lambda x: Counted(math.floor(x.value)),
        add_product=lambda c, a, b: _result("fused", _value(c) + _value(a) * _value(b)),
        subtract_product=lambda c, a, b: _result("fused", _value(c) - _value(a) * _value(b)),
        any_lane=bool,
        all_lanes=bool,
    )
    return module


def _load_counting_modules(folder: Path) -> dict[str, ModuleType]:
    """The kernels' modules, executed from their source on counting lanes; the real ones stay as they are."""
    compilation = ModuleType("compilation")
    vars(compilation).update(dict.fromkeys(("kernel", "inlined_kernel", "entry_point"), lambda function: function))
    # Whoever is imported comes before whoever imports it: what is not there yet would come from the package itself.
    names = (
        "current", "geometry", "star_matrix", "rods", "stretching", "bending", "drag", "added_mass", "fluid",
        "actuation", "contact", "energy", "damping", "star_solution", "coupled", "potential", "newton", "guard",
        "stages",
    )  # fmt: skip
    saved = {f"{COUNTED}.{name}": sys.modules.get(f"{COUNTED}.{name}") for name in (*names, "lanes", "compilation")}
    for name in names:
        sys.modules.pop(f"{COUNTED}.{name}", None)
    sys.modules[f"{COUNTED}.lanes"], sys.modules[f"{COUNTED}.compilation"] = _counting_lanes(), compilation
    try:
        for name in names:
            if f"{COUNTED}.{name}" not in sys.modules:
                spec = importlib.util.spec_from_file_location(f"{COUNTED}.{name}", folder / f"{name}.py")
                assert spec is not None and spec.loader is not None
                sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
        return {name: sys.modules[f"{COUNTED}.{name}"] for name in names}
    finally:
        for name, module_or_none in saved.items():
            if module_or_none is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module_or_none


def count_operations(scene: Scene, folder: Path = KERNELS) -> dict[str, Counter[str]]:
    """Operations of one robot, by part, in the middle of a heating ramp; folder: Where the kernels' source is.

    Keys: "hub hinges", "limbs" (assembly and elimination), "ring" (elimination and solution of root nodes and hub),
    "substitution" (and the Newton step), together "iteration"; and "step", what a step costs besides iterations
    (schemes of one stage).
    """
    modules = _load_counting_modules(folder)
    potential, newton, stages = modules["potential"], modules["newton"], modules["stages"]
    work, rods, scheme, actuation, state, a = _moving_robot(scene, modules)
    h = Counted(scene.numerics.step)
    parts: dict[str, Counter[str]] = {}

    def counted(part: str, call: Any) -> Any:
        _counts.clear()
        result = call()
        parts[part] = Counter(_counts)
        return result

    def limbs() -> None:
        D, r = (Counted(1.0), Counted(0.0), Counted(1.0)), (Counted(0.0), Counted(0.0))
        for limb in range(rods.n_limbs):
            D, r, *_ = potential.sweep_limb(rods, work, stage, limb, None, D, r)

    def step() -> None:
        begun = stages.begin_stage(rods, work, scheme, 0, *state, a, h)
        stages.set_natural_hub_angles(rods, work, actuation, Counted(1.0))
        stages.end_step(rods, work, scheme, begun, *state, a, h, True)

    stage = stages.begin_stage(rods, work, scheme, 0, *state, a, h)
    stages.set_natural_hub_angles(rods, work, actuation, Counted(1.0))
    counted("hub hinges", lambda: potential.assemble_hub_hinges(rods, work, stage, None))
    counted("limbs", limbs)
    unit = (Counted(1.0), Counted(0.0), Counted(1.0))
    counted("ring", lambda: modules["star_matrix"].solve_ring(work, rods.n_limbs, unit, unit[:2]))
    counted("substitution", lambda: newton.take_step(rods, work, True, False, Counted(1.0)))
    parts["iteration"] = sum(parts.values(), Counter())
    counted("step", step)
    return parts


def _moving_robot(scene: Scene, modules: dict[str, ModuleType]) -> tuple[Any, ...]:
    """Memory, coefficients, scheme, actuation, state rows and accelerations of a robot whose limbs are bending."""
    simulator = Simulator(scene, threads=1)
    command = np.zeros((1, scene.robot.n_limbs))
    command[0, 1], command[0, -1] = 1.0, -1.0
    stroke = simulator.stroke_in_parts(command, 20)
    next(stroke)
    scheme, rods, rows = SCHEMES[scene.numerics.scheme], scene.rods(), modules["rods"]
    work = rows.make_work(rods, scheme.n_stages)
    angles = 0.5 * scene.actuator.peak_angle * command.T
    q, v = simulator.positions.reshape(-1, 1), simulator.velocities.reshape(-1, 1)
    a = np.zeros(((len(q) + 1) * scheme.n_stages, 1))
    return work, rods, scheme, rows.Actuation(angles, angles), (q, v), a


def flops(counts: Counter[str]) -> int:
    """Floating-point operations of a count; a fused product counts as two."""
    return sum(FLOPS.get(kind, 0) * n for kind, n in counts.items())
