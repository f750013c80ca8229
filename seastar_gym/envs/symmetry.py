"""The symmetry of the regular n-gon: what a robot of n equal limbs knows about one sector, it knows about all.

Directions in the body frame fall into 2n sectors; sector g spans the angles [g pi/n, (g + 1) pi/n]. *Element* g of the
symmetry group is the turn (g even) or the turn and mirror (g odd) that brings sector g onto sector 0:

    element 2k:      turn by -2 pi k/n
    element 2k - 1:  turn by -2 pi k/n, then mirror at the x axis (y -> -y), for k = 1..n

It carries a robot with its waypoints onto another robot, whose limb j was limb `limb_order(n)[g, j]`; a mirror swaps
the commands + and -. A controller that sees only waypoints in sector 0 and whose actions are carried back is
equivariant: in a turned or mirrored world it swims the turned or mirrored way.

Functions here take batches: observations of shape (..., size), as laid out in observation.py, and elements (...).
"""

from collections.abc import Iterable, Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, as_array, command_table
from seastar_gym.envs.observation import layout_of_size
from seastar_gym.envs.randomization import LIMB_STRENGTHS, DomainRandomization
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene import Scene
from seastar_gym.scene.actuators.actuator import StatefulActuator
from seastar_gym.scene.checks import shown

Elements = NDArray[np.intp]

BOUNDARY_WIDTH = 1e-6
"""[rad]: a waypoint this close to a boundary between two sectors lies on it. Far above the rounding of observations, so
that rounding never chooses the sector of a robot that is aimed along a limb; the next waypoint's side does."""


# --- the group -------------------------------------------------------------------------------------------------------


def _is_mirror(elements: ArrayLike) -> NDArray[np.bool_]:
    return np.asarray(elements) % 2 == 1


def inverse(elements: ArrayLike, n_limbs: int) -> Elements:
    """The elements that undo these; a mirror undoes itself."""
    elements = np.asarray(elements)
    return np.where(_is_mirror(elements), elements, -elements % (2 * n_limbs))


def compose(second: ArrayLike, first: ArrayLike, n_limbs: int) -> Elements:
    """The elements that do what `first` and then `second` do."""
    second, first = np.asarray(second), np.asarray(first)
    k_first, k_second = (first + 1) // 2, (second + 1) // 2
    k = k_first + np.where(_is_mirror(first), -k_second, k_second)
    return (2 * k - (first + second) % 2) % (2 * n_limbs)


@cache
def turns(n_limbs: int) -> NDArray[np.complex128]:
    """exp(-2 pi i k/n) of every element, shape (2 n_limbs,): what it multiplies a vector x + iy by; exactly 1 for 0."""
    k = (np.arange(2 * n_limbs) + 1) // 2 % n_limbs
    return _read_only(np.exp(-2j * np.pi / n_limbs * k))


