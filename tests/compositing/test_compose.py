"""The panorama as a function of a region: tiles make the whole, known pictures come back, turns close."""

import sys
import tracemalloc
from dataclasses import replace

import cv2
import numpy as np
import pytest

from compositing.mosaics import alignment_of, panorama_of, shifted
from panostitch.compositing import lay_out, make_panorama, make_plan, plan
from panostitch.compositing.compose import Sight
from panostitch.compositing.cost import decoded_bytes
from panostitch.compositing.seams import SEAMS
from panostitch.io.writers import assemble
from panostitch.model.canvas import Region
from panostitch.model.panorama import NOBODY
from panostitch.options import CompositingOptions, LayoutOptions
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene

# Grey levels; tiles and the whole differ by the rounding of float32 sums of up to 255. 6e-5 seen.
TILED = 1e-3
# Share of bytes that may differ by one level, where a value lies between two. 7e-6 seen.
TILED_BYTES = 1e-4

# Grey levels; a picture cut into pieces that overlap by two thirds comes back: 0.7 seen. (Where they overlap less, the
# lowest bands reach beyond the overlap and into what is made up there: up to 5 levels.)
IDENTITY = 1.0

# Steps of +-0.3 EV in the light: 10 % of encoded brightness. What is left of the planted ratios, see contracts.
EV = 0.3
LEFT = 0.35  # share of the planted step; 0.2 seen

DARK, LIGHT = 80, 160  # grey levels of two photos that meet at the edge of a turn
BLENDED_SEAM = 8.0  # grey levels; a tenth of that step, 2 seen

# Times; how much more neighbours across the edge of a turn may differ than neighbours elsewhere (95th percentile over
# the columns). 0.54 seen.
ACROSS_EDGE = 1.15


@pytest.fixture(scope="module")
def scene():
    return sphere_scene(procedural_texture(1400, 700, seed=5))


def cameras_in_a_row():
    return rig(np.deg2rad([-20, 0, 22]), np.deg2rad([1, -2, 2]), np.deg2rad([1, 0, -2]), size=(320, 240), hfov=0.85)


def cameras_in_a_ring():
    return rig(np.arange(8) * np.pi / 4, 0.02, 0.01, size=(320, 240), hfov=np.deg2rad(65))


@pytest.fixture(scope="module")
def row(scene):
    cameras = cameras_in_a_row()
    steps = (EV, -EV, EV)
    return alignment_of(cameras, [photograph(scene, c, exposure=e) for c, e in zip(cameras, steps, strict=True)])


@pytest.fixture(scope="module")
def ring(scene):
    cameras = cameras_in_a_ring()
    steps = (EV, -EV, 0, EV, 0, -EV, EV, -EV)
    return alignment_of(cameras, [photograph(scene, c, exposure=e) for c, e in zip(cameras, steps, strict=True)])


def at_factor(monkeypatch, alignment, factor, **options):
    """A panorama whose plan is reduced by this factor."""
    uncropped = LayoutOptions(crop="none")
    area = lay_out(alignment, uncropped).region.area
    monkeypatch.setattr(plan, "PLAN_PIXELS", 1.02 * area / factor**2)
    made = panorama_of(alignment, layout=uncropped, compositing=CompositingOptions(**options))
    assert made.plan.factor == factor
    return made


def stitched_from_tiles(panorama, side):
    whole = panorama.canvas.region
    pixels = np.zeros((whole.height, whole.width, 3), np.float32)
    covered = np.zeros((whole.height, whole.width), bool)
    for tile in whole.tiles(side):
        layer = panorama.read(tile)
        pixels[tile.within(whole)], covered[tile.within(whole)] = layer.pixels, layer.mask
    return pixels, covered


TILINGS = [("multiband", side) for side in (100, 256, 777)] + [("feather", 100), ("none", 256)]


@pytest.mark.parametrize(("blender", "side"), TILINGS)
@pytest.mark.parametrize("factor", [1, 4])
def test_tiles_make_the_whole(row, monkeypatch, blender, factor, side):
    panorama = at_factor(monkeypatch, row, factor, blender=blender)
    whole = panorama.read(panorama.canvas.region)

    pixels, covered = stitched_from_tiles(panorama, side)

    assert np.array_equal(covered, whole.mask)
    np.testing.assert_allclose(pixels, whole.pixels, atol=TILED)
    assert (np.rint(pixels) != np.rint(whole.pixels)).mean() < TILED_BYTES


