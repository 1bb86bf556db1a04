"""EXIF: which way is up, how long the lens is; nonsense does no harm."""

import io
import math
import struct

import numpy as np
import pytest
from PIL import Image
from PIL.ExifTags import IFD, Base
from PIL.TiffImagePlugin import IFDRational

from panostitch.io.readers import open_photo
from tolerances import JPEG_MEAN

# Relative; the diagonal of film is known to four digits.
FOCAL = 1e-3

# characters; what is shown of the camera's and the lens's name together
LONGEST_NAME = 300

# What turns an upright picture into the stored one: EXIF orientation 6 is stored turned left, and so on.
STORED_FROM_UPRIGHT = {
    1: None,
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_90,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_270,
}


def exif(main=None, lens=None):
    data = Image.Exif()
    for tag, value in (main or {}).items():
        data[tag] = value
    data.get_ifd(IFD.Exif).update(lens or {})
    return data


@pytest.fixture
def upright():
    """A portrait (60, 40, 3), smooth and without symmetry."""
    y, x = np.mgrid[:60, :40]
    return np.stack([x * 5 + 20, y * 3 + 10, 250 - 2 * x - y], axis=-1).astype(np.uint8)


TURNED_TWICE = "Pillow turns a TIFF by itself, its size too; so it is turned twice, or called stale"


@pytest.mark.parametrize("name", ["a.jpg", "a.png", "a.webp"])
@pytest.mark.parametrize("orientation", STORED_FROM_UPRIGHT)
def test_every_orientation_gives_the_same_upright_picture(name, orientation, upright, tmp_path):
    stored, how = Image.fromarray(upright), STORED_FROM_UPRIGHT[orientation]
    if how is not None:
        stored = stored.transpose(how)
    options = {"a.jpg": {"quality": 95, "subsampling": 0}, "a.webp": {"lossless": True}}.get(name, {})
    stored.save(tmp_path / name, exif=exif({Base.Orientation: orientation}), **options)

    photo = open_photo(tmp_path / name)
    pixels, _ = photo.source.read()
    half, _ = photo.source.read(0.5)

    assert photo.size == (40, 60)
    assert photo.notes == ()
    assert np.abs(pixels.astype(float) - upright).mean() <= (JPEG_MEAN if name == "a.jpg" else 0)
    expected = upright.reshape(30, 2, 20, 2, 3).mean((1, 3))
    assert np.abs(half - expected).mean() < JPEG_MEAN


@pytest.mark.parametrize("orientation", STORED_FROM_UPRIGHT)
def test_every_orientation_of_a_tiff(orientation, upright, tmp_path):
    test_every_orientation_gives_the_same_upright_picture("a.tif", orientation, upright, tmp_path)


def test_the_mask_is_turned_with_the_pixels(upright, tmp_path):
    alpha = np.full(upright.shape[:2], 255, np.uint8)
    alpha[:20, :10] = 0
    stored = Image.fromarray(np.dstack([upright, alpha])).transpose(STORED_FROM_UPRIGHT[6])
    stored.save(tmp_path / "a.png", exif=exif({Base.Orientation: 6}))

    _, mask = open_photo(tmp_path / "a.png").source.read()

    np.testing.assert_array_equal(mask, alpha)


@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_a_stale_orientation_is_ignored_and_noted(orientation, upright, tmp_path):
    # pixels that stand upright already, by a program that turned them and left the tag
    Image.fromarray(upright).save(tmp_path / "a.png", exif=exif({Base.Orientation: orientation}))

    photo = open_photo(tmp_path / "a.png")

    assert photo.size == (40, 60)
    np.testing.assert_array_equal(photo.source.read()[0], upright)
    (note,) = photo.notes
    assert "stale" in note
    assert str(orientation) in note


@pytest.mark.parametrize("orientation", [0, 9, 99, 65535])
def test_orientations_that_do_not_exist_are_ignored(orientation, upright, tmp_path):
    Image.fromarray(upright).save(tmp_path / "a.png", exif=exif({Base.Orientation: orientation}))

    np.testing.assert_array_equal(open_photo(tmp_path / "a.png").source.read()[0], upright)


def opened(tmp_path, *, size=(600, 400), main=None, lens=None):
    Image.new("RGB", size).save(tmp_path / "a.jpg", exif=exif(main, lens))
    return open_photo(tmp_path / "a.jpg")


def test_no_metadata(tmp_path):
    Image.new("RGB", (60, 40)).save(tmp_path / "a.jpg")

    photo = open_photo(tmp_path / "a.jpg")

    assert (photo.focal, photo.lens, photo.notes) == (None, "", ())


