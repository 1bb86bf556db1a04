"""The judge of finished panoramas: what it finds again, what it does not excuse, and where programs say they lie."""

import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from panostitch.geometry import rotation
from panostitch.geometry.rotation import from_angles
from panostitch.model.photo import Photo
from panostitch.runtime.executor import serial
from panostitch.synthetic.render import ArraySource, photograph
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene
from panostitch.synthetic.textures import even_on_sphere

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SIZE, HFOV = (240, 180), np.deg2rad(55)
FOCAL = SIZE[0] / 2 / np.tan(HFOV / 2)  # px
WIDTH, HEIGHT, MIDDLE = 390, 248, (202.3, 120.7)  # px, of a finished picture
TURNED = from_angles(0.3, -0.2, 0.1)  # of a program's world
FOUND_PX = 0.02  # px, rms: how near the place of a perfect picture is found again; 0.001 to 0.005 seen
ROUNDING_PSNR = 50.0  # dB: a perfect picture, rounded, moved by less than FOUND_PX and read elsewhere; 53 to 58 seen
SAME = 1e-6  # px, rad


@pytest.fixture(scope="module")
def script():
    """The scripts of the benchmark find each other in their own folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        import quality

        yield quality
        for name in ("quality", "quality_programs", "quality_judge"):
            del sys.modules[name]


@pytest.fixture(scope="module")
def judge(script):
    return sys.modules[script.judge.__module__]


@pytest.fixture(scope="module")
def programs(script):
    return sys.modules[script.installed.__module__]


@pytest.fixture(scope="module")
def scene():
    return sphere_scene(even_on_sphere(procedural_texture(1024, 512, 11)))


@pytest.fixture(scope="module")
def cameras():
    return rig(np.array([-0.45, 0.0, 0.45]), size=SIZE, hfov=HFOV)


@pytest.fixture(scope="module")
def perfect(judge, scene, cameras):
    """A picture straight from the scene, in a turned world, whose program is wrong about turn and scale by some px."""
    place = judge.Place((WIDTH, HEIGHT), FOCAL, MIDDLE, TURNED.T)
    slightly_off = rotation.exp(np.array([0.006, -0.009, 0.004]))
    believed = tuple(camera.turned(TURNED.T @ slightly_off) for camera in cameras)
    said = replace(place, scale=1.004 * FOCAL, turn=np.eye(3))
    return place, judge.Finished(judge.render(scene, place), np.ones((HEIGHT, WIDTH), bool), said, believed)


def apart(one, other, xy):
    """Distances (n,) px between where two places say that pixels look."""
    a, b = (rays / np.linalg.norm(rays, axis=1, keepdims=True) for rays in (one.rays(xy), other.rays(xy)))
    return np.linalg.norm(a - b, axis=1) * one.scale


def rms(distances):
    return float(np.sqrt((distances**2).mean()))


def test_pixels_undo_rays(judge):
    place = judge.Place((640, 260), 100.0, (315.0, 130.0), TURNED)
    turned_round = place.grid[:, 0] > 2 * np.pi * 100 - 0.5
    np.testing.assert_allclose(
        place.pixels(place.rays(place.grid))[~turned_round], place.grid[~turned_round], atol=SAME
    )
    assert (place.pixels(place.rays(place.grid))[turned_round, 0] < 12).all()


def test_the_place_of_a_perfect_picture_is_found_again(judge, scene, cameras, perfect):
    place, picture = perfect
    stated = replace(picture.place, turn=judge.stated_turn(cameras, picture.cameras))
    assert rms(apart(place, stated, place.grid)) > 1  # there is something to find
    assert rms(apart(place, judge.register(scene, cameras, picture), place.grid)) < FOUND_PX


def test_at_another_scale_too(judge, scene, cameras, perfect):
    (place, picture), factor = perfect, 0.7
    size, scale = (round(WIDTH * factor), round(HEIGHT * factor)), factor * FOCAL
    place = replace(place, size=size, scale=scale, middle=(MIDDLE[0] * factor, MIDDLE[1] * factor))
    said = replace(place, scale=1.003 * scale)
    other = replace(picture, pixels=judge.render(scene, place), mask=np.ones(size[::-1], bool), place=said)
    assert rms(apart(place, judge.register(scene, cameras, other), place.grid)) < FOUND_PX


def test_a_perfect_picture_is_at_the_ceiling(judge, scene, cameras, perfect):
    quality = judge.judge(scene, cameras, {"perfect": perfect[1]})["perfect"]
    assert quality.psnr > ROUNDING_PSNR
    assert quality.ssim > 0.999
    assert quality.sharpness == pytest.approx(1, abs=0.002)
    assert quality.photos == 3
    assert quality.scale == pytest.approx(1, abs=1e-4)


def test_brightness_and_contrast_of_the_whole_do_not_count(judge, scene, cameras, perfect):
    picture = perfect[1]
    tinted = np.clip(np.rint(picture.pixels * [0.8, 0.75, 0.7] + [20, 10, 30]), 0, 255).astype(np.uint8)
    quality = judge.judge(scene, cameras, {"tinted": replace(picture, pixels=tinted)})["tinted"]
    assert quality.psnr > ROUNDING_PSNR - 3  # rounded once more, and then enlarged by 1 / 0.7


def test_a_photo_in_the_wrong_place_is_not_excused(judge, scene, cameras, perfect):
    picture = perfect[1]
    shifted = picture.pixels.copy()
    shifted[:, 260:] = np.roll(picture.pixels, 1, axis=0)[:, 260:]
    found = judge.judge(scene, cameras, {"whole": picture, "shifted": replace(picture, pixels=shifted)})
    assert found["shifted"].psnr < 35 < found["whole"].psnr
    assert found["shifted"].ssim < found["whole"].ssim - 0.01


def test_a_blur_costs_sharpness(judge, scene, cameras, perfect):
    picture = perfect[1]
    soft = np.asarray(cv2.GaussianBlur(picture.pixels, (0, 0), 0.8))
    found = judge.judge(scene, cameras, {"soft": replace(picture, pixels=soft)})["soft"]
    assert found.sharpness < 0.8


def test_a_gain_that_changes_slowly_is_no_sharpness(judge, scene, cameras, perfect):
    picture = perfect[1]
    gain = np.linspace(0.7, 1, picture.pixels.shape[1])[None, :, None]
    uneven = np.rint(picture.pixels * gain).astype(np.uint8)
    found = judge.judge(scene, cameras, {"uneven": replace(picture, pixels=uneven)})["uneven"]
    assert found.psnr < 35
    assert found.sharpness == pytest.approx(1, abs=0.01)


def test_what_only_one_picture_shows_is_not_compared(judge, scene, cameras, perfect):
    picture = perfect[1]
    spoilt = picture.pixels.copy()
    spoilt[:, 320:] = np.random.default_rng(1).integers(0, 256, spoilt[:, 320:].shape)
    part = picture.mask.copy()
    part[:, 320:] = False
    found = judge.judge(
        scene, cameras, {"spoilt": replace(picture, pixels=spoilt), "part": replace(picture, mask=part)}
    )
    assert found["spoilt"].psnr > 40
    # but a picture that has left photos out narrows nobody's field but its own
    fewer = replace(picture, mask=part, cameras=(*picture.cameras[:2], None))
    found = judge.judge(scene, cameras, {"spoilt": replace(picture, pixels=spoilt), "fewer": fewer})
    assert found["spoilt"].psnr < 25 < found["fewer"].psnr
    assert (found["spoilt"].photos, found["fewer"].photos) == (3, 2)


def test_where_hugin_says_its_panorama_lies(programs):
    place = programs.hugin_place("# hugin\np f2 w3000 h900 v120  k0 E0 R0\nm i0\n")
    assert place.size == (3000, 900)
    assert place.scale == pytest.approx(3000 / np.deg2rad(120))
    assert place.middle == (1499.5, 449.5)
    with pytest.raises(programs.HuginError):
        programs.hugin_place("p f0 w3000 h900 v120  k0\n")


def test_where_opencv_puts_its_panorama(programs, cameras):
    """Its own warper draws a picture from a photo; the place says where each pixel of the photo is in it."""
    camera = cameras[2]
    intrinsics = np.array([[camera.focal, 0, camera.centre[0]], [0, camera.focal, camera.centre[1]], [0, 0, 1]])
    x, y = np.meshgrid(*map(np.arange, camera.size))
    ramp = np.dstack([x, y]).astype(np.float32)
    warper = cv2.PyRotationWarper("spherical", camera.focal)
    turn = camera.cam_from_world.T.astype(np.float32)
    _, warped = warper.warp(ramp, intrinsics.astype(np.float32), turn, cv2.INTER_LINEAR, cv2.BORDER_CONSTANT)
    place = programs.rival_place((None, camera), warped.shape[1::-1])
    middle = np.array([[warped.shape[1] // 2, warped.shape[0] // 2]])
    np.testing.assert_allclose(camera.project(place.rays(middle))[0], warped[middle[0, 1], middle[0, 0]], atol=0.05)
    with pytest.raises(ValueError, match="picture"):
        programs.rival_place((None, camera), (10, 10))


def test_ours_says_where_it_lies(programs, judge, scene, cameras):
    """A photo put on the sphere by our program's own canvas is seen where the place says."""
    photos = [Photo(f"{n}.jpg", SIZE, ArraySource(photograph(scene, camera))) for n, camera in enumerate(cameras)]
    picture = programs.ours(photos, cameras, serial)
    stated = replace(picture.place, turn=judge.stated_turn(cameras, picture.cameras))
    found = judge.register(scene, cameras, picture)
    assert rms(apart(found, stated, found.grid)) < 0.2


