"""PPO on the native batch: its hyperparameters, its training environment, and policies on disk.

A saved policy is Stable-Baselines3's own zip file with two more entries: `policy.json` says what the policy expects
(observation layout, scene, action mode, symmetry), `random_states.npz` holds what `resume` continues from. `load` reads
only `policy.json` and the network's weights, and unpickles nothing.
"""

import io
import json
import os
import random
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import LinearSchedule, get_device

import seastar_gym
from agents.vec_env import BatchVecEnv
from seastar_gym import RewardWeights
from seastar_gym.envs.commands import Actions, action_space
from seastar_gym.envs.observation import OBSERVATION_LAYOUT, observation_size
from seastar_gym.envs.symmetry import VectorSymmetryReduction, reduce_observations, restore_actions
from seastar_gym.envs.task import Path as SwimPath
from seastar_gym.scene import Fidelity, Numerics, Scene, Seastar, SmaPulse, Water

FORMAT = 1
"""Version of what `policy.json` says."""
DESCRIPTION, WEIGHTS, RANDOM_STATES = "policy.json", "policy.pth", "random_states.npz"

Loaded = TypeVar("Loaded")


@dataclass(frozen=True)
class Hyperparameters:
    """What PPO learns with, and why. Trials: strokes round the pentagon, for which the scripted gait takes 250."""

    actions: Actions = "joint"
    """One categorical over whole commands. With one distribution per limb ("limbs") it stays at 202 strokes: the
    fastest swim alternates between two pairs of limbs, which independent limbs do not find."""
    symmetry: bool = True
    """Waypoints turned and mirrored into one sector: every stroke teaches ten directions at once. Without, it takes
    twice the strokes to learn."""
    num_envs: int = 128
    """Robots side by side. Small rollouts, so frequent updates: it learns from a third of the strokes that 512 robots
    take. Fewer still learn from yet fewer strokes, but keep the simulator's lanes and threads less busy."""
    rollout: int = 16
    """Strokes of every robot between updates: three times the horizon 1/(1 - discount)."""
    batch_size: int = 512
    """A quarter of a rollout. Half of one leaves too few gradient steps: it stayed at 194 strokes."""
    epochs: int = 6
    """Passes over a rollout: 4 are enough for the pentagon, not quite for random paths; 10 only take longer."""
    learning_rate: float = 1e-3
    """At first; it falls linearly to zero, so that the last policy is a settled one."""
    discount: float = 0.8
    """Per stroke. What a stroke does to the swimming is over after a few. 0.9 is as good on average, but less even over
    seeds (161.4 to 164.3 strokes on random paths, against 162.3 to 162.5); 0.95 stays at 182 round the pentagon."""
    gae_lambda: float = 0.9
    """Little depends on it with so short a horizon."""
    clip_range: float = 0.2
    """PPO's customary one."""
    entropy: float = 0.0
    """Weight of the entropy bonus. Exploration lasts long enough without; 0.01 costs 3 % on random paths."""
    hidden: tuple[int, ...] = (128, 128)
    """Widths of the hidden layers, of policy and value each."""
    max_episode_steps: int = 400
    """Time limit of a training episode [strokes]: a random path takes about 160."""
    reward: RewardWeights = RewardWeights()
    """Progress dominates: a stroke of the best gaits earns about 1, and a heated limb costs 0.01."""

    def __post_init__(self) -> None:
        for name in ("num_envs", "rollout", "batch_size", "epochs", "max_episode_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}.")
        if self.num_envs * self.rollout % self.batch_size:
            raise ValueError(
                f"batch_size must divide the {self.num_envs * self.rollout} strokes of a rollout of all robots, "
                f"{self.batch_size} does not."
            )
        if not (0.0 <= self.discount < 1.0 and 0.0 <= self.gae_lambda <= 1.0):
            raise ValueError("discount must be in [0, 1) and gae_lambda in [0, 1].")
        if not (self.learning_rate > 0.0 and self.clip_range > 0.0 and self.entropy >= 0.0):
            raise ValueError("learning_rate and clip_range must be positive, entropy not negative.")
        if not self.hidden or min(self.hidden) < 1:
            raise ValueError(f"hidden must be widths of at least 1, not {self.hidden}.")


def make_training_env(
    hyperparameters: Hyperparameters,
    path: SwimPath,
    random_heading: bool,
    fidelity: Fidelity | None = None,
    scene: Scene | None = None,
    threads: int | None = None,
) -> BatchVecEnv:
    """The native batch as Stable-Baselines3 wants it, with symmetry reduction if asked for."""
    env: gym.vector.VectorEnv[Any, Any, Any] = gym.make_vec(
        "SeastarSwim-v0",
        num_envs=hyperparameters.num_envs,
        vectorization_mode="vector_entry_point",
        max_episode_steps=hyperparameters.max_episode_steps,
        path=path,
        random_heading=random_heading,
        actions=hyperparameters.actions,
        fidelity=fidelity,
        scene=scene,
        reward=hyperparameters.reward,
        autoreset_mode=AutoresetMode.SAME_STEP,
        threads=threads,
    )
    return BatchVecEnv(VectorSymmetryReduction(env) if hyperparameters.symmetry else env)


