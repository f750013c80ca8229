"""Ablations of the training, fidelities of the training, and the fastest swims that offline searches find."""

import sys

from seastar_gym.extras import is_command, require_extra

if is_command() and {"studies.learning.ablations", "studies.learning.fidelities"} & set(sys.orig_argv):
    require_extra("Trainings", "train", "safetensors", "stable_baselines3", "torch")
