"""Forces of a user's own on nodes: of an energy U(x, y), -grad U, and of a dissipation D(w_x, w_y), -grad D.

w = v - u is a node's velocity relative to the fluid. They add U(q) + gamma D(w) to the incremental potential, as drag
does (drag.py), so what a step does with them is what it does with the package's. A user writes each of the two as a
function of coefficients of the node and of two numbers, that returns its value, slopes and second slopes:

    def dissipation(c, wx, wy):
        return 0.5 * c * (wx * wx + wy * wy), (c * wx, c * wy), (c, 0.0 * c, c)

D is convex, so that it never gives energy. Second slopes of U count where the node's inertia outweighs them, so that
matrices of convex parts alone stay positive definite; without, Newton's method takes more steps to the same end.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from seastar_gym.lanes.compile import kernel
from seastar_gym.lanes.functions import compiled, handed, require_compiled
from seastar_gym.lanes.plain import Lanes
from seastar_gym.lanes.registers import add_product, load, select

KINDS = "energy", "dissipation"


class Own(NamedTuple):
    """Sums of all own energies and dissipations, each a kernel of (numbers, row, x, y), or None where there is none.

    numbers: Coefficients of all terms, `width` rows per node.
    """

    energy: Any
    dissipation: Any
    numbers: np.ndarray
    width: int


class Function(NamedTuple):
    """A term's energy or dissipation, and which of a node's coefficients it takes: `width` from `first` on."""

    function: Callable
    first: int
    width: int


def coefficients(terms: Sequence[Any], mesh: Any) -> Own | None:
    """Coefficients of terms, see `seastar_gym.register_term`, on a mesh; None where there are none.

    ValueError in one sentence where a term's coefficients or slopes are not what they have to be.
    """
    if not terms:
        return None
    parts: dict[str, list[Function]] = {kind: [] for kind in KINDS}
    columns: list[np.ndarray] = []
    for term in terms:
        name, found = type(term).__name__, rows_of(term, mesh)
        for kind in KINDS:
            if (function := getattr(term, kind, None)) is not None:
                check_slopes(name, kind, function, tuple(row.tolist() for row in found[:, [0, -1]]), mesh)
                parts[kind].append(Function(function, len(columns), len(found)))
        columns.extend(found)
    energy, dissipation = (handed(sum_of(tuple(parts[kind]))) if parts[kind] else None for kind in KINDS)
    return Own(energy, dissipation, np.stack(columns, axis=1).ravel(), len(columns))


def rows_of(term: Any, mesh: Any) -> np.ndarray:
    """A term's coefficients as rows, shape (n, n_nodes)."""
    name, given = type(term).__name__, term.coefficients(mesh)
    rows = [np.asarray(row, dtype=float) for row in (given if isinstance(given, tuple) else (given,))]
    if not rows or any(row.shape != mesh.dl.shape or not np.isfinite(row).all() for row in rows):
        raise ValueError(
            f"{name}.coefficients must return one finite number per node, shape ({len(mesh.dl)},), or a tuple of such."
        )
    return np.array(rows)


@cache
def taken(width: int) -> Callable:
    """A kernel that reads the coefficients of a node: one number, or a tuple of them."""
    if width == 1:
        return load
    if width == 2:

        @kernel
        def pair(numbers, row):
            return load(numbers, row), load(numbers, row + 1)

        return pair
    before = taken(width - 1)
    last = width - 1

    @kernel
    def more(numbers, row):
        return before(numbers, row) + (load(numbers, row + last),)

    return more


@cache
def sum_of(parts: tuple[Function, ...]) -> Callable:
    """The sum of functions as one kernel of (numbers, row of the node's first number, x, y)."""
    head, *rest = parts
    own, read, first = compiled(head.function), taken(head.width), head.first

    if not rest:

        @kernel
        def lone(numbers, row, x, y):
            return own(read(numbers, row + first), x, y)

        return lone
    others = sum_of(tuple(rest))

    @kernel
    def both(numbers, row, x, y):
        U, (x_1, y_1), (xx, xy, yy) = own(read(numbers, row + first), x, y)
        V, (x_2, y_2), (uu, uv, vv) = others(numbers, row, x, y)
        return U + V, (x_1 + x_2, y_1 + y_2), (xx + uu, xy + uv, yy + vv)

    return both


@kernel
def add_own_slopes(rods, work, stage, node, wx, wy, slopes):
    """Add own terms of a node to (energy, gradient, Hessian) in q, see potential.py."""
    energy, (fx, fy), (xx, xy, yy) = slopes
    row = node * rods.own.width
    if rods.own.dissipation is not None:
        D, (gx, gy), (axx, axy, ayy) = rods.own.dissipation(rods.own.numbers, row, wx, wy)
        energy, fx, fy = add_product(energy, stage.gamma, D), fx + gx, fy + gy
        xx = add_product(xx, stage.inverse_gamma, axx)
        xy = add_product(xy, stage.inverse_gamma, axy)
        yy = add_product(yy, stage.inverse_gamma, ayy)
    if rods.own.energy is not None:
        x, y = load(work.q, 2 * node), load(work.q, 2 * node + 1)
        U, (gx, gy), (axx, axy, ayy) = rods.own.energy(rods.own.numbers, row, x, y)
        energy, fx, fy = energy + U, fx + gx, fy + gy
        sxx, sxy, syy = xx + axx, xy + axy, yy + ayy
        convex = (sxx > 0.0) & (sxx * syy - sxy * sxy > 0.0)
        xx, xy, yy = select(convex, sxx, xx), select(convex, sxy, xy), select(convex, syy, yy)
    return energy, (fx, fy), (xx, xy, yy)