@cache
def limb_order(n_limbs: int) -> NDArray[np.intp]:
    """Limb j (counted from 0) of the robot carried by element g was limb order[g, j]; shape (2 n_limbs, n_limbs)."""
    elements, limbs = np.arange(2 * n_limbs)[:, None], np.arange(n_limbs)
    return _read_only(((elements + 1) // 2 + np.where(_is_mirror(elements), -limbs, limbs)) % n_limbs)


# --- observations ----------------------------------------------------------------------------------------------------


def sectors(observations: NDArray[np.floating[Any]], n_limbs: int) -> Elements:
    """Sector of the current waypoint, 0 .. 2 n_limbs - 1, shape (...).

    On a boundary it is the sector on the side of the next waypoint, and where that lies on the same line (or there is
    none) the sector anti-clockwise of the boundary. A waypoint at the hub lies in sector 0.
    """
    at = layout_of_size(observations.shape[-1])
    current = np.asarray(observations[..., at.current_waypoint], np.float64)
    towards_next = np.asarray(observations[..., at.next_waypoint], np.float64)
    width = np.pi / n_limbs
    angle = np.arctan2(current[..., 1], current[..., 0])
    boundary = np.rint(angle / width)  # the nearest one
    on_boundary = np.abs(angle - boundary * width) <= BOUNDARY_WIDTH
    c, s = np.cos(boundary * width), np.sin(boundary * width)
    aside = c * towards_next[..., 1] - s * towards_next[..., 0]
    next_is_right = aside < -BOUNDARY_WIDTH * np.hypot(towards_next[..., 0], towards_next[..., 1])
    sector = np.where(on_boundary, boundary - next_is_right, np.floor(angle / width))
    return sector.astype(np.intp) % (2 * n_limbs)


@cache
def _vector_order(n_limbs: int, n_vectors: int) -> NDArray[np.intp]:
    """Vector i of an observation carried by element g was vector order[g, i]; shape (2 n_limbs, n_vectors)."""
    at = layout_of_size(2 * n_vectors)
    n_nodes = at.velocities.start // 2
    nodes = np.arange(n_nodes).reshape(n_limbs, -1)[limb_order(n_limbs)].reshape(-1, n_nodes)
    others = np.tile(np.arange(at.hub_velocity.start // 2, n_vectors), (2 * n_limbs, 1))
    return _read_only(np.concatenate([nodes, n_nodes + nodes, others], axis=1))


def transform_observations(
    observations: NDArray[np.floating[Any]], elements: ArrayLike, n_limbs: int
) -> NDArray[np.floating[Any]]:
    """What the robots carried by the elements see: a fresh array of the same shape and type."""
    observations, elements = np.asarray(observations), np.asarray(elements, dtype=np.intp)
    size = observations.shape[-1]
    at = layout_of_size(size)
    if at.size != size or at.velocities.start % (2 * n_limbs) or at.velocities.start <= 0:
        raise ValueError(f"An observation of {size} numbers is not that of a robot of {n_limbs} limbs.")
    as_vectors = np.result_type(observations, np.complex64)  # pairs of numbers as x + iy
    vectors = np.ascontiguousarray(observations).view(as_vectors)
    vectors = np.take_along_axis(vectors, _vector_order(n_limbs, size // 2)[elements], axis=-1)
    vectors *= turns(n_limbs)[elements][..., None].astype(as_vectors)
    np.conjugate(vectors, out=vectors, where=_is_mirror(elements)[..., None])
    return vectors.view(observations.dtype)


def reduce_observations(
    observations: NDArray[np.floating[Any]], n_limbs: int
) -> tuple[NDArray[np.floating[Any]], Elements]:
    """Observations with the current waypoint brought into sector 0, and the elements that did it."""
    elements = sectors(observations, n_limbs)
    return transform_observations(observations, elements, n_limbs), elements


# --- actions ---------------------------------------------------------------------------------------------------------


def transform_commands(commands: NDArray[np.floating[Any]], elements: ArrayLike) -> NDArray[np.floating[Any]]:
    """Commands of the robots carried by the elements, shape (..., n_limbs)."""
    moved = _move_limbs(np.asarray(commands), np.asarray(elements, dtype=np.intp))
    return np.where(_is_mirror(elements)[..., None], -moved, moved) + 0.0  # no -0.0


def _move_limbs(values: NDArray[Any], elements: Elements) -> NDArray[Any]:
    """Values of the limbs, shape (..., n_limbs), in the order of the robots carried by the elements."""
    order = limb_order(values.shape[-1])[elements]
    shape = np.broadcast_shapes(values.shape, order.shape)
    return np.take_along_axis(np.broadcast_to(values, shape), np.broadcast_to(order, shape), axis=-1)


@cache
def action_table(actions: Actions, n_limbs: int) -> NDArray[np.intp]:
    """For "joint" and "pairs": the action that action a becomes under element g; shape (2 n_limbs, n_actions)."""
    commands = command_table(actions, n_limbs)
    number = {command.tobytes(): action for action, command in enumerate(commands + 0.0)}
    carried = transform_commands(commands, np.arange(2 * n_limbs)[:, None])
    return _read_only(np.array([[number[command.tobytes()] for command in row] for row in carried]))


_SWAPPED_LIMB_ACTIONS = np.argmax(-LIMB_COMMANDS[:, None] == LIMB_COMMANDS, axis=1)
"""The action of one limb after a mirror: + and - change places."""


def transform_actions(
    actions: NDArray[np.integer[Any]], elements: ArrayLike, mode: Actions, n_limbs: int
) -> NDArray[np.integer[Any]]:
    """Actions of the robots carried by the elements: shape (..., n_limbs) for mode "limbs", else (...)."""
    actions, elements = as_array(actions), np.asarray(elements, dtype=np.intp)
    n_choices = 3 if mode == "limbs" else action_table(mode, n_limbs).shape[1]
    _check_shape(actions, elements, mode, n_limbs)
    if actions.dtype.kind not in "iu" or (actions.size and (actions.min() < 0 or actions.max() >= n_choices)):
        raise ValueError(f'With actions="{mode}" an action is a whole number from 0 to {n_choices - 1}.')
    if mode != "limbs":
        return action_table(mode, n_limbs)[elements, actions]
    moved = _move_limbs(actions, elements)
    return np.where(_is_mirror(elements)[..., None], _SWAPPED_LIMB_ACTIONS[moved], moved)


def _check_shape(actions: NDArray[Any], elements: Elements, mode: Actions, n_limbs: int) -> None:
    """Refuse actions that are not one for every element, or one for all."""
    of_one = (n_limbs,) if mode == "limbs" else ()
    robots = actions.shape[: actions.ndim - len(of_one)]
    if actions.shape != (*robots, *of_one) or (robots != elements.shape and () not in (robots, elements.shape)):
        one = f"{n_limbs} numbers" if mode == "limbs" else "a number"
        raise ValueError(
            f'With actions="{mode}" an action is {one}, for each of {elements.size} robot(s), not an array of shape '
            f"{actions.shape}."
        )


def restore_actions(
    actions: NDArray[np.integer[Any]], elements: ArrayLike, mode: Actions, n_limbs: int
) -> NDArray[np.integer[Any]]:
    """Actions of the robots as they are, from those chosen on observations reduced by the elements."""
    return transform_actions(actions, inverse(elements, n_limbs), mode, n_limbs)


def _read_only(table: NDArray[Any]) -> NDArray[Any]:
    table.setflags(write=False)  # it is cached and shared
    return table


def require_symmetry(scene: Scene, randomization: DomainRandomization | None = None) -> None:
    """Refuse scenes, and draws of their numbers, that a turn or a mirror would change."""
    why = next(_asymmetries(scene, () if randomization is None else randomization.distributions), None)
    if why is not None:
        raise ValueError(f"This scene has not the symmetry of the regular polygon: {why}.")


def _asymmetries(scene: Scene, drawn: Iterable[str]) -> Iterator[str]:
    """Reasons why a scene, some of whose numbers are drawn, is not symmetric."""
    if not scene.robot.is_symmetric:
        yield "its limbs are not alike, straight and evenly spread"
    if len(set(scene.limb_strengths)) > 1:
        yield "its limbs are not equally strong"
    if isinstance(scene.actuator, StatefulActuator):
        yield "its actuators remember what they did, and no table says how that is carried from limb to limb"
    if any(node != 0 for node in scene.held_nodes):
        yield "nodes of limbs are held"
    if scene.loads:
        yield "its nodes are loaded"
    if scene.gravity is not None:
        yield "gravity has a direction"
    if scene.fluid is not None and scene.fluid.current is not None:
        yield "its water has a current"
    for name in drawn:
        if name == LIMB_STRENGTHS or name.startswith("robot.limbs."):
            yield f"{name} is drawn for every limb by itself"


# --- wrappers --------------------------------------------------------------------------------------------------------


if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper  # not generic in gymnasium 1.2


def _of_symmetric(env: Any) -> tuple[Actions, int]:
    """Action mode and number of limbs of an environment, or of a batch of them; ValueError if it is not symmetric."""
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, SeastarSwimEnv | SeastarSwimVectorEnv):
        raise ValueError(f"Symmetry is known of SeastarSwim-v0 alone, not of {shown(inner)}.")
    require_symmetry(inner.scene, inner.randomization)
    return inner.actions, inner.scene.robot.n_limbs


class SymmetryReduction(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """`SeastarSwim-v0` whose observations have the current waypoint in sector 0 and whose actions are carried back."""

    def __init__(self, env: gym.Env[Any, Any]):
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)
        self._mode, self._n_limbs = _of_symmetric(env)
        self._element = np.zeros((), np.intp)

    def _reduced(self, observation: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._element = reduce_observations(observation, self._n_limbs)
        return reduced

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._reduced(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """One stroke, by an action chosen on the last reduced observation."""
        action = restore_actions(action, self._element, self._mode, self._n_limbs)
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._reduced(observation), reward, terminated, truncated, info


class VectorSymmetryReduction(_VectorWrapper):
    """The same for the native batch, with `info["final_obs"]` reduced too, each by its own element."""

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        super().__init__(env)
        self._mode, self._n_limbs = _of_symmetric(env)
        self._elements = np.zeros(env.num_envs, np.intp)

    def _reduced(self, observations: NDArray[np.float32]) -> NDArray[np.floating[Any]]:
        reduced, self._elements = reduce_observations(observations, self._n_limbs)
        return reduced

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        return self._reduced(observations), info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One stroke of every robot, by actions chosen on the last reduced observations."""
        actions = restore_actions(actions, self._elements, self._mode, self._n_limbs)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        if "final_obs" in info:
            final = info["final_obs"].copy()
            for robot in np.flatnonzero(info["_final_obs"]):
                final[robot], _ = reduce_observations(final[robot], self._n_limbs)
            info = {**info, "final_obs": final}
        return self._reduced(observations), rewards, terminated, truncated, info
