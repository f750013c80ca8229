"""Training on several machines: PPO of RLlib, with the native batch in every env runner."""

from seastar_gym.extras import require_extra

require_extra("Trainings on several machines", "rllib", "ray", "tree", "torch")
