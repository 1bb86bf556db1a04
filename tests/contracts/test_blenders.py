"""What every blender promises, whichever it is, in panoramas of flat pictures that were only shifted."""

from itertools import pairwise

import numpy as np
import pytest

from panostitch.compositing import lay_out, make_panorama, make_plan, plan
from panostitch.compositing.blend import BLENDERS
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Region
from panostitch.model.photo import Photo
from panostitch.options import CompositingOptions, LayoutOptions
from panostitch.synthetic.render import ArraySource

# Grey levels; float32 sums of bands of up to 255, whose steps are 2e-5.
FLOAT32_LEVELS = 2e-3

# Grey levels; sampled at whole pixels a photo stays what it is, but the coordinates have errors of 1e-4 px.
RESAMPLED = 0.5

# Grey levels by which a fade may step back; float32 again, and the truncated kernels of the pyramids. 2e-5 seen.
NOT_MONOTONE = 0.1
# Grey levels; the same where fine bands and correction are made at different sizes, of a step of 80. 0.8 seen.
RIPPLE = 1.5
# Grey levels; a seam between 80 and 160 has gone if no step between neighbours is larger than a tenth of it. Seen:
# 1.2 with bands, 7.8 with feathers over 4 px.
NO_STEP = 8.0
DARK, LIGHT = 80, 160
# Rows or columns along the edge of the canvas where half-way seams run aside: both photos end there, equally near.
ASIDE = 60

# Grey levels by which an overlap of 160 px, where both photos show the same, is changed; the lowest bands reach a
# little beyond it. 0.65 seen.
SAME_SCENE = 1.0

NAMES = sorted(BLENDERS)
FADING = ["feather", "multiband"]
SIZE = (240, 180)  # px of each photo


@pytest.fixture(params=[1, 4], ids=["plan at full size", "plan at a quarter"])
def factor(request):
    return request.param


def panorama_of(pictures, offsets, blender, monkeypatch, factor, *, seams="voronoi", bands=None):
    """Flat pictures at these places (x, y) of a plane, and the place of the plane's origin on the canvas."""
    photos = tuple(Photo(f"p{n}", p.shape[1::-1], ArraySource(p)) for n, p in enumerate(pictures))
    cameras = tuple(
        Camera(p.size, 1.0, (0.0, 0.0), np.array([[1.0, 0, -x], [0, 1, -y], [0, 0, 1]]))
        for p, (x, y) in zip(photos, offsets, strict=True)
    )
    alignment = Alignment("homography", photos, cameras, (), (), 0.0, 0.0)
    canvas = lay_out(alignment, LayoutOptions(crop="none"))
    monkeypatch.setattr(plan, "PLAN_PIXELS", 1.01 * canvas.region.area / factor**2)
    options = CompositingOptions(exposure="none", seams=seams, blender=blender, bands=bands)
    made = make_plan(alignment, canvas, options, "none")
    assert made.factor == factor
    return make_panorama(alignment, canvas, made, options), (-int(canvas.origin[0]), -int(canvas.origin[1]))


def plain(level):
    return np.full((SIZE[1], SIZE[0], 3), level, np.uint8)


def covered(panorama):
    layer = panorama.read(panorama.canvas.region)
    assert layer.mask.any()
    return layer, layer.pixels[layer.mask]


@pytest.mark.parametrize("name", NAMES)
def test_a_constant_stays_constant(name, factor, monkeypatch):
    panorama, _ = panorama_of([plain(130)] * 2, [(0, 0), (150, 0)], name, monkeypatch, factor)

    np.testing.assert_allclose(covered(panorama)[1], 130, atol=FLOAT32_LEVELS)


@pytest.mark.parametrize("name", NAMES)
def test_a_constant_stays_constant_next_to_empty_corners(name, factor, monkeypatch):
    places = [(0, 0), (150, 20), (90, 110)]

    panorama, _ = panorama_of([plain(130)] * 3, places, name, monkeypatch, factor)

    np.testing.assert_allclose(covered(panorama)[1], 130, atol=FLOAT32_LEVELS)


@pytest.mark.parametrize("name", NAMES)
def test_one_photo_comes_back(name, factor, monkeypatch, views):
    panorama, (x, y) = panorama_of([views[0]], [(0, 0)], name, monkeypatch, factor)

    layer = panorama.read(Region(x, y, 400, 300))

    assert layer.mask.all()
    np.testing.assert_allclose(layer.pixels, views[0], atol=RESAMPLED)


@pytest.mark.parametrize("name", NAMES)
def test_equal_photos_come_back(name, factor, monkeypatch, views):
    panorama, (x, y) = panorama_of([views[0]] * 2, [(0, 0)] * 2, name, monkeypatch, factor)

    np.testing.assert_allclose(panorama.read(Region(x, y, 400, 300)).pixels, views[0], atol=RESAMPLED)