@pytest.mark.parametrize("factor", [1, 4])
def test_tiles_of_a_closed_turn_make_the_whole(ring, monkeypatch, factor):
    panorama = at_factor(monkeypatch, ring, factor)
    assert panorama.canvas.wraps
    whole = panorama.read(panorama.canvas.region)

    pixels, covered = stitched_from_tiles(panorama, 256)

    assert np.array_equal(covered, whole.mask)
    np.testing.assert_allclose(pixels, whole.pixels, atol=TILED)


@pytest.mark.parametrize("region", [Region(17, 33, 1, 1), Region(101, 50, 3, 90), Region(0, 0, 64, 5)])
def test_any_region_is_a_part_of_the_whole(row, monkeypatch, region):
    panorama = at_factor(monkeypatch, row, 4)
    whole = panorama.read(panorama.canvas.region)

    part = panorama.read(region)

    assert part.region == region
    assert part.pixels.shape == (region.height, region.width, 3)
    assert part.pixels.dtype == np.float32
    assert np.array_equal(part.mask, whole.mask[region.within(whole.region)])
    np.testing.assert_allclose(part.pixels, whole.pixels[region.within(whole.region)], atol=TILED)


def test_threads_make_the_same_bytes(row):
    panorama = panorama_of(row)

    one, four = (assemble(panorama, run=Executor(threads)) for threads in (1, 4))

    assert np.array_equal(one[0], four[0])
    assert np.array_equal(one[1], four[1])


def test_reading_twice_gives_the_same(row):
    panorama = panorama_of(row)
    region = Region(50, 40, 200, 100)

    assert np.array_equal(panorama.read(region).pixels, panorama.read(region).pixels)


def test_uncovered_pixels_are_black_and_masked(row, monkeypatch):
    panorama = at_factor(monkeypatch, row, 2)
    layer = panorama.read(panorama.canvas.region)

    assert 0.5 < layer.mask.mean() < 0.99
    assert not layer.pixels[~layer.mask].any()
    # each photo's middle is covered
    for camera in row.cameras:
        x, y = panorama.canvas.pixels(camera.rays(np.array([camera.centre])))[0]
        assert layer.mask[round(y), round(x)]


@pytest.mark.parametrize("factor", [1, 2, 4, 8])
@pytest.mark.parametrize("width", [200, 203])
def test_a_full_rectangle_is_covered_to_its_last_pixel(monkeypatch, width, factor):
    # the canvas ends where the photos do, so that the first and last pixels of the reduced one are covered in part
    cameras = [shifted((width, 151), x, y) for x, y in ((0.0, 0.0), (100.3, 0.4))]
    alignment = alignment_of(cameras, [np.full((151, width, 3), LIGHT, np.uint8)] * 2, model="homography")
    canvas, options = lay_out(alignment, LayoutOptions()), CompositingOptions()
    monkeypatch.setattr(plan, "PLAN_PIXELS", 1.02 * canvas.region.area / factor**2)

    planned = make_plan(alignment, canvas, options, "full")

    assert planned.factor == factor
    assert make_panorama(alignment, canvas, planned, options).read(planned.crop).mask.all()
    assert planned.covered


def test_a_full_rectangle_of_a_closed_turn_goes_all_around(ring, monkeypatch):
    canvas, options = lay_out(ring, LayoutOptions()), CompositingOptions()
    monkeypatch.setattr(plan, "PLAN_PIXELS", 1.02 * canvas.region.area / 4**2)

    planned = make_plan(ring, canvas, options, "full")

    assert planned.crop.width == canvas.size[0]
    assert planned.covered


@pytest.mark.parametrize("factor", [1, 4])
def test_a_picture_in_pieces_comes_back(views, monkeypatch, factor):
    picture = views[0]
    pieces, cameras = [], []
    for y in (0, 60):
        for x in (0, 100):
            pieces.append(picture[y : y + 240, x : x + 300])
            cameras.append(shifted((300, 240), x, y))
    panorama = at_factor(monkeypatch, alignment_of(cameras, pieces, model="homography"), factor)
    left, top = (-int(v) for v in panorama.canvas.origin)

    layer = panorama.read(Region(left, top, 400, 300))

    assert layer.mask.all()
    np.testing.assert_allclose(layer.pixels, picture, atol=IDENTITY)
    np.testing.assert_allclose(panorama.plan.light.gains, 1, atol=1e-3)


