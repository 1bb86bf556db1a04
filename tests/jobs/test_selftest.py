"""The self-test passes on a healthy program and finds planted faults."""

from dataclasses import replace

import numpy as np
import pytest

from panostitch import pipeline
from panostitch.errors import AlignmentError
from panostitch.geometry import rotation
from panostitch.jobs import selftest
from panostitch.jobs.contender import OURS, RIVAL
from panostitch.jobs.hugin import HUGIN, HuginCamera, HuginError, HuginResult
from panostitch.options import Options
from panostitch.runtime.executor import serial
from panostitch.synthetic.scene import rig

# px; it must state an error that is no fault, and no zero. 0.05 seen.
STATED = (0.001, 0.2)
TURN = 0.005  # rad, by which a camera is turned: about 2 px
HFOV = np.deg2rad(50)
BOUNDS = dict(selftest.BOUNDS)


@pytest.fixture(autouse=True)
def _smaller(monkeypatch):
    """Smaller photos of a smaller world, for speed."""

    def row(*yaws):
        return lambda: rig(np.deg2rad(yaws), 0.02, [0.01 * n for n, _ in enumerate(yaws)], size=(400, 300), hfov=HFOV)

    monkeypatch.setattr(selftest, "TEXTURES", (2048, 2048))
    # the verdict is what is tested here, not how exact the program is on photos as small as these
    monkeypatch.setattr(selftest, "BOUNDS", dict.fromkeys(selftest.PLANS, STATED[1]))
    monkeypatch.setitem(selftest.PLANS, "pair", row(-12, 12))
    monkeypatch.setitem(selftest.PLANS, "low_overlap", row(-30, 0, 30))


def findings(*plans, **more):
    return list(selftest.run_selftest(plans, Options(), run=serial, **more))


def with_result(monkeypatch, change):
    """`pipeline.align` whose result goes through `change`."""
    healthy = pipeline.align
    monkeypatch.setattr(pipeline, "align", lambda *args, **kwargs: change(healthy(*args, **kwargs)))


def test_a_healthy_program_passes():
    (finding,) = findings("pair")

    assert finding.passed
    assert (finding.plan, finding.photos, finding.given) == ("pair", 2, 2)
    assert STATED[0] < finding.rms < STATED[1]
    assert finding.p95 >= finding.rms * 0.5
    assert finding.message == ""


def test_a_turned_camera_is_found(monkeypatch):
    def turned(alignment):
        first, *rest = alignment.cameras
        matrix = rotation.exp(np.array([0.0, TURN, 0.0])) @ first.cam_from_world
        return replace(alignment, cameras=(replace(first, cam_from_world=matrix), *rest))

    with_result(monkeypatch, turned)

    (finding,) = findings("pair")

    assert not finding.passed
    assert finding.photos == 2
    assert STATED[1] < finding.rms < 5


def test_a_photo_left_out_is_found(monkeypatch):
    with_result(
        monkeypatch,
        lambda alignment: replace(alignment, photos=alignment.photos[:-1], cameras=alignment.cameras[:-1]),
    )

    (finding,) = findings("low_overlap")

    assert not finding.passed
    assert (finding.photos, finding.given) == (2, 3)
    assert finding.rms < STATED[1]


def test_cameras_in_another_order_are_told_apart_by_name(monkeypatch):
    with_result(
        monkeypatch,
        lambda alignment: replace(alignment, photos=alignment.photos[::-1], cameras=alignment.cameras[::-1]),
    )

    assert findings("pair")[0].passed


def test_an_error_is_a_finding_and_does_not_end_the_test(monkeypatch):
    def fails(*_args, **_kwargs):
        raise AlignmentError("nothing fits")

    monkeypatch.setattr(pipeline, "align", fails)

    found = findings("pair", "pair")

    assert [(f.passed, f.message, f.photos) for f in found] == [(False, "nothing fits", 0)] * 2
    assert all(np.isinf(f.rms) for f in found)


def test_a_bug_is_not_swallowed(monkeypatch):
    def broken(*_args, **_kwargs):
        raise ZeroDivisionError

    monkeypatch.setattr(pipeline, "align", broken)

    with pytest.raises(ZeroDivisionError):
        findings("pair")


def test_every_plan_has_its_bound():
    assert set(BOUNDS) == set(selftest.PLANS)
    assert all(0 < bound <= 0.05 for bound in BOUNDS.values())


def test_the_rival_stands_beside_ours():
    ours, rival = findings("pair", programs=(OURS, RIVAL))

    assert (ours.program, rival.program) == (OURS, RIVAL)
    assert (rival.photos, rival.given) == (2, 2)
    assert ours.rms < rival.rms < 3  # px; a wrong reading of its cameras is off by tens


def test_exif_is_in_the_photos_and_in_the_finding(monkeypatch):
    seen = []
    healthy = pipeline.align
    monkeypatch.setattr(pipeline, "align", lambda photos, *a, **k: seen.append(photos) or healthy(photos, *a, **k))

    found = findings("pair", exif=(False, True))

    assert [f.exif for f in found] == [False, True]
    assert {p.focal for p in seen[0]} == {None}
    (focal,) = {p.focal for p in seen[1]}
    true = 200 / np.tan(HFOV / 2)
    assert 0 < abs(focal - true) < 0.002 * true  # rounded to a tenth of a millimetre
    assert all(np.array_equal(a.source.pixels, b.source.pixels) for a, b in zip(*seen, strict=True))


def planted(*errors):
    """What Hugin would find if it were off by these angles: one for the photos as it comes, one with its lens."""

    def one(error):
        cameras = selftest.PLANS["pair"]()
        turn = rotation.exp(np.array([0.0, error, 0.0]))
        cameras[1] = replace(cameras[1], cam_from_world=turn @ cameras[1].cam_from_world)
        return tuple(HuginCamera(c.size, c.focal, c.centre, c.cam_from_world) for c in cameras)

    return lambda *_args, **_more: HuginResult(*(one(error) for error in errors), seconds=1.5)


@pytest.mark.parametrize(("errors", "words"), [((0.0, TURN), "as it comes"), ((TURN, 0.0), "lens optimised")])
def test_the_better_one_of_hugins_results_counts(monkeypatch, errors, words):
    monkeypatch.setattr(selftest, "is_installed", lambda: True)
    monkeypatch.setattr(selftest, "run_hugin", planted(*errors))

    (finding,) = findings("pair", programs=(HUGIN,))

    assert finding.message.startswith(words)
    assert finding.rms < 1e-6  # px: the true cameras
    assert (finding.program, finding.photos, finding.seconds) == (HUGIN, 2, 1.5)


def test_hugin_that_fails_is_a_row_that_says_so(monkeypatch):
    def fails(*_args, **_more):
        raise HuginError("cpfind failed with code 1")

    monkeypatch.setattr(selftest, "is_installed", lambda: True)
    monkeypatch.setattr(selftest, "run_hugin", fails)

    (finding,) = findings("pair", programs=(HUGIN,))

    assert (finding.photos, finding.message) == (0, "cpfind failed with code 1")
    assert np.isinf(finding.rms)


def test_hugin_that_is_not_installed_is_passed_over(monkeypatch):
    monkeypatch.setattr(selftest, "is_installed", lambda: False)

    assert [f.program for f in findings("pair", programs=(OURS, HUGIN))] == [OURS]
