"""When Newton's last step may be left out, because quadratic convergence foretells that it would be small enough.

After one of its first steps, of size d, the next is expected to be at most d^2/(quadratic length). That is measured,
not proved: by `python -m studies.speed.foresight --discretisation chapter` at commit 0e818f3, in 1000 strokes of every
kind by eight robots, stiff and soft, with edges of 3 to 50 radii, at steps of 0.1 to 20 ms, in water and in vacuum. Had
every step been just small enough, the one left out would have been

    99 %     99.9 %    worst
    0.7      1.6       18       times as large as foreseen
    19       43        190      times d^2 over the edge length, where edges are light: CURVATURE
    0.4      0.9       2        times as large as foreseen, where edges of 70 to 500 radii are stiff against inertia
    2900     840                as SLENDER would allow for it, where edges are thick and stiff
    1.9      4.3       23       times as large as foreseen without LATE, after the third step
    0.2      0.5       1e3      times as large as foreseen after the third step, EASY, in violent motion
    0.4      1e6       2e8      the same after the fifth
    1.2      3         40       times as large where the largest hub t is 2 to 4, which is FORESEEABLE_T, of thick limbs
    3.7      24        30       the same from 10 to 40

With a rigid hub, which has no poles, the numbers of the first, second, third and fifth line are 0.9, 1.8 and 9; 26, 51
and 220 times d^2 over the edge length; 0.8, 1.7 and 3; 2.6, 5.8 and 15 (300 strokes of every kind).

In water with hub hinges near their poles, steps from potentials below a tenth of that of PREDICTABLE_STRAIN created no
energy; 0.02 % did up to PREDICTABLE_STRAIN, 0.1 % up to ten times and 0.5 % up to a hundred times as much. Where the
curvature of drag, about l rho_f C_d/(pi r rho_m), is ten times CURVATURE, as with edges of a thousand radii, no step is
left out: one that was had been 300 times the tolerance.
"""

from seastar_gym.der.contact.contact import not_touching
from seastar_gym.der.geometry import larger
from seastar_gym.simd.compilation import inlined_kernel, kernel
from seastar_gym.simd.lanes import load, select, splat

CURVATURE = 40.0  # for light edges, the step after one of size d is below this times d^2 over the edge length
EASY = 3.0  # Newton steps: a stage that took more is not predictable
LATE = 10.0  # times CURVATURE for the last of the easy steps
FORESEEABLE_T = 4.0  # larger values of tan(phi/2) are too near its pole for that


@inlined_kernel
def can_skip(rods, work, iterations, setbacks, phi, move, tolerated):
    """Mask of the robots whose next Newton step is expected to be small enough.

    iterations, setbacks: Newton steps so far, and how many of them were shortened or needed a convex matrix. phi:
    Potential before the step [J]. move: Largest node move of the step [m]. tolerated: Tolerance times the quadratic
    length [m^2].
    """
    easy = (setbacks <= 0.0) & (iterations <= EASY) & (phi <= load(rods.scales.predictable, 0))
    easy = not_touching(work, easy)
    late = select(iterations < EASY, splat(1.0), LATE)
    foreseen = late * move * move <= tolerated
    return easy & foreseen & (largest_hub_t(rods, work) < FORESEEABLE_T)


@kernel
def quadratic_length(rods, stage):
    """Length [m] that a Newton step's square is divided by to foresee the size of the next one.

    Turning an edge stretches it, and the tension that this makes moves nodes the farther, the stiffer the edges are
    against the nodes' inertia.
    """
    rate = load(rods.scales.curvature_rate, 0)
    return load(rods.scales.shortest_edge, 0) / (CURVATURE + rate * stage.gamma * stage.gamma)


@kernel
def largest_hub_t(rods, work):
    """Largest tan(phi/2) of the hub hinges, as last assembled."""
    largest = load(work.hub_t, 0)
    for limb in range(1, rods.n_limbs):
        largest = larger(load(work.hub_t, limb), largest)
    return largest
