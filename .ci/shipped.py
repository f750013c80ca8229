"""Asserts that a wheel with machine code compiles nothing, for one robot and a batch: all registered ids, or some.

python -I .ci/shipped.py [ID ...]
"""

import os
import sys
import tempfile
from pathlib import Path

with tempfile.TemporaryDirectory() as folder:
    os.environ["NUMBA_CACHE_DIR"] = folder
    import gymnasium as gym

    from seastar_gym.lanes.registers import N_LANES

    for id in sys.argv[1:] or sorted(each for each in gym.registry if each.startswith("Seastar")):
        for env in (gym.make(id), gym.make_vec(id, N_LANES, vectorization_mode="vector_entry_point")):
            env.reset(seed=0)
            env.step(env.action_space.sample())
            env.close()
    compiled = [each.name for each in Path(folder).rglob("*.nbc")]
assert not compiled, f"{compiled} had to be compiled: build with the numba of constraints.txt, see pyproject.toml."
print("Nothing was compiled.")
