"""Symmetry of robots: one of n equal limbs swims alike in every sector of the regular n-gon.

An element of the group (group.py) carries a robot with its waypoints onto another robot, and does to the memory of
actuators what they say (`memory_mirror`). A turn leaves the turns that asked headings ask for as they are, a mirror
reverses them. Further entries of an observation are carried by what they are (`layout.py`). A controller that sees only
waypoints in sector 0 and whose actions are carried back is equivariant: in a turned or mirrored world it swims the
turned or mirrored way.

Robots with less symmetry have less to turn and to mirror: four limbs at a rectangle have a mirror and half a turn.
`symmetry_of` finds from limbs, body and attachments what there is.

A `Symmetry` knows the group, the layout and the actions of a robot; a `FrameStack` is the same with its past. Methods
take batches: observations of shape (..., size), and elements of shape (...). Wrappers reduce environments to one
sector, or remember, for any learner.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Self, get_args

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from seastar_gym.envs.attributes import RobotsEnv
from seastar_gym.envs.commands import LIMB_COMMANDS, Actions, as_array, choices, sampling_mask
from seastar_gym.envs.group import (
    Elements,
    Group,
    action_table,
    axis_of,
    inverse,
    is_mirror,
    limb_order,
    move_limbs,
    n_limbs_of,
    n_turns_of,
    read_only,
    require_group,
    transform_commands,
    trivial_group,
    turns,
)
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.randomization import DomainRandomization
from seastar_gym.scene import Scene, checks
from seastar_gym.scene.actuators.base import Actuator, Mirror, complete, is_actuator
from seastar_gym.scene.checks import is_whole_number, require_choice, require_count, require_flag, require_kind, shown
from seastar_gym.scene.shape import SAME, PointGroup

if TYPE_CHECKING:
    _VectorWrapper = gym.vector.VectorWrapper[Any, Any, Any, Any, Any]
else:
    _VectorWrapper = gym.vector.VectorWrapper  # not generic in gymnasium 1.2


def require_mirror(mirror: object) -> None:
    """ValueError unless a mirror is a pair of index and sign for each number of a limb."""
    rows = mirror if isinstance(mirror, tuple) else (None,)
    if not all(isinstance(row, tuple) and len(row) == 2 and _is_row(row[0], row[1], len(rows)) for row in rows):
        raise ValueError(f"mirror must be a tuple of pairs, an index and a sign, not {shown(mirror)}.")


def _is_row(index: object, sign: object, n: int) -> bool:
    """Whether a row of the mirror of n numbers is an index and a sign."""
    are_whole = is_whole_number(index) and is_whole_number(sign)
    return are_whole and 0 <= index < n and sign in (-1, 1)  # type: ignore[operator]


def symmetry_of(scene: Scene) -> Group:
    """Turns and mirrors that leave the robot of a scene unchanged: all of its polygon, or those that there are.

    Robots of the chapter's discretisation have all or none.
    """
    require_kind("scene", scene, Scene, "a Scene")
    robot = scene.robot
    group = robot.point_group(_feels_directions(scene))
    if group.is_whole:
        return robot.n_limbs
    return trivial_group(robot.n_limbs) if robot.discretisation == "chapter" else group


def _feels_directions(scene: Scene) -> bool:
    """Whether fluid that moves along with a body is that of an ellipse along its axes."""
    body, fluid = scene.robot.body, scene.fluid
    if body is None or fluid is None or fluid.added_mass_coefficient is None:
        return False
    along, across = body.shape.widths
    return abs(along - across) > SAME


def memory_mirror(actuator: Actuator) -> Mirror:
    """What a mirror does to the numbers that are observed of a limb's actuator; empty without memory."""
    if not is_actuator(actuator):
        raise ValueError(f"actuator must be an actuator, such as SmaWires, not {shown(actuator)}.")
    known = complete(actuator)
    return (known.mirror or ())[: known.observe(known.rest).shape[-1]]


Floating = NDArray[np.floating[Any]]

BOUNDARY_WIDTH = 1e-6
"""Angle [rad] from a boundary between two sectors within which a waypoint lies on it. It is far above the rounding of
observations: not rounding, but the next waypoint chooses the sector of a robot that is aimed along a limb."""
MOST_PAST = 1000
"""Largest number of past observations that can be remembered."""

