"""TIFF, PNG and JPEG that are written as they are rendered: the same pixels, bounded memory, nothing left behind."""

import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
import simplejpeg
import tifffile
from PIL import Image

from panostitch.errors import LimitError, OutputError, UsageError
from panostitch.io import rendering, tiff, writers
from panostitch.io.limits import arranged
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import OutputOptions
from panostitch.runtime.executor import Executor

# Odd, no multiples of a tile, three rows of tiles; begins off the canvas's corner.
CROP = Region(13, 5, 2307, 1301)


def computed(region):
    """A layer whose pixels say where they are; a disc is not covered."""
    y, x = np.mgrid[region.y : region.bottom, region.x : region.right].astype(np.int32)
    pixels = np.stack([x // 3 % 256, y // 2 % 256, (x + y) % 251], axis=-1).astype(np.float32)
    mask = (x - 700) ** 2 + (y - 600) ** 2 > 300**2
    return Layer(region, np.where(mask[..., None], pixels, np.float32(0)), mask)


def panorama_of(crop=CROP, *, covered=False, read=computed):
    plan = Plan(np.ones(1), 1, np.zeros((1, 1), np.int16), (), crop, "as asked", covered)
    return Panorama(Canvas("cylindrical", 100.0, (0.0, 0.0), (crop.right, crop.bottom)), plan, read)


def row_or_column(regions):
    """Bytes of photos that a row of tiles shows, or a column: a row shows more."""
    return (len({region.x for region in regions[:3]}) > 1) << 40


def write(path, panorama=None, *, threads=2, **options):
    writers.write_panorama(panorama or panorama_of(), str(path), OutputOptions(**options), run=Executor(threads))
    return path


def expected(*, covered):
    pixels, mask = writers.assemble(panorama_of())
    return pixels if covered else np.dstack([pixels, mask])


@pytest.mark.parametrize("covered", [False, True])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.tif", {}),
        ("a.tif", {"compression": "none"}),
        ("a.tiff", {"pyramid": "full"}),
        ("a.tif", {"pyramid": "full", "compression": "none"}),
        ("a.png", {}),
    ],
)
def test_three_readers_find_the_pixels_that_were_rendered(name, options, covered, tmp_path):
    path = write(tmp_path / name, panorama_of(covered=covered), **options)

    picture = expected(covered=covered)
    with Image.open(path) as image:
        np.testing.assert_array_equal(np.asarray(image), picture)
    bgr = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(bgr[..., [2, 1, 0, 3][: picture.shape[2]]], picture)
    if not name.endswith("png"):
        np.testing.assert_array_equal(tifffile.imread(path), picture)
    assert os.listdir(tmp_path) == [name]


@pytest.mark.parametrize("size", [(1, 1), (512, 512), (513, 1), (1024, 512), (1025, 513)])
@pytest.mark.parametrize("name", ["a.tif", "a.png"])
def test_sizes_at_the_edges_of_tiles(name, size, tmp_path):
    crop = Region(3, 4, *size)

    path = write(tmp_path / name, panorama_of(crop, covered=True), pyramid="full")

    with Image.open(path) as image:
        np.testing.assert_array_equal(np.asarray(image), computed(crop).pixels)


@pytest.mark.parametrize("size", [(1, 1), (16, 256), (17, 257), (513, 1), (1025, 513), (40, 2600), (65_500, 257)])
@pytest.mark.parametrize("covered", [False, True])
def test_strips_of_a_jpeg_are_what_an_encoder_makes_of_the_whole(size, covered, tmp_path):
    # 2600 rows: restart markers are counted modulo 8; 65,500 columns: the largest restart interval
    crop = Region(3, 4, *size)
    path, whole = write(tmp_path / "a.jpg", panorama_of(crop, covered=covered)), tmp_path / "whole.jpg"
    Image.fromarray(writers.assemble(panorama_of(crop))[0]).save(whole, quality=OutputOptions().quality)

    with Image.open(path) as ours, Image.open(whole) as theirs:
        assert (ours.mode, ours.size) == ("RGB", size)
        np.testing.assert_array_equal(np.asarray(ours), np.asarray(theirs))
    np.testing.assert_array_equal(cv2.imread(str(path)), cv2.imread(str(whole)))
    np.testing.assert_array_equal(simplejpeg.decode_jpeg(path.read_bytes()), simplejpeg.decode_jpeg(whole.read_bytes()))


