"""What of the photos' metadata stands in the panorama, by a rule; read back by other programs."""

import functools
import io
import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms
from PIL.ExifTags import GPS, IFD, Base
from PIL.TiffImagePlugin import IFDRational

import icc
from compositing.mosaics import alignment_of
from panostitch.io import tiff, writers
from panostitch.io.colour import in_one_profile
from panostitch.io.readers import open_photo
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.light import unchanged
from panostitch.model.panorama import Panorama, Plan
from panostitch.options import OutputOptions
from panostitch.synthetic.scene import rig

CROP = Region(4, 6, 37, 23)
FORMATS = ["a.jpg", "a.png", "a.tif", "a.webp"]
# degrees; seconds are written to four digits: 3e-8 degrees
PLACE = 1e-7
HEADING = 0.1  # degrees; given to a tenth, and the second photo's direction was rounded too
SCALE = 100.0  # px a radian: the sphere is 628 px wide

MAIN = {
    Base.Make: "Acme",
    Base.Model: "One",
    Base.Artist: "Ada",
    Base.Copyright: "© Ada".encode(),
}  # UTF-8 of "© Ada"
READ = {**MAIN, Base.Copyright: MAIN[Base.Copyright].decode("latin-1")}  # as Pillow understands it
LENS = {
    Base.LensModel: "Prime 35",
    Base.DateTimeOriginal: "2020:05:17 10:00:09",
    Base.OffsetTimeOriginal: "+02:00",
    Base.MakerNote: b"secret" * 20,
    Base.FocalLength: IFDRational(35, 1),
    Base.BodySerialNumber: "4711",
}


def place(latitude=(48, 8, 14.5), longitude=(11, 34, 31.25), *, west=False, heading=None, reference="T"):
    tags = {
        GPS.GPSLatitudeRef: "N",
        GPS.GPSLatitude: tuple(IFDRational(round(v * 100), 100) for v in latitude),
        GPS.GPSLongitudeRef: "W" if west else "E",
        GPS.GPSLongitude: tuple(IFDRational(round(v * 100), 100) for v in longitude),
        GPS.GPSAltitudeRef: b"\0",
        GPS.GPSAltitude: IFDRational(5195, 10),
    }
    if heading is not None:
        tags |= {GPS.GPSImgDirectionRef: reference, GPS.GPSImgDirection: IFDRational(round(heading * 100), 100)}
    return tags


@functools.cache  # littleCMS notes the time
def profile(space="RGB"):
    return ImageCms.ImageCmsProfile(ImageCms.createProfile({"RGB": "sRGB"}.get(space, space))).tobytes()


def photo(path, *, main=MAIN, lens=LENS, where=None, raw=None, size=(60, 40), **options):
    data = Image.Exif()
    data.update(main)
    data.get_ifd(IFD.Exif).update(lens)
    data.get_ifd(IFD.GPSInfo).update(where or {})
    Image.new("RGB", size, (90, 120, 150)).save(path, exif=raw if raw is not None else data, **options)
    return open_photo(path)


def panorama_of(photos, *, crop=CROP, projection="equirectangular", scale=SCALE, **canvas):
    """Looks to the north, if the first photo does; further photos each 0.3 radians to the right of the one before."""
    cameras = rig([0.3 * n for n in range(len(photos))], size=(60, 40), focal=60.0)
    alignment = replace(alignment_of(cameras), photos=tuple(photos))
    plan = Plan(unchanged(1), 1, np.zeros((1, 1), np.int16), (), crop, "as asked")
    size = (crop.right, crop.bottom)
    return Panorama(Canvas(projection, scale, (-60.0, -25.0), size, **canvas), plan, shown, alignment=alignment)


def shown(region):
    shape = (region.height, region.width)
    mask = np.ones(shape, bool)
    mask[:3] = False
    return Layer(region, np.full((*shape, 3), 77, np.float32), mask)


