"""What every detector promises, whichever it is: `DETECTORS` decides which are tested."""

import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest

from panostitch.errors import InputError
from panostitch.features import DETECTORS, MASK_MARGIN, detect, detect_one
from panostitch.model.photo import Photo
from panostitch.options import FeatureOptions
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import ArraySource

# Length of a descriptor; 128 float32 numbers of 6e-8 relative error each.
UNIT_LENGTH = 1e-4

# px; coordinates up to 800 px in float32, whose steps are 6e-5 there.
FLOAT32_PLACE = 2e-4

# Working px, mean; key points of a mirrored photo lie where those of the photo lie, mirrored. OpenCV's ORB forgets the
# half pixel where it reduces the picture: 0.13 seen. The others: 0.003 at the most. SIFT without its precise upscale
# would have 0.25.
BIAS = {"sift": 0.02, "surf": 0.02, "akaze": 0.02, "orb": 0.25}
SAME_POINT = 1.0  # working px; farther away it is another point

NATIVE = 0.12  # megapixels of the test photo: its working size is its own size
DETECTOR_NAMES = sorted(DETECTORS)

SHAPES = {"flat": (300, 400), "one pixel high": (1, 400), "one pixel wide": (300, 1), "one pixel": (1, 1)}
SHAPES |= {"7 x 5": (5, 7), "strip": (8, 400)}


@dataclass(frozen=True)
class MaskedSource:
    """Pixels with a mask, at full size only."""

    pixels: np.ndarray
    mask: np.ndarray

    def read(self, scale=1.0):
        assert scale == 1.0
        return self.pixels, self.mask


@dataclass(frozen=True)
class BrokenSource:
    """Pixels that cannot be had."""

    def read(self, scale=1.0):  # noqa: ARG002
        raise InputError("broken.jpg: broken")


def photo_of(pixels, name="photo"):
    return Photo(name, pixels.shape[1::-1], ArraySource(np.ascontiguousarray(pixels)))


def options_for(detector, *, count=3000, megapixels=NATIVE):
    return FeatureOptions(detector=detector, max_features=count, work_megapixels=megapixels)


def same(a, b):
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in vars(a))


@pytest.fixture(params=DETECTOR_NAMES)
def detector(request):
    return request.param


@pytest.fixture
def pixels(views):
    return views[0]


@pytest.mark.parametrize("megapixels", [0.06, NATIVE, 0.48])
def test_fields_are_what_the_model_says(detector, pixels, megapixels):
    found = detect_one(photo_of(pixels), options_for(detector, megapixels=megapixels))

    count, (height, width) = len(found), pixels.shape[:2]
    assert count > 100
    assert found.xy.shape == (count, 2)
    assert found.scale.shape == found.angle.shape == found.response.shape == (count,)
    assert {a.dtype for a in (found.xy, found.scale, found.angle, found.response)} == {np.dtype(np.float32)}
    assert ((found.xy >= -0.5) & (found.xy <= (width - 0.5, height - 0.5))).all()
    assert (found.scale > 0).all()
    assert np.isfinite(found.angle).all()
    # how far small photos are enlarged is the detector's own affair
    asked = np.sqrt(NATIVE / megapixels)
    assert 0.99 * asked < found.pixel_size < 1.01 * max(asked, 1)


def test_descriptors_are_unit_floats_or_bytes(detector, pixels):
    descriptors = detect_one(photo_of(pixels), options_for(detector)).descriptors

    assert descriptors.dtype in (np.float32, np.uint8)
    assert descriptors.flags.c_contiguous
    if descriptors.dtype == np.float32:
        np.testing.assert_allclose(np.linalg.norm(descriptors, axis=1), 1, atol=UNIT_LENGTH)


@pytest.mark.parametrize("most", [50, 300])
def test_at_most_so_many_and_spread(detector, pixels, most):
    found = detect_one(photo_of(pixels), options_for(detector, count=most))

    assert len(found) == most
    halves = [(found.xy[:, 0] < 199.5).mean(), (found.xy[:, 1] < 149.5).mean()]
    # exact halves are not to be had: the margins of the detectors and the picture leave their mark
    assert all(0.3 < half < 0.7 for half in halves)


