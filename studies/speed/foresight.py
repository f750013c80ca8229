"""How well the size of a Newton step that is left out is foreseen: `python -m studies.speed.foresight`.

Drawn robots make strokes by plain Newton steps that leave nothing out. For every iteration that could have been the
last of a stage, the study compares the next step with what der/stepping/foresight.py allows, and prints every constant
of that file beside what was measured.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from tqdm import tqdm

from seastar_gym.command import run_command
from seastar_gym.der.energy import elastic_energy
from seastar_gym.der.potential import factorise
from seastar_gym.der.rods import make_work
from seastar_gym.der.stepping import foresight, scales
from seastar_gym.der.stepping.newton import ROUNDING, take_step
from seastar_gym.der.stepping.schemes import SCHEMES
from seastar_gym.der.stepping.stages import begin_stage, end_step
from seastar_gym.der.terms.hub import Actuation, set_natural_hub_angles
from seastar_gym.der.terms.inertia import kinetic_energy
from seastar_gym.model.coefficients import Coefficients
from seastar_gym.scene import Scene, Seastar, SmaPulse, Water
from seastar_gym.scene.robot import Discretisation, HubHinge
from seastar_gym.simd.compilation import entry_point
from seastar_gym.simd.lanes import N_LANES, borrow, load, splat, store
from seastar_gym.simd.rows import aligned_rows
from studies.parser import study_parser

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Range = tuple[float, float]

ITERATIONS, STEPS, RAMP = 6, 60, 6
"""Newton steps of a stage, stages of a drawn stroke, and stages between two corners of its rotations."""
TRACED = 4  # numbers that are kept of an iteration
LARGEST_TOLERANCE, ROUNDED = 1e-2, 1e-13
"""Limb lengths: the largest Newton tolerance that a scene may have, and moves that are rounding."""
LIGHT, STIFF = 4.0, 400.0
"""Values of curvature_rate gamma^2 that are small, and large, beside a curvature of some tens."""


@entry_point
def trace(rods, work, scheme, actuation, q, v, a, rotations, h, iterations, energies):
    """Steps of implicit Euler by plain Newton, every one of as many iterations.

    rotations: Of the limbs at the ends of the steps [rad], shape (n_steps, n_limbs, N_LANES). h: Steps [s], per robot.
    iterations: Out: move [m], Phi [J], largest hub t and smallest pivot of every iteration, in rows of each step.
    energies: Out: energy [J] that a step may end with, and ends with, shape (n_steps, 2, N_LANES).
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
            store(seen, TRACED * i + 2, foresight.largest_hub_t(rows, memory))
            store(seen, TRACED * i + 3, pivot)
        end_step(rows, memory, tableau, stage, q_rows, v_rows, a_rows, gamma, everyone)
        store(energy, 1, elastic_energy(rows, memory, q_rows) + kinetic_energy(rows, v_rows, (zero, zero)))


@dataclass(frozen=True)
class Draw:
    """Ranges that robots, their strokes and their steps are drawn from; all but the peak on a logarithmic scale.

    slenderness: Edge length over radius. modulus [Pa], density [kg/m^3], gamma [s]. nodes, limbs: Numbers to choose.
    hinges: Measures of hub hinges to choose from. peak: Largest rotation, as a share of what the hub hinges allow.
    speed: Standard deviation of the nodes' velocities at the start, in limb lengths per step. strain: The same of their
    displacements, in edge lengths.
    """

    slenderness: Range = (3.0, 50.0)
    modulus: Range = (1e4, 1e8)
    density: Range = (700.0, 2000.0)
    gamma: Range = (1e-4, 2e-2)
    nodes: tuple[int, ...] = (3, 5, 10, 20, 40)
    limbs: tuple[int, ...] = (3, 4, 5, 6, 7)
    hinges: tuple[HubHinge, ...] = ("opening", "turning")
    peak: Range = (0.02, 0.95)
    speed: Range = (1e-6, 1e-3)
    strain: Range = (1e-6, 1e-2)


STROKES = Draw()
LONG = Draw(slenderness=(70.0, 500.0))
VIOLENT = Draw(speed=(1e-2, 1.0))
NEAR_POLES = Draw(hinges=("opening",), peak=(0.9, 0.999))
THICK_NEAR_POLES = Draw(slenderness=(3.0, 12.0), nodes=(3, 5), limbs=(3,), hinges=("opening",), peak=(0.9, 0.999))
"""Ordinary strokes; long thin edges; violent motion; hub hinges near their poles; the same of thick limbs."""