@pytest.mark.parametrize(("name", "depth"), [("a.jpg", "8"), ("a.png", "8"), ("a.png", "16")])
def test_the_order_of_the_tiles_does_not_change_a_byte(name, depth, tmp_path):
    rows, columns = (
        write(tmp_path / f"{number}{name}", replace(panorama_of(), shown=shown), depth=depth)
        for number, shown in enumerate((panorama_of().shown, row_or_column))
    )

    assert rows.read_bytes() == columns.read_bytes()


@pytest.mark.parametrize("name", ["a.tif", "a.png", "a.jpg", "a.webp"])
def test_threads_do_not_change_a_byte(name, tmp_path):
    one, four = (write(tmp_path / f"{threads}{name}", threads=threads, pyramid="full") for threads in (1, 4))

    assert one.read_bytes() == four.read_bytes()


def test_a_pyramid_halves_down_to_a_tile(tmp_path):
    path = write(tmp_path / "a.tif", panorama_of(covered=True), pyramid="full")

    with tifffile.TiffFile(path) as file:
        levels = [level.asarray() for level in file.series[0].levels]
        assert file.pages[0].tile == (tiff.SIDE, tiff.SIDE)
        assert len(file.pages) == 1
    assert [level.shape[:2] for level in levels] == [(1301, 2307), (651, 1154), (326, 577), (163, 289)]
    for large, small in pairwise(levels):
        height, width = (n // 2 for n in large.shape[:2])
        means = large[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3).mean((1, 3))
        assert np.abs(small[:height, :width] - means).max() <= 0.5  # of a level: rounding


def test_what_is_transparent_does_not_darken_the_smaller_copies(tmp_path):
    def grey(region):
        layer = computed(region)
        return replace(layer, pixels=np.where(layer.mask[..., None], np.full(3, 200, np.float32), np.float32(0)))

    path = write(tmp_path / "a.tif", panorama_of(read=grey), pyramid="full")

    with tifffile.TiffFile(path) as file:
        for level in (level.asarray() for level in file.series[0].levels):
            np.testing.assert_array_equal(level[..., :3][level[..., 3] > 0], 200)
            assert (level[..., 3] == 0).any()


def test_above_four_gigabytes_it_is_a_bigtiff(tmp_path, monkeypatch):
    small = write(tmp_path / "small.tif")
    monkeypatch.setattr(tiff, "CLASSIC", 2307 * 1301)

    big = write(tmp_path / "big.tif")

    assert small.read_bytes()[:4] == b"II*\0"
    assert big.read_bytes()[:4] == b"II+\0"
    np.testing.assert_array_equal(tifffile.imread(big), tifffile.imread(small))


@pytest.mark.slow
def test_offsets_beyond_four_gigabytes(tmp_path):
    def plain(region):
        value = np.float32((region.x // 1024 + region.y // 512) % 251)
        shape = (region.height, region.width)
        return Layer(region, np.full((*shape, 3), value, np.float32), np.ones(shape, bool))

    crop = Region(0, 0, 38 * 1024, 38 * 1024)
    path = write(tmp_path / "a.tif", panorama_of(crop, covered=True, read=plain), compression="none")

    assert path.stat().st_size > 2**32
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        last, offset, size = len(page.dataoffsets) - 1, page.dataoffsets[-1], page.databytecounts[-1]
        file.filehandle.seek(offset)
        assert offset > 2**32
        assert (page.decode(file.filehandle.read(size), last)[0] == (37 + 75) % 251).all()


@pytest.mark.parametrize(("name", "limit"), [("a.jpg", "65500"), ("a.webp", "16383")])
def test_what_no_file_of_the_format_can_hold_is_refused(name, limit, tmp_path):
    with pytest.raises(LimitError, match=limit) as caught:
        write(tmp_path / name, panorama_of(Region(0, 0, int(limit) + 1, 10)))

    assert ".tif" in caught.value.hint
    assert not any(tmp_path.iterdir())


def test_webp_has_alpha(tmp_path):
    with Image.open(write(tmp_path / "a.webp")) as image:
        assert (image.format, image.mode, image.size) == ("WEBP", "RGBA", (CROP.width, CROP.height))
        np.testing.assert_array_equal(np.asarray(image)[..., 3], expected(covered=False)[..., 3])


@pytest.mark.parametrize("name", ["a.tif", "a.png", "a.jpg"])
def test_a_full_disk_is_said_and_leaves_nothing(name, tmp_path):
    # a limit on the size of files fails like a full disk: in the middle, and at any of the writes
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(OutputError, match=name):
            write(tmp_path / name, pyramid="full", quality=100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)

    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.tif", "a.png", "a.jpg"])
def test_an_interruption_in_the_middle_leaves_the_old_file(name, tmp_path):
    (tmp_path / name).write_bytes(b"old")

    def interrupted(region):
        if region.y > 1000:
            raise KeyboardInterrupt
        return computed(region)

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / name, panorama_of(read=interrupted))

    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [(name, b"old")]


SLOWLY = """
import os, sys, time
sys.path[:0] = [{tests!r}]
from test_streams import Region, computed, panorama_of, write
def slowly(region):
    os.write(1, b"tile" + os.linesep.encode())  # at once: print writes a line and its end apart, and threads mix them
    time.sleep(0.05)
    return computed(region)
write({path!r}, panorama_of(Region(0, 0, 2000, 40_000), read=slowly), pyramid="full")
"""


@pytest.mark.skipif(not hasattr(os, "O_TMPFILE"), reason="files without a name are Linux's")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_run_leaves_nothing_behind(how, tmp_path):
    program = SLOWLY.format(tests=os.path.dirname(__file__), path=str(tmp_path / "a.tif"))
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        for _ in range(12):
            assert process.stdout.readline() == "tile\n"
        process.send_signal(how)
        assert process.wait(30) == -how

    assert not any(tmp_path.iterdir())


MEASURED = """
import sys
sys.path[:0] = [{tests!r}]
from test_streams import Region, panorama_of, write
crop = Region(0, 0, {side}, {side})
write({path!r}, panorama_of(crop), threads=4, **{options!r})
"""


def peak(path, side, **options):
    """Bytes that a process held at most while it wrote a picture of `side` px squared."""
    program = MEASURED.format(tests=os.path.dirname(__file__), path=str(path), side=side, options=options)
    watched = (
        "import resource, subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]], check=True);"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024)"
    )
    done = subprocess.run([sys.executable, "-c", watched, program], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.parametrize("name", ["a.tif", "a.jpg"])
def test_memory_does_not_grow_with_the_picture(name, tmp_path):
    # The larger picture has 231 MB of pixels more than the smaller one.
    small, large = (peak(tmp_path / f"{side}{name}", side, compression="none") for side in (3072, 8192))

    # Bytes. When threads meet at their peaks, and what the allocator keeps back, differ by up to 40 MB from run to run.
    assert large - small < 64 << 20


@pytest.mark.parametrize("name", ["a.tif", "a.png", "a.jpg"])
def test_the_limit_of_memory_is_kept(name, tmp_path):
    limit = 480 << 20

    assert peak(tmp_path / name, 4096, max_memory="480M", pyramid="full") <= limit


@pytest.mark.parametrize(("name", "limit"), [("a.tif", "1M"), ("a.png", "1M"), ("a.jpg", "1M"), ("a.webp", "2G")])
def test_too_little_memory_is_said_before_a_tile_is_made(name, limit, tmp_path):
    def never(region):
        raise AssertionError(f"{region} was rendered")

    with pytest.raises(LimitError, match="--max-memory") as caught:
        write(
            tmp_path / name,
            panorama_of(Region(0, 0, 16_000, 16_000), read=never),
            max_memory=limit,
        )

    assert caught.value.exit_code == 7
    assert ("a .tif" in caught.value.hint) == (name != "a.tif")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "limit", "by_columns"),
    [
        ("a.jpg", None, True),
        ("a.jpg", "4G", True),
        ("a.jpg", "900M", False),
        ("a.png", None, True),
        ("a.tif", None, False),
    ],
)
def test_the_whole_picture_is_made_first_where_photos_take_more_and_it_fits(name, limit, by_columns):
    # 1.2 GB, of photos that take a terabyte where they are kept for a row of tiles, of which few are kept
    panorama = replace(panorama_of(Region(0, 0, 20_001, 20_000), covered=True), shown=row_or_column, budget=1 << 20)
    picture = rendering.Rendering(panorama, Executor(), 3)

    assert arranged(picture, name, OutputOptions(max_memory=limit)).by_columns == by_columns


