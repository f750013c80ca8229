"""One time step: its stages, its error, and the guard's verdict on the energy that it ends with."""

from typing import Any, NamedTuple

from seastar_gym.der.body.body import freeze_body
from seastar_gym.der.body.forces import add_work_on_body
from seastar_gym.der.contact.broad_phase import freeze_contact
from seastar_gym.der.contact.coupled import solver_iterations
from seastar_gym.der.contact.crossing import without_new_crossings
from seastar_gym.der.stepping.guard import (
    LARGEST_CUT,
    add_work_of_loads,
    allowed_energy,
    frame_velocity,
    hold_to_energy,
    may_gain,
    restore,
    save,
    through_poles,
)
from seastar_gym.der.stepping.momentum import correct_momentum
from seastar_gym.der.stepping.newton import minimise
from seastar_gym.der.stepping.report import (
    BACKTRACKS,
    ENERGY_CUTS,
    NEWTON_ITERATIONS,
    REGULARISED,
    SOLVER_ITERATIONS,
    add_to_report,
    iterations_spent,
)
from seastar_gym.der.stepping.stages import (
    LAST_STEP,
    begin_stage,
    end_stage,
    end_step,
    guessed_motion,
    memory_row,
    start_at_rest,
    step_error,
)
from seastar_gym.der.terms.damping import freeze_strains
from seastar_gym.der.terms.fluid import add_work_of_current, freeze_fluid
from seastar_gym.der.terms.hub import set_natural_hub_angles
from seastar_gym.simd.compilation import inlined_kernel, kernel
from seastar_gym.simd.lanes import any_lane, load, load_number, select, splat, store

MOST_HALVINGS = 12.0  # a robot whose step fails once more has failed
TURNABLE = 8.0  # after so many halvings, a choice, hinges may go through their poles, see guard.py
SMALLEST_FRACTION = 2.0**-12  # of an interval: there is no shorter step


class Step(NamedTuple):
    """A time step of every robot; lanes.

    start, size: Its beginning and its length, as shares of the interval. h: Its length [s].
    iteration_limit: Most Newton iterations of a stage.
    retrying: Mask of the robots that halved a step of this interval.
    """

    start: Any
    size: Any
    h: Any
    iteration_limit: Any
    retrying: Any


@kernel
def try_step(rods, work, scheme, actuation, q, v, a, step, active, limits, report):
    """One step for the robots in the mask `active`.

    a: Memory from one step to the next, see LAST_STEP and SIZE; read at the beginning and written at the end.

    Returns (good, accepted, error rate): the mask of the robots whose stages all converged and created no energy, that
    of those whose error is small enough besides, whose state has moved, and the error per time [m/s], zero if steps are
    not adapted.
    """
    good, guarded, stage = solve_stages(rods, work, scheme, actuation, q, v, a, step, active, limits, report)
    accepted, error_rate, last_h = good, splat(0.0), memory_row(rods, scheme, LAST_STEP)
    if limits.adaptive and not scheme.dissipative:
        error_rate = step_error(rods, work, stage, a, step.h, load(a, last_h)) / step.h
        small = (error_rate <= load(limits.error_rate, 0)) | (step.size <= SMALLEST_FRACTION)
        accepted = good & small
        store(a, last_h, select(accepted, step.h, load(a, last_h)))
    guarded = accepted & guarded
    if not any_lane(guarded):
        end_step(rods, work, scheme, stage, q, v, a, step.h, accepted)
        return good, accepted, error_rate
    refused = end_guarded_step(rods, work, scheme, actuation, q, v, a, step, stage, accepted, guarded, limits, report)
    return good & ~refused, accepted & ~refused, error_rate


@inlined_kernel
def solve_stages(rods, work, scheme, actuation, q, v, a, step, active, limits, report):
    """Solve the stages of a step for the robots in the mask `active`.

    Returns (good, guarded, stage): the masks of the robots whose stages all converged, and of those whose energy has to
    be looked at; the last stage.
    """
    good, guarded = active, step.retrying
    tolerance = load(limits.tolerance, 0)
    for k in range(scheme.n_stages):
        stage = begin_stage(rods, work, scheme, k, q, v, a, step.h)
        freeze_contact(rods, work, stage, q)
        freeze_body(rods, work, stage, guessed_motion(rods, scheme, k, stage, a))
        if any_lane(step.retrying):
            start_at_rest(rods, work, stage, frame_velocity(rods, q, v), step.retrying)
        freeze_fluid(rods, work)
        set_natural_hub_angles(rods, work, actuation, step.start + load_number(scheme.c, k) * step.size)
        freeze_strains(rods, work, stage.q_hat)
        left = limits.most_iterations - iterations_spent(report)
        most, good = select(left < step.iteration_limit, left, step.iteration_limit), good & (left > 0.0)
        good, phi, iterations, regularised, backtracks = minimise(rods, work, stage, good, tolerance, most)
        correct_momentum(rods, work, scheme, k, stage, q, v, step.h, good)
        good = without_new_crossings(rods, work, stage, q, good)
        guarded = guarded | (regularised + backtracks > 0.0)
        if scheme.dissipative:
            guarded = guarded | those_that_may_gain(rods, work, stage, phi, good & ~guarded)
        add_to_report(report, NEWTON_ITERATIONS, iterations)
        add_to_report(report, SOLVER_ITERATIONS, solver_iterations(work))
        add_to_report(report, REGULARISED, regularised)
        add_to_report(report, BACKTRACKS, backtracks)
        if k < scheme.n_stages - 1:
            end_stage(rods, work, scheme, k, stage, a, active)
    return good, guarded, stage


@inlined_kernel
def those_that_may_gain(rods, work, stage, phi, robots):
    """Mask of robots with so much energy that drag may not take what a step of implicit Euler creates.

    robots: Mask of those that Newton's method has nothing to say about; of the predictable ones among them only those
    are meant whose potential leaves room for it.
    """
    energetic = phi > load(rods.scales.damped, 0)
    predictable = robots & energetic & (phi <= load(rods.scales.predictable, 0))
    if any_lane(predictable):
        gaining = may_gain(rods, work, stage, phi, predictable)
        energetic = (energetic & ~predictable) | gaining
    return energetic


@kernel
def end_guarded_step(rods, work, scheme, actuation, q, v, a, step, stage, accepted, guarded, limits, report):
    """End a step of the robots in the mask `accepted`, and hold those in `guarded` to their energy.

    Returns the mask of the robots whose step was refused and undone.
    """
    save(rods, work, scheme, q, v)
    frame = frame_velocity(rods, q, v)
    allowed = allowed_energy(rods, work, scheme, actuation, step.start, step.start + step.size, q, v, frame)
    end_step(rods, work, scheme, stage, q, v, a, step.h, accepted)
    largest_cut = select(step.iteration_limit > MOST_HALVINGS * limits.max_iterations, splat(1.0), LARGEST_CUT)
    allowed = add_work_of_current(rods, work, v, step.h, frame, allowed)
    allowed = add_work_of_loads(rods, work, q, step.h, frame, allowed)
    allowed = add_work_on_body(rods, work, work.step, q, v, step.h, frame, allowed)
    refused, cut = hold_to_energy(rods, work, scheme, q, v, step.h, frame, guarded, allowed, largest_cut)
    turnable = guarded & (step.iteration_limit <= TURNABLE * limits.max_iterations)
    refused = refused | through_poles(rods, work, q, turnable)
    if any_lane(refused):
        restore(rods, work, scheme, q, v, refused)
    add_to_report(report, ENERGY_CUTS, select(cut, splat(1.0), splat(0.0)))
    return refused
