"""Agents for SeastarSwim-v0: scripted gaits, PPO, and their evaluation."""

from seastar_gym.extras import is_command, require_extra

if is_command():  # agents.policy and the scripted gaits do without most of these, in other people's programs
    require_extra("The agents", "train", "imageio", "matplotlib", "plotly", "rich", "safetensors", "tyro")
