"""What every way of laying seams promises, whichever it is: `SEAMS` decides which are tested."""

from dataclasses import replace

import numpy as np
import pytest

from panostitch.compositing.seams import SEAMS, extend
from panostitch.model.canvas import Canvas, Layer, Region
from panostitch.model.panorama import NOBODY

NAMES = sorted(SEAMS)
CANVAS = Canvas("rectilinear", 1.0, (0.0, 0.0), (300, 160))
OBJECT = (slice(55, 105), slice(130, 170))  # rows and columns; it stands where half-way seams run
CONTRAST = 90.0  # grey levels between the object and what is behind it
GRAIN = 3.0  # grey levels, standard deviation of what the photos differ by elsewhere


def ground(rng):
    return rng.uniform(90, 130, (CANVAS.size[1], CANVAS.size[0], 3)).astype(np.float32)


def layer(picture, region, mask=None):
    pixels = picture[region.within(CANVAS.region)]
    return Layer(region, pixels.copy(), np.ones(pixels.shape[:2], bool) if mask is None else mask)


def disc(region):
    y, x = np.mgrid[: region.height, : region.width]
    return np.hypot((x + 0.5) / region.width - 0.5, (y + 0.5) / region.height - 0.5) < 0.5


def arrangements(rng):
    """(photo, layer) pieces that lie on the canvas in several ways."""
    picture = ground(rng)
    round_one, inner = Region(100, 10, 140, 130), Region(60, 40, 80, 60)
    return {
        "two": [(0, layer(picture, Region(0, 0, 180, 160))), (1, layer(picture, Region(120, 0, 180, 160)))],
        "apart": [(0, layer(picture, Region(0, 0, 80, 160))), (1, layer(picture, Region(220, 30, 80, 100)))],
        "inside": [(0, layer(picture, Region(0, 0, 300, 160))), (1, layer(picture, inner))],
        "round": [
            (0, layer(picture, Region(0, 0, 180, 120))),
            (1, layer(picture, Region(150, 50, 150, 110))),
            (2, layer(picture, round_one, disc(round_one))),
        ],
        "in two pieces": [
            (0, layer(picture, Region(0, 0, 100, 160))),
            (1, layer(picture, Region(60, 0, 200, 160))),
            (0, layer(picture, Region(230, 0, 70, 160))),
        ],
        "equal": [(0, layer(picture, Region(20, 20, 200, 100))), (1, layer(picture, Region(20, 20, 200, 100)))],
    }


ARRANGEMENTS = sorted(arrangements(np.random.default_rng(0)))


def cover(pieces, photo):
    """Where a photo shows something, on the canvas."""
    covered = np.zeros(CANVAS.size[::-1], bool)
    for number, piece in pieces:
        if number == photo:
            covered[piece.region.within(CANVAS.region)] |= piece.mask
    return covered


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_labels_share_out_what_is_covered(name, arrangement, rng):
    pieces = arrangements(rng)[arrangement]

    labels = SEAMS[name](CANVAS, pieces)

    everything = np.any([cover(pieces, photo) for photo, _ in pieces], axis=0)
    assert labels.dtype == np.int16
    assert np.array_equal(labels != NOBODY, everything)
    assert set(np.unique(labels)) <= {NOBODY, *(photo for photo, _ in pieces)}
    for photo in {photo for photo, _ in pieces}:
        assert not ((labels == photo) & ~cover(pieces, photo)).any()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_what_only_one_photo_shows_is_its_own(name, arrangement, rng):
    pieces = arrangements(rng)[arrangement]

    labels = SEAMS[name](CANVAS, pieces)

    photos = sorted({photo for photo, _ in pieces})
    times = np.sum([cover(pieces, photo) for photo in photos], axis=0)
    for photo in photos:
        alone = cover(pieces, photo) & (times == 1)
        assert (labels[alone] == photo).all()


@pytest.mark.parametrize("name", NAMES)
def test_same_every_time(name, rng):
    pieces = arrangements(rng)["round"]

    assert np.array_equal(SEAMS[name](CANVAS, pieces), SEAMS[name](CANVAS, pieces))


@pytest.mark.parametrize("name", NAMES)
def test_turning_a_closed_turn_turns_its_seams(name, rng):
    closed = replace(CANVAS, wraps=True)
    picture = ground(rng)
    seen = [picture + rng.normal(0, GRAIN, picture.shape).astype(np.float32) for _ in range(4)]

    def turned(by):
        return SEAMS[name](closed, [piece for n in range(4) for piece in around(seen[n], n, 75 * n + by, by)])

    assert len(around(seen[0], 0, 290, 290)) == 2  # or no photo would lie across the edge
    assert np.array_equal(turned(290), np.roll(turned(0), 290, axis=1))