def test_the_rendered_plane_is_cv2_s_warp_of_the_photo(views):
    first = shifted((400, 300), 0, 0)
    matrix = np.array([[0.95, 0.08, -210.0], [-0.05, 1.02, 25.0], [1e-4, -1.5e-4, 1.0]])
    second = replace(first, cam_from_world=matrix)
    picture = cv2.GaussianBlur(views[0], (0, 0), 1.5)  # two cubic kernels differ on the finest detail
    alignment = alignment_of([first, second], [picture, cv2.GaussianBlur(views[1], (0, 0), 1.5)], model="homography")
    panorama = panorama_of(
        alignment, layout=LayoutOptions(crop="none"), compositing=CompositingOptions(exposure="none", blender="none")
    )
    canvas = panorama.canvas

    layer = panorama.read(canvas.region)

    plane_from_canvas = np.array([[1, 0, canvas.origin[0]], [0, 1, canvas.origin[1]], [0, 0, 1.0]])
    expected = cv2.warpPerspective(
        alignment.photos[1].source.pixels,
        matrix @ plane_from_canvas,
        canvas.size,
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
    )
    whole = np.full((300, 400), 255, np.uint8)
    alone, other = (
        cv2.warpPerspective(whole, m @ plane_from_canvas, canvas.size, flags=cv2.WARP_INVERSE_MAP)
        for m in (matrix, np.eye(3))
    )
    interior = (cv2.erode(alone, np.ones((9, 9), np.uint8)) == 255) & (cv2.dilate(other, np.ones((9, 9))) == 0)
    assert interior.sum() > 30_000
    difference = np.abs(layer.pixels[interior] - expected[interior])
    assert difference.max() < WARP_PERSPECTIVE[0]
    assert difference.mean() < WARP_PERSPECTIVE[1]


# Grey levels, worst and mean: coordinates between nodes 16 px apart are off by 0.02 px, and OpenCV samples at 1/32 px,
# of a picture that changes by up to 30 levels a px. 1.9 and 0.3 seen, half of it by rounding to bytes.
WARP_PERSPECTIVE = (4.0, 0.6)


def brightness_steps(gains):
    """Largest ratio of what neighbours in the row show after these gains."""
    factors = np.array([2 ** (e / 2.2) for e in (EV, -EV, EV)]) * gains
    return np.abs(np.diff(np.log(factors))).max()


def test_planted_exposure_steps_shrink(row):
    gains = panorama_of(row).plan.light.brightness

    assert brightness_steps(gains) < LEFT * brightness_steps(np.ones(3))
    assert panorama_of(row, compositing=CompositingOptions(exposure="none")).plan.light.brightness.tolist() == [1, 1, 1]


@pytest.mark.parametrize("factor", [1, 4])
def test_gains_reach_the_pixels(views, monkeypatch, factor):
    light = views[0]
    dark = np.rint(light * 0.8).astype(np.uint8)
    pieces, cameras = [light[:, :240], dark[:, 160:]], [shifted((240, 300), 0, 0), shifted((240, 300), 160, 0)]
    alignment = alignment_of(cameras, pieces, model="homography")

    steps = {}
    for exposed in ("gain", "none"):
        panorama = at_factor(monkeypatch, alignment, factor, exposure=exposed, blender="none")
        left, top = (-int(v) for v in panorama.canvas.origin)
        ratio = np.log(panorama.read(Region(left, top, 400, 300)).pixels.mean(2) + 1) - np.log(light.mean(2) + 1)
        steps[exposed] = abs(np.median(ratio[:, :100]) - np.median(ratio[:, -100:]))

    assert steps["none"] == pytest.approx(-np.log(0.8), rel=0.05)
    assert steps["gain"] < LEFT * steps["none"]


def step_at_edge(pixels, mask):
    """How much the first and the last column differ, over what neighbouring columns usually do."""
    rows = mask[:, [0, -1]].all(1)
    assert rows.mean() > 0.5
    soft = cv2.blur(pixels, (1, 9))[rows]  # grain averages out along the seam, a step does not
    elsewhere = np.abs(np.diff(soft, axis=1)).mean((0, 2))
    return np.abs(soft[:, 0] - soft[:, -1]).mean() / np.percentile(elsewhere, 95)


