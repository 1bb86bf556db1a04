"""Hugin's project file: the same rays go through the same pixels, by a panotools camera that is written here anew."""

import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from panostitch.compositing import lay_out
from panostitch.errors import InputError, UsageError
from panostitch.geometry import rotation
from panostitch.io.pto import check_photos, read_pto, write_pto
from panostitch.io.readers import open_photo
from panostitch.model.alignment import Alignment
from panostitch.model.camera import Camera
from panostitch.model.canvas import Region
from panostitch.model.light import Light
from panostitch.model.match import ControlPoints
from panostitch.options import LayoutOptions
from tolerances import PIXEL

SIZE = (300, 200)

# px: numbers in the file have 12 digits
WRITTEN = 1e-6
# px: the promise of a round trip; 0.0015 seen for k1 -0.15, k2 0.05
ROUND_TRIP = 0.01
# px: control points have four decimals in the file
FOUR_DECIMALS = 1e-4


@pytest.fixture(autouse=True)
def _in_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def save(name, size=SIZE, orientation=1):
    """A photo that is `size` when upright."""
    stored = size[::-1] if orientation > 4 else size
    exif = Image.Exif()
    exif[0x0112] = orientation
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    tags = {"tiffinfo": {0x0112: orientation}} if name.endswith("tif") else {"exif": exif}
    Image.new("RGB", stored).save(name, **tags)
    return name


def alignment_of(cameras, model="rotation", orientations=None, points=()):
    photos = []
    for n, camera in enumerate(cameras):
        photos.append(open_photo(save(f"p {n}.png", camera.size, (orientations or [1] * len(cameras))[n])))
    return Alignment(model, tuple(photos), tuple(cameras), (), (), 0.0, 0.0, control_points=tuple(points))


def turning(size=SIZE, shift=(0.0, 0.0), **lens):
    """Four cameras that look to either side of straight ahead, unevenly; up, down, and tilted."""
    centre = ((size[0] - 1) / 2 + shift[0], (size[1] - 1) / 2 + shift[1])
    angles = np.deg2rad([[-30, 3, 10], [-8, -12, -80], [15, 20, 170], [38, 1, 2]])
    return [Camera(size, 280.0, centre, rotation.from_angles(*turn), **lens) for turn in angles]


def before_a_plane(count=5, size=SIZE, focal=330.0):
    """Homographies of photos by one camera of a plane that the first photo sees askance; plane: its pixels."""
    rng = np.random.default_rng(7)
    middle = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    normal = np.array([0.2, -0.15, 1.0]) / np.linalg.norm([0.2, -0.15, 1.0])
    matrices = [np.eye(3)]
    for _ in range(count - 1):
        turn = rotation.from_angles(*rng.uniform(-0.2, 0.2, 3))
        place = rng.uniform(-0.3, 0.3, 3)
        matrices.append(middle @ turn @ (np.eye(3) - np.outer(place, normal)) @ np.linalg.inv(middle))
    return [Camera(size, 1.0, (0.0, 0.0), matrix / matrix[2, 2]) for matrix in matrices]


def maps(*linear):
    """Cameras of a flat subject by their maps (2, 2)."""
    rng = np.random.default_rng(3)
    matrices = [np.eye(3) for _ in linear]
    for matrix, given in zip(matrices, linear, strict=True):
        matrix[:2, :2], matrix[:2, 2] = given, rng.uniform(-90, 90, 2)
    return [Camera(SIZE, 1.0, (0.0, 0.0), matrix) for matrix in matrices]


def similar(factor, degrees):
    c, s = factor * np.cos(np.deg2rad(degrees)), factor * np.sin(np.deg2rad(degrees))
    return np.array([[c, -s], [s, c]])


def values(line, first=()):
    """The numbers of a line by their names; linked ones from the first image."""
    found = {}
    for name, value in re.findall(r" ([A-Za-z]+)(=?[-0-9.e]+)(?= )", line.split(' n"')[0].replace(" ", "  ") + "  "):
        found[name] = first[name] if value.startswith("=") else float(value)
    return found


