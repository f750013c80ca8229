"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`, the same with continuous commands, the timed environments that decide
several times a second, and the tasks of `seastar_gym.envs.tasks`. Its names are imported when somebody asks for them.

Rooms, from what a user says to Newton's step: `envs`, `scene`, `model`, `simulator`, `rods`, `lanes`; beside them
`controllers`, `evaluation`, `accuracy`, `gradients`, `identify`, `plant`, `sweep`. docs/contributing.md has a table of
what is where.
"""

from lazy_loader import attach_stub

from seastar_gym.envs import IDS as IDS
from seastar_gym.envs import TASKS as TASKS

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
