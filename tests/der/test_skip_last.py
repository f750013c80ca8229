"""When the last Newton step is left out: every condition alone."""

from functools import cache
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from hubs import TEN
from seastar_gym import Scene, Seastar, SmaPulse, Water
from seastar_gym.der.energy import elastic_energy
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping.newton import ROUNDING, take_step
from seastar_gym.der.stepping.scales import PREDICTABLE_STRAIN, SLENDER
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.skip_last import (
    CURVATURE,
    EASY,
    FORESEEABLE_T,
    LATE,
    can_skip,
    largest_hub_t,
    quadratic_length,
)
from seastar_gym.der.stepping.stages import begin_stage, end_step
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.der.terms.inertia import kinetic_energy
from seastar_gym.model.coefficients import Coefficients
from seastar_gym.model.rods import make_rods
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, borrow, load, splat, store
from seastar_gym.simd.numpy_lanes import Lanes
from seastar_gym.simd.rows import aligned_rows
from slopes import plain
from touching import touching_limbs

ROBOT = TEN
RODS = make_rods(Scene(ROBOT))
EDGE = ROBOT.limb_length / 9
WORK = make_work(RODS, 1)
ENERGY = PREDICTABLE_STRAIN * ROBOT.youngs_modulus * np.pi * ROBOT.rod_radius**2 * 5 * ROBOT.limb_length
"""Joule: the strain energy up to which steps are predictable."""


def foreseen(iterations=1.0, setbacks=0.0, phi=0.0, move=0.99e-5, tolerated=1e-10, t=1.0):
    """Whether the next step is left out, of one robot in all lanes, the last hub hinge of which has this t."""
    WORK.hub_t[:] = 0.5
    WORK.hub_t[-1] = t
    numbers = map(Lanes, (iterations, setbacks, phi, move, tolerated))
    mask = plain(can_skip.plain(RODS, WORK, *numbers))
    assert mask.all() == mask.any()
    return bool(mask.all())


@pytest.mark.parametrize(
    "inside, outside",
    [
        ({}, {"move": 1.01e-5}),
        ({"iterations": EASY, "move": 0.99e-5 / np.sqrt(LATE)}, {"iterations": EASY, "move": 1.01e-5 / np.sqrt(LATE)}),
        ({"iterations": EASY - 1.0}, {"iterations": EASY + 1.0, "move": 1e-9}),
        ({"setbacks": 0.0}, {"setbacks": 1.0}),
        ({"phi": 0.99 * ENERGY}, {"phi": 1.01 * ENERGY}),
        ({"t": 0.99 * FORESEEABLE_T}, {"t": FORESEEABLE_T}),
        ({}, {"move": np.nan}),
        ({}, {"phi": np.nan}),
    ],
)
def test_a_step_is_left_out_up_to_every_threshold_and_not_beyond(inside, outside):
    assert foreseen(**inside) and not foreseen(**outside)


def test_limbs_that_touch_are_not_predictable():
    touching = touching_limbs(apart=3)
    touching.work.contact.touching[0] = np.arange(N_LANES) >= 3
    numbers = map(Lanes, (1.0, 0.0, 0.0, 1e-9, 1.0))
    mask = plain(can_skip.plain(touching.rods, touching.work, *numbers))
    np.testing.assert_array_equal(mask, np.arange(N_LANES) < 3)


def length(gamma: float, **robot: float) -> float:
    rods = make_rods(Scene(Seastar(nodes_per_limb=10, **robot)))
    return float(np.max(plain(quadratic_length.plain(rods, SimpleNamespace(gamma=Lanes(gamma))))))


def test_the_foreseeable_length_of_light_edges_is_a_fraction_of_the_shortest():
    assert length(1e-9) == pytest.approx(EDGE / CURVATURE)
    assert length(1e-9, limb_length=0.2) == pytest.approx(2.0 * EDGE / CURVATURE)


