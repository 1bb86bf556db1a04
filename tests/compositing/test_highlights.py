"""What is burnt looks as in photos that are not burnt there, or white; what only is as bright is left alone."""

import numpy as np
import pytest

from compositing.mosaics import alignment_of, panorama_of, shifted
from panostitch.compositing import plan
from panostitch.compositing.burnt import burnt_map
from panostitch.compositing.overlaps import find_overlaps
from panostitch.model.canvas import Layer, Region
from panostitch.model.light import Light
from panostitch.options import CompositingOptions, LayoutOptions

SIZE = 320, 240  # px of each photo
SHIFT = 160  # px from one photo to the next
SKY = np.array([90.0, 140.0, 205.0])
BRIGHTER = 2.0 ** (1 / 2.2)  # one stop
LEVELS = 4.0  # grey levels: how near the sky of one photo comes to that of the other; 2 seen
TILED = 1e-3  # grey levels: rounding of float32 sums of up to 255


def ground():
    """Rows below the horizon (h / 2, w, 3) of the whole scene: any dark texture."""
    noise = np.random.default_rng(4).uniform(20, 100, (SIZE[1] // 8, (SIZE[0] + 3 * SHIFT) // 4, 3))
    return noise.repeat(4, axis=0).repeat(4, axis=1)


def photos(sky, gains):
    """The alignment of photos in a row, whose light has these gains (n, 3), of a scene with a sky (3,)."""
    below = ground()
    scene = np.vstack([np.broadcast_to(sky, below.shape), below])
    cut = [scene[:, n * SHIFT :][:, : SIZE[0]] * gain for n, gain in enumerate(np.asarray(gains))]
    pictures = [np.rint(pixels).clip(0, 255).astype(np.uint8) for pixels in cut]
    return alignment_of([shifted(SIZE, n * SHIFT, 0) for n in range(len(pictures))], pictures, model="similarity")


def made(alignment, **options):
    options = {"blender": "none", "seams": "voronoi", "exposure": "channels", **options}
    return panorama_of(alignment, layout=LayoutOptions(crop="none"), compositing=CompositingOptions(**options))


def sky_of(panorama, x):
    return panorama.read(Region(x, 20, 20, 60)).pixels.mean((0, 1))


def test_a_sky_that_is_burnt_in_blue_has_the_colour_that_another_photo_shows():
    panorama = made(photos(SKY, [np.ones(3), np.full(3, BRIGHTER)]))
    true, burnt = sky_of(panorama, 20), sky_of(panorama, 440)  # that no other photo shows

    assert panorama.plan.light.brightness[1] < 0.9
    np.testing.assert_allclose(burnt, true, atol=LEVELS)
    # what its factor alone makes of it is as green as blue
    assert true[2] - 255 * panorama.plan.light.gains[1, 2] > 5 * LEVELS


def test_what_all_photos_burn_stays_white_without_a_colour(monkeypatch):
    light = Light(np.array([[1.0, 1.0, 1.0], [0.65, 0.7, 0.8]]), np.zeros((2, 3)))
    monkeypatch.setitem(plan.EXPOSURE, "channels", lambda *_: light)
    panorama = made(photos(np.full(3, 400.0), [np.ones(3), np.full(3, BRIGHTER)]))

    np.testing.assert_allclose(sky_of(panorama, 440), 255, atol=1)


def test_what_is_bright_but_not_burnt_follows_its_factor():
    bright = np.array([100.0, 130.0, 170.0])
    panorama = made(photos(bright, [np.ones(3), np.full(3, BRIGHTER)]))

    assert panorama.plan.light.spared == (None, None)
    np.testing.assert_allclose(sky_of(panorama, 440), sky_of(panorama, 20), atol=LEVELS)


def test_a_burnt_photo_that_is_not_darkened_is_left_alone():
    panorama = made(photos(np.full(3, 400.0), np.ones((2, 3))))
    assert panorama.plan.light.spared == (None, None)


def test_photos_are_exposed_from_the_least_burnt_on_so_that_each_learns_from_the_last():
    """The last photo does not overlap the first, which alone shows the sky as it is."""
    panorama = made(photos(SKY, [np.ones(3), np.full(3, BRIGHTER), np.full(3, BRIGHTER**1.5)]))
    np.testing.assert_allclose(sky_of(panorama, 600), sky_of(panorama, 20), atol=2 * LEVELS)


@pytest.mark.parametrize("factor", [1, 2])
def test_tiles_make_the_whole_where_photos_are_burnt(monkeypatch, factor):
    monkeypatch.setattr(plan, "reduction", lambda _: factor)
    panorama = made(photos(SKY, [np.ones(3), np.full(3, BRIGHTER)]), blender="multiband")
    whole = panorama.canvas.region
    pixels = panorama.read(whole).pixels

    assert panorama.plan.light.spared[1].any()
    for tile in whole.tiles(150):
        np.testing.assert_allclose(panorama.read(tile).pixels, pixels[tile.within(whole)], atol=TILED)


def test_the_map_says_where_a_photo_is_burnt_and_fades_out_around_it():
    pixels = np.full((480, 640, 3), 200, np.uint8)
    assert burnt_map(pixels) is None

    pixels[:100, :100, 2] = 255
    burnt = burnt_map(pixels)

    assert burnt[0, 0] == pytest.approx(1)
    assert burnt[20:, :].max() == burnt[:, 20:].max() == 0
    assert np.abs(np.diff(burnt, axis=0)).max() < 0.5
    np.testing.assert_array_equal(burnt, burnt_map(pixels.astype(np.uint16) * 257))


def test_ratios_of_dark_and_of_bright_light_are_trusted_less():
    columns = np.repeat(np.array([12.0, 120.0, 235.0], np.float32), 40)
    pixels = np.broadcast_to(columns[None, :, None], (120, 120, 3)).copy()
    layer = Layer(Region(0, 0, 120, 120), pixels, np.ones((120, 120), bool))

    overlaps = find_overlaps([(0, layer), (1, layer)], lambda _, region: np.zeros((region.height, region.width)))

    dark, middle, bright = np.unique(overlaps.share.round(9))[[0, -1, 1]]
    assert middle > 2 * bright > 2 * dark