def write(path, panorama, **options):
    return writers.write_panorama(panorama, str(path), OutputOptions(**options))


def read(path):
    """EXIF tags of the main and the exposure's directory together, those of the place, profile and XMP, by Pillow."""
    with Image.open(path) as image:
        image.load()
        assert np.asarray(image)[5, 5, 0] in (76, 77, 78)
        data = image.getexif()
        xmp = image.info.get("xmp") or image.info.get("XML:com.adobe.xmp") or b""
        if image.format == "TIFF":
            xmp = data.get(700, b"")
        tags = dict(data) | data.get_ifd(IFD.Exif)
        return tags, dict(data.get_ifd(IFD.GPSInfo)), image.info.get("icc_profile"), xmp


def gpano(xmp):
    text = xmp.decode() if isinstance(xmp, bytes) else xmp
    return dict(re.findall(r'GPano:(\w+)="([^"]*)"', text))


@pytest.mark.parametrize("name", FORMATS)
def test_what_all_photos_agree_on_is_in_every_format(name, tmp_path):
    colours = profile()
    later = LENS | {Base.DateTimeOriginal: "2020:05:17 10:00:20", Base.OffsetTimeOriginal: "+05:00"}
    photos = [
        photo(tmp_path / "1.jpg", lens=later, where=place(heading=10.0), icc_profile=colours),
        photo(tmp_path / "2.png", where=place(heading=27.2), icc_profile=colours),
    ]

    written = write(tmp_path / name, panorama_of(photos))

    tags, where, icc, xmp = read(tmp_path / name)
    assert written.notes == ()
    assert {tag: tags[tag] for tag in MAIN} == READ
    assert tags[Base.LensModel] == "Prime 35"
    assert (tags[Base.DateTimeOriginal], tags[Base.OffsetTimeOriginal]) == ("2020:05:17 10:00:09", "+02:00")
    assert tags[Base.Software].startswith("panostitch ")
    assert tags[Base.Orientation] == 1
    assert not {Base.MakerNote, Base.FocalLength, Base.BodySerialNumber} & tags.keys()
    assert icc == colours
    degrees = [sum(float(v) / 60**n for n, v in enumerate(where[t])) for t in (GPS.GPSLatitude, GPS.GPSLongitude)]
    assert degrees == pytest.approx([48 + 8 / 60 + 14.5 / 3600, 11 + 34 / 60 + 31.25 / 3600], abs=PLACE)
    assert (where[GPS.GPSLatitudeRef], where[GPS.GPSLongitudeRef]) == ("N", "E")
    assert float(where[GPS.GPSAltitude]) == 519.5
    assert not {GPS.GPSImgDirection, GPS.GPSDateStamp} & where.keys()
    assert gpano(xmp)["ProjectionType"] == "equirectangular"
    # the first photo looks to 10 degrees and straight ahead; the middle of the crop is 38 px left of that
    assert float(gpano(xmp)["PoseHeadingDegrees"]) == pytest.approx(370 - np.rad2deg(38 / SCALE), abs=HEADING)


@pytest.mark.parametrize("name", FORMATS)
def test_without_metadata_there_is_the_colour_profile_alone(name, tmp_path):
    photos = [photo(tmp_path / "1.jpg", where=place(), icc_profile=profile())] * 2

    write(tmp_path / name, panorama_of(photos), metadata="none")

    tags, where, icc, xmp = read(tmp_path / name)
    said = {Base.Software, *MAIN, *LENS, Base.ExifVersion, Base.DateTime}
    assert not said & tags.keys()
    assert (where, icc, xmp) == ({}, profile(), b"")
    assert b"panostitch" not in (tmp_path / name).read_bytes()


