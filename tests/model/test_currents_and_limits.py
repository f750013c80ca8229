"""Currents and the solver's limits are those of the scene, in numbers that kernels read."""

import numpy as np
import pytest

from seastar_gym import GridCurrent, Numerics, Scene, Seastar, ShearCurrent, SmaPulse, UniformCurrent, Vortex
from seastar_gym.der.terms.current import current_velocity
from seastar_gym.model.currents import current_rows
from seastar_gym.model.rods import make_limits
from seastar_gym.scene.numerics import ADAPTATION, MOST_ITERATIONS, MOST_ITERATIONS_PER_STEP
from seastar_gym.simd.numpy_lanes import Lanes
from slopes import plain

X, Y = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 9))
ALONG = -X * np.sin(0.7) + Y * np.cos(0.7)
FROM_CENTRE = np.array([-(Y + 0.2), X - 0.1]) / ((X - 0.1) ** 2 + (Y + 0.2) ** 2 + 0.07**2)
CURRENTS = {
    "uniform": (UniformCurrent(0.02, -0.03), np.outer([0.02, -0.03], np.ones(9))),
    "shear": (ShearCurrent(0.4, 0.7), 0.4 * ALONG * np.array([[np.cos(0.7)], [np.sin(0.7)]])),
    "vortex": (Vortex(0.3, 0.1, -0.2, 0.07), 0.3 / (2.0 * np.pi) * FROM_CENTRE),
    "grid": (
        GridCurrent.from_function(lambda x, y: (2.0 * x - y, x + 3.0 * y), (-0.4, 0.4), (-0.5, 0.4), 0.1),
        np.array([2.0 * X - Y, X + 3.0 * Y]),
    ),
}


@pytest.mark.parametrize("name", CURRENTS)
def test_a_current_flows_everywhere_as_its_formula_says(name):
    current, expected = CURRENTS[name]
    found = plain(current_velocity.plain(current_rows(current), Lanes(X), Lanes(Y)))
    for component, velocity in zip(found, expected, strict=True):
        np.testing.assert_allclose(np.broadcast_to(component, 9), velocity, rtol=1e-12, atol=1e-15)


def test_limits_are_in_limb_lengths_and_in_steps_begun():
    numerics = Numerics("implicit-midpoint", 0.3, newton_tolerance=1e-6, max_iterations=17, path_tolerance=0.01)
    limits = make_limits(Scene(Seastar(limb_length=0.2), actuator=SmaPulse(0.3, 0.5, 1.5), numerics=numerics))
    assert limits.tolerance == pytest.approx(0.2e-6) and limits.max_iterations == 17 and limits.adaptive
    assert limits.most_iterations == MOST_ITERATIONS + 7 * MOST_ITERATIONS_PER_STEP
    assert limits.error_rate == pytest.approx(0.2 / 2.0 * (0.01 / ADAPTATION[0]) ** ADAPTATION[1])
    fixed = make_limits(Scene(numerics=Numerics("implicit-midpoint", 0.01)))
    assert not fixed.adaptive and fixed.error_rate == 0.0
