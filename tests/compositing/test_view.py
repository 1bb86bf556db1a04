"""The view turns right, up and clockwise; a photo comes to the middle; a flat subject can only be rolled."""

import numpy as np
import pytest

from compositing.mosaics import alignment_of, shifted
from panostitch import pipeline
from panostitch.compositing import lay_out
from panostitch.compositing.view import look
from panostitch.errors import UsageError
from panostitch.geometry import rotation
from panostitch.options import LayoutOptions, Options
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene
from tolerances import UNIT

SIZE, HFOV = (400, 300), np.deg2rad(50)
AHEAD = np.array([[0.0, 0.0, 1.0]])


def row():
    return rig(np.deg2rad([-40, -20, 0, 20, 40]), np.deg2rad([3, -2, 5, 0, 1]), size=SIZE, hfov=HFOV)


def ring():
    return rig(np.arange(10) * 2 * np.pi / 10 - np.pi, size=SIZE, hfov=HFOV)


def seen(cameras, **options):
    return look(alignment_of(cameras), LayoutOptions(**options)).cameras


def direction(yaw, pitch):
    """The ray (1, 3) that far to the right and up (degrees)."""
    return rotation.from_angles(np.deg2rad(yaw), np.deg2rad(pitch), 0.0)[2:]


def test_nothing_asked_nothing_done():
    alignment = alignment_of(row())

    assert look(alignment, LayoutOptions()) is alignment


@pytest.mark.parametrize(("yaw", "pitch"), [(30, 0), (-75, 0), (0, 25), (0, -10), (40, 20)])
def test_what_lay_there_is_straight_ahead(yaw, pitch):
    before, after = row()[2], seen(row(), yaw=yaw, pitch=pitch)[2]

    # any photo: the new "straight ahead" is the old direction
    np.testing.assert_allclose(
        AHEAD @ after.cam_from_world.T, direction(yaw, pitch) @ before.cam_from_world.T, atol=UNIT
    )


def test_right_of_the_view_moves_left_and_above_moves_down():
    right, up = seen(row(), yaw=20)[2], seen(row(), pitch=20)[2]

    assert right.cam_from_world[2, 0] < -0.3
    assert up.cam_from_world[2, 1] > 0.2


def test_a_view_turned_clockwise_shows_the_picture_turned_the_other_way():
    level = rig([0.0], size=SIZE, hfov=HFOV)
    east = level[0].rays(np.array([[399.0, 149.5]]))

    (after,) = seen(level, roll=90)

    # what was on the right is now above
    assert east[0, 0] > 0.4
    np.testing.assert_allclose(after.rays(np.array([[399.0, 149.5]])), [[0, -east[0, 0], 1]], atol=UNIT)


def test_photos_keep_their_places_to_each_other():
    before, after = row(), seen(row(), yaw=31, pitch=-12, roll=7, center_on="p1")

    for camera, other in zip(before, after, strict=True):
        np.testing.assert_allclose(
            other.cam_from_world @ after[0].cam_from_world.T,
            camera.cam_from_world @ before[0].cam_from_world.T,
            atol=UNIT,
        )


@pytest.mark.parametrize("number", range(5))
def test_the_chosen_photo_is_in_the_middle_and_the_horizon_stays_level(number):
    before = row()
    name = alignment_of(before).photos[number].name

    after = seen(before, center_on=name)

    assert abs(after[number].cam_from_world[2, 0]) < UNIT
    for camera, other in zip(before, after, strict=True):
        np.testing.assert_allclose(other.cam_from_world[:, 1], camera.cam_from_world[:, 1], atol=UNIT)


def test_a_name_that_no_photo_has():
    names = [photo.name for photo in alignment_of(row()).photos]

    with pytest.raises(UsageError) as caught:
        seen(row(), center_on=names[1] + "x")

    assert caught.value.exit_code == 2
    assert all(name in caught.value.details[0] for name in names)
    assert "did you mean" in caught.value.hint


@pytest.mark.parametrize("options", [{"yaw": 5.0}, {"pitch": -3.0}, {"center_on": "p0"}])
def test_a_flat_subject_has_nothing_around_it(options):
    with pytest.raises(UsageError) as caught:
        look(alignment_of([shifted(SIZE, 0, 0)], model="homography"), LayoutOptions(**options))

    assert "--" + next(iter(options)).replace("_", "-") in caught.value.message


def test_a_flat_subject_turns_in_its_plane():
    alignment = look(alignment_of([shifted(SIZE, 0, 0)], model="homography"), LayoutOptions(roll=90.0))

    width, height = lay_out(alignment, LayoutOptions()).size
    assert abs(width - SIZE[1]) <= 2
    assert abs(height - SIZE[0]) <= 2


@pytest.mark.parametrize("yaw", [0.0, 90.0, -133.0, 360.0])
def test_a_full_turn_still_wraps(yaw):
    canvas = lay_out(look(alignment_of(ring()), LayoutOptions(yaw=yaw)), LayoutOptions())

    assert canvas.wraps
    assert canvas.size == lay_out(alignment_of(ring()), LayoutOptions()).size


def test_the_picture_of_a_full_turn_goes_round(closed_turn):
    plain, turned = (closed_turn(yaw) for yaw in (0.0, 90.0))

    width = plain.canvas.size[0]
    first, second = (p.read(p.canvas.region).pixels for p in (plain, turned))
    # a quarter of the width is a whole number of pixels; grey levels differ where seams run otherwise
    assert width % 4 == 0
    difference = np.abs(np.roll(first, -width // 4, axis=1) - second)
    assert np.median(difference) < 1
    assert np.median(np.abs(first - second)) > 5
    edge = np.abs(second[:, 0] - second[:, -1]).mean()
    assert edge < 3 * np.abs(np.diff(second, axis=1)).mean()


@pytest.fixture
def closed_turn():
    """Renders a ring of ten photos of a made-up world, with a view turned by some degrees."""
    scene = sphere_scene(procedural_texture(1600, 800, seed=3))
    alignment = alignment_of(ring(), [photograph(scene, camera, supersample=1) for camera in ring()])

    def render(yaw):
        return pipeline.render(
            alignment, Options.of(yaw=yaw, crop="none", seams="voronoi", blender="feather", scale=0.5)
        )

    return render
