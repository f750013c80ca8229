"""The Newton step where limbs touch solves the star's matrix plus that of contact."""

import numpy as np
import pytest

from seastar_gym.der.contact.coupled import (
    add_contact_product,
    dot,
    solve_again_coupled,
    solve_coupled,
    solver_iterations,
)
from seastar_gym.der.linear.star_solution import solve_again, substitute_star
from seastar_gym.der.potential import factorise
from seastar_gym.simd.lanes import N_LANES
from seastar_gym.simd.numpy_lanes import Lanes, Mask
from slopes import NO_WORK, plain
from touching import touching_limbs

EVERYONE = np.ones(N_LANES, bool)


def steps(touching, robots=EVERYONE):
    """(the star's step, the coupled one, their decrements)."""
    rods, work = touching.rods, touching.work
    _, alone, _ = factorise.plain(rods, work, touching.stage, None)
    star = np.zeros_like(work.q)
    substitute_star.plain(rods, work, star)
    together = solve_coupled.plain(rods, work, Mask(robots), alone)
    return star, work.contact.x.copy(), plain(alone), plain(together)


@pytest.mark.parametrize("discretisation", ["chapter", "continuum"])
def test_the_step_solves_the_star_and_contact_together(discretisation):
    """H x + C K C^T x = H x_star: what contact takes, solved by the star, is where the two steps differ."""
    touching = touching_limbs(discretisation=discretisation)
    star, x, _, _ = steps(touching)
    taken, moved = np.zeros_like(x), np.zeros_like(x)
    add_contact_product.plain(touching.rods, touching.work, x, -1.0, taken)
    solve_again.plain(touching.rods, touching.work, taken, moved)
    assert np.abs(x - star).max() > 1e-2 * np.abs(star).max()
    np.testing.assert_allclose(x - star, moved, rtol=0.0, atol=1e-5 * np.abs(moved).max())
    assert not touching.work.contact.missed.any()


def test_derivatives_are_solved_to_rounding():
    touching = touching_limbs()
    rods, work = touching.rods, touching.work
    star, x, _, _ = steps(touching)
    iterations, found = plain(solver_iterations.plain(work)), star.copy()
    solve_again_coupled.plain(rods, work, found)
    taken, moved = np.zeros_like(x), np.zeros_like(x)
    add_contact_product.plain(rods, work, found, -1.0, taken)
    solve_again.plain(rods, work, taken, moved)
    np.testing.assert_allclose(found - star, moved, rtol=0.0, atol=1e-9 * np.abs(moved).max())
    np.testing.assert_allclose(found, x, rtol=0.0, atol=1e-4 * np.abs(x).max())
    np.testing.assert_array_equal(plain(solver_iterations.plain(work)), iterations)


def test_contact_makes_the_matrix_stiffer_so_its_decrement_is_smaller():
    _, _, alone, together = steps(touching_limbs())
    assert np.all((together > 0.0) & (together < alone))


def test_robots_that_do_not_touch_or_are_not_asked_keep_the_stars_step_to_the_last_bit():
    asked = np.arange(N_LANES) != N_LANES - 1
    star, x, alone, together = steps(touching_limbs(apart=1), asked)
    kept = [0, N_LANES - 1]
    np.testing.assert_array_equal(x[:, kept], star[:, kept])
    np.testing.assert_array_equal(together[kept], alone[kept])
    assert np.all(together[1:-1] != alone[1:-1])


def test_contacts_matrix_is_symmetric_and_never_negative():
    touching = touching_limbs()
    steps(touching)
    a, b = np.random.default_rng(0).standard_normal((2, *touching.work.q.shape))
    of_a, of_b = np.zeros_like(a), np.zeros_like(b)
    add_contact_product.plain(touching.rods, touching.work, a, 1.0, of_a)
    add_contact_product.plain(touching.rods, touching.work, b, 1.0, of_b)
    np.testing.assert_allclose((a * of_b).sum(axis=0), (b * of_a).sum(axis=0), rtol=1e-9)
    assert np.all((a * of_a).sum(axis=0) > 0.0)


def test_dot_is_the_product_of_rows_robot_by_robot():
    touching = touching_limbs()
    a, b = np.random.default_rng(0).standard_normal((2, *touching.work.q.shape))
    np.testing.assert_allclose(plain(dot.plain(touching.rods, a, b)), (a * b).sum(axis=0), rtol=1e-12)


def test_without_contact_the_decrement_is_the_stars():
    one = Lanes(1.0)
    assert solve_coupled.plain(None, NO_WORK, None, one) is one
    assert not plain(solver_iterations.plain(NO_WORK)).any()


def test_few_iterations_solve_it_as_exactly_as_a_step_of_5_ms_allows(monkeypatch):
    """To 1e-10 of the decrement: about what rounding leaves where edges are that much stiffer than inertia.

    Of convex matrices, since at such a step those of these robots are not positive definite.
    """
    touching, left, product_of = touching_limbs(gamma=5e-3), [], dot.plain
    rods, work = touching.rods, touching.work
    _, alone, _ = factorise.plain(rods, work, touching.stage, Mask(EVERYONE))

    def noted(rods, a, b):
        product = product_of(rods, a, b)
        if a is work.contact.r:
            left.append(plain(product))
        return product

    monkeypatch.setitem(solve_coupled.plain.__globals__, "dot", noted)
    decrement = plain(solve_coupled.plain(rods, work, Mask(EVERYONE), alone))
    assert not work.contact.missed.any() and len(left) < 20
    assert np.any(left[-2] > 1e-10 * decrement)
    assert 1e-11 < (left[-1] / decrement).max() < 1e-10


def test_whoever_does_not_arrive_in_200_iterations_is_missed(monkeypatch):
    touching, iterations = touching_limbs(), []
    rods, work = touching.rods, touching.work
    _, alone, _ = factorise.plain(rods, work, touching.stage, None)

    def never_less(rods, a, b):
        if a is work.contact.r:
            iterations.append(1.0)
        return Lanes(1.0)

    monkeypatch.setitem(solve_coupled.plain.__globals__, "dot", never_less)
    solve_coupled.plain(rods, work, Mask(EVERYONE), alone)
    assert work.contact.missed.all() and len(iterations) == 1 + 200
    assert np.all(plain(solver_iterations.plain(work)) == 200.0)
