"""Photos of every kind come out upright, RGB and 8 bits; those that are broken are named."""

import io
import re
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageFile, PngImagePlugin, TiffImagePlugin

from panostitch.errors import InputError
from panostitch.io.readers import open_photo, open_photos
from panostitch.model.photo import natural_key
from tolerances import JPEG_MEAN

# Grey levels, mean and largest difference of a reduced reading from the full one, averaged over areas.
# The JPEG decoder averages in its own transform, whose weights are not quite a box's: 1.03 and 13 seen, on a picture
# that is rich at every scale. Half a pixel of displacement would make 8 and 100.
REDUCED_MEAN, REDUCED_MOST = 2.0, 25.0

# Grey levels, largest difference between brightness decoded by itself and that of decoded colours: rounding of three
# channels, and of weights in whole numbers; 2 seen.
BRIGHTNESS_MOST = 3

JPEG = {"quality": 95, "subsampling": 0}

DECODES = "Pillow's getexif decodes a whole PNG that has no EXIF before its pixels"
NO_INT = "isdigit() is true of a superscript, but int() refuses it"


@pytest.fixture
def picture():
    """A smooth picture (48, 64, 3) without symmetry."""
    y, x = np.mgrid[:48, :64]
    return np.stack([x * 3 + 20, y * 4 + 10, 200 - x - y], axis=-1).astype(np.uint8)


def read(path, scale=1.0):
    photo = open_photo(path)
    pixels, mask = photo.source.read(scale)
    assert pixels.dtype == np.uint8
    assert pixels.shape[2:] == (3,)
    if scale == 1:
        assert pixels.shape[1::-1] == photo.size
    if mask is not None:
        assert mask.dtype == np.uint8
        assert mask.shape == pixels.shape[:2]
    return pixels, mask


LOSSLESS = ["a.png", "a.tif", "a.bmp", "a.ppm", "a.webp", "a.jp2"]


@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_formats_come_back_as_they_were(name, picture, save):
    options = {"a.webp": {"lossless": True}}.get(name, {})

    pixels, mask = read(save(name, picture, **options))

    np.testing.assert_array_equal(pixels, picture)
    assert mask is None


@pytest.mark.parametrize("name", ["a.jpg", "A.JPEG", "progressive.jpg", "no extension"])
def test_jpeg(name, picture, save):
    path = save(name, picture, format="JPEG", progressive="progressive" in name, **JPEG)

    pixels, mask = read(path)

    assert np.abs(pixels.astype(float) - picture).mean() < JPEG_MEAN
    assert mask is None


def test_a_file_is_what_it_is_not_what_it_is_called(picture, save):
    np.testing.assert_array_equal(read(save("a.jpg", picture, format="PNG"))[0], picture)


def grey_of(picture):
    return picture[..., 0]


def alpha_of(picture):
    alpha = np.full(picture.shape[:2], 255, np.uint8)
    alpha[:10] = 0
    return alpha


def cmyk_of(picture):
    return np.dstack([255 - picture, np.zeros(picture.shape[:2], np.uint8)])


# Pillow's mode: the file and what Pillow writes into it, from a picture
WRITTEN = {
    "L png": ("a.png", lambda p: Image.fromarray(grey_of(p))),
    "L jpg": ("a.jpg", lambda p: Image.fromarray(grey_of(p))),
    "LA png": ("a.png", lambda p: Image.merge("LA", [Image.fromarray(grey_of(p)), Image.fromarray(alpha_of(p))])),
    "RGBA png": ("a.png", lambda p: Image.fromarray(np.dstack([p, alpha_of(p)]))),
    "RGBA tif": ("a.tif", lambda p: Image.fromarray(np.dstack([p, alpha_of(p)]))),
    "RGBA webp": ("a.webp", lambda p: Image.fromarray(np.dstack([p, alpha_of(p)]))),
    "P png": ("a.png", lambda p: Image.fromarray(p).quantize(8)),
    "1 png": ("a.png", lambda p: Image.fromarray(grey_of(p)).point(lambda v: 255 * (v > 100), mode="1")),
    "1 tif": ("a.tif", lambda p: Image.fromarray(grey_of(p)).point(lambda v: 255 * (v > 100), mode="1")),
    "CMYK jpg": ("a.jpg", lambda p: Image.fromarray(cmyk_of(p), mode="CMYK")),
    "CMYK tif": ("a.tif", lambda p: Image.fromarray(cmyk_of(p), mode="CMYK")),
    "I;16 png": ("a.png", lambda p: Image.fromarray(grey_of(p).astype(np.uint16) * 257)),
    "I;16 tif": ("a.tif", lambda p: Image.fromarray(grey_of(p).astype(np.uint16) * 257)),
}