@pytest.mark.parametrize("name", SHAPES)
def test_nothing_to_see_gives_nothing_and_does_not_raise(detector, pixels, name):
    height, width = SHAPES[name]
    picture = np.full((300, 400, 3), 90, np.uint8) if name == "flat" else pixels[:height, :width]

    found = detect_one(photo_of(picture), FeatureOptions(detector=detector))

    usual = detect_one(photo_of(pixels), options_for(detector, count=50)).descriptors
    assert len(found) <= (30 if name == "strip" else 0)
    assert found.xy.shape == (len(found), 2)
    assert found.descriptors.shape == (len(found), usual.shape[1])
    assert found.descriptors.dtype == usual.dtype


def test_same_every_time_and_with_two_threads(detector, views):
    photos = [photo_of(view, f"view_{n}") for n, view in enumerate(views)]

    first = detect(photos, options_for(detector))

    for again in (detect(photos, options_for(detector)), detect(photos, options_for(detector), run=Executor(2))):
        assert all(same(a, b) for a, b in zip(first, again, strict=True))


def test_a_photo_twice_the_size_has_its_points_by_the_half_pixel_rule(detector, pixels):
    doubled = pixels.repeat(2, axis=0).repeat(2, axis=1)  # reduced to working size it is the photo itself

    small = detect_one(photo_of(pixels), options_for(detector))
    large = detect_one(photo_of(doubled), options_for(detector))

    np.testing.assert_allclose(large.xy, (small.xy + 0.5) * 2 - 0.5, rtol=0, atol=FLOAT32_PLACE)
    np.testing.assert_allclose(large.scale, small.scale * 2, rtol=1e-6)
    assert np.array_equal(large.descriptors, small.descriptors)
    assert large.pixel_size == pytest.approx(2 * small.pixel_size)


@pytest.mark.parametrize("megapixels", [NATIVE, 0.48])
@pytest.mark.parametrize("axis", [0, 1])
def test_points_lean_to_no_side(detector, pixels, megapixels, axis):
    options = options_for(detector, megapixels=megapixels)
    found, mirrored = (detect_one(photo_of(p), options) for p in (pixels, np.flip(pixels, 1 - axis)))
    back = mirrored.xy.copy()
    back[:, axis] = pixels.shape[1 - axis] - 1 - back[:, axis]

    apart = np.linalg.norm(found.xy[:, None] - back, axis=2)
    apart += np.abs(np.log(found.scale[:, None] / mirrored.scale)) * found.pixel_size
    partner = apart.argmin(1)
    paired = apart.min(1) < SAME_POINT * found.pixel_size
    lean = (found.xy - back[partner])[paired, axis].mean() / 2 / found.pixel_size

    assert paired.mean() > 0.5
    assert abs(lean) < BIAS[detector]


def test_transparent_parts_have_no_points(detector, pixels):
    mask = np.full(pixels.shape[:2], 255, np.uint8)
    mask[:, 150:250] = 0
    hidden = pixels.copy()
    hidden[:, 150:250] = 0  # the edge of the hole is the strongest corner there is

    photo = Photo("cut-out", (400, 300), MaskedSource(hidden, mask))
    xy = detect_one(photo, options_for(detector)).xy
    enlarged = detect_one(photo, options_for(detector, megapixels=0.48)).xy

    for x in (xy[:, 0], enlarged[:, 0]):
        assert (x < 150).sum() > 20
        assert (x > 250).sum() > 20
        assert not ((x > 150 - MASK_MARGIN / 2) & (x < 249 + MASK_MARGIN / 2)).any()


def test_a_wholly_transparent_photo_has_no_points(detector, pixels):
    photo = Photo("nothing", (400, 300), MaskedSource(pixels, np.zeros((300, 400), np.uint8)))

    assert len(detect_one(photo, options_for(detector))) == 0


def test_features_can_be_sent_to_another_process(detector, pixels):
    found = detect_one(photo_of(pixels), options_for(detector, count=50))

    assert same(pickle.loads(pickle.dumps(found)), found)


def test_unreadable_pixels_are_a_value_and_spare_the_others(detector, pixels):
    good = photo_of(pixels)

    found = detect([good, replace(good, source=BrokenSource()), good], options_for(detector))

    assert isinstance(found[1], InputError)
    assert same(found[0], found[2])


def test_brightness_does_not_move_the_points(detector, pixels):
    darker = np.rint(pixels * 0.7).astype(np.uint8)
    found, dim = (detect_one(photo_of(p), options_for(detector)) for p in (pixels, darker))

    nearest = np.linalg.norm(dim.xy[:, None] - found.xy, axis=2).min(1)

    assert (nearest < SAME_POINT).mean() > 0.8
