"""Blocks in a sparse matrix are the sums they stand for."""

import numpy as np
import pytest

from panostitch.alignment.normal_equations import FIXED, assembled, pair_products, pattern

EXACT = 1e-12  # of entries of about ten: sums of some dozen float64 numbers
SOLVED = 1e-9  # of a well-conditioned system

# of four pairs; an unknown twice in one pair stands for a lens that both photos share
COLUMNS = np.array([[0, 1, 4], [1, 2, 4], [FIXED, 3, 4], [2, 5, 5]])
SIZE = 7  # the last one is seen by nobody


def blocks(rng):
    """Positive definite blocks (4, 3, 3) and gradients (4, 3)."""
    half = rng.normal(size=(4, 5, 3))
    return half.transpose(0, 2, 1) @ half, rng.normal(size=(4, 3))


def dense(squares, gradients):
    matrix, right = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
    for columns, block, part in zip(COLUMNS, squares, gradients, strict=True):
        for a, row in enumerate(columns):
            if row == FIXED:
                continue
            right[row] += part[a]
            for b, column in enumerate(columns):
                if column != FIXED:
                    matrix[row, column] += block[a, b]
    return matrix, right


def unfolded(equations):
    """The matrix (SIZE, SIZE) that is stored sparsely."""
    places, matrix = equations.pattern, np.zeros((SIZE, SIZE))
    for column, (begin, end) in enumerate(zip(places.indptr[:-1], places.indptr[1:], strict=True)):
        matrix[places.indices[begin:end], column] = equations.values[begin:end]
    return matrix


def test_sparse_is_dense(rng):
    squares, gradients = blocks(rng)

    equations = assembled(pattern(COLUMNS, SIZE), squares, gradients)

    matrix, right = dense(squares, gradients)
    np.testing.assert_allclose(unfolded(equations), matrix, atol=EXACT)
    np.testing.assert_allclose(equations.gradient, right, atol=EXACT)
    assert equations.pattern.stored < 0.6 * SIZE**2


@pytest.mark.parametrize("damping", [1e-6, 1e-3, 10.0])
def test_the_damped_step_is_that_of_the_dense_equations(damping, rng):
    squares, gradients = blocks(rng)
    step = assembled(pattern(COLUMNS, SIZE), squares, gradients).step(damping)

    matrix, right = dense(squares, gradients)
    seen = slice(0, SIZE - 1)
    damped = matrix[seen, seen] + damping * np.diag(np.diag(matrix)[seen])
    np.testing.assert_allclose(step[seen], np.linalg.solve(damped, -right[seen]), rtol=0, atol=SOLVED)


def test_an_unknown_that_nobody_sees_stays(rng):
    assert assembled(pattern(COLUMNS, SIZE), *blocks(rng)).step(1e-3)[-1] == 0


def test_a_prior_is_added_to_the_diagonal(rng):
    squares, gradients = blocks(rng)
    equations = assembled(pattern(COLUMNS, SIZE), squares, gradients)
    stiffness, pull = rng.uniform(1, 2, (2, SIZE))

    held = equations.plus(stiffness, pull)

    np.testing.assert_allclose(unfolded(held) - unfolded(equations), np.diag(stiffness), atol=EXACT)
    np.testing.assert_allclose(held.gradient - equations.gradient, pull, atol=EXACT)


def test_products_of_each_pair(rng):
    jacobian, value = rng.normal(size=(2, 4, 9)), rng.normal(size=(2, 9))

    squares, gradients = pair_products(jacobian, value, np.array([0, 3, 8]))

    for n, rows in enumerate((slice(0, 3), slice(3, 8), slice(8, 9))):
        flat = jacobian[:, :, rows].transpose(0, 2, 1).reshape(-1, 4)
        np.testing.assert_allclose(squares[n], flat.T @ flat, atol=EXACT)
        np.testing.assert_allclose(gradients[n], flat.T @ value[:, rows].reshape(-1), atol=EXACT)
