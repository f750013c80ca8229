"""Strokes of hard scenes arrive, end where they did, and cost what they did: whatever changes a step is noticed."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from fuzz.promises import assert_told
from hubs import HUBS, TEN, robot_with
from seastar_gym import AlongLimb, Contact, Numerics, Scene, Seastar, Simulator, SmaPulse, Stiffening, Water
from seastar_gym.rods.step import SCHEMES
from simulator.test_conservation import LOPSIDED, rattled
from simulator.test_fluids import STILL
from strokes import ternary

BENT = Seastar(nodes_per_limb=6, along=AlongLimb(0.8, (1.0, 0.5)), stiffening=Stiffening())
HARD = {
    **{f"{scheme}, {name}": (partial(Scene, robot, fluid, SmaPulse(peak), Numerics(scheme, step)), speed)
       for scheme in SCHEMES for name, robot, fluid, peak, step, speed in (
           *((f"{speed:g} m/s", TEN, Water(), 0.6, 0.01, speed) for speed in (0.0, 0.1, 1.0, 10.0)),
           ("100 m/s", TEN, Water(), 0.6, 0.05, 100.0), ("long steps", TEN, Water(), 0.6, 0.2, 0.0),
           *((f"{n} nodes", Seastar(nodes_per_limb=n), Water(), 0.6, 0.05, 0.0) for n in (40, 80)),
           ("twelve limbs", Seastar(12), Water(), 0.6, 0.02, 0.0),
           *((f"1e{k} Pa", Seastar(nodes_per_limb=10, youngs_modulus=10.0**k), Water(), 0.6, 0.02, 0.0)
             for k in range(2, 12)),
           *((f"{hub} hub in vacuum, {speed:g} m/s", robot_with(hub, nodes_per_limb=6), None, 0.3, 0.01, speed)
             for hub in HUBS for speed in (1.0, 10.0)),
           ("body in vacuum", LOPSIDED, None, 0.5, 8e-3, 0.0), ("body in water", LOPSIDED, Water(), 0.5, 8e-3, 0.0),
           ("all terms of a fluid", Seastar(relaxation_time=1e-4), STILL, 0.6, 0.01, 0.1),
           ("bent along", BENT, Water(), 0.6, 0.01, 0.1),
       )},
    **{f"{scheme}, touching": (
        partial(Scene, TEN, Water(), SmaPulse(0.7), Numerics(scheme, 5e-3), contact=Contact()), 0.1)
       for scheme in ("sdirk2", "implicit-midpoint")},
}  # fmt: skip
"""What makes scenes that defeat plain Newton, and random velocities at the start [m/s]."""
COUNTED = "halvings", "newton_iterations", "steps", "energy_cuts"
KEPT = Path(__file__).parents[1] / "golden" / "costs" / "strokes.json"


@pytest.mark.filterwarnings("ignore:Limbs of robot:RuntimeWarning")
@pytest.mark.parametrize("name", HARD)
def test_hard_scenes_arrive_where_they_did_and_cost_what_they_did(request, name):
    """Rounding, which depends on the machine, counts for a per cent where strokes need many halvings."""
    make, speed = HARD[name]
    scene = make()
    simulator, counts = rattled(Simulator(scene, 8), speed), np.zeros(len(COUNTED))
    simulator._watches.pop("energy_growth", None)  # energies have machine code of their own, which the core has not
    for commands in ternary(3, 8, n_limbs=scene.robot.n_limbs):
        commands[0] = np.resize([1.0, -1.0], scene.robot.n_limbs)
        report = simulator.stroke(commands)
        assert not report.status.any()
        assert_told(simulator, report)
        counts += [getattr(report, each).sum() for each in COUNTED]
    ends = [1e3 * np.abs(simulator.positions).sum(), report.largest_overlap.sum(), report.smallest_opening_angle.sum()]
    if request.config.getoption("--update"):
        known = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
        KEPT.parent.mkdir(exist_ok=True)
        known[name] = [*counts, *ends]
        KEPT.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    kept = json.loads(KEPT.read_text(encoding="utf-8"))[name]
    violent = kept[0] > 10
    np.testing.assert_allclose(counts, kept[: len(COUNTED)], rtol=0.02 if violent else 1e-3, atol=2.0)
    share, least = (0.01, 0.05) if violent else (1e-6, 1e-9)
    np.testing.assert_allclose(ends, kept[len(COUNTED) :], rtol=share, atol=least)
