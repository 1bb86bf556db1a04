"""The judge of Hugin: its reader of .pto files, its cameras, and the tools themselves where they are installed."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest

from panostitch.jobs import hugin
from panostitch.jobs.hugin import (
    HuginCamera,
    HuginError,
    is_installed,
    missing_tools,
    read_pto,
    run_hugin,
    stitch_hugin,
)
from panostitch.model.photo import Photo
from panostitch.synthetic.render import ArraySource, photograph_plan
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene
from panostitch.synthetic.score import score
from tolerances import PIXEL, UNIT

SIZE = (1200, 900)
HUGIN_PX = 2.0  # px, rms, of photos of 640 x 480; a wrong sign or unit is off by tens of px. 0.22 to 0.5 seen.

PTO = """# hugin project file
p f2 w3000 h1500 v360  k0 E0 R0 n"TIFF_m c:LZW r:CROP"
m i0

#-hugin  cropFactor=1
i w1200 h900 f0 v60 Ra0.5 Rb-8.7e-01 Eev0 r10 p-5 y-20 TrX0 j0 a0.01 b-0.06 c2e-2 d3 e-1.5 g0 t0 Va1 n"a y9 v1.png"
i w1200 h900 f0 v=0 Ra=0 Eev0.5 r-1.4e-14 p2.5 y1.2e1 TrX0 j0 a=0 b=0 c=0 d=0 e=0 g=0 t=0 Va=0 n"b.png"
i w1200 h900 f0 v50 r0 p0 y0 a0 b0 c0 d0 e0 n"stray.png"
i w1200 h900 f0 v=2 r90 p0 y30 a0 b0 c0 d0 e0 n"c.png"

