"""Intervals of a fit hold what they promise where residuals depend on each other, and where they do not."""

import numpy as np
import pytest
from scipy.stats import norm

from seastar_gym.identify import covariance as module
from seastar_gym.identify.covariance import uncertainty_of


def line(n_pictures: int) -> tuple[np.ndarray, np.ndarray]:
    """Times of pictures of two coordinates, and the derivative of a straight line and an oscillation."""
    times = np.repeat(np.arange(n_pictures) * 0.05, 2)
    return times, np.stack([np.ones_like(times), times, np.sin(3.0 * times)], axis=1)


def coverage(memory: float, n_pictures: int = 400) -> np.ndarray:
    """Share of 400 fits whose 95 % interval has the truth, shape (p,). memory: Of errors, from picture to picture."""
    times, jacobian = line(n_pictures)
    rng, held = np.random.default_rng(0), []
    fit = np.linalg.pinv(jacobian)
    for _ in range(400):
        errors = np.empty((n_pictures, 2))
        errors[0] = rng.normal(size=2)
        for picture in range(1, n_pictures):
            errors[picture] = memory * errors[picture - 1] + np.sqrt(1.0 - memory**2) * rng.normal(size=2)
        wrong = fit @ errors.ravel()
        covariance = uncertainty_of(jacobian, errors.ravel() - jacobian @ wrong, times).covariance
        held.append(np.abs(wrong) < norm.ppf(0.975) * np.sqrt(np.diag(covariance)))
    return np.mean(held, axis=0)


def test_intervals_hold_where_errors_depend_on_those_before(monkeypatch):
    """Errors are remembered for 0.2 s of 20. Intervals of independent errors hold the truth in six of ten fits."""
    assert coverage(0.8).min() > 0.85
    monkeypatch.setattr(module, "REMEMBERED", 1e-6)
    assert coverage(0.8).max() < 0.8


def test_intervals_hold_where_errors_are_independent():
    assert coverage(0.0).min() > 0.93


def test_the_covariance_is_at_least_that_of_independent_errors():
    times, jacobian = line(50)
    residuals = np.random.default_rng(1).normal(size=100)
    independent = residuals @ residuals / 97 * np.linalg.inv(jacobian.T @ jacobian)
    found = uncertainty_of(jacobian, residuals, times).covariance
    assert np.linalg.eigvalsh(found - independent).min() > -1e-12 * np.trace(found)


def test_errors_that_are_the_same_in_both_coordinates_count_once():
    """Errors of one picture may depend on each other: means of n equal pairs have variance 1/n."""
    times = np.repeat(np.arange(2000.0), 2)
    errors = np.repeat(np.random.default_rng(2).normal(size=2000), 2)
    found = uncertainty_of(np.ones((4000, 1)), errors - errors.mean(), times).covariance
    assert found[0, 0] == pytest.approx(1.0 / 2000.0, rel=0.6) and found[0, 0] > 0.7 / 2000.0


def test_what_the_data_do_not_tell_has_a_huge_variance():
    times, jacobian = line(50)
    jacobian[:, 2] = 0.0
    found = uncertainty_of(jacobian, np.ones(100), times).covariance
    assert np.isfinite(found).all() and found[2, 2] > 1e100
    assert uncertainty_of(jacobian[:, :2], np.zeros(100), times).covariance.max() == 0.0


def test_residuals_of_zero_have_the_correlation_of_independent_errors():
    """And of what the data do not tell, every parameter correlates with itself."""
    times, jacobian = line(50)
    inverse = np.linalg.inv(jacobian.T @ jacobian)
    scale = np.sqrt(np.diag(inverse))
    found = uncertainty_of(jacobian, np.zeros(100), times)
    np.testing.assert_allclose(found.correlation, inverse / np.outer(scale, scale), atol=1e-9)
    assert (found.covariance == 0.0).all() and (found.errors == 0.0).all()
    jacobian[:, 1:] = 0.0
    np.testing.assert_allclose(np.diag(uncertainty_of(jacobian, np.ones(100), times).correlation), 1.0)
