"""Learned policies without Python: one file of C99, which allocates nothing, or a graph of ONNX.

    seastar export learned --to c --out policy.c

Both are made of tables of what a policy does around its network. The tables follow from `Symmetry` itself, applied to
unit vectors, so that an exported policy knows no other rules.

| input of ONNX | shape | what it is |
|---|---|---|
| `observation` | (n, size), float32 | observations of the environment, see `layout.py` |
| `past` | (n, past, size), float32 | those before, latest first; of policies with memory |

| output | shape | what it is |
|---|---|---|
| `action` | (n,) or (n, n_limbs), int64 | the most probable actions of the environment |
| `commands` | (n, n_limbs), float32 | what they mean, -1, 0 or 1 for every limb |
| `logits` | (n, distributions, choices), float32 | of the network, whose waypoint is in sector 0 |
| `later` | (n, past, size), float32 | `past` for the next decision |

At the beginning of an episode, `past` is the present observation again and again. A robot whose observation or past
has a number that is NaN, infinite or beyond 1e30 rests: its actions and commands are 0.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import LARGEST_SEEN
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.commands import LIMB_COMMANDS, command_table
from seastar_gym.envs.group import axis_of, n_turns_of
from seastar_gym.envs.layout import N_STATIONS, SIZES, VELOCITY_SCALE
from seastar_gym.envs.stations import at_stations, weights
from seastar_gym.envs.symmetry import BOUNDARY_WIDTH
from seastar_gym.files import require_extra
from seastar_gym.scene.checks import require_count, require_kind
from seastar_gym.version import __version__

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]


class Sectors(NamedTuple):
    """Sectors of the current waypoint. n: Number of sectors. width: Of each [rad]. axis: Where they begin [rad].

    per_sector: Elements from one sector to the next. n_elements: Number of elements.
    """

    n: int
    width: float
    axis: float
    per_sector: int
    n_elements: int


def sectors_of(description: Description) -> Sectors:
    """Sectors of a policy; one of all directions for a policy without symmetry."""
    reduction = description.reduction
    if reduction is None:
        return Sectors(1, 2.0 * np.pi, 0.0, 1, 1)
    axis, n_turns = axis_of(reduction.group), n_turns_of(reduction.group)
    per_sector = 2 if axis is None else 1
    return Sectors(2 * n_turns // per_sector, per_sector * np.pi / n_turns, axis or 0.0, per_sector, 2 * n_turns)


def carried_by(description: Description) -> NDArray[np.float32]:
    """Matrices that observations, as rows, are multiplied with, for every element, shape (n_elements, size, size)."""
    reduction, unit = description.reduction, np.eye(description.observation_size, dtype=np.float32)
    if reduction is None:
        return unit[None]
    n = sectors_of(description).n_elements
    return np.stack([reduction.carry(unit, np.full(len(unit), element)) for element in range(n)])


def told_places(description: Description) -> Integers:
    """Places of the numbers that the network sees of every past observation."""
    return np.zeros(0, np.intp) if description.frame_stack is None else description.frame_stack.features


def restored_actions(description: Description) -> tuple[Integers, Integers]:
    """Actions of the robot as it is, from those of the network, for every element.

    Returns the place of every number of an action, shape (n_elements, n_numbers), and what every choice becomes,
    shape (n_elements, n_choices).
    """
    (n_numbers, n_choices), reduction = description.distributions, description.reduction
    n = sectors_of(description).n_elements
    if reduction is None:
        return np.arange(n_numbers)[None], np.arange(n_choices)[None]
    if description.actions != "limbs":
        every = np.arange(n_choices)
        return np.zeros((n, 1), np.intp), np.stack([reduction.restore(every, np.full(n_choices, e)) for e in range(n)])
    of_one = np.eye(n_numbers, dtype=np.intp)
    every = np.repeat(np.arange(n_choices)[:, None], n_numbers, axis=1)
    places = [(reduction.restore(of_one, np.full(n_numbers, e)) != 0).argmax(axis=1) for e in range(n)]
    return np.stack(places), np.stack([reduction.restore(every, np.full(n_choices, e))[:, 0] for e in range(n)])


def command_rows(description: Description) -> Floats:
    """Commands of every choice: of all limbs, shape (n_choices, n_limbs), or with actions="limbs" of one, (3, 1)."""
    if description.actions == "limbs":
        return LIMB_COMMANDS[:, None]
    return command_table(description.actions, description.scene.robot.n_limbs)


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
    sectors, shapes = sectors_of(description), description.shapes()
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
        "TOLD": len(told_places(description)),
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
    yield from _carry(carried_by(description))
    places, actions = restored_actions(description)
    yield _table("int", "told", told_places(description))
    yield _table("int", "restored_place", places)
    yield _table("int", "restored", actions)
    yield _table("float", "commands_of", command_rows(description))


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


OPSET, IR_VERSION = 17, 8
"""Versions of ONNX's operators and of its format, of 2022, which runtimes know."""


