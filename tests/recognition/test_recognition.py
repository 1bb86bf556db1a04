"""From photos to groups: what is linked, what is tried again, and what is told of it."""

from dataclasses import replace

import numpy as np
import pytest

from panostitch import pipeline
from panostitch.features import attempt_of, brings_more, detect_one, rungs
from panostitch.options import FeatureOptions, Options
from panostitch.runtime.executor import Executor
from panostitch.synthetic.render import ArraySource

FOG = 0.02  # of the contrast is left in the photo that is lost in fog: 5 grey levels
NATIVE = 0.12  # megapixels of the test photos
QUICK = {"work_megapixels": NATIVE, "max_features": 1000}


def fogged(photo):
    """The photo in fog, thickest in the middle."""
    pixels = photo.source.read()[0].astype(np.float64)
    return replace(photo, source=ArraySource(np.rint(190 + (pixels - 128) * FOG).astype(np.uint8)))


def groups(recognition):
    return {frozenset(recognition.photos[n].name for n in group) for group in recognition.groups.panoramas}


def outcomes(recognition):
    """What became of every pair, by names."""
    return {
        frozenset((recognition.photos[link.i].name, recognition.photos[link.j].name)): (bool(link), link.inliers)
        for link in recognition.links
    }


@pytest.fixture(scope="module")
def foggy(memory_photos):
    return [memory_photos[0], memory_photos[1], fogged(memory_photos[2])]


def test_a_photo_in_fog_is_found_by_another_way_to_see_it(foggy):
    first = pipeline.recognise(foggy, Options.of(**QUICK, retries="none"))
    again = pipeline.recognise(foggy, Options.of(**QUICK))

    assert first.groups.panoramas == ((0, 1),)
    assert again.groups.panoramas == ((0, 1, 2),)
    assert len(first.attempts[2]) == 1
    assert len(again.attempts[2]) > 1


def test_who_stays_alone_is_told_what_was_tried(memory_photos):
    heard = []

    recognition = pipeline.recognise(
        memory_photos, Options.of(**QUICK), trace=lambda event, **data: heard.append((event, data))
    )

    (left_out,) = pipeline.left_out(recognition, (0, 1, 2))
    assert left_out.name == "view_3"
    assert left_out.details[0].startswith("cause: different scene: ")
    assert left_out.details[-1].startswith("tried: sift at 0.12 MP, ")
    assert "akaze" in left_out.details[-1]
    retried = [data for event, data in heard if event == "matching.retried"]
    assert len(retried) == len(recognition.attempts[3]) - 1
    assert all(3 in (link.i, link.j) for data in retried for link in data["links"])


def test_who_has_a_place_is_not_tried_again(memory_photos):
    recognition = pipeline.recognise(memory_photos[:3], Options.of(**QUICK))

    assert [len(attempts) for attempts in recognition.attempts] == [1, 1, 1]


def test_every_pair_has_an_outcome_with_its_numbers(memory_photos):
    recognition = pipeline.recognise(memory_photos, Options.of(**QUICK, retries="none"))

    assert [(link.i, link.j) for link in recognition.links] == [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    assert all(link.putative >= link.inliers for link in recognition.links)
    assert all(link.reason and link.needed for link in recognition.links if not link)


def test_threads_do_not_matter_at_all(foggy):
    one, two, four = (pipeline.recognise(foggy, Options.of(**QUICK), run=Executor(n)) for n in (1, 2, 4))

    for other in (two, four):
        assert outcomes(other) == outcomes(one)
        for a, b in zip(one.links, other.links, strict=True):
            assert not a or np.array_equal(a.j_from_i, b.j_from_i)


def test_the_order_of_photos_does_not_change_what_belongs_together(foggy, memory_photos):
    heap = [*foggy, memory_photos[3]]

    first, turned = (pipeline.recognise(photos, Options.of(**QUICK)) for photos in (heap, heap[::-1]))

    assert groups(turned) == groups(first)
    assert outcomes(turned).keys() == outcomes(first).keys()


@pytest.mark.parametrize("detector", ["sift", "surf", "orb", "akaze"])
def test_every_rung_sees_more_or_otherwise(detector):
    options = FeatureOptions(detector=detector)
    ways = [options, *rungs(options)]

    assert len({(way.detector, way.megapixels, way.contrast) for way in ways}) == len(ways) >= 3
    assert all(way.megapixels >= options.megapixels and way.count >= options.count for way in ways)
    assert len({way.detector for way in ways}) == 2


def test_zero_stands_for_what_suits_the_detector():
    sift, orb = FeatureOptions(), FeatureOptions(detector="orb")

    assert 0 < sift.megapixels < orb.megapixels
    assert 0 < sift.count < orb.count
    assert FeatureOptions(work_megapixels=3.0, max_features=70).megapixels == 3.0
    assert FeatureOptions(max_features=70).count == 70


def test_evened_contrast_finds_points_in_fog(foggy):
    own, local = (detect_one(foggy[2], FeatureOptions(contrast=contrast)) for contrast in ("own", "local"))

    assert len(local) > 2 * len(own)


@pytest.mark.parametrize("detector", ["sift", "surf", "orb", "akaze"])
@pytest.mark.parametrize("megapixels", [0.05, NATIVE, 0.48])
def test_an_attempt_names_the_size_that_is_searched(detector, megapixels, memory_photos):
    options = FeatureOptions(detector=detector, work_megapixels=megapixels)
    photo = memory_photos[0]

    searched = photo.megapixels / detect_one(photo, options).pixel_size ** 2

    assert attempt_of(photo, options).megapixels == pytest.approx(searched, rel=0.01)


def test_a_small_photo_has_no_more_pixels_to_show(memory_photos):
    first, *_, last = (attempt_of(memory_photos[0], way) for way in rungs(FeatureOptions()))

    assert brings_more(first, [attempt_of(memory_photos[0], FeatureOptions())])
    assert not brings_more(last, [first])
