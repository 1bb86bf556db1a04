"""The least squares of light: coefficients that must not be negative."""

import numpy as np
import pytest
from scipy.optimize import nnls

from panostitch.compositing import photometry

# Share of the largest coefficient; both solve the same well-conditioned systems in float64. 2e-12 seen.
SAME = 1e-9


@pytest.mark.parametrize("count", [1, 3, 6, 9])
def test_coefficients_that_may_not_be_negative_are_those_of_scipy(count, rng):
    bounded = 0
    for _ in range(50):
        rows = rng.normal(size=(count + 3, count)) * 10 ** rng.uniform(-2, 2, count)
        square, pull = rows.T @ rows + 1e-6 * np.eye(count), rows.T @ rng.normal(size=count + 3)
        root = np.linalg.cholesky(square)

        found = photometry.not_negative(square, pull)

        truth = nnls(root.T, np.linalg.solve(root, pull))[0]
        assert np.abs(found - truth).max() <= SAME * max(1.0, truth.max())
        assert (found >= 0).all()
        bounded += bool((truth == 0).any())
    assert bounded > 5


def test_a_lens_that_no_overlap_shows_has_no_fall_off():
    assert not photometry.not_negative(np.eye(3), np.zeros(3)).any()
