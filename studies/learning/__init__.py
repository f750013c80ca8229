"""What bounds the speed of learned policies, their ways, and what lateness costs them."""

from seastar_gym.extras import require_extra

require_extra("Trainings", "train", "safetensors", "stable_baselines3", "torch", "tyro")
