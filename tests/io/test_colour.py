"""Photos of several colour profiles come to one; photos of one profile stay what they are, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
import tifffile
from PIL import Image

import icc
from compositing.mosaics import alignment_of
from panostitch import pipeline
from panostitch.io import colour, project
from panostitch.io.colour import DAMAGED, SRGB, TOO_DEEP, conversions, in_one_profile
from panostitch.io.readers import open_photo
from panostitch.io.writers import assemble, write_panorama
from panostitch.options import Options, OutputOptions
from panostitch.synthetic.scene import rig

# Grey levels; LittleCMS computes 8 bits with numbers of 14 to 16 bits, whose error dark levels magnify
LEVEL = 2
# Grey levels; those, and sampling and blending of photos that differ by them
BLENDED = 3

P3, ADOBE = icc.rgb(icc.P3, name="Display P3"), icc.rgb(icc.SRGB, gamma=1.8, name="Gamma 1.8")
# another edition of the same, with other bytes
P3_AGAIN = icc.rgb(icc.P3, name="Display P3, another edition")


def picture(size=(24, 16), seed=3):
    """Muted colours (h, w, 3), which all profiles here can show."""
    return np.random.default_rng(seed).integers(70, 190, (*size[::-1], 3), np.uint8)


def saved(path, pixels, profile=b"", **options):
    Image.fromarray(pixels).save(path, icc_profile=profile or None, **options)
    return open_photo(path)


def shown_by(pixels, primaries, gamma=2.2):
    """CIE XYZ of pixels under a profile of `icc.rgb`."""
    return (pixels / 255.0) ** gamma @ np.array(primaries)


def encoded(xyz, primaries, gamma=2.2):
    """Pixels of CIE XYZ under a profile of `icc.rgb`."""
    linear = xyz @ np.linalg.inv(np.array(primaries))
    return np.rint(255 * linear.clip(0, 1) ** (1 / gamma)).astype(np.uint8)


@pytest.mark.parametrize("profile", [SRGB, P3])
def test_photos_of_one_profile_stay_what_they_are(profile, tmp_path):
    photos = [saved(tmp_path / f"{n}.png", picture(seed=n), profile) for n in range(3)]

    one = in_one_profile(photos)

    assert all(a is b for a, b in zip(one, photos, strict=True))
    assert {photo.profile for photo in one} == {profile}
    np.testing.assert_array_equal(one[1].source.read()[0], picture(seed=1))
    assert conversions(one) == ()


def test_colours_are_what_they_were_under_the_photos_own_profile(tmp_path):
    photos = [
        saved(tmp_path / "a.png", picture(), P3),
        *(saved(tmp_path / f"{n}.png", picture(seed=n), icc.rgb(icc.SRGB)) for n in (1, 2)),
    ]

    one = in_one_profile(photos)

    pixels, mask = one[0].source.read()
    expected = encoded(shown_by(picture(), icc.P3), icc.SRGB)
    assert np.abs(expected.astype(int) - picture()).max() > 10 * LEVEL
    np.testing.assert_allclose(pixels.astype(int), expected, atol=LEVEL)
    assert mask is None
    assert one[1:] == tuple(photos[1:])
    assert {photo.profile for photo in one} == {icc.rgb(icc.SRGB)}


def test_size_orientation_and_alpha_stay(tmp_path):
    rgba = np.dstack([picture(), np.full((16, 24), 90, np.uint8)])
    data = Image.Exif()
    data[0x0112] = 6
    photos = [saved(tmp_path / "a.png", rgba, P3, exif=data), *[saved(tmp_path / "b.png", picture())] * 2]

    one = in_one_profile(photos)[0]

    for scale in (1.0, 0.5):
        own, converted = photos[0].source.read(scale), one.source.read(scale)
        assert converted[0].shape == own[0].shape
        np.testing.assert_array_equal(converted[1], own[1])


@pytest.mark.parametrize(
    ("profiles", "chosen"),
    [
        ([ADOBE, P3, P3], P3),
        ([P3, ADOBE], P3),
        ([ADOBE, P3], ADOBE),
        ([SRGB, P3, SRGB], SRGB),
        # editions of one profile count together
        ([ADOBE, ADOBE, P3, P3_AGAIN, P3], P3),
        ([ADOBE, ADOBE, P3_AGAIN, P3, P3_AGAIN], P3_AGAIN),
    ],
)
def test_the_profile_of_most_photos_is_the_one_for_all(profiles, chosen, tmp_path):
    photos = [saved(tmp_path / f"{n}.png", picture(), p) for n, p in enumerate(profiles)]

    one = in_one_profile(photos)

    assert {photo.profile for photo in one} == {chosen}
    (note,) = conversions(one)
    for n, profile in enumerate(profiles):
        same = chosen[-100:] == profile[-100:] if chosen else not profile
        assert (f"{n}.png" in note) == (not same)


def test_editions_of_one_profile_are_not_converted(tmp_path):
    photos = [saved(tmp_path / f"{n}.png", picture(seed=n), p) for n, p in enumerate([P3, P3_AGAIN, P3])]

    one = in_one_profile(photos)

    assert [photo.source for photo in one] == [photo.source for photo in photos]
    assert {photo.profile for photo in one} == {P3}


def test_a_profile_to_which_nothing_can_be_converted_is_not_chosen(tmp_path):
    """A scanner's table may lead from its numbers to colours only."""
    corners = np.zeros((2, 2, 2, 3))
    corners[..., 0] = np.linspace(0, 1, 8).reshape(2, 2, 2)
    scanned = icc.table(b"RGB ", corners)
    photos = [saved(tmp_path / f"{n}.png", picture(), p) for n, p in enumerate([scanned, scanned, P3])]

    assert {photo.profile for photo in in_one_profile(photos)} == {P3}
    assert {photo.profile for photo in in_one_profile(photos[:2])} == {scanned}