def to_onnx(policy: LearnedPolicy, name: str) -> bytes:
    """File of a graph, checked by the package onnx. name: Of the policy."""
    require_extra("ONNX files", "export", "onnx")
    import onnx
    from onnx import TensorProto, helper

    description, graph = policy.description, Graph()
    n_limbs, size, past = policy.scene.robot.n_limbs, description.observation_size, description.past
    _shown(graph, policy)
    _network(graph, policy)
    _actions(graph, policy)
    inputs = [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["n", size])]
    of_action: list[str | int] = ["n", n_limbs] if description.actions == "limbs" else ["n"]
    outputs = [
        helper.make_tensor_value_info("action", TensorProto.INT64, of_action),
        helper.make_tensor_value_info("commands", TensorProto.FLOAT, ["n", n_limbs]),
        helper.make_tensor_value_info("logits", TensorProto.FLOAT, ["n", *description.distributions]),
    ]
    if past:
        inputs.append(helper.make_tensor_value_info("past", TensorProto.FLOAT, ["n", past, size]))
        outputs.append(helper.make_tensor_value_info("later", TensorProto.FLOAT, ["n", past, size]))
    model = helper.make_model(
        helper.make_graph(graph.nodes, name, inputs, outputs, graph.constants),
        opset_imports=[helper.make_opsetid("", OPSET)], producer_name="seastar_gym", producer_version=__version__,
    )  # fmt: skip
    model.ir_version = IR_VERSION
    about = {"actions": description.actions, "decision_period": f"{policy.decision_period:g}", "task": description.task}
    helper.set_model_props(model, {key: str(value or "waypoints") for key, value in about.items()})
    onnx.checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString())


