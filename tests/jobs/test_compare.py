"""Both programs on photos of a known scene, and what is left of a program that crashes."""

import os
import signal
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from panostitch.errors import NoOverlapError
from panostitch.geometry.rotation import from_angles
from panostitch.io.readers import open_photos
from panostitch.jobs.compare import LABEL, MARGIN, NARROWEST, compare, failure, judge_options, side_by_side
from panostitch.jobs.contender import DONE, OURS, PICTURE, RIVAL, STATUS_WORDS, Task, rival_cameras, run_apart
from panostitch.model.photo import Photo
from panostitch.options import Options
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import rig, sphere_scene
from panostitch.synthetic.score import pair_errors
from panostitch.synthetic.textures import procedural_texture

OUR_MISFIT = 1.0  # px, median: noise of the judge's key points; observed 0.18
RIVAL_MISFIT = 1.5  # px, median: a wrong reading of its rotations is off by tens of px; observed 0.34
OUR_ERROR = 0.5  # px from the true cameras, 95 %; observed 0.04
RIVAL_ERROR = 3.0  # px; observed 0.58
EXACT = 1e-9  # px: the same numbers by another road, times a focal length
BALLAST = 60_000_000  # float64: 480 MB, far more than a child needs

CAMERAS = rig(np.deg2rad([-13, 13]), np.deg2rad([1.0, -2.0]), np.deg2rad([1.0, -1.0]), size=(480, 360), focal=500)


def write(path, pixels):
    assert cv2.imwrite(str(path), pixels[..., ::-1])
    return path


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """Two photos that overlap by half, one as JPEG and one as PNG, and one of nothing that either shows."""
    folder = tmp_path_factory.mktemp("photos")
    scene = sphere_scene(procedural_texture(1536, 768, seed=3))
    noise = np.random.default_rng(0).integers(0, 255, (360, 480, 3), np.uint8)
    pictures = [*(photograph(scene, camera, supersample=1) for camera in CAMERAS), noise]
    names = ("a.jpg", "b.png", "c.png")
    return [write(folder / name, pixels) for name, pixels in zip(names, pictures, strict=True)]


@pytest.fixture(scope="module")
def comparison(paths, tmp_path_factory):
    photos, _ = open_photos(paths)
    return compare(photos, Options(), tmp_path_factory.mktemp("compare"), threads=2)


def test_both_succeed_and_leave_out_the_stranger(comparison):
    assert [outcome.program for outcome in comparison.outcomes] == [RIVAL, OURS]
    for outcome in comparison.outcomes:
        assert outcome.status == DONE
        assert comparison.included(outcome) == ["a.jpg", "b.png"]
        assert comparison.left_out(outcome) == ["c.png"]
        assert np.load(outcome.picture).shape[:2] == outcome.size[::-1]
        assert outcome.seconds > 0
        assert outcome.cpu_seconds > 0
    assert failure(comparison) is None


def test_points_judge_both(comparison):
    rival, ours = comparison.misfits
    assert comparison.pairs == 1
    assert comparison.points > 50
    assert 0 < ours.median < OUR_MISFIT
    assert 0 < rival.median < RIVAL_MISFIT
    assert ours.median <= ours.rms <= ours.p95 * 2


@pytest.mark.parametrize(("program", "tolerance"), [(OURS, OUR_ERROR), (RIVAL, RIVAL_ERROR)])
def test_cameras_against_the_truth(comparison, program, tolerance):
    found = next(outcome.cameras for outcome in comparison.outcomes if outcome.program == program)
    assert np.quantile(pair_errors(tuple(CAMERAS), found[:2]), 0.95) < tolerance


def test_both_panoramas_are_judged_and_ours_is_the_better_one(comparison):
    rival, ours = comparison.scores
    assert min(rival.places, ours.places) > 100
    assert ours.total < rival.total


def test_side_by_side_shows_both(comparison):
    picture = side_by_side(comparison)
    heights = [outcome.size[1] for outcome in comparison.outcomes]
    assert picture.shape == (sum(heights) + 2 * (LABEL + MARGIN), NARROWEST + 2 * MARGIN, 3)
    assert picture[LABEL : LABEL + heights[0]].std() > 10  # grey levels: a picture, not plain paper
    assert picture[-MARGIN - heights[1] : -MARGIN].std() > 10


def test_side_by_side_without_the_rival(comparison):
    crashed = replace(comparison.rival, status="crashed: aborted", size=None, picture="", cameras=())
    picture = side_by_side(replace(comparison, outcomes=(crashed, comparison.ours)))
    assert picture.shape[0] == comparison.ours.size[1] + 2 * (LABEL + MARGIN)


def test_rotations_of_the_rival_are_world_from_camera():
    turn = from_angles(0.3, -0.2, 0.1)
    # a photo of 800 x 600 px at half its size: the centre of the full photo is at 399.5, of the small one at 199.5
    estimated = SimpleNamespace(focal=400.0, ppx=199.5, ppy=149.5, R=turn.T)
    (camera,) = rival_cameras([estimated], 0.5, [(800, 600)])
    (expected,) = rig([0.3], -0.2, 0.1, size=(800, 600), focal=800.0)
    rays = expected.rays(expected.corners)
    assert np.abs(camera.project(rays) - expected.corners).max() < EXACT * 1000


def test_judge_uses_another_detector():
    for detector in ("sift", "surf", "orb", "akaze"):
        assert judge_options(Options.of(detector=detector)).features.detector not in (detector, "orb")


def doomed(read):
    """Photos whose pixels end the process that reads them."""
    return tuple(Photo(name, (480, 360), SimpleNamespace(read=read)) for name in ("a", "b"))


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (partial(signal.raise_signal, signal.SIGSEGV), "crashed: segmentation fault"),
        (partial(signal.raise_signal, signal.SIGKILL), "crashed: killed, perhaps for want of memory"),
        (partial(os._exit, 3), "stopped with code 3"),
    ],
)
def test_crash_in_words(read, words, tmp_path):
    outcome = run_apart(Task(RIVAL, doomed(read), Options()), tmp_path)
    assert (outcome.program, outcome.status) == (RIVAL, words)
    assert outcome.cameras == ()
    assert outcome.size is None


def test_interrupted_child_interrupts_us(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        run_apart(Task(RIVAL, doomed(partial(signal.raise_signal, signal.SIGINT)), Options()), tmp_path)


def test_memory_is_the_childs_own(paths, tmp_path):
    ballast = np.ones(BALLAST)
    photos, _ = open_photos([paths[0], paths[2]])
    outcome = run_apart(Task(RIVAL, tuple(photos), Options()), tmp_path)
    assert outcome.status == STATUS_WORDS[1]
    assert 20 < outcome.peak_megabytes < ballast.nbytes / 1e6 / 2
    assert not (tmp_path / PICTURE).exists()


def test_failure_of_ours_is_the_users_error(comparison):
    error = NoOverlapError("no two photos overlap")
    ours = replace(comparison.ours, status=error.message, error=error)
    assert failure(replace(comparison, outcomes=(comparison.rival, ours))) is error
    bug = replace(comparison.ours, status="stopped with code 1", log=("ValueError: no",))
    assert "ValueError: no" in str(failure(replace(comparison, outcomes=(comparison.rival, bug))))