@pytest.mark.filterwarnings("ignore:'mode' parameter is deprecated:DeprecationWarning")
@pytest.mark.parametrize("kind", WRITTEN)
def test_every_kind_of_pixel(kind, picture, tmp_path):
    name, make = WRITTEN[kind]
    image = make(picture)
    image.save(tmp_path / name, **({"lossless": True} if name.endswith("webp") else {}))

    pixels, mask = read(tmp_path / name)

    grey = np.repeat(grey_of(picture)[..., None], 3, axis=2)
    expected = {
        "L": grey,
        "LA": grey,
        "RGBA": picture,
        "P": np.asarray(image.convert("RGB")),
        "1": np.where(grey > 100, 255, 0),
        "CMYK": picture,
        "I;16": grey,
    }[kind.split()[0]]
    allowed = JPEG_MEAN if name.endswith("jpg") else 0
    shown = slice(10, None)  # WebP may forget what is under transparency
    assert np.abs(pixels[shown].astype(float) - expected[shown]).mean() <= allowed
    if "A" in kind.split()[0]:
        np.testing.assert_array_equal(mask, alpha_of(picture))
    else:
        assert mask is None


def test_transparent_colour_of_a_palette_is_a_mask(picture, tmp_path):
    image = Image.fromarray(picture).quantize(8)
    image.save(tmp_path / "a.png", transparency=3)

    _, mask = read(tmp_path / "a.png")

    np.testing.assert_array_equal(mask == 0, np.asarray(image) == 3)


def test_sixteen_bits_of_colour(picture, tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), picture[..., ::-1].astype(np.uint16) * 257)

    np.testing.assert_array_equal(read(tmp_path / "a.png")[0], picture)


def test_floating_point_pixels_are_refused(tmp_path):
    Image.fromarray(np.ones((20, 30), np.float32)).save(tmp_path / "a.tif")

    with pytest.raises(InputError, match=r"a\.tif.*floating"):
        open_photo(tmp_path / "a.tif")


SIZES = [(400, 300), (399, 301), (403, 297), (9, 5), (1, 1)]
SCALES = [0.7, 0.5, 0.25, 0.124, 0.1, 0.01]


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["a.jpg", "a.png", "grey.jpg"])
def test_reduced_reading_agrees_with_the_full_one(name, size, scale, views, save):
    pixels = np.resize(cv2.GaussianBlur(views[0], (0, 0), 1), (size[1], size[0], 3))
    if size[0] > 1:
        pixels = cv2.resize(views[0], size, interpolation=cv2.INTER_AREA)
    stored = pixels[..., 0] if "grey" in name else pixels
    path = save(name, stored, **(JPEG if "jpg" in name else {}))
    full, _ = read(path)

    reduced, _ = read(path, scale)

    promised = max(1, round(size[0] * scale)), max(1, round(size[1] * scale))
    assert reduced.shape[1::-1] == promised
    expected = cv2.resize(full, promised, interpolation=cv2.INTER_AREA)
    difference = np.abs(reduced.astype(float) - expected)
    assert difference.mean() <= REDUCED_MEAN
    assert difference.max() <= REDUCED_MOST