@pytest.mark.parametrize("name", NAMES)
def test_noise_and_corners_give_finite_numbers(name, factor, monkeypatch, rng):
    noise = [rng.integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8) for _ in range(4)]

    panorama, _ = panorama_of(noise, [(0, 0), (200, 150), (230, 10), (30, 170)], name, monkeypatch, factor)
    layer, pixels = covered(panorama)

    assert np.isfinite(layer.pixels).all()
    assert not layer.mask.all()
    assert (layer.pixels[~layer.mask] == 0).all()
    # the mean of noise is kept, whatever the seams
    assert pixels.mean() == pytest.approx(127.5, abs=3)


def across_the_seam(name, seam, monkeypatch, factor):
    """A dark and a light photo, the seam upright, without the edges along which it runs aside."""
    place = (160, 0) if seam == "upright" else (0, 120)
    panorama, (x, y) = panorama_of([plain(DARK), plain(LIGHT)], [(0, 0), place], name, monkeypatch, factor)
    pixels = panorama.read(Region(x, y, SIZE[0] + place[0], SIZE[1] + place[1])).pixels
    return (pixels if seam == "upright" else pixels.swapaxes(0, 1))[ASIDE:-ASIDE]


@pytest.mark.parametrize("name", FADING)
@pytest.mark.parametrize("seam", ["upright", "level"])
def test_two_constants_fade_into_each_other(name, factor, seam, monkeypatch):
    across = across_the_seam(name, seam, monkeypatch, factor)

    assert np.diff(across, axis=1).max() < NO_STEP
    # no darker than the dark one and no lighter than the light one, and far from the seam as they were
    assert DARK - RIPPLE < across.min() < DARK + 5
    assert LIGHT + RIPPLE > across.max() > LIGHT - 5


@pytest.mark.parametrize("name", FADING)
@pytest.mark.parametrize("seam", ["upright", "level"])
def test_a_fade_never_goes_back(name, factor, seam, monkeypatch):
    across = across_the_seam(name, seam, monkeypatch, factor)

    assert np.diff(across, axis=1).min() > -(NOT_MONOTONE if factor == 1 else RIPPLE)


def test_no_blending_keeps_the_seam(factor, monkeypatch):
    panorama, _ = panorama_of([plain(DARK), plain(LIGHT)], [(0, 0), (160, 0)], "none", monkeypatch, factor)

    assert set(np.unique(covered(panorama)[1])) == {DARK, LIGHT}


@pytest.mark.parametrize("name", NAMES)
def test_far_from_the_seam_fine_detail_is_the_photo_s_own(name, factor, monkeypatch, rng):
    noise = [rng.integers(100, 140, (SIZE[1], SIZE[0], 3), np.uint8) for _ in range(2)]

    panorama, (x, y) = panorama_of(noise, [(0, 0), (200, 0)], name, monkeypatch, factor)
    left = panorama.read(Region(x, y, 100, SIZE[1])).pixels
    change = left - noise[0][:, :100]

    # blending may change brightness smoothly, not neighbours apart
    assert np.abs(np.diff(change, axis=1)).max() < 2 * RESAMPLED


@pytest.mark.parametrize("name", NAMES)
def test_a_photo_in_pieces_makes_the_whole(name, factor, monkeypatch, views):
    left, right = views[0][:, :280], views[0][:, 120:]

    panorama, (x, y) = panorama_of([left, right], [(0, 0), (120, 0)], name, monkeypatch, factor, seams="graphcut")

    np.testing.assert_allclose(panorama.read(Region(x, y, 400, 300)).pixels, views[0], atol=SAME_SCENE)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seams", ["graphcut", "voronoi"])
def test_narrow_overlaps_of_photos_that_agree_change_nothing(name, seams, monkeypatch, views):
    left, right = views[0][:, :230], views[0][:, 180:]

    panorama, (x, y) = panorama_of([left, right], [(0, 0), (180, 0)], name, monkeypatch, 1, seams=seams)

    np.testing.assert_allclose(panorama.read(Region(x, y, 400, 300)).pixels, views[0], atol=RESAMPLED)


def test_no_bands_are_hard_seams(factor, monkeypatch, rng):
    noise = [rng.integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8) for _ in range(3)]
    places = [(0, 0), (150, 20), (90, 110)]

    hard, _ = panorama_of(noise, places, "none", monkeypatch, factor)
    panorama, _ = panorama_of(noise, places, "multiband", monkeypatch, factor, bands=0)

    np.testing.assert_allclose(covered(panorama)[1], covered(hard)[1], atol=FLOAT32_LEVELS)


def test_each_band_more_makes_the_fade_wider(factor, monkeypatch):
    widths = []
    for bands in range(5):
        pictures, places = [plain(DARK), plain(LIGHT)], [(0, 0), (160, 0)]
        panorama, (x, y) = panorama_of(pictures, places, "multiband", monkeypatch, factor, bands=bands)
        across = panorama.read(Region(x, y, SIZE[0] + 160, SIZE[1])).pixels[SIZE[1] // 2, :, 0]
        widths.append(int(((across > DARK + 1) & (across < LIGHT - 1)).sum()))

    assert widths[0] == 0
    assert all(narrow < wide for narrow, wide in pairwise(widths))