def test_what_photos_do_not_agree_on_is_left_out(tmp_path):
    photos = [
        photo(tmp_path / "1.jpg"),
        photo(tmp_path / "2.jpg", main={**MAIN, Base.Model: "Two"}, lens={}),
        photo(tmp_path / "3.jpg", main={tag: text for tag, text in MAIN.items() if tag != Base.Artist}),
    ]

    write(tmp_path / "a.jpg", panorama_of(photos))

    tags = read(tmp_path / "a.jpg")[0]
    assert (tags[Base.Make], tags[Base.Copyright]) == (READ[Base.Make], READ[Base.Copyright])
    assert not {Base.Model, Base.Artist, Base.LensModel} & tags.keys()
    assert tags[Base.DateTimeOriginal] == LENS[Base.DateTimeOriginal]


def test_of_places_that_of_the_photo_in_the_middle_counts(tmp_path):
    seconds = (14.0, 15.0, 14.4)  # 31 m apart
    photos = [photo(tmp_path / f"{n}.jpg", where=place((48, 8, s))) for n, s in enumerate(seconds)]
    photos.append(photo(tmp_path / "nowhere.jpg"))

    write(tmp_path / "a.jpg", panorama_of(photos))

    assert float(read(tmp_path / "a.jpg")[1][GPS.GPSLatitude][2]) == 14.4


@pytest.mark.parametrize("far", [place((48, 8, 18.5)), place((48, 8, 14.5), west=True)])
def test_photos_taken_far_apart_have_no_place(far, tmp_path):
    photos = [photo(tmp_path / "1.jpg", where=place()), photo(tmp_path / "2.jpg", where=far)]

    write(tmp_path / "a.jpg", panorama_of(photos))

    assert read(tmp_path / "a.jpg")[1] == {}


def test_the_one_colour_profile_to_which_photos_are_converted_is_carried_and_said(tmp_path):
    profiles = [icc.rgb(icc.P3), profile(), profile()]
    photos = [photo(tmp_path / f"{n}.jpg", icc_profile=p) for n, p in enumerate(profiles)]

    written = write(tmp_path / "a.tif", panorama_of(in_one_profile(photos)))

    assert read(tmp_path / "a.tif")[2] == profile()
    (note,) = written.notes
    assert "0.jpg" in note
    assert "1.jpg" not in note


HOSTILE_PROFILES = {
    "Lab": lambda: profile("LAB"),
    "short": lambda: profile()[:100],
    "cut off": lambda: profile()[:-10],
    "noise": lambda: bytes(range(256)) * 4,
    "huge": lambda: (2 << 20).to_bytes(4) + profile()[4:] + bytes((2 << 20) - len(profile())),
}


@pytest.mark.parametrize("kind", HOSTILE_PROFILES)
def test_a_colour_profile_that_is_none_is_left_out(kind, tmp_path):
    photos = [photo(tmp_path / "1.png", icc_profile=HOSTILE_PROFILES[kind]())] * 2

    written = write(tmp_path / "a.png", panorama_of(photos))

    assert read(tmp_path / "a.png")[2] is None
    assert written.notes == ()


