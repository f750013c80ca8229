"""Which robot swims fastest: 100,000 designs of limbs, and where their mass belongs."""

from seastar_gym.extras import require_extra

require_extra("The designs", "sweep", "pandas", "pyarrow")