def test_focal_length_from_its_equivalent_on_film(tmp_path):
    # 50 mm before film of 36 mm: 50/36 of the width
    photo = opened(tmp_path, lens={Base.FocalLengthIn35mmFilm: 50, Base.FocalLength: IFDRational(33, 1)})

    assert photo.focal == pytest.approx(600 * 50 / 36, rel=FOCAL)


def test_the_equivalent_refers_to_the_diagonal(tmp_path):
    photo = opened(tmp_path, size=(400, 300), lens={Base.FocalLengthIn35mmFilm: 28})

    assert photo.focal == pytest.approx(500 * 28 / math.hypot(36, 24), rel=FOCAL)


SENSOR = {  # 600 px on 24 mm, in every unit that EXIF has
    "inch": {Base.FocalPlaneXResolution: IFDRational(635, 1), Base.FocalPlaneResolutionUnit: 2},
    "inch unsaid": {Base.FocalPlaneXResolution: IFDRational(635, 1)},
    "centimetre": {Base.FocalPlaneXResolution: IFDRational(250, 1), Base.FocalPlaneResolutionUnit: 3},
    "millimetre": {Base.FocalPlaneXResolution: IFDRational(25, 1), Base.FocalPlaneResolutionUnit: 4},
}


@pytest.mark.parametrize("unit", SENSOR)
def test_focal_length_from_the_resolution_of_the_sensor(unit, tmp_path):
    lens = {**SENSOR[unit], Base.FocalLength: IFDRational(35, 1), Base.ExifImageWidth: 600}

    assert opened(tmp_path, lens=lens).focal == pytest.approx(600 * 35 / 24, rel=FOCAL)
    # the same photo, made smaller without a word in its metadata
    assert opened(tmp_path, size=(300, 200), lens=lens).focal == pytest.approx(300 * 35 / 24, rel=FOCAL)


def test_a_sensor_too_small_to_be_one_is_not_believed(tmp_path):
    lens = {**SENSOR["centimetre"], Base.FocalLength: IFDRational(35, 1), Base.ExifImageWidth: 60}

    assert opened(tmp_path, lens=lens).focal is None


@pytest.mark.parametrize("missing", [Base.FocalLength, Base.FocalPlaneXResolution, Base.ExifImageWidth])
def test_half_the_story_of_a_sensor_is_none(missing, tmp_path):
    lens = {**SENSOR["inch"], Base.FocalLength: IFDRational(35, 1), Base.ExifImageWidth: 600}
    del lens[missing]

    assert opened(tmp_path, lens=lens).focal is None


def test_a_photo_held_upright_has_the_same_focal_length(tmp_path):
    lens = {Base.FocalLengthIn35mmFilm: 50}

    level = opened(tmp_path, lens=lens)
    upright = opened(tmp_path, main={Base.Orientation: 6}, lens=lens)

    assert upright.size == level.size[::-1]
    assert upright.focal == level.focal


def test_photos_of_one_lens_share_its_name(tmp_path):
    main = {Base.Make: "Acme", Base.Model: "One"}

    names = [
        opened(tmp_path, main=main, lens={Base.LensModel: "Prime", Base.FocalLength: IFDRational(mm, 2)}).lens
        for mm in (70, 70, 71)
    ]

    assert names[0] == names[1] == "Acme One Prime 35 mm"
    assert names[2] == "Acme One Prime 35.5 mm"


ZERO, NAN = IFDRational(1, 0), IFDRational(0, 0)
HOSTILE = {
    "zero denominators": ({}, {Base.FocalLength: ZERO, Base.FocalPlaneXResolution: ZERO, Base.ExifImageWidth: 600}),
    "not a number": ({}, {Base.FocalLength: NAN, Base.FocalPlaneXResolution: NAN, Base.ExifImageWidth: 600}),
    "zeros": ({}, {Base.FocalLengthIn35mmFilm: 0, Base.FocalLength: IFDRational(0, 1), Base.ExifImageWidth: 0}),
    "several for one": ({}, {Base.FocalLength: (IFDRational(50, 1), IFDRational(60, 1)), Base.ExifImageWidth: 600}),
    "endless names": ({Base.Make: "A" * 30_000, Base.Model: "B" * 30_000}, {}),
    "control characters": ({Base.Make: "\x1b[2J\x1b]0;owned\x07\r\n", Base.Model: "\u202egnp\u2028"}, {}),
}


@pytest.mark.filterwarnings("ignore:.*:UserWarning:PIL")
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_metadata_are_ignored(case, tmp_path):
    main, lens = HOSTILE[case]

    photo = opened(tmp_path, main=main, lens=lens)

    assert photo.focal is None
    assert photo.size == (600, 400)
    assert photo.lens.isprintable()
    assert len(photo.lens) < LONGEST_NAME
    assert photo.source.read()[0].shape == (400, 600, 3)


