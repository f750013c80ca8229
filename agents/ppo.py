"""PPO on the native batch: the training environment, the learner, and the policy that it has learned.

Hyperparameters of PPO, each with the measurement that chose it.

Progress by where a robot would come to rest: a shaped reward for decisions that are short against a stroke.

A limb's power stroke pulls the hub ahead, and its way back pushes it astern again. Where decisions are shorter than a
stroke, the progress within a decision says little about either. `CoastingProgress` measures progress by where the hub
would come to rest without further commands, which is a linear function of the observation, fitted to random swims.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, get_args

import gymnasium as gym
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.utils import LinearSchedule

from seastar_gym.adapters.stable_baselines3 import BatchVecEnv
from seastar_gym.controllers import learned
from seastar_gym.controllers.description import Description
from seastar_gym.controllers.learned import LearnedPolicy, Weights
from seastar_gym.controllers.registry import task_of
from seastar_gym.controllers.search import turned
from seastar_gym.envs.commands import Discrete, command_table
from seastar_gym.envs.layout import Layout
from seastar_gym.envs.paths import WAYPOINT_RADIUS
from seastar_gym.envs.rewards import RewardWeights
from seastar_gym.envs.stations import heading_of
from seastar_gym.envs.symmetry import VectorFrameStack, VectorSymmetryReduction, observed_mirror
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.envs.waypoints import AlongPath
from seastar_gym.envs.waypoints import Path as SwimPath
from seastar_gym.scene import Scene
from seastar_gym.scene.checks import (
    require_choice,
    require_count,
    require_finite,
    require_flag,
    require_kind,
    require_number,
    require_period,
    shown,
)
from seastar_gym.simulator import Simulator

MOST_STROKES, MOST_WEIGHTS = 2**24, 2**26
"""Strokes of a rollout of all robots, and weights of a network: with more, memory ends before the first update."""


@dataclass(frozen=True)
class Hyperparameters:
    """Hyperparameters of PPO and of its training environment.

    Scores are mean strokes on held-out random paths after 98,304 strokes of training, where policies choose from all
    243 commands (`python -m studies.learning.ablations` at commit 9cd3be4): 174.5, and 172.6 over pairs, the default.
    They are means over three seeds that differ by up to 4 strokes, so smaller differences say nothing.
    """

    actions: Discrete = "pairs"
    """Action mode. "pairs" has one distribution over the 21 commands that heat no limb or two. "joint", over all 243,
    is as good on held-out paths, but learns later, and its seeds differ by more round the pentagon. "limbs", with one
    distribution per limb, scores 197: the fastest swim alternates between two pairs of limbs, which independent limbs
    do not find."""
    symmetry: bool = True
    """Whether waypoints are turned and mirrored into one sector, so that every stroke teaches ten directions at once.
    Without it, the score is 181."""
    num_envs: int = 128
    """Number of robots side by side. With few of them, updates are frequent: 512 robots, with batches four times as
    large, score 205. Fewer than 128 would keep the simulator's lanes and threads less busy."""
    rollout: int = 16
    """Strokes of every robot between updates: three times the horizon 1/(1 - discount)."""
    batch_size: int = 512
    """Strokes in a minibatch: a quarter of a rollout."""
    epochs: int = 6
    """Passes over a rollout in an update."""
    learning_rate: float = 1e-3
    """Learning rate at the beginning. It falls linearly to zero, so that the last policy is a settled one."""
    decision_period: float | None = None
    """Time between decisions [s]. None means a stroke, of 1 s; with another, robots have wires."""
    discount: float = 0.8
    """Discount per second, or per stroke where decisions are strokes. The effect of a stroke on the swimming is over
    after a few more: 0.5 scores no worse than 0.8. 0.95 scores 181, because noise of twenty strokes hides the value of
    one."""
    gae_lambda: float = 0.9
    """Decay of the generalised advantage estimate. With so short a horizon it matters little."""
    clip_range: float = 0.2
    """Clip range of the probability ratio, with PPO's customary value."""
    entropy: float = 0.0
    """Weight of the entropy bonus. Exploration lasts long enough without it: 0.01 scores 173."""
    hidden: tuple[int, ...] = (128, 128)
    """Widths of the hidden layers, of the policy and of the value network each. 256 gains no more than a seed (172)."""
    max_episode_time: float = 400.0
    """Time limit of a training episode [s]. A random path takes about 170."""
    coasting: bool = False
    """Whether progress is measured by where the hub would come to rest, see `agents.ppo`. Worth it where decisions
    are shorter than a stroke, with a discount of 0.3: at 0.2 s, ten seeds take 77 s round the pentagon, not 83 s."""
    reward: RewardWeights = RewardWeights()
    """Weights of the reward's terms. Progress dominates: a stroke of the best gaits earns about 1, and a heated limb
    costs 0.01."""

    def __post_init__(self) -> None:
        require_choice("actions", self.actions, get_args(Discrete))
        for name in ("num_envs", "rollout", "batch_size", "epochs"):
            require_count(name, getattr(self, name), 1, 2**31)
        require_number("max_episode_time", self.max_episode_time, "s")
        require_period(self.decision_period)
        for name in ("learning_rate", "discount", "gae_lambda", "clip_range", "entropy"):
            require_finite(name, getattr(self, name), "1")
        require_flag("symmetry", self.symmetry)
        require_flag("coasting", self.coasting)
        require_kind("reward", self.reward, RewardWeights, "RewardWeights")
        strokes = int(self.num_envs) * int(self.rollout)
        if strokes > MOST_STROKES:
            raise ValueError(f"num_envs times rollout must be at most {MOST_STROKES:,}, not {strokes:,}.")
        if strokes % int(self.batch_size):
            raise ValueError(
                f"batch_size must divide the {strokes} strokes of a rollout of all robots, {self.batch_size} does not."
            )
        if not (0.0 <= self.discount < 1.0 and 0.0 <= self.gae_lambda <= 1.0):
            raise ValueError("discount must be in [0, 1) and gae_lambda in [0, 1].")
        if not (self.learning_rate > 0.0 and self.clip_range > 0.0 and self.entropy >= 0.0):
            raise ValueError("learning_rate and clip_range must be positive, entropy not negative.")
        if not isinstance(self.hidden, tuple) or not self.hidden:
            raise ValueError(f"hidden must be widths of at least 1, not {shown(self.hidden)}.")
        for width in self.hidden:
            require_count("a width in hidden", width, 1, 2**20)
        if sum(map(operator.mul, self.hidden, (*self.hidden[1:], 1_000))) > MOST_WEIGHTS:
            raise ValueError(f"hidden must be layers of {MOST_WEIGHTS:,} weights at most, not {shown(self.hidden)}.")

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of the training environment that are known here, see `SwimOptions`."""
        return {
            "actions": self.actions,
            "decision_period": self.decision_period,
            "max_episode_steps": self.max_episode_steps,
            "reward": self.reward,
        }

    @property
    def max_episode_steps(self) -> int:
        """Time limit of a training episode [decisions]."""
        return max(1, round(self.max_episode_time / self._seconds))

    @property
    def discount_per_decision(self) -> float:
        """Discount from one decision to the next."""
        return float(self.discount**self._seconds)

    @property
    def _seconds(self) -> float:
        """Time between decisions [s]."""
        return 1.0 if self.decision_period is None else self.decision_period


OWN: dict[str, dict[str, Any]] = {
    "miswired": {"discount": 0.9},
    "prey": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "fast-prey": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "station": {"discount": 0.9},
    "fail-blind": {"discount": 0.9},
    "obst-trap": {"discount": 0.95},
    "prizes": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "fast-prizes": {"discount": 0.98, "rollout": 64, "gae_lambda": 0.95},
    "sim-to-real": {"discount": 0.3, "gae_lambda": 0.95},
}
"""Hyperparameters that differ from the project's, by task: prey and prizes are met after many seconds."""


