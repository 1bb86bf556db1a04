"""How exact the residual of a match is, when the points of both photos are inexact by as many pixels.

A point p of photo i goes to f(p) in photo j; its residual has the noise of photo j and that of photo i times A = f'(p),
covariance I + A A^T in units of the noise. Weighting by its inverse (Sampson 1982) makes one direction do for both: the
way back has the residual A^-1 r and says the same. Wide angles need no other treatment.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def whitening(stretch: Floats) -> Floats:
    """What makes residuals equally exact: the inverse of the Cholesky factor of (I + A A^T) / 2, as (3, m).

    stretch: (2, 2, m), px of photo j by px of photo i. Where photos have one scale, residuals stay about as long as
    they are.
    """
    a = 1 + (stretch[0] ** 2).sum(0)
    b = (stretch[0] * stretch[1]).sum(0)
    c = 1 + (stretch[1] ** 2).sum(0)
    first = np.sqrt(2 / a)
    second = np.sqrt(2 * a / (a * c - b * b))
    return np.stack([first, -b / a * second, second])


def squares(factor: Floats, value: Floats) -> Floats:
    """Squared lengths (m,) of residuals (2, m) multiplied by the factor."""
    return np.asarray((whitened(factor, value) ** 2).sum(0))


def whitened(factor: Floats, vectors: Floats) -> Floats:
    """Vectors (2, m), or (2, c, m) for c of each match, multiplied by the factor."""
    result = np.empty(vectors.shape)
    np.multiply(factor[0], vectors[0], out=result[0])
    np.multiply(factor[1], vectors[0], out=result[1])
    result[1] += factor[2] * vectors[1]
    return result
