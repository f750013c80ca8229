"""Studies: measurements of the simulator and of learning, each run as `python -m studies.NAME` (extra `studies`)."""

from seastar_gym.extras import require_extra

require_extra("The studies", "studies", "matplotlib", "rich", "tqdm")