def test_photos_in_wrong_places_are_a_failure(script, cameras, perfect):
    picture = perfect[1]
    assert script.right(picture, cameras) is picture
    swapped = replace(picture, cameras=(picture.cameras[1], picture.cameras[0], picture.cameras[2]))
    with pytest.raises(ValueError, match="wrong places"):
        script.right(swapped, cameras)


def test_the_page_says_who_is_best_and_who_failed(script, judge):
    photos = judge.Quality(43.0, 0.992, 1.001, 0.0, 6, 1.0)
    first, second = replace(photos, psnr=40.0, sharpness=0.997), replace(photos, psnr=39.97, ssim=0.98, sharpness=1.02)
    both = script.Row("hall", "row", "even", photos, {"one": first, "other": second})
    alone = script.Row("hall", "row", "uneven", photos, {"one": first, "other": "failed: too few photos"})
    assert script.lines(both)[1:] == [
        "| hall | row | even | one | **40.00** | **0.9920** | **0.997** | 0.00 | 6 | 1.000 |",
        "| hall | row | even | other | **39.97** | 0.9800 | 1.020 | 0.00 | 6 | 1.000 |",
    ]
    assert script.lines(alone)[2] == "| hall | row | uneven | other | failed: too few photos | - | - | - | - | - |"
    page = script.page([both, alone])
    assert "| even | one | 1 | 40.00 | 1 | 0.9920 | 1 | 0.997 | 1 |" in page
    assert "| even | other | 1 | 39.97 | 1 | 0.9800 | 0 | 1.020 | 0 |" in page
    assert "\n| uneven | one |" not in page  # where one has failed there is nothing to compare
