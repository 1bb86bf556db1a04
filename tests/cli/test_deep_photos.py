"""Photos of 16 bits on the command line: what comes out, and what is said of it."""

import json

import cv2
import numpy as np
import pytest
from PIL import Image


@pytest.fixture(scope="module")
def deep_photos(tmp_path_factory):
    """A folder with a photo of 16 bits and one of 8, of a flat subject; they overlap by half."""
    folder = tmp_path_factory.mktemp("deep")
    rng = np.random.default_rng(7)
    spots = rng.integers(0, 256, (25, 45, 3), dtype=np.uint8)
    subject = cv2.resize(spots, (360, 200), interpolation=cv2.INTER_CUBIC)  # as smooth as a JPEG can hold
    deep, shallow = subject[:, :240].astype(np.int64), subject[:, 120:]
    pixels = (deep * 257 + rng.integers(-128, 129, deep.shape)).clip(0, 65535)
    cv2.imwrite(str(folder / "a.png"), pixels[..., ::-1].astype(np.uint16))
    Image.fromarray(shallow).save(folder / "b.jpg", quality=95)
    return folder


def test_16_bits_and_8_become_16(deep_photos, call):
    project = call(deep_photos, "-o", "a.tif", "--save-project", "a.pano.json", "--json")
    again = call("render", "a.pano.json", "-o", "b.png")
    small = call("render", "a.pano.json", "-o", "c.jpg")

    assert (project.code, again.code, small.code) == (0, 0, 0)
    pixels = cv2.imread("a.tif", cv2.IMREAD_UNCHANGED)
    assert pixels.dtype == np.uint16
    assert len(np.unique(pixels)) > 10_000  # levels
    np.testing.assert_array_equal(cv2.imread("b.png", cv2.IMREAD_UNCHANGED), pixels)
    panorama = json.loads(project.out)["panorama"]
    assert (panorama["depth"], panorama["notes"]) == (16, [])
    assert "16 bits" in again.err
    assert "note: c.jpg: photos have 16 bits" in small.err
    shallow = np.asarray(cv2.imread("c.jpg"), float)
    assert np.abs(shallow - pixels[..., :3] / 257).mean() < 3  # grey levels; JPEG of quality 92 on a rich picture


@pytest.mark.parametrize("command", ["stitch", "render", "batch"])
def test_16_bits_in_a_jpeg_are_refused_before_anything_is_read(command, call):
    result = call(command, "none.pano.json", "-o", "a.jpg", "--depth", "16")

    assert result.code == 2
    assert "jpg: this format has 8 bits" in result.err