def hyperparameters(task: str, decision_period: float) -> Hyperparameters:
    """Those of the project, with the horizon of the task."""
    return replace(Hyperparameters(), decision_period=decision_period, **OWN[task])


Floats = NDArray[np.floating[Any]]

ROBOTS, DECISIONS = 512, 24
"""Size of the swims that the function is fitted to: robots, and decisions of each."""
SECONDS = 1.2
"""Time in which a robot comes to rest [s]."""
RIDGE = 1e-6
"""Weight of the squared coefficients in the fit, relative to the mean square of the scaled features."""


def coasted(coefficients: Floats, observations: Floats) -> Floats:
    """Displacements of the hub until rest, in the body frame [limb lengths], shape (n, 2), as `fit_coasting` fits them.

    observations: Shape (n, size); a linear function of what they show of the robot, before the waypoints.
    """
    robot = observations[:, : len(coefficients) - 1]
    return np.asarray(robot @ coefficients[:-1] + coefficients[-1])


def fit_coasting(scene: Scene, decision_period: float | None, rng: np.random.Generator) -> Floats:
    """Coefficients of `coasted`, shape (k + 1, 2), the constant last, by random swims of pairs of limbs with rests.

    decision_period: Time between decisions [s]. None means a stroke.
    """
    env = SeastarSwimVectorEnv(ROBOTS, actions="pairs", scene=scene, decision_period=decision_period)
    env.reset(seed=0)
    twins, layout = Simulator(scene, ROBOTS), Layout.of(scene)
    n_commands = len(command_table("pairs", scene.robot.n_limbs))
    seen, ways = [], []
    for _ in range(DECISIONS):
        observations, *_ = env.step(rng.integers(n_commands, size=ROBOTS) * (rng.random(ROBOTS) < 0.5))
        simulator = env.simulator
        twins.set_state(simulator.get_state())
        twins.advance(SECONDS)
        heading = heading_of(simulator)
        seen.append(observations[:, : layout.waypoints.start].astype(np.float64))
        ways.append(turned(twins.hub_position() - simulator.hub_position(), -heading) / scene.robot.limb_length)
    env.close()
    return _ridge(np.concatenate(seen), np.concatenate(ways))


