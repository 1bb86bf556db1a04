"""The one rectangle type. All of it is exact."""

import numpy as np
import pytest

from panostitch.model.canvas import Region

REGIONS = [Region(0, 0, 10, 7), Region(-5, 3, 64, 64), Region(100, -100, 1, 33), Region(7, 7, 65, 128)]


def painted(region, size=300, shift=150):
    """The region's pixels as True on a square that holds all regions of this file."""
    picture = np.zeros((size, size), bool)
    picture[region.y + shift : region.bottom + shift, region.x + shift : region.right + shift] = True
    return picture


@pytest.mark.parametrize("side", [1, 7, 32, 64, 1000])
@pytest.mark.parametrize("region", REGIONS)
def test_tiles_cover_every_pixel_once(region, side):
    count = np.zeros((300, 300), int)
    for tile in region.tiles(side):
        assert 0 < tile.width <= side
        assert 0 < tile.height <= side
        count += painted(tile)

    np.testing.assert_array_equal(count, painted(region))


def test_tiles_go_row_by_row():
    assert [(t.x, t.y) for t in Region(0, 0, 5, 3).tiles(2)] == [(0, 0), (2, 0), (4, 0), (0, 2), (2, 2), (4, 2)]


def test_nothing_has_no_tiles():
    assert Region(5, 5, 0, 10).tiles(4) == []


@pytest.mark.parametrize("a", REGIONS)
@pytest.mark.parametrize("b", REGIONS)
def test_and_is_what_both_hold(a, b):
    np.testing.assert_array_equal(painted(a & b), painted(a) & painted(b))
    assert bool(a & b) == (painted(a) & painted(b)).any()
    assert (a & b).area == (painted(a) & painted(b)).sum()
    assert (a & b) == (b & a) or not a & b


def test_regions_that_only_touch_have_nothing_in_common():
    assert not Region(0, 0, 5, 5) & Region(5, 0, 5, 5)
    assert not Region(0, 0, 5, 5) & Region(0, 5, 5, 5)


@pytest.mark.parametrize("margin", [0, 1, 17])
@pytest.mark.parametrize("multiple", [1, 4, 16])
@pytest.mark.parametrize("region", REGIONS)
def test_grown_is_the_smallest_that_holds_the_margin(region, margin, multiple):
    grown = region.grown(margin, multiple=multiple)

    edges = (grown.x, grown.y, grown.right, grown.bottom)
    assert all(edge % multiple == 0 for edge in edges)
    excess = (region.x - grown.x, region.y - grown.y, grown.right - region.right, grown.bottom - region.bottom)
    assert all(margin <= n < margin + multiple for n in excess)


def test_within_finds_the_pixels_in_the_outer_array():
    outer, inner = Region(-10, 20, 50, 40), Region(3, 30, 7, 5)
    rows, columns = np.mgrid[outer.y : outer.bottom, outer.x : outer.right]

    place = inner.within(outer)

    assert rows[place].shape == (5, 7)
    assert (rows[place][0, 0], columns[place][0, 0]) == (30, 3)
    assert (rows[place][-1, -1], columns[place][-1, -1]) == (34, 9)


def test_divided_and_times_undo_each_other():
    region = Region(-16, 32, 64, 8)

    assert region.divided(8) == Region(-2, 4, 8, 1)
    assert region.divided(8).times(8) == region


def test_half_open():
    region = Region(2, 3, 4, 5)

    assert (region.right, region.bottom, region.area) == (6, 8, 20)
    assert region
    assert not Region(2, 3, 0, 5)
    assert not Region(2, 3, 4, 0)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("region", [Region(-5, 7, 100, 61), Region(0, 0, 64, 64), Region(3, 3, 2, 2)])
def test_halves_share_out_a_region(region, axis):
    first, second = region.halves(axis, multiple=16)

    assert first
    assert second
    assert not first & second
    assert first.area + second.area == region.area
    assert (first & region, second & region) == (first, second)
    assert (second.x, second.y) == ((region.x, first.bottom) if axis == 0 else (first.right, region.y))


def test_halves_are_cut_at_a_multiple_where_there_is_one():
    assert Region(-5, 0, 100, 50).halves(1, multiple=16)[1].x == 32
    assert Region(0, 3, 9, 50).halves(0, multiple=16)[1].y == 16
    assert Region(1, 0, 10, 50).halves(1, multiple=16)[1].x == 6
