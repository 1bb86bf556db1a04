"""What every exposure compensation promises, and what the one that does something finds."""

import numpy as np
import pytest

from panostitch.compositing import photometry
from panostitch.compositing.exposure import EXPOSURE
from panostitch.model.canvas import Layer, Region
from panostitch.model.light import radius_square
from tolerances import UNIT

NAMES = sorted(EXPOSURE)
PLANTED = np.array([1.0, 0.8, 1.15, 0.9, 1.05])  # what each photo's pixels were multiplied by

# Relative; medians of logarithms of float32 ratios, each good to 6e-8.
FLOAT32 = 1e-6

# Share of the planted steps that is left: slow drifts of the light are meant to stay. 0.14 seen.
LEFT = 0.25
# Relative; what is left where nothing is meant to stay. 2e-5 seen: the wide wish for gains near 1.
EXACT = 1e-4
# Relative; the same with grain of 4 grey levels in 4000 px and a moved thing in a tenth of each overlap. Seen
# over 30 seeds: 0.007 to 0.012. No error at all would mean that nothing was disturbed.
DISTURBED = (0.001, 0.035)
NOTHING_STAYS = 10.0  # spread of log gains: so wide that only the overlaps speak

ROW, WIDTH, STEP = 80, 140, 90  # px: photos 140 wide, 90 apart


def scene(rng, count):
    """A soft picture in 60..160, so that planted gains clip nothing."""
    width = STEP * (count - 1) + WIDTH
    return rng.uniform(60, 160, (ROW, width, 3)).astype(np.float32)


def pieces_of(picture, factors, *, grain=0.0, rng=None):
    pieces = []
    for n, factor in enumerate(factors):
        pixels = picture[:, n * STEP : n * STEP + WIDTH] * np.float32(factor)
        if grain:
            pixels = pixels + rng.normal(0, grain, pixels.shape).astype(np.float32)
        pieces.append((n, Layer(Region(n * STEP, 0, WIDTH, ROW), pixels, np.ones((ROW, WIDTH), bool))))
    return pieces


def light(name, count, pieces):
    """What a method finds of photos through one lens, whose middle is the radius 0."""

    def squares(photo, region):
        x, y = np.meshgrid(np.arange(region.x, region.right), np.arange(region.y, region.bottom))
        return radius_square(np.stack([x - photo * STEP, y], axis=-1), (WIDTH, ROW))

    return EXPOSURE[name]([0] * count, pieces, squares)


def brightness(name, count, pieces):
    return light(name, count, pieces).brightness


def unevenness(gains):
    """Largest relative difference of brightness that is left between any two photos."""
    left = gains * PLANTED[: len(gains)]
    return left.max() / left.min() - 1


@pytest.mark.parametrize("name", NAMES)
def test_geometric_mean_is_one(name, rng):
    gains = brightness(name, 5, pieces_of(scene(rng, 5), PLANTED))

    assert gains.shape == (5,)
    assert np.log(gains).mean() == pytest.approx(0, abs=UNIT)


@pytest.mark.parametrize("name", NAMES)
def test_equal_photos_are_left_alone(name, rng):
    np.testing.assert_allclose(brightness(name, 4, pieces_of(scene(rng, 4), np.ones(4))), 1, atol=FLOAT32)


@pytest.mark.parametrize("name", NAMES)
def test_one_photo_keeps_its_brightness(name, rng):
    np.testing.assert_allclose(brightness(name, 1, pieces_of(scene(rng, 1), [0.5])), 1, atol=UNIT)


@pytest.mark.parametrize("name", NAMES)
def test_a_photo_that_fell_off_the_canvas_has_a_finite_gain(name, rng):
    gains = brightness(name, 5, pieces_of(scene(rng, 4), PLANTED[:4]))

    assert gains.shape == (5,)
    assert np.isfinite(gains).all()


def test_none_is_ones(rng):
    assert np.array_equal(brightness("none", 5, pieces_of(scene(rng, 5), PLANTED)), np.ones(5))


def test_planted_steps_shrink(rng):
    gains = brightness("gain", 5, pieces_of(scene(rng, 5), PLANTED))

    assert unevenness(np.ones(5)) > 0.4
    assert unevenness(gains) < LEFT * unevenness(np.ones(5))


@pytest.fixture
def overlaps_alone(monkeypatch):
    monkeypatch.setattr(photometry, "GAIN_SPREAD", NOTHING_STAYS)


@pytest.mark.usefixtures("overlaps_alone")
def test_planted_gains_are_undone(rng):
    assert unevenness(brightness("gain", 5, pieces_of(scene(rng, 5), PLANTED))) < EXACT


@pytest.mark.usefixtures("overlaps_alone")
def test_grain_and_moved_things_disturb_little(rng):
    pieces = pieces_of(scene(rng, 5), PLANTED, grain=4.0, rng=rng)
    for n, layer in pieces:
        if n % 2:
            layer.pixels[20:60, :10] = 240  # something white stands in the overlap with the photo before

    assert DISTURBED[0] < unevenness(brightness("gain", 5, pieces)) < DISTURBED[1]


@pytest.mark.usefixtures("overlaps_alone")
def test_burnt_and_black_pixels_say_nothing(rng):
    picture = scene(rng, 2)
    picture[:30] = 0
    picture[50:] = 400
    pieces = [(n, Layer(p.region, p.pixels.clip(0, 255), p.mask)) for n, p in pieces_of(picture, PLANTED[:2])]

    assert unevenness(brightness("gain", 2, pieces)) < EXACT


@pytest.mark.usefixtures("overlaps_alone")
def test_pixels_outside_the_masks_say_nothing(rng):
    pieces = pieces_of(scene(rng, 2), PLANTED[:2])
    masked = pieces[1][1]
    masked.mask[:60] = False
    masked.pixels[:60] = 200

    assert unevenness(brightness("gain", 2, pieces)) < EXACT


def test_brightness_of_the_whole_does_not_matter(rng):
    picture = scene(rng, 5)

    gains, darker = (brightness("gain", 5, pieces_of(picture * f, PLANTED)) for f in (1.0, 0.5))

    np.testing.assert_allclose(darker, gains, rtol=FLOAT32)


def test_order_of_the_photos_does_not_matter(rng):
    pieces = pieces_of(scene(rng, 5), PLANTED)

    np.testing.assert_allclose(brightness("gain", 5, pieces[::-1]), brightness("gain", 5, pieces), rtol=FLOAT32)


def test_two_pieces_of_one_photo_are_not_compared(rng):
    picture = scene(rng, 1)
    both = pieces_of(picture, [1.0]) + pieces_of(picture, [0.5])

    np.testing.assert_allclose(brightness("gain", 1, both), 1, atol=UNIT)