@pytest.mark.parametrize("factor", [1, 4])
@pytest.mark.parametrize(("blender", "exposure"), [("multiband", "gain"), ("multiband", "none"), ("feather", "none")])
def test_a_turn_closes_without_a_step(ring, monkeypatch, factor, exposure, blender):
    panorama = at_factor(monkeypatch, ring, factor, exposure=exposure, blender=blender)
    layer = panorama.read(panorama.canvas.region)

    assert panorama.canvas.wraps
    assert step_at_edge(layer.pixels, layer.mask) < ACROSS_EDGE


def nearest_in_longitude(canvas, pieces):
    """Seams half-way between eight cameras, the first of which look 22.5 degrees beside the edge of the turn."""
    labels = np.full(canvas.size[::-1], NOBODY, np.int16)
    longitude = (np.arange(canvas.size[0]) + 0.5) / canvas.size[0] * 8 - 4
    owner = np.broadcast_to(np.floor(longitude).astype(int) % 8, labels.shape)
    for photo, layer in pieces:
        place = layer.region.within(canvas.region)
        labels[place][layer.mask & (owner[place] == photo)] = photo
    return labels


@pytest.mark.parametrize("factor", [1, 4])
def test_a_seam_on_the_very_edge_of_a_turn_is_blended(monkeypatch, factor):
    cameras = rig((np.arange(8) + 0.5) * np.pi / 4, size=(320, 240), hfov=np.deg2rad(65))
    plain = [np.full((240, 320, 3), LIGHT if n % 2 else DARK, np.uint8) for n in range(8)]
    monkeypatch.setitem(SEAMS, "voronoi", nearest_in_longitude)

    step = {}
    for blender in ("multiband", "none"):
        panorama = at_factor(
            monkeypatch, alignment_of(cameras, plain), factor, exposure="none", blender=blender, seams="voronoi"
        )
        assert panorama.canvas.wraps
        pixels = panorama.read(panorama.canvas.region).pixels[60:-60, :, 0]
        step[blender] = float(np.abs(pixels[:, 0] - pixels[:, -1]).max())

    assert step["none"] == LIGHT - DARK
    assert step["multiband"] < BLENDED_SEAM


def test_the_step_would_be_seen(ring, monkeypatch):
    panorama = at_factor(monkeypatch, ring, 4)
    layer = panorama.read(panorama.canvas.region)
    darker = layer.pixels.copy()
    darker[:, : layer.region.width // 2] *= 0.9

    missing = np.roll(layer.pixels, 40, axis=1)[:, 20:]

    assert step_at_edge(darker, layer.mask) > ACROSS_EDGE
    assert step_at_edge(missing, layer.mask[:, 20:]) > ACROSS_EDGE


def test_a_region_is_cut_into_parts_that_share_it_out_and_part_the_photos(monkeypatch, ring):
    monkeypatch.setattr(sys.modules[Sight.__module__], "SMALLEST", 32)
    monkeypatch.setattr(sys.modules[Sight.__module__], "IN_CACHE", 8000)
    work = at_factor(monkeypatch, ring, 4).read.args[0]
    region = Region(40, 8, 700, 200)

    sight = Sight(work, work.around(region))
    parts = list(sight.parts(region))

    count = np.zeros((region.height, region.width), int)
    for part, photos in parts:
        count[part.within(region)] += 1
        owners = work.plan.labels[part.grown(0, multiple=4).divided(4).within(work.canvas.reduced(4).region)]
        assert set(np.unique(owners)) <= set(photos) == set(work.photos(part))
    assert (count == 1).all()
    alone = sum(part.area for part, photos in parts if len(photos) == 1)
    assert alone > region.area / 4
    assert max(part.area for part, photos in parts if len(photos) > 1) < region.area / 4


def test_fewer_photos_are_kept_by_columns_than_by_rows(monkeypatch, ring):
    panorama = at_factor(monkeypatch, ring, 4)
    rows = panorama.canvas.region.tiles(100, 60)
    columns = sorted(rows, key=lambda tile: tile.x)
    photo = decoded_bytes(ring.photos[:1])

    assert panorama.kept(rows) == len(ring.photos) * photo
    # the photo across the edge of the turn, and those that meet in one column of tiles
    assert 2 * photo <= panorama.kept(columns) <= 4 * photo
    assert replace(panorama, budget=photo).kept(rows) == photo


def test_what_a_tile_takes_is_not_more_than_was_said(monkeypatch, ring):
    panorama = at_factor(monkeypatch, ring, 4)
    region = Region(100, 10, 512, 200)
    panorama.read(region)  # decodes

    tracemalloc.start()
    panorama.read(region)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()

    assert taken <= panorama.cost(region)
