"""The self-test passes on a healthy program and finds planted faults."""

from dataclasses import replace

import numpy as np
import pytest

from panostitch import pipeline
from panostitch.errors import AlignmentError
from panostitch.geometry import rotation
from panostitch.jobs import selftest
from panostitch.options import Options
from panostitch.runtime.executor import serial
from panostitch.synthetic.scene import rig

# px; it must state an error that is no fault, and no zero. 0.05 seen.
STATED = (0.005, selftest.MAX_RMS)
TURN = 0.005  # rad, by which a camera is turned: about 2 px
HFOV = np.deg2rad(50)


@pytest.fixture(autouse=True)
def _smaller(monkeypatch):
    """Smaller photos of a smaller world, for speed."""

    def row(*yaws):
        return lambda: rig(np.deg2rad(yaws), 0.02, [0.01 * n for n, _ in enumerate(yaws)], size=(400, 300), hfov=HFOV)

    monkeypatch.setattr(selftest, "TEXTURE", (2048, 1024))
    monkeypatch.setitem(selftest.PLANS, "pair", row(-12, 12))
    monkeypatch.setitem(selftest.PLANS, "low_overlap", row(-30, 0, 30))


def findings(*plans):
    return list(selftest.run_selftest(plans, Options(), run=serial))


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
    assert selftest.MAX_RMS < finding.rms < 5


def test_a_photo_left_out_is_found(monkeypatch):
    with_result(
        monkeypatch,
        lambda alignment: replace(alignment, photos=alignment.photos[:-1], cameras=alignment.cameras[:-1]),
    )

    (finding,) = findings("low_overlap")

    assert not finding.passed
    assert (finding.photos, finding.given) == (2, 3)
    assert finding.rms < selftest.MAX_RMS


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