v y1
v
c n0 N1 x1 y2 X3 Y4 t0
c n3 N1 x1 y2 X3 Y4 t0
"""


@pytest.fixture(scope="module")
def cameras():
    return read_pto(PTO)


def test_angles_are_degrees_right_up_and_clockwise(cameras):
    first, second, _, fourth = cameras
    for camera, (yaw, pitch, roll) in ((first, (-20, -5, 10)), (second, (12, 2.5, -1.4e-14)), (fourth, (30, 0, 90))):
        (expected,) = rig(*np.deg2rad([yaw, pitch, roll]), size=SIZE, hfov=1.0)
        np.testing.assert_allclose(camera.cam_from_world, expected.cam_from_world, atol=UNIT)


def test_a_camera_turned_right_sees_what_is_right(cameras):
    # 12 degrees right and 2.5 up: that direction is the middle of the photo, but for the shift of the lens
    yaw, pitch = np.deg2rad([12, 2.5])
    ahead = np.array([[np.sin(yaw) * np.cos(pitch), -np.sin(pitch), np.cos(yaw) * np.cos(pitch)]])
    np.testing.assert_allclose(cameras[1].project(ahead), [[599.5 + 3, 449.5 - 1.5]], atol=PIXEL)


def test_field_of_view_is_that_of_the_width(cameras):
    assert cameras[0].focal == pytest.approx(600 / np.tan(np.deg2rad(30)))
    assert cameras[3].focal == pytest.approx(600 / np.tan(np.deg2rad(25)))


def test_linked_variables_are_those_of_the_other_photo(cameras):
    assert cameras[1].focal == cameras[0].focal
    assert cameras[1].abc == cameras[0].abc == (0.01, -0.06, 0.02)
    assert cameras[3].abc == (0, 0, 0)


def test_a_photo_without_control_points_is_left_out(cameras):
    assert [camera is None for camera in cameras] == [False, False, True, False]


def test_nothing_is_joined_without_control_points():
    assert read_pto(PTO[: PTO.index("c n0")]) == (None,) * 4


def test_the_smaller_group_is_left_out():
    lines = PTO.replace("c n3 N1", "c n0 N3")
    assert [camera is None for camera in read_pto(lines)] == [False, False, True, False]


def test_polynomial_is_in_half_heights(cameras):
    # at half the height from the middle, the unit of the radius, the polynomial is 1 whatever its coefficients are
    camera = replace(cameras[0], centre=(599.5, 449.5), cam_from_world=np.eye(3))
    at_unit = np.array([[450.0 / camera.focal, 0.0, 1.0]])
    np.testing.assert_allclose(camera.project(at_unit), [[599.5 + 450, 449.5]], atol=PIXEL)
    halfway = np.array([[0.0, 225.0 / camera.focal, 1.0]])
    factor = 0.01 / 8 - 0.06 / 4 + 0.02 / 2 + 1.03
    np.testing.assert_allclose(camera.project(halfway), [[599.5, 449.5 + 225 * factor]], atol=PIXEL)


def test_rays_and_project_are_inverse(cameras):
    x, y = np.meshgrid(np.linspace(0, 1199, 13), np.linspace(0, 899, 9))
    points = np.column_stack([x.ravel(), y.ravel()])
    for camera in (cameras[0], cameras[3]):
        np.testing.assert_allclose(camera.project(camera.rays(points)), points, atol=1e-5)


def test_behind_the_camera_there_is_nothing(cameras):
    assert np.isnan(cameras[3].project(np.array([[0.0, 0.0, -1.0]]))).all()


def test_a_radius_beyond_the_lens_has_no_ray():
    camera = HuginCamera(SIZE, 1000.0, (599.5, 449.5), np.eye(3), (0.0, -0.4, 0.0))
    assert np.isnan(camera.rays(np.array([[3000.0, 449.5]]))).any()


def test_fisheyes_are_refused():
    with pytest.raises(HuginError, match="lens type 3"):
        read_pto(PTO.replace("h900 f0 v60", "h900 f3 v60"))


def test_a_tool_that_fails_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(hugin, "_commands", lambda *_args, **_more: [["false", "-o", "photos.pto"]])
    photo = Photo("a", (8, 6), ArraySource(np.zeros((6, 8, 3), np.uint8)))
    with pytest.raises(HuginError, match="false failed with code 1"):
        run_hugin([photo], tmp_path)


def test_a_tool_that_hangs_is_ended(monkeypatch, tmp_path):
    def hangs(command, **_):
        raise subprocess.TimeoutExpired(command, 1)

    monkeypatch.setattr(subprocess, "run", hangs)
    photo = Photo("a", (8, 6), ArraySource(np.zeros((6, 8, 3), np.uint8)))
    with pytest.raises(HuginError, match="pto_gen took more than"):
        run_hugin([photo], tmp_path)


@pytest.mark.skipif(not is_installed(), reason="hugin-tools are not installed")
@pytest.mark.parametrize("exif", [False, True])
def test_hugin_itself(exif, tmp_path):
    """Tilted by a quarter turn and upwards, so that no angle can change its sign or its place unnoticed."""
    turns = np.deg2rad([[-14, 2, 5], [8, -3, 90], [27, 6, -12]]).T
    cameras = rig(*turns, size=(640, 480), hfov=np.deg2rad(52))
    scene = sphere_scene(procedural_texture(2048, 1024, seed=4))
    photos = photograph_plan(scene, cameras, supersample=1, focal_known=exif)

    result = run_hugin(photos, tmp_path)

    best = min((score(cameras, found) for found in (result.plain, result.lens)), key=lambda s: s.rms)
    assert best.missing == ()
    assert best.rms < HUGIN_PX
    first = (tmp_path / "photos.pto").read_text()
    assert (" v50 " in first) != exif
    if exif and not missing_tools():
        panorama = stitch_hugin(tmp_path)
        assert panorama.shape[2] == 4
        # tilted photos leave corners empty
        assert 0.2 < (panorama[..., 3] > 0).mean() < 1
        assert panorama[..., :3].std() > 10  # grey levels: a picture
