"""Rotations: exponential and logarithm map, nearest rotation, turns about the axes of a camera.

Axes of a camera: x right, y down, z forward. Angles in radians.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def cross_matrix(v: Floats) -> Floats:
    """Matrices (..., 3, 3) that multiply like the cross product with the vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(v, np.float64), -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*x.shape, 3, 3)


def exp(v: Floats) -> Floats:
    """Rotations (..., 3, 3) by |v| radians about the axes v (..., 3): Rodrigues' formula."""
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    k = cross_matrix(v)
    # sinc forms stay exact where the angle is zero
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.asarray(np.eye(3) + a * k + b * (k @ k))


def log(rotation: Floats) -> Floats:
    """Rotation vector (3,) of a rotation (3, 3); its length is the angle, at most pi.

    By way of the quaternion, which is well conditioned at every angle (Shepperd 1978).
    """
    trace = np.trace(rotation)
    q = np.empty(4)
    candidates = np.array([trace, *np.diag(rotation)])
    largest = int(np.argmax(candidates))
    if largest == 0:
        q[:] = 1 + trace, *(rotation - rotation.T)[[2, 0, 1], [1, 2, 0]]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = rotation[k, j] - rotation[j, k]
        q[1 + i] = 1 + 2 * rotation[i, i] - trace
        q[1 + j] = rotation[i, j] + rotation[j, i]
        q[1 + k] = rotation[i, k] + rotation[k, i]
    q /= np.linalg.norm(q)
    if q[0] < 0:
        q = -q
    sine = float(np.linalg.norm(q[1:]))
    if sine == 0.0:
        return np.zeros(3)
    return np.asarray(q[1:] * (2 * np.arctan2(sine, q[0]) / sine))


def angle(rotation: Floats) -> float:
    """Angle of a rotation (3, 3) in radians, 0 to pi."""
    return float(np.linalg.norm(log(rotation)))


def nearest(matrix: Floats) -> Floats:
    """The rotations (..., 3, 3) nearest to matrices (..., 3, 3) in the Frobenius norm (Kabsch 1976)."""
    u, _, vt = np.linalg.svd(matrix)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return np.asarray(u @ vt)


def from_angles(yaw: float, pitch: float, roll: float) -> Floats:
    """`cam_from_world` (3, 3) of a camera turned right by yaw, then up by pitch, then clockwise by roll (radians)."""
    turn = exp(np.array([0.0, yaw, 0.0])) @ exp(np.array([pitch, 0.0, 0.0])) @ exp(np.array([0.0, 0.0, roll]))
    return np.asarray(turn.T)