@pytest.mark.filterwarnings("ignore:'mode' parameter is deprecated:DeprecationWarning")
@pytest.mark.parametrize("scale", [1.0, 0.5, 0.3])
@pytest.mark.parametrize("kind", ["RGB jpg, sideways", "RGB tif of 16 bits", *WRITTEN])
def test_grey_reading_is_the_brightness_of_the_colours(kind, scale, picture, tmp_path):
    if "sideways" in kind:
        path, exif = tmp_path / "a.jpg", Image.Exif()
        exif[0x0112] = 6
        Image.fromarray(picture).save(path, exif=exif, **JPEG)
    elif "16 bits" in kind:
        path = tmp_path / "a.tif"
        cv2.imwrite(str(path), picture[..., ::-1].astype(np.uint16) * 257)
    else:
        path = tmp_path / WRITTEN[kind][0]
        WRITTEN[kind][1](picture).save(path)
    photo = open_photo(path)

    grey, mask = photo.read_grey(scale)

    pixels, expected_mask = photo.source.read(scale)
    expected = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY).astype(float)
    np.testing.assert_array_equal(mask, expected_mask)
    assert grey.dtype == np.uint8
    assert np.abs(grey - expected).max() <= BRIGHTNESS_MOST


def test_the_mask_is_reduced_with_the_pixels(picture, save):
    path = save("a.png", np.dstack([picture, alpha_of(picture)]))

    pixels, mask = read(path, 0.5)

    assert mask.shape == pixels.shape[:2] == (24, 32)
    np.testing.assert_array_equal(mask > 0, np.arange(24)[:, None] >= np.full(32, 5))


TRUNCATED = {
    "a.jpg": JPEG,
    "progressive.jpg": {**JPEG, "progressive": True},
    "a.png": {},
    "a.tif": {},
    "packed.tif": {"compression": "tiff_lzw"},
    "a.webp": {},
    "a.bmp": {},
    "a.ppm": {},
    "a.jp2": {},
}


@pytest.mark.filterwarnings("ignore:.*:UserWarning:PIL")  # see test_a_broken_header_is_no_reason_to_warn
@pytest.mark.parametrize("share", [0.02, 0.4, 0.7, 0.95])
@pytest.mark.parametrize("name", TRUNCATED)
def test_half_a_picture_is_refused_by_name(name, share, views, save):
    path = save(name, views[0], **TRUNCATED[name])
    data = Path(path).read_bytes()
    Path(path).write_bytes(data[: int(len(data) * share)])

    for scale in (1.0, 0.25):
        with pytest.raises(InputError) as caught:
            read(path, scale)
        assert path in caught.value.message
        assert "\n" not in caught.value.message
        with pytest.raises(InputError, match=re.escape(path)):
            open_photo(path).read_grey(scale)


@pytest.mark.parametrize("scale", [1.0, 0.125])
def test_a_photo_that_vanishes_is_refused_by_name(scale, views, save):
    path = save("a.jpg", views[0])
    photo = open_photo(path)
    Path(path).unlink()

    with pytest.raises(InputError, match=r"a\.jpg"):
        photo.source.read(scale)


def test_what_is_no_picture_is_refused_by_name(tmp_path):
    (tmp_path / "empty.jpg").touch()
    (tmp_path / "letter.jpg").write_text("Dear reader,\n" * 100)
    (tmp_path / "film.gif").write_bytes(b"GIF89a" + bytes(100))
    (tmp_path / "folder.jpg").mkdir()
    script = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n"
    (tmp_path / "script.jpg").write_bytes(script)

    for name in ("empty.jpg", "letter.jpg", "film.gif", "folder.jpg", "script.jpg", "missing.jpg"):
        with pytest.raises(InputError) as caught:
            open_photo(tmp_path / name)
        assert name in caught.value.message
        assert "\n" not in caught.value.message


