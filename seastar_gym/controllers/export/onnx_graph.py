"""A learned policy as a graph of ONNX, from observations to actions.

| input | shape | what it is |
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

from typing import Any

import numpy as np
from numpy.typing import NDArray

from seastar_gym.controllers.contract import LARGEST_SEEN
from seastar_gym.controllers.export import tables
from seastar_gym.controllers.learned import LearnedPolicy
from seastar_gym.envs.symmetry.symmetry import BOUNDARY_WIDTH
from seastar_gym.files import require_extra
from seastar_gym.version import __version__

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
    matrices = graph.add("Gather", tables.carried(description), "element")  # (n, size, size)
    reduced = graph.add("MatMul", every, matrices)
    first = graph.add("Flatten", graph.add("Slice", reduced, np.array([0]), np.array([1]), axis_1))
    if not description.past:
        graph.add("Identity", first, out="input")
        return
    before = graph.add("Slice", reduced, np.array([1]), np.array([1 + description.past]), axis_1)
    told = graph.add("Flatten", graph.add("Gather", before, tables.told(description).astype(np.int64), axis=2))
    graph.add("Concat", first, told, axis=1, out="input")


def _element(graph: Graph, policy: LearnedPolicy, observation: str) -> None:
    """Value "element", of the group that brings the current waypoint into sector 0, shape (n,).

    As `Symmetry.sectors`, but by the sides of the sectors' boundaries on which a waypoint lies, without its angle, for
    which ONNX has no operator.
    """
    sectors, size = tables.sectors_of(policy.description), policy.description.observation_size
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
    places, actions = tables.restored(description)
    of_element = graph.add("Gather", actions.astype(np.int64), "element")  # (n, choices)
    became = graph.add("GatherElements", of_element, chosen, axis=1)
    to_place = graph.add("Gather", places.argsort(axis=1).astype(np.int64), "element")
    numbers = graph.add("GatherElements", became, to_place, axis=1)
    commands = tables.commands(description).astype(np.float32)
    if description.actions == "limbs":
        graph.add("Identity", numbers, out="action")
        graph.add("Gather", commands.ravel(), "action", out="commands")
    else:
        graph.add("Squeeze", numbers, np.array([1]), out="action")
        graph.add("Gather", commands, "action", out="commands")