def test_grey_becomes_srgb_by_its_own_profile(tmp_path):
    levels = np.arange(256, dtype=np.uint8).reshape(16, 16)
    for name in ("a.png", "a.jpg"):
        photo = saved(tmp_path / name, levels, icc.grey(1.8), **({"quality": 100} if name == "a.jpg" else {}))

        pixels, _ = photo.source.read()

        with Image.open(tmp_path / name) as image:
            stored = (np.asarray(image) / 255.0) ** 1.8
        expected = 255 * np.where(stored <= 0.0031308, 12.92 * stored, 1.055 * stored ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(pixels, np.repeat(expected[..., None], 3, axis=2), atol=LEVEL)
        assert (photo.profile, photo.notes) == (SRGB, ())


def test_grey_with_alpha_keeps_it(tmp_path):
    pixels = np.dstack([np.full((8, 8), 50, np.uint8), np.arange(64, dtype=np.uint8).reshape(8, 8)])

    rgb, mask = saved(tmp_path / "a.png", pixels, icc.grey(1.0)).source.read()

    assert rgb[0, 0, 0] > 100
    np.testing.assert_array_equal(mask, pixels[..., 1])


def test_cmyk_becomes_srgb_by_its_own_profile(tmp_path):
    corners = np.zeros((2, 2, 2, 2, 3))
    corners[0, 0, 0, 0], corners[1, 0, 0, 0] = [1, 0, 0], [0.5, 0, 0]  # paper is white, cyan is a grey here
    inks = np.zeros((4, 2, 4), np.uint8)
    inks[:, 1, 0] = 255
    Image.fromarray(inks, "CMYK").save(tmp_path / "a.tif", icc_profile=icc.table(b"CMYK", corners))

    photo = open_photo(tmp_path / "a.tif")

    np.testing.assert_allclose(photo.source.read()[0][0], [[255] * 3, [119] * 3], atol=LEVEL)  # L = 50 is 119 in sRGB
    assert (photo.profile, photo.notes) == (SRGB, ())


BROKEN = {
    "cut off": P3[:-10],
    "short": P3[:100],
    "noise": bytes(range(256)) * 4,
    "huge": (2 << 20).to_bytes(4) + P3[4:] + bytes((2 << 20) - len(P3)),
    "of grey": icc.grey(2.2),
    "without curves": icc.profile(b"RGB ", {b"wtpt": icc.xyz(icc.D50)}),
    "that points beyond its end": P3[:172] + b"\xff\xff\xff\xf0" + P3[176:],  # to the curve of red
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_profile_is_said_and_taken_for_srgb(kind, tmp_path):
    photo = saved(tmp_path / "a.png", picture(), BROKEN[kind])

    assert (photo.profile, photo.notes) == (SRGB, (DAMAGED,))
    np.testing.assert_array_equal(photo.source.read()[0], picture())


def test_damage_anywhere_in_a_profile_ends_no_run(tmp_path):
    rng = np.random.default_rng(1)
    good = saved(tmp_path / "good.png", picture())
    for n in range(60):
        bad = bytearray(P3)
        for place in rng.integers(4, len(bad), 6):
            bad[place] = rng.integers(256)
        one = in_one_profile([saved(tmp_path / f"{n}.png", picture(), bytes(bad)), good, good])
        assert one[0].source.read()[0].shape == (16, 24, 3)


def test_16_bits_that_need_another_profile_become_8_and_that_is_said(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", picture().astype(np.uint16) * 257, photometric="rgb")
    photo = replace(open_photo(tmp_path / "a.tif"), profile=P3)
    others = [saved(tmp_path / "b.png", picture(seed=1))] * 2
    assert photo.depth == 16

    one = in_one_profile([photo, *others])

    assert one[0].depth == 8
    assert one[0].source.read()[0].dtype == np.uint8
    assert any("8 bits" in note and "a.tif" in note for note in conversions(one))
    assert in_one_profile([photo, photo])[0].depth == 16


def halves(tmp_path, profiles):
    """Two photos of one wall, one beside the other, each in its own profile; and their cameras."""
    wall = np.repeat(np.repeat(picture((12, 4)), 20, axis=0), 20, axis=1)  # patches of 20 px
    xyz = shown_by(wall, icc.SRGB)
    cameras = rig(np.deg2rad([0, 0]), size=wall.shape[1::-1], focal=200.0)
    photos = []
    for n, (name, primaries) in enumerate(profiles):
        photos.append(saved(tmp_path / f"{name}{n}.png", encoded(xyz, primaries), icc.rgb(primaries, name=name)))
    return replace(alignment_of(cameras), photos=tuple(photos))


def test_a_panorama_of_two_profiles_is_that_of_one(tmp_path):
    options = Options.of(exposure="none", projection="rectilinear", crop="full")
    same = pipeline.render(halves(tmp_path, [("srgb", icc.SRGB)] * 2), options)
    mixed = halves(tmp_path, [("srgb", icc.SRGB), ("p3", icc.P3)])
    (tmp_path / "again").mkdir()
    project.write_project(mixed, str(tmp_path / "again" / "x.pano.json"))

    for alignment in (mixed, project.read_project(str(tmp_path / "again" / "x.pano.json"))):
        panorama = pipeline.render(alignment, options)
        difference = assemble(panorama)[0].astype(int) - assemble(same)[0]
        assert np.abs(difference).max() <= BLENDED
    written = write_panorama(panorama, str(tmp_path / "out.png"), OutputOptions())

    with Image.open(tmp_path / "out.png") as image:
        assert image.info["icc_profile"] == icc.rgb(icc.SRGB, name="srgb")
    (note,) = written.notes
    assert note == "colours of p31.png are converted to srgb, the panorama's profile"


def test_a_deep_photo_keeps_no_grey_profile(tmp_path):
    tifffile.imwrite(tmp_path / "a.tif", np.full((8, 8), 30_000, np.uint16))
    with Image.open(tmp_path / "a.tif") as image:
        image.info["icc_profile"] = icc.grey(2.2)
        assert colour.read_profiles(image, deep=True) == colour.Profiles(notes=(TOO_DEEP,))