def png_claiming(width, height):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = [chunk(b"IHDR", header), chunk(b"IDAT", zlib.compress(bytes(1000))), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.fixture
def _no_decoding(monkeypatch):
    """Whoever wants pixels from Pillow fails."""

    def load(self):
        raise AssertionError(f"{self.format} was decoded")

    for plugin in (ImageFile.ImageFile, PngImagePlugin.PngImageFile, TiffImagePlugin.TiffImageFile):
        monkeypatch.setattr(plugin, "load", load)


@pytest.mark.usefixtures("_no_decoding")
def test_a_header_that_claims_too_much_is_refused_before_memory_is_taken(tmp_path):
    (tmp_path / "huge.png").write_bytes(png_claiming(100_000, 100_000))

    with pytest.raises(InputError, match=r"huge\.png.*10000 megapixels"):
        open_photo(tmp_path / "huge.png")


@pytest.mark.parametrize("name", [*LOSSLESS, "a.jpg"])
def test_opening_reads_the_header_alone(name, picture, save, request):
    path = save(name, picture)
    request.getfixturevalue("_no_decoding")

    assert open_photo(path).size == (64, 48)


def test_a_header_that_claims_more_than_there_is(tmp_path):
    (tmp_path / "liar.png").write_bytes(png_claiming(300, 200))

    with pytest.raises(InputError, match=r"liar\.png"):
        read(tmp_path / "liar.png")


def test_a_jpeg_2000_header_that_claims_too_much(picture):
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG2000")
    data = bytearray(buffer.getvalue())
    at = data.index(b"jp2h") - 4
    data[at : at + 4] = struct.pack(">I", 1)  # the box says: my length, eight bytes, follows
    data[at + 8 : at + 16] = struct.pack(">Q", 2**62)
    path = Path("huge_box.jp2")
    path.write_bytes(data)

    with pytest.raises(InputError, match="huge_box"):
        open_photo(path)


@pytest.fixture(autouse=True)
def _in_tmp_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_photos_come_in_the_natural_order_of_their_names(picture, save):
    for name in ("photo_10.png", "photo_9.png", "Photo_1.png", "photo_010.png", "a/photo_2.png"):
        save(name, picture)
    names = ["photo_10.png", "photo_9.png", "a/photo_2.png", "photo_010.png", "Photo_1.png"]

    photos, failures = open_photos(names)

    assert not failures
    assert [p.path for p in photos] == ["a/photo_2.png", "Photo_1.png", "photo_9.png", "photo_010.png", "photo_10.png"]
    assert open_photos(names[::-1]) == (photos, [])


@pytest.mark.parametrize(
    "name",
    ["1²2.jpg", "①.jpg", "٣.jpg", "²", "-1.5e3", "a\u0300.png", "😀7.jpg"],
)
def test_every_name_has_its_place(name):
    others = ["1.jpg", "a.jpg", "10", "a10b2"]

    assert sorted([name, *others], key=natural_key) == sorted([*others, name], key=natural_key)


def test_a_name_comes_before_its_continuation():
    assert sorted(["photo1", "photo", "photo1a"], key=natural_key) == ["photo", "photo1", "photo1a"]


def test_photos_of_one_name_are_called_by_their_paths(picture, save):
    for name in ("left/a.png", "right/a.png", "b.png"):
        save(name, picture)

    photos, _ = open_photos(["left/a.png", "right/a.png", "b.png"])

    assert [photo.name for photo in photos] == ["b.png", "left/a.png", "right/a.png"]


def test_the_same_file_twice_is_one_photo(picture, save, tmp_path):
    save("a.png", picture)
    (tmp_path / "link.png").symlink_to("a.png")
    (tmp_path / "folder").mkdir()

    photos, failures = open_photos(["a.png", "./a.png", "folder/../a.png", tmp_path / "a.png", "link.png"])

    assert [photo.name for photo in photos] == ["a.png"]
    assert not failures


def test_what_cannot_be_opened_is_told_beside_what_can(picture, save, tmp_path):
    save("good.png", picture)
    (tmp_path / "bad.png").write_text("no")
    (tmp_path / "loop.png").symlink_to("loop.png")

    photos, failures = open_photos(["bad.png", "good.png", "none.png", "loop.png"])

    assert [photo.name for photo in photos] == ["good.png"]
    assert [f.message.split(":")[0] for f in failures] == ["bad.png", "none.png", "loop.png"]
