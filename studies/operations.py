"""Number of floating-point operations of the kernels, counted by running their source on lanes that count.

Kernels that Python calls run in Python, see seastar_gym/lanes/plain.py, so the count is that of the code that
runs, for one robot of any scene. It does not depend on the machine, and tests bound it.
"""

from collections import Counter
from typing import Any
from unittest.mock import patch

import numpy as np

from seastar_gym.lanes import plain as numpy_lanes
from seastar_gym.lanes.plain import Lanes, Mask
from seastar_gym.lanes.registers import N_LANES
from seastar_gym.model import make_rods
from seastar_gym.rods.bundles import make_work
from seastar_gym.rods.newton import take_step
from seastar_gym.rods.potential import assemble_hub, solve_hub, sweep_limb
from seastar_gym.rods.step import begin_stage, end_step, scheme_of
from seastar_gym.rods.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.scene import Scene
from seastar_gym.simulator import Simulator

FLOPS = {"add": 1, "multiply": 1, "fused": 2, "divide": 1, "root": 1}
"""Floating-point operations per counted operation; comparisons, selections, loads and stores do not count. Of loads,
those of a robot's own numbers are counted, not those of numbers that all robots share."""

_counts: Counter[str] = Counter()


class Counted(Lanes):
    """Lanes that count the operations on them."""

    __slots__ = ()

    def made(self, operation: str, numbers: Any) -> "Counted":
        _counts[operation] += 1
        return Counted(numbers)

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, Constant) and other.numbers == 0.0:
            return self  # the compiler omits this subtraction
        return super().__sub__(other)


class Constant(Counted):
    """Lanes whose value is known when kernels are compiled."""

    __slots__ = ()


load, load_at, store = numpy_lanes.load, numpy_lanes.load_at, numpy_lanes.store


def _load(rows: Any, row: int) -> Counted:
    _counts["load"] += rows.ndim > 1
    return Counted(load(rows, row).numbers)


def _store(rows: Any, row: int, value: Any) -> None:
    _counts["store"] += 1
    store(rows, row, value)


COUNTING: dict[str, Any] = {
    "load": _load, "store": _store, "splat": Constant,
    "load_at": lambda rows, row: Counted(load_at(rows, row).numbers),
}  # fmt: skip
"""Functions in place of those of plain.py."""


@np.errstate(all="ignore")
@patch.multiple(numpy_lanes, **COUNTING)
def count_operations(scene: Scene) -> dict[str, Counter[str]]:
    """Operations of one robot in the middle of a heating ramp, by part.

    The parts of an iteration are "hub hinges", "limbs" (assembly and elimination), "ring" (elimination and solution for
    the root nodes and the hub) and "substitution" (with the Newton step); "iteration" is their sum. "step" counts the
    operations of a time step outside iterations, for schemes with one stage.
    """
    work, rods, scheme, actuation, state, a = _moving_robot(scene)
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
            D, r, *_ = sweep_limb(rods, work, stage, limb, None, D, r)

    def step() -> None:
        begun = begin_stage(rods, work, scheme, 0, *state, a, h)
        set_natural_hub_angles(rods, work, actuation, Counted(1.0))
        end_step(rods, work, scheme, begun, *state, a, h, Mask(True))

    stage = begin_stage(rods, work, scheme, 0, *state, a, h)
    set_natural_hub_angles(rods, work, actuation, Counted(1.0))
    counted("hub hinges", lambda: assemble_hub(rods, work, stage, None))
    counted("limbs", limbs)
    unit = (Counted(1.0), Counted(0.0), Counted(1.0))
    counted("ring", lambda: solve_hub(rods, work, unit, unit[:2]))
    counted("substitution", lambda: take_step(rods, work, Mask(True), Mask(False), Counted(1.0)))
    parts["iteration"] = sum(parts.values(), Counter())
    counted("step", step)
    return parts


def _moving_robot(scene: Scene) -> tuple[Any, ...]:
    """Memory, coefficients, scheme, actuation, state rows and accelerations of a robot with bending limbs."""
    simulator = Simulator(scene, threads=1)
    command = np.zeros((1, scene.robot.n_limbs))
    command[0, 1], command[0, -1] = 1.0, -1.0
    stroke = simulator.stroke_in_parts(command, 20)
    next(stroke)
    scheme, rods = scheme_of(scene.numerics.scheme, scene.numerics.damping), make_rods(scene)
    work = make_work(rods, scheme.n_stages)
    angles, q, v = (
        np.repeat(numbers.reshape(-1, 1), N_LANES, axis=1)
        for numbers in (0.5 * scene.actuator.peak_angle * command, simulator.positions, simulator.velocities)
    )
    a = np.zeros(((len(q) + 1) * scheme.n_stages, N_LANES))
    return work, rods, scheme, Actuation(angles, angles), (q, v), a


def flops(counts: Counter[str]) -> int:
    """Number of floating-point operations in a count; a fused product counts as two."""
    return sum(FLOPS.get(kind, 0) * n for kind, n in counts.items())


def numbers_moved(counts: Counter[str]) -> int:
    """Numbers that are read from a robot's memory and written there in a count."""
    return counts["load"] + counts["store"]