class Graph:
    """Nodes and constants of a graph. Nodes are added in the order in which they are computed."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, array: NDArray[Any]) -> str:
        """Name of a constant."""
        from onnx import numpy_helper

        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(array), name))
        return name

    def add(self, kind: str, *inputs: str | NDArray[Any], out: str | None = None, **attributes: Any) -> str:
        """Name of the output of a node. inputs: Names of values, or arrays that are constants."""
        from onnx import helper

        names = [given if isinstance(given, str) else self.constant(given) for given in inputs]
        result = f"value_{len(self.nodes)}" if out is None else out
        self.nodes.append(helper.make_node(kind, names, [result], **attributes))
        return result


def _shown(graph: Graph, policy: LearnedPolicy) -> None:
    """Values "element", shape (n,), "known", 0 or 1, shape (n, 1), and "input" of the network, shape (n, inputs)."""
    description, axis_1 = policy.description, np.array([1])
    every = graph.add("Unsqueeze", "observation", axis_1)
    if description.past:
        every = graph.add("Concat", every, "past", axis=1)
        ends = np.array([0]), np.array([description.past])
        graph.add("Slice", every, *ends, axis_1, out="later")
    are_known = graph.add("LessOrEqual", graph.add("Abs", every), np.array(LARGEST_SEEN, np.float32))
    of_robot = graph.add("Flatten", graph.add("Cast", are_known, to=7))  # int64
    graph.add("ReduceMin", of_robot, out="known", axes=[1], keepdims=1)
    every = graph.add("Where", are_known, every, np.zeros((), np.float32))
    _element(graph, policy, graph.add("Flatten", graph.add("Slice", every, np.array([0]), np.array([1]), axis_1)))
    matrices = graph.add("Gather", carried_by(description), "element")  # (n, size, size)
    reduced = graph.add("MatMul", every, matrices)
    first = graph.add("Flatten", graph.add("Slice", reduced, np.array([0]), np.array([1]), axis_1))
    if not description.past:
        graph.add("Identity", first, out="input")
        return
    before = graph.add("Slice", reduced, np.array([1]), np.array([1 + description.past]), axis_1)
    told = graph.add("Flatten", graph.add("Gather", before, told_places(description).astype(np.int64), axis=2))
    graph.add("Concat", first, told, axis=1, out="input")


def _element(graph: Graph, policy: LearnedPolicy, observation: str) -> None:
    """Value "element", of the group that brings the current waypoint into sector 0, shape (n,).

    As `Symmetry.sectors`, but by the sides of the sectors' boundaries on which a waypoint lies, without its angle, for
    which ONNX has no operator.
    """
    sectors, size = sectors_of(policy.description), policy.description.observation_size
    waypoints = graph.add("Slice", observation, np.array([size - 4]), np.array([size]), np.array([1]))
    waypoints = graph.add("Cast", waypoints, to=11)  # double
    if sectors.n == 1:  # all directions: element 0 of every robot
        nothing = graph.add("Mul", graph.add("ReduceSum", waypoints, np.array([1]), keepdims=0), np.zeros(()))
        graph.add("Cast", nothing, out="element", to=7)  # int64
        return
    current, after = (graph.add("Slice", waypoints, np.array([k]), np.array([k + 2]), np.array([1])) for k in (0, 2))
    at_hub = graph.add("Equal", _length(graph, current), np.zeros(()))
    angles = sectors.axis + sectors.width * np.arange(sectors.n)
    first = np.array([np.cos(angles[0]), np.sin(angles[0])])
    current = graph.add("Where", at_hub, first, current)  # a waypoint at the hub lies on the first boundary
    along, across = np.stack([np.cos(angles), np.sin(angles)]), np.stack([-np.sin(angles), np.cos(angles)])
    ahead, aside = graph.add("MatMul", current, along), graph.add("MatMul", current, across)  # (n, n_sectors)
    width = graph.add("Mul", _length(graph, current), np.array(BOUNDARY_WIDTH))
    is_near = graph.add("LessOrEqual", graph.add("Abs", aside), width)
    on_boundary = graph.add("And", is_near, graph.add("Greater", ahead, np.zeros(())))
    is_left = graph.add("Greater", aside, width)
    is_right = graph.add("Less", aside, graph.add("Neg", width))
    right_of_next = graph.add("Gather", is_right, (np.arange(sectors.n) + 1) % sectors.n, axis=1)
    inside = graph.add("And", is_left, right_of_next)
    limit = graph.add("Mul", _length(graph, after), np.array(-BOUNDARY_WIDTH))
    next_is_right = graph.add("Less", graph.add("MatMul", after, across), limit)
    sector = np.arange(sectors.n)
    of_boundary = graph.add("Where", next_is_right, (sector - 1) % sectors.n, sector)
    on = graph.add("Where", on_boundary, of_boundary, np.zeros((), np.int64))
    within = graph.add("Where", inside, sector, np.zeros((), np.int64))
    found = graph.add("ReduceSum", graph.add("Add", on, within), np.array([1]), keepdims=0)
    graph.add("Mul", found, np.array(sectors.per_sector), out="element")


def _length(graph: Graph, vectors: str) -> str:
    """Lengths of vectors, shape (n, 1)."""
    return graph.add("ReduceL2", vectors, axes=[1], keepdims=1)


def _network(graph: Graph, policy: LearnedPolicy) -> None:
    """Value "logits", shape (n, distributions, choices), of "input"."""
    layers, value = len(policy.weights) // 2, "input"
    for layer in range(layers):
        weight, bias = policy.weights[f"{layer}.weight"], policy.weights[f"{layer}.bias"]
        value = graph.add("Gemm", value, weight, bias, transB=1)
        value = graph.add("Tanh", value) if layer < layers - 1 else value
    shape = np.array([-1, *policy.description.distributions])
    graph.add("Reshape", value, shape, out="logits")


def _actions(graph: Graph, policy: LearnedPolicy) -> None:
    """Values "action" and "commands", of "logits", "known" and "element"."""
    description = policy.description
    chosen = graph.add("Mul", graph.add("ArgMax", "logits", axis=2, keepdims=0), "known")  # (n, distributions)
    places, actions = restored_actions(description)
    of_element = graph.add("Gather", actions.astype(np.int64), "element")  # (n, choices)
    became = graph.add("GatherElements", of_element, chosen, axis=1)
    to_place = graph.add("Gather", places.argsort(axis=1).astype(np.int64), "element")
    numbers = graph.add("GatherElements", became, to_place, axis=1)
    commands = command_rows(description).astype(np.float32)
    if description.actions == "limbs":
        graph.add("Identity", numbers, out="action")
        graph.add("Gather", commands.ravel(), "action", out="commands")
    else:
        graph.add("Squeeze", numbers, np.array([1]), out="action")
        graph.add("Gather", commands, "action", out="commands")
