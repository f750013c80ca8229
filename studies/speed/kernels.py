"""Compiled loops that are timed: fused products alone, whose rate is the peak, and parts of a Newton iteration."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np

from seastar_gym.der.potential import assemble_hub, solve_hub, sweep_limb
from seastar_gym.der.stepping.newton import take_step
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Scene
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, add_product, any_lane, borrow, load, splat, store
from seastar_gym.simulator import Simulator
from studies.speed.strokes import repeat


@entry_point
def fused_products(values, n):
    """Compute n fused products in each of eight independent chains; values: Start and factors, shape (18, N_LANES)."""
    rows = borrow(values)
    c, d = load(rows, 16), load(rows, 17)
    x0, x1, x2, x3 = load(rows, 0), load(rows, 1), load(rows, 2), load(rows, 3)
    x4, x5, x6, x7 = load(rows, 4), load(rows, 5), load(rows, 6), load(rows, 7)
    for _ in range(n):
        x0, x1, x2, x3 = add_product(c, x0, d), add_product(c, x1, d), add_product(c, x2, d), add_product(c, x3, d)
        x4, x5, x6, x7 = add_product(c, x4, d), add_product(c, x5, d), add_product(c, x6, d), add_product(c, x7, d)
    store(rows, 0, x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7)


def peak_gigaflops(seconds: float) -> list[float]:
    """Rates of one core on fused products alone [Gflop/s]."""
    values = np.full((18, N_LANES), 0.5)
    n = 200_000
    return [8 * 2 * N_LANES * n / d / 1e9 for d in repeat(lambda: fused_products(values, n), seconds)]


def peak_speedup(seconds: float) -> list[float]:
    """Speedups of fused products alone by a second core, measured in turn: an upper bound for batches."""
    chains, n = [np.full((18, N_LANES), 0.5) for _ in range(2)], 2_000_000
    ratios = []
    with ThreadPoolExecutor(2) as pool:
        for _ in range(max(5, int(seconds * 4))):
            one = repeat(lambda: [fused_products(chain, n) for chain in chains], 0.0, 1)[0]
            two = repeat(lambda: list(pool.map(fused_products, chains, [n, n])), 0.0, 1)[0]
            ratios.append(one / two)
    return ratios


PARTS = ("hub hinges", "limbs", "ring", "substitution")


@entry_point
def repeat_part(rods, work, q_0, v_0, step, part, n):
    """Run one part of an iteration n times; returns a value that depends on it, so that it is not optimised away."""
    rows, memory = borrow(rods), borrow(work)
    zero, one, gamma = splat(0.0), splat(1.0), splat(step)
    stage = Stage(borrow(q_0), borrow(v_0), gamma, 1.0 / gamma, False)
    seen = zero
    for _ in range(n):
        if part == 0:
            seen += assemble_hub(rows, memory, stage, None)
        elif part == 1:
            for limb in range(rods.n_limbs):
                seen += sweep_limb(rows, memory, stage, limb, None, (zero, zero, zero), (zero, zero))[2]
        elif part == 2:
            seen += solve_hub(rows, memory, (one, zero, one), (one, zero))[1]
        else:
            seen += take_step(rows, memory, seen < 0.0, None, zero)
    return any_lane(seen > 0.0)


def part_seconds(scene: Scene, seconds: float) -> dict[str, list[float]]:
    """Durations of every part per robot [s], repeated for about `seconds` each, in the middle of a heating ramp."""
    simulator = Simulator(scene, N_LANES, threads=1)
    commands = np.zeros((N_LANES, scene.robot.n_limbs))
    commands[:, 1], commands[:, -1] = 1.0, -1.0
    stroke = simulator.stroke_in_parts(commands, 20)
    next(stroke)
    rods, (work, _) = make_rods(scene), simulator.memory[0]
    work.q[:] = simulator.q[0]
    durations: dict[str, list[float]] = {}
    n = 500
    for part, name in enumerate(PARTS):
        run = partial(repeat_part, rods, work, simulator.q[0], simulator.v[0], scene.numerics.step, part, n)
        durations[name] = [d / n / N_LANES for d in repeat(run, seconds)]
    return durations
