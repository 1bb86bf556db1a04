"""Pictures of a given size, field of view or rectangle: exactly that, and nothing empty where all is covered."""

import numpy as np
import pytest

from compositing.mosaics import alignment_of, shifted
from panostitch import pipeline
from panostitch.compositing import frame, make_plan
from panostitch.compositing.plan import reduction
from panostitch.errors import UsageError
from panostitch.io.writers import assemble
from panostitch.model.canvas import Canvas
from panostitch.options import CompositingOptions, LayoutOptions, Options
from panostitch.synthetic.scene import rig

SIZE, HFOV = (400, 300), np.deg2rad(50)
QUICK = CompositingOptions(exposure="none", seams="voronoi", blender="none")

# degrees: half a pixel of a canvas 500 px wide and up to 180 degrees across
HALF_PIXEL = 0.2
# px: two cells of the canvas on each side, which is not reduced, and a rounding
SAME_VIEW = 5


def row(first=-30, last=30, count=4, **angles):
    return rig(np.deg2rad(np.linspace(first, last, count)), size=SIZE, hfov=HFOV, **angles)


def ring(count=9):
    return rig(np.arange(count) * 2 * np.pi / count - np.pi, size=SIZE, hfov=HFOV)


def scan():
    return [shifted(SIZE, x, y) for x, y in ((0, 0), (250, 10), (500, -5))]


def planned(cameras, *, model="rotation", **options):
    alignment = alignment_of(cameras, [np.zeros((300, 400, 3), np.uint8)] * len(cameras), model=model)
    canvas, crop = frame(alignment, LayoutOptions(**options))
    return canvas, make_plan(alignment, canvas, QUICK, crop)


SCENES = {"row": (row(), "rotation"), "ring": (ring(), "rotation"), "scan": (scan(), "homography")}


@pytest.mark.parametrize(
    ("scene", "crop", "size"),
    [
        ("row", "full", "448"),
        ("row", "full", "2400x4000"),
        ("row", "none", "4000x100"),
        ("scan", "full", "x150"),
        ("scan", "full", "2400"),
        ("ring", "full", "x100"),
        ("ring", "none", "448x400"),
        ("ring", "full", "1600x100"),
    ],
)
def test_the_picture_has_the_size_that_was_asked_for(scene, crop, size):
    cameras, model = SCENES[scene]
    canvas, plan = planned(cameras, model=model, size=size, crop=crop)
    plain, cut = planned(cameras, model=model, crop=crop)
    width, height = plan.crop.width, plan.crop.height

    asked = LayoutOptions(size=size).sides
    exact = [own == side for own, side in zip((width, height), asked, strict=True) if side]
    assert any(exact)
    assert all(own <= side for own, side in zip((width, height), asked, strict=True) if side)
    assert canvas.wraps == plain.wraps
    # a closed turn given by its height is as wide as a multiple of 64 px comes near
    slack = (64 / width if scene == "ring" else 1 / height) + SAME_VIEW / cut.crop.height
    assert width / height == pytest.approx(cut.crop.width / cut.crop.height, rel=slack)
    assert plan.covered == (crop == "full")


def test_a_picture_of_another_size_shows_the_same():
    plain, cut = planned(row(), crop="full")
    canvas, _ = planned(row(), crop="full", size="300")

    corners = np.array([[-0.5, -0.5], [canvas.size[0] - 0.5, canvas.size[1] - 0.5]])
    own = np.array([[cut.crop.x - 0.5, cut.crop.y - 0.5], [cut.crop.right - 0.5, cut.crop.bottom - 0.5]])
    np.testing.assert_allclose(plain.pixels(canvas.rays(corners)), own, atol=SAME_VIEW)


def test_a_turn_that_would_not_close_is_refused_with_one_that_does():
    with pytest.raises(UsageError, match="multiple of 8") as caught:
        planned(ring(), size="10001")

    assert caught.value.hint == "use --size 10000"


def angle(a, b):
    return np.rad2deg(np.arccos(np.sum(a * b, -1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)))


@pytest.mark.parametrize(
    ("projection", "across", "down"),
    [
        ("rectilinear", 60, 40),
        ("panini", 110, 50),
        ("cylindrical", 150, 60),
        ("equirectangular", 40, 170),
        ("stereographic", 170, 90),
        ("transverse-mercator", 40, 170),
    ],
)
def test_the_canvas_shows_the_field_that_was_asked_for(projection, across, down):
    alignment = alignment_of(ring())
    canvas, crop = frame(alignment, LayoutOptions(projection=projection, fov=f"{across}x{down}", scale=0.5))

    x, y = (np.array(canvas.size) - 1) / 2
    left, right = canvas.rays(np.array([[-0.5, y], [canvas.size[0] - 0.5, y]]))
    top, bottom = canvas.rays(np.array([[x, -0.5], [x, canvas.size[1] - 0.5]]))
    assert angle(left, right) == pytest.approx(across, abs=HALF_PIXEL)
    assert angle(top, bottom) == pytest.approx(down, abs=HALF_PIXEL)
    np.testing.assert_allclose(canvas.rays(np.array([[x, y]]))[0, :2], 0, atol=1e-9)
    assert crop == "none"


