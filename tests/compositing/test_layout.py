"""The canvas: which projection, how large, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from compositing.mosaics import alignment_of, shifted
from panostitch.compositing import lay_out
from panostitch.compositing.view import look
from panostitch.errors import AlignmentError, LimitError, UsageError
from panostitch.geometry.projections import PROJECTIONS
from panostitch.options import LayoutOptions
from panostitch.synthetic.scene import FLAT_PLANS, PLANS, rig

SIZE, HFOV = (400, 300), np.deg2rad(50)

EDGE = 1e-6  # px; an outline may lie on the very edge of the canvas
SCALE = 1e-9  # relative; the canvas takes the focal length as it is
ROUND = 0.02  # relative; a closed turn is rounded to a multiple of 64 px


def row(first, last, count=5, *, pitch=0.0, size=SIZE):
    yaws = np.deg2rad(np.linspace(first, last, count))
    return rig(yaws, np.deg2rad(pitch), size=size, hfov=HFOV)


def ring(count=10, **angles):
    return rig(np.arange(count) * 2 * np.pi / count - np.pi, size=SIZE, hfov=HFOV, **angles)


def canvas_of(cameras, *, model="rotation", **options):
    return lay_out(alignment_of(cameras, model=model), LayoutOptions(**options))


@pytest.mark.parametrize(
    ("cameras", "projection"),
    [
        (row(-15, 15), "rectilinear"),
        (row(-60, 60), "cylindrical"),
        (row(-15, 15, pitch=20.0), "rectilinear"),
        (row(-60, 60, pitch=50.0), "equirectangular"),
        (ring(), "cylindrical"),
        (ring(pitches=np.deg2rad(45)), "equirectangular"),
    ],
    ids=["narrow", "wide", "narrow and up", "wide and high", "ring", "ring of the sky"],
)
def test_auto_goes_by_the_field_of_view_and_says_so(cameras, projection):
    told = {}

    canvas = lay_out(alignment_of(cameras), LayoutOptions(), trace=lambda event, **data: told.update({event: data}))

    assert canvas.projection == projection
    assert "degrees wide" in told["layout.chosen"]["reason"]
    assert told["layout.chosen"]["canvas"] == canvas


@pytest.mark.parametrize("count", [8, 10, 13])
def test_a_ring_of_photos_wraps(count):
    assert canvas_of(ring(count)).wraps


def test_a_closed_turn_wraps_and_nothing_else_does():
    closed, open_turn = canvas_of(ring()), canvas_of(row(-150, 145, 12))

    assert closed.wraps
    assert not open_turn.wraps
    assert closed.size[0] % 64 == 0
    assert closed.size[0] == pytest.approx(2 * np.pi * closed.scale)
    assert closed.scale == pytest.approx(ring()[0].focal, rel=ROUND)
    assert open_turn.size[0] < closed.size[0]


def test_a_turn_that_closes_but_for_a_degree_does_not_wrap():
    half = np.rad2deg(HFOV) / 2
    ends = row(-180 + half + 0.6, 180 - half - 0.6, 12)

    assert not canvas_of(ends).wraps


CASES = [
    *((name, "auto") for name in PLANS),
    *((name, p) for name in ("rolled", "row", "two_rows") for p in ("cylindrical", "equirectangular")),
    ("ring", "equirectangular"),
    *(("pair", name) for name in PROJECTIONS),
    *(("row", name) for name in ("panini", "mercator", "miller", "stereographic", "fisheye", "equisolid")),
]


@pytest.mark.parametrize(("plan", "projection"), CASES)
@pytest.mark.parametrize("scale", [1.0, 0.3])
def test_the_canvas_holds_every_photo(plan, projection, scale):
    cameras = PLANS[plan]()
    model = "homography" if plan in FLAT_PLANS else "rotation"
    if plan in FLAT_PLANS:  # the plane's units are those of the first photo, as alignment leaves it
        first = np.linalg.inv(cameras[0].cam_from_world)
        cameras = [camera.turned(first) for camera in cameras]

    canvas = canvas_of(cameras, model=model, projection=projection, scale=scale)

    for camera in cameras:
        xy = canvas.pixels(camera.rays(camera.outline(40)))
        assert np.isfinite(xy).all()
        assert (xy >= -0.5 - EDGE).all()
        # a closed turn has one column at both of its ends
        assert (xy <= np.array(canvas.size) - 0.5 + EDGE).all()


@pytest.mark.parametrize("projection", sorted(PROJECTIONS))
def test_the_canvas_is_no_larger_than_needed(projection):
    cameras = row(-15, 15)

    canvas = canvas_of(cameras, projection=projection)

    xy = np.vstack([canvas.pixels(camera.rays(camera.outline(200))) for camera in cameras])
    low, high = xy.min(0), xy.max(0)
    assert (low < 2).all()
    assert (high > np.array(canvas.size) - 3).all()


def test_photos_keep_their_own_resolution():
    camera = row(0, 0, 1)[0]

    assert canvas_of([camera]).scale == pytest.approx(camera.focal, rel=SCALE)
    assert canvas_of([camera], scale=0.5).scale == pytest.approx(camera.focal / 2, rel=SCALE)
    assert np.abs(np.array(canvas_of([camera]).size) - SIZE).max() <= 2


@pytest.mark.parametrize(
    "cameras", [row(-80, 120, 6), [row(0, 0, 1)[0], row(70, 70, 1)[0]]], ids=["200 degrees", "aside"]
)
def test_rectilinear_cannot_show_200_degrees(cameras):
    with pytest.raises(UsageError) as caught:
        canvas_of(cameras, projection="rectilinear")

    assert caught.value.exit_code == 2
    assert "rectilinear" in caught.value.message
    assert "auto" in caught.value.hint


@pytest.mark.parametrize("name", ["panini", "compressed-rectilinear", "stereographic"])
def test_what_cannot_show_all_around_says_what_can(name):
    with pytest.raises(UsageError) as caught:
        canvas_of(ring(), projection=name)

    assert name in caught.value.message
    assert "360 degrees wide" in caught.value.message
    assert "equirectangular" in caught.value.hint
    assert canvas_of(ring(), projection="equirectangular").wraps


@pytest.mark.parametrize("name", ["mercator", "panini", "cylindrical"])
def test_what_cannot_show_the_zenith(name):
    with pytest.raises(UsageError, match="reaches 90 degrees"):
        canvas_of(row(-30, 30, pitch=80.0), projection=name)


@pytest.mark.parametrize("name", ["fisheye", "equisolid", "miller", "equirectangular"])
def test_the_whole_sphere(name):
    cameras = [*ring(), *row(0, 0, 1, pitch=85.0), *row(0, 0, 1, pitch=-85.0)]
    focal = cameras[0].focal
    sides = {"fisheye": (2 * np.pi, 2 * np.pi), "equisolid": (4, 4), "miller": (2 * np.pi, 4.6068)}

    canvas = canvas_of(cameras, projection=name)

    expected = np.array(sides.get(name, (2 * np.pi, np.pi))) * focal
    np.testing.assert_allclose(canvas.size, expected, rtol=2 * ROUND)
    assert canvas.wraps == (name in ("miller", "equirectangular"))


def test_a_photo_across_the_tear_of_transverse_mercator_is_shown_whole():
    cameras = [*row(0, 0, 1), *row(150, 150, 1)]

    canvas = canvas_of(cameras, projection="transverse-mercator")

    height = canvas.size[1] / canvas.scale
    assert height == pytest.approx(2 * np.pi, abs=4 / canvas.scale)


def test_a_little_planet_looks_down_on_a_ring():
    options = LayoutOptions(projection="little-planet")
    seen = look(alignment_of(ring(pitches=np.deg2rad(-20))), options)

    canvas = lay_out(seen, options)

    assert canvas.projection == "stereographic"
    # the middle of the first view's horizon is straight up from the middle of the picture
    nadir = canvas.pixels(np.array([[0.0, 0.0, 1.0]]))[0]
    ahead = canvas.pixels(np.array([[0.0, -1.0, 0.0]]))[0]
    np.testing.assert_allclose(nadir, (np.array(canvas.size) - 1) / 2, atol=2)
    np.testing.assert_allclose(ahead - nadir, [0, -2 * canvas.scale], atol=1)


def test_a_little_planet_of_the_whole_sphere_has_an_edge():
    options = LayoutOptions(projection="little-planet")
    cameras = [*ring(), *row(0, 0, 1, pitch=85.0), *row(0, 0, 1, pitch=-85.0)]

    canvas = lay_out(look(alignment_of(cameras), options), options)

    np.testing.assert_allclose(canvas.size, 4 * np.tan(np.deg2rad(60)) * canvas.scale, atol=3)


def test_the_canvas_carries_the_distance_of_panini():
    near, far = (canvas_of(row(-60, 60), projection="panini", panini_distance=d) for d in (1.0, 3.0))

    assert near.parameters == (1.0,)
    assert far.parameters == far.reduced(2).parameters == (3.0,)
    assert far.size[0] < near.size[0]


def test_cylindrical_cannot_show_the_zenith():
    with pytest.raises(UsageError) as caught:
        canvas_of(row(-30, 30, pitch=80.0), projection="cylindrical")

    assert "equirectangular" in caught.value.hint


def test_a_photo_of_the_zenith_fills_a_whole_turn():
    canvas = canvas_of(row(-30, 30, pitch=80.0))

    assert canvas.projection == "equirectangular"
    assert canvas.wraps
    top = canvas.pixels(np.array([[0.0, -1.0, 0.0]]))[0, 1]
    assert -0.5 <= top < 1


@pytest.mark.parametrize("projection", ["cylindrical", "equirectangular"])
def test_a_flat_subject_is_shown_flat(projection):
    with pytest.raises(UsageError):
        canvas_of([shifted(SIZE, 0, 0)], model="homography", projection=projection)
    assert canvas_of([shifted(SIZE, 0, 0)], model="homography").projection == "rectilinear"


def test_beyond_the_horizon_of_a_plane_nothing_is_to_be_seen():
    tilted = replace(shifted(SIZE, 0, 0), cam_from_world=np.array([[1.0, 0, 0], [0, 1, 0], [0.01, 0, 1]]))

    with pytest.raises(AlignmentError):
        canvas_of([tilted], model="homography")


def test_too_large_is_a_limit():
    huge = ring(count=14)
    huge = [replace(c, size=(60000, 45000), focal=c.focal * 150, centre=(29999.5, 22499.5)) for c in huge]

    with pytest.raises(LimitError) as caught:
        canvas_of(huge)

    assert caught.value.exit_code == 7
    assert "--scale" in caught.value.hint
    assert canvas_of(huge, scale=0.25).wraps


def absurd():
    """Four photos with a far too long lens, at the corners of a view of 140 x 80 degrees."""
    cameras = rig(np.deg2rad([-70, -20, 20, 70]), np.deg2rad([-40, 40, -40, 40]), size=SIZE, hfov=HFOV)
    return [replace(camera, focal=20 * camera.focal) for camera in cameras]


def test_absurdly_spread_photos_are_no_alignment():
    with pytest.raises(AlignmentError) as caught:
        canvas_of(absurd())

    assert caught.value.exit_code == 6
    assert "far apart" in caught.value.details[0]


def test_the_photo_that_stretches_the_canvas_is_named():
    # seen almost along the plane: its right edge lies close to the horizon
    aside = replace(
        shifted(SIZE, 0, 0), cam_from_world=np.linalg.inv(np.array([[1, 0, 300], [0, 1, 0], [-0.00245, 0, 1]]))
    )

    with pytest.raises(AlignmentError) as caught:
        canvas_of([shifted(SIZE, 0, 0), aside], model="homography")

    assert "p1 alone would be spread over" in caught.value.details[0]


def test_absurd_does_not_depend_on_the_scale_asked_for():
    for scale in (0.1, 2.0):
        with pytest.raises(AlignmentError):
            canvas_of(absurd(), scale=scale)
        assert canvas_of(row(-60, 60), scale=scale).size[0] > 0