HOSTILE = {
    "control characters": {"main": {Base.Make: "\x1b[2J", Base.Copyright: "a\nb"}, "lens": {}},
    "endless names": {"main": {Base.Make: "A" * 30_000}, "lens": {}},
    "zero denominators": {"main": {}, "lens": {}, "where": place() | {GPS.GPSLatitude: (IFDRational(1, 0),) * 3}},
    "beyond the pole": {"main": {}, "lens": {}, "where": place((91, 0, 0))},
    "half a place": {"main": {}, "lens": {}, "where": {GPS.GPSLatitude: (IFDRational(1, 1),) * 2}},
    "no directory": {"raw": b"Exif\0\0II*\0\xff\xff\xff\x7f"},
    "noise": {"raw": b"Exif\0\0" + bytes(range(256)) * 20},
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_metadata_are_left_out(case, tmp_path):
    photos = [photo(tmp_path / "1.jpg", **HOSTILE[case])] * 2

    write(tmp_path / "a.jpg", panorama_of(photos))

    tags, where, _, _ = read(tmp_path / "a.jpg")
    assert tags.keys() == {Base.Orientation, Base.Software, Base.ExifOffset, Base.ExifVersion}
    assert where == {}


def test_a_lens_whose_name_is_not_ascii_is_left_out(tmp_path):
    data = Image.Exif()
    data.update(MAIN)
    data.get_ifd(IFD.Exif).update(LENS)
    raw = data.tobytes().replace(b"Prime 35", "Prim\N{LATIN SMALL LETTER E WITH ACUTE}35".encode())

    write(tmp_path / "a.jpg", panorama_of([photo(tmp_path / "1.jpg", raw=raw)] * 2))

    tags = read(tmp_path / "a.jpg")[0]
    assert tags[Base.Make] == "Acme"
    assert Base.LensModel not in tags


def test_a_nul_in_the_middle_ends_no_name(tmp_path):
    photos = [photo(tmp_path / "1.jpg", main={Base.Make: "Ac\0me"})] * 2

    write(tmp_path / "a.jpg", panorama_of(photos))

    assert "\0" not in read(tmp_path / "a.jpg")[0].get(Base.Make, "")


def test_a_photo_that_has_gone_says_nothing(tmp_path):
    gone = photo(tmp_path / "1.jpg")
    (tmp_path / "1.jpg").unlink()

    write(tmp_path / "a.jpg", panorama_of([gone, gone]))

    assert Base.Make not in read(tmp_path / "a.jpg")[0]


def test_the_part_of_the_sphere_that_the_crop_shows(tmp_path):
    photos = [photo(tmp_path / "1.jpg", where=place(heading=350.0))]
    # the horizon (v = 0) is row 25 of the canvas; the middle column of the crop, 4 + 18, is 38 px left of north
    write(tmp_path / "a.jpg", panorama_of(photos, scale=SCALE))

    said = gpano(read(tmp_path / "a.jpg")[3])
    assert (said["FullPanoWidthPixels"], said["FullPanoHeightPixels"]) == ("628", "314")
    assert (said["CroppedAreaImageWidthPixels"], said["CroppedAreaImageHeightPixels"]) == ("37", "23")
    # the upper edge of row 6 lies 19.5 px above the horizon, which is 157 px below the zenith
    assert int(said["CroppedAreaTopPixels"]) in (137, 138)
    assert int(said["CroppedAreaLeftPixels"]) == (628 - 37) // 2
    assert float(said["PoseHeadingDegrees"]) == pytest.approx((350 - np.rad2deg(38 / SCALE)) % 360, abs=HEADING)
    assert said["SourcePhotosCount"] == "1"


def test_a_whole_sphere_is_told_as_one(tmp_path):
    photos = [photo(tmp_path / "1.jpg")]
    whole = panorama_of(photos, crop=Region(0, 0, 200, 100), scale=200 / (2 * np.pi), wraps=True)
    whole = replace(whole, canvas=replace(whole.canvas, origin=(-99.5, -49.5)))

    write(tmp_path / "a.jpg", whole)

    said = gpano(read(tmp_path / "a.jpg")[3])
    assert [said[f"FullPano{side}Pixels"] for side in ("Width", "Height")] == ["200", "100"]
    assert [said[f"CroppedArea{side}Pixels"] for side in ("Left", "Top", "ImageWidth", "ImageHeight")] == [
        "0", "0", "200", "100"
    ]  # fmt: skip
    assert "PoseHeadingDegrees" not in said


@pytest.mark.parametrize(
    "directions", [(10.0, 27.2, 90.0), ("M", 10.0, 27.2), (None, None)], ids=["contradict", "magnetic", "unknown"]
)
def test_no_heading_where_it_is_not_known(directions, tmp_path):
    reference = "M" if directions[0] == "M" else "T"
    headings = [heading for heading in directions if heading != "M"]
    photos = [
        photo(tmp_path / f"{n}.jpg", where=place(heading=heading, reference=reference))
        for n, heading in enumerate(headings)
    ]

    write(tmp_path / "a.jpg", panorama_of(photos))

    assert "PoseHeadingDegrees" not in gpano(read(tmp_path / "a.jpg")[3])


@pytest.mark.parametrize("change", [{"projection": "cylindrical"}, {"projection": "cube"}, {"model": "similarity"}])
def test_what_is_no_sphere_is_not_told_as_one(change, tmp_path):
    panorama = panorama_of([photo(tmp_path / "1.jpg")])
    if "model" in change:
        panorama = replace(panorama, alignment=replace(panorama.alignment, **change))
    else:
        panorama = replace(panorama, canvas=replace(panorama.canvas, **change))

    write(tmp_path / "a.jpg", panorama)

    assert read(tmp_path / "a.jpg")[3] == b""


@pytest.mark.parametrize("name", FORMATS)
def test_a_second_run_writes_the_same_bytes(name, tmp_path):
    photos = [photo(tmp_path / f"{n}.jpg", where=place(), icc_profile=profile()) for n in (1, 2)]
    for run in "xy":
        write(tmp_path / f"{run}{name}", panorama_of(photos))

    assert (tmp_path / f"x{name}").read_bytes() == (tmp_path / f"y{name}").read_bytes()


@pytest.mark.parametrize(("limit", "pyramid"), [(2**32, "none"), (1, "full")])
def test_a_tiff_keeps_its_directories(limit, pyramid, tmp_path, monkeypatch):
    monkeypatch.setattr(tiff, "CLASSIC", limit)
    photos = [photo(tmp_path / "1.jpg", where=place(), icc_profile=profile())] * 2

    write(tmp_path / "a.tif", panorama_of(photos, crop=Region(0, 0, 1100, 20)), pyramid=pyramid)

    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        assert file.is_bigtiff == (limit == 1)
        tags = file.pages[0].tags
        assert tags["Make"].value == "Acme"
        assert tags["ExifTag"].value["LensModel"] == "Prime 35"
        assert tags["GPSTag"].value["GPSLatitudeRef"] == "N"
        assert tags["InterColorProfile"].value == profile()
        assert [tag.code for tag in tags] == sorted(tag.code for tag in tags)
        assert len(file.series[0].levels) == (3 if pyramid == "full" else 1)
        assert len(file.pages) == 1
        assert (file.series[0].levels[-1].asarray()[5:9, 5:9, 0] == 77).all()


@pytest.mark.skipif(shutil.which("exiftool") is None, reason="exiftool is not installed")
def test_exiftool_finds_no_fault(tmp_path):
    photos = [photo(tmp_path / "1.jpg", where=place(heading=3.0), icc_profile=profile())] * 2
    paths = [tmp_path / name for name in FORMATS]
    for path in paths:
        write(path, panorama_of(photos))

    told = subprocess.run(
        ["exiftool", "-j", "-a", "-warning", "-error", "-Make", "-Copyright", "-ProfileDescription", "-GPSLatitude#",
         "-ProjectionType", *paths], capture_output=True, text=True, check=True,
    )  # fmt: skip

    for entry in json.loads(told.stdout):
        assert not {"Warning", "Error"} & entry.keys(), entry
        assert (entry["Make"], entry["Copyright"], entry["ProjectionType"]) == ("Acme", "© Ada", "equirectangular")
        assert entry["GPSLatitude"] == pytest.approx(48 + 8 / 60 + 14.5 / 3600, abs=PLACE)
        assert "sRGB" in entry["ProfileDescription"]


def test_a_large_profile_is_cut_into_segments_of_a_jpeg(tmp_path):
    small = profile()
    large = (200_000).to_bytes(4) + small[4:] + bytes(200_000 - len(small))
    photos = [photo(tmp_path / "1.png", icc_profile=large)] * 2

    write(tmp_path / "a.jpg", panorama_of(photos))

    with Image.open(io.BytesIO((tmp_path / "a.jpg").read_bytes())) as image:
        assert image.info["icc_profile"] == large