_SWAPPED_LIMB_ACTIONS = np.argmax(-LIMB_COMMANDS[:, None] == LIMB_COMMANDS, axis=1)
"""Action of a limb after a mirror, by its action before: + and - change places."""
_SWAPPED_WIRES = {"limbs": [0, 2, 1], "continuous": [1, 0]}
"""Order of a limb's numbers in a mask after a mirror: + and - change places."""


@dataclass(frozen=True)
class Symmetry:
    """What turns and mirrors of a robot do to its observations, to its actions and to their masks.

    group: Turns and mirrors that there are. mirror: What a mirror does to the numbers of a limb, see `memory_mirror`;
    () if there are none. layout: Of the observations. actions: Action mode.
    """

    group: Group
    mirror: Mirror
    layout: Layout
    actions: Actions = "limbs"

    def __post_init__(self) -> None:
        require_group(self.group)
        require_mirror(self.mirror)
        require_kind("layout", self.layout, Layout, "a Layout")
        require_choice("actions", self.actions, get_args(Actions))
        n_limbs, of_limb = n_limbs_of(self.group), len(self.mirror)
        if (n_limbs, of_limb) != (self.layout.n_limbs, self.layout.of_limb):
            raise ValueError(
                f"A group of {n_limbs} limbs and a mirror of {of_limb} numbers each do not fit a layout of "
                f"{self.layout.n_limbs} limbs and {self.layout.of_limb} numbers."
            )

    @classmethod
    def of(cls, scene: Scene, actions: Actions = "limbs") -> Symmetry:
        """Symmetry of the robot of a scene that swims along waypoints."""
        mirror = memory_mirror(scene.actuator)
        return cls(symmetry_of(scene), mirror, Layout(scene.robot.n_limbs, len(mirror)), actions)

    @classmethod
    def none_of(cls, layout: Layout, actions: Actions = "limbs") -> Symmetry:
        """That of a robot without any: observations and actions stay as they are."""
        return cls(trivial_group(layout.n_limbs), tuple((k, 1) for k in range(layout.of_limb)), layout, actions)

    def sectors(self, observations: Floating) -> Elements:
        """Sectors of the current waypoints, 0 to 2 n_turns - 1, shape (...), in observations of shape (..., size).

        They begin at the mirror's line. A group of turns alone has even ones only, twice as wide, from the x axis on.

        A waypoint on a boundary belongs to the sector on the side of the next waypoint, and where that lies on the same
        line (or there is none) to the sector anti-clockwise of the boundary. A waypoint at the hub lies in sector 0.
        """
        self._require_fit(observations)
        waypoints = np.asarray(observations[..., self.layout.waypoints], np.float64)
        current, towards_next = waypoints[..., :2], waypoints[..., 2:]
        axis, n_turns = axis_of(self.group), n_turns_of(self.group)
        per_sector = 2 if axis is None else 1
        width = per_sector * np.pi / n_turns
        current, towards_next = _from_axis(current, axis), _from_axis(towards_next, axis)
        angle = np.arctan2(current[..., 1], current[..., 0])
        boundary = np.rint(angle / width)  # the nearest one
        on_boundary = np.abs(angle - boundary * width) <= BOUNDARY_WIDTH
        c, s = np.cos(boundary * width), np.sin(boundary * width)
        aside = c * towards_next[..., 1] - s * towards_next[..., 0]
        next_is_right = aside < -BOUNDARY_WIDTH * np.hypot(towards_next[..., 0], towards_next[..., 1])
        sector = np.where(on_boundary, boundary - next_is_right, np.floor(angle / width))
        return per_sector * sector.astype(np.intp) % (2 * n_turns)

    def _require_fit(self, observations: Floating) -> None:
        """ValueError for observations, shape (..., size), of another robot."""
        size, n_limbs = observations.shape[-1], self.layout.n_limbs
        if size != self.layout.size:
            raise ValueError(f"An observation of {size} numbers is not that of a robot of {n_limbs} limbs.")

    def carry(self, observations: Floating, elements: ArrayLike) -> Floating:
        """Observations of the robots carried by the elements: a fresh array of the same shape and type."""
        observations, elements = np.asarray(observations), np.asarray(elements, dtype=np.intp)
        self._require_fit(observations)
        at, order = self.layout, _vector_order(self.group, self.layout.shows_limbs, self.layout.stations)
        if not self.mirror and not at.entries:
            return self._carry_vectors(observations, elements, order)
        hub = at.stations_and_hub.stop
        vectors = np.concatenate([observations[..., at.stations_and_hub], observations[..., at.waypoints]], axis=-1)
        vectors = self._carry_vectors(vectors, elements, order)
        of_limbs = self._carry_limbs(observations[..., at.actuators], elements)
        further = self._carry_further(observations[..., at.further], elements)
        return np.concatenate([vectors[..., :hub], of_limbs, further, vectors[..., hub:]], axis=-1)

    def _carry_further(self, numbers: Floating, elements: Elements) -> Floating:
        """Further entries, shape (..., k)."""
        carried = numbers.copy()
        pseudoscalars, at = self.layout.begins("pseudoscalar"), self.layout.begins("vector")
        carried[..., pseudoscalars] *= np.where(is_mirror(elements)[..., None], -1, 1).astype(numbers.dtype)
        if len(at):
            pairs = np.stack([numbers[..., at], numbers[..., at + 1]], axis=-1).reshape(*numbers.shape[:-1], -1)
            unmoved = np.tile(np.arange(len(at)), (2 * n_turns_of(self.group), 1))
            pairs = self._carry_vectors(pairs, elements, unmoved)
            carried[..., at], carried[..., at + 1] = pairs[..., ::2], pairs[..., 1::2]
        return carried

    def _carry_limbs(self, numbers: Floating, elements: Elements) -> Floating:
        """Numbers of the limbs, shape (..., n_limbs len(mirror)), moved with them and mirrored where the robots are."""
        if not self.mirror:
            return numbers
        of_limbs = numbers.reshape(*numbers.shape[:-1], n_limbs_of(self.group), len(self.mirror))
        of_limbs = np.take_along_axis(of_limbs, limb_order(self.group)[elements][..., None], axis=-2)
        index, sign = np.array(self.mirror, dtype=int).T
        swapped = of_limbs[..., index] * sign.astype(numbers.dtype)
        return np.where(is_mirror(elements)[..., None, None], swapped, of_limbs).reshape(numbers.shape)

    def _carry_vectors(self, numbers: Floating, elements: Elements, order: NDArray[np.intp]) -> Floating:
        """Pairs of numbers, turned, mirrored and moved with their limbs by an `order` like that of `_vector_order`."""
        as_vectors = np.result_type(numbers, np.complex64)  # pairs of numbers as x + iy
        vectors = np.ascontiguousarray(numbers).view(as_vectors)
        vectors = np.take_along_axis(vectors, order[elements], axis=-1)
        vectors *= turns(self.group)[elements][..., None].astype(as_vectors)
        np.conjugate(vectors, out=vectors, where=is_mirror(elements)[..., None])
        axis = axis_of(self.group)
        if axis:
            vectors *= np.where(is_mirror(elements), np.exp(2j * axis), 1.0)[..., None].astype(as_vectors)
        return vectors.view(numbers.dtype)

    def reduce(self, observations: Floating) -> tuple[Floating, Elements]:
        """Observations with the current waypoint brought into sector 0, and the elements that did it."""
        observations = checks.as_array("observations", observations)
        if observations.dtype.kind != "f" or not observations.ndim:
            raise ValueError(f"Observations must be floats, of shape (..., size), not {observations.dtype} values.")
        elements = self.sectors(observations)
        return self.carry(observations, elements), elements

    def carry_actions(self, actions: NDArray[Any], elements: ArrayLike) -> NDArray[Any]:
        """Actions of the robots carried by the elements: shape (..., n_limbs) for "limbs", "continuous", or (...)."""
        actions, elements, mode = as_array(actions), np.asarray(elements, dtype=np.intp), self.actions
        self._require_shape(actions, elements)
        if mode == "continuous":
            if actions.dtype.kind not in "iuf":
                raise ValueError(f'With actions="continuous" an action is numbers, not {actions.dtype}.')
            return transform_commands(actions, elements, self.group)
        _, n_choices = choices(mode, n_limbs_of(self.group))
        if actions.dtype.kind not in "iu" or (actions.size and (actions.min() < 0 or actions.max() >= n_choices)):
            raise ValueError(f'With actions="{mode}" an action is a whole number from 0 to {n_choices - 1}.')
        if mode != "limbs":
            return action_table(mode, self.group)[elements, actions]
        moved = move_limbs(actions, elements, self.group)
        return np.where(is_mirror(elements)[..., None], _SWAPPED_LIMB_ACTIONS[moved], moved)

    def _require_shape(self, actions: NDArray[Any], elements: Elements) -> None:
        """ValueError where there is not one action for every element, or one for all."""
        n_limbs = n_limbs_of(self.group)
        of_one = (n_limbs,) if self.actions in ("limbs", "continuous") else ()
        robots = actions.shape[: actions.ndim - len(of_one)]
        if actions.shape != (*robots, *of_one) or (robots != elements.shape and () not in (robots, elements.shape)):
            one = f"{n_limbs} numbers" if of_one else "a number"
            raise ValueError(
                f'With actions="{self.actions}" an action is {one}, for each of {elements.size} robot(s), not an array '
                f"of shape {actions.shape}."
            )

    def restore(self, actions: Any, elements: ArrayLike) -> Any:
        """Actions of the robots as they are, from those chosen on observations reduced by the elements."""
        checked, n = as_array(elements), 2 * n_turns_of(self.group)
        if checked.dtype.kind not in "iu" or (checked.size and (checked.min() < 0 or checked.max() >= n)):
            raise ValueError(f"elements must be whole numbers from 0 to {n - 1}, not {shown(elements)}.")
        return self.carry_actions(actions, inverse(checked, self.group))

    def carry_masks(self, masks: NDArray[Any], elements: ArrayLike) -> NDArray[Any]:
        """Masks of actions of the robots carried by the elements, shape (..., k), as in `seastar_gym.envs.commands`."""
        masks, elements = np.asarray(masks), np.asarray(elements, dtype=np.intp)
        if self.actions not in _SWAPPED_WIRES:
            before = action_table(self.actions, self.group)[inverse(elements, self.group)]
            return np.take_along_axis(masks, before, axis=-1)
        of_limbs = np.moveaxis(masks.reshape(*masks.shape[:-1], n_limbs_of(self.group), -1), -1, 0)
        moved = np.moveaxis(np.stack([move_limbs(one, elements, self.group) for one in of_limbs]), 0, -1)
        mirrored = np.where(is_mirror(elements)[..., None, None], moved[..., _SWAPPED_WIRES[self.actions]], moved)
        return mirrored.reshape(*masks.shape)

    def carry_info(self, info: dict[str, Any], elements: Elements) -> dict[str, Any]:
        """Info with the masks of the robots carried by the elements, if it has any."""
        if "action_mask" not in info:
            return info
        return {**info, "action_mask": self.carry_masks(info["action_mask"], elements)}


