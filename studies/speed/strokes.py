"""Speed of the simulator's strokes: real-time factors, threads, and cost over resolution."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from seastar_gym.gaits import STRAIGHT
from seastar_gym.scene import Scene
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simulator import Simulator

NODES_PER_LIMB = (5, 10, 20, 40, 80, 160, 320, 640)
"""Nodes per limb on the curve of cost."""


def real_time_factors(scene: Scene, n_robots: int, threads: int, seconds: float) -> list[float]:
    """Real-time factors of a batch in the straight swim: simulated over computing time."""
    simulator, commands = Simulator(scene, n_robots, threads), np.tile(STRAIGHT, (n_robots, 1))
    return [n_robots * scene.actuator.period / d for d in repeat(lambda: simulator.stroke(commands), seconds)]


def threads_speedup(scene: Scene, n_robots: int, seconds: float) -> list[float]:
    """Ratios of the duration of a stroke on one thread to that on two threads, measured in turn."""
    commands = np.tile(STRAIGHT, (n_robots, 1))
    one, two = Simulator(scene, n_robots, threads=1), Simulator(scene, n_robots, threads=2)
    ratios = []
    for _ in range(max(5, int(seconds * 4))):
        ratios.append(repeat(lambda: one.stroke(commands), 0.0, 1)[0] / repeat(lambda: two.stroke(commands), 0.0, 1)[0])
    return ratios


def cost_over_nodes(scene: Scene, seconds: float) -> list[tuple[int, float]]:
    """Pairs (N, time per robot and Newton iteration [µs]) for N nodes per limb."""
    rows = []
    for n in NODES_PER_LIMB:
        finer = replace(scene, robot=replace(scene.robot, nodes_per_limb=n))
        simulator = Simulator(finer, N_LANES, threads=1)
        commands = np.zeros((N_LANES, 5))  # at rest, every N takes one Newton iteration per step
        duration = float(np.median(repeat(partial(simulator.stroke, commands), seconds)))
        iterations = int(simulator.stroke(commands).newton_iterations.max())
        rows.append((n, duration / N_LANES / iterations * 1e6))
    return rows


def exponent(rows: list[tuple[int, float]]) -> float:
    """Exponent of the cost over the number of nodes, 5 N - 4; rows: Pairs (N, cost)."""
    nodes, cost = np.array(rows).T
    slope: float = np.polyfit(np.log(5 * nodes - 4), np.log(cost), 1)[0]
    return slope


def iteration_seconds(scene: Scene, seconds: float) -> list[float]:
    """Durations per robot and Newton iteration [s], including everything else that a stroke does."""
    simulator = Simulator(scene, 8 * N_LANES, threads=1)
    commands = np.tile(STRAIGHT, (simulator.n_robots, 1))
    iterations = int(simulator.stroke(commands).newton_iterations.sum())
    return [d / iterations for d in repeat(lambda: simulator.stroke(commands), seconds)]


# Timing of repeated runs on this machine.


def repeat(
    run: Callable[[], object], seconds: float, at_least: int = 5, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Durations of repeated runs [s], after a first run that does not count, for about `seconds` [s]."""
    run()
    durations: list[float] = []
    while len(durations) < at_least or sum(durations) < seconds:
        start = clock()
        run()
        durations.append(clock() - start)
    return durations
