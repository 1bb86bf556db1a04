"""Key points come from everywhere in the photo, the strongest of each place first."""

import numpy as np
import pytest

from panostitch.features.spread import CELLS, spread

SIZE = (960, 720)  # px; cells of 40 px


def points(rng, count=2000):
    return rng.uniform((0, 0), SIZE, (count, 2)).astype(np.float32), rng.uniform(0, 1, count).astype(np.float32)


@pytest.mark.parametrize("count", [0, 1, 100, 1999, 2000, 5000])
def test_at_most_so_many_and_none_twice(rng, count):
    xy, response = points(rng)

    chosen = spread(xy, response, SIZE, count)

    assert len(chosen) == min(count, 2000)
    assert len(set(chosen.tolist())) == len(chosen)


def test_no_points():
    assert len(spread(np.zeros((0, 2), np.float32), np.zeros(0, np.float32), SIZE, 10)) == 0


def test_the_strongest_of_every_cell_comes_first(rng):
    xy, response = points(rng)
    cell = (xy // (SIZE[0] / CELLS)).astype(int)
    occupied = {tuple(c) for c in cell.tolist()}

    chosen = spread(xy, response, SIZE, len(occupied))

    assert {tuple(c) for c in cell[chosen].tolist()} == occupied
    for n in chosen:
        assert response[n] == response[(cell == cell[n]).all(1)].max()


def test_a_bush_does_not_take_all(rng):
    bush = rng.uniform((100, 100), (135, 135), (1000, 2))
    field = rng.uniform((0, 0), SIZE, (300, 2))
    xy = np.vstack([bush, field]).astype(np.float32)
    response = np.concatenate([np.full(1000, 9.0), np.ones(300)]).astype(np.float32)

    chosen = spread(xy, response, SIZE, 250)

    assert (chosen < 1000).sum() < 10


def test_order_of_the_points_does_not_matter(rng):
    xy, response = points(rng)
    response = np.round(response, 1)  # many ties
    shuffled = rng.permutation(2000)

    first = xy[spread(xy, response, SIZE, 300)]
    again = xy[shuffled][spread(xy[shuffled], response[shuffled], SIZE, 300)]

    assert np.array_equal(first, again)


def test_points_on_the_very_edge_are_of_the_photo():
    edge = np.array([[-0.4, -0.4], [959.4, 719.4], [959.4, 0], [0, 719.4]], np.float32)

    assert len(spread(edge, np.ones(4, np.float32), SIZE, 4)) == 4
