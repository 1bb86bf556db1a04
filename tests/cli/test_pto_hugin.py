"""Hugin's own programs on our .pto files: the same geometry, the same brightness, control points where they belong."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from panostitch import pipeline
from panostitch.compositing import frame, lay_out
from panostitch.compositing.view import look
from panostitch.compositing.warp import blocks, read_for, warp_and_place
from panostitch.geometry import rotation
from panostitch.io.pto import read_pto, write_pto
from panostitch.io.pto.canvas import NUMBERS
from panostitch.io.readers import open_photo
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.light import Light, radius_square
from panostitch.model.match import ControlPoints
from panostitch.options import LayoutOptions, Options
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import procedural_texture, sphere_scene

pytestmark = pytest.mark.skipif(not shutil.which("nona"), reason="Hugin's programs (hugin-tools) are not installed")

UPRIGHT = (300, 400)
ORIENTATIONS = (1, 6, 3, 8)
EXPOSURES = (0.0, 0.4, -0.3, 0.0)
PIXELS_UPRIGHT = {1: 0, 3: 2, 6: 1, 8: 3}  # quarter turns to the left that store an upright picture so

# px: pano_trafo says six decimals
SIX_DECIMALS = 2e-6
# px: of the fitted lens, 0.012 stated
LENS = 0.02
# px: between nona's picture and ours; 0.006 seen, most of it the interpolation of coordinates in our warp
SHIFT = 0.03
# share: nona's response curve is our power law but for two grey levels; 0.004 seen
GAIN = 0.01
# share: the same for parts of photos whose channels are changed by up to a fifth; 0.012 seen
LIGHT = 0.02
# degrees: by which Hugin's optimiser moves true cameras; 0.00016 seen
STILL = 0.002


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    """Photos on disk, stored in all four ways, with true cameras and control points."""
    folder = tmp_path_factory.mktemp("hugin")
    scene = sphere_scene(procedural_texture(2400, 1200, seed=3))
    angles = np.deg2rad([[0, 2, 3], [14, -3, -4], [28, 1, 2], [42, 0, 1]])
    cameras = tuple(Camera(UPRIGHT, 412.0, (153.8, 193.4), rotation.from_angles(*turn), -0.1, 0.02) for turn in angles)
    photos = []
    for n, camera in enumerate(cameras):
        pixels = photograph(scene, camera, exposure=EXPOSURES[n], supersample=1)
        exif = Image.Exif()
        exif[0x0112] = ORIENTATIONS[n]
        path = folder / f"photo {n}.png"
        stored = np.ascontiguousarray(np.rot90(pixels, PIXELS_UPRIGHT[ORIENTATIONS[n]]))
        Image.fromarray(stored).save(path, exif=exif)
        photos.append(open_photo(path))
    points = tuple(common_points(cameras, n, n + 1) for n in range(len(cameras) - 1))
    return Alignment("rotation", tuple(photos), cameras, (), (), 0.0, 0.0, control_points=points)


def common_points(cameras, i, j):
    x, y = np.meshgrid(np.linspace(140, 285, 6), np.linspace(15, 385, 6))
    xy = np.column_stack([x.ravel(), y.ravel()])
    other = cameras[j].project(cameras[i].rays(xy))
    seen = ((other >= 0) & (other <= np.array(UPRIGHT) - 1)).all(1)
    return ControlPoints(i, j, xy[seen], other[seen])


def run(*command, stdin=None):
    done = subprocess.run([str(word) for word in command], input=stdin, capture_output=True, text=True, timeout=120)
    return done.returncode, done.stdout


def transformed(path, number, xy):
    """Where (n, 2) in the cropped panorama Hugin puts stored pixels (n, 2) of a photo."""
    _, out = run("pano_trafo", path, number, stdin="".join(f"{x:.9f} {y:.9f}\n" for x, y in xy))
    line = next(line for line in Path(path).read_text().splitlines() if line.startswith("p "))
    left, _, top, _ = (int(n) for n in line.split(" S")[1].split()[0].split(","))
    return np.array([[float(word) for word in line.split()] for line in out.splitlines()]) - [left, top]


def in_photo(camera):
    x, y = np.meshgrid(*(np.linspace(0, n - 1, 7) for n in camera.size))
    return np.column_stack([x.ravel(), y.ravel()])


def as_stored(xy, orientation):
    """Upright pixels (n, 2) to stored ones."""
    across, down = UPRIGHT[0] - 1 - xy[:, 0], UPRIGHT[1] - 1 - xy[:, 1]
    return np.column_stack(
        {1: [xy[:, 0], xy[:, 1]], 3: [across, down], 6: [xy[:, 1], across], 8: [down, xy[:, 0]]}[orientation]
    )


@pytest.mark.parametrize("projection", sorted(NUMBERS))
def test_hugin_puts_pixels_where_we_do(truth, tmp_path, projection):
    canvas = lay_out(truth, LayoutOptions(projection=projection))
    path = tmp_path / "x.pto"

    exactness = write_pto(truth, str(path), canvas)

    assert exactness.lens < LENS
    for n, camera in enumerate(truth.cameras):
        xy = in_photo(camera)
        found = transformed(path, n, as_stored(xy, ORIENTATIONS[n]))
        # a rectilinear canvas is stretched towards its edges
        np.testing.assert_allclose(found, canvas.pixels(camera.rays(xy)), atol=4 * LENS)


@pytest.mark.parametrize(
    "options",
    [
        {"size": "333"},
        {"size": "x301", "projection": "cylindrical"},
        {"fov": "41x33", "yaw": 10.0},
        {"fov": "360x180", "size": "1280"},
        {"fov": "70", "projection": "stereographic"},
    ],
    ids=str,
)
def test_hugin_has_our_canvas_of_a_given_size_or_field(truth, tmp_path, options):
    layout = LayoutOptions(**options)
    seen = look(truth, layout)
    canvas, _ = frame(seen, layout)
    path = tmp_path / "x.pto"

    write_pto(seen, str(path), canvas)

    compared = 0
    for n, camera in enumerate(seen.cameras):
        xy = in_photo(camera)
        own, found = canvas.pixels(camera.rays(xy)), transformed(path, n, as_stored(xy, ORIENTATIONS[n]))
        shown = ((own > 0) & (own < np.array(canvas.size) - 1)).all(1)  # beyond it a turn may come from the other side
        np.testing.assert_allclose(found[shown], own[shown], atol=4 * LENS)
        compared += int(shown.sum())
    assert compared > 50


@pytest.mark.parametrize("distance", [0.3, 1.0, 2.5])
def test_hugin_has_our_panini(truth, tmp_path, distance):
    canvas = lay_out(truth, LayoutOptions(projection="panini", panini_distance=distance))
    path = tmp_path / "x.pto"

    write_pto(truth, str(path), canvas)

    for n, camera in enumerate(truth.cameras):
        xy = in_photo(camera)
        found = transformed(path, n, as_stored(xy, ORIENTATIONS[n]))
        np.testing.assert_allclose(found, canvas.pixels(camera.rays(xy)), atol=4 * LENS)


def test_a_flat_subject_lies_where_it_does_with_us(truth, tmp_path):
    # any four homographies of a real camera: those of the photos among each other, and a step to the side
    middle = np.array([[412.0, 0, 149.5], [0, 412.0, 199.5], [0, 0, 1]])
    normal = np.array([0.1, -0.2, 1.0])
    cameras = []
    for n, camera in enumerate(truth.cameras):
        side = np.eye(3) - np.outer([0.05 * n, 0.02 * n, -0.04 * n], normal)
        matrix = middle @ camera.cam_from_world @ side @ truth.cameras[0].cam_from_world.T @ np.linalg.inv(middle)
        cameras.append(Camera(UPRIGHT, 1.0, (0.0, 0.0), matrix / matrix[2, 2]))
    flat = replace(truth, model="homography", cameras=tuple(cameras), control_points=())
    canvas = lay_out(flat, LayoutOptions())
    path = tmp_path / "x.pto"

    exactness = write_pto(flat, str(path), canvas)

    assert exactness.plane is not None
    assert exactness.plane < LENS
    for n, camera in enumerate(flat.cameras):
        xy = in_photo(camera)
        found = transformed(path, n, as_stored(xy, ORIENTATIONS[n]))
        np.testing.assert_allclose(found, canvas.pixels(camera.rays(xy)), atol=4 * LENS)


@pytest.mark.parametrize("projection", ["cylindrical", "equirectangular"])
def test_nona_renders_what_we_render(truth, tmp_path, projection):
    panorama = pipeline.render(truth, Options.of(projection=projection, crop="full"))
    canvas, plan = panorama.canvas, panorama.plan
    path = tmp_path / "x.pto"
    write_pto(truth, str(path), canvas, crop=plan.crop, light=plan.light)
    # layers as large as the panorama, for comparison
    path.write_text(path.read_text().replace(" r:CROP", ""))

    code, _ = run("nona", "-m", "TIFF_m", "-o", tmp_path / "layer", path)

    assert code == 0
    assert np.ptp(np.log2(plan.light.brightness)) > 0.2
    for n, (photo, camera) in enumerate(zip(truth.photos, truth.cameras, strict=True)):
        with Image.open(tmp_path / f"layer{n:04d}.tif") as image:
            theirs = np.asarray(image, np.float64)
        assert theirs.shape[:2] == (plan.crop.height, plan.crop.width)
        ours = warp_and_place(*read_for(photo, camera, canvas), canvas, plan.crop, interpolation=cv2.INTER_CUBIC)[0]
        inside = cv2.erode((ours.mask & (theirs[..., 3] > 0)).astype(np.uint8), np.ones((9, 9))).astype(bool)
        assert inside.sum() > 10_000
        exposed = ours.pixels.mean(2) * plan.light.brightness[n]
        right, down, gain = difference(exposed, theirs[..., :3].mean(2), inside)
        assert np.hypot(right, down) < SHIFT
        assert abs(gain - 1) < GAIN


def test_nona_undoes_the_light_that_we_undo(truth, tmp_path):
    gains = np.array([[1.1, 1.0, 0.95], [0.9, 1.05, 1.0], [1.0, 0.9, 1.1], [1.0, 1.0, 1.0]])
    light = Light(gains, np.tile([0.3, 0.05, 0.1], (4, 1)))
    canvas = lay_out(truth, LayoutOptions(projection="cylindrical"))
    path = tmp_path / "x.pto"
    write_pto(truth, str(path), canvas, light=light)
    path.write_text(path.read_text().replace(" r:CROP", ""))

    code, _ = run("nona", "-m", "TIFF_m", "-o", tmp_path / "layer", path)

    assert code == 0
    for n, (photo, camera) in enumerate(zip(truth.photos, truth.cameras, strict=True)):
        with Image.open(tmp_path / f"layer{n:04d}.tif") as image:
            theirs = np.asarray(image, np.float64)
        ours = warp_and_place(*read_for(photo, camera, canvas), canvas, canvas.region, interpolation=cv2.INTER_CUBIC)[0]
        x, y, _ = blocks(camera, canvas, canvas.region).coordinates
        square = radius_square(np.stack([x, y], axis=-1), camera.size)
        exposed = ours.pixels * light.gains[n] * light.brightening(n, np.minimum(square, 1))[..., None]
        inside = ours.mask & (theirs[..., 3] > 0) & (exposed.max(2) < 240)
        inside = cv2.erode(inside.astype(np.uint8), np.ones((9, 9))).astype(bool)
        assert inside.sum() > 10_000
        for channel in range(3):
            for part in (inside & (square < 0.25), inside & (square > 0.5)):
                gain = theirs[part, channel].mean() / exposed[part, channel].mean()
                assert abs(gain - 1) < LIGHT


def difference(ours, theirs, inside):
    """Shift (x, y px) and factor that make one picture (h, w) of the other, by least squares."""
    down, right = np.gradient(ours)
    columns = np.column_stack([right[inside], down[inside], ours[inside]])
    x, y, gain = np.linalg.lstsq(columns, theirs[inside], rcond=None)[0]
    return x, y, gain


def moved_by_the_optimiser(alignment, folder):
    """Largest turn (degrees) of a camera, relative to the first, when Hugin adjusts them to the control points."""
    before, after = folder / "before.pto", folder / "after.pto"
    write_pto(alignment, str(before), lay_out(alignment, LayoutOptions()))
    code, _ = run("autooptimiser", "-n", "-o", after, before)
    assert code == 0
    first, second = read_pto(str(before)).cameras, read_pto(str(after)).cameras
    return max(
        np.rad2deg(rotation.angle(p.cam_from_world.T @ q.cam_from_world)) for p, q in zip(first, second, strict=True)
    )


def test_the_optimiser_finds_nothing_to_improve(truth, tmp_path):
    assert moved_by_the_optimiser(truth, tmp_path) < STILL


def test_the_optimiser_would_notice_half_a_pixel(truth, tmp_path):
    # photos on their sides: points off by half a pixel pull the cameras in different directions
    off = tuple(replace(pair, xy_i=pair.xy_i + 0.5) for pair in truth.control_points)

    assert moved_by_the_optimiser(replace(truth, control_points=off), tmp_path) > 10 * STILL


def test_checkpto_accepts_it(truth, tmp_path):
    path = tmp_path / "x.pto"
    write_pto(truth, str(path), lay_out(truth, LayoutOptions()))

    code, out = run("checkpto", path)

    assert code == 0
    assert "All images are connected" in out
    assert "Maximum           : 0.00" in out