class Panotools:
    """libpano13's way from a panorama's pixels to a photo's (adjust.c SetMakeParams, math.c), in angles."""

    def __init__(self, path):
        lines = Path(path).read_text().splitlines()
        panorama = next(line for line in lines if line.startswith("p "))
        self.panorama = values(panorama)
        # Hugin makes the width of an equirectangular panorama even, and takes `v` for that of the wider one
        self.panorama["w"] += self.panorama["f"] == 2 and self.panorama["w"] % 2
        self.crop = [int(n) for n in re.search(r" S(\S+)", panorama)[1].split(",")]
        self.images = []
        for line in lines:
            if line.startswith("i "):
                self.images.append(values(line, self.images[0] if self.images else ()))
        self.points = [values(line + " ") for line in lines if line.startswith("c ")]

    def photo(self, number, xy):
        """Where (n, 2) a photo sees pixels (n, 2) of the cropped panorama."""
        p, i = self.panorama, self.images[number]
        xy = xy + np.array([self.crop[0], self.crop[2]]) - (np.array([p["w"], p["h"]]) - 1) / 2
        field = np.deg2rad(p["v"])
        distance = p["w"] / (2 * np.tan(field / 2)) if p["f"] == 0 else p["w"] / field
        u, v = xy.T / distance
        longitude = np.arctan(u) if p["f"] == 0 else u
        latitude = {0: np.arctan2(v, np.hypot(u, 1)), 1: np.arctan(v), 2: v}[int(p["f"])]
        longitude, latitude = self._through_plane(i, longitude, latitude)
        longitude = longitude - np.deg2rad(i["y"])
        # up is z, ahead x, right y; pitch about y, roll about x
        ray = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), -np.sin(latitude)])
        pitch, roll = np.deg2rad(i["p"]), np.deg2rad(i["r"])
        ahead, up = np.cos(pitch) * ray[0] + np.sin(pitch) * ray[2], np.cos(pitch) * ray[2] - np.sin(pitch) * ray[0]
        right, up = np.cos(roll) * ray[1] - np.sin(roll) * up, np.cos(roll) * up + np.sin(roll) * ray[1]
        flat = np.stack([right, -up]) / ahead * i["w"] / 2 / np.tan(np.deg2rad(i["v"]) / 2)
        rho = np.hypot(*flat) / (min(i["w"], i["h"]) / 2)
        a, b, c = i["a"], i["b"], i["c"]
        flat = flat * (a * rho**3 + b * rho**2 + c * rho + 1 - a - b - c)
        return flat.T + [i["d"], i["e"]] + (np.array([i["w"], i["h"]]) - 1) / 2

    @staticmethod
    def _through_plane(i, longitude, latitude):
        if not any(i[name] for name in ("TrX", "TrY", "TrZ")):
            return longitude, latitude

        def cartesian(phi, down):
            return np.stack([np.cos(down) * np.sin(phi), np.sin(down), -np.cos(down) * np.cos(phi)])

        normal = cartesian(np.deg2rad(i["Tpy"]), -np.deg2rad(i["Tpp"]))
        ray = cartesian(longitude, latitude)
        x, y, z = ray / (normal @ ray) - np.array([[i["TrX"]], [i["TrY"]], [i["TrZ"]]])
        return np.arctan2(x, -z), np.arcsin(y / np.sqrt(x * x + y * y + z * z))


def written(alignment, crop=None, light=None, **layout):
    """Write x.pto; the canvas and what was said of it."""
    canvas = lay_out(alignment, LayoutOptions(**layout))
    return canvas, write_pto(alignment, "x.pto", canvas, crop=crop, light=light)


def farthest(alignment, canvas, region=None, frames=None):
    """Largest distance px between where our camera and Hugin's see the canvas, over all photos."""
    hugin, worst = Panotools("x.pto"), 0.0
    corner = np.array([region.x, region.y] if region else [0, 0])
    for n, camera in enumerate(alignment.cameras):
        x, y = np.meshgrid(*(np.linspace(0, size - 1, 9) for size in camera.size))
        xy = np.column_stack([x.ravel(), y.ravel()])
        seen = hugin.photo(n, canvas.pixels(camera.rays(xy)) - corner)
        worst = max(worst, float(np.abs(seen - (frames[n](xy) if frames else xy)).max()))
    return worst


@pytest.mark.parametrize("scale", [1.0, 0.37])
@pytest.mark.parametrize("projection", ["rectilinear", "cylindrical", "equirectangular"])
def test_hugin_sees_what_we_see(projection, scale):
    alignment = alignment_of(turning(shift=(7.0, -11.0), k1=-0.12))

    canvas, exactness = written(alignment, projection=projection, scale=scale)

    assert exactness.lens < WRITTEN
    assert farthest(alignment, canvas) < WRITTEN


