"""Turning camera or flat subject: decided by how well each explains the matches."""

from dataclasses import dataclass
from typing import Literal

Model = Literal["rotation", "homography"]

# A homography has eight parameters for a pair where a rotation has three or four: it always fits a little better.
# Only when it is better by more than this does it say something about the scene.
CLEARLY_BETTER = 2.0
NOTICEABLE = 1.0  # working px rms: below, a rotation that fits is not given up for a better homography


@dataclass(frozen=True)
class Choice:
    """The model and why, in one sentence."""

    model: Model
    reason: str


def choose(rotation_rms: float, homography_rms: float | None, *, pixel_size: float) -> Choice:
    """Take the rotation unless the homography fits clearly better. Errors in px; None where it was not tried."""
    if homography_rms is None:
        return Choice("rotation", f"views from one point explain the matches to {rotation_rms:.2f} px")
    figures = f"rotation {rotation_rms:.2f} px, homography {homography_rms:.2f} px"
    if rotation_rms > NOTICEABLE * pixel_size and rotation_rms > CLEARLY_BETTER * homography_rms:
        return Choice("homography", f"a flat subject explains the matches clearly better ({figures})")
    return Choice("rotation", f"views from one point explain the matches ({figures})")
