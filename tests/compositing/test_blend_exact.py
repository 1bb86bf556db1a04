"""The blend in two scales and in tiles is the textbook's multi-band blend of the whole canvas at full size."""

import cv2
import numpy as np
import pytest

from compositing.mosaics import alignment_of, shifted
from panostitch.compositing import lay_out, make_panorama, make_plan, plan
from panostitch.compositing.blend import multiband
from panostitch.compositing.blend.pieces import Piece, hard_composite
from panostitch.compositing.seams import SEAMS
from panostitch.model.canvas import Canvas
from panostitch.options import CompositingOptions, LayoutOptions

# dB of the peak signal to noise ratio, on 0..255; cv2.detail.MultiBandBlender reaches 37 by its rounding. 149 seen
# where the canvas is not reduced (float32 sums), 68 where fine and low bands are blended at different sizes.
EXACT_DB, TWO_SCALES_DB = 100.0, 60.0
BANDS = 5
SIZE = (384, 256)  # px, multiples of 2 ** BANDS
# px at the border of the canvas that are not compared: the textbook does not say how photos go on there
BORDER = 2**BANDS


def reduced(array):
    return cv2.pyrDown(array)


def enlarged(array, like):
    return cv2.pyrUp(array, dstsize=like.shape[1::-1])


def textbook(photos, masks, bands):
    """Burt & Adelson 1983: the sum over photos of mask pyramid times Laplacian pyramid, in double precision."""
    levels = [0.0] * (bands + 1)
    for photo, mask in zip(photos, masks, strict=True):
        pixels, weight = photo.astype(np.float64), mask.astype(np.float64)
        for level in range(bands):
            smaller = reduced(pixels)
            levels[level] = levels[level] + (pixels - enlarged(smaller, pixels)) * weight[..., None]
            pixels, weight = smaller, reduced(weight)
        levels[bands] = levels[bands] + pixels * weight[..., None]
    whole = levels[bands]
    for level in reversed(levels[:bands]):
        whole = enlarged(whole, level) + level
    return whole


def decibels(one, other):
    inner = (slice(BORDER, -BORDER), slice(BORDER, -BORDER))
    return 20 * np.log10(255 / np.sqrt(((one[inner] - other[inner]) ** 2).mean()))


def labels_of(canvas, pieces):
    """Three photos that meet in the middle, one seam slanted."""
    del pieces
    width, height = canvas.size
    y, x = np.mgrid[:height, :width] / [[[height]], [[width]]]
    return np.where(y > 0.55, 2, np.where(x + 0.3 * y > 0.6, 1, 0)).astype(np.int16)


@pytest.fixture
def photos(views, rng):
    """Three photos of the same place, light and grain different."""
    picture = views[0][: SIZE[1], : SIZE[0]].astype(np.float64)
    seen = [picture * gain + rng.normal(0, 4, picture.shape) for gain in (0.8, 1.0, 0.6)]
    return [np.clip(np.rint(pixels), 0, 255).astype(np.uint8) for pixels in seen]


@pytest.fixture
def blend(monkeypatch):
    """A function from photos that all lie over the whole canvas to what a blender makes of them."""
    monkeypatch.setitem(SEAMS, "voronoi", labels_of)

    def made(photos, factor, blender, bands=None, tile=None):
        alignment = alignment_of([shifted(SIZE, 0, 0)] * len(photos), photos, model="homography")
        canvas = lay_out(alignment, LayoutOptions(crop="none"))
        canvas = canvas.__class__(canvas.projection, 1.0, (0.0, 0.0), SIZE)
        monkeypatch.setattr(plan, "PLAN_PIXELS", 1.01 * canvas.region.area / factor**2)
        options = CompositingOptions(exposure="none", seams="voronoi", blender=blender, bands=bands)
        panorama = make_panorama(alignment, canvas, make_plan(alignment, canvas, options, "none"), options)
        assert panorama.plan.factor == factor
        pixels = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
        for region in canvas.region.tiles(tile or max(SIZE)):
            pixels[region.within(canvas.region)] = panorama.read(region).pixels
        return pixels

    return made


@pytest.mark.parametrize(("factor", "least"), [(1, EXACT_DB), (4, TWO_SCALES_DB)])
def test_the_blend_is_the_textbook_s(photos, blend, factor, least):
    flat = [np.full_like(photos[0], level) for level in (0, 100, 200)]
    owner = np.rint(blend(flat, factor, "none")[..., 0] / 100)
    exact = textbook(photos, [owner == n for n in range(3)], BANDS)

    ours = blend(photos, factor, "multiband", BANDS, tile=100)

    assert decibels(ours, exact) > least
    # and hard seams are not, or any picture would do
    assert decibels(blend(photos, factor, "none"), exact) < least / 2


@pytest.mark.parametrize("factor", [1, 4])
def test_a_photo_comes_back_bit_for_bit(photos, blend, factor):
    """One photo three times over: seams run through it and nothing of them is left."""
    back = blend([photos[0]] * 3, factor, "multiband", BANDS, tile=100)

    assert np.array_equal(np.rint(back).astype(np.uint8), photos[0])


def test_photos_are_blended_where_they_matter_and_nowhere_else(views, rng):
    """Twelve photos in a grid, each made in a box about its own cell: the same as all of them on the whole canvas."""
    levels, shape = 2, SIZE[::-1]
    y, x = np.mgrid[: shape[0], : shape[1]]
    labels = (y // 64 * 4 + x // 96).astype(np.int16)
    picture = views[0][: shape[0], : shape[1]].astype(np.float32)
    photos = [picture * np.float32(gain) for gain in rng.uniform(0.5, 1.0, 12)]
    everywhere = (slice(0, shape[0]), slice(0, shape[1]))
    pieces = [Piece(n, everywhere, p, np.ones(shape, bool), labels == n) for n, p in enumerate(photos)]
    canvas = Canvas("rectilinear", 1.0, (0.0, 0.0), SIZE)

    blended = multiband.blend_reduced(pieces, labels, hard_composite(pieces, shape)[0], canvas, 1, levels)

    assert decibels(blended, textbook(photos, [labels == n for n in range(12)], levels)) > EXACT_DB
    assert multiband.matters(labels == 0, levels, wraps=False).area < labels.size / 4
