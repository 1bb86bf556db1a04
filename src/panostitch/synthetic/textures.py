"""A made-up picture, rich at every scale, that wraps horizontally: cloudy colours under shapes with sharp edges."""

import cv2
import numpy as np
from numpy.typing import NDArray

COARSEST_ROWS = 3
SHAPES = 3000
# radius of the largest and of the smallest shape, as parts of the height
RADII = (0.09, 0.0015)
# amplitude of an octave per amplitude of the one twice as coarse; somewhat above the 0.5 of natural pictures
# (Field 1987), so that plain areas have fine grain too
FALL = 0.72
SUBPIXEL_BITS = 4
PIXEL_BLUR = 0.5  # px, deviation of the blur that makes a pixel of its light: a box has 0.29, a lens adds to it
BAND = 64  # rows made at once


def procedural_texture(width: int, height: int, seed: int) -> NDArray[np.uint8]:
    """A texture (height, width, 3) RGB; shapes are widened towards top and bottom, as an equirectangular map asks."""
    rng = np.random.default_rng(seed)
    base = 128 + 45 * _noise(width, height, rng, colour=0.45)
    grain = 20 * _noise(width, height, rng, colour=0.15)
    picture = _with_shapes(np.clip(base, 0, 255).astype(np.uint8), rng) + grain
    return np.asarray(np.clip(np.rint(picture), 0, 255), np.uint8)


def even_on_sphere(texture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An equirectangular texture (h, 2 h, 3) without the detail that its narrow pixels near the poles could hold.

    Each row is smoothed along itself until it is no finer than the rows at the equator, as in a picture of a true
    place: else photos of the poles would show the flicker of unresolved detail.
    """
    height, width = texture.shape[:2]
    latitude = ((np.arange(height) + 0.5) / height - 0.5) * np.pi
    # a pixel of the equator is 1 / cos wide up there; its own width is there already
    sigma = PIXEL_BLUR * np.sqrt(1 / np.cos(latitude) ** 2 - 1)
    frequency = 2 * np.pi * np.fft.rfftfreq(width)
    smooth = np.empty_like(texture)
    for top in range(0, height, BAND):
        rows = slice(top, top + BAND)
        kept = np.exp(-0.5 * (sigma[rows, None] * frequency) ** 2)[..., None]
        spectrum = np.fft.rfft(texture[rows], axis=1) * kept
        smooth[rows] = np.clip(np.rint(np.fft.irfft(spectrum, width, axis=1)), 0, 255)
    return smooth


def _noise(width: int, height: int, rng: np.random.Generator, *, colour: float) -> NDArray[np.float32]:
    """Sum of octaves (height, width, 3) of unit deviation; `colour` is the share that differs by channel."""
    rows = COARSEST_ROWS
    total = np.zeros((rows, 2 * rows, 3), np.float32)
    strength = 1.0
    while True:
        grey, tint = (rng.standard_normal((rows, 2 * rows, n), np.float32) for n in (1, 3))
        total += strength * ((1 - colour) * grey + colour * tint)
        if rows >= height / 2:
            break
        rows, strength = 2 * rows, strength * FALL
        total = _enlarged(total, 2 * rows, rows)
    total = _enlarged(total, width, height)
    return np.asarray(total / total.std(), np.float32)


def _enlarged(picture: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """A picture (h, w, 3) at another size, continued across the left and right edge."""
    margin = 2
    wide = np.concatenate([picture[:, -margin:], picture, picture[:, :margin]], axis=1)
    across = (np.arange(width, dtype=np.float32) + 0.5) * (picture.shape[1] / width) - 0.5 + margin
    down = (np.arange(height, dtype=np.float32) + 0.5) * (picture.shape[0] / height) - 0.5
    x, y = np.meshgrid(across, down)
    return np.asarray(cv2.remap(wide, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), np.float32)


def _with_shapes(canvas: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Draw polygons, ellipses and strokes, large ones first; what leaves at one side comes in at the other."""
    height, width = canvas.shape[:2]
    # as many between r and 2 r as between 2 r and 4 r: rich at every scale
    for radius in height * np.geomspace(*RADII, SHAPES):
        centre = np.array([rng.uniform(0, width), rng.uniform(0, height)])
        stretch = 1 / max(0.15, np.cos((centre[1] / height - 0.5) * np.pi))
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 9)))
        reach = radius * rng.uniform(0.5, 1.0, len(angles))
        outline = np.column_stack([np.cos(angles) * reach * stretch, np.sin(angles) * reach])
        colour = np.clip(rng.uniform(25, 235) + rng.normal(0, 28, 3), 0, 255).tolist()
        kind = int(rng.integers(3))
        for turn in (-width, 0, width):
            _draw(canvas, centre + np.array([turn, 0.0]), outline, colour, kind)
    return canvas


def _draw(
    canvas: NDArray[np.uint8],
    centre: NDArray[np.float64],
    outline: NDArray[np.float64],
    colour: list[float],
    kind: int,
) -> None:
    """One shape: 0 a filled polygon, 1 an ellipse, 2 a polyline; drawn to fractions of a pixel."""
    scale = 2**SUBPIXEL_BITS
    points = np.rint((centre + outline) * scale).astype(np.int32)
    if kind == 0:
        cv2.fillPoly(canvas, [points], colour, cv2.LINE_AA, SUBPIXEL_BITS)
    elif kind == 1:
        axes = np.rint(np.abs(outline).max(0) * scale).astype(int)
        middle = np.rint(centre * scale).astype(int)
        cv2.ellipse(canvas, middle.tolist(), axes.tolist(), 0, 0, 360, colour, cv2.FILLED, cv2.LINE_AA, SUBPIXEL_BITS)
    else:
        thickness = int(np.ceil(np.abs(outline).max() / 24))
        cv2.polylines(canvas, [points], False, colour, thickness, cv2.LINE_AA, SUBPIXEL_BITS)
