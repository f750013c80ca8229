"""What matters to the learning, and the best that a search finds."""

import sys

from seastar_gym.extras import is_command, require_extra

if is_command() and "studies.learning.ablations" in sys.orig_argv:
    require_extra("Trainings", "train", "safetensors", "stable_baselines3", "torch")
