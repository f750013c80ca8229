"""Measurements of the simulator and of learning, each run as `python -m studies.ROOM` or `python -m studies.ROOM.NAME`.

They need the extra `studies`, those of `learning` also the extra `train`.
"""

from seastar_gym.extras import require_extra

require_extra("The studies", "studies", "matplotlib", "rich", "tqdm")