@pytest.mark.parametrize("size", [(301, 200), (300, 201), (200, 300)])
def test_odd_and_upright_sizes(size):
    alignment = alignment_of(turning(size=size, shift=(1.5, 0.25)))

    canvas, _ = written(alignment)

    assert farthest(alignment, canvas) < WRITTEN


def test_a_closed_turn():
    turns = [rotation.from_angles(a, 0.05, 0.0) for a in np.arange(9) * 2 * np.pi / 9]
    alignment = alignment_of([Camera(SIZE, 250.0, (149.5, 99.5), turn) for turn in turns])

    canvas, _ = written(alignment)

    assert canvas.wraps
    assert Panotools("x.pto").panorama["v"] == 360
    assert Panotools("x.pto").panorama["w"] == canvas.size[0]
    assert farthest(alignment, canvas) < WRITTEN


def test_the_crop_of_the_panorama():
    alignment = alignment_of(turning())
    region = Region(31, 17, 120, 90)

    canvas, _ = written(alignment, crop=region)

    left, right, top, bottom = Panotools("x.pto").crop
    assert (right - left, bottom - top) == (120, 90)
    assert farthest(alignment, canvas, region) < WRITTEN


def test_the_error_of_the_lens_is_the_error_that_is_stated():
    alignment = alignment_of(turning(k1=-0.2, k2=0.06))

    canvas, exactness = written(alignment, projection="cylindrical")

    worst = farthest(alignment, canvas)
    assert worst <= exactness.lens * (1 + 1e-6) + WRITTEN
    assert worst > exactness.lens / 4
    assert f"to {exactness.lens:.3f} px" in Path("x.pto").read_text()


def test_a_poor_lens_is_called_poor():
    camera = Camera((1500, 1000), 750.0, (749.5, 499.5), np.eye(3), -0.3, 0.5)
    alignment = alignment_of([camera])

    _, exactness = written(alignment, projection="cylindrical")

    assert exactness.poor
    assert "differ visibly" in Path("x.pto").read_text()


def test_a_lens_that_folds_in_the_photo_is_refused():
    alignment = alignment_of(turning(k1=-4.0))

    with pytest.raises(UsageError, match="distorts"):
        written(alignment)


def test_photos_of_one_lens_are_linked():
    cameras = turning(k1=-0.1)
    alignment = alignment_of([*cameras[:3], replace(cameras[3], focal=281.0)])

    written(alignment)

    lines = [line for line in Path("x.pto").read_text().splitlines() if line.startswith("i ")]
    assert [" v=0 " in line for line in lines] == [False, True, True, False]
    assert [" b=0 " in line for line in lines] == [False, True, True, False]


def test_gains_are_exposure_values():
    alignment = alignment_of(turning())
    # a photo that is twice too dark in linear light, which Hugin says with a higher exposure value
    gains = np.array([2 ** (1 / 2.2), 1.0, 2 ** (-1 / 2.2), 1.0])
    written(alignment, light=Light(np.repeat(gains[:, None], 3, axis=1), np.zeros((4, 3))))

    assert [image["Eev"] for image in Panotools("x.pto").images] == pytest.approx([1, 0, -1, 0], abs=1e-9)


def stored_6(xy):
    return np.column_stack([xy[:, 1], SIZE[0] - 1 - xy[:, 0]])


def stored_8(xy):
    return np.column_stack([SIZE[1] - 1 - xy[:, 1], xy[:, 0]])


def stored_3(xy):
    return np.array(SIZE) - 1 - xy


TURNED = {1: lambda xy: xy, 3: stored_3, 6: stored_6, 8: stored_8}


@pytest.mark.parametrize("orientations", [(6, 3, 8, 1), (8, 6, 1, 3)])
def test_photos_that_are_stored_turned(orientations):
    # upright photos that are higher than wide: a camera on its side
    size = SIZE
    frames = [TURNED[orientation] for orientation in orientations]
    cameras = turning(size=size, shift=(3.0, -5.0), k1=-0.1)
    xy = np.array([[10.0, 20.0], [250.25, 170.5]])
    alignment = alignment_of(cameras, orientations=[1] * 4, points=[ControlPoints(0, 1, xy, xy[::-1])])
    photos = []
    for n, orientation in enumerate(orientations):
        # TIFF: an orientation that stands a picture up is believed there
        photos.append(open_photo(save(f"t{n}.tif", size, orientation)))
        assert photos[-1].size == size
    alignment = replace(alignment, photos=tuple(photos))

    canvas, _ = written(alignment)

    assert farthest(alignment, canvas, frames=frames) < WRITTEN
    point = Panotools("x.pto").points[0]
    assert [point["x"], point["y"]] == pytest.approx(list(frames[0](xy)[0]), abs=FOUR_DECIMALS)
    assert [point["X"], point["Y"]] == pytest.approx(list(frames[1](xy[::-1])[0]), abs=FOUR_DECIMALS)
    same_but_for_a_turn(alignment, read_pto("x.pto"))