class Stages(NamedTuple):
    """Stages of plain Newton, one per row.

    move [m], phi [J], hub_t: Of every iteration, shape (n, ITERATIONS); those before its step, but for the move.
    sound: Iterations up to which no step would have been shortened or needed a convex matrix.
    limb, edge: Lengths [m]. stiffness: E gamma^2/(rho l^2) [1]. slenderness: Edge length over radius.
    strain_energy: EA times the length of all limbs [J]. damped: Share of PREDICTABLE_STRAIN that drag makes harmless.
    gained: Energy beyond the one allowed, over the allowed one.
    """

    move: Floats
    phi: Floats
    hub_t: Floats
    sound: Mask
    limb: Floats
    edge: Floats
    stiffness: Floats
    slenderness: Floats
    strain_energy: Floats
    damped: Floats
    gained: Floats


def logarithmic(rng: np.random.Generator, ends: Range) -> Floats:
    low, high = ends
    return np.exp(rng.uniform(np.log(low), np.log(high), N_LANES))


def drawn_rotations(draw: Draw, room: float, n_limbs: int, rng: np.random.Generator) -> Floats:
    """Rotations of limbs along straight ramps between random corners [rad], shape (STEPS, n_limbs, N_LANES)."""
    corners = rng.uniform(-1.0, 1.0, (STEPS // RAMP + 1, n_limbs, N_LANES))
    corners = np.where(rng.random(N_LANES) < 0.5, np.round(corners), corners)
    corners *= 0.5 * room * rng.uniform(*draw.peak, N_LANES)
    corners[0] = 0.0
    ramp, step = np.divmod(np.arange(STEPS), RAMP)
    share = ((step + 1) / RAMP)[:, None, None]
    return np.ascontiguousarray((1.0 - share) * corners[ramp] + share * corners[ramp + 1])


def drawn_stages(draw: Draw, rng: np.random.Generator, discretisation: Discretisation) -> Stages:
    """Stages of one stroke of N_LANES robots."""
    nodes, n_limbs = int(rng.choice(draw.nodes)), int(rng.choice(draw.limbs))
    hinge = draw.hinges[rng.integers(len(draw.hinges))]
    room = np.pi - 2.0 * np.pi / n_limbs if hinge == "opening" else 2.0 * np.pi / n_limbs
    if discretisation == "continuum":
        hinge, room = "opening", np.pi
    limb, slenderness = logarithmic(rng, (0.03, 0.3)), logarithmic(rng, draw.slenderness)
    modulus, density, gamma = (logarithmic(rng, ends) for ends in (draw.modulus, draw.density, draw.gamma))
    edge = limb / (nodes - 1)
    length, radius, E, rho = (tuple(each.tolist()) for each in (limb, edge / slenderness, modulus, density))
    robot = Seastar(n_limbs, nodes, length, radius, E, rho, hinge, discretisation=discretisation)
    rotations = drawn_rotations(draw, room, n_limbs, rng)
    fluid = None if rng.random() < 0.3 else Water()
    coefficients = Coefficients(Scene(robot, fluid, SmaPulse(0.01)), N_LANES)
    rods, q = coefficients.rods(0), coefficients.rest[0].copy()
    v = logarithmic(rng, draw.speed) * limb / gamma * rng.standard_normal(q.shape)
    q += logarithmic(rng, draw.strain) * edge * rng.standard_normal(q.shape)
    turned = Actuation(aligned_rows(n_limbs, N_LANES), aligned_rows(n_limbs, N_LANES))
    iterations, energies = aligned_rows(STEPS, TRACED * ITERATIONS, N_LANES), aligned_rows(STEPS, 2, N_LANES)
    a = aligned_rows(len(q) + 3, N_LANES)
    scheme = SCHEMES["implicit-euler"]
    trace(rods, make_work(rods, 1), scheme, turned, q, v, a, rotations, gamma[None].copy(), iterations, energies)
    move, phi, hub_t, pivot = iterations.transpose(0, 2, 1).reshape(-1, ITERATIONS, TRACED).transpose(2, 0, 1)
    allowed, found = energies.transpose(1, 0, 2).reshape(2, -1)

    def each(numbers: Floats) -> Floats:
        return np.tile(numbers, STEPS)

    return Stages(
        move, phi, hub_t, without_setbacks(move, phi, pivot),
        each(limb), each(edge), each(modulus / density * (gamma / edge) ** 2), each(slenderness),
        each(rods.scales.predictable[0] / scales.PREDICTABLE_STRAIN),
        each(rods.scales.damped[0] / rods.scales.predictable[0]),
        (found - allowed) / allowed,
    )  # fmt: skip


def without_setbacks(move: Floats, phi: Floats, pivot: Floats) -> Mask:
    before = np.concatenate([np.full((len(phi), 1), np.inf), phi[:, :-1]], axis=1)
    fine = np.isfinite(move) & (pivot > 0.0) & (phi <= before + ROUNDING * np.abs(phi))
    return np.logical_and.accumulate(fine, axis=1)


def sample(
    draw: Draw, n: int, seed: int, progress: Callable[[range], Any] = iter, discretisation: Discretisation = "chapter"
) -> Stages:
    """Stages of n strokes, of N_LANES robots each."""
    rng = np.random.default_rng(seed)
    with np.errstate(all="ignore"):  # plain Newton may fail
        strokes = [drawn_stages(draw, rng, discretisation) for _ in progress(range(n))]
    return Stages(*(np.concatenate(parts) for parts in zip(*strokes, strict=True)))


def curvature_rate(stages: Stages) -> Floats:
    """curvature_rate gamma^2 of foresight.py [1], shape (n, 1)."""
    rate = stages.stiffness * np.minimum(1.0, stages.slenderness**2 / scales.SLENDER)
    return rate[:, None]


class Decisions(NamedTuple):
    """Iterations after which the next step might be left out, in one row.

    iteration: Its number, from 1. curvature: Next move times edge length over this move squared, the number that
    foresight.py has a bound for. rate: curvature_rate gamma^2. excess: Curvature over CURVATURE + rate.
    """

    iteration: NDArray[np.int_]
    curvature: Floats
    rate: Floats
    excess: Floats
    hub_t: Floats
    stiffness: Floats
    slenderness: Floats


def decisions(stages: Stages) -> Decisions:
    """Iterations whose next step some tolerance would leave out, were it foreseen to be as small.

    That tolerance is below the present move, and a scene may have it; the next move is more than rounding.
    """
    move, following = stages.move[:, :-1], stages.move[:, 1:]
    limb, edge, rate = stages.limb[:, None], stages.edge[:, None], curvature_rate(stages)
    foreseen = move**2 * (foresight.CURVATURE + rate) / edge
    asked = (foreseen < move) & (foreseen < LARGEST_TOLERANCE * limb) & (following > ROUNDED * limb)
    small = stages.phi[:, :-1] <= scales.PREDICTABLE_STRAIN * stages.strain_energy[:, None]
    chosen = stages.sound[:, :-1] & asked & small

    def those(numbers: NDArray[Any]) -> Any:
        return np.broadcast_to(numbers, chosen.shape)[chosen]

    curvature = those(following * edge / np.where(chosen, move, 1.0) ** 2)
    return Decisions(
        those(np.arange(1, ITERATIONS)), curvature, those(rate), curvature / (foresight.CURVATURE + those(rate)),
        those(stages.hub_t[:, :-1]), those(stages.stiffness[:, None]), those(stages.slenderness[:, None]),
    )  # fmt: skip


def before_poles(seen: Decisions, first: float, last: float) -> Mask:
    """Decisions after iterations in (first, last], away from the poles of the hub hinges."""
    return (seen.iteration > first) & (seen.iteration <= last) & (seen.hub_t < foresight.FORESEEABLE_T)


def curvatures_of_light_edges(seen: Decisions) -> Floats:
    """Curvatures where edges are light, so that CURVATURE alone decides."""
    return seen.curvature[before_poles(seen, 0, foresight.EASY - 1) & (seen.rate < LIGHT)]


def excesses_of_stiff_edges(seen: Decisions) -> Floats:
    """Curvatures over what is allowed, where edges are so slender and stiff that their rate decides."""
    slender = (seen.slenderness**2 > scales.SLENDER) & (seen.rate > STIFF)
    return seen.excess[before_poles(seen, 0, foresight.EASY - 1) & slender]


def thick_and_stiff(seen: Decisions) -> Mask:
    """Decisions where SLENDER decides, whatever it is within a factor of ten."""
    stiff = seen.stiffness * seen.slenderness**2 > 1e5
    return before_poles(seen, 0, foresight.EASY - 1) & (seen.slenderness < 30.0) & stiff


def slenderness_that_thick_edges_need(seen: Decisions, share: float) -> float:
    """The SLENDER that allows this share of the curvatures where edges are thick and stiff."""
    rate, thick = seen.stiffness * seen.slenderness**2, thick_and_stiff(seen)
    return 1.0 / float(np.quantile((seen.curvature - foresight.CURVATURE)[thick] / rate[thick], share))


def late_excesses(seen: Decisions) -> Floats:
    """Curvatures after the last easy step over what is allowed before it, which LATE multiplies."""
    return seen.excess[before_poles(seen, foresight.EASY - 1, foresight.EASY)]


def excesses_after(seen: Decisions, first: float, last: float) -> Floats:
    """Curvatures after iterations in (first, last] over what is allowed; LATE counts from EASY on."""
    late = np.where(seen.iteration < foresight.EASY, 1.0, foresight.LATE)
    return (seen.excess / late)[before_poles(seen, first, last)]


def excesses_near_poles(seen: Decisions, low: float, high: float) -> Floats:
    """Curvatures over what is allowed, before the last easy step, where the largest hub t is in (low, high]."""
    return seen.excess[(seen.iteration < foresight.EASY) & (seen.hub_t > low) & (seen.hub_t <= high)]


def gains(stages: Stages, low: float, high: float) -> Floats:
    """Energy that steps in water created, over the allowed one, by plain Newton that needed no help.

    low, high: Range of Phi before the last step that is taken, in units of the potential up to which it is not looked
    at.
    """
    converged = stages.sound[:, -1] & (stages.move[:, -1] < 1e-9 * stages.limb)
    last = np.argmax(stages.move < 1e-8 * stages.limb[:, None], axis=1)
    unit = scales.PREDICTABLE_STRAIN * stages.strain_energy * stages.damped
    phi = np.take_along_axis(stages.phi, last[:, None], axis=1)[:, 0] / np.where(unit > 0.0, unit, np.nan)
    return stages.gained[converged & (phi > low) & (phi <= high)]


def share_that_gains(stages: Stages, low: float, high: float) -> float:
    """Share of such steps that created energy, beyond rounding."""
    return float(np.mean(gains(stages, low, high) > 1e-9))


class Row(NamedTuple):
    """A line of the table: what is measured, over how many decisions, and what was found."""

    what: str
    allowed: str
    n: int
    found: str


def quantiles(numbers: Floats) -> str:
    return " / ".join(f"{x:.3g}" for x in (*np.quantile(numbers, [0.99, 0.999]), numbers.max()))


def ranked(what: str, allowed: float, numbers: Floats) -> Row:
    return Row(what, f"{allowed:g}", len(numbers), quantiles(numbers))


def measure(n: int, seed: int = 0, discretisation: Discretisation = "chapter") -> list[Row]:
    """Everything that the constants decide, from n strokes of every kind.

    The last two kinds are about hub hinges: in the continuum's discretisation, which has none, they are left out.
    """
    strokes, long, violent = (sample(draw, n, seed, tqdm, discretisation) for draw in (STROKES, LONG, VIOLENT))
    ordinary, wild = decisions(strokes), decisions(violent)
    easy, t = foresight.EASY, foresight.FORESEEABLE_T
    need = " / ".join(f"{slenderness_that_thick_edges_need(ordinary, share):.0f}" for share in (0.99, 0.999))
    rows = [
        ranked("next step over the one foreseen", 1.0, excesses_after(ordinary, 0, easy)),
        ranked("CURVATURE: next step l/d^2, light edges", foresight.CURVATURE, curvatures_of_light_edges(ordinary)),
        ranked("curvature_rate: over the one foreseen, stiff edges", 1.0, excesses_of_stiff_edges(decisions(long))),
        Row("SLENDER that thick stiff edges need", f"{scales.SLENDER:g}", thick_and_stiff(ordinary).sum(), need),
        ranked("LATE: third step's, without it", foresight.LATE, late_excesses(ordinary)),
    ]
    for k in range(1, ITERATIONS):
        rows.append(ranked(f"EASY: over the one foreseen after step {k}, violent", 1.0, excesses_after(wild, k - 1, k)))
    if discretisation == "continuum":
        return rows
    near, thick = (sample(draw, n, seed, tqdm) for draw in (NEAR_POLES, THICK_NEAR_POLES))
    polar = decisions(thick)
    for low, high in ((0.25 * t, 0.5 * t), (0.5 * t, t), (t, 2.5 * t), (2.5 * t, 10.0 * t)):
        said = f"FORESEEABLE_T: over the one foreseen, t to {high:g}"
        rows.append(ranked(said, 1.0, excesses_near_poles(polar, low, high)))
    for low in (0.01, 0.1, 1.0, 10.0):
        said = f"PREDICTABLE_STRAIN: steps that gain, energy to {10.0 * low:g} of it"
        found = f"{100.0 * share_that_gains(near, low, 10.0 * low):.2g} % of them"
        rows.append(Row(said, "0", len(gains(near, low, 10.0 * low)), found))
    return rows


def as_table(rows: list[Row]) -> Table:
    """Rows as a table for the terminal."""
    table = Table(title="What the constants of der/stepping/foresight.py allow, and what plain Newton needs")
    table.add_column("measured")
    for name in ("in use", "steps", "99 % / 99.9 % / worst"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(row.what, row.allowed, str(row.n), row.found)
    return table


def main() -> None:
    """Command line: measure and print the table."""
    parser = study_parser("studies.speed.foresight", __doc__)
    parser.add_argument("--strokes", type=int, default=1000, help="drawn strokes of each kind (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the draws (default: %(default)s)")
    parser.add_argument(
        "--discretisation", choices=get_args(Discretisation), default="continuum",
        help="discretisation of the robots (default: %(default)s)",
    )  # fmt: skip
    options = parser.parse_args()
    Console().print(as_table(measure(options.strokes, options.seed, options.discretisation)))


if __name__ == "__main__":
    run_command(main)
