"""Ablations of the training, trainings in time, and the fastest swims that offline searches find."""

import sys

from seastar_gym.extras import is_command, require_extra

TRAININGS = {f"studies.learning.{name}" for name in ("ablations", "in_time")}
if is_command() and TRAININGS & set(sys.orig_argv):
    require_extra("Trainings", "train", "safetensors", "stable_baselines3", "torch")