def test_a_jpeg_on_its_side(save):
    upright = (200, 300)
    exif = Image.Exif()
    exif[0x0112] = 6
    photo = open_photo(save("side.jpg", np.zeros((200, 300, 3), np.uint8), exif=exif))
    assert photo.size == upright
    alignment = alignment_of(turning(size=upright)[:1])
    alignment = replace(alignment, photos=(photo,))

    canvas, _ = written(alignment)

    def frame(xy):
        return np.column_stack([xy[:, 1], upright[0] - 1 - xy[:, 0]])

    assert (Panotools("x.pto").images[0]["w"], Panotools("x.pto").images[0]["h"]) == (300, 200)
    assert farthest(alignment, canvas, frames=[frame]) < WRITTEN


@pytest.mark.parametrize("orientation", [2, 4, 5, 7])
def test_mirrored_photos_are_refused_by_name(orientation):
    photo = open_photo(save("mirrored.png", (200, 300) if orientation > 4 else SIZE, orientation))

    with pytest.raises(UsageError, match=r"mirrored\.png"):
        check_photos([photo])


def test_names_that_a_pto_file_cannot_hold():
    photo = open_photo(save('two "quotes".png'))

    with pytest.raises(UsageError, match="quotes"):
        check_photos([photo])


def same_but_for_a_turn(ours, back, tolerance=WRITTEN):
    """Both see the same, pixel for pixel; a cylinder's .pto is turned so that its middle is straight ahead."""
    turn = back.cameras[0].cam_from_world.T @ ours.cameras[0].cam_from_world
    for camera, other in zip(ours.cameras, back.cameras, strict=True):
        assert other.size == camera.size
        xy = camera.outline()
        np.testing.assert_allclose(other.project(camera.rays(xy) @ turn.T), xy, atol=tolerance)


@pytest.mark.parametrize(("k1", "k2"), [(0.0, 0.0), (-0.1, 0.0), (0.15, 0.0), (-0.15, 0.05), (0.05, -0.02)])
@pytest.mark.parametrize("projection", ["rectilinear", "equirectangular"])
def test_round_trip(projection, k1, k2):
    alignment = alignment_of(turning(shift=(-4.5, 2.0), k1=k1, k2=k2))

    written(alignment, projection=projection)
    back = read_pto("x.pto")

    assert back.model == "rotation"
    same_but_for_a_turn(alignment, back, ROUND_TRIP if k2 else WRITTEN)


def test_control_points_come_back():
    xy = np.array([[0.0, 0.0], [123.25, 99.5], [299.0, 199.0]])
    alignment = alignment_of(turning(), points=[ControlPoints(0, 1, xy, xy[::-1]), ControlPoints(1, 3, xy[1:], xy[1:])])

    written(alignment)
    back = read_pto("x.pto")

    assert [(points.i, points.j) for points in back.control_points] == [(0, 1), (1, 3)]
    for points, other in zip(alignment.control_points, back.control_points, strict=True):
        np.testing.assert_allclose(other.xy_i, points.xy_i, atol=FOUR_DECIMALS)
        np.testing.assert_allclose(other.xy_j, points.xy_j, atol=FOUR_DECIMALS)


def test_true_control_points_have_no_error_when_read():
    cameras = turning(k1=-0.1)
    xy = np.array([[200.0, 60.0], [220.0, 110.0], [250.0, 90.0]])
    points = ControlPoints(0, 1, xy, cameras[1].project(cameras[0].rays(xy)))
    written(alignment_of(cameras, points=[points]))

    back = read_pto("x.pto")

    assert back.rms < 2 * FOUR_DECIMALS
    assert [(link.i, link.j, link.matches) for link in back.links] == [(0, 1, 3)]


