"""The rectangle that is kept lies inside what is covered and is the largest, or nearly."""

import numpy as np
import pytest

from panostitch.compositing import crop
from panostitch.compositing.crop import bounding_box, choose_crop, largest_rectangle
from panostitch.model.canvas import Region

WHOLE = 40  # px, side of the masks in the table
SLACK = 2  # cells of the coarse search by which each side may fall short where masks are large


def mask(height, width, *holes):
    covered = np.ones((height, width), bool)
    for y, bottom, x, right in holes:
        covered[y:bottom, x:right] = False
    return covered


TABLE = {
    "empty": (np.zeros((20, 30), bool), 0),
    "full": (mask(20, 30), 600),
    "one pixel": (mask(1, 1), 1),
    "no pixel": (np.zeros((1, 1), bool), 0),
    "1 x n": (mask(1, 30), 30),
    "n x 1": (mask(30, 1), 30),
    "1 x n with a gap": (mask(1, 30, (0, 1, 10, 11)), 19),
    "n x 1 with a gap": (mask(30, 1, (10, 11, 0, 1)), 19),
    "L": (mask(WHOLE, WHOLE, (0, 25, 15, WHOLE)), 600),
    "hole in the middle": (mask(WHOLE, WHOLE, (18, 22, 18, 22)), 18 * WHOLE),
    "pinhole": (mask(9, 9, (4, 5, 4, 5)), 36),
    "stripe": (mask(WHOLE, WHOLE, (0, 17, 0, WHOLE), (20, WHOLE, 0, WHOLE)), 3 * WHOLE),
    "two islands": (mask(20, 30, (0, 20, 12, 14)), 320),
    "single pixel": (~mask(20, 30, (7, 8, 9, 10)), 1),
    "diagonal": (np.eye(12, dtype=bool), 1),
}


def brute_force(covered):
    """Area of the largest rectangle of True, by trying them all."""
    height, width = covered.shape
    sums = np.zeros((height + 1, width + 1), int)
    sums[1:, 1:] = covered.cumsum(0).cumsum(1)
    best = 0
    for y in range(height):
        for bottom in range(y + 1, height + 1):
            for x in range(width):
                for right in range(x + 1, width + 1):
                    area = (bottom - y) * (right - x)
                    if area > best and sums[bottom, right] - sums[y, right] - sums[bottom, x] + sums[y, x] == area:
                        best = area
    return best


def is_inside(region, covered):
    whole = Region(0, 0, covered.shape[1], covered.shape[0])
    return not region or ((region & whole) == region and bool(covered[region.within(whole)].all()))


@pytest.mark.parametrize("name", TABLE)
def test_degenerate_masks(name):
    covered, area = TABLE[name]

    found = largest_rectangle(covered)

    assert found.area == area
    assert is_inside(found, covered)


@pytest.mark.parametrize("seed", range(40))
def test_random_masks_agree_with_trying_all(seed):
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 14, 2)
    covered = rng.random((height, width)) < rng.choice([0.3, 0.7, 0.9, 0.97])

    found = largest_rectangle(covered)

    assert is_inside(found, covered)
    assert found.area == brute_force(covered)


@pytest.mark.parametrize("seed", range(25))
def test_large_masks_lose_a_few_pixels_at_most(seed, monkeypatch):
    monkeypatch.setattr(crop, "COARSE", 12)
    rng = np.random.default_rng(seed)
    covered = np.zeros((30, 40), bool)
    x, y = rng.integers(0, 15, 2)
    width, height = rng.integers(14, 25), rng.integers(12, 16)
    covered[y : y + height, x : x + width] = True
    covered |= rng.random(covered.shape) < 0.3
    step = -(-40 // 12)

    found = largest_rectangle(covered)

    assert is_inside(found, covered)
    assert found.area >= (width - SLACK * step) * (height - SLACK * step)
    # and it cannot grow on any side
    for side in ((-1, 0, 1, 0), (0, -1, 0, 1), (0, 0, 1, 0), (0, 0, 0, 1)):
        wider = Region(found.x + side[0], found.y + side[1], found.width + side[2], found.height + side[3])
        assert wider == found or not is_inside_canvas(wider, covered)


def is_inside_canvas(region, covered):
    whole = Region(0, 0, covered.shape[1], covered.shape[0])
    return (region & whole) == region and bool(covered[region.within(whole)].all())


@pytest.mark.parametrize("shape", [(700, 1500), (1500, 700), (321, 321), (640, 3)])
def test_a_full_mask_is_kept_whole_whatever_its_size(shape):
    assert largest_rectangle(np.ones(shape, bool)) == Region(0, 0, shape[1], shape[0])


@pytest.mark.parametrize("name", TABLE)
def test_the_box_holds_all_that_is_covered(name):
    covered, _ = TABLE[name]

    box = bounding_box(covered)

    outside = covered.copy()
    outside[box.y : box.bottom, box.x : box.right] = False
    assert not outside.any()
    if box:
        assert covered[box.y].any()
        assert covered[box.bottom - 1].any()
        assert covered[:, box.x].any()
        assert covered[:, box.right - 1].any()


@pytest.mark.parametrize("rule", ["auto", "full", "none"])
@pytest.mark.parametrize("name", TABLE)
def test_every_rule_answers_for_every_mask(rule, name):
    covered, area = TABLE[name]

    kept, reason = choose_crop(covered, rule)

    assert reason
    assert bool(kept) == bool(area)
    assert is_inside(kept, np.ones_like(covered))


def test_full_keeps_no_empty_corner():
    covered = mask(100, 200, (0, 20, 0, 30), (85, 100, 150, 200), (0, 8, 100, 200))

    kept, reason = choose_crop(covered, "full")

    assert is_inside(kept, covered)
    assert "full rectangle" in reason
    assert kept.area > 0.7 * covered.sum()


def test_auto_cuts_little_and_keeps_much():
    little = mask(100, 200, (0, 8, 0, 60))
    much = np.add.outer(np.abs(np.arange(-50, 50)) * 2, np.abs(np.arange(-100, 100))) < 100

    assert is_inside(choose_crop(little, "auto")[0], little)
    kept, reason = choose_crop(much, "auto")
    assert kept == bounding_box(much)
    assert "not cropped" in reason


def test_none_keeps_all():
    covered = mask(100, 200, (0, 8, 0, 60))

    assert choose_crop(covered, "none")[0] == Region(0, 0, 200, 100)


def test_a_pixel_of_a_reduced_mask_counts_only_with_its_neighbours():
    covered = mask(50, 60, (0, 10, 0, 60))

    kept, _ = choose_crop(covered, "full")

    # the first covered row is only partly covered at full size
    assert kept == Region(0, 11, 60, 39)
