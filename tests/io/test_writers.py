"""Panoramas are written whole or not at all, and never over what must stay."""

import errno
import os
import stat
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from panostitch.errors import LimitError, OutputError
from panostitch.io import atomic, rendering, writers
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import unchanged
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import OutputOptions
from panostitch.runtime.executor import Executor
from tolerances import JPEG_MEAN

BUGS = {".jpg": "passes the check, but has no suffix for the encoder: cv2.error"}

CROP = Region(7, 5, 300, 200)


@pytest.fixture
def picture():
    y, x = np.mgrid[:48, :64]
    return np.stack([x * 3 + 20, y * 4 + 10, 200 - x - y], axis=-1).astype(np.uint8)


@pytest.fixture
def _in_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def refused(path, **given):
    with pytest.raises(OutputError) as caught:
        writers.check_output(str(path), **{"overwrite": False, **given})
    assert str(path) in caught.value.message
    assert "\n" not in caught.value.message
    return caught.value


@pytest.mark.parametrize("name", ["a.jpg", "a.JPEG", "a.png", "a.tif", "a.TIFF", "a b.c.jpg"])
def test_a_new_file_is_welcome(name, tmp_path):
    writers.check_output(str(tmp_path / name), overwrite=False)

    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a", "a.gif", "a.jpg.txt", "jpg", "a.pano.json", ".jpg"])
def test_names_must_end_in_a_known_extension(name, tmp_path):
    assert ".png" in refused(tmp_path / name).message


def test_other_extensions_may_be_asked_for(tmp_path):
    writers.check_output(str(tmp_path / "a.pano.json"), overwrite=False, extensions=[".pano.json"])

    assert ".pano.json" in refused(tmp_path / "a.jpg", extensions=[".pano.json"]).message


def test_a_folder_is_no_file(tmp_path):
    (tmp_path / "a.jpg").mkdir()

    assert "folder" in refused(tmp_path / "a.jpg", overwrite=True).message


def test_the_folder_must_be_there(tmp_path):
    assert "mkdir" in refused(tmp_path / "none" / "a.jpg").hint


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").touch()

    refused(tmp_path / "file" / "a.jpg")


def test_what_exists_is_not_overwritten_unasked(tmp_path):
    (tmp_path / "a.jpg").touch()

    assert "--overwrite" in refused(tmp_path / "a.jpg").hint
    writers.check_output(str(tmp_path / "a.jpg"), overwrite=True)


@pytest.mark.usefixtures("_in_tmp_path")
@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("output", ["a.jpg", "./a.jpg", "folder/../a.jpg", "soft.jpg", "hard.jpg"])
def test_a_photo_is_never_overwritten(output, overwrite, tmp_path):
    Path("a.jpg").touch()
    Path("folder").mkdir()
    Path("soft.jpg").symlink_to("a.jpg")
    Path("hard.jpg").hardlink_to("a.jpg")

    error = refused(output, overwrite=overwrite, inputs=["missing.jpg", str(tmp_path / "a.jpg")])

    assert "one of the photos" in error.message


def test_a_folder_that_cannot_be_written_to(tmp_path, monkeypatch):
    # the tests may run as root, who may write anywhere
    monkeypatch.setattr(os, "access", lambda path, mode: not (Path(path) == tmp_path and mode & os.W_OK))

    assert "cannot be written" in refused(tmp_path / "a.jpg").message


def test_a_name_too_long_for_any_disk(tmp_path):
    refused(tmp_path / ("a" * 300 + ".jpg"))


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.TIFF", "a.PNG"])
def test_lossless_formats_hold_what_was_written(name, picture, tmp_path):
    writers.write_picture(str(tmp_path / name), picture, np.full(picture.shape[:2], 255, np.uint8))

    with Image.open(tmp_path / name) as image:
        assert image.mode == "RGB"
        np.testing.assert_array_equal(np.asarray(image), picture)


@pytest.mark.parametrize("name", ["a.jpg", "a.JPEG"])
def test_jpeg(name, picture, tmp_path):
    hole = np.full(picture.shape[:2], 255, np.uint8)
    hole[:5] = 0

    writers.write_picture(str(tmp_path / name), picture, hole, quality=95)

    with Image.open(tmp_path / name) as image:
        assert (image.format, image.mode) == ("JPEG", "RGB")
        assert np.abs(np.asarray(image, float) - picture).mean() < JPEG_MEAN