def _ridge(x: Floats, y: Floats) -> Floats:
    """Coefficients, shape (k + 1, m), of the linear function with a constant of x, (n, k), that comes closest to y."""
    x = np.append(x, np.ones((len(x), 1)), axis=1)
    scale = np.sqrt(np.mean(x**2, axis=0))
    scale[scale == 0.0] = 1.0
    scaled = x / scale
    normal = scaled.T @ scaled / len(x) + RIDGE * np.eye(x.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ y / len(x)) / scale[:, None])


class CoastingProgress(gym.vector.VectorWrapper):
    """Batch in autoreset mode SAME_STEP whose reward for progress counts the way that the hub would coast.

    The step that ends an episode has the environment's own reward, so that a swim through the last waypoint is not
    charged for the way that it does not go on.

    coasting: Coefficients that `fit_coasting` gives. weights: Those of the environment's reward, whose waypoints have
    the radius WAYPOINT_RADIUS.
    """

    env: Any

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], coasting: Floats, weights: RewardWeights):
        super().__init__(env)
        self.coasting, self.weights = coasting, weights
        self._gain: Floats = np.zeros(env.num_envs)

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, info = self.env.reset(**arguments)
        self._gain = self.gain(self._true(observations))
        return observations, info

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One decision of every robot."""
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        gain = self.gain(self._true(observations))
        more = np.where(terminated | truncated, 0.0, gain - self._gain)
        self._gain = gain
        return observations, rewards + self.weights.progress * more, terminated, truncated, info

    def _true(self, observations: Floats) -> Floats:
        """What would be observed of robots that are seen as they are, see `privileged_observations`."""
        batch = self.env.unwrapped
        return observations if batch.layout == Layout.of(batch.scene) else batch.privileged_observations()

    def gain(self, observations: Floats) -> Floats:
        """Way to go that coasting would save [m], shape (n_robots,)."""
        scene = self.env.unwrapped.scene
        layout, length = Layout.of(scene), scene.robot.limb_length
        current, following = (observations[:, at] * length for at in (layout.current_waypoint, layout.next_waypoint))
        here, there = (
            self.weights.way_to_next(place, current, following, WAYPOINT_RADIUS)
            for place in (np.zeros_like(current), length * coasted(self.coasting, observations))
        )
        return np.asarray(here - there)


def make_training_env(
    hyperparameters: Hyperparameters, path: SwimPath, random_heading: bool, **options: Any
) -> BatchVecEnv:
    """Native batch for Stable-Baselines3, with symmetry reduction if the hyperparameters ask for it.

    options: Further options of the batch, see `make_training_batch`.
    """
    env = make_training_batch(hyperparameters, path, random_heading, **options)
    if hyperparameters.coasting:
        inner: Any = env.unwrapped
        coasting = fit_coasting(inner.scene, inner.decision_period, np.random.default_rng(0))
        env = CoastingProgress(env, coasting, hyperparameters.reward)
    return BatchVecEnv(VectorSymmetryReduction(env) if hyperparameters.symmetry else env)


def make_training_batch(
    hyperparameters: Hyperparameters, path: SwimPath, random_heading: bool, **options: Any
) -> gym.vector.VectorEnv[Any, Any, Any]:
    """Native batch of a training, in autoreset mode SAME_STEP.

    options: Arguments of the batch besides, such as `num_envs`, `threads` and `fidelity`, see `SeastarSwimVectorEnv`;
    those of the hyperparameters unless named.
    """
    require_kind("hyperparameters", hyperparameters, Hyperparameters, "Hyperparameters")
    arguments = {"num_envs": hyperparameters.num_envs, **hyperparameters.options, **options}
    return gym.make_vec(
        "SeastarSwim-v0",
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP,
        path=path,
        random_heading=random_heading,
        waypoint_radius=WAYPOINT_RADIUS,
        **arguments,
    )


def make_model(env: BatchVecEnv, hyperparameters: Hyperparameters, seed: int, device: str = "cpu") -> PPO:
    """New learner on an environment."""
    require_kind("env", env, BatchVecEnv, "a BatchVecEnv, as make_training_env gives it")
    require_kind("hyperparameters", hyperparameters, Hyperparameters, "Hyperparameters")
    require_count("seed", seed, 0, 2**32 - 1)
    require_device(device)
    return PPO(
        "MlpPolicy",
        env,
        n_steps=hyperparameters.rollout,
        batch_size=hyperparameters.batch_size,
        n_epochs=hyperparameters.epochs,
        learning_rate=LinearSchedule(hyperparameters.learning_rate, 0.0, 1.0),
        gamma=hyperparameters.discount_per_decision,
        gae_lambda=hyperparameters.gae_lambda,
        clip_range=hyperparameters.clip_range,
        ent_coef=hyperparameters.entropy,
        policy_kwargs={"net_arch": list(hyperparameters.hidden)},
        seed=int(seed),
        device=device,
    )


def require_device(device: str) -> None:
    """ValueError for a device that is not there; Stable-Baselines3 would quietly take the processor."""
    if not isinstance(device, str) or device not in ("cpu", "cuda", "auto"):
        raise ValueError(f"device must be 'cpu', 'cuda' or 'auto', not {shown(device)}.")
    if device == "cuda" and not torch.cuda.is_available():
        raise ValueError("There is no CUDA device that torch can use: take device cpu or auto.")


def describe(env: BatchVecEnv, hidden: tuple[int, ...]) -> Description:
    """Description of a policy with these widths of hidden layers that learns in an environment."""
    batch: Any = env.env.unwrapped
    memory = next((layer for layer in env.layers() if isinstance(layer, VectorFrameStack)), None)
    symmetry = env.env_is_wrapped(VectorSymmetryReduction)[0] if memory is None else memory.symmetric
    about = Description(batch.actions, symmetry, batch.scene, hidden, batch.decision_period)
    past = 0 if memory is None else memory.frame_stack.past
    at = batch.layout
    about = about._replace(
        past=past, entries=at.entries, shows_limbs=at.shows_limbs, stations=at.stations, sight=batch.sight,
        action_delay=batch.action_delay,
    )  # fmt: skip
    if isinstance(batch.task, AlongPath):
        return about._replace(path=batch.path if isinstance(batch.path, str) else None)
    return about._replace(task=task_of(batch), limb_mirror=observed_mirror(batch))


def policy_of(model: PPO) -> LearnedPolicy:
    """Policy that a learner on a `BatchVecEnv` has learned so far."""
    require_kind("model", model, PPO, "a PPO of Stable-Baselines3")
    env = model.get_env()
    if not isinstance(env, BatchVecEnv):
        raise ValueError(f"Only a learner on a BatchVecEnv says what its policy expects, not one on {env}.")
    description = describe(env, tuple(model.policy_kwargs["net_arch"]))
    return LearnedPolicy(description, actor(model.policy.state_dict()))


def actor(weights: Mapping[str, torch.Tensor]) -> Weights:
    """Weights of the policy in Stable-Baselines3's network, under the names of `LearnedPolicy`."""
    return learned.actor({name: tensor.detach().cpu().numpy().copy() for name, tensor in weights.items()})
