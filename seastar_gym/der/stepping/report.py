"""The report of a stroke: counts and extremes of every robot."""

from seastar_gym.simd.compilation import kernel
from seastar_gym.simd.lanes import load, store

# Rows of a lane group's report, shape (len(REPORT_ROWS), N_LANES): what happened to its robots.
REPORT_ROWS = (
    "newton_iterations",
    "solver_iterations",  # of the conjugate gradients where limbs touch, see linear/coupled.py
    "regularised",  # Newton steps that needed the convex matrix
    "backtracks",  # halvings of a Newton step by the line search
    "steps",  # time steps taken
    "halvings",  # halvings of a time step that did not converge
    "rejections",  # halvings of a time step whose error was too large
    "energy_cuts",  # steps after which velocities were cut, see guard.py
    "covered",  # time [s]
    "smallest_hub_t",  # smallest tan(phi/2) of a hub hinge
    "largest_overlap",  # of limbs that touch each other or a body, see contact/crossing.py
)
(
    NEWTON_ITERATIONS, SOLVER_ITERATIONS, REGULARISED, BACKTRACKS, STEPS, HALVINGS, REJECTIONS, ENERGY_CUTS, COVERED,
    SMALLEST_HUB_T, LARGEST_OVERLAP,
) = range(len(REPORT_ROWS))  # fmt: skip

# Rows of a lane group's effort, if it is asked for: work of the actuators [J], the largest moment that resisted one
# [N m] and, limb after limb, the last moments [N m].
WORK, PEAK_MOMENT, MOMENTS = range(3)


@kernel
def add_to_report(report, row, amount):
    store(report, row, load(report, row) + amount)


@kernel
def iterations_spent(report):
    """Iterations that count towards a robot's bound on work: of Newton's method, and of the linear solver within it."""
    return load(report, NEWTON_ITERATIONS) + load(report, SOLVER_ITERATIONS)
