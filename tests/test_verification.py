"""The simulator against exact solutions and published codes, and those solutions against independent formulas."""

import functools
import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from continuum_oracle import Continuum
from oracle import Star, elastic_hessian, inertia_matrix
from seastar_gym import Numerics, Scene, Seastar, Simulator, Water
from seastar_gym.model.rods import make_rods
from studies.verification import clamped, drag, exact, mujoco, published, waves
from studies.verification import page as verification_page
from studies.verification import study as verification
from studies.verification.unactuated import IN_LINE, let_pass, pause

PAGE = Path(__file__).parents[1] / "docs" / "verification.md"

section = functools.cache(lambda name: verification.SECTIONS[name]())


@pytest.mark.parametrize("name", verification.SECTIONS)
def test_every_line_of_the_page_is_within_its_bound(name):
    outside = [row for row in section(name).rows if not row.holds]
    assert section(name).rows and not outside


@pytest.mark.parametrize("name", verification.SECTIONS)
def test_bounds_are_not_generous(name):
    """Half of a section's lines would not hold if the simulator were off by a hundredth more than it is."""
    worse = [replace(row, ours=row.ours + 1e-2 * row.reference * np.sign(row.difference)) for row in section(name).rows]
    assert sum(not row.holds for row in worse) >= 0.5 * len(worse)


# The elastica


@pytest.mark.parametrize("tip_angle", [0.1, 0.7, 1.4])
def test_shooting_finds_the_elastica_of_the_elliptic_integrals(tip_angle):
    """Inextensible, load across the clamp: p^2 = (1 + sin theta_tip) / 2, Bisshopp and Drucker (1945)."""
    m = 0.5 * (1.0 + np.sin(tip_angle))
    start = np.arcsin(np.sqrt(0.5 / m))
    root_k = ellipk(m) - ellipkinc(start, m)
    x = np.sqrt(2.0 * np.sin(tip_angle)) / root_k
    y = 1.0 - 2.0 * (ellipe(m) - ellipeinc(start, m)) / root_k
    np.testing.assert_allclose(exact.elastica_tip(root_k**2, 1.0, 1.0), [x, y], rtol=1e-9)


def test_a_stretchable_rod_reaches_farther_than_the_elastica():
    stiff, soft = exact.elastica_tip(3.0, 1.0, 1.0), exact.elastica_tip(3.0, 1.0, 1.0, EA=1e3)
    assert np.hypot(*soft) > np.hypot(*stiff)


@pytest.mark.parametrize(("discretisation", "clamp"), [("chapter", 1.0 / 2.0), ("continuum", 5.0 / 12.0)])
def test_a_limb_held_by_hub_and_root_node_is_clamped_within_the_held_edge(discretisation, clamp):
    """The hinge at the root node bends from there; against an elastica from that place, the error is of order 2."""
    robots = [Seastar(nodes_per_limb=n, discretisation=discretisation) for n in (20, 40, 80)]
    EI, EA = exact.bending_stiffness(robots[0]), exact.stretching_stiffness(robots[0])
    load = EI / 0.1**2
    numerics = Numerics("implicit-euler", step=0.5, newton_tolerance=1e-12)
    errors = []
    for robot in robots:
        tip, held = robot.nodes_per_limb - 1, clamp * robot.edge_length
        scene = Scene(robot, Water(), pause(8.0), numerics, held_nodes=(0, 1), loads=((tip, 0.0, load),))
        simulator = Simulator(scene)
        let_pass(simulator)
        expected = exact.elastica_tip(load, EI, 0.1 - held, EA) + [held, 0.0]
        errors.append(np.hypot(*(simulator.positions[0, tip] - expected)))
    order = verification_page.order_row("", [robot.edge_length for robot in robots], errors, 0.0).ours
    assert order == pytest.approx(2.0, abs=0.1)


# Natural frequencies