@pytest.mark.parametrize("radius, share", [(1e-5, 1.0), (1e-3, (EDGE / 1e-3) ** 2 / SLENDER)])
def test_the_foreseeable_length_shrinks_with_the_square_of_the_step_the_less_the_thicker_edges_are(radius, share):
    gamma = 0.1
    rate = share * ROBOT.youngs_modulus / ROBOT.density / EDGE**2
    assert length(gamma, rod_radius=radius) == pytest.approx(EDGE / (CURVATURE + rate * gamma**2))


def test_the_largest_hub_t_is_found_whichever_hinge_has_it():
    work = make_work(RODS, 1)
    work.hub_t[:] = np.random.default_rng(0).standard_normal(work.hub_t.shape)
    np.testing.assert_array_equal(plain(largest_hub_t.plain(RODS, work)), work.hub_t.max(axis=0))


# Every constant of der/stepping/skip_last.py is what plain Newton needs: ten times more or less fails here.


STROKES, ROBOTS = 150, 8
"""Drawn strokes of a kind, and robots of a stroke, however many lanes a processor has."""
ITERATIONS, STEPS, RAMP = 6, 60, 6
"""Newton steps of a stage, stages of a stroke, and stages between two corners of its rotations."""
TRACED = 4
"""Numbers that are kept of an iteration."""
LARGEST_TOLERANCE, ROUNDED = 1e-2, 1e-13
"""Limb lengths: the largest Newton tolerance that a scene may have, and moves that are rounding."""


