"""Another view of an alignment: turned right, up or clockwise, with a chosen photo in the middle, or from above."""

from dataclasses import replace
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from panostitch.errors import UsageError
from panostitch.geometry import rotation
from panostitch.model.alignment import Alignment
from panostitch.options import LayoutOptions

Floats = NDArray[np.float64]

NAMES_SHOWN = 6


def look(alignment: Alignment, options: LayoutOptions) -> Alignment:
    """The alignment in the axes of the view that is asked for; the same one where nothing is.

    Raises UsageError for a photo that is not in it, and for turns that a flat subject does not have.
    """
    planet = options.projection == "little-planet" and alignment.model == "rotation"
    if not (options.yaw or options.pitch or options.roll or options.center_on is not None or planet):
        return alignment
    yaw, pitch, roll = np.deg2rad([options.yaw, options.pitch - 90 * planet, options.roll])
    if alignment.model != "rotation":
        _only_roll(options)
    if options.center_on is not None:
        yaw += _longitude(alignment, options.center_on)
    # the view is a camera in the old world; the new world is what it calls right, down and forward
    old_from_new = rotation.from_angles(yaw, pitch, roll).T
    return replace(alignment, cameras=tuple(camera.turned(old_from_new) for camera in alignment.cameras))


def _only_roll(options: LayoutOptions) -> None:
    named = {"--yaw": options.yaw, "--pitch": options.pitch, "--center-on": options.center_on is not None}
    wrong = [name for name, value in named.items() if value]
    if wrong:
        raise UsageError(
            f"{' and '.join(wrong)}: a flat subject is seen straight on; there is nothing around it to turn to",
            hint="--roll turns it in its plane; aligned with --model rotation, the photos are views all around",
        )


def _longitude(alignment: Alignment, name: str) -> float:
    """How far to the right (radians) the middle of a photo lies; the horizon stays where it is."""
    names = [photo.name for photo in alignment.photos]
    if name not in names:
        raise _unknown(name, names)
    camera = alignment.cameras[names.index(name)]
    x, _, z = camera.rays((np.array([camera.size]) - 1) / 2)[0]
    return float(np.arctan2(x, z))


def _unknown(name: str, names: list[str]) -> UsageError:
    shown = ", ".join(names[:NAMES_SHOWN])
    more = f" and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else ""
    near = get_close_matches(name, names, n=1)
    return UsageError(
        f"--center-on {name}: no photo of the panorama has that name",
        details=(f"its photos are {shown}{more}",),
        hint=f"did you mean {near[0]}?" if near else "names are those that `panostitch align -v` lists",
    )
