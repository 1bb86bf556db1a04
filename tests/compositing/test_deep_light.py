"""16 bits through warp, light, seams and blend: they come out as exact as they went in."""

from dataclasses import replace

import numpy as np
import pytest

from compositing.mosaics import alignment_of, panorama_of, shifted
from deep import deep_photo
from panostitch.compositing import plan
from panostitch.compositing.cost import decoding_bytes, photo_budget
from panostitch.io.rendering import read_tile
from panostitch.options import CompositingOptions, LayoutOptions

WHITE = 65535
SIZE, SHIFT = (260, 160), 170  # px; two photos that overlap by a third

# Of 65535; float32 sums of the bands of a blend round to some 1e-5 of a grey level, 257 of which are one. 1 seen.
BLENDED = 4
# Of 65535, mean: gains are estimated to some 0.3 %, half of it on each side. 30 seen.
EXPOSED_MEAN = 60
# Of 65535; from a pixel to the next the gradient goes on straight, but for rounding. Levels of 8 bits are 257 apart.
ROUGH = 4
MANY = 4096  # distinct levels; 8 bits have 256


def gradient():
    """Smooth in all channels (160, 430, 3), with most of the 65536 levels."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0] + SHIFT]
    return np.stack([3000 + x * 131 + y * 7, 62000 - x * 113 - y * 9, 2000 + y * 300 + x * 11], axis=-1).astype(
        np.uint16
    )


def pieces_of(picture, factors=(1.0, 1.0)):
    """A flat subject in two photos, the light of each times a factor."""
    cameras = [shifted(SIZE, x, 0) for x in (0, SHIFT)]
    photos = [
        deep_photo(f"p{n}", np.rint(picture[:, x : x + SIZE[0]] * factor).astype(np.uint16))
        for n, (x, factor) in enumerate(zip((0, SHIFT), factors, strict=True))
    ]
    return replace(alignment_of(cameras, model="similarity"), photos=tuple(photos))


def rendered(alignment, **options):
    """The pixels with 16 bits; the canvas has a margin of a pixel."""
    panorama = panorama_of(alignment, layout=LayoutOptions(crop="none"), compositing=CompositingOptions(**options))
    return read_tile(panorama, panorama.canvas.region, 16)[0][1:-1, 1:-1].astype(int)


def test_a_single_photo_comes_back_bit_for_bit(rng):
    picture = rng.integers(0, WHITE + 1, (*SIZE[::-1], 3)).astype(np.uint16)
    alignment = replace(alignment_of([shifted(SIZE, 0, 0)], model="similarity"), photos=(deep_photo("p", picture),))

    np.testing.assert_array_equal(rendered(alignment, exposure="none"), picture)


@pytest.mark.parametrize("blender", ["multiband", "feather", "none"])
def test_a_gradient_in_two_photos_comes_back(blender, monkeypatch):
    monkeypatch.setattr(plan, "PLAN_PIXELS", 8_000)  # reduced four times: low bands, fine bands and a halo
    picture = gradient()

    found = rendered(pieces_of(picture), blender=blender, exposure="none")

    assert np.abs(found - picture).max() <= BLENDED
    assert len(np.unique(found)) > 10 * MANY


def test_a_step_of_light_is_undone_in_16_bits():
    picture = gradient() // 2 + 8000

    found = rendered(pieces_of(picture, (1.0, 0.8)))

    # brightness is free: gains are of the mean of both
    factor = (found / picture).mean()
    assert np.abs(found - factor * picture).mean() <= EXPOSED_MEAN
    assert np.abs(np.diff(found, n=2, axis=0)).max() <= ROUGH
    assert len(np.unique(found)) > MANY


def test_photos_of_16_bits_are_lit_and_blended_like_those_of_8():
    picture = np.asarray(gradient()[:100, :240] // 400, np.uint8)
    cameras = [shifted((160, 100), 0.4, 0), shifted((160, 100), 80, 0.3)]
    shallow = alignment_of(cameras, [picture[:, :160], picture[:, 80:] // 2], model="similarity")
    photos = tuple(deep_photo(photo.name, photo.source.pixels.astype(np.uint16) * 257) for photo in shallow.photos)

    difference = rendered(replace(shallow, photos=photos)) - rendered(shallow)

    assert 0 < np.abs(difference).max() <= 257  # one level of 8 bits, to which sampling rounds photos of 8 bits


def test_a_photo_of_16_bits_takes_more_memory(rng):
    pixels = rng.integers(0, WHITE + 1, (30, 40, 3)).astype(np.uint16)
    deep = deep_photo("p", pixels)
    shallow = replace(deep, deep=None)

    assert decoding_bytes([shallow, deep]) == decoding_bytes([deep]) > 1.5 * decoding_bytes([shallow])
    # kept are six bytes of a pixel and one of the mask
    assert photo_budget([deep], 1) == 7 * 30 * 40 > photo_budget([shallow], 1)
