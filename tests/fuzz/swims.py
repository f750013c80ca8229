"""Swims of the chapter's robot: presets against the reference, and environments alone and in a batch."""

from functools import lru_cache
from random import Random
from typing import Any

import numpy as np

from seastar_gym import DomainRandomization, Limited, Scene, SmaLimb, SmaPulse, SmaWires, ThermalSma, Uniform
from seastar_gym.accuracy import chapters_certificate
from seastar_gym.envs.seastar_swim import SeastarSwimEnv
from seastar_gym.envs.vector import SeastarSwimVectorEnv
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator

PRESETS: tuple[Fidelity, ...] = ("fast", "balanced", "accurate", "chapter")
N_STROKES, N_ROBOTS = 10, 16


# --- presets ---------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=8)
def hub_paths(fidelity: Fidelity, seed: int) -> np.ndarray:
    """Hub positions [m] from rest by ternary commands, shape (n_strokes + 1, N_ROBOTS, 2)."""
    simulator = Simulator(Scene.preset(fidelity), N_ROBOTS)
    path = [simulator.hub_position()]
    for command in ternary_commands(seed):
        assert not simulator.stroke(command).status.any()
        path.append(simulator.hub_position())
    return np.array(path)


def path_errors(path: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Largest distance at the ends of strokes over the length of the reference's path, per robot."""
    off = np.linalg.norm(path - reference, axis=2).max(axis=0)
    return off / np.linalg.norm(np.diff(reference, axis=0), axis=2).sum(axis=0)


def ternary_commands(seed: int) -> np.ndarray:
    """Of an environment's actions, but for robots that are never heated."""
    commands = np.random.default_rng(seed).integers(-1, 2, (N_STROKES, N_ROBOTS, 5)).astype(float)
    commands[0, :, 0] = 1.0
    return commands


def check_preset(fidelity: Fidelity, seed: int) -> None:
    """A preset's path errs by no more than is promised of it, and of the reference."""
    errors = path_errors(hub_paths(fidelity, seed), hub_paths("reference", seed))
    known = [chapters_certificate().of(Scene.preset(name)) for name in (fidelity, "reference")]
    promised = sum(each.errors["random"] for each in known)
    assert errors.max() <= promised, f"{fidelity} errs by {errors.max():.4f}, promised are {promised:.4f}"


# --- environments ----------------------------------------------------------------------------------------------------

N_ENVS = 3


def draw_arguments(rng: Random) -> dict[str, Any]:
    """Of an environment whose kernels are compiled anyway."""
    randomized = rng.random() < 0.4
    limited = Limited(SmaPulse(), largest_rate=3.0)
    actuator = rng.choice([SmaPulse(), SmaPulse(0.3), limited, ThermalSma(), SmaWires(), SmaLimb()])
    names = rng.sample(["robot.youngs_modulus", "robot.density", "fluid.density"], rng.randint(1, 3))
    spread = DomainRandomization(
        {"limb_strengths": Uniform(0.3, 1.0)}
        | {name: Uniform(8e5, 2e6) if "modulus" in name else Uniform(800.0, 1200.0) for name in names}
    )
    return {
        "path": rng.choice(["pentagon", "line", "random", "figure-eight", [[0.01, 0.0], [0.02, 0.01]]]),
        "actions": rng.choice(["limbs", "joint", "pairs"]),
        "fidelity": rng.choice(["fast", "balanced"]),
        "scene": Scene(actuator=actuator),
        "waypoint_radius": rng.choice([0.001, 0.01]),
        "random_heading": rng.random() < 0.5,
        "randomization": spread if randomized else None,
    }


def check_environment(seed: int, n_steps: int = 4) -> None:
    """The batch, with resets of some, does what its robots do alone; observations are in their space, keys stay."""
    rng = Random(seed)
    arguments = draw_arguments(rng)
    batch = SeastarSwimVectorEnv(N_ENVS, autoreset_mode="Disabled", threads=rng.choice([1, 2]), **arguments)
    singles = [SeastarSwimEnv(**arguments) for _ in range(N_ENVS)]
    batch.action_space.seed(seed)
    observations, infos = batch.reset(seed=seed)
    for k, single in enumerate(singles):
        observation, info = single.reset(seed=seed + k)
        assert_same(observation, info, observations[k], infos, k)
    keys = set(info)
    for _ in range(n_steps):
        step_together(batch, singles, keys)
        begin_anew(batch, singles, rng)
    batch.close()


def step_together(batch: SeastarSwimVectorEnv, singles: list[SeastarSwimEnv], keys: set[str]) -> None:
    actions = batch.action_space.sample()
    observations, rewards, terminated, truncated, infos = batch.step(actions)
    assert observations in batch.observation_space and np.isfinite(observations).all() and not truncated.any()
    for k, single in enumerate(singles):
        observation, reward, is_over, is_cut, info = single.step(actions[k])
        assert observation in single.observation_space and set(info) == keys
        assert (reward, is_over, is_cut) == (rewards[k], terminated[k], truncated[k])
        assert_same(observation, info, observations[k], infos, k)


def begin_anew(batch: SeastarSwimVectorEnv, singles: list[SeastarSwimEnv], rng: Random) -> None:
    """Reset the robots that are done, and some others."""
    mask = batch._needs_reset | np.array([rng.random() < 0.3 for _ in singles])
    if not mask.any():
        return
    observations, infos = batch.reset(options={"reset_mask": mask})
    for k in np.flatnonzero(mask):
        observation, info = singles[k].reset()
        assert_same(observation, info, observations[k], infos, k)


def assert_same(observation: np.ndarray, info: dict[str, Any], row: np.ndarray, infos: dict[str, Any], k: int) -> None:
    np.testing.assert_array_equal(observation, row)
    for name, value in info.items():
        np.testing.assert_array_equal(infos[name][k], value, err_msg=name)
