"""Designs of a sweep, and the batches that they are simulated in."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from seastar_gym.scene import Limb, Numerics, Scene, Seastar, SmaPulse
from seastar_gym.scene.actuators.wires import SmaWires
from seastar_gym.simulator import Simulator
from seastar_gym.sweep.designs import Batch, Choices, Range, Sweep
from seastar_gym.sweep.run import REFUSED, UNITS, swim

FAST = Scene.preset("fast")
LENGTH = Range("robot.limb_length", 0.05, 0.15)


def values_of(sweep, *names):
    """Values of axes, design after design."""
    found = []
    for batch in sweep.batches():
        labels = dict(batch.configuration.labels)
        columns = [batch.numbers.get(name, [labels.get(name)] * batch.n_robots) for name in names]
        found += zip(*columns, strict=True)
    return found


def test_a_grid_has_every_combination_once():
    axes = (
        Choices("robot.n_limbs", (3, 5)), Range("robot.limb_length", 0.05, 0.15).spaced(3),
        Choices("actuator.peak_angle", (0.2, 0.4, 0.6)), Choices("gait", ("straight", "1+,3-")),
    )  # fmt: skip
    for robots in (1, 2, 4, 100):
        sweep = Sweep(FAST, axes, robots=robots)
        found = values_of(sweep, *(axis.name for axis in axes))
        assert len(found) == sweep.n_designs == 36
        assert set(found) == set(itertools.product(*(axis.values for axis in axes)))
        assert len(list(sweep.batches())) == sweep.n_batches
    numbers = Choices("robot.limb_length", (0.05, 0.1)), Choices("numerics.step", (2e-3, 5e-3))
    batches = [(batch.n_robots, batch.configuration.scene.numerics.step) for batch in Sweep(FAST, numbers).batches()]
    assert batches == [(2, 2e-3), (2, 5e-3)]


def test_what_a_design_does_is_the_same_beside_any_others():
    """Limb 1 is bent at rest, in every design by another amount, and the way ahead is along it."""
    robot = Seastar(3, 4, limbs=(Limb(natural_curvature=1.0), Limb(), Limb()))
    bent = np.array([0.0, 8.0, -5.0])
    frame = next(Sweep(Scene(robot), (LENGTH,), settling=0, measured=1, samples=1).batches()).configuration

    def swum(order):
        return swim(Batch(frame, {"robot.limbs.0.natural_curvature": bent[order]}, len(order)))

    together = swum([0, 1, 2])
    for order in ([2, 0, 1], [1], [2]):
        for name, values in swum(order).items():
            np.testing.assert_array_equal(values, together[name][order], err_msg=name)


def test_every_row_and_column_of_a_latin_hypercube_has_one_design():
    sweep = Sweep(FAST, (LENGTH, Range("robot.youngs_modulus", 1e5, 1e7, is_log=True)), samples=50, robots=16)
    found = np.array(values_of(sweep, "robot.limb_length", "robot.youngs_modulus"))
    strata = np.stack([(found[:, 0] - 0.05) / 0.1, (np.log10(found[:, 1]) - 5.0) / 2.0], axis=1) * 50
    assert (np.sort(strata.astype(int), axis=0) == np.arange(50)[:, None]).all()


def test_each_combination_has_a_hypercube_of_its_own_and_a_seed_repeats_all():
    def lengths(seed):
        return values_of(Sweep(FAST, (LENGTH, Choices("robot.n_limbs", (3, 5))), samples=8, seed=seed), LENGTH.name)

    assert lengths(3) == lengths(3) != lengths(4)
    assert lengths(3)[:8] != lengths(3)[8:]


def test_parts_fidelities_and_gaits_are_choices_of_frames():
    axes = (
        Choices("actuator", (SmaPulse(0.3), SmaWires(period=1.0))),
        Choices("robot", (Seastar(), Seastar(n_limbs=4)), ("five", "four")),
        Choices("fidelity", ("fast", "balanced")),
    )
    frames = list(Sweep(Scene(), axes).configurations())
    assert len(frames) == 8
    assert dict(frames[0].labels) == {"actuator": "SmaPulse", "robot": "five", "fidelity": "fast"}
    assert {frame.scene.robot.nodes_per_limb for frame in frames} == {7, 12}
    assert frames[-1].scene.numerics == Numerics.preset("balanced")
    assert frames[-1].gait.commands == ((0.0, 1.0, 0.0, -1.0),)


def test_a_cell_is_named_by_all_that_its_results_depend_on(monkeypatch):
    def names(scene=FAST, axes=(LENGTH,), **options):
        return [batch.name for batch in Sweep(scene, axes, **{"samples": 4, **options}).batches()]

    first, one, other = names(), np.array([0.1]), np.array([0.2])
    assert first == names()
    frame = next(Sweep(FAST, (LENGTH,), samples=1).configurations())
    numbers = {"a": one, "b": other}, {"a": other, "b": one}, {"ab": one, "": other}
    others = [
        names(Scene.preset("balanced")), names(seed=1), names(gait="2-,5+"), names(settling=3), names(measured=9),
        names(axes=(Range("robot.limb_length", 0.05, 0.16),)), names(axes=(LENGTH, Choices("robot.n_limbs", (5,)))),
        names(gait=np.full((2, 5), 0.5)), *([Batch(frame, each, 1).name] for each in numbers),
    ]  # fmt: skip
    monkeypatch.setattr("seastar_gym.sweep.designs.__version__", "99.0")
    assert len({name for each in (first, *others, names()) for name in each}) == 13
    told = json.loads(frame.text)  # in order, so a name does not depend on that of a scene's fields
    assert list(told) == sorted(told) and list(told["scene"]["robot"]) == sorted(told["scene"]["robot"])


def test_a_swim_is_measured_after_it_has_settled():
    """Columns of repeated strokes are those of a simulator, robot by robot."""
    lengths = np.array([0.08, 0.1])
    scene = Scene(Seastar(4, 5, limbs=(Limb(natural_curvature=5.0),) * 4), actuator=SmaWires(), numerics=FAST.numerics)
    frame = next(Sweep(scene, (), "1+,3-", settling=2, measured=3).configurations())
    found = swim(Batch(frame, {"robot.limb_length": lengths}, 2))
    for k, length in enumerate(lengths):
        robot = Simulator(replace(scene, robot=replace(scene.robot, limb_length=length)), effort=True)
        reports = [robot.stroke([[1.0, 0.0, -1.0, 0.0]]) for _ in range(2)]
        hub, heading = robot.hub_position(), robot.heading()
        measured = [robot.stroke([[1.0, 0.0, -1.0, 0.0]]) for _ in range(3)]
        way = ((robot.hub_position() - hub) @ [1.0, 1.0j] * np.exp(-1j * heading)).item()
        expected = {
            "speed": abs(way) / 3.0, "strokes_per_metre": 3.0 / abs(way), "ahead": way.real, "aside": way.imag,
            "turn": (robot.heading() - heading).item(), "status": 0,
            **{name: sum(getattr(report, name).item() for report in measured) for name in ("energy", "work")},
            "peak_moment": max(report.peak_moment.item() for report in measured),
            "newton_iterations": sum(report.newton_iterations.item() for report in reports + measured),
            "smallest_opening_angle": min(report.smallest_opening_angle.item() for report in reports + measured),
        }  # fmt: skip
        assert {name: values[k] for name, values in found.items()} == pytest.approx(expected, rel=1e-12)


def test_a_design_that_a_scene_refuses_costs_itself_alone():
    frame = next(Sweep(FAST, (LENGTH,), settling=0, measured=1, samples=1).configurations())
    found = swim(Batch(frame, {"robot.limb_length": np.array([0.1, -1.0])}, 2))
    assert found["status"].tolist() == [0, REFUSED] and found["status"].dtype == np.int64
    assert np.isnan([found[name][1] for name in UNITS if name != "status"]).all() and found["speed"][0] > 0.0
    alone = swim(Batch(frame, {"robot.limb_length": np.array([0.1])}, 1))
    assert all(found[name][0] == alone[name][0] for name in UNITS)
    none = swim(Batch(frame, {"robot.limb_length": np.array([-1.0])}, 1))
    assert none["status"].tolist() == [REFUSED] and np.isnan(none["speed"]).all()
