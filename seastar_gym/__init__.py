"""A five-limb soft robot that learns to swim: planar discrete elastic rods behind a Gymnasium environment.

Importing this package registers `SeastarSwim-v0`, the same with continuous commands, the timed environments that decide
several times a second, and the tasks of `seastar_gym.envs.tasks`. Its names are imported when somebody asks for them.
"""

from lazy_loader import attach_stub

from seastar_gym.envs import IDS as IDS
from seastar_gym.envs import TASKS as TASKS

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
