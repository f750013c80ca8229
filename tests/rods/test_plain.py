"""Kernels in plain Python: one by one where Python calls them, and all of them in place of the compiled ones."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from seastar_gym import (
    AlongLimb,
    Body,
    Contact,
    Numerics,
    Scene,
    Seastar,
    Simulator,
    SmaPulse,
    Stiffening,
    Vortex,
    Water,
)
from seastar_gym.lanes.registers import N_LANES

ROOT = Path(__file__).resolve().parents[2]
COMPILED = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


SCRIPT = """
import sys, numpy, test_plain
bodies = test_plain.ends(test_plain.on_bodies())
assert all(numpy.isfinite(each).all() for each in bodies.values())
numpy.savez(sys.argv[1], **test_plain.ends(test_plain.scenes()))
"""
MEETING = SmaPulse(0.62, 0.06, 0.02)
WATER = Water(950.0, 1.3, 0.1, Vortex(0.02, 0.1, -0.05, 0.06), 0.8)


# Whole strokes


def scenes():
    """Name, scene, and velocities of some robots at the start [m/s], by which steps are halved and limbs meet."""
    pulse, midpoint = SmaPulse(0.6, 0.02, 0.02), Numerics("implicit-midpoint", 0.01)
    for scheme, nodes, blow in (("implicit-euler", 4, 20.0), ("sdirk2", 3, 0.3), ("implicit-midpoint", 3, 0.3)):
        yield scheme, Scene(Seastar(nodes_per_limb=nodes), actuator=pulse, numerics=Numerics(scheme, 0.02)), blow
    robot = Seastar(nodes_per_limb=3, relaxation_time=4e-3)
    yield "fluid", Scene(robot, WATER, pulse, midpoint), 0.3
    bent = Seastar(nodes_per_limb=4, along=AlongLimb(0.7, (1.0, 2.0, 0.5)), stiffening=Stiffening(2.0))
    yield "bent along", Scene(bent, None, pulse, midpoint), 0.3
    for name, contact in (("contact", Contact()), ("no contact", None)):
        yield name, Scene(Seastar(nodes_per_limb=4), None, MEETING, Numerics(step=0.02), contact=contact), 1.0


def on_bodies():
    """Robots with a body and all other terms, whose machine code takes minutes to compile."""
    outline = ((0.02, -0.01), (0.01, 0.02), (-0.02, 0.01), (-0.01, -0.02))
    for scheme, contact, body, blow in (
        ("implicit-euler", Contact(), Body(radius=0.02), 10.0),
        ("implicit-midpoint", Contact(), Body(outline=outline, centre_of_mass=(2e-3, 1e-3)), 0.5),
        ("sdirk2", None, Body(outline=outline, mass=0.01), 20.0),
    ):
        robot = Seastar(3, 3, relaxation_time=4e-3, body=body, along=AlongLimb(0.7), stiffening=Stiffening(2.0))
        pull = {"gravity": (1.0, -9.81), "loads": ((4, 1e-3, -2e-3),)}
        yield scheme, Scene(robot, WATER, MEETING, Numerics(scheme, 0.02), contact=contact, **pull), blow


def ends(scenes) -> dict[str, np.ndarray]:
    """Where the nodes are after a stroke; some robots begin with blows that need convex matrices and halved steps."""
    found = {}
    for name, scene, blow in scenes:
        n_robots, rows = N_LANES + (name == "implicit-euler"), 2 * scene.robot.n_nodes  # two threads once
        simulator, rng = Simulator(scene, n_robots, threads=2), np.random.default_rng(0)
        simulator.v[:, :rows, -2:] = blow * rng.standard_normal(simulator.v[:, :rows, -2:].shape)
        report = simulator.stroke(rng.integers(-1, 2, (n_robots, scene.robot.n_limbs)).astype(float))
        counts = np.array([report.steps, report.halvings, report.energy_cuts])
        found[name], found[f"{name} counts"] = simulator.positions, counts
    return found


@COMPILED
def test_strokes_in_plain_python_stay_within_their_rows_and_are_those_of_the_machine_code(tmp_path):
    """Reading or writing beyond rows raises where nothing is compiled."""
    path = os.pathsep.join(map(str, (ROOT, ROOT / "tests", ROOT / "tests" / "rods")))
    answer = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT, str(tmp_path / "plain.npz")],
        cwd=ROOT, env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    expected = ends(scenes())
    with np.load(tmp_path / "plain.npz") as found:
        assert set(found) == set(expected)
        for name in expected:
            np.testing.assert_allclose(found[name], expected[name], rtol=0.0, atol=1e-13, err_msg=name)
    assert expected["implicit-euler counts"][1].sum() > 0  # steps were halved
    assert expected["bent along counts"][2].sum() > 0  # energy was cut
    assert np.abs(expected["contact"] - expected["no contact"]).max() > 1e-5  # limbs have met
