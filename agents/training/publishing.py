"""Bundled policy, with its card: replaced by a trained one if that is no worse."""

import sys
from pathlib import Path

import numpy as np

from agents.cards import HELD_OUT_PATHS, write_card
from agents.training.options import Options
from agents.training.run import resume_command
from seastar_gym.controllers.learned import BUNDLED, LearnedPolicy, bundled_file
from seastar_gym.controllers.learned import load as load_policy
from seastar_gym.controllers.learned import save as save_policy
from seastar_gym.envs.options import make_scene
from seastar_gym.evaluation.swim import HELD_OUT_SEED, swim_many


def publish(options: Options, folder: Path) -> int:
    """Make the run's policy the bundled one, unless it is worse and not confirmed; returns the exit code."""
    policy = load_policy(folder / "policy.safetensors")
    if not options.publish_anyway and (objection := why_not(policy, options)):
        command = f"{resume_command(folder)} --publish --publish-anyway"
        print(f"The bundled policy stays: {objection}. Replace it all the same with\n    {command}", file=sys.stderr)
        return 1
    file = bundled_file(options.ppo.decision_period, BUNDLED)
    save_policy(policy, file)
    print(f"Bundled: {file}, with its card {write_card(file, options.num_threads).name}")
    return 0


def why_not(policy: LearnedPolicy, options: Options) -> str | None:
    """Reason against replacing the bundled policy by this one, None if there is none."""
    file = bundled_file(options.ppo.decision_period, BUNDLED)
    if not file.exists():
        return None
    try:
        box = load_policy(file)
    except (ValueError, FileNotFoundError) as unreadable:
        return f"there is nothing to compare with, {str(unreadable).rstrip('.')}"
    ours, theirs = (held_out_decisions(one, options) for one in (policy, box))
    if ours <= theirs:
        return None
    decisions = "strokes" if options.ppo.decision_period is None else "decisions"
    return f"it takes {theirs:.1f} {decisions} on {HELD_OUT_PATHS} held-out random paths, the new one {ours:.1f}"


def held_out_decisions(policy: LearnedPolicy, options: Options) -> float:
    """Mean decisions to the last waypoint of held-out random paths; a swim that does not arrive counts as the limit."""
    scene = make_scene(None, options.fidelity, options.ppo.decision_period)
    swims = swim_many(
        "learned", policy, "random", HELD_OUT_PATHS, scene, max_strokes=options.limit(scene), seed=HELD_OUT_SEED,
        threads=options.num_threads, decision_period=options.ppo.decision_period,
    )  # fmt: skip
    return float(np.mean([done.strokes for done in swims]))
