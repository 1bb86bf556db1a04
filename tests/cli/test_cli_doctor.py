"""`panostitch doctor`: its lines, its JSON, its exit codes; what is in them is the job's business."""

import json

import pytest

from panostitch.jobs import doctor
from panostitch.jobs.doctor import Check

GOOD = Check("packages", "numpy", "ok", "2.4.0", value="2.4.0")
MISSING = Check("optional", "extra dev", "missing", "without ruff", "pip install 'panostitch[dev]'")
NOTED = Check("machine", "memory", "note", "512M in all", "use --max-memory 384M", 512 << 20)
BAD = Check("formats", "PNG, 8 bits", "failed", "it is not written", "install Pillow anew")


@pytest.fixture
def found(monkeypatch):
    """What the doctor finds is made up."""

    def pretend(*checks):
        monkeypatch.setattr(doctor, "examine", lambda **_: iter(checks))

    return pretend


def test_what_is_optional_may_be_missing(call, found):
    found(GOOD, NOTED, MISSING)
    result = call("doctor")

    assert result.code == 0
    assert result.err == ""
    assert result.out.splitlines()[-1] == "everything that is needed works"
    assert "next: pip install 'panostitch[dev]'" in result.out


def test_what_is_needed_may_not(call, found):
    found(GOOD, BAD)
    result = call("doctor")

    assert result.code == 11
    assert "FAILED" in result.out
    assert result.out.splitlines()[-1].startswith("PNG, 8 bits: not working")


def test_parts_have_a_head(call, found):
    found(GOOD, GOOD, BAD)

    assert [line for line in call("doctor").out.splitlines() if line in ("packages", "formats")] == [
        "packages",
        "formats",
    ]


def test_json(call, found):
    found(NOTED, BAD)
    result = call("doctor", "--json")

    data = json.loads(result.out)
    assert data["exit_code"] == result.code == 11
    assert [check["verdict"] for check in data["checks"]] == ["note", "failed"]
    assert data["checks"][0]["value"] == 512 << 20