@entry_point
def trace(rods, work, scheme, actuation, q, v, a, rotations, h, iterations, energies):
    """Steps of implicit Euler by plain Newton, every one of as many iterations; all that is kept is per step.

    rotations: Of the limbs at the ends [rad]. h: Steps [s], per robot. iterations: Out: move [m], Phi [J], largest hub
    t and smallest pivot of every iteration. energies: Out: energy [J] that a step may end with, and ends with.
    """
    rows, memory, turned, tableau = borrow(rods), borrow(work), borrow(actuation), borrow(scheme)
    q_rows, v_rows, a_rows = borrow(q), borrow(v), borrow(a)
    zero, gamma = splat(0.0), load(borrow(h), 0)
    everyone = zero < splat(1.0)
    for k in range(rotations.shape[0]):
        seen, energy, rotation = borrow(iterations[k]), borrow(energies[k]), borrow(rotations[k])
        for limb in range(rods.n_limbs):
            store(turned.delta_psi_end, limb, load(rotation, limb))
        stage = begin_stage(rows, memory, tableau, 0, q_rows, v_rows, a_rows, gamma)
        set_natural_hub_angles(rows, memory, turned, splat(1.0))
        store(energy, 0, elastic_energy(rows, memory, q_rows) + kinetic_energy(rows, v_rows, (zero, zero)))
        for i in range(iterations.shape[1] // TRACED):
            phi, _, pivot = factorise(rows, memory, stage, None)
            store(seen, TRACED * i, take_step(rows, memory, everyone, None, zero))
            store(seen, TRACED * i + 1, phi)
            store(seen, TRACED * i + 2, largest_hub_t(rows, memory))
            store(seen, TRACED * i + 3, pivot)
        end_step(rows, memory, tableau, stage, q_rows, v_rows, a_rows, gamma, everyone)
        store(energy, 1, elastic_energy(rows, memory, q_rows) + kinetic_energy(rows, v_rows, (zero, zero)))


class Draw(NamedTuple):
    """What robots, their strokes and their steps are drawn from; ranges but that of the peak are logarithmic.

    slenderness: Edge length over radius. peak: Largest rotation, as a share of what the hub hinges allow. speed: Of the
    nodes at the start, in limb lengths per step.
    """

    slenderness: tuple[float, float] = (3.0, 50.0)
    nodes: tuple[int, ...] = (3, 5, 10, 20, 40)
    limbs: tuple[int, ...] = (3, 4, 5, 6, 7)
    hinges: tuple[str, ...] = ("opening", "turning")
    peak: tuple[float, float] = (0.02, 0.95)
    speed: tuple[float, float] = (1e-6, 1e-3)


ORDINARY = Draw()
LONG = Draw(slenderness=(70.0, 500.0))
VIOLENT = Draw(speed=(1e-2, 1.0))
NEAR_POLES = Draw(hinges=("opening",), peak=(0.9, 0.999))
THICK_NEAR_POLES = Draw(slenderness=(3.0, 12.0), nodes=(3, 5), limbs=(3,), hinges=("opening",), peak=(0.9, 0.999))


class Stages(NamedTuple):
    """Stages of plain Newton, one per row; numbers of robots have the shape (n, 1).

    move [m], phi [J], hub_t: Of every iteration; those before its step, but for the move.
    sound: Iterations up to which no step would have been shortened or needed a convex matrix.
    limb, edge: Lengths [m]. stiffness: E gamma^2/(rho l^2) [1]. predictable, damped: Potentials [J] of the scales.
    gained: Energy beyond the one allowed, over the allowed one.
    """

    move: np.ndarray
    phi: np.ndarray
    hub_t: np.ndarray
    sound: np.ndarray
    limb: np.ndarray
    edge: np.ndarray
    stiffness: np.ndarray
    slenderness: np.ndarray
    predictable: np.ndarray
    damped: np.ndarray
    gained: np.ndarray


def logarithmic(rng, ends):
    return np.exp(rng.uniform(*np.log(ends), ROBOTS))


def in_lanes(numbers):
    """Numbers of robots, shape (..., ROBOTS), in groups of lanes, shape (n_groups, ..., N_LANES)."""
    n_groups = -(-ROBOTS // N_LANES)
    filled = numbers[..., np.arange(n_groups * N_LANES) % ROBOTS]
    return np.ascontiguousarray(np.moveaxis(filled.reshape(*numbers.shape[:-1], n_groups, N_LANES), -2, 0))


def drawn_rotations(draw, room, n_limbs, rng):
    """Rotations of limbs along straight ramps between random corners [rad], shape (STEPS, n_limbs, ROBOTS)."""
    corners = rng.uniform(-1.0, 1.0, (STEPS // RAMP + 1, n_limbs, ROBOTS))
    corners = np.where(rng.random(ROBOTS) < 0.5, np.round(corners), corners)
    corners *= 0.5 * room * rng.uniform(*draw.peak, ROBOTS)
    corners[0] = 0.0
    ramp, step = np.divmod(np.arange(STEPS), RAMP)
    share = ((step + 1) / RAMP)[:, None, None]
    return (1.0 - share) * corners[ramp] + share * corners[ramp + 1]


def drawn_stages(draw, rng):
    """Stages of one stroke."""
    nodes, n_limbs = int(rng.choice(draw.nodes)), int(rng.choice(draw.limbs))
    hinge = draw.hinges[rng.integers(len(draw.hinges))]
    room = np.pi - 2.0 * np.pi / n_limbs if hinge == "opening" else 2.0 * np.pi / n_limbs
    limb, slenderness = logarithmic(rng, (0.03, 0.3)), logarithmic(rng, draw.slenderness)
    modulus, density, gamma = (logarithmic(rng, ends) for ends in ((1e4, 1e8), (700.0, 2000.0), (1e-4, 2e-2)))
    edge = limb / (nodes - 1)
    length, radius, E, rho = (in_lanes(each).ravel() for each in (limb, edge / slenderness, modulus, density))
    robot = Seastar(n_limbs, nodes, length, radius, E, rho, hinge, discretisation="chapter")
    rotations = in_lanes(drawn_rotations(draw, room, n_limbs, rng))
    fluid = None if rng.random() < 0.3 else Water()
    coefficients = Coefficients(Scene(robot, fluid, SmaPulse(0.01)), len(length))
    shape = (coefficients.rest.shape[1], ROBOTS)
    v = in_lanes(logarithmic(rng, draw.speed) * limb / gamma * rng.standard_normal(shape))
    shaken = in_lanes(logarithmic(rng, (1e-6, 1e-2)) * edge * rng.standard_normal(shape))
    found = []
    for group, h in enumerate(in_lanes(gamma[None])):
        rods, q = coefficients.rods(group), coefficients.rest[group].copy()
        q += shaken[group]
        turned = Actuation(aligned_rows(n_limbs, N_LANES), aligned_rows(n_limbs, N_LANES))
        iterations, energies = aligned_rows(STEPS, TRACED * ITERATIONS, N_LANES), aligned_rows(STEPS, 2, N_LANES)
        a, scheme = aligned_rows(len(q) + 3, N_LANES), SCHEMES["implicit-euler"]
        trace(rods, make_work(rods, 1), scheme, turned, q, v[group], a, rotations[group], h, iterations, energies)
        scales = (np.broadcast_to(x[0], N_LANES) for x in (rods.scales.predictable, rods.scales.damped))
        found.append((iterations, energies, *scales))
    parts = (np.concatenate(part, axis=-1)[..., :ROBOTS] for part in zip(*found, strict=True))
    iterations, energies, predictable, damped = parts
    by_stage = iterations.reshape(STEPS, ITERATIONS, TRACED, ROBOTS).transpose(2, 0, 3, 1)
    move, phi, hub_t, pivot = by_stage.reshape(TRACED, -1, ITERATIONS)
    allowed, ended = energies.transpose(1, 0, 2).reshape(2, -1, 1)
    numbers = limb, edge, modulus / density * (gamma / edge) ** 2, slenderness, predictable, damped
    each = (np.tile(one, STEPS)[:, None] for one in numbers)
    return Stages(move, phi, hub_t, without_setbacks(move, phi, pivot), *each, (ended - allowed) / allowed)


def without_setbacks(move, phi, pivot):
    before = np.concatenate([np.full((len(phi), 1), np.inf), phi[:, :-1]], axis=1)
    fine = np.isfinite(move) & (pivot > 0.0) & (phi <= before + ROUNDING * np.abs(phi))
    return np.logical_and.accumulate(fine, axis=1)


@cache
def stages(draw):
    rng = np.random.default_rng(0)
    with np.errstate(all="ignore"):  # plain Newton may fail
        strokes = [drawn_stages(draw, rng) for _ in range(STROKES)]
    return Stages(*(np.concatenate(parts) for parts in zip(*strokes, strict=True)))


class Decisions(NamedTuple):
    """Iterations after which some tolerance would leave the next step out, were it foreseen to be as small.

    iteration: Its number, from 1. curvature: Next move times edge length over this move squared, the number that
    skip_last.py has a bound for. rate: curvature_rate gamma^2. excess: Curvature over CURVATURE + rate.
    """

    iteration: np.ndarray
    curvature: np.ndarray
    rate: np.ndarray
    excess: np.ndarray
    hub_t: np.ndarray
    stiffness: np.ndarray
    slenderness: np.ndarray


@cache
def decisions(draw):
    seen = stages(draw)
    move, following = seen.move[:, :-1], seen.move[:, 1:]
    rate = seen.stiffness * np.minimum(1.0, seen.slenderness**2 / SLENDER)
    foreseen = move**2 * (CURVATURE + rate) / seen.edge
    asked = (foreseen < move) & (foreseen < LARGEST_TOLERANCE * seen.limb) & (following > ROUNDED * seen.limb)
    chosen = seen.sound[:, :-1] & asked & (seen.phi[:, :-1] <= seen.predictable)

    def those(numbers):
        return np.broadcast_to(numbers, chosen.shape)[chosen]

    curvature = those(following * seen.edge / np.where(chosen, move, 1.0) ** 2)
    return Decisions(
        those(np.arange(1, ITERATIONS)), curvature, those(rate), curvature / (CURVATURE + those(rate)),
        those(seen.hub_t[:, :-1]), those(seen.stiffness), those(seen.slenderness),
    )  # fmt: skip


def before_poles(seen, first, last):
    """Decisions after iterations in (first, last], away from the poles of the hub hinges."""
    return (seen.iteration > first) & (seen.iteration <= last) & (seen.hub_t < FORESEEABLE_T)


def excesses_after(seen, first, last):
    """Curvatures after iterations in (first, last] over what is allowed; LATE counts from EASY on."""
    return (seen.excess / np.where(seen.iteration < EASY, 1.0, LATE))[before_poles(seen, first, last)]


def test_a_step_that_is_left_out_is_as_small_as_foreseen_in_99_of_100_ordinary_stages():
    excesses = excesses_after(decisions(ORDINARY), 0, EASY)
    assert 0.3 < np.quantile(excesses, 0.99) < 1.0
    assert np.quantile(excesses, 0.999) < 2.0 and excesses.max() < 20.0


def test_light_edges_need_the_curvature_in_one_of_1000_stages():
    seen = decisions(ORDINARY)
    light = before_poles(seen, 0, EASY - 1) & (seen.rate < 4.0)
    assert 0.3 * CURVATURE < np.quantile(seen.curvature[light], 0.999) < CURVATURE


def test_slender_stiff_edges_need_the_curvature_rate_in_one_of_1000_stages():
    seen = decisions(LONG)
    stiff = before_poles(seen, 0, EASY - 1) & (seen.slenderness**2 > SLENDER) & (seen.rate > 400.0)
    assert 0.3 < np.quantile(seen.excess[stiff], 0.999) < 1.0


def test_thick_stiff_edges_need_that_the_rate_is_reduced_by_their_slenderness_and_no_further():
    seen = decisions(ORDINARY)
    rate = seen.stiffness * seen.slenderness**2
    thick = before_poles(seen, 0, EASY - 1) & (seen.slenderness < 30.0) & (rate > 1e5)
    needed = 1.0 / np.quantile((seen.curvature - CURVATURE)[thick] / rate[thick], 0.99)
    assert 0.5 * SLENDER < needed < 2.0 * SLENDER


def test_after_the_last_easy_step_one_of_1000_needs_that_it_counts_as_late():
    seen = decisions(ORDINARY)
    assert 0.3 * LATE < np.quantile(seen.excess[before_poles(seen, EASY - 1, EASY)], 0.999) < LATE


def test_only_the_easy_steps_foresee_anything_where_robots_move_violently():
    assert np.quantile(excesses_after(decisions(VIOLENT), EASY - 1, EASY), 0.999) < 1.0
    assert np.quantile(excesses_after(decisions(VIOLENT), EASY, 10.0 * EASY), 0.999) > 1e3


@pytest.mark.parametrize("low, high, foreseen", [(0.25, 1.0, True), (2.5, 10.0, False)])
def test_steps_are_foreseen_up_to_the_largest_hub_t_and_ever_worse_beyond(low, high, foreseen):
    seen, t = decisions(THICK_NEAR_POLES), FORESEEABLE_T
    near = (seen.iteration < EASY) & (seen.hub_t > low * t) & (seen.hub_t <= high * t)
    assert (np.quantile(seen.excess[near], 0.99) < 2.0) == foreseen


def test_drag_takes_what_predictable_steps_create_and_not_what_more_energetic_ones_do():
    seen = stages(NEAR_POLES)
    converged = seen.sound[:, -1:] & (seen.move[:, -1:] < 1e-9 * seen.limb) & (seen.damped > 0.0)
    last = np.argmax(seen.move < 1e-8 * seen.limb, axis=1)[:, None]
    phi = np.take_along_axis(seen.phi, last, axis=1) / np.where(seen.damped > 0.0, seen.damped, np.nan)
    shares = [np.mean(seen.gained[converged & (phi > low) & (phi <= 10.0 * low)] > 1e-9) for low in (0.1, 1.0)]
    assert shares[0] < 5e-4 < shares[1] and PREDICTABLE_STRAIN > 0.0
