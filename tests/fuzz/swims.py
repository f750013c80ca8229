"""Environments alone and in a batch, with options that are drawn."""

from random import Random
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from episodes import assert_same_steps, both
from seastar_gym import DomainRandomization, Limited, Scene, SmaLimb, SmaPulse, SmaWires, ThermalSma, Uniform


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


def check_environment(seed: int) -> None:
    """The batch, with resets of some, does what its robots do alone; observations are in their space."""
    rng = Random(seed)
    arguments = draw_arguments(rng)
    envs = both("SeastarSwim-v0", 3, AutoresetMode.DISABLED, threads=rng.choice([1, 2]), **arguments)
    assert_same_steps(*(env.reset(seed=seed) for env in envs))
    envs[0].action_space.seed(seed)
    for _ in range(4):
        actions = envs[0].action_space.sample()
        found, expected = (env.step(actions) for env in envs)
        assert_same_steps(found, expected)
        assert found[0] in envs[0].observation_space and np.isfinite(found[0]).all()
        mask = found[2] | found[3] | np.array([rng.random() < 0.3 for _ in range(3)])
        if mask.any():
            assert_same_steps(*(env.reset(options={"reset_mask": mask.copy()}) for env in envs))
