"""Studies: measurements of the simulator, each run as `python -m seastar_gym.studies.NAME` (extra `studies`)."""

from seastar_gym.extras import require_extra

require_extra("The studies", "studies", "matplotlib", "rich", "tqdm")
