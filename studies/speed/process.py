"""Costs around the strokes: the vector environment, memory, and the start of a process."""

import gc
import os
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import gymnasium as gym
import numpy as np

from seastar_gym.der.stepping import stroke
from seastar_gym.envs import observation, pictures
from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.simd.dispatch import code_for
from seastar_gym.simulator import Simulator, batch


def environment_share(n_robots: int, seconds: float) -> list[float]:
    """Shares of a vector environment's step that are not the simulator's stroke, with fidelity `fast`."""
    env = gym.make_vec(
        "seastar_gym:SeastarSwim-v0", num_envs=n_robots, vectorization_mode="vector_entry_point", fidelity="fast",
        actions="joint", max_episode_steps=10**9, threads=1, path=[[10.0, 0.0]],
    )  # fmt: skip
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    shares = []
    for _ in range(max(5, int(20 * seconds))):
        actions = rng.integers(3**5, size=n_robots)
        batch = env.unwrapped
        commands = batch.command_table[actions]  # type: ignore[attr-defined]
        simulator = batch.simulator  # type: ignore[attr-defined]
        state = simulator.get_state()
        start = time.perf_counter()
        simulator.stroke(commands)
        stroke = time.perf_counter() - start
        simulator.set_state(state)
        start = time.perf_counter()
        env.step(actions)
        shares.append(1.0 - stroke / (time.perf_counter() - start))
    return shares[1:]


def step_of_one(id: str, n: int, unwrapped: bool = False) -> tuple[float, float]:
    """Processor time of a step of one environment beyond its kernels, and in them [s], means of n random steps.

    Kernels are the machine code of the strokes and of the observation, as Python calls it. unwrapped: Without
    Gymnasium's wrappers.
    """
    env: Any = gym.make(f"seastar_gym:{id}", fidelity="fast", max_episode_steps=10**9, path=[[10.0, 0.0], [10.0, 10.0]])
    env = env.unwrapped if unwrapped else env
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(n)]
    env.step(actions[0])
    in_kernels = 0.0

    def timed(kernel: Callable[..., None]) -> Callable[..., None]:
        codes: list[Callable[..., None]] = []

        def call(*arguments: Any) -> None:
            nonlocal in_kernels
            if not codes:
                codes.append(code_for(kernel, *arguments))
            start = time.thread_time()
            codes[0](*arguments)
            in_kernels += time.thread_time() - start

        return call

    advance, observe = timed(stroke.advance), timed(observation.observe)
    with patch.object(batch, "advance", advance), patch.object(pictures, "observe", observe):
        start = time.thread_time()
        for action in actions:
            env.step(action)
        whole = time.thread_time() - start
    return (whole - in_kernels) / n, in_kernels / n


def memory_per_robot(scene: Scene, n_robots: int = 512) -> tuple[float, float]:
    """Memory of a robot in a batch [KiB], and memory that a stroke leaves allocated per robot [B]."""
    commands = np.tile(STRAIGHT, (n_robots, 1))
    tracemalloc.start()
    simulator = Simulator(scene, n_robots, threads=1)
    held = tracemalloc.get_traced_memory()[0]
    simulator.stroke(commands)
    gc.collect()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(20):
        simulator.stroke(commands)
    gc.collect()
    left = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    return held / n_robots / 1024, max(0, left) / 20 / n_robots


def process_seconds(code: str, cache: str) -> float:
    """Time [s] that `code` prints in a fresh interpreter; cache: Folder of numba's cache, the user's own if empty."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    output = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    return float(output.stdout)


FIRST_SCENES = {
    "balanced": "s.Scene.preset('balanced')",
    "wires": "s.Scene(actuator=s.SmaWires()).at('balanced')",
    "all terms": "list(scenes().values())[-1]",
}
"""Scenes whose first strokes are timed, in Python."""


def first_stroke(name: str, cache: str) -> float:
    """Processor time [s] of making a simulator in a fresh interpreter, and of its first stroke."""
    return process_seconds(
        "import time, seastar_gym as s; from studies.speed.terms import scenes; "
        f"scene = {FIRST_SCENES[name]}; start = time.process_time(); "
        "s.Simulator(scene, scene.n_robots or 1).stroke([[0, 1, 0, 0, -1]] * (scene.n_robots or 1)); "
        "print(time.process_time() - start)",
        cache,
    )


IMPORT = "import time, gymnasium; start = time.process_time(); import seastar_gym; print(time.process_time() - start)"
TIMED = "import time; start = time.process_time(); {}; print(time.process_time() - start)"
FIRST_STROKE = (
    "import seastar_gym as s; "
    "s.Simulator(s.Scene(s.Seastar(nodes_per_limb=10), numerics=s.Numerics())).stroke([[0, 1, 0, 0, -1]])"
)