FLAT = {
    "from anywhere": ("homography", before_a_plane),
    "two photos": ("homography", lambda: before_a_plane(2)),
    "similar": ("similarity", lambda: maps(np.eye(2), similar(1.3, 20), similar(0.8, -95), similar(1, 180))),
    "affine": ("affine", lambda: maps(np.eye(2), [[1.02, 0.01], [-0.03, 0.97]], [[0.98, 0.02], [0.01, 1.03]])),
}
# px: full scale; only a squeeze, which takes a camera far away, leaves something: 0.01 seen
FLAT_ERROR = 0.03


@pytest.mark.parametrize("case", FLAT)
def test_a_flat_subject(case):
    model, cameras = FLAT[case]
    alignment = alignment_of(cameras(), model)

    canvas, exactness = written(alignment)

    assert exactness.plane < FLAT_ERROR
    assert farthest(alignment, canvas) < FLAT_ERROR


def test_a_flat_subject_comes_back():
    alignment = alignment_of(before_a_plane(), "homography")
    written(alignment)

    back = read_pto("x.pto")

    assert back.model == "homography"
    # the plane may have got other axes: photo to photo nothing changes
    xy = np.array([[100.0, 80.0], [150.0, 100.0], [180.0, 130.0]])
    for camera, other in zip(alignment.cameras, back.cameras, strict=True):
        ours = alignment.cameras[0].project(camera.rays(xy))
        np.testing.assert_allclose(back.cameras[0].project(other.rays(xy)), ours, atol=FLAT_ERROR)


def test_homographies_that_no_camera_takes_are_called_poor():
    rng = np.random.default_rng(2)
    cameras = [
        replace(camera, cam_from_world=camera.cam_from_world + rng.normal(0, [[0.1], [0.1], [3e-4]], (3, 3)))
        for camera in before_a_plane(4)
    ]
    alignment = alignment_of(cameras, "homography")

    canvas, exactness = written(alignment)

    assert exactness.poor
    assert farthest(alignment, canvas) < 1.5 * exactness.plane


HEAD = 'p f2 w3000 h1500 v360 E0 R0 n"TIFF_m"\nm i0\n'
LINE = 'i w300 h200 f0 v50 Ra0 r0 p0 y0 TrX0 TrY0 TrZ0 j0 a0 b0 c0 d0 e0 g0 t0 n"a.png"\n'
OTHER = LINE.replace("v50", "v=0").replace("a0 b0 c0 d0 e0", "a=0 b=0 c=0 d=0 e=0").replace("a.png", "b c.png")


def project(text):
    for name in ("a.png", "b c.png"):
        if not os.path.exists(name):
            save(name)
    Path("x.pto").write_text(HEAD + text)
    return read_pto("x.pto")


def test_links_of_hugin_are_followed():
    third = OTHER.replace("v=0", "v=1")

    back = project(LINE.replace("d0", "d3") + OTHER + third)

    assert {camera.focal for camera in back.cameras} == {150 / np.tan(np.deg2rad(25))}
    assert {camera.centre for camera in back.cameras} == {(152.5, 99.5)}


def test_angles_are_read_as_written():
    back = project(LINE + OTHER.replace("y0", "y90").replace("p0", "p30"))

    np.testing.assert_allclose(back.cameras[0].cam_from_world[2], [0, 0, 1], atol=PIXEL)
    # to the right, and up, which is negative y
    np.testing.assert_allclose(back.cameras[1].cam_from_world[2], [np.sqrt(0.75), -0.5, 0], atol=PIXEL)


def test_a_lens_that_is_not_quite_ours_is_noted():
    back = project(LINE.replace("a0 b0 c0", "a0.05 b-0.2 c0.3") + OTHER)

    assert "k1 and k2 only to" in back.reason


def test_masks_are_said_to_be_ignored():
    assert "masks" in project(LINE + OTHER + 'k i0 t0 p"1 1 2 2 3 1"\n').reason
    assert "masks" not in project(LINE + OTHER).reason


def test_photos_that_are_switched_off_are_left_out():
    back = project(
        LINE + "#-hugin  cropFactor=1 disabled\n" + OTHER + LINE + "c n1 N2 x1 y1 X2 Y2 t0\nc n0 N2 x1 y1 X2 Y2\n"
    )

    assert [photo.name for photo in back.left_out] == ["b c.png"]
    assert len(back.photos) == 2
    assert [(points.i, points.j) for points in back.control_points] == [(0, 1)]


