"""PNG and TIFF of 16 bits come back bit for bit, upright; what cannot be read is said."""

import io
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image

from panostitch.errors import InputError
from panostitch.io import pto
from panostitch.io.readers import open_photo

SIZE = (40, 30)
ORIENTATIONS = range(1, 9)
# What an upright picture (h, w, ...) looks like in the file, for each EXIF orientation.
STORED = {
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.swapaxes(0, 1),
    6: lambda a: a.swapaxes(0, 1)[::-1],
    7: lambda a: a[::-1, ::-1].swapaxes(0, 1),
    8: lambda a: a.swapaxes(0, 1)[:, ::-1],
}


@pytest.fixture
def picture(rng):
    """All bits (30, 40, 4) in use, with alpha."""
    return rng.integers(0, 65536, (*SIZE[::-1], 4)).astype(np.uint16)


def tiff_of(pixels, photometric="rgb", **options):
    file = io.BytesIO()
    tifffile.imwrite(file, np.ascontiguousarray(pixels), photometric=photometric, **options)
    return file.getvalue()


def png_of(pixels, colour_type, *chunks):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width = pixels.shape[:2]
    header = struct.pack(">IIBBBBB", width, height, 16, colour_type, 0, 0, 0)
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    parts = [(b"IHDR", header), *chunks, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


def grey_of(p):
    return np.repeat(p[..., :1], 3, axis=2)


# The file's bytes, what should be read of the picture, and whether its last channel is alpha.
KINDS = {
    "RGB png": (lambda p: png_of(p[..., :3], 2), lambda p: p[..., :3], False),
    "RGBA png": (lambda p: png_of(p, 6), lambda p: p[..., :3], True),
    "grey png": (lambda p: png_of(p[..., 0], 0), grey_of, False),
    "grey and alpha png": (lambda p: png_of(p[..., [0, 3]], 4), grey_of, True),
    "RGB tif": (lambda p: tiff_of(p[..., :3]), lambda p: p[..., :3], False),
    "big-endian tif": (lambda p: tiff_of(p[..., :3], byteorder=">"), lambda p: p[..., :3], False),
    "BigTIFF": (lambda p: tiff_of(p[..., :3], bigtiff=True), lambda p: p[..., :3], False),
    "deflated tif": (lambda p: tiff_of(p[..., :3], compression="zlib", predictor=True), lambda p: p[..., :3], False),
    "LZW tif": (lambda p: cv2.imencode(".tif", p[..., 2::-1])[1].tobytes(), lambda p: p[..., :3], False),
    "tiled tif": (lambda p: tiff_of(p[..., :3], tile=(16, 16)), lambda p: p[..., :3], False),
    "RGBA tif": (lambda p: tiff_of(p, extrasamples=["unassalpha"]), lambda p: p[..., :3], True),
    "RGB and something tif": (lambda p: tiff_of(p, extrasamples=["unspecified"]), lambda p: p[..., :3], False),
    "grey tif": (lambda p: tiff_of(p[..., 0], "minisblack"), grey_of, False),
    "white is zero tif": (lambda p: tiff_of(p[..., 0], "miniswhite"), lambda p: 65535 - grey_of(p), False),
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_comes_back_bit_for_bit(kind, picture, tmp_path):
    make, shown, alpha = KINDS[kind]
    (tmp_path / "photo").write_bytes(make(picture))

    photo = open_photo(tmp_path / "photo")
    pixels, mask = photo.deep.read()
    bytes_of, same_mask = photo.source.read()

    assert (photo.depth, photo.size) == (16, SIZE)
    np.testing.assert_array_equal(pixels, shown(picture))
    np.testing.assert_array_equal(bytes_of, np.rint(pixels / 257))
    if alpha:
        np.testing.assert_array_equal(mask == 255, picture[..., 3] >= 0xFF00)
        np.testing.assert_array_equal(same_mask, mask)
    else:
        assert mask is same_mask is None


@pytest.mark.parametrize("orientation", ORIENTATIONS)
@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_every_orientation(name, orientation, picture, tmp_path):
    upright = picture[..., :3].swapaxes(0, 1)  # a portrait: an upright sensor's tag would be stale
    stored = STORED[orientation](upright)
    tag = struct.pack("<HHIHH", 0x112, 3, 1, orientation, 0)
    exif = b"II*\0" + struct.pack("<IH", 8, 1) + tag + bytes(4)
    data = (
        png_of(stored, 2, (b"eXIf", exif))
        if name == "a.png"
        else tiff_of(stored, extratags=[(0x112, "H", 1, orientation, False)])
    )
    (tmp_path / name).write_bytes(data)

    photo = open_photo(tmp_path / name)

    assert photo.size == upright.shape[1::-1]
    np.testing.assert_array_equal(photo.deep.read()[0], upright)
    np.testing.assert_array_equal(photo.source.read()[0], np.rint(upright / 257))
    if orientation in (6, 8):
        assert pto.frame.frame_of(photo).size == stored.shape[1::-1]


def test_reduced_reading_is_the_mean(picture, tmp_path):
    (tmp_path / "a.png").write_bytes(png_of(picture, 6))

    pixels, mask = open_photo(tmp_path / "a.png").deep.read(0.5)

    means = picture[..., :3].reshape(15, 2, 20, 2, 3).mean((1, 3))
    assert np.abs(pixels - means).max() <= 1
    assert mask.shape == (15, 20)


def test_photos_of_8_bits_have_no_more(picture, save):
    for name in ("a.png", "a.tif", "a.jpg"):
        photo = open_photo(save(name, np.asarray(picture[..., :3] >> 8, np.uint8)))
        assert (photo.depth, photo.deep) == (8, None)


@pytest.mark.parametrize("share", [0.02, 0.4, 0.7, 0.98])
@pytest.mark.parametrize("kind", ["RGB png", "RGB tif", "deflated tif", "LZW tif", "tiled tif"])
def test_half_a_picture_is_refused_by_name(kind, share, picture, tmp_path):
    data = KINDS[kind][0](np.tile(picture, (4, 4, 1)))
    (tmp_path / "half").write_bytes(data[: int(len(data) * share)])

    with pytest.raises(InputError, match="half") as caught:
        open_photo(tmp_path / "half").deep.read()

    assert "\n" not in caught.value.message


def test_a_photo_that_vanishes_is_refused_by_name(picture, tmp_path):
    (tmp_path / "a.png").write_bytes(png_of(picture, 6))
    photo = open_photo(tmp_path / "a.png")
    Path(photo.path).unlink()

    with pytest.raises(InputError, match=r"a\.png"):
        photo.deep.read()


UNREADABLE = {
    "floating point": lambda p: tiff_of(p[..., 0].astype(np.float32), "minisblack"),
    "3 x float32, rgb": lambda p: tiff_of(p[..., :3].astype(np.float32)),
    "signed": lambda p: tiff_of((p[..., 0] >> 1).astype(np.int16), "minisblack"),
    "32 bits": lambda p: tiff_of(p[..., 0].astype(np.uint32), "minisblack"),
    "planes": lambda p: tiff_of(p[..., :3].transpose(2, 0, 1), planarconfig="separate"),
    "2 x uint16, minisblack": lambda p: tiff_of(p[..., [0, 3]], "minisblack", extrasamples=["unassalpha"]),
    "cielab": lambda p: tiff_of(p[..., :3], "cielab"),
}


@pytest.mark.parametrize("kind", UNREADABLE)
def test_what_cannot_be_read_is_said_before_anything_is_done(kind, picture, tmp_path):
    (tmp_path / "photo.tif").write_bytes(UNREADABLE[kind](picture))

    with pytest.raises(InputError, match=rf"photo\.tif.*{kind}") as caught:
        open_photo(tmp_path / "photo.tif")

    assert "\n" not in caught.value.message
    assert "16 bits" in caught.value.hint


@pytest.mark.parametrize("depth", [8, 16])
def test_cmyk_is_read_with_8_bits(depth, picture, tmp_path):
    picture[..., 3] = 0
    stored = picture if depth == 16 else np.asarray(picture >> 8, np.uint8)
    (tmp_path / "a.tif").write_bytes(tiff_of(stored, "separated"))

    photo = open_photo(tmp_path / "a.tif")

    assert photo.depth == 8
    np.testing.assert_array_equal(photo.source.read()[0], 255 - (picture[..., :3] >> 8))


def test_an_8_bit_picture_is_none_of_16(picture, tmp_path):
    # a header that is changed after the photo was opened
    path = tmp_path / "a.png"
    path.write_bytes(png_of(picture, 6))
    photo = open_photo(path)
    Image.fromarray(np.asarray(picture[..., :3] >> 8, np.uint8)).save(path)

    with pytest.raises(InputError, match=r"a\.png"):
        photo.deep.read()
