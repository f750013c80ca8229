"""Training: PPO on the native batch, imitation, and cards of the policies.

Controllers, evaluation and the adapter of Stable-Baselines3 are in the package, in `seastar_gym`.
"""

from seastar_gym.files import is_command, require_extra

if is_command():  # the learner does without most of these, in other people's programs
    require_extra("The agents", "train", "imageio", "matplotlib", "plotly", "tyro")