def test_the_shape_of_a_mode_satisfies_the_beam_equation_and_its_ends():
    s, d = np.linspace(0.0, 1.0, 2001), 1.0 / 2000
    for root in exact.CANTILEVER_ROOTS:
        shape = exact.cantilever_shape(root, s)
        slope, bend = np.gradient(shape, d), np.diff(shape, 2) / d**2
        assert np.cos(root) * np.cosh(root) == pytest.approx(-1.0, abs=1e-9)
        assert shape[0] == pytest.approx(0.0, abs=1e-12) and shape[-1] == pytest.approx(1.0)
        assert abs(slope[0]) < 1e-2 * root and abs(bend[-1]) < 1e-2 * root**2
        np.testing.assert_allclose(np.diff(bend, 2)[::100] / d**2, (root**4 * shape[2:-2])[::100], atol=2e-2 * root**4)


@pytest.mark.parametrize("name", IN_LINE)
@pytest.mark.parametrize("n", [10, 20])
def test_the_limbs_ring_with_the_eigenvalues_of_their_stiffness(name, n):
    """The dense oracle's Hessian at rest and masses, where both limbs move alike and the hub is held."""
    star = {"continuum": Continuum(2, n), "chapter": Star(2, n, hub_hinge="turning")}[name]
    across = 2 * np.arange(1, n) + 1  # y of limb 1: along x the straight limb only stretches
    alike = np.zeros((2 * star.n_nodes, n - 1))
    for limb in (across, across + 2 * (n - 1)):
        alike[limb, np.arange(n - 1)] = 1.0
    stiffness = alike.T @ elastic_hessian(star, star.rest, np.zeros(2)) @ alike
    eigenvalues = eigh(stiffness, alike.T @ inertia_matrix(star) @ alike, eigvals_only=True)
    ours = [clamped.ringing_frequency(replace(IN_LINE[name], nodes_per_limb=n), mode) for mode in range(3)]
    np.testing.assert_allclose(ours, np.sqrt(eigenvalues[:3]) / (2.0 * np.pi), rtol=5e-5)


def test_a_fitted_frequency_is_that_of_the_signal():
    time = np.linspace(0.0, 12.0, 301)
    signal = 0.3 * np.sin(2.0 * np.pi * 1.037 * time + 0.4) + 1e-4 * np.sin(2.0 * np.pi * 6.2 * time)
    assert clamped.fitted_frequency(time, signal, 1.0) == pytest.approx(1.037, rel=1e-6)


# Drag


def test_exact_drag_solutions_satisfy_their_equations():
    k, a, v0, t, d = 199.0, 1.0, 0.1, 0.07, 1e-6
    speed = exact.falling_speed(k, a, t)
    assert (exact.falling_speed(k, a, t + d) - speed) / d == pytest.approx(a - k * speed**2, rel=1e-4)
    change = (exact.coasting(k, v0, t + d) - exact.coasting(k, v0, t)) / d
    speed = exact.coasting(k, v0, t)[0]
    np.testing.assert_allclose(change, [-k * speed**2, speed], rtol=1e-4)


def test_drag_over_mass_is_that_of_every_node():
    rods = make_rods(Scene(Seastar(discretisation="chapter")))
    k = exact.drag_over_mass(Seastar(), Scene().fluid)
    np.testing.assert_allclose(rods.drag / rods.mass, k, rtol=1e-13)


def test_in_either_discretisation_a_robot_translates_alike():
    np.testing.assert_allclose(drag.coasted(0.1, 1.0, "continuum"), drag.coasted(0.1, 1.0, "chapter"), rtol=1e-10)


# Waves