@kernel
def own_energy(rods, q, energy):
    """Add the energy of own terms at q [J]."""
    if rods.own.energy is None:
        return energy
    for node in range(rods.n_nodes):
        own = rods.own.energy(rods.own.numbers, node * rods.own.width, load(q, 2 * node), load(q, 2 * node + 1))
        energy += own[0]
    return energy


@kernel
def own_drag(rods, node, wx, wy, fx, fy):
    """Add a node's own dissipative force against its velocity relative to the fluid to (f_x, f_y) [N]."""
    if rods.own.dissipation is None:
        return fx, fy
    gx, gy = rods.own.dissipation(rods.own.numbers, node * rods.own.width, wx, wy)[1]
    return fx + gx, fy + gy


SAMPLES = np.array([[0.7, 0.4], [-0.3, 0.9], [0.2, -0.8], [-0.6, -0.5]])
"""Places and velocities at which slopes are compared with differences, as shares of a limb's length and speed."""
MOVE, TOLERANCE = 1e-5, 1e-6
SPEED = 0.05  # m/s, a choice: robots swim at some cm/s, and parts of limbs faster

_checked: set[Any] = set()


def check_slopes(name: str, kind: str, function: Callable, numbers: tuple[list[float], ...], mesh: Any) -> None:
    """ValueError unless slopes are the slopes, by differences, and a dissipation is convex and least at rest.

    numbers: Coefficients of some nodes, one list for each.
    """
    if (key := (function, len(numbers))) in _checked:
        return
    plain: Callable = np.errstate(all="ignore")(compiled(function))  # as machine code is where it divides by zero
    size = mesh.limb_lengths[0] if kind == "energy" else SPEED
    for node in range(len(numbers[0])):
        own = [Lanes(row[node]) for row in numbers]
        c = own[0] if len(own) == 1 else tuple(own)

        def at(x: float, y: float, c: Any = c) -> np.ndarray:
            U, slopes, second = plain(c, Lanes(x), Lanes(y))
            return np.array([float(getattr(n, "numbers", n)) for n in (U, *slopes, *second)])

        try:
            rest = at(0.0, 0.0)
            _compare(name, kind, at, size, rest)
        except (TypeError, ValueError, AttributeError) as unfit:
            if type(unfit) is ValueError and name in str(unfit):
                raise
            raise ValueError(
                f"{name}.{kind} must be a function of coefficients and two numbers that returns (value, (slopes), "
                f"(second slopes xx, xy, yy)) on lanes, which it does not: {str(unfit).rstrip('.')}."
            ) from unfit
    require_compiled(f"{name}.{kind}", sum_of((Function(function, 0, len(numbers)),)))
    _checked.add(key)


def _compare(name: str, kind: str, at: Callable, size: float, rest: np.ndarray) -> None:
    if not np.isfinite(rest).all():
        raise ValueError(f"{name}.{kind} is not finite where both its numbers are zero.")
    for x, y in size * SAMPLES:
        h = MOVE * size
        here, around = at(x, y), [at(x + h, y), at(x - h, y), at(x, y + h), at(x, y - h)]
        along_x, along_y = (around[0] - around[1]) / (2 * h), (around[2] - around[3]) / (2 * h)
        wanted = np.array([along_x[0], along_y[0], along_x[1], along_x[2], along_y[2]])
        scale = np.array([abs(here[0]) / h * 1e-9 + abs(wanted[:2]).max()] * 2 + [abs(wanted[2:]).max()] * 3)
        scale[2:] += abs(here[1:3]).max() / h * 1e-9
        off = np.abs(here[1:] - wanted) > TOLERANCE * scale + 1e-300
        if not np.isfinite(here).all() or off.any() or abs(along_y[1] - here[4]) > TOLERANCE * scale[3] + 1e-300:
            which = "slopes" if off[:2].any() else "second slopes"
            raise ValueError(f"{name}.{kind} has other {which} than differences of it show: compare it term by term.")
        determinant = here[3] * here[5] - here[4] ** 2
        is_convex = here[3] >= 0.0 and here[5] >= 0.0 and determinant >= -1e-9 * scale[2] ** 2
        if kind == "dissipation" and not (is_convex and here[0] >= rest[0]):
            raise ValueError(f"{name}.dissipation must be convex and least at rest, or the force gives energy.")