def test_a_whole_sphere_is_twice_as_wide_as_high():
    canvas, plan = planned(row(), fov="360x180", scale=0.5)

    assert canvas.projection == "equirectangular"
    assert canvas.wraps
    assert (plan.crop.width, plan.crop.height) == canvas.size == (canvas.size[0], canvas.size[0] // 2)
    assert not plan.covered
    assert planned(row(), fov="360x180", size="640")[0].size == (640, 320)


def test_a_part_of_a_ring_may_be_rectilinear_and_is_full():
    canvas, plan = planned(ring(), fov="60x30")

    assert canvas.projection == "rectilinear"
    assert "60 degrees wide" in canvas.reason
    assert plan.covered


def test_the_width_alone_leaves_the_height_to_the_photos():
    whole, _ = planned(ring(), projection="cylindrical")
    canvas, _ = planned(ring(), projection="cylindrical", fov="90")

    assert canvas.size[0] == pytest.approx(np.pi / 2 * canvas.scale, abs=1)
    assert canvas.size[1] == pytest.approx(whole.size[1], rel=0.02)


@pytest.mark.parametrize(
    ("options", "model", "word"),
    [
        ({"fov": "200", "projection": "rectilinear"}, "rotation", "cannot show this"),
        ({"fov": "90x200", "projection": "equirectangular"}, "rotation", "does not show 200 degrees down"),
        ({"fov": "20"}, "rotation", "no photo is straight ahead"),
        ({"fov": "90"}, "homography", "flat subject"),
        ({"crop": "0,0,9000,10"}, "rotation", "the canvas is"),
    ],
)
def test_what_cannot_be_shown_is_refused(options, model, word):
    cameras = scan() if model == "homography" else row(100, 160)

    with pytest.raises(UsageError, match=word):
        planned(cameras, model=model, **options)


def test_a_rectangle_is_cut_from_the_whole_canvas(rng):
    pictures = [rng.integers(0, 256, (300, 400, 3), np.uint8) for _ in range(3)]
    alignment = alignment_of(scan(), pictures, model="homography")

    whole, _ = assemble(pipeline.render(alignment, Options.of(crop="none", seams="voronoi", exposure="none")))
    part, mask = assemble(
        pipeline.render(alignment, Options.of(crop="201,33,415,177", seams="voronoi", exposure="none"))
    )

    np.testing.assert_array_equal(part, whole[33 : 33 + 177, 201 : 201 + 415])
    assert mask.all()


def test_a_rectangle_without_a_photo_is_refused():
    cameras = [shifted(SIZE, 0, 0), shifted(SIZE, 300, 250)]

    with pytest.raises(UsageError, match="no photo shows anything"):
        planned(cameras, model="homography", crop="0,340,200,200")


@pytest.mark.parametrize(
    ("given", "sides"), [("4000", (4000, None)), ("x20", (None, 20)), ("7X9", (7, 9)), (" 5 ", (5, None))]
)
def test_sizes(given, sides):
    assert LayoutOptions(size=given).sides == sides


@pytest.mark.parametrize(
    "options",
    [
        *({"size": text} for text in ("", "x", "0", "5x0", "4k", "-5", "5x6x7", "1.5")),
        *({"fov": text} for text in ("", "0", "361", "x90", "90x", "90x361", "nan", "-20")),
        *({"crop": text} for text in ("", "al", "1,2,3", "1,2,0,5", "1,2,3,4,5", "-1,0,5,5")),
        {"size": "100", "scale": 0.5},
        {"size": "100", "crop": "0,0,5,5"},
    ],
)
def test_what_makes_no_sense_is_refused_with_an_example(options):
    with pytest.raises(UsageError) as caught:
        Options.of(**options).check()

    assert next(iter(options)) in caught.value.message
    assert caught.value.hint


def test_a_field_that_is_full_is_not_cut_for_its_size():
    canvas, plan = planned(ring(), fov="60x30", projection="rectilinear", size="400")

    left, right = canvas.rays(np.array([[-0.5, 0.0], [399.5, 0.0]]))
    assert np.rad2deg(np.arctan2(right[0], right[2]) - np.arctan2(left[0], left[2])) == pytest.approx(
        60, abs=HALF_PIXEL
    )
    assert plan.covered


@pytest.mark.parametrize(("megapixels", "factor"), [(0.4, 1), (16, 8), (250, 16), (1100, 16), (1500, 32), (9000, 64)])
def test_the_plan_of_a_huge_canvas_is_finer(megapixels, factor):
    side = round(np.sqrt(megapixels * 1e6))

    assert reduction(Canvas("rectilinear", 1.0, (0.0, 0.0), (side, side))) == factor
