"""Cases of the atlas of stability: eight quantities against the time step, and the text of their values."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from seastar_gym.scene import Seastar, Water

STEPS = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 2e-2, 5e-2, 1e-1, 3e-1, 1.0)
"""Time steps of the atlas [s]."""


@dataclass(frozen=True)
class Case:
    """A scene without its time step, and the initial state of its robots.

    speed: Standard deviation of the random initial velocities, per component and node [m/s].
    shift: Largest random initial displacement of a node, per component, as a fraction of the edge length.
    all_commands: Simulate one robot for every command of -1, 0 and +1 per limb.
    """

    robot: Seastar = Seastar(nodes_per_limb=10)
    fluid: Water | None = field(default_factory=Water)
    peak_angle: float = math.pi / 5
    speed: float = 0.0
    shift: float = 0.0
    all_commands: bool = False


@dataclass(frozen=True)
class Sweep:
    """A quantity that the atlas varies.

    values: Values of the quantity in `unit`; None is vacuum.
    case: Case of a value.
    chapter: Value in the chapter, in `unit`.
    """

    name: str
    label: str
    unit: str
    values: tuple[float | None, ...]
    case: Callable[[float | None], Case]
    chapter: float


def _robot(**changes: float | int) -> Case:
    return Case(robot=replace(Seastar(nodes_per_limb=10), **changes))  # type: ignore[arg-type]


def _number(value: float | None) -> float:
    assert value is not None
    return value


SWEEPS = (
    Sweep(
        "youngs_modulus", "Young's modulus", "Pa", tuple(10.0**k for k in range(2, 12)),
        lambda E: _robot(youngs_modulus=_number(E)), 1e6,
    ),
    Sweep(
        "rod_radius", "rod radius", "mm", (0.01, 0.03, 0.1, 0.3, 0.8, 1.6, 4.0, 10.0, 20.0),
        lambda r: _robot(rod_radius=1e-3 * _number(r)), 1.6,
    ),
    Sweep(
        "nodes_per_limb", "nodes per limb", "", (2, 3, 5, 10, 20, 40, 80, 160, 320, 640),
        lambda N: _robot(nodes_per_limb=int(_number(N))), 10,
    ),
    Sweep(
        "drag_coefficient", "drag coefficient", "", (None, 0.0, 0.01, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4),
        lambda c: Case(fluid=None if c is None else Water(drag_coefficient=c)), 1.0,
    ),
    Sweep(
        "density_ratio", "density of limbs over water", "", (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0),
        lambda ratio: _robot(density=1000.0 * _number(ratio)), 1.0,
    ),
    Sweep(
        "speed", "random velocities of nodes", "m/s", (0.0, 0.001, 0.01, 0.1, 1.0, 10.0, 30.0, 100.0),
        lambda speed: Case(speed=_number(speed)), 0.0,
    ),
    Sweep(
        "shift", "random shifts of nodes", "% of an edge", (0.0, 0.3, 1.0, 3.0, 10.0, 20.0, 30.0),
        lambda shift: Case(shift=0.01 * _number(shift)), 0.0,
    ),
    Sweep(
        "peak_angle", "peak angle, all 243 commands", "°",
        (9.0, 18.0, 36.0, 54.0, 72.0, 90.0, 108.0, 135.0, 162.0, 179.0),
        lambda angle: Case(peak_angle=math.radians(_number(angle)), all_commands=True), 36.0,
    ),
)  # fmt: skip


def format_value(sweep: Sweep, value: float | None) -> str:
    """Text of a value of a sweep without its unit, such as 10⁶, 1.6 or vacuum."""
    if value is None:
        return "vacuum"
    if value >= 1e4:
        return "10" + str(round(math.log10(value))).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{value:g}"


def format_step(step: float) -> str:
    """Text of a time step [s] in the unit that makes it a number from 1 to 999."""
    if step < 1e-3:
        return f"{1e6 * step:g} µs"
    return f"{1e3 * step:g} ms" if step < 1.0 else f"{step:g} s"
