"""Six faces that fit together: what the sphere shows, without a step where faces touch in the world."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from compositing.mosaics import alignment_of, shifted
from panostitch import pipeline
from panostitch.compositing import plan
from panostitch.compositing.cube import SIDE_MULTIPLE
from panostitch.errors import UsageError
from panostitch.geometry.projections.cube import FACES, FRONT
from panostitch.io.writers import assemble
from panostitch.model.canvas import Region
from panostitch.options import Options
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene

SIZE, HFOV = (120, 160), np.deg2rad(60)
QUICK = {"exposure": "none", "seams": "voronoi", "blender": "none"}
EV = 0.3  # EV; steps of the light from photo to photo

# Grey levels, mean and most of the smoothed difference between the row and the sphere along its rays; they are sampled
# differently, which smoothing by so many px takes away: 0.20 and 2.1 seen; without the change of the low bands 0.35
# and 3.7, with the plan one reduced pixel aside 0.28 and 5.8
SMOOTHED, MEAN_OFF, MOST_OFF = 4.0, 0.25, 3.0
# Times, of means along a whole edge; how much more neighbours across an edge differ than neighbours beside it: 0.81 to
# 1.03 seen
ACROSS_EDGE = 1.2
# Grey levels; tiles and the whole differ by the rounding of float32 sums of up to 255
TILED = 1e-3


def all_around():
    """Cameras in three rings, and one straight up and down."""
    rings = [(0, 8), (45, 6), (-45, 6), (90, 1), (-90, 1)]
    yaw, pitch = zip(*[(360 * n / count + 10, up) for up, count in rings for n in range(count)], strict=True)
    return rig(np.deg2rad(yaw), np.deg2rad(pitch), size=SIZE, hfov=HFOV)


@pytest.fixture(scope="module")
def alignment():
    scene = sphere_scene(procedural_texture(640, 320, seed=5))
    cameras = all_around()
    light = [EV * (-1) ** n for n in range(len(cameras))]
    return alignment_of(cameras, [photograph(scene, c, exposure=e) for c, e in zip(cameras, light, strict=True)])


@pytest.fixture(scope="module", autouse=True)
def small_plan():
    """Plans are reduced, as those of large pictures are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "PLAN_PIXELS", 2e4)
        yield


@pytest.fixture(scope="module")
def cube(alignment):
    return pipeline.render(alignment, Options.of(projection="cube"))


@pytest.fixture(scope="module")
def sphere(alignment):
    return pipeline.render(alignment, Options.of(projection="equirectangular", fov="360x180"))


@pytest.fixture(scope="module")
def row(cube):
    pixels, mask = assemble(cube)
    assert mask.all()
    return pixels.astype(np.float32)


def face(row, name):
    side = row.shape[0]
    return row[:, FACES.index(name) * side :][:, :side]


def test_a_face_has_the_resolution_of_the_photos_in_its_middle(alignment, cube):
    width, side = cube.canvas.size

    assert (width, side % SIDE_MULTIPLE) == (len(FACES) * side, 0)
    assert side == pytest.approx(2 * alignment.cameras[0].focal, abs=SIDE_MULTIPLE / 2)
    assert cube.plan.crop == cube.canvas.region


def test_where_all_is_covered_there_is_no_alpha(cube, sphere):
    assert cube.plan.factor > 1
    assert (cube.channels, sphere.channels) == (3, 3)


def test_a_hole_at_a_pole_is_empty(alignment):
    without = replace(alignment, photos=alignment.photos[:-1], cameras=alignment.cameras[:-1])

    panorama = pipeline.render(without, Options.of(projection="equirectangular", fov="360x180"))

    assert panorama.channels == 4


def test_the_faces_show_what_the_sphere_shows(cube, sphere, row):
    pixels = np.pad(assemble(sphere)[0], ((1, 1), (0, 0), (0, 0)), mode="edge").astype(np.float32)
    pixels = np.pad(pixels, ((0, 0), (1, 1), (0, 0)), mode="wrap")
    x, y = np.meshgrid(np.arange(row.shape[1], dtype=float), np.arange(row.shape[0], dtype=float))
    xy = sphere.canvas.pixels(cube.canvas.rays(np.column_stack([x.ravel(), y.ravel()]))).astype(np.float32) + 1
    xy = xy.reshape(*row.shape[:2], 2)

    off = cv2.remap(pixels, xy[..., 0], xy[..., 1], cv2.INTER_CUBIC) - row

    smooth = np.abs([cv2.GaussianBlur(face(off, name), (0, 0), SMOOTHED) for name in FACES])
    assert smooth.mean() < MEAN_OFF
    assert smooth.max() < MOST_OFF


