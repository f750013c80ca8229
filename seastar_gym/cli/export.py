"""Writes a learned policy as one file of C, or of ONNX, for robots and computers without Python.

The policy is a bundled one, by its name (learned, timed-0.2s, or that of a task such as prey or miswired-0.5s), or a
file: .safetensors, or a model.zip of train.py. The most probable action is taken.

C is C99 with <math.h>, without allocation. seastar_observe makes the observation from the last positions of tracked
points and the waypoints, seastar_act the commands. Points of a limb are evenly spaced; by default they are the nodes of
the policy's scene. ONNX begins with the observation, and remembers nothing: past observations are an input.
"""

import argparse
from pathlib import Path

from seastar_gym.command import command_parser, main_of
from seastar_gym.controllers import learned
from seastar_gym.controllers.export import to_c, to_onnx
from seastar_gym.controllers.learned import BUNDLED, LearnedPolicy
from seastar_gym.controllers.registry import learned_policy
from seastar_gym.envs.options import own_scene
from seastar_gym.files import write_atomically

FORMATS = ("c", "onnx")


def parser() -> argparse.ArgumentParser:
    """Parser of the options."""
    found = command_parser("seastar export", __doc__)
    found.add_argument("policy", help="name or file of a learned policy")
    found.add_argument("--to", choices=FORMATS, required=True, help="format of the file that is written")
    found.add_argument("--out", type=Path, help="file that is written (default: POLICY.c or POLICY.onnx)")
    found.add_argument("--scene", type=Path, help="Python file of a scene that registers parts of the policy's robot")
    points = "tracked points per limb with the hub, of c (default: the nodes of the policy's scene)"
    found.add_argument("--points", type=int, help=points)
    return found


def load_policy(name: str) -> LearnedPolicy:
    """Policy of a name or a file."""
    policy = learned_policy(name)
    if policy is None:
        raise ValueError(
            f"{name} is no learned policy: name a file, .safetensors or the model.zip of train.py, or one of "
            f"{', '.join(['learned', *learned.by_name()])}."
        )
    return policy


def export(options: argparse.Namespace) -> str:
    """Write the file; returns a sentence on it."""
    own_scene(options.scene)
    policy = load_policy(options.policy)
    name = Path(options.policy).name.removesuffix(BUNDLED.suffix).removesuffix(".zip")
    out = Path(f"{name}.{options.to}") if options.out is None else options.out
    if options.to == "onnx" and options.points is not None:
        raise ValueError("--points is for c: ONNX begins with the observation.")
    data = to_c(policy, name, options.points) if options.to == "c" else to_onnx(policy, name)
    write_atomically(out, data)
    return f"{out}: {len(data) / 1000:.0f} kB, {policy.description.observation_size} numbers seen."


main = main_of(parser, export)