def around(picture, photo, left, turn, reach=120):
    """(photo, layer) pieces of a photo on a closed turn; the picture is turned as well."""
    width, height = CANVAS.size
    rolled = np.roll(picture, turn, axis=1)
    first = left % width
    parts = [(first, min(width, first + reach)), (0, max(0, first + reach - width))]
    return [(photo, layer(rolled, Region(x, 10, end - x, height - 20))) for x, end in parts if end > x]


@pytest.mark.parametrize("name", NAMES)
def test_extending_leaves_no_hole_and_changes_no_owner(name, rng):
    labels = SEAMS[name](CANVAS, arrangements(rng)["apart"])

    extended = extend(labels)

    assert (extended != NOBODY).all()
    assert np.array_equal(extended[labels != NOBODY], labels[labels != NOBODY])
    # the left part of the hole goes to the photo on the left, the right part to the one on the right
    assert (extended[60, 80:145] == 0).all()
    assert (extended[60, 155:220] == 1).all()


def with_object_in(photo, rng):
    """Two photos, in one of which somebody stands in the middle of the overlap."""
    picture = ground(rng)
    regions = Region(0, 0, 200, 160), Region(100, 0, 200, 160)
    layers = []
    for number, region in enumerate(regions):
        seen = picture + rng.normal(0, GRAIN, picture.shape).astype(np.float32)
        if number == photo:
            seen[OBJECT] += CONTRAST
        layers.append((number, layer(seen.astype(np.float32), region)))
    return layers


def seam_inside_object(labels):
    """Number of neighbours inside the object that have different owners."""
    inside = labels[OBJECT]
    return int((inside[:, 1:] != inside[:, :-1]).sum() + (inside[1:] != inside[:-1]).sum())


@pytest.mark.parametrize("photo", [0, 1])
def test_graph_cuts_go_around_what_moved(photo, rng):
    pieces = with_object_in(photo, rng)

    assert seam_inside_object(SEAMS["graphcut"](CANVAS, pieces)) == 0
    # and the plain way does not, or there would have been nothing to go around
    assert seam_inside_object(SEAMS["voronoi"](CANVAS, pieces)) >= OBJECT[0].stop - OBJECT[0].start


GRASS = 12.0  # grey levels, standard deviation of what two photos of grass in the wind differ by
PERSON = (slice(40, 130), slice(140, 160))  # narrow: through it is the short way


@pytest.mark.parametrize("photo", [0, 1])
def test_somebody_in_the_grass_stays_whole(photo, rng):
    picture = ground(rng)
    layers = []
    for number, region in enumerate((Region(0, 0, 200, 160), Region(100, 0, 200, 160))):
        seen = picture + rng.normal(0, GRASS, picture.shape).astype(np.float32)
        if number == photo:
            seen[PERSON] -= 60
        layers.append((number, layer(seen.astype(np.float32), region)))

    labels = SEAMS["graphcut"](CANVAS, layers)

    assert len(np.unique(labels[PERSON])) == 1


def test_many_photos_over_one_place_are_cut_again(rng):
    """The third photo agrees with both others where these do not: it takes their seam over."""
    picture = ground(rng)
    left, right = picture.copy(), picture.copy()
    left[:, 140:160] += 50
    pieces = [
        (0, layer(left, Region(0, 0, 160, 160))),
        (1, layer(right, Region(140, 0, 160, 160))),
        (2, layer(picture, Region(80, 0, 140, 160))),
    ]

    labels = SEAMS["graphcut"](CANVAS, pieces)

    assert (labels[5:-5, 139:161] != 0).all()


def test_graph_cuts_run_half_way_where_nothing_tells_the_photos_apart():
    picture = np.full((160, 300, 3), 100, np.float32)
    pieces = [(0, layer(picture, Region(0, 0, 200, 160))), (1, layer(picture, Region(100, 0, 200, 160)))]

    labels = SEAMS["graphcut"](CANVAS, pieces)

    seam = (labels == 0).sum(1)
    assert np.abs(seam - 150).max() <= 30


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (3, 2)])
@pytest.mark.parametrize("name", NAMES)
def test_tiny_overlaps(name, size, rng):
    picture = ground(rng)
    width, height = size
    pieces = [(0, layer(picture, Region(10, 10, 40, 40))), (1, layer(picture, Region(50 - width, 20, 60, height)))]

    labels = SEAMS[name](CANVAS, pieces)

    assert np.array_equal(labels != NOBODY, cover(pieces, 0) | cover(pieces, 1))
    assert (labels == 1).any()
