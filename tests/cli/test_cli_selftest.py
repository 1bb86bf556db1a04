"""`panostitch selftest`: its table, its JSON, its exit codes; what is in them is the job's business."""

import json
import math
from dataclasses import replace

import pytest

from panostitch.jobs import selftest
from panostitch.jobs.contender import OURS, RIVAL
from panostitch.jobs.hugin import HUGIN
from panostitch.jobs.selftest import Finding

GOOD = Finding("pair", 2, 2, 0.0123, 0.02, 1.5)
RIVALS = Finding("pair", 1, 2, 0.262, 0.4, 0.8, program=RIVAL)
HUGINS = replace(RIVALS, photos=0, rms=math.inf, p95=math.inf, message="cpfind failed with code 1", program=HUGIN)


@pytest.fixture
def asked(monkeypatch):
    """Findings are made up; what the job was asked for."""
    calls = []

    def job(plans, _options, **more):
        calls.append((tuple(plans), more))
        programs = {OURS: GOOD, RIVAL: RIVALS, HUGIN: HUGINS}
        for plan in plans:
            for exif in more["exif"]:
                yield from (replace(programs[p], plan=plan, exif=exif) for p in more["programs"])

    monkeypatch.setattr(selftest, "run_selftest", job)
    return calls


def test_quick_by_default(call, asked):
    result = call("selftest")

    ((plans, more),) = asked
    assert result.code == 0
    assert plans == selftest.QUICK
    assert more["programs"] == [OURS, RIVAL]
    assert more["exif"] == (False,)
    assert more["size"] == selftest.QUICK_SIZE


def test_full_is_everything(call, asked):
    assert call("selftest", "--full").code == 0

    ((plans, more),) = asked
    assert plans == tuple(selftest.PLANS)
    assert more["programs"] == [OURS, RIVAL, HUGIN]
    assert more["exif"] == (False, True)
    assert more["size"] is None


def test_the_others_stand_beside_ours(call, asked):
    text = call("selftest", "--full", "--plan", "pair").err

    *_, head, without, with_exif = text.splitlines()
    assert " ".join(head.split()) == "plan EXIF photos rms px 95 % px seconds verdict cv2.Stitcher px Hugin px"
    assert " ".join(without.split()) == "pair no 2 of 2 0.012 0.020 1.5 passed 0.262 (1 of 2) failed"
    assert with_exif.split()[:2] == ["pair", "yes"]
    assert "pair with EXIF: Hugin: failed (cpfind failed with code 1)" in text
    assert asked[0][0] == ("pair",)


def test_a_dash_for_what_did_not_run(call, asked):
    assert call("selftest", "--alone", "--plan", "row").err.splitlines()[-1].split()[-2:] == ["-", "-"]
    assert asked[0][1]["programs"] == [OURS]


def test_json_has_no_infinity(call, asked):
    result = call("selftest", "--full", "--plan", "pair", "--json")

    ours, _, hugins = json.loads(result.out)[:3]
    assert (ours["program"], ours["rms"], ours["passed"], ours["exif"]) == (OURS, GOOD.rms, True, False)
    assert hugins["rms"] is None
    assert asked


@pytest.mark.parametrize("bad", [{"rms": 0.021}, {"photos": 1}, {"rms": math.inf, "photos": 0}])
def test_only_our_failure_fails(call, monkeypatch, bad):
    def job(*_args, **_more):
        yield from (replace(GOOD, **bad), RIVALS)

    monkeypatch.setattr(selftest, "run_selftest", job)
    result = call("selftest")
    assert result.code == 1
    assert "FAILED" in result.err


def test_an_unknown_plan_is_refused(call, asked):
    result = call("selftest", "--plan", "cube")

    assert result.code == 2
    assert "there is no plan cube" in result.err
    assert "mosaic" in result.err
    assert not asked