def test_quality_is_worth_bytes(rng, tmp_path):
    noise = rng.integers(0, 256, (64, 64, 3), dtype=np.uint8)
    for quality in (10, 92):
        writers.write_picture(str(tmp_path / f"{quality}.jpg"), noise, quality=quality)

    assert 2 * (tmp_path / "10.jpg").stat().st_size < (tmp_path / "92.jpg").stat().st_size


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_what_no_photo_covers_is_transparent(name, picture, tmp_path):
    mask = np.full(picture.shape[:2], 255, np.uint8)
    mask[:10, :7] = 0

    writers.write_picture(str(tmp_path / name), picture, mask)

    with Image.open(tmp_path / name) as image:
        assert image.mode == "RGBA"
        np.testing.assert_array_equal(np.asarray(image), np.dstack([picture, mask]))


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def fail(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


FAILURES = {
    "encoder": lambda patch: patch.setattr(Image.Image, "save", fail),
    "disk full": lambda patch: patch.setattr(atomic.os, "open", fail),
    "rename": lambda patch: patch.setattr(os, "replace", fail),
    "permissions": lambda patch: patch.setattr(os, "chmod", fail),
}


@pytest.mark.parametrize("where", FAILURES)
@pytest.mark.parametrize("before", [{}, {"a.png": b"the old panorama"}])
def test_a_failure_leaves_everything_as_it_was(where, before, picture, tmp_path, monkeypatch):
    for name, content in before.items():
        (tmp_path / name).write_bytes(content)
    FAILURES[where](monkeypatch)

    with pytest.raises(OutputError, match=r"a\.png"):
        writers.write_picture(str(tmp_path / "a.png"), picture)

    assert files(tmp_path) == before


def test_an_interruption_leaves_nothing_behind(picture, tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)

    with pytest.raises(KeyboardInterrupt):
        writers.write_picture(str(tmp_path / "a.png"), picture)

    assert files(tmp_path) == {}


def test_a_file_has_the_permissions_of_any_new_file(tmp_path):
    before = os.umask(0o027)
    try:
        writers.write_bytes(str(tmp_path / "a.bin"), b"x")
    finally:
        after = os.umask(before)

    assert after == 0o027
    assert stat.S_IMODE((tmp_path / "a.bin").stat().st_mode) == 0o640


def coordinates(region):
    """A layer whose pixels say where they are; nothing is covered left of canvas column 20."""
    y, x = np.mgrid[region.y : region.bottom, region.x : region.right]
    pixels = np.stack([x % 256, y % 256, (x + y) % 7], axis=-1).astype(np.float32) + np.float32(0.3)
    return Layer(region, pixels, x >= 20)


@pytest.fixture
def panorama():
    plan = Plan(unchanged(2), 1, np.zeros((1, 1), np.int16), (), CROP, "as asked")
    return Panorama(Canvas("cylindrical", 100.0, (0.0, 0.0), (320, 240)), plan, coordinates)


@pytest.mark.parametrize("threads", [1, 3])
def test_tiles_make_up_the_crop(threads, panorama, monkeypatch):
    monkeypatch.setattr(rendering, "TILE", 64)

    pixels, mask = writers.assemble(panorama, run=Executor(threads))

    whole = coordinates(CROP)
    np.testing.assert_array_equal(pixels, np.floor(whole.pixels))  # 0.3 above a whole level
    np.testing.assert_array_equal(mask, np.where(whole.mask, 255, 0))


def test_levels_beyond_the_range_are_cut(panorama):
    def glaring(region):
        layer = coordinates(region)
        return replace(layer, pixels=layer.pixels * 10 - 300)

    pixels, _ = writers.assemble(replace(panorama, read=glaring))

    expected = np.rint(coordinates(CROP).pixels * 10 - 300).clip(0, 255)
    np.testing.assert_array_equal(pixels, expected)


def test_write_panorama(panorama, tmp_path):
    events = []

    writers.write_panorama(
        panorama, str(tmp_path / "a.png"), OutputOptions(), trace=lambda event, **data: events.append((event, data))
    )

    with Image.open(tmp_path / "a.png") as image:
        assert (image.size, image.mode) == ((300, 200), "RGBA")
    ((event, data),) = events
    assert event == "panorama.written"
    assert (data["path"], data["size"]) == (str(tmp_path / "a.png"), (300, 200))
    assert data["preview"].shape == (200, 300, 3)


def test_a_jpeg_of_impossible_size_is_refused_before_it_is_rendered(panorama, tmp_path):
    def never(region):
        raise AssertionError(f"{region} was rendered")

    wide = replace(panorama, plan=replace(panorama.plan, crop=Region(0, 0, 65_501, 10)), read=never)

    with pytest.raises(LimitError, match="65500"):
        writers.write_panorama(wide, str(tmp_path / "a.JPG"), OutputOptions())

    assert files(tmp_path) == {}