# pairs of faces, and how each is turned (by quarters, anticlockwise) so that the second lies right of the first
TOUCHING = [
    ("left", 0, "front", 0),
    ("front", 0, "right", 0),
    ("right", 0, "back", 0),
    ("back", 0, "left", 0),
    ("up", 1, "front", 1),
    ("front", 1, "down", 1),
    ("up", 0, "right", 1),
    ("up", 3, "back", 1),
    ("up", 2, "left", 1),
    ("right", 1, "down", 2),
    ("back", 1, "down", 3),
    ("left", 1, "down", 0),
]


@pytest.mark.parametrize(("first", "turns", "second", "other_turns"), TOUCHING)
def test_no_step_where_faces_touch_in_the_world(first, turns, second, other_turns, row):
    left, right = np.rot90(face(row, first), turns), np.rot90(face(row, second), other_turns)

    across = np.abs(left[:, -1] - right[:, 0]).mean()
    beside = (np.abs(left[:, -1] - left[:, -2]).mean() + np.abs(right[:, 0] - right[:, 1]).mean()) / 2

    assert across < ACROSS_EDGE * beside


def test_tiles_make_the_whole_across_faces_too(cube):
    side = cube.canvas.size[1]
    edge = Region(2 * side - 37, 11, 91, 63)
    whole = cube.read(edge)

    for part in edge.tiles(40, 29):
        np.testing.assert_allclose(cube.read(part).pixels, whole.pixels[part.within(edge)], rtol=0, atol=TILED)
    assert cube.cost(edge) > 0


def test_what_no_photo_shows_is_empty(alignment):
    ahead = alignment_of([alignment.cameras[0]], [np.full((*SIZE[::-1], 3), 200, np.uint8)])
    cube = pipeline.render(ahead, Options.of(projection="cube", yaw=10))
    side = cube.canvas.size[1]

    _, mask = assemble(cube)

    assert cube.channels == 4
    assert mask[side // 2, FRONT * side + side // 2] == 255
    assert not np.delete(mask, np.s_[FRONT * side : (FRONT + 1) * side], axis=1).any()


@pytest.mark.parametrize(
    ("options", "size"),
    [
        ({"size": "600"}, (600, 100)),
        ({"size": "x96"}, (576, 96)),
        ({"size": "605x2000"}, (600, 100)),
        ({"scale": 0.5}, (576, 96)),
        ({"scale": 0.5, "crop": "96,0,96,96"}, (96, 96)),
    ],
)
def test_the_size_that_was_asked_for(options, size, alignment):
    crop = pipeline.render(alignment, Options.of(projection="cube", **QUICK, **options)).plan.crop

    assert (crop.width, crop.height) == size


@pytest.mark.parametrize("options", [{"fov": "120x60"}, {"crop": "full"}, {"size": "5"}, {"crop": "0,0,99999,5"}])
def test_what_a_cube_does_not_have_is_refused(options, alignment):
    with pytest.raises(UsageError):
        pipeline.render(alignment, Options.of(projection="cube", **options))


@pytest.mark.parametrize("options", [{"fov": "120x60"}, {"crop": "full"}])
def test_options_that_contradict_a_cube_are_refused_before_anything_is_done(options):
    with pytest.raises(UsageError, match=next(iter(options))):
        Options.of(projection="cube", **options).check()
    Options.of(projection="equirectangular", **options).check()


def test_a_flat_subject_has_no_faces():
    scan = alignment_of([shifted(SIZE, 0, 0)], [np.zeros((*SIZE[::-1], 3), np.uint8)], model="homography")

    with pytest.raises(UsageError, match="cube cannot show a flat subject"):
        pipeline.render(scan, Options.of(projection="cube"))