def test_the_pixels_do_not_depend_on_the_limit_of_memory(tmp_path):
    free, bound = write(tmp_path / "a.tif"), write(tmp_path / "b.tif", threads=4, max_memory="1G")

    assert free.read_bytes() == bound.read_bytes()


def test_the_rows_of_a_png_are_compressed_in_slices_that_end_anywhere(tmp_path, monkeypatch):
    whole = write(tmp_path / "a.png")
    monkeypatch.setattr(rendering, "STRIP", 7)

    other = write(tmp_path / "b.png")

    assert whole.read_bytes() != other.read_bytes()
    with Image.open(whole) as first, Image.open(other) as second:
        np.testing.assert_array_equal(np.asarray(first), np.asarray(second))


def test_the_first_row_of_tiles_goes_on_in_the_second_one(tmp_path):
    # stripes are best told from the row above, and look best told from black where that row were taken for it
    def stripes(region):
        columns = np.arange(region.x, region.right) % 2 * np.float32(100)
        pixels = np.broadcast_to(columns[:, None], (region.height, region.width, 3))
        return Layer(region, pixels, np.ones(pixels.shape[:2], bool))

    crop = Region(0, 0, 100, 1100)
    path = write(tmp_path / "a.png", panorama_of(crop, covered=True, read=stripes))

    with Image.open(path) as image:
        np.testing.assert_array_equal(np.asarray(image), stripes(crop).pixels)


