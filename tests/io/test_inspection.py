"""What is told of a picture is what was put into it; damage is an error; a piece at a time is the same as the whole."""

import os
import struct
import zlib

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

from panostitch.errors import InputError
from panostitch.io import inspection, sphere, writers
from panostitch.io.inspection import border, pieces, png_strips, tiff_pages
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import unchanged
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import OutputOptions

SIZE = (700, 560)  # px; more than a tile of a TIFF
LEFT, TOP, RIGHT, BOTTOM = 31, 16, 9, 40  # px that are empty
HOLE = (slice(200, 220), slice(300, 330))  # rows and columns that are empty, away from the sides
JPEG_STEP = 2  # px by which compression may blur the edge of black


def grey_world(dtype=np.uint8):
    """Pixels (h, w, 3) that are black where nothing is, and nowhere else."""
    white = np.iinfo(dtype).max
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    pixels = (
        np.stack([white // 4 + x * 50, white // 3 + y * 70, white // 2 + (x + y) * 30], axis=-1) % (white // 2)
        + white // 4
    )
    pixels[:TOP], pixels[-BOTTOM:], pixels[:, :LEFT], pixels[:, -RIGHT:] = 0, 0, 0, 0
    pixels[HOLE] = 0
    return pixels.astype(dtype)


def with_alpha(pixels):
    alpha = np.where(pixels.any(-1), np.iinfo(pixels.dtype).max, 0).astype(pixels.dtype)
    return np.dstack([np.maximum(pixels, 1), alpha])


FRAME = 1 - (SIZE[0] - LEFT - RIGHT) * (SIZE[1] - TOP - BOTTOM) / (SIZE[0] * SIZE[1])  # share of the picture
HOLE_SHARE = 20 * 30 / (SIZE[0] * SIZE[1])


def sides(found):
    return found.left, found.top, found.right, found.bottom


def save_png16(path, pixels):
    import cv2

    cv2.imwrite(str(path), pixels[..., [2, 1, 0, 3][: pixels.shape[2]]])


def written(name, path):
    """A picture with a black frame and a hole, or with transparent ones, in many formats."""
    pixels = grey_world(np.uint16 if "16" in name else np.uint8)
    pixels = with_alpha(pixels) if "alpha" in name else pixels
    if name.startswith("png16"):
        save_png16(path, pixels)
    elif name.startswith("tif"):
        options = {"photometric": "rgb", "extrasamples": ["unassalpha"] if "alpha" in name else None}
        options |= {"tile": (128, 128)} if "tiles" in name else {"rowsperstrip": 50}
        options |= {"compression": "adobe_deflate", "predictor": 2} if "deflate" in name else {}
        tifffile.imwrite(path, pixels, bigtiff="big" in name, **options)
    elif name == "lzw.tif":
        Image.fromarray(pixels).save(path, compression="tiff_lzw")
    else:
        Image.fromarray(pixels).save(path, lossless=True)
    return str(path)


LOSSLESS = [
    "a.png", "alpha.png", "png16.png", "png16-alpha.png", "tif.tif", "tif16-alpha-tiles-deflate.tif",
    "tif-big-tiles.tif", "tif16-deflate.tif", "lzw.tif", "a.webp", "alpha.webp", "a.bmp", "a.ppm",
]  # fmt: skip


@pytest.mark.parametrize("name", LOSSLESS)
def test_what_is_empty(name, tmp_path, monkeypatch):
    monkeypatch.setattr(png_strips, "STRIP", 100_000)  # bytes: several strips

    picture = inspection.inspect_picture(written(name, tmp_path / name))

    assert picture.size == SIZE
    assert picture.bits == (16 if "16" in name else 8)
    assert picture.channels == ("RGB and alpha" if "alpha" in name else "RGB")
    assert picture.format == ("BigTIFF" if "big" in name else Image.registered_extensions()[os.path.splitext(name)[1]])
    assert picture.border is not None
    assert sides(picture.border) == (LEFT, TOP, RIGHT, BOTTOM)
    # a black hole may be a black thing; a transparent one is empty
    expected = FRAME + HOLE_SHARE if "alpha" in name else FRAME
    assert picture.border.kind == ("transparent" if "alpha" in name else "black")
    assert picture.border.share == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("reduced", [1, 8])
def test_what_is_empty_in_a_jpeg(reduced, tmp_path, monkeypatch):
    monkeypatch.setattr(pieces, "REDUCED", SIZE[0] * SIZE[1] / reduced**2 + 1)
    path = tmp_path / "a.jpg"
    Image.fromarray(grey_world()).save(path, quality=95)

    found = inspection.inspect_picture(str(path)).border

    assert found.step == reduced
    assert np.abs(np.subtract(sides(found), (LEFT, TOP, RIGHT, BOTTOM))).max() <= max(JPEG_STEP, reduced)
    assert found.share == pytest.approx(FRAME, abs=0.02)


def test_nothing_is_empty(tmp_path):
    path = tmp_path / "a.png"
    Image.fromarray(np.maximum(grey_world(), 100)).save(path)

    found = inspection.inspect_picture(str(path)).border

    assert (sides(found), found.share) == ((0, 0, 0, 0), 0.0)


def test_everything_is_empty(tmp_path):
    path = tmp_path / "a.png"
    Image.fromarray(np.zeros((5, 7, 3), np.uint8)).save(path)

    found = inspection.inspect_picture(str(path)).border

    assert (sides(found), found.share) == ((7, 5, 7, 5), 1.0)


def test_the_order_and_size_of_pieces_do_not_matter(rng, monkeypatch):
    monkeypatch.setattr(border, "CELLS", 20)
    mask = rng.random((61, 83)) < 0.5
    mask[:7], mask[:, -5:] = True, True
    whole = border.Emptiness((83, 61), 1)
    whole.add(Region(0, 0, 83, 61), mask)
    parts = border.Emptiness((83, 61), 1)
    tiles = Region(0, 0, 83, 61).tiles(17, 11)
    for number in rng.permutation(len(tiles)):
        parts.add(tiles[number], mask[tiles[number].y : tiles[number].bottom, tiles[number].x : tiles[number].right])

    for kind in ("black", "transparent"):
        assert parts.border(kind) == whole.border(kind)
    assert whole.border("transparent").share == pytest.approx(mask.mean())
    assert sides(whole.border("black"))[1:3] == (7, 5)


def test_a_png_with_every_filter_by_strips(tmp_path, monkeypatch):
    """Noise and ramps make Pillow's encoder choose among all filters."""
    monkeypatch.setattr(png_strips, "STRIP", 5000)
    y, x = np.mgrid[:90, :100]
    pixels = np.stack([x * y % 256, (x * 7 + y * y) % 256, (x**2 // 9 + y * 3) % 256], axis=-1).astype(np.uint8)
    path = tmp_path / "a.png"
    Image.fromarray(pixels).save(path)

    strips = list(png_strips.read_strips(str(path), png_strips.read_header(str(path))))

    assert len(strips) > 3
    np.testing.assert_array_equal(np.concatenate(strips), pixels)


def panorama(size=SIZE, projection="equirectangular"):
    def computed(region):
        y, _ = np.mgrid[region.y : region.bottom, region.x : region.right]
        mask = y >= TOP
        return Layer(region, np.where(mask[..., None], np.float32(200), np.float32(0)).repeat(3, -1), mask)

    plan = Plan(unchanged(0), 1, np.zeros((1, 1), np.int16), (), Region(0, 0, *size), "", False)
    return Panorama(Canvas(projection, 100.0, (0.0, 0.0), size), plan, computed)


def test_a_pyramid_is_told_and_used(tmp_path, monkeypatch):
    monkeypatch.setattr(tiff_pages, "QUICK", 1100 * 600 / 3)
    path = str(tmp_path / "a.tif")
    writers.write_panorama(panorama((1100, 600)), path, OutputOptions(pyramid="full"))

    picture = inspection.inspect_picture(path)

    assert picture.levels == ((550, 300), (275, 150))
    assert "tiles of 512 x 512" in picture.storage
    assert "deflate" in picture.storage
    assert picture.border.step == 2
    assert picture.border.top == TOP


def test_the_sphere_that_we_write_is_the_one_that_is_told():
    packet = sphere.PACKET.format(
        properties='GPano:ProjectionType="equirectangular" GPano:FullPanoWidthPixels="3600" '
        'GPano:FullPanoHeightPixels="1800" GPano:CroppedAreaImageWidthPixels="1000" '
        'GPano:CroppedAreaImageHeightPixels="500" GPano:PoseHeadingDegrees="12.5"'
    ).encode()

    found = sphere.read_sphere(packet, (1000, 500))

    assert found == sphere.Sphere("equirectangular", (100.0, 50.0), (3600, 1800), 12.5)
    # scaled since: it shows what it showed
    assert sphere.read_sphere(packet, (500, 250)).field == (100.0, 50.0)


@pytest.mark.parametrize("packet", [b"", b"<x/>", b"\xff\xfe", b'GPano:FullPanoWidthPixels="5"'])
def test_no_sphere(packet):
    assert sphere.read_sphere(packet, (10, 5)) is None


def test_nonsense_about_the_sphere_is_left_out():
    packet = b'<GPano:ProjectionType>equirectangular</GPano:ProjectionType> GPano:FullPanoWidthPixels="nan"'

    assert sphere.read_sphere(packet, (10, 5)) == sphere.Sphere("equirectangular")


def test_how_it_was_taken(tmp_path):
    exif = Image.Exif()
    exif[271], exif[272], exif[305] = "Maker", "Model 1", "Darkroom 2"
    exif.get_ifd(0x8769).update({33434: 0.004, 33437: 8.0, 34855: 200, 36867: "2024:05:06 07:08:09", 41989: 36})
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    path = tmp_path / "a.jpg"
    Image.new("RGB", (360, 240), "white").save(path, exif=exif, icc_profile=profile)

    picture = inspection.inspect_picture(str(path))

    shot = picture.shot
    assert (shot.lens, shot.exposure, shot.taken) == ("Maker Model 1", "1/250 s, f/8, ISO 200", "2024:05:06 07:08:09")
    assert (shot.software, shot.profile) == ("Darkroom 2", "sRGB built-in")
    # 36 mm on film of 36 x 24 mm; the photo has its shape
    assert picture.field_of_view == pytest.approx((53.13, 36.87), abs=0.02)


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def claiming(width, height, data=b"x", *, kind=2, interlaced=0):
    head = struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, interlaced)
    end = chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b"")
    return png_strips.SIGNATURE + chunk(b"IHDR", head) + end


HOSTILE = {
    "zero bytes": ("a.jpg", b"", "not a picture"),
    "text": ("a.jpg", b"Dear reader,\n" * 50, "not a picture"),
    "a PNG that claims gigapixels": ("a.png", claiming(100_000, 100_000), "claims 10000 megapixels"),
    "a wide PNG": ("a.png", claiming(2**31 - 1, 1), "claims"),
    "an interlaced PNG": ("a.png", claiming(100_000, 100_000, interlaced=1), "claims 10000 megapixels"),
    "a PNG that ends early": ("a.png", claiming(300, 300, bytes(100_000)), "ends before the picture does"),
    "a PNG without deflate": ("a.png", claiming(9, 9).replace(b"IDAT\x78", b"IDAT\x00"), "broken"),
    "the magic of TIFF": ("a.tif", b"II*\0", "cannot be read"),
    "a TIFF that points nowhere": ("a.tif", b"II*\0" + b"\xff" * 100, "no directory"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files(case, tmp_path):
    name, data, words = HOSTILE[case]
    (tmp_path / name).write_bytes(data)

    with pytest.raises(InputError, match=words) as error:
        inspection.inspect_picture(str(tmp_path / name))

    assert name in error.value.message


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "tif-deflate.tif", "lzw.tif", "a.webp", "a.bmp"])
def test_half_a_file(name, tmp_path):
    path = written(name, tmp_path / name)
    os.truncate(path, os.path.getsize(path) // 2)

    with pytest.raises(InputError, match=name):
        inspection.inspect_picture(path)


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe.jpg")

    for name, words in (("none.jpg", "no such file"), ("pipe.jpg", "no ordinary file"), (".", "is a folder")):
        with pytest.raises(InputError, match=words):
            inspection.inspect_picture(str(tmp_path / name))


def test_what_is_too_large_to_decode_in_one_piece_is_told_without_it(tmp_path, monkeypatch):
    monkeypatch.setattr(pieces, "MOST_WHOLE", 1000)

    for name in ("a.webp", "lzw.tif"):
        picture = inspection.inspect_picture(written(name, tmp_path / name))
        assert picture.border is None
        assert "not looked for" in picture.note