def raw_exif(*entries):
    """An EXIF block by hand: (tag, type, count, value of four bytes), as no honest program would write it."""
    directory = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHI4s", *entry) for entry in entries)
    return b"Exif\0\0II*\0" + struct.pack("<I", 8) + directory + bytes(4)


BROKEN = {
    "words for numbers": raw_exif((Base.Orientation, 2, 4, b"six\0"), (Base.FocalLengthIn35mmFilm, 2, 4, b"50m\0")),
    "a number that is none": raw_exif((Base.FocalLengthIn35mmFilm, 11, 1, struct.pack("<f", math.nan))),
    "infinite": raw_exif((Base.FocalLengthIn35mmFilm, 11, 1, struct.pack("<f", math.inf))),
    "several for one": raw_exif((Base.FocalLengthIn35mmFilm, 3, 2, struct.pack("<HH", 50, 60))),
    "nothing": b"Exif\0\0",
    "no header": b"Exif\0\0" + b"\xff" * 40,
    "half a header": b"Exif\0\0II*\0",
    "directory beyond the end": b"Exif\0\0II*\0" + struct.pack("<I", 10_000),
    "directory that is itself": raw_exif((IFD.Exif, 4, 1, struct.pack("<I", 8))),
    "lens beyond the end": raw_exif((IFD.Exif, 4, 1, struct.pack("<I", 2**31))),
    "text beyond the end": raw_exif((Base.Make, 2, 2**31, struct.pack("<I", 2**31))),
    "type that does not exist": raw_exif((Base.Orientation, 77, 1, b"\6\0\0\0")),
    "entries that are not there": b"Exif\0\0II*\0" + struct.pack("<IH", 8, 5000) + b"\1\2\3",
}


@pytest.mark.filterwarnings("ignore:.*:UserWarning:PIL")
@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_block_does_not_keep_the_photo_out(case, tmp_path):
    Image.new("RGB", (60, 40), (10, 20, 30)).save(tmp_path / "a.jpg", exif=BROKEN[case])

    photo = open_photo(tmp_path / "a.jpg")

    assert (photo.size, photo.focal) == ((60, 40), None)
    assert photo.source.read()[0].shape == (40, 60, 3)


WARNS = dict.fromkeys(
    ("directory beyond the end", "lens beyond the end", "text beyond the end", "entries that are not there"),
    "Pillow's UserWarning reaches standard error",
)


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_header_is_no_reason_to_warn(case, tmp_path):
    # a Python warning would end up on the user's terminal, even with --quiet
    Image.new("RGB", (60, 40)).save(tmp_path / "a.jpg", exif=BROKEN[case])

    open_photo(tmp_path / "a.jpg").source.read()


def test_a_tiff_that_lost_a_tag_is_not_a_bug(tmp_path):
    buffer = io.BytesIO()
    Image.new("RGB", (60, 40)).save(buffer, "TIFF", exif=exif({Base.Orientation: 1}))
    data = buffer.getvalue()
    # the entry of the photometric interpretation, with a number of values that is none
    entry = data.index(struct.pack("<HHI", 262, 3, 1))
    (tmp_path / "a.tif").write_bytes(data[: entry + 4] + struct.pack("<I", 0) + data[entry + 8 :])

    try:
        open_photo(tmp_path / "a.tif")
    except Exception as error:
        assert type(error).__name__ == "InputError"  # noqa: PT017 - that it opens is as good


@pytest.mark.parametrize(
    ("lens", "seconds"),
    [
        ({Base.DateTimeOriginal: "1970:01:02 00:00:01", Base.SubsecTimeOriginal: "25"}, 86401.25),
        ({Base.DateTimeOriginal: "1970:01:02 00:00:01", Base.SubsecTimeOriginal: "²x"}, 86401.0),
        ({Base.DateTimeOriginal: "1970:01:02 00:00:01"}, 86401.0),
        ({Base.DateTimeOriginal: "0000:00:00 00:00:00"}, None),
        ({Base.DateTimeOriginal: "    :  :     :  :  "}, None),
        ({Base.DateTimeOriginal: 7}, None),
        ({Base.SubsecTimeOriginal: "25"}, None),
        ({}, None),
    ],
)
def test_when_a_photo_was_taken(lens, seconds, upright, tmp_path):
    Image.fromarray(upright).save(tmp_path / "a.jpg", exif=exif(lens=lens))

    assert open_photo(str(tmp_path / "a.jpg")).taken == seconds
