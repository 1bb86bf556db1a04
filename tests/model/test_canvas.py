"""Rays to pixels of the panorama and back, at full size and reduced."""

import numpy as np
import pytest

from panostitch.geometry.projections import PROJECTIONS
from panostitch.model.canvas import Canvas, Region
from tolerances import PIXEL, RELATIVE, UNIT

CLOSING = sorted(name for name, projection in PROJECTIONS.items() if projection.period)


def canvas(name, size=(600, 400)):
    """Straight ahead in its middle, an odd fraction of a pixel off the grid."""
    return Canvas(name, 300.0, (-size[0] / 2 + 0.25, -size[1] / 2 - 0.375), size)


def closed(name, turn=640):
    return Canvas(name, turn / (2 * np.pi), (-turn / 2 + 0.5, -100.0), (turn, 201), wraps=True)


def all_pixels(of):
    x, y = np.meshgrid(np.arange(of.size[0], dtype=float), np.arange(of.size[1], dtype=float))
    return np.column_stack([x.ravel(), y.ravel()])


def directions(rays):
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


@pytest.mark.parametrize("name", sorted(PROJECTIONS))
def test_pixels_undoes_rays(name):
    of = canvas(name)

    np.testing.assert_allclose(of.pixels(of.rays(all_pixels(of))), all_pixels(of), rtol=0, atol=PIXEL)


@pytest.mark.parametrize("name", CLOSING)
def test_pixels_undoes_rays_all_the_way_round(name):
    of = closed(name)

    np.testing.assert_allclose(of.pixels(of.rays(all_pixels(of))), all_pixels(of), rtol=0, atol=PIXEL)


def test_origin_and_scale():
    of = Canvas("equirectangular", 100.0, (-50.0, -20.0), (101, 41))

    np.testing.assert_allclose(of.pixels(np.array([[0.0, 0.0, 1.0]])), [[50, 20]], rtol=0, atol=PIXEL)
    np.testing.assert_allclose(of.rays(np.array([[50 + 100 * 0.3, 20.0]])), [[np.sin(0.3), 0, np.cos(0.3)]], atol=UNIT)


@pytest.mark.parametrize("name", CLOSING)
def test_columns_of_a_closed_canvas_continue_at_the_other_edge(name):
    of = closed(name)
    left, right = np.array([[-1.0, 50], [0, 50]]), np.array([[639.0, 50], [640, 50]])

    np.testing.assert_allclose(of.rays(left), of.rays(right), rtol=0, atol=UNIT)


@pytest.mark.parametrize("name", CLOSING)
def test_rays_fall_into_the_first_turn(name, rng):
    of = closed(name)
    longitude = rng.uniform(-10, 10, 1000)
    rays = np.column_stack([np.sin(longitude), np.zeros(1000), np.cos(longitude)])

    columns = of.pixels(rays)[:, 0]

    assert (columns >= -0.5).all()
    assert (columns < of.size[0] - 0.5).all()


@pytest.mark.parametrize("name", CLOSING)
def test_a_canvas_around_the_back_shows_what_lies_behind(name):
    # from 150 to 210 degrees: its columns lie on both sides of longitude 180
    of = Canvas(name, 300.0, (300 * np.deg2rad(150.0), -50.0), (314, 101))

    behind = of.pixels(np.array([[0.0, 0.0, -1.0], [1e-3, 0.0, -1.0], [-1e-3, 0.0, -1.0]]))

    np.testing.assert_allclose(behind[:, 0], 300 * (np.deg2rad(30) + np.arctan([0, -1e-3, 1e-3])), atol=PIXEL)


def test_rays_that_are_not_shown_are_nowhere():
    rays = np.array([[0.0, 0.1, -1.0], [np.nan, np.nan, np.nan]])

    for name in sorted(PROJECTIONS):
        assert np.isnan(canvas(name).pixels(rays)[1]).any()
    assert np.isnan(canvas("rectilinear").pixels(rays)[0]).any()


def test_beyond_the_poles_there_is_nothing():
    of = Canvas("equirectangular", 100.0, (0.0, -200.0), (10, 400))

    rays = of.rays(np.column_stack([np.zeros(400), np.arange(400.0)]))

    shown = np.isfinite(rays).all(1)
    np.testing.assert_array_equal(shown, np.abs(np.arange(400) - 200) / 100 <= np.pi / 2)


@pytest.mark.parametrize("factor", [1, 2, 8])
@pytest.mark.parametrize("name", sorted(PROJECTIONS))
def test_a_reduced_pixel_covers_its_block(name, factor):
    of = canvas(name)
    small = of.reduced(factor)
    xy = all_pixels(small)[::37]

    # the middle of a block of factor x factor pixels
    middle = xy * factor + (factor - 1) / 2
    np.testing.assert_allclose(directions(small.rays(xy)), directions(of.rays(middle)), rtol=0, atol=UNIT)


def test_reduced_rounds_up():
    of = canvas("cylindrical", (601, 399))

    small = of.reduced(4)

    assert small.size == (151, 100)
    assert small.region.times(4) & of.region == of.region


def test_reduced_twice_is_reduced_once():
    of = canvas("cylindrical", (640, 320))

    once, twice = of.reduced(8), of.reduced(2).reduced(4)

    assert once.size == twice.size
    assert once.scale == pytest.approx(twice.scale, rel=RELATIVE)
    assert once.origin == pytest.approx(twice.origin, rel=RELATIVE)


@pytest.mark.parametrize("factor", [2, 16, 64])
def test_a_closed_turn_stays_closed(factor):
    small = closed("cylindrical").reduced(factor)

    assert small.wraps
    assert small.size[0] == 640 // factor
    assert small.scale * 2 * np.pi == pytest.approx(small.size[0], rel=RELATIVE)


def test_region_is_the_whole_canvas():
    assert canvas("cylindrical", (601, 399)).region == Region(0, 0, 601, 399)
