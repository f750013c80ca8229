"""The ten lines of README: the bundled policy swims round the pentagon, in a window."""

import gymnasium as gym

import seastar_gym  # noqa: F401, registers the environments
from seastar_gym.controllers import pretrained

policy = pretrained("timed-0.2s")  # trained for decisions every 0.2 s; numpy runs it
env = gym.make("SeastarSwimTimedModerate-v0", actions=policy.actions, render_mode="human")
observation, info = env.reset(seed=0)
terminated = truncated = False
while not (terminated or truncated):
    action, _ = policy.predict(observation, deterministic=True)
    observation, reward, terminated, truncated, info = env.step(action)
env.close()
