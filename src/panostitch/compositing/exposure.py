"""Equal brightness where photos overlap: which gains and which fall-off pay, and how bright the whole is to be."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from panostitch.compositing import photometry
from panostitch.compositing.overlaps import BRIGHT, WHITE, Overlaps, Pieces, Squares, find_overlaps
from panostitch.compositing.photometry import Fit
from panostitch.model.canvas import Layer
from panostitch.model.light import GAMMA, Light, unchanged

Floats = NDArray[np.float64]

PAYS = 0.08  # share of the errors in either held-out half of the overlaps that the fall-off must explain
USUAL = 1.0  # stops in the corners: more is rare in photos, and must explain more: by the square of it
SEEN_FALL_OFF = 0.02  # of the log of encoded brightness in the corner: less does not show
SEEN_COLOUR = 0.012  # of the log ratio of a channel to the others between two photos, rms: less does not show
EXPLAINED = 0.5  # share of these differences of colour that gains of the channels must explain
OUTLYING = 3.0  # standard deviations from which on errors count alike when halves are compared
EVERY = 4  # px of the reduced canvas between those that are looked at for the brightness of the whole
BLOWN = 0.01  # share of the pixels that gains may drive beyond white before the whole is darkened
MOST_DARKENED = 0.08  # of the log of the encoded brightness: a quarter of a stop of linear light

# From the numbers of the photos' lenses, (photo, layer) pieces on the reduced canvas and radii to what corrects them
Compensate = Callable[[Sequence[int], Pieces, Squares], Light]


def compensate(choice: str, lenses: Sequence[int], pieces: Pieces, squares: Squares) -> Light:
    """Gains, the same in all channels (`gain`), one for each (`channels`) or what pays (`auto`), and fall-off."""
    overlaps = find_overlaps(pieces, squares)
    if not len(overlaps):
        return unchanged(len(lenses), "no overlap says anything of the light")
    found, about_fall_off = _with_fall_off(overlaps, lenses)
    coloured, about_colour = _colour_pays(overlaps, found) if choice == "auto" else (choice == "channels", "as asked")
    logs = found.logs if coloured else np.repeat(found.mean_logs[:, None], 3, axis=1)
    light = Light(np.exp(logs), found.fall_off[np.asarray(lenses)] * GAMMA)
    what = "a gain for each channel" if coloured else "one gain for all channels"
    return Light(_anchored(light, pieces, squares), light.fall_off, f"{what} ({about_colour}), {about_fall_off}")


def leave(lenses: Sequence[int], pieces: Pieces, squares: Squares) -> Light:
    """No compensation."""
    del pieces, squares
    return unchanged(len(lenses), "as asked")


EXPOSURE: dict[str, Compensate] = {
    "auto": partial(compensate, "auto"),
    "gain": partial(compensate, "gain"),
    "channels": partial(compensate, "channels"),
    "none": leave,
}


def _with_fall_off(overlaps: Overlaps, lenses: Sequence[int]) -> tuple[Fit, str]:
    """The fit with fall-off where it pays, else without; and which."""
    plain = photometry.fit(overlaps, lenses, fall_off=False)
    if 2 * len(set(lenses)) > len(lenses):
        return plain, "no fall-off (too few photos of a lens)"
    fitted = photometry.fit(overlaps, lenses, fall_off=True)
    corner = float(fitted.fall_off.sum(1).max())
    if corner < SEEN_FALL_OFF:
        return plain, "no fall-off (too little to show)"
    stops = corner * GAMMA / np.log(2)
    explained = min(_explained(overlaps, lenses, half) for half in (False, True))
    if explained < PAYS * max(1.0, stops / USUAL) ** 2:
        return plain, f"no fall-off ({stops:.2f} stops explain {max(0.0, explained):.0%} of the differences)"
    return fitted, f"fall-off of {stops:.2f} stops in the corners (explains {explained:.0%} of the differences)"


def _explained(overlaps: Overlaps, lenses: Sequence[int], half: bool) -> float:
    """Share of the errors in one half of each overlap that the fall-off explains which the other half told."""
    held_out = overlaps.where(overlaps.fold == half)
    fitted = photometry.fit(overlaps.where(overlaps.fold != half), lenses, fall_off=True)
    seen = held_out.logs.mean(1)
    undone = seen + photometry.differences(held_out, lenses) @ fitted.fall_off.ravel()
    before, after = (np.abs(photometry.without_offsets(held_out, errors)) for errors in (seen, undone))
    most = OUTLYING * photometry.MAD * np.median(before)
    sums = [float((np.minimum(errors, most) * held_out.share).sum()) for errors in (before, after)]
    return 1 - sums[1] / max(sums[0], 1e-12) if most > photometry.LEAST_SCALE else 0.0


def _colour_pays(overlaps: Overlaps, fitted: Fit) -> tuple[bool, str]:
    """Whether channels differ by more than one gain can mend, consistently; and by how much."""
    pairs, sizes = overlaps.pairs, []
    for logs in (overlaps.logs, photometry.residuals(overlaps, fitted.logs)):
        colours = logs - logs.mean(1, keepdims=True)
        medians = np.array([np.median(colours[cells], axis=0) for cells in pairs])
        shares = np.array([overlaps.share[cells].sum() for cells in pairs])
        sizes.append(float(np.sqrt(np.average((medians**2).mean(1), weights=shares))))
    before, after = sizes
    told = f"colours differ by {before:.1%} between photos, {after:.1%} with a gain for each channel"
    return before > SEEN_COLOUR and after < (1 - EXPLAINED) * before, told


def _anchored(light: Light, pieces: Pieces, squares: Squares) -> Floats:
    """The gains (n, 3) times the one factor that keeps the whole as bright as it was, or darker if much would burn."""
    looked_at = [_looked_at(light, photo, layer, squares) for photo, layer in pieces]
    factors, weights, rooms = (np.concatenate(column) for column in zip(*looked_at, strict=True))
    if not weights.sum():
        return light.gains
    shift = -np.average(factors, weights=weights)
    if len(rooms):
        shift += float(np.clip(np.quantile(rooms - shift, BLOWN), -MOST_DARKENED, 0))
    return np.asarray(light.gains * np.exp(shift))


def _looked_at(light: Light, photo: int, layer: Layer, squares: Squares) -> tuple[Floats, Floats, Floats]:
    """Of some pixels the log of their factor (m,) and what it counts for (m,); of those that are not white the log
    (k,) of how far they are from it.

    Photos show little of their corners in the panorama, so these count for nothing.
    """
    shown = layer.mask[::EVERY, ::EVERY]
    pixels = layer.pixels[::EVERY, ::EVERY][shown]
    square = squares(photo, layer.region)[::EVERY, ::EVERY][shown]
    brighter = np.log(light.brightening(photo, square))
    unburnt = pixels.max(1, initial=0) < BRIGHT
    brightest = np.maximum((pixels * light.gains[photo]).max(1, initial=0), 1)
    rooms = np.log(WHITE / brightest[unburnt]) - brighter[unburnt]
    return np.log(light.brightness[photo]) + brighter, np.maximum(1 - square, 0), rooms
