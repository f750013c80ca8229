"""Policy in the box: replaced by a trained one if that is no worse."""

import sys
from pathlib import Path

import numpy as np

from agents.policy import SHIPPED, LearnedPolicy
from agents.policy import load as load_policy
from agents.policy import save as save_policy
from agents.training.folder import resume_command
from agents.training.options import Options
from agents.trials import HELD_OUT_SEED, swim_many
from seastar_gym.envs.task import make_scene

HELD_OUT_PATHS = 64
"""Number of random paths on which a policy is compared with the one in the box; no training draws them."""


def put_in_the_box(options: Options, folder: Path) -> int:
    """Make the run's policy the one in the box, unless it is worse and not confirmed; returns the exit code."""
    policy = load_policy(folder / "policy.safetensors")
    if not options.ship_anyway and (objection := why_not(policy, options)):
        command = f"{resume_command(folder)} --ship --ship-anyway"
        print(f"The policy in the box stays: {objection}. Replace it all the same with\n    {command}", file=sys.stderr)
        return 1
    save_policy(policy, SHIPPED)
    print(f"In the box: {SHIPPED}")
    return 0


def why_not(policy: LearnedPolicy, options: Options) -> str | None:
    """Reason against replacing the policy in the box by this one, None if there is none."""
    if not SHIPPED.exists():
        return None
    try:
        box = load_policy(SHIPPED)
    except (ValueError, FileNotFoundError) as unreadable:
        return f"there is nothing to compare with, {str(unreadable).rstrip('.')}"
    if policy.decision_period != box.decision_period:
        return f"it decides every {box.decision_period:g} s, the new one every {policy.decision_period:g} s"
    ours, theirs = (held_out_strokes(one, options) for one in (policy, box))
    if ours <= theirs:
        return None
    return f"it takes {theirs:.1f} strokes on {HELD_OUT_PATHS} held-out random paths, the new one {ours:.1f}"


def held_out_strokes(policy: LearnedPolicy, options: Options) -> float:
    """Mean strokes to the last waypoint of held-out random paths; a swim that does not arrive counts as the limit."""
    scene = make_scene(None, options.fidelity)
    swims = swim_many(
        "learned", policy, "random", HELD_OUT_PATHS, scene,
        max_strokes=options.limit, seed=HELD_OUT_SEED, threads=options.num_threads,
    )  # fmt: skip
    return float(np.mean([done.strokes for done in swims]))
