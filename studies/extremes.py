"""Fidelities in extreme scenes: whole strokes of random commands in the scenes of the atlas of `studies.stability`.

Every fidelity has its own nodes and numerics. Robots begin at rest, or with random velocities or shifts of their nodes.
"""

from functools import partial
from typing import Any

import numpy as np

from seastar_gym.accuracy.certificate import at
from seastar_gym.scene import Scene, SmaPulse
from seastar_gym.scene.numerics import PRESETS, Fidelity
from seastar_gym.simulator import Simulator
from seastar_gym.simulator.drive import step_times
from studies.frame import Results, Study, rounded
from studies.stability import SWEEPS, Case, disturb

STROKES = 3
"""Strokes of every robot."""


def cases() -> list[Case]:
    """Scenes of all values of the atlas but numbers of nodes, which fidelities choose."""
    return [sweep.case(value) for sweep in SWEEPS if sweep.label != "nodes per limb" for value in sweep.values]


def swum(fidelity: Fidelity) -> dict[str, Any]:
    """Numbers of a fidelity over all scenes; iterations are Newton's, per time step of a stroke."""
    robots, failed, halved, iterations = 0, 0, 0, []
    for case in cases():
        scene = at(Scene(case.robot, case.fluid, SmaPulse(case.peak_angle)), PRESETS[fidelity])
        commands, rng = case.commands(), np.random.default_rng(3)
        simulator = Simulator(scene, len(commands))
        disturb(simulator, case.speed, case.shift)
        steps = len(step_times(scene.actuator.corners, scene.numerics.step)) - 1  # without substeps
        for _ in range(STROKES):
            report = simulator.stroke(commands)
            halved += int((report.halvings > 0).sum())
            iterations += (report.newton_iterations / steps).tolist()
            commands = rng.permuted(commands, axis=1)
        state = simulator.get_state()
        finite = (np.isfinite(state.positions) & np.isfinite(state.velocities)).all(axis=(1, 2))
        robots, failed = robots + len(commands), failed + int((simulator.failed | ~finite).sum())
    return {
        "scenes": len(cases()), "robots": robots, "failed": failed, "strokes": len(iterations), "halved": halved,
        "iterations": rounded(float(np.median(iterations))), "most": rounded(max(iterations)),
    }  # fmt: skip


def run(results: Results) -> None:
    """Swim the scenes at every fidelity that has none of the chapter's poles at the hub."""
    fidelities = [each for each in PRESETS if each != "chapter"]
    results.fill({("fidelities", each): partial(swum, each) for each in fidelities}, str)


STUDY = Study("extremes", run, file="stability/extremes.json", settings=dict)
