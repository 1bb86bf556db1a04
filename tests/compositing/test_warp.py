"""A photo on the canvas: against the formula itself, in any part, at any size."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from compositing.mosaics import alignment_of
from panostitch.compositing import lay_out, warp
from panostitch.compositing.compose import INTERPOLATION
from panostitch.compositing.view import look
from panostitch.geometry.projections import PROJECTIONS
from panostitch.model.canvas import Canvas, Region
from panostitch.model.mesh import Mesh, flat_mesh
from panostitch.model.photo import Photo
from panostitch.options import LayoutOptions
from panostitch.synthetic.render import ArraySource
from panostitch.synthetic.scene import rig

SIZE = (400, 300)
SMALL = (180, 135)  # px, where a canvas of all directions is made pixel by pixel
LENSES = {"plain": {}, "barrel": {"k1": -0.12, "k2": 0.02}, "pincushion": {"k1": 0.05}}
SHOWN = sorted(PROJECTIONS)
SPHERE = ["equirectangular", "miller", "fisheye", "equisolid", "little-planet"]  # show every direction, or near so

# px; between exact coordinates 16 px apart a bilinear guess is off by their curvature; where that is more than 0.05,
# every pixel is exact. These photos are small, so that they bend strongly within 16 px. 0.049 seen.
COORDINATES = 0.06
# px; the same for a photo of usual size, which bends less within 16 px. 0.009 seen.
COORDINATES_LARGE = 0.03
# Grey levels, worst and mean; rounding to bytes makes 0.5 and 0.25, the coordinates 20 levels a px at the steepest.
# 2.2 and 0.29 seen.
SAMPLED_WORST, SAMPLED_MEAN = 4.0, 0.5
# Grey levels, worst and mean, by which a picture that is shifted by one pixel is off at the least. 15 and 2.9 seen.
SHIFTED_WORST, SHIFTED_MEAN = 10.0, 2.0
# Grey levels, mean; a picture reduced to a quarter, sampled where the full one is. 0.35 seen; half a reduced pixel
# aside, which is 1 or 2 px, it would be 0.8 or 1.6.
REDUCED_MEAN = 0.6
# Grey levels; float32 sums of up to 64 products of up to 255
ROUNDING = 1e-3
# px; float32 coordinates up to 400 px
SAME = 1e-4


def soft_picture(size=SIZE, seed=4):
    noise = np.random.default_rng(seed).uniform(0, 255, (size[1], size[0], 3)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), 6)
    return np.clip((soft - 127.5) * 9 + 127.5, 0, 255).astype(np.uint8)


def setting(projection="cylindrical", lens="plain", *, size=SIZE, focal=430.0):
    """A camera that looks aside and is rolled, and the canvas for it and its neighbours."""
    cameras = rig([-0.3, 0.15, 0.3], [0.1, -0.12, 0.0], [0.05, 0.2, 0.0], size=size, focal=focal, **LENSES[lens])
    return cameras[1], lay_out(alignment_of(cameras), LayoutOptions(projection=projection))


def exact(camera, canvas, region):
    """Where each canvas pixel (h, w, 2) lies in the photo, by the formula itself."""
    x, y = np.meshgrid(np.arange(region.x, region.right), np.arange(region.y, region.bottom))
    rays = canvas.rays(np.column_stack([x.ravel(), y.ravel()]).astype(float))
    with np.errstate(invalid="ignore"):
        return camera.project(rays).reshape(region.height, region.width, 2)


def inside(xy, size, margin=0.0):
    return ((xy >= margin) & (xy <= np.array(size) - 1 - margin)).all(2)


@pytest.mark.parametrize("projection", SHOWN)
@pytest.mark.parametrize("lens", LENSES)
def test_coordinates_are_those_of_the_formula(projection, lens):
    camera, canvas = setting(projection, lens)

    x, y, valid = warp.blocks(camera, canvas, canvas.region).coordinates

    truth = exact(camera, canvas, canvas.region)
    seen = inside(truth, SIZE)
    assert seen.sum() > 50_000
    assert valid[seen].all()
    assert np.abs(np.dstack([x, y]) - truth)[seen].max() < COORDINATES


@pytest.mark.parametrize("projection", SPHERE)
@pytest.mark.parametrize("towards", ["back", "up", "down"])
def test_coordinates_where_projections_end(projection, towards):
    """Photos of the zenith, the nadir and straight back, where rows, circles and turns end."""
    options = LayoutOptions(projection=projection)
    cameras = rig(np.deg2rad([180, 10, 20]), np.deg2rad([0, 80, -85]), 0.1, size=SMALL, focal=190.0)
    seen_so = look(alignment_of(cameras), options)
    camera, canvas = seen_so.cameras[["back", "up", "down"].index(towards)], lay_out(seen_so, options)

    x, y, valid = warp.blocks(camera, canvas, canvas.region).coordinates

    truth = exact(camera, canvas, canvas.region)
    seen = inside(truth, SMALL)
    assert seen.any() or (projection, towards) == ("little-planet", "up")
    assert valid[seen].all()
    assert np.abs(np.dstack([x, y]) - truth)[seen].max(initial=0) < COORDINATES


def test_coordinates_of_a_photo_of_usual_size():
    camera, canvas = setting("cylindrical", "barrel", size=(2000, 1500), focal=2150.0)
    part = Region(900, 300, 1500, 1200)

    x, y, _ = warp.blocks(camera, canvas, part).coordinates

    truth = exact(camera, canvas, part)
    seen = inside(truth, camera.size)
    assert seen.sum() > 500_000
    assert np.abs(np.dstack([x, y]) - truth)[seen].max() < COORDINATES_LARGE


@pytest.mark.parametrize("projection", SHOWN)
@pytest.mark.parametrize("lens", LENSES)
def test_pixels_are_those_of_the_formula_sampled_by_scipy(projection, lens):
    camera, canvas = setting(projection, lens)
    picture = soft_picture()

    layer = warp.warp_and_place((picture, None), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[0]

    worst, mean = off(layer, picture, exact(camera, canvas, canvas.region))
    assert worst < SAMPLED_WORST
    assert mean < SAMPLED_MEAN


def off(layer, picture, truth):
    """Largest and mean difference (grey levels) between a layer and a picture sampled at the true places."""
    seen = inside(truth, SIZE, margin=1.0)
    assert layer.mask[seen].all()
    at = truth[seen].T[::-1]
    sampled = np.column_stack([map_coordinates(picture[..., c].astype(float), at, order=1) for c in range(3)])
    difference = np.abs(layer.pixels[seen] - sampled)
    return float(difference.max()), float(difference.mean())


@pytest.mark.parametrize("interpolation", INTERPOLATION.values(), ids=list(INTERPOLATION))
@pytest.mark.parametrize(("right", "down"), [(0.4, 0.5), (0.0, 0.0), (0.9, 0.9), (-3.0, 0.0)])
def test_a_region_is_sampled_as_from_the_whole_photo(right, down, interpolation):
    """From its window, which must hold all that an interpolation looks at; within, across and beyond edges."""
    camera, canvas = setting()
    picture = np.random.default_rng(8).integers(0, 256, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
    (seen,) = warp.footprints([camera], canvas)[0]
    grid = warp.blocks(
        camera, canvas, Region(seen.x + int(right * seen.width), seen.y + int(down * seen.height), 60, 50)
    )
    assert grid.window.area < picture[..., 0].size / 4

    layer = warp.sample((picture, None), grid, interpolation)

    x, y, _ = grid.coordinates
    whole = cv2.remap(picture.astype(np.float32), x, y, interpolation, borderMode=cv2.BORDER_REPLICATE)
    np.testing.assert_allclose(layer.pixels, whole, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("shift", [(1, 0), (0, 1)])
def test_one_pixel_is_noticed(shift):
    camera, canvas = setting()
    picture = soft_picture()
    moved = np.roll(picture, shift, axis=(1, 0))

    layer = warp.warp_and_place((moved, None), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[0]

    worst, mean = off(layer, picture, exact(camera, canvas, canvas.region))
    assert worst > SHIFTED_WORST
    assert mean > SHIFTED_MEAN


@pytest.mark.parametrize("region", [Region(37, 11, 200, 150), Region(0, 0, 16, 16), Region(301, 123, 1, 1)])
@pytest.mark.parametrize("projection", SHOWN)
def test_a_part_has_the_coordinates_of_the_whole(projection, region):
    camera, canvas = setting(projection, "barrel")

    whole = warp.blocks(camera, canvas, canvas.region).coordinates
    part = warp.blocks(camera, canvas, region).coordinates

    rows_columns = region.within(canvas.region)
    for a, b in zip(whole[:2], part[:2], strict=True):
        np.testing.assert_allclose(b, a[rows_columns], rtol=0, atol=SAME)
    assert np.array_equal(part[2], whole[2][rows_columns])


def bent(camera):
    """The camera with a mesh that displaces by up to 3 px."""
    mesh = flat_mesh(camera.size)
    return replace(camera, mesh=Mesh(camera.size, np.random.default_rng(2).uniform(-2, 2, mesh.nodes.shape)))


def test_a_mesh_is_part_of_the_coordinates():
    plain, canvas = setting()
    camera = bent(plain)

    x, y, _ = warp.blocks(camera, canvas, canvas.region).coordinates

    truth = exact(camera, canvas, canvas.region)
    seen = inside(truth, SIZE)
    assert np.abs(np.dstack([x, y]) - truth)[seen].max() < COORDINATES
    assert np.abs(truth - exact(plain, canvas, canvas.region))[seen].max() > 1.0  # px


def test_a_mesh_is_the_same_in_every_part():
    camera, canvas = setting()
    region = Region(37, 11, 200, 150)

    whole = warp.blocks(bent(camera), canvas, canvas.region).coordinates
    part = warp.blocks(bent(camera), canvas, region).coordinates

    for a, b in zip(whole[:2], part[:2], strict=True):
        np.testing.assert_allclose(b, a[region.within(canvas.region)], rtol=0, atol=SAME)


def test_parts_may_lie_beside_the_canvas():
    camera, canvas = setting()
    beside = Region(-40, -30, 100, 90)

    part = warp.blocks(camera, canvas, beside).coordinates
    whole = warp.blocks(camera, canvas, Region(0, 0, 60, 60)).coordinates

    np.testing.assert_allclose(part[0][30:, 40:], whole[0], rtol=0, atol=SAME)


def test_large_regions_are_made_in_pieces(monkeypatch):
    camera, canvas = setting()
    picture = soft_picture()
    at_once = warp.warp_and_place((picture, None), camera, canvas, canvas.region, interpolation=cv2.INTER_CUBIC)[0]

    monkeypatch.setattr(warp, "CHUNK", 100)
    in_pieces = warp.warp_and_place((picture, None), camera, canvas, canvas.region, interpolation=cv2.INTER_CUBIC)[0]

    assert np.array_equal(in_pieces.mask, at_once.mask)
    np.testing.assert_allclose(in_pieces.pixels, at_once.pixels, atol=SAMPLED_WORST)


@pytest.mark.parametrize("lens", LENSES)
def test_the_mask_is_the_photo_s_outline(lens):
    camera, canvas = setting("cylindrical", lens)

    layer = warp.warp_and_place((soft_picture(), None), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[
        0
    ]

    truth = exact(camera, canvas, canvas.region)
    assert layer.mask[inside(truth, SIZE, margin=-0.5 + COORDINATES)].all()
    assert not layer.mask[~inside(truth, SIZE, margin=-0.5 - COORDINATES)].any()


def test_nothing_is_seen_behind_the_camera():
    camera = rig([0.0], size=SIZE, focal=430.0)[0]
    canvas = Canvas("equirectangular", 100.0, (-314.0, -157.0), (629, 315))

    layer = warp.warp_and_place((soft_picture(), None), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[
        0
    ]

    assert np.isfinite(layer.pixels).all()
    columns = np.flatnonzero(layer.mask.any(0))
    # the photo is 50 degrees wide, so a tenth of the columns and a few: none of the 100 to the left or right
    assert columns.min() > 250
    assert columns.max() < 380


@pytest.mark.parametrize("projection", ["rectilinear", "cylindrical", "equirectangular"])
def test_a_photo_misses_what_its_mask_misses(projection):
    camera = rig([0.3], [0.05], [0.1], size=(1200, 900), hfov=1.0)[0]
    canvas = Canvas(projection, 1200.0, (-1500.0, -1200.0), (3000, 2400))
    raster = np.zeros((900, 1200, 3), np.uint8), None
    tiles = canvas.region.tiles(300)

    missed = [warp.blocks(camera, canvas, tile).misses for tile in tiles]
    empty = [
        not warp.warp_and_place(raster, camera, canvas, tile, interpolation=cv2.INTER_LINEAR)[0].mask.any()
        for tile in tiles
    ]

    # to overlook an empty tile costs time, to miss a pixel would leave a hole
    assert all(nothing for nothing, miss in zip(empty, missed, strict=True) if miss)
    assert sum(missed) > sum(empty) / 3 > 0


def test_transparent_pixels_stay_transparent():
    camera, canvas = setting()
    alpha = np.full((SIZE[1], SIZE[0]), 255, np.uint8)
    alpha[100:200, 150:250] = 0

    layer = warp.warp_and_place((soft_picture(), alpha), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[
        0
    ]

    xy = exact(camera, canvas, canvas.region)
    hole = inside(xy - (150, 100), (100, 100))
    well_beside = inside(xy, SIZE, margin=1) & ~inside(xy - (150, 100), (100, 100), margin=-2)
    assert hole.sum() > 5000
    assert not layer.mask[hole].any()
    assert layer.mask[well_beside].all()


FOOTPRINT_CASES = {
    "row": rig([-0.5, 0.0, 0.5], 0.1, 0.2, size=SIZE, focal=430.0),
    "ring": rig(np.arange(8) * np.pi / 4 + 0.3, 0.0, 0.1, size=SIZE, focal=430.0),
    "zenith": rig([0.0, 1.0], [1.4, 0.9], size=SIZE, focal=430.0),
    "back": rig([np.pi, 0.1], [0.05, 0.0], 0.3, size=SIZE, focal=430.0),
    "quarter turns": rig([0.0, 0.3], 0.0, [np.pi / 2, 0.0], size=SIZE, focal=430.0),
}


@pytest.mark.parametrize("case", FOOTPRINT_CASES)
@pytest.mark.parametrize("factor", [2, 4])
def test_footprints_hold_every_pixel_of_a_photo(case, factor):
    cameras = FOOTPRINT_CASES[case]
    canvas = lay_out(alignment_of(cameras), LayoutOptions())
    small = canvas.reduced(factor)

    places = warp.footprints(cameras, small)

    for camera, regions in zip(cameras, places, strict=True):
        outside = np.ones((small.size[1], small.size[0]), bool)
        for region in regions:
            assert (region & small.region) == region
            assert outside[region.within(small.region)].all(), "two parts of a footprint overlap"
            outside[region.within(small.region)] = False
        assert not (inside(exact(camera, small, small.region), SIZE, margin=-0.5) & outside).any()


def test_a_photo_across_the_edge_of_a_turn_is_in_two_pieces():
    cameras = FOOTPRINT_CASES["ring"]
    canvas = lay_out(alignment_of(cameras), LayoutOptions())

    counts = [len(regions) for regions in warp.footprints(cameras, canvas)]

    assert canvas.wraps
    assert max(counts) == 2
    assert sum(counts) < 2 * len(cameras)


@pytest.mark.parametrize("scale", [1.0, 0.8, 0.5, 0.2])
def test_photos_are_read_no_larger_than_needed(scale):
    camera, _ = setting()
    picture = soft_picture()
    canvas = lay_out(alignment_of([camera]), LayoutOptions(scale=scale))

    (pixels, _), reduced = warp.read_for(Photo("p", SIZE, ArraySource(picture)), camera, canvas)

    height, width = pixels.shape[:2]
    assert reduced.size == (width, height)
    assert width == (SIZE[0] if scale > 0.75 else SIZE[0] * scale)
    # the reduced camera sees the same rays: the outline of the photo stays where it is
    np.testing.assert_allclose(
        canvas.pixels(reduced.rays(reduced.outline())), canvas.pixels(camera.rays(camera.outline())), atol=SAME
    )


@pytest.mark.parametrize("scale", [0.5, 0.25])
def test_a_reduced_photo_lies_where_the_full_one_does(scale):
    camera, _ = setting()
    picture = cv2.GaussianBlur(soft_picture(), (0, 0), 10)  # reducing must not cost it any detail
    canvas = lay_out(alignment_of([camera]), LayoutOptions(scale=scale))

    raster, small_camera = warp.read_for(Photo("p", SIZE, ArraySource(picture)), camera, canvas)
    small = warp.warp_and_place(raster, small_camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[0]
    full = warp.warp_and_place((picture, None), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR)[0]
    aside = warp.warp_and_place(
        (np.roll(picture, 2, axis=1), None), camera, canvas, canvas.region, interpolation=cv2.INTER_LINEAR
    )[0]

    both = cv2.erode((small.mask & full.mask).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert raster[0].shape[1] == SIZE[0] * scale
    assert np.abs(small.pixels - full.pixels)[both].mean() < REDUCED_MEAN
    assert np.abs(small.pixels - aside.pixels)[both].mean() > 2 * REDUCED_MEAN