def test_a_large_picture_comes_in_seconds(tmp_path):
    began = time.perf_counter()
    crop = Region(0, 0, 9000, 3000)

    path = write(tmp_path / "a.tif", panorama_of(crop), compression="none")

    assert time.perf_counter() - began < 60  # s, on a machine that is busy with other things
    with tifffile.TiffFile(path) as file:
        assert file.pages[0].shape == (3000, 9000, 4)


@pytest.mark.parametrize(
    ("text", "size"), [("500M", 500 << 20), ("1.5G", 3 << 29), ("2 GiB", 2 << 30), ("64kb", 1 << 16), ("12345", 12345)]
)
def test_amounts_of_memory(text, size):
    assert OutputOptions(max_memory=text).memory == size


@pytest.mark.parametrize("text", ["", "much", "-1G", "1e9", "G", "nan"])
def test_what_is_no_amount_of_memory(text):
    with pytest.raises(UsageError, match="amount"):
        _ = OutputOptions(max_memory=text).memory


@pytest.mark.parametrize("name", ["a.tif", "a.png", "a.jpg", "a.webp"])
def test_a_photo_is_dropped_after_the_last_tile_that_shows_it(tmp_path, name):
    """Photos 0, 1 and 2 lie side by side, 700 px apart, and 9 shows in the first and the last column of tiles."""
    told: list[tuple[str, int, Region | None]] = []

    def shown(region):
        own = {n for n in range(3) if region.x < CROP.x + 700 * (n + 1) and region.right > CROP.x + 700 * n}
        return frozenset(own | ({9} if region.x == CROP.x or region.right == CROP.right else set()))

    def read(region):
        told.extend(("read", photo, region) for photo in shown(region))
        return computed(region)

    panorama = replace(
        panorama_of(read=read),
        photos=shown,
        forget=lambda photo: told.append(("forget", photo, None)),
        shown=row_or_column,
    )
    write(tmp_path / name, panorama, threads=1)

    forgotten = [photo for what, photo, _ in told if what == "forget"]
    assert {0, 1} <= set(forgotten)  # who takes the last tile may ask for nothing more
    for photo in forgotten:
        rest = told[told.index(("forget", photo, None)) :]
        assert not [entry for entry in rest if entry[:2] == ("read", photo)]
    if name != "a.tif":  # column by column
        assert told.index(("forget", 0, None)) < min(n for n, entry in enumerate(told) if entry[:2] == ("read", 2))
