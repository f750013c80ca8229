"""Compiles the simulator before it is needed: in a container's image, or for all nodes of a cluster at once.

The machine code goes into the user's cache folder, or into that which the variable NUMBA_CACHE_DIR names. Any process
of the same versions that finds it there, on a processor of the same kind, starts in a second. Scenes of the same terms
share it, whatever their numbers.
"""

import argparse
import time
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym
import numpy as np

from seastar_gym.command import command_parser, main_of
from seastar_gym.envs.options import FIDELITY_HELP, own_scene, scene_at
from seastar_gym.evaluation.rollout import make_task
from seastar_gym.rods.potential import energies
from seastar_gym.scene import Scene
from seastar_gym.scene.number import numbers_of, with_numbers
from seastar_gym.scene.numerics import Fidelity
from seastar_gym.simulator import Simulator


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar compile", __doc__)
    found.add_argument(
        "tasks", nargs="*", metavar="ID", default=["SeastarSwim-v0"],
        help="ids of registered environments (default: SeastarSwim-v0)",
    )  # fmt: skip
    found.add_argument("--scene", type=Path, help="file of the robot's scene, .py or .json (default: the task's)")
    found.add_argument("--fidelity", choices=get_args(Fidelity), help=FIDELITY_HELP)
    found.add_argument(
        "--per-robot", action="store_true",
        help="also for numbers that differ from robot to robot, as in sweeps and with randomization",
    )  # fmt: skip
    return found


def swim(env: gym.Env[Any, Any], per_robot: bool) -> None:
    """Call all compiled code of an environment and of its simulator once."""
    env.reset(seed=0)
    env.step(env.action_space.sample())
    scene: Scene = env.get_wrapper_attr("simulator").scene
    for kind in (scene, of_one_robot(scene))[: 1 + per_robot]:
        simulator = Simulator(kind, threads=1)
        simulator.stroke(np.zeros((1, scene.robot.n_limbs)))
        simulator.elastic_energy()


def of_one_robot(scene: Scene) -> Scene:
    """The scene with a number that is a robot's own."""
    name, value = next((name, value) for name, value in numbers_of(scene).items() if value is not None)
    return with_numbers(scene, {name: np.reshape(value, 1)})


def compile_all(options: argparse.Namespace) -> None:
    """Compile what the options ask for, and say where it is."""
    scene = scene_at(own_scene(options.scene), options.fidelity, "balanced")
    asked = {"scene": scene, "fidelity": options.fidelity if scene is None else None}
    arguments = {name: value for name, value in asked.items() if value is not None}
    for task in options.tasks:
        begin = time.perf_counter()
        swim(make_task(task, **arguments), options.per_robot)
        print(f"{task}: {time.perf_counter() - begin:.1f} s", flush=True)
    folder = energies.stats.cache_path
    if folder is None:
        raise ValueError("No folder keeps the machine code: set NUMBA_CACHE_DIR to one that you alone can write.")
    print(f"Machine code: {folder}")


main = main_of(parser, compile_all)
