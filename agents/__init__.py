"""Training: PPO on the native batch, imitation, and bundled policies.

In come options on a command line, and the package's environments and adapter of Stable-Baselines3. Out go folders of
runs, with the learner, the policy and its comparison, and bundled policies with their cards.
"""

from seastar_gym.files import is_command, require_extra

if is_command():  # the learner does without most of these, in other people's programs
    require_extra("The agents", "train", "imageio", "matplotlib", "plotly", "tyro")
