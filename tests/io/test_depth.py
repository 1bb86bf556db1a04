"""Panoramas of 16 bits: every value that was rendered is in the file, and who gets them is a stated rule."""

import functools
import os
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
import tifffile

from compositing.mosaics import alignment_of, shifted
from deep import deep_photo
from panostitch.errors import UsageError
from panostitch.io import tiff, writers
from panostitch.io.limits import arranged
from panostitch.io.rendering import Rendering, read_tile
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import unchanged
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import OutputOptions
from panostitch.runtime import memory
from panostitch.runtime.executor import Executor

# Odd, no multiples of a tile, two rows and columns of tiles, the last ones narrow; begins off the canvas's corner.
CROP = Region(13, 5, 1037, 525)


def computed(region):
    """A layer of values between those of 8 bits, beyond black and white too; a disc is not covered."""
    y, x = np.mgrid[region.y : region.bottom, region.x : region.right].astype(np.int32)
    levels = np.stack([x * 43 + y, 65_535 - x * 3 - y * 70, (x * y) % 70_000 - 2000], axis=-1)
    mask = (x - 700) ** 2 + (y - 300) ** 2 > 200**2
    return Layer(region, np.asarray(np.where(mask[..., None], levels, 0) / 257, np.float32), mask)


def panorama_of(*, covered=False, crop=CROP, depths=(16,)):
    alignment = alignment_of([shifted((8, 8), 0, 0)] * len(depths), model="similarity")
    deep = deep_photo("p", np.zeros((8, 8, 3), np.uint16))
    photos = [deep if depth == 16 else replace(deep, deep=None) for depth in depths]
    plan = Plan(unchanged(1), 1, np.zeros((1, 1), np.int16), (), crop, "as asked", covered)
    canvas = Canvas("cylindrical", 100.0, (0.0, 0.0), (crop.right, crop.bottom))
    return Panorama(canvas, plan, computed, alignment=replace(alignment, photos=tuple(photos)))


def write(path, panorama, *, threads=2, **options):
    return writers.write_panorama(panorama, str(path), OutputOptions(**options), run=Executor(threads))


@functools.cache
def expected(channels):
    pixels, mask = read_tile(panorama_of(), CROP, 16)
    return np.dstack([pixels, mask])[..., :channels]


def test_levels_are_rounded_and_cut_to_16_bits():
    pixels, mask = read_tile(panorama_of(), CROP, 16)

    layer = computed(CROP)
    np.testing.assert_array_equal(pixels, np.rint(layer.pixels.astype(float) * 257).clip(0, 65535))
    np.testing.assert_array_equal(mask, np.where(layer.mask, 65535, 0))
    assert (pixels == 0).any()
    assert (pixels == 65535).any()


@pytest.mark.parametrize(
    ("name", "options", "covered"),
    [
        ("a.tif", {}, True),
        ("a.tif", {"compression": "none"}, False),
        ("a.png", {}, False),
        ("a.png", {}, True),
    ],
)
def test_readers_find_the_pixels_that_were_rendered(name, options, covered, tmp_path):
    written = write(tmp_path / name, panorama_of(covered=covered), **options)

    picture = expected(3 if covered else 4)
    bgr = cv2.imread(str(tmp_path / name), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(bgr[..., [2, 1, 0, 3][: picture.shape[2]]], picture)
    if name == "a.tif":
        np.testing.assert_array_equal(tifffile.imread(tmp_path / name), picture)
    assert written == writers.Written(16)
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("name", ["a.tif", "a.png"])
def test_threads_do_not_change_a_byte(name, tmp_path):
    for threads in (1, 4):
        write(tmp_path / f"{threads}{name}", panorama_of(), threads=threads, pyramid="full")

    assert (tmp_path / f"1{name}").read_bytes() == (tmp_path / f"4{name}").read_bytes()


def test_smaller_copies_are_means_of_16_bits(tmp_path):
    write(tmp_path / "a.tif", panorama_of(), pyramid="full")

    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        levels = [level.asarray() for level in file.series[0].levels]
    assert [level.dtype for level in levels] == [np.uint16] * 3
    np.testing.assert_array_equal(levels[0], expected(4))
    for large, small in pairwise(levels):
        height, width = (n // 2 for n in large.shape[:2])
        four = large[: 2 * height, : 2 * width].reshape(height, 2, width, 2, -1)
        opaque = (four[..., -1] == 65535).all((1, 3))
        means = four.mean((1, 3))
        assert np.abs(small[:height, :width] - means)[opaque].max() <= 0.5  # of a level: rounding


def test_four_gigabytes_are_counted_in_bytes(tmp_path, monkeypatch):
    monkeypatch.setattr(tiff, "CLASSIC", tiff.SIDE**2 * 3 + 1)

    for depth, magic in (("8", b"II*\0"), ("16", b"II+\0")):
        write(tmp_path / f"{depth}.tif", panorama_of(covered=True, crop=Region(0, 0, 30, 20)), depth=depth)
        assert (tmp_path / f"{depth}.tif").read_bytes()[:4] == magic


@pytest.mark.parametrize(
    ("name", "depths", "asked", "depth", "said"),
    [
        ("a.tif", (8, 8), "auto", 8, False),
        ("a.tif", (8, 16), "auto", 16, False),
        ("a.png", (8, 8), "16", 16, False),
        ("a.png", (16, 16), "8", 8, False),
        ("a.jpg", (16, 8), "auto", 8, True),
        ("a.webp", (16, 8), "auto", 8, True),
        ("a.jpg", (16, 16), "8", 8, False),
        ("a.jpg", (8, 8), "auto", 8, False),
    ],
)
def test_who_gets_16_bits(name, depths, asked, depth, said, tmp_path):
    written = write(tmp_path / name, panorama_of(depths=depths, crop=Region(0, 0, 30, 20)), depth=asked)

    assert written.depth == depth
    assert ("16 bits" in " ".join(written.notes)) == said
    pixels = cv2.imread(str(tmp_path / name), cv2.IMREAD_UNCHANGED)
    assert pixels.dtype == (np.uint16 if depth == 16 else np.uint8)


@pytest.mark.parametrize("name", ["a.jpg", "a.JPEG", "a.webp"])
def test_16_bits_that_a_format_does_not_have(name, tmp_path):
    with pytest.raises(UsageError, match=name) as caught:
        write(tmp_path / name, panorama_of(), depth="16")

    assert ".tif" in caught.value.hint
    assert not any(tmp_path.iterdir())


def test_what_waits_to_be_written_counts_twice():
    panorama = replace(panorama_of(covered=True), cost=lambda _: 1)  # byte, so that only the file counts
    options = OutputOptions(max_memory=str(memory.resident() + (400 << 20)))

    pictures = [Rendering(panorama, Executor(1000), 3, depth) for depth in (8, 16)]
    threads = [arranged(picture, "a.tif", options).run.threads for picture in pictures]

    assert threads[0] // 2 - 1 <= threads[1] <= threads[0] // 2 + 1


def test_the_preview_has_8_bits(tmp_path):
    crop, events = Region(13, 5, 90, 70), []

    writers.write_panorama(
        panorama_of(crop=crop), str(tmp_path / "a.tif"), OutputOptions(), trace=lambda _, **data: events.append(data)
    )

    (data,) = events
    assert data["preview"].dtype == np.uint8
    assert np.abs(data["preview"][50:60, 50:60, 0].astype(float) - computed(crop).pixels[50:60, 50:60, 0]).max() <= 1