@pytest.mark.parametrize("discretisation", waves.SLOWER)
def test_a_pulse_has_the_dispersion_of_the_discrete_rod(discretisation):
    """omega = 4/l^2 sin^2(k l / 2) sqrt(EI / (rho_m A)): what the continuous k^2 becomes on nodes a length l apart.

    A wave in consistent masses has 1 - 2/3 sin^2(k l / 2) of its mass.
    """
    robot = Seastar(n_limbs=3, nodes_per_limb=201, limb_length=1.0, discretisation=discretisation)
    pulse = waves.bending_pulse(robot)
    for k in (70.0, 80.0, 90.0):
        sine = np.sin(0.5 * k * robot.edge_length)
        mass = 1.0 - 2.0 / 3.0 * sine**2 if discretisation == "continuum" else 1.0
        omega = (2.0 / robot.edge_length * sine) ** 2 * exact.beam_constant(robot) / np.sqrt(mass)
        assert waves.pulse_frequency(robot, k, *pulse) == pytest.approx(omega, rel=5e-4)


# Published codes


def test_published_swims_have_a_hundred_times_and_agree_with_each_other():
    time, x_a, x_b = published.published_swim()
    np.testing.assert_allclose(time, 0.1 * np.arange(1, 101))
    np.testing.assert_allclose(x_a, x_b, rtol=1e-6)


def test_a_missing_file_of_published_figures_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nothing\.csv is missing"):
        published.published_swim(tmp_path / "nothing.csv")


# The page


def test_the_page_in_the_repository_is_the_one_that_the_study_writes():
    """Except for the last digits of ours, which depend on the machine."""
    page = PAGE.read_text(encoding="utf-8")
    assert page.startswith(verification_page.INTRODUCTION)
    for name in verification.SECTIONS:
        assert f"## {section(name).title}\n\n{section(name).method}\n" in page
        for row in (row for row in section(name).rows if row.shown):
            what, reference, *_ = verification_page.as_cells(row)
            assert f"| {what} | {reference} |" in page


def test_a_row_is_written_with_its_unit_and_difference():
    row = verification_page.Row("speed", 2.0, 2.001, "m/s", allowed=1e-4)
    assert verification_page.as_cells(row) == ("speed [m/s]", "2.00000", "2.00100", "+1.0e-03 (+5.0e-04)")
    assert not row.holds
    shown = verification_page.Section("Speeds", "How.", [row])
    assert "| speed [m/s] | 2.00000 | 2.00100 | +1.0e-03 (+5.0e-04) |" in verification_page.as_page([shown])


# Beside MuJoCo


def beside_mujoco() -> dict:
    """The committed errors and times: by case, setting and code."""
    return json.loads((PAGE.parent / "results" / "verification" / "mujoco.json").read_text(encoding="utf-8"))


def test_our_error_beside_mujoco_is_that_of_the_page():
    wanted = np.cos(2.0 * np.pi * np.arange(mujoco.PERIODS * mujoco.SAMPLES + 1) / mujoco.SAMPLES)
    numerics = Numerics("implicit-midpoint", mujoco.period() / 50, 1e-10)
    committed, _, _ = beside_mujoco()["ringing"]["50"]["implicit-midpoint"]
    assert mujoco.our_ringing(numerics, wanted)[0] == pytest.approx(committed, rel=1e-3)


def test_the_page_says_of_mujoco_what_was_measured():
    found = beside_mujoco()
    for row in found["ringing"].values():
        (damped, own_time, _), (other, other_time, _) = row["implicit-euler"], row["mujoco"]
        assert damped <= other and own_time < 0.2 * other_time
        assert row["implicit-midpoint"][0] < 0.1 * other
    loaded = found["tip load"]
    assert loaded["40"]["implicit-euler"][0] < loaded["20"]["mujoco"][0] < loaded["40"]["mujoco"][0]
    assert found["free fall"]["20"]["implicit-midpoint"][0] < mujoco.ROUNDING


@pytest.mark.skipif(find_spec("mujoco") is None, reason="MuJoCo is not installed: the extra mujoco has it")
def test_mujoco_s_error_is_that_of_the_page():
    committed, _, _ = beside_mujoco()["tip load"]["10"]["mujoco"]
    assert mujoco.loaded(10)[mujoco.MUJOCO].error == pytest.approx(committed, rel=1e-2)
