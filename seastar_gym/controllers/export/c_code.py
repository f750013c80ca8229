"""A learned policy as one file of C99, which needs the standard library's mathematics and allocates nothing."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import LARGEST_SEEN
from seastar_gym.controllers.export import tables
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.layout import N_STATIONS, SIZES, VELOCITY_SCALE
from seastar_gym.envs.stations import at_stations, weights
from seastar_gym.envs.symmetry.symmetry import BOUNDARY_WIDTH
from seastar_gym.scene.checks import require_count, require_kind
from seastar_gym.version import __version__

CODE = Path(__file__).with_name("policy.c")
"""Code of every policy, below its own constants and tables."""
MOST_POINTS = 1000
"""Most tracked points of a limb."""
PER_LINE = 12
"""Numbers on a line of a table."""


def to_c(policy: LearnedPolicy, name: str, points_per_limb: int | None = None) -> str:
    """Text of a C file. Its functions are explained above them.

    name: Of the policy, for the first line.
    points_per_limb: Tracked points of a limb with the hub, evenly spaced. None means the nodes of the policy's scene.
    """
    require_kind("policy", policy, LearnedPolicy, "a LearnedPolicy")
    require_kind("name", name, str, "text")
    robot, n = policy.scene.robot, points_per_limb
    if robot.has_body:
        raise ValueError("A robot whose limbs begin on a body cannot be exported to C, only to ONNX.")
    if n is not None:
        require_count("points per limb", n, 2, MOST_POINTS)
    n = robot.nodes_per_limb if n is None else n
    parts = [*_head(policy, name), *_constants(policy, n), *_tables(policy, n), CODE.read_text(encoding="utf-8")]
    return "\n".join(parts)


def _head(policy: LearnedPolicy, name: str) -> Iterator[str]:
    """First lines: what this is, and what the robot is asked."""
    description = policy.description
    task = "waypoints" if description.task is None else f"the task {description.task}"
    called = " ".join(name.replace("*/", " ").split())
    yield f"/* Policy {called} for {task}, exported by seastar_gym {__version__}."
    yield ""
    yield f"   It decides every {policy.decision_period:g} s: call seastar_observe, and then seastar_act. */"
    yield ""


def _constants(policy: LearnedPolicy, points_per_limb: int) -> Iterator[str]:
    """Sizes and units."""
    description, layout = policy.description, policy.description.layout
    sectors, shapes = tables.sectors_of(description), description.shapes()
    numbers, choices = description.distributions
    wholes = {
        "LIMBS": layout.n_limbs,
        "PER_LIMB": points_per_limb - 1,
        "POINTS": 1 + layout.n_limbs * (points_per_limb - 1),
        "STATIONS": N_STATIONS,
        "SHOWS_LIMBS": int(layout.shows_limbs),
        "OF_LIMB": layout.of_limb,
        "FURTHER": sum(SIZES[entry] for entry in layout.entries),
        "SIZE": layout.size,
        "PAST": description.past,
        "TOLD": len(tables.told(description)),
        "INPUTS": description.input_size,
        "OUTPUTS": numbers * choices,
        "NUMBERS": numbers,
        "CHOICES": choices,
        "LAYERS": len(shapes) // 2,
        "WIDEST": max(shape[0] for shape in shapes.values()),
        "ELEMENTS": sectors.n_elements,
        "PER_SECTOR": sectors.per_sector,
    }
    floats = {
        "DECISION_PERIOD": policy.decision_period,
        "LIMB_LENGTH": policy.scene.robot.limb_length,
        "VELOCITY_SCALE": VELOCITY_SCALE,
        "SECTOR_WIDTH": sectors.width,
        "AXIS": sectors.axis,
        "BOUNDARY_WIDTH": BOUNDARY_WIDTH,
        "LARGEST_SEEN": LARGEST_SEEN,
    }
    yield from (f"#define SEASTAR_{name} {value}" for name, value in wholes.items())
    yield from (f"#define SEASTAR_{name} {float(value)!r}" for name, value in floats.items())
    yield ""


def _tables(policy: LearnedPolicy, points_per_limb: int) -> Iterator[str]:
    """Weights of stations and of the network, and the tables of symmetry."""
    description = policy.description
    yield _table("double", "station_weights", weights(points_per_limb, N_STATIONS + 1))
    tracked = replace(policy.scene.robot, nodes_per_limb=points_per_limb)
    yield _table("double", "rest_stations", at_stations(tracked.nodes(), tracked)[1:])
    for name, array in policy.weights.items():
        yield _table("float", f"layer_{name.replace('.', '_')}", array.ravel())
    yield "static const struct { int inputs, outputs; const float *weight, *bias; } layers[SEASTAR_LAYERS] = {"
    for layer in range(len(policy.weights) // 2):
        outputs, inputs = policy.weights[f"{layer}.weight"].shape
        yield f"    {{{inputs}, {outputs}, layer_{layer}_weight, layer_{layer}_bias}},"
    yield "};"
    yield from _carry(tables.carried(description))
    places, actions = tables.restored(description)
    yield _table("int", "told", tables.told(description))
    yield _table("int", "restored_place", places)
    yield _table("int", "restored", actions)
    yield _table("float", "commands_of", tables.commands(description))


def _carry(matrices: NDArray[np.float32]) -> Iterator[str]:
    """Matrices with at most two numbers in a column, shape (n_elements, size, size), as the terms of every column."""
    n_elements, size, _ = matrices.shape
    yield "struct term { int place; float factor; };"
    yield f"static const struct term carry[{n_elements}][{size}][2] = {{"
    for matrix in matrices:
        yield "{"
        places = np.argsort(matrix == 0.0, axis=0, kind="stable")[:2]
        factors = np.take_along_axis(matrix, places, axis=0)
        for (first, second), (a, b) in zip(places.T.tolist(), factors.T, strict=True):
            yield f"    {{{{{first}, {_literal(a)}}}, {{{second}, {_literal(b)}}}}},"
        yield "},"
    yield "};"


def _table(kind: str, name: str, array: NDArray[np.generic]) -> str:
    """Declaration of an array; an empty one has an element, since C knows no empty arrays."""
    filled = array if array.size else np.zeros(1, array.dtype)
    shape = "".join(f"[{length}]" for length in filled.shape)
    return f"static const {kind} {name}{shape} = {_initialiser(kind, filled)};"


def _initialiser(kind: str, array: NDArray[np.generic]) -> str:
    if array.ndim > 1:
        return "{\n" + ",\n".join(_initialiser(kind, row) for row in array) + "}"
    texts = [str(int(x)) if kind == "int" else _literal(x) if kind == "float" else repr(float(x)) for x in array]
    lines = [", ".join(texts[k : k + PER_LINE]) for k in range(0, len(texts), PER_LINE)]
    return "{" + ",\n ".join(lines) + "}"


def _literal(number: np.floating) -> str:
    """A float of single precision, to the last bit."""
    return f"{np.format_float_scientific(np.float32(number), unique=True, trim='0')}f"
