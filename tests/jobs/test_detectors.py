"""All detectors on photos of a known scene: the judge is nearly the truth, and without one nothing is judged."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from panostitch.debug import ink
from panostitch.errors import NoOverlapError
from panostitch.features import DETECTORS
from panostitch.jobs.detectors import LICENCES, hold, picture, trials
from panostitch.jobs.detectors.trials import RIGHT
from panostitch.matching import MATCHERS
from panostitch.model.match import VerifiedMatch
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.synthetic.render import ArraySource, photograph_plan
from panostitch.synthetic.scene import procedural_texture, rig, sphere_scene

SIZE = (400, 300)
OPTIONS = Options.of(work_megapixels=0.12, max_features=500)  # the photos as they are, so that the tests are quick
CAMERAS = rig(np.deg2rad([-30, 0, 30]), 0.0, np.deg2rad([1.0, -1.0, 2.0]), size=SIZE, hfov=np.deg2rad(55))
ERROR = 1.0  # px of a homography from key points; observed 0.1 to 0.3
BORDERLINE = 0.01  # of the matches, which may fall on either side of RIGHT: the judge is some 0.02 px off the truth


class Counted:
    """A source that counts how often it is read at each scale."""

    def __init__(self, source):
        self.source, self.reads = source, []

    def read(self, scale=1.0):
        self.reads.append(scale)
        return self.source.read(scale)


@pytest.fixture(scope="module")
def photos():
    return photograph_plan(sphere_scene(procedural_texture(1536, 768, seed=3)), CAMERAS, supersample=1)


@pytest.fixture(scope="module")
def strangers():
    dice = np.random.default_rng(0)
    return [Photo(name, (160, 120), ArraySource(dice.integers(0, 255, (120, 160, 3), np.uint8))) for name in "ab"]


@pytest.fixture(scope="module")
def contest(photos):
    return hold(photos, OPTIONS)


@pytest.fixture(scope="module")
def unjudged(strangers):
    return hold(strangers, replace(OPTIONS, matching=replace(OPTIONS.matching, retries="none")))


def test_every_detector_meets_every_matcher(contest):
    assert [(trial.detector, trial.matcher) for trial in contest.trials] == list(product(DETECTORS, MATCHERS))
    assert contest.pairs == ((0, 1), (1, 2))
    for trial in contest.trials:
        figures = trial.to_json()
        assert figures["raw"] >= figures["kept"] >= figures["verified"] > 0
        assert trial.linked == len(contest.pairs)
        assert min(*trial.detect_ms, *trial.match_ms) >= 0
        assert figures["descriptor_bytes"] == np.mean([f.descriptors.nbytes for f in trial.features])


def test_judge_agrees_with_the_truth(contest):
    for trial in contest.trials:
        for match, judged in zip(trial.matches, trial.right, strict=True):
            here, there = (trial.features[n].xy[match.pairs[:, k]] for k, n in enumerate((match.i, match.j)))
            off = np.linalg.norm(CAMERAS[match.j].project(CAMERAS[match.i].rays(here)) - there, axis=1)
            assert ((off <= RIGHT * max(SIZE)) != judged).mean() <= BORDERLINE
        assert 0.5 < trial.right_share <= 1
        assert trial.error < ERROR


def test_error_is_that_of_the_homography(contest):
    trial = contest.trials[0]
    (link,) = (one for one in trial.links if (one.i, one.j) == (0, 1))
    assert isinstance(link, VerifiedMatch)
    shifted = replace(link, j_from_i=np.array([[1, 0, 7.0], [0, 1, 0], [0, 0, 1]]) @ link.j_from_i)
    error = np.median(trials.errors_of(contest.reference.cameras, shifted))
    assert error == pytest.approx(7.0, abs=ERROR)


def test_without_a_reference_nothing_is_judged(unjudged):
    assert unjudged.reference is None
    assert isinstance(unjudged.failure, NoOverlapError)
    assert unjudged.pairs == ((0, 1),)
    for trial in unjudged.trials:
        assert (trial.linked, trial.right_share, trial.error) == (0, None, None)
    assert unjudged.to_json()["reference"] is None


def test_photos_are_read_before_the_clock_runs(photos, monkeypatch):
    """Once for each detector and photo, besides what the alignment reads."""
    counted = [replace(photo, source=Counted(photo.source)) for photo in photos[:2]]
    monkeypatch.setattr(trials.pipeline, "align", lambda *_, **__: (_ for _ in ()).throw(NoOverlapError("none")))
    hold(counted, OPTIONS)
    assert [len(photo.source.reads) for photo in counted] == [len(DETECTORS)] * 2


def test_picture_has_a_row_for_each_detector(contest, unjudged):
    drawn = picture(contest)
    rows = np.split(drawn, len(DETECTORS))
    for row, trial in zip(rows, contest.trials[:: len(MATCHERS)], strict=True):
        green, red = ((row == colour).all(2).any() for colour in (ink.GREEN, ink.VERMILLION))
        right = trial.right[contest.best_pair]
        assert (green, red) == (right.any(), not right.all())
    assert picture(unjudged).shape[0] > 0


def test_best_pair_has_most_verified_matches(contest):
    sums = [sum(trial.links[n].inliers for trial in contest.trials) for n in range(len(contest.pairs))]
    assert sums[contest.best_pair] == max(sums)


def test_every_detector_has_a_licence():
    assert set(LICENCES) == set(DETECTORS)
