"""Turning camera or flat subject, and how flat: decided by how well each explains the matches.

Errors are made comparable first: robust, and as large as the noise must be, given how many unknowns took some of it in
(residuals over surplus, as an unbiased estimate of a variance has it). Statistics alone would then take the richest
model in almost every case, for parallax and distortion are not noise; what is asked of a richer or less usual model is
therefore not to be significantly better, but noticeably. Compare Torr, "Geometric Motion Segmentation and Model
Selection", 1998.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from panostitch.alignment.distances import distances
from panostitch.model.alignment import Model
from panostitch.model.camera import Camera
from panostitch.model.match import ControlPoints

__all__ = ["FLAT", "Candidate", "Choice", "Model", "candidate", "choose", "flat_parameters", "flat_to_try"]

Floats = NDArray[np.float64]

FLAT: tuple[Model, ...] = ("similarity", "affine", "homography")  # from the plainest to the richest
FREE = {"similarity": 4, "affine": 6, "homography": 8}  # numbers for each photo but one

NOTICEABLE = 1.0  # working px: below, a rotation that fits is not given up for a richer model
CLEARLY_BETTER = 2.0  # times: a homography must be for photographs not to be views from one point
NEARLY_AS_GOOD = 1.25  # times the error of the best flat model that a plainer one may have
# Times the error of the rotation that a similarity or affine transform may have to be taken instead: if photos merely
# slide over each other, nothing shows that a camera turned. Photographs of ordinary lenses have 1.4 and more.
SLIDES = 1.1
UNSEEN = 0.1  # working px: errors below say nothing
ALL_AROUND_FITS = 5.0  # working px: a rotation that fits this well is believed about directions far apart
MANY = 20  # photos beyond which flat models are not tried where a rotation fits
# Across a photo: where a rotation fits with such a lens, nothing slides. A lens that is wider was found because nothing
# shows what it is: the photos hardly differ.
ORDINARY_FIELD = np.deg2rad((30.0, 120.0))


@dataclass(frozen=True)
class Candidate:
    """A model with cameras.

    error:      px, robust root mean square over all matches, those of links that were given up included
    parameters: number of unknowns; observations: number of matches, each of two coordinates
    """

    model: Model
    error: float
    parameters: int
    observations: int

    @property
    def noise(self) -> float:
        """The error, made up for what the unknowns took in; infinite where they could take in everything."""
        surplus = 2 * self.observations - self.parameters
        return self.error * float(np.sqrt(2 * self.observations / surplus)) if surplus > 0 else float("inf")


@dataclass(frozen=True)
class Choice:
    """The model and why, in one sentence; how many times better it is than the runner-up (below 1: it is worse).

    Without a runner-up, nothing else was tried, and the margin is infinite.
    """

    model: Model
    reason: str
    runner_up: Model | None = None
    margin: float = float("inf")


def flat_parameters(model: Model, photos: int) -> int:
    """Unknowns of so many photos of a plane."""
    return FREE[model] * (photos - 1)


def candidate(
    model: Model, cameras: Sequence[Camera], points: Sequence[ControlPoints], parameters: int, *, scale: float
) -> Candidate:
    """How well cameras explain matches, in both photos of each; `scale` is the noise of a match, px.

    Give every model the same matches, all that there are.
    """
    there = np.concatenate(distances(cameras, points))
    back = np.concatenate(distances(cameras, [pair.swapped() for pair in points]))
    square = (there**2 + back**2) / 2
    # the one square that has the mean loss of all
    error = scale * float(np.sqrt(np.expm1(np.log1p(square / scale**2).mean())))
    return Candidate(model, error, parameters, len(square))


def flat_to_try(turning: Candidate | None, cameras: Sequence[Camera], *, pixel_size: float) -> tuple[Model, ...]:
    """Which flat models are worth the time beside turning cameras with their candidate, if there are any."""
    if turning is None:
        return FLAT
    forward = np.array([camera.cam_from_world[2] for camera in cameras])
    if turning.noise < ALL_AROUND_FITS * pixel_size and (forward @ forward.T).min() < 0:
        return ()  # no plane is seen in directions more than a right angle apart
    if turning.noise > NOTICEABLE * pixel_size:
        return FLAT
    field = float(np.median([2 * np.arctan(max(camera.size) / 2 / camera.focal) for camera in cameras]))
    ordinary = ORDINARY_FIELD[0] < field < ORDINARY_FIELD[1]
    return () if len(cameras) > MANY or ordinary else FLAT


def choose(candidates: Sequence[Candidate], *, pixel_size: float) -> Choice:
    """The model to take; `pixel_size` is a working pixel in px.

    A rotation is the rule for photographs. A flat subject is taken where one is clearly better, or where photos slide
    over each other without any perspective; of flat models, the plainest that is nearly as good as the best.
    """
    turning = next((c for c in candidates if c.model == "rotation"), None)
    flat = [c for model in FLAT for c in candidates if c.model == model]
    noise = {c.model: max(c.noise, UNSEEN * pixel_size) for c in candidates}
    if not flat:
        if turning is None:
            raise ValueError("no candidates")
        return Choice("rotation", f"views from one point explain the key points to {turning.error:.2f} px")
    least = min(noise[c.model] for c in flat)
    plainest = next(c for c in flat if noise[c.model] <= NEARLY_AS_GOOD * least)
    if turning is None:
        return _choice(plainest, flat, noise, "a flat subject explains the key points")
    limit = noise["rotation"]
    if limit > NOTICEABLE * pixel_size and limit > CLEARLY_BETTER * least:
        return _choice(plainest, candidates, noise, "a flat subject explains the key points clearly better")
    sliding = [c for c in flat if c.model != "homography" and noise[c.model] <= SLIDES * limit]
    if sliding:
        slid = plainest.model != "homography"
        why = (
            "the photos slide over each other without perspective" if slid else "a flat subject explains the key points"
        )
        return _choice(plainest, candidates, noise, why)
    return _choice(turning, candidates, noise, "views from one point explain the key points")


def _choice(taken: Candidate, candidates: Sequence[Candidate], noise: dict[Model, float], why: str) -> Choice:
    """The choice with its figures, the best of the others first."""
    others = sorted((c for c in candidates if c.model != taken.model), key=lambda c: noise[c.model])
    figures = ", ".join(f"{c.model} {c.error:.2f} px" for c in (taken, *others))
    if not others:
        return Choice(taken.model, f"{why} ({figures})")
    best = others[0].model
    return Choice(taken.model, f"{why} ({figures})", best, noise[best] / noise[taken.model])
