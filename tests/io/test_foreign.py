"""Raw photos and HEIC: refused by name, by tags and by their first bytes; never stitched as their previews."""

import numpy as np
import pytest
import tifffile
from PIL import Image, features

from panostitch.errors import InputError
from panostitch.io import foreign
from panostitch.io.readers import EXTENSIONS, open_photo

THUMBNAIL = np.full((12, 16, 3), 90, np.uint8)
SENSOR = np.full((60, 80), 900, np.uint16)
DNG = (foreign.DNG_VERSION, "B", 4, bytes((1, 4, 0, 0)), True)


def raw_photo(path, *, tags=(), reduced=True):
    with tifffile.TiffWriter(path) as file:
        file.write(THUMBNAIL, photometric="rgb", subfiletype=int(reduced), subifds=1, extratags=tags)
        file.write(SENSOR, photometric="minisblack")
    return path


@pytest.mark.parametrize("extension", sorted(foreign.RAW))
def test_a_raw_photo_is_known_by_its_name(extension, tmp_path):
    for name in (f"a{extension}", f"A{extension.upper()}"):
        with pytest.raises(InputError, match="raw photo") as caught:
            open_photo(raw_photo(tmp_path / name))
        assert caught.value.hint == foreign.remedy(extension.upper()) == foreign.DEVELOP


@pytest.mark.parametrize(("tags", "reduced"), [((), True), ((DNG,), False)])
def test_a_raw_photo_is_known_by_its_tags(tags, reduced, tmp_path):
    with pytest.raises(InputError, match="raw photo"):
        open_photo(raw_photo(tmp_path / "a.tif", tags=tags, reduced=reduced))


def test_smaller_copies_make_no_raw_photo(tmp_path):
    assert open_photo(raw_photo(tmp_path / "a.tif", reduced=False)).size == (16, 12)


@pytest.mark.parametrize("brand", sorted(foreign.BRANDS))
def test_heic_is_known_by_its_first_bytes(brand, tmp_path):
    (tmp_path / "a.jpg").write_bytes(b"\0\0\0\x18ftyp" + brand + bytes(100))

    with pytest.raises(InputError, match="HEIC") as caught:
        open_photo(tmp_path / "a.jpg")

    assert caught.value.hint == foreign.EXPORT == foreign.remedy(".HEIC")


@pytest.mark.skipif(not features.check("avif"), reason="Pillow was built without AVIF")
def test_avif_as_pillow_writes_it(tmp_path):
    Image.fromarray(THUMBNAIL).save(tmp_path / "a.avif")

    with pytest.raises(InputError, match="AVIF"):
        open_photo(tmp_path / "a.avif")


def test_nothing_is_both_read_and_foreign():
    assert not EXTENSIONS & (foreign.RAW | foreign.HEIF)
    assert not any(map(foreign.remedy, EXTENSIONS))