def make_model(
    env: BatchVecEnv,
    hyperparameters: Hyperparameters,
    seed: int,
    device: str = "cpu",
    tensorboard_log: str | os.PathLike[str] | None = None,
) -> PPO:
    """A new learner on this environment."""
    return PPO(
        "MlpPolicy",
        env,
        n_steps=hyperparameters.rollout,
        batch_size=hyperparameters.batch_size,
        n_epochs=hyperparameters.epochs,
        learning_rate=LinearSchedule(hyperparameters.learning_rate, 0.0, 1.0),
        gamma=hyperparameters.discount,
        gae_lambda=hyperparameters.gae_lambda,
        clip_range=hyperparameters.clip_range,
        ent_coef=hyperparameters.entropy,
        policy_kwargs={"net_arch": list(hyperparameters.hidden)},
        tensorboard_log=None if tensorboard_log is None else os.fspath(tensorboard_log),
        seed=seed,
        device=device,
    )


# --- what a policy expects -------------------------------------------------------------------------------------------


class Description(NamedTuple):
    """What a saved policy expects of its environment, and its network's shape."""

    actions: Actions
    symmetry: bool
    scene: Scene
    hidden: tuple[int, ...]

    @classmethod
    def of(cls, model: PPO) -> "Description":
        """That of a learner on a `BatchVecEnv`."""
        env = model.get_env()
        if not isinstance(env, BatchVecEnv):
            raise ValueError(f"Only a learner on a BatchVecEnv says what its policy expects, not one on {env}.")
        return cls.of_environment(env, tuple(model.policy_kwargs["net_arch"]))

    @classmethod
    def of_environment(cls, env: BatchVecEnv, hidden: tuple[int, ...]) -> "Description":
        """What a policy with these hidden layers expects that learns here."""
        batch: Any = env.env.unwrapped
        return cls(batch.actions, env.env_is_wrapped(VectorSymmetryReduction)[0], batch.simulator.scene, hidden)

    def to_json(self, **more: Any) -> str:
        """As text; `more` is for people to read."""
        facts = {
            "format": FORMAT,
            "observation_layout": OBSERVATION_LAYOUT,
            **self._asdict(),
            "scene": asdict(self.scene),
            "seastar_gym": seastar_gym.__version__,
            **more,
        }
        return json.dumps(facts, indent=2)

    @classmethod
    def from_json(cls, text: str) -> "Description":
        """From `to_json`. ValueError: another format or observation layout, or a scene that is none."""
        facts = json.loads(text)
        for name, ours in (("format", FORMAT), ("observation_layout", OBSERVATION_LAYOUT)):
            if facts[name] != ours:
                raise ValueError(f"its {name} is {facts[name]!r}, this version of seastar_gym knows {ours}")
        scene = facts["scene"]
        return cls(
            actions=facts["actions"],
            symmetry=bool(facts["symmetry"]),
            scene=Scene(
                robot=Seastar(**scene["robot"]),
                fluid=None if scene["fluid"] is None else Water(**scene["fluid"]),
                actuator=SmaPulse(**scene["actuator"]),
                numerics=Numerics(**scene["numerics"]),
            ),
            hidden=tuple(facts["hidden"]),
        )


# --- saving ----------------------------------------------------------------------------------------------------------


def save(model: PPO, path: str | os.PathLike[str]) -> None:
    """Save a learner, all at once: whoever looks at `path` finds the old file or the new one, never half a file."""
    buffer = io.BytesIO()
    model.save(buffer)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.writestr(DESCRIPTION, Description.of(model).to_json(strokes_trained=model.num_timesteps))
        archive.writestr(RANDOM_STATES, _random_states())
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    part.write_bytes(buffer.getvalue())
    os.replace(part, path)


def _random_states() -> bytes:
    """The global generators of torch, numpy and Python, as an .npz file."""
    _, keys, position, has_gauss, cached_gaussian = np.random.get_state(legacy=True)  # noqa: NPY002
    version, internal, gauss_next = random.getstate()
    buffer = io.BytesIO()
    np.savez(
        buffer,
        torch=torch.get_rng_state().numpy(),
        numpy_keys=keys,
        numpy_rest=np.array([position, has_gauss, cached_gaussian]),
        python=np.array(internal, dtype=np.uint64),
        python_rest=np.array([version, np.nan if gauss_next is None else gauss_next]),
    )
    return buffer.getvalue()


