"""`--pto` and `render x.pto` on the command line."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

# grey levels: seams may take another way where the same cameras have other last digits
SAME_MEAN = 0.5


@pytest.fixture
def stitched(call, photos):
    """A panorama of three photos and its .pto."""
    result = call(photos, "-o", "a.png", "--pto", "a.pto", "--projection", "rectilinear", "--crop", "none", "-v")
    assert result.code == 0
    return result


def test_a_pto_renders_the_panorama_again(call, stitched):
    assert "note: a.pto: Hugin's a, b, c" in stitched.err

    result = call("render", "a.pto", "-o", "b.png", "--projection", "rectilinear", "--crop", "none")

    assert result.code == 0
    with Image.open("a.png") as first, Image.open("b.png") as second:
        a, b = (np.asarray(image, np.float64) for image in (first, second))
    assert np.abs(np.array(a.shape) - b.shape).max() <= 1
    height, width = np.minimum(a.shape[:2], b.shape[:2])
    assert np.abs(a[:height, :width] - b[:height, :width]).mean() < SAME_MEAN


def test_align_writes_one_too(call, photos):
    result = call("align", photos, "-o", "x.pano.json", "--pto", "x.pto")

    assert result.code == 0
    assert call("render", "x.pto", "-o", "x.jpg", "--scale", 0.25).code == 0


def test_a_turned_view_is_the_view_in_the_pto(call, photos):
    result = call(photos, "-o", "a.png", "--pto", "a.pto", "--projection", "rectilinear", "--yaw", 10)

    assert result.code == 0
    yaws = [
        float(line.split(" y")[1].split()[0])
        for line in Path("a.pto").read_text().splitlines()
        if line.startswith("i ")
    ]
    assert yaws[1] == pytest.approx(-10, abs=1)


def test_a_pto_that_exists_is_kept(call, photos):
    Path("x.pto").write_text("mine")

    assert call(photos, "-o", "a.jpg", "--pto", "x.pto").code == 8
    assert Path("x.pto").read_text() == "mine"


def test_a_pto_is_called_so(call, photos):
    assert call(photos, "-o", "a.jpg", "--pto", "x.txt").code == 8


def test_a_broken_pto(call):
    Path("x.pto").write_text("i w\n")

    result = call("render", "x.pto", "-o", "a.jpg")

    assert result.code == 5
    assert result.err.startswith("error: x.pto: not a sound Hugin project")


def test_a_mirrored_photo_is_refused_before_any_work(call, photos, save):
    exif = Image.Exif()
    exif[0x0112] = 2
    with Image.open(photos / "a.jpg") as image:
        mirrored = save("mirrored.jpg", np.asarray(image)[:, ::-1], exif=exif)

    result = call(mirrored, photos / "b.jpg", "-o", "a.jpg", "--pto", "x.pto")

    assert result.code == 2
    assert "mirrored.jpg" in result.err