def _from_axis(vectors: NDArray[np.float64], axis: float | None) -> NDArray[np.float64]:
    """Vectors, shape (..., 2), in a frame whose x axis is the mirror's line."""
    if not axis:
        return vectors
    c, s = np.cos(axis), np.sin(axis)
    return np.asarray(vectors @ np.array([[c, -s], [s, c]]))


@cache
def _vector_order(group: Group, shows_limbs: bool, stations: int) -> NDArray[np.intp]:
    """Order of vectors, shape (2 n_turns, k): vector i after element g was vector order[g, i] before."""
    n_limbs, n_turns = n_limbs_of(group), n_turns_of(group)
    at = Layout(n_limbs, shows_limbs=shows_limbs, stations=stations)
    n_places = at.velocities.start // 2
    places = np.arange(n_places).reshape(n_limbs, -1)[limb_order(group)].reshape(2 * n_turns, n_places)
    others = np.tile(np.arange(at.hub_velocity.start, at.size, 2) // 2, (2 * n_turns, 1))
    return read_only(np.concatenate([places, n_places + places, others], axis=1))


class FrameStack:
    """What a controller with memory sees: the present observation, and what was most telling of the last ones.

    The limbs of a robot are renamed from one decision to the next as the waypoint moves from sector to sector. Here all
    past observations are carried by the element of the present one, so that limbs have the same places throughout.

    Of every past observation it keeps the tips of the limbs, the hub's velocity, the numbers of the limbs (last
    commands among them) and the targets. Where a task shows no limbs, all of every past observation is kept.

    symmetry: Of the robot and what it sees. past: Number of past observations.
    """

    def __init__(self, symmetry: Symmetry, past: int = 1):
        require_kind("symmetry", symmetry, Symmetry, "a Symmetry")
        require_count("past", past, 1, MOST_PAST)
        self.symmetry, self.layout, self.past = symmetry, symmetry.layout, int(past)

    @cached_property
    def features(self) -> NDArray[np.intp]:
        """Places of the numbers that are kept of a past observation."""
        if not self.layout.shows_limbs:
            return np.arange(self.layout.size)
        return np.array([*self.layout.tips, *range(self.layout.hub_velocity.start, self.layout.size)])

    @property
    def size(self) -> int:
        """Length of what is shown."""
        return self.layout.size + self.past * len(self.features)

    def stacked(self, observations: NDArray[Any], past: NDArray[Any]) -> tuple[NDArray[np.float32], Elements]:
        """What is shown of observations, shape (n, size), and the elements that brought their targets into sector 0.

        observations: Present ones, shape (n, layout.size). past: Those before, latest first, (n, past, layout.size).
        """
        elements = self.symmetry.sectors(observations)
        every = np.concatenate([observations[:, None], past], axis=1)
        reduced = self.symmetry.carry(every, np.repeat(elements[:, None], every.shape[1], axis=1))
        n = len(observations)
        shown = np.concatenate([reduced[:, 0], reduced[:, 1:, self.features].reshape(n, -1)], axis=1)
        return shown.astype(np.float32), elements


def require_symmetry(scene: Scene, randomization: DomainRandomization | None = None) -> None:
    """ValueError for scenes, and draws of their numbers, that every turn and mirror would change.

    Drawn strengths of limbs are no reason: they have the same distribution for every limb.
    """
    why = next(_asymmetries(scene, () if randomization is None else randomization.distributions), None)
    if why is not None:
        raise ValueError(
            f"This scene has neither the symmetry of the regular polygon nor a lesser one: {why}. Train without the "
            "reduction: train.py --no-symmetry."
        )


def _asymmetries(scene: Scene, drawn: Iterable[str]) -> Iterator[str]:
    """Reasons why a scene, some of whose numbers are drawn, is not symmetric."""
    group = symmetry_of(scene)
    if isinstance(group, PointGroup) and group.is_trivial:
        yield "its limbs are not alike, straight and evenly spread" + (
            "" if scene.robot.body is None else " around a body of their symmetry"
        )
    if len(set(scene.limb_strengths)) > 1:
        yield "its limbs are not equally strong"
    if complete(scene.actuator).mirror is None:
        yield "its actuators remember what they did, and do not say what a mirror makes of it (`mirror`)"
    if any(node != 0 for node in scene.held_nodes):
        yield "nodes of limbs are held"
    if scene.loads:
        yield "its nodes are loaded"
    for term in scene.terms:
        if not getattr(term, "isotropic", False):
            yield f"its own {type(term).__name__} does not say that turns and mirrors leave it (`isotropic = True`)"
    if scene.gravity is not None:
        yield "gravity has a direction"
    if scene.fluid is not None and scene.fluid.current is not None:
        yield "its water has a current"
    for name in drawn:
        if name.startswith("robot.limbs."):
            yield f"{name} is drawn for every limb by itself"


def symmetry_in(env: Any, reduced: bool = True) -> Symmetry:
    """Symmetry of an environment or a batch; ValueError if its scene is not symmetric.

    reduced: Whether that is used. Otherwise any scene will do.
    """
    inner = getattr(env, "unwrapped", env)
    if not isinstance(inner, RobotsEnv):
        raise ValueError(f"Symmetry is known of SeastarSwim-v0 and the timed environments alone, not of {inner!r}.")
    if not reduced:
        return Symmetry.none_of(inner.layout, inner.actions)
    require_symmetry(inner.scene, inner.randomization)
    return Symmetry(symmetry_of(inner.scene), observed_mirror(inner), inner.layout, inner.actions)


OF_OBSERVATIONS: tuple[type[Any], ...] = (
    gym.ObservationWrapper, gym.wrappers.FrameStackObservation, gym.vector.VectorObservationWrapper
)  # fmt: skip
OF_ACTIONS: tuple[type[Any], ...] = gym.ActionWrapper, gym.vector.VectorActionWrapper
"""Kinds of wrappers that change observations, and actions."""
MAY_BE_SAME: tuple[type[Any], ...] = (
    gym.wrappers.DtypeObservation, gym.wrappers.FlattenObservation,
    gym.wrappers.vector.DtypeObservation, gym.wrappers.vector.FlattenObservation,
)  # fmt: skip
"""Those that change nothing but the type or the shape, if that."""


def require_plain(env: Any, who: str, kinds: tuple[type[Any], ...] = OF_OBSERVATIONS + OF_ACTIONS) -> None:
    """ValueError for a layer of an environment or a batch that changes what a wrapper needs as it is.

    who: Name of the wrapper. kinds: Of layers, besides reductions, which change both.
    """
    layer = env
    while isinstance(layer, gym.Wrapper | gym.vector.VectorWrapper):
        is_same = isinstance(layer, MAY_BE_SAME) and layer.observation_space == layer.env.observation_space
        if not is_same and isinstance(layer, (*kinds, SymmetryReduction, VectorSymmetryReduction)):
            name = type(layer).__name__
            raise ValueError(f"{name} changes what {who} needs as it is: put {name} around it.")
        layer = layer.env


def observed_mirror(env: Any) -> Mirror:
    """What a mirror does to the numbers that are observed of every limb of an environment or a batch."""
    mirror = memory_mirror(env.scene.actuator) if env.observe_actuators else ()
    return mirror + tuple((len(mirror) + index, sign) for index, sign in env.added_mirror)


def box_of(space: Any, kind: Any = gym.spaces.Box) -> Any:
    """A Box of a kind that is equal to a Box of observations, and says the same time between decisions."""
    made = kind(space.low, space.high, space.shape, space.dtype)
    made.decision_period = getattr(space, "decision_period", None)
    return made


class ReducedBox(gym.spaces.Box):
    """Space of reduced observations: a Box, equal to that of observations as they are, that says that they are reduced.

    Files of models have the space that was learned in, and so say it, too.
    """

    @classmethod
    def of(cls, space: Any) -> Self:
        """The space of observations of a space, reduced; ValueError for observations that are no arrays."""
        require_kind("The space of observations", space, gym.spaces.Box, "a Box: put other wrappers around this one")
        return box_of(space, cls)


class SymmetryReduction(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Wrapper that turns and mirrors observations so that the current waypoint lies in sector 0, and actions back.

    Masks of actions, in info and of `action_masks`, are those of the reduced robot. The observation space is a
    `ReducedBox`.
    """

    def __init__(self, env: gym.Env[Any, Any]):
        require_kind("env", env, gym.Env, "an environment of one robot")
        require_plain(env, type(self).__name__)
        gym.utils.RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)
        self._symmetry = symmetry_in(env)
        self.observation_space = ReducedBox.of(env.observation_space)
        self._element = np.zeros((), np.intp)

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on the last reduced observation that the wires can follow, shape (k,)."""
        inner: Any = self.unwrapped
        return self._symmetry.carry_masks(inner.action_masks(), self._element)

    def sampling_mask(self) -> Any:
        """`action_masks` in the form that `action_space.sample(mask=...)` takes."""
        return sampling_mask(self.action_space, self.action_masks())

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; the observation is reduced."""
        observation, info = self.env.reset(seed=seed, options=options)
        reduced, self._element = self._symmetry.reduce(observation)
        return reduced, self._symmetry.carry_info(info, self._element)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Swim for one decision by an action that was chosen on the last reduced observation."""
        action = self._symmetry.restore(action, self._element)
        observation, reward, terminated, truncated, info = self.env.step(action)
        reduced, self._element = self._symmetry.reduce(observation)
        return reduced, reward, terminated, truncated, self._symmetry.carry_info(info, self._element)


class VectorSymmetryReduction(_VectorWrapper):
    """Wrapper of the native batch that does for every robot what `SymmetryReduction` does for one.

    Observations in `info["final_obs"]` are turned and mirrored, too, each by its own element, and so are masks.
    """

    symmetric = True
    """Whether robots are turned and mirrored."""

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]):
        require_kind("env", env, gym.vector.VectorEnv, "a batch, as gym.make_vec gives it")
        if self.symmetric:
            require_plain(env, type(self).__name__)
        super().__init__(env)
        self._symmetry = symmetry_in(env, self.symmetric)
        self.single_observation_space = ReducedBox.of(env.single_observation_space)
        self._elements = np.zeros(env.num_envs, np.intp)

    @property
    def elements(self) -> NDArray[np.intp]:
        """Elements that brought the last observations into sector 0, shape (num_envs,), a copy."""
        return self._elements.copy()

    def action_masks(self) -> NDArray[np.bool_]:
        """Actions on the last reduced observations that the wires can follow, shape (num_envs, k)."""
        inner: Any = self.unwrapped
        return self._symmetry.carry_masks(inner.action_masks(), self._elements)

    def sampling_mask(self) -> tuple[Any, ...]:
        """`action_masks` in the form that `single_action_space.sample(mask=...)` takes, for every robot."""
        return tuple(sampling_mask(self.single_action_space, mask) for mask in self.action_masks())

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes; the observations are reduced."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        reduced, self._elements = self._symmetry.reduce(observations)
        return reduced, self._symmetry.carry_info(info, self._elements)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision with every robot, by actions that were chosen on the last reduced observations."""
        actions = self._symmetry.restore(actions, self._elements)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        if "final_obs" in info:
            info = {**info, **self._reduced_final(info)}
        reduced, self._elements = self._symmetry.reduce(observations)
        return reduced, rewards, terminated, truncated, self._symmetry.carry_info(info, self._elements)

    def _reduced_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """Last observations and infos of episodes that are over, of reduced robots."""
        final, elements = info["final_obs"].copy(), np.zeros(self.num_envs, np.intp)
        for robot in np.flatnonzero(info["_final_obs"]):
            final[robot], elements[robot] = self._symmetry.reduce(final[robot])
        return {"final_obs": final, "final_info": self._symmetry.carry_info(info["final_info"], elements)}


class VectorFrameStack(VectorSymmetryReduction):
    """Wrapper of a native batch that shows a `FrameStack`, and takes actions that were chosen on it.

    At the beginning of an episode, the past is the first observation. Asked headings are not shown in the past.

    past: Number of past observations. symmetry: Whether they are brought into one sector; otherwise scenes need none.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], past: int, symmetry: bool = True):
        require_flag("symmetry", symmetry)
        self.symmetric = symmetry
        super().__init__(env)
        if self._symmetry.layout.asks_headings:
            raise ValueError("Asked headings have no place in this memory: take a task without them.")
        self.frame_stack = FrameStack(self._symmetry, past)
        self._over = np.zeros(env.num_envs, bool)  # robots whose next step begins an episode
        self._begins_later = env.metadata.get("autoreset_mode") == AutoresetMode.NEXT_STEP
        self._past = np.zeros((env.num_envs, past, self.frame_stack.layout.size), np.float32)
        self.single_observation_space = gym.spaces.Box(-np.inf, np.inf, (self.frame_stack.size,), np.float32)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, env.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes, of those in `options["reset_mask"]` or of all."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]
        mask = (options or {}).get("reset_mask")
        begun = np.ones(self.num_envs, bool) if mask is None else np.asarray(mask)
        self._past[begun] = observations[begun, None]
        self._over[begun] = False
        self._latest = observations
        shown, self._elements = self.frame_stack.stacked(observations, self._past)
        return shown, self._symmetry.carry_info(info, self._elements)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Swim for one decision by actions that were chosen on what was shown last."""
        actions = self._symmetry.restore(actions, self._elements)
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        self._past = np.concatenate([self._latest[:, None], self._past[:, :-1]], axis=1)
        begun = self._over
        if self._begins_later:
            self._over = terminated | truncated
        elif "final_obs" in info:
            begun = info["_final_obs"]
            info = {**info, **self._shown_final(info)}
        self._past[begun] = observations[begun, None]
        self._latest = observations
        shown, self._elements = self.frame_stack.stacked(observations, self._past)
        return shown, rewards, terminated, truncated, self._symmetry.carry_info(info, self._elements)

    def _shown_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """Last observations with their past, and masks, of episodes that are over."""
        over, final, elements = info["_final_obs"], info["final_obs"].copy(), np.zeros(self.num_envs, np.intp)
        shown, elements[over] = self.frame_stack.stacked(np.stack(list(final[over])), self._past[over])
        for robot, last in zip(np.flatnonzero(over), shown, strict=True):
            final[robot] = last
        return {"final_obs": final, "final_info": self._symmetry.carry_info(info["final_info"], elements)}