BROKEN = {
    "no photo line": ("", "names no photos"),
    "no name": (LINE.replace('n"a.png"', ""), "file name"),
    "name without end": (LINE.replace('n"a.png"', 'n"a.png'), "file name"),
    "photo gone": (LINE.replace("a.png", "gone.png"), "gone.png: no such file"),
    "name with a zero": (LINE.replace("a.png", "a\0.png"), ""),
    "no v": (LINE.replace("v50 ", ""), "no v"),
    "no yaw": (LINE.replace("y0 ", ""), "no y"),
    "v of nothing": (LINE.replace("v50", "v0"), "0 degrees"),
    "v negative": (LINE.replace("v50", "v-50"), "degrees"),
    "v half round": (LINE.replace("v50", "v180"), "180 degrees"),
    "v not a number": (LINE.replace("v50", "vnan"), "no v"),
    "v Nan with sign": (LINE.replace("v50", "v+nan"), "v is"),
    "v words": (LINE.replace("v50", "v5O"), "v is"),
    "yaw infinite": (LINE.replace("y0", "y1e999"), "y is"),
    "yaw enormous": (LINE.replace("y0", "y" + "9" * 400), "y is"),
    "a enormous": (LINE.replace("a0", "a1e300"), "a is"),
    "linked to itself": (LINE.replace("v50", "v=0"), "linked to itself"),
    "linked in a ring": (LINE.replace("v50", "v=1") + OTHER, "linked to itself"),
    "linked to nobody": (LINE.replace("v50", "v=7"), "no image"),
    "linked to minus one": (LINE.replace("v50", "v=-1"), "no image"),
    "fisheye": (LINE.replace("f0", "f3"), "fisheye"),
    "type unknown": (LINE.replace("f0", "f77"), "77"),
    "sheared": (LINE.replace("g0", "g5"), "sheared"),
    "another size": (LINE.replace("w300", "w301"), "301 x 200"),
    "plane from the side": (LINE.replace("TrZ0", "TrZ-1"), "from the side"),
    "point of nobody": (LINE + OTHER + "c n0 N2 x1 y1 X2 Y2 t0\n", "no image"),
    "point without place": (LINE + OTHER + "c n0 N1 x1 y1 X2 t0\n", "Y is"),
    "point nowhere": (LINE + OTHER + "c n0 N1 x1 y1 Xinf Y2 t0\n", "X is"),
    "all switched off": ("#-hugin disabled\n" + LINE, "switched off"),
    "endless line": ("i " + "w300 " * 250_000, "file name"),
    "endless word": ("i w" + "3" * 1_000_000 + ' n"a.png"', "w is"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_project_is_refused_in_one_line(case):
    text, word = BROKEN[case]

    with pytest.raises(InputError) as caught:
        project(text)

    assert word in caught.value.message
    assert "\n" not in caught.value.message
    assert len(caught.value.message) < 300


NO_PROJECT = {
    "nothing": b"",
    "text": b"Dear reader,\n" * 50,
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "noise": np.random.default_rng(1).bytes(100_000),
    "one long line": b"i" * 1_000_000,
}


@pytest.mark.parametrize("case", NO_PROJECT)
def test_what_is_no_project_is_refused_by_name(case):
    Path("x.pto").write_bytes(NO_PROJECT[case])

    with pytest.raises(InputError, match=r"x\.pto"):
        read_pto("x.pto")


@pytest.mark.parametrize("path", ["none.pto", "folder.pto"])
def test_what_cannot_be_read(path):
    Path("folder.pto").mkdir()

    with pytest.raises(InputError, match=path):
        read_pto(path)


@pytest.mark.parametrize("path", ["x.pto", "sub/x.pto"])
def test_names_are_relative_and_may_be_anything_else(path):
    Path("sub").mkdir()
    names = [os.fsdecode(b"caf\xe9 v5 y3.png"), "far/a b ü.png"]
    cameras = turning()[:2]
    alignment = replace(alignment_of(cameras), photos=tuple(open_photo(save(name)) for name in names))

    write_pto(alignment, path, lay_out(alignment, LayoutOptions()))
    back = read_pto(path)

    assert [os.path.samefile(photo.path, name) for photo, name in zip(back.photos, names, strict=True)] == [True, True]
    same_but_for_a_turn(alignment, back)
