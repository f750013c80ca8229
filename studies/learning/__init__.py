"""Trainings in time, and the fastest swims that offline searches find."""

from seastar_gym.extras import require_extra

require_extra("Trainings", "train", "safetensors", "stable_baselines3", "torch", "tyro")