def _restore_random_states(data: bytes) -> None:
    with np.load(io.BytesIO(data), allow_pickle=False) as states:
        torch.set_rng_state(torch.from_numpy(states["torch"]))
        position, has_gauss, cached_gaussian = states["numpy_rest"].tolist()
        numpy_state = ("MT19937", states["numpy_keys"], int(position), int(has_gauss), cached_gaussian)
        np.random.set_state(numpy_state)  # noqa: NPY002
        version, gauss_next = states["python_rest"].tolist()
        random.setstate((int(version), tuple(states["python"].tolist()), None if np.isnan(gauss_next) else gauss_next))


# --- loading ---------------------------------------------------------------------------------------------------------


class LearnedPolicy:
    """A trained policy in Stable-Baselines3's form: raw observations of the environment in, its actions out.

    actions: Action mode of the environment that it is for: `gym.make("SeastarSwim-v0", actions=policy.actions)`.
    scene: What was modelled when it was trained.
    """

    def __init__(self, description: Description, network: ActorCriticPolicy):
        self.actions = description.actions
        self.scene = description.scene
        self.symmetry = description.symmetry
        self._network = network

    @classmethod
    def of(cls, model: PPO) -> "LearnedPolicy":
        """What a learner on a `BatchVecEnv` has learned; it goes on learning if the learner does."""
        return cls(Description.of(model), model.policy)

    def predict(
        self,
        observation: NDArray[np.float32],
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = False,
    ) -> tuple[NDArray[Any], tuple[NDArray[Any], ...] | None]:
        """Actions for observations of shape (size,) or (n, size); there is no state."""
        observation, robot = np.asarray(observation), self.scene.robot
        size = observation_size(robot.n_nodes)
        if observation.ndim not in (1, 2) or observation.shape[-1] != size:
            raise ValueError(
                f"This policy was trained on a robot of {robot.n_limbs} limbs of {robot.nodes_per_limb} nodes: "
                f"it sees {size} numbers, not an observation of shape {observation.shape}."
            )
        if not self.symmetry:
            return self._network.predict(observation, deterministic=deterministic)[0], None
        reduced, elements = reduce_observations(observation, robot.n_limbs)
        chosen, _ = self._network.predict(reduced, deterministic=deterministic)
        return restore_actions(chosen, elements, self.actions, robot.n_limbs), None


def load(path: str | os.PathLike[str], device: str | torch.device = "cpu") -> LearnedPolicy:
    """The policy in a file that `save` wrote. FileNotFoundError or ValueError, with one sentence, if there is none."""

    device = get_device(device)

    def read(archive: zipfile.ZipFile) -> LearnedPolicy:
        description = Description.from_json(archive.read(DESCRIPTION).decode())
        network = _make_network(description).to(device)
        weights = torch.load(io.BytesIO(archive.read(WEIGHTS)), map_location=device, weights_only=True)
        network.load_state_dict(weights)
        network.set_training_mode(False)
        return LearnedPolicy(description, network)

    return _read(path, read)


def _make_network(description: Description) -> ActorCriticPolicy:
    robot = description.scene.robot
    return ActorCriticPolicy(
        spaces.Box(-np.inf, np.inf, (observation_size(robot.n_nodes),), np.float32),
        action_space(description.actions, robot.n_limbs),
        lambda _: 0.0,
        net_arch=list(description.hidden),
    )


def resume(path: str | os.PathLike[str], env: BatchVecEnv, device: str = "cpu") -> PPO:
    """The learner in a file that `save` wrote, as it was: weights, optimiser, stroke count and random states.

    The environment's episodes begin anew, with seeds that were not used before. Unpickles Stable-Baselines3's own
    data: resume only from files you trust.
    """

    def read(archive: zipfile.ZipFile) -> tuple[Description, bytes]:
        return Description.from_json(archive.read(DESCRIPTION).decode()), archive.read(RANDOM_STATES)

    description, random_states = _read(path, read)
    ours = Description.of_environment(env, description.hidden)
    if description != ours:
        raise ValueError(f"{os.fspath(path)} was trained for {description}, not for {ours}.")
    model = PPO.load(Path(path), env=env, device=device)
    assert model.seed is not None
    env.seed(model.seed + model.num_timesteps)
    _restore_random_states(random_states)
    return model


def _read(path: str | os.PathLike[str], read: Callable[[zipfile.ZipFile], Loaded]) -> Loaded:
    if not os.path.isfile(path):
        raise FileNotFoundError(f"There is no trained policy at {os.fspath(path)}.")
    try:
        with zipfile.ZipFile(path) as archive:
            return read(archive)
    except (zipfile.BadZipFile, EOFError, zlib.error, KeyError) as damaged:
        reason = str(damaged.args[0]).rstrip(".")
        raise ValueError(f"{os.fspath(path)} is damaged, or no policy saved by this project: {reason}.") from damaged
    except (ValueError, TypeError, RuntimeError) as mismatch:
        reason = " ".join(str(mismatch).split()).rstrip(".")
        raise ValueError(f"{os.fspath(path)} does not fit: {reason}.") from mismatch
