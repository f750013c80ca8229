"""Time of the parts of a Newton iteration, each repeated alone in a compiled loop."""

import time

import numpy as np

from seastar_gym.der.potential import assemble_hub, solve_hub, sweep_limb
from seastar_gym.der.stepping.newton import take_step
from seastar_gym.der.stepping.stages import Stage
from seastar_gym.model.rods import make_rods
from seastar_gym.scene import Scene
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, any_lane, borrow, splat
from seastar_gym.simulator import Simulator

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
        repeat_part(rods, work, simulator.q[0], simulator.v[0], scene.numerics.step, part, 1)
        durations[name] = []
        while sum(durations[name]) * n * N_LANES < seconds or len(durations[name]) < 5:
            start = time.perf_counter()
            repeat_part(rods, work, simulator.q[0], simulator.v[0], scene.numerics.step, part, n)
            durations[name].append((time.perf_counter() - start) / n / N_LANES)
    return durations
