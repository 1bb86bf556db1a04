"""The pixel-centre rule."""

import cv2
import numpy as np
import pytest

from panostitch.geometry.sampling import rescale
from tolerances import PIXEL

# px; resize works in float32 on values up to 64
RESIZE = 1e-4

FACTORS = [0.125, 0.3, 0.5, 1.0, 2.0, 3.7]


@pytest.mark.parametrize("factor", FACTORS)
def test_edges_of_a_picture_stay_its_edges(factor):
    width, height = 64, 48
    edges = np.array([[-0.5, -0.5], [width - 0.5, height - 0.5]])

    moved = rescale(edges, factor)

    np.testing.assert_allclose(moved, [[-0.5, -0.5], [width * factor - 0.5, height * factor - 0.5]], atol=PIXEL)


def test_a_block_of_pixels_becomes_the_pixel_that_covers_it():
    np.testing.assert_allclose(rescale(np.array([1.5, 5.5]), 0.25), [0.0, 1.0], atol=PIXEL)


@pytest.mark.parametrize("factor", FACTORS)
def test_there_and_back(factor, rng):
    xy = rng.uniform(-100, 5000, (50, 2))

    np.testing.assert_allclose(rescale(rescale(xy, factor), 1 / factor), xy, rtol=0, atol=PIXEL)


def test_each_axis_may_have_its_own_factor():
    np.testing.assert_allclose(rescale(np.array([[3.5, 3.5]]), np.array([0.5, 2.0])), [[1.5, 7.5]], atol=PIXEL)


@pytest.mark.parametrize("factor", [2, 4])
def test_agrees_with_how_pictures_are_made_smaller(factor):
    # each pixel holds its own column; after averaging it holds the column it stands for
    columns = np.tile(np.arange(64, dtype=np.float32), (8, 1))

    small = cv2.resize(columns, (64 // factor, 8 // factor), interpolation=cv2.INTER_AREA)

    places = rescale(np.column_stack([small[0], np.zeros(len(small[0]))]), 1 / factor)
    np.testing.assert_allclose(places[:, 0], np.arange(64 // factor), atol=RESIZE)
