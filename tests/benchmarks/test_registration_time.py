"""The benchmark of registration times: what it books to which stage, what it says, and one run of it."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT, PHOTOS = ROOT / "benchmarks" / "registration_time.py", ROOT / "samples" / "poster"
ROUNDING = 1e-9  # s


@pytest.fixture(scope="module")
def script():
    if sys.platform == "win32":
        pytest.skip("there is no resource usage to read")
    spec = importlib.util.spec_from_file_location("registration_time", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up there
    yield spec.loader.exec_module(module) or module
    del sys.modules[spec.name]


def test_stages_add_up_and_none_is_forgotten(script):
    start = script.Seconds.now()
    stages = script.Stages()
    for label in ("Finding key points", "Matching photos"):
        list(stages.progress([1, 2], total=2, label=label))
    stages.trace("matching.grouped")
    list(stages.progress([1, 2], total=2, label="Measuring control points"))
    stages.book()
    total = script.Seconds.now() - start
    assert set(stages.booked) == set(script.STAGES)
    assert sum(one.wall for one in stages.booked.values()) <= total.wall + ROUNDING


def test_a_run_survives_the_way_to_the_parent(script):
    run = script.Run(3, script.Seconds(1.5, 2.5), "done", {"matching": script.Seconds(0.5, 1.0)})
    assert script.Run.from_json(run.to_json()) == run


def test_ratios_are_ours_over_theirs_and_only_where_both_succeed(script):
    ours = [script.Run(2, script.Seconds(wall, 4.0)) for wall in (1.0, 9.0, 2.0)]
    theirs = [script.Run(2, script.Seconds(8.0, 1.0))]
    failed = [script.Run(0, script.Seconds(8.0, 1.0), "need more images")]
    _, compared, without = script.comparison("set", 2, {script.OURS: ours, script.RIVAL: theirs, script.HUGIN: failed})
    assert compared == "| set | 2 | cv2.Stitcher | 2 | 8.00 | 1.00 | 0.25 | 4.00 |"
    assert without == "| set | 2 | Hugin | 0: need more images | 8.00 | 1.00 | - | - |"


@pytest.mark.slow
def test_it_runs(tmp_path):
    page = tmp_path / "page.md"
    command = [sys.executable, str(SCRIPT), str(PHOTOS), "--repeat", "1", "--no-hugin", "--output", str(page)]
    subprocess.run(command, check=True, capture_output=True)
    rows = [line.split(" | ") for line in page.read_text().splitlines() if line.startswith(f"| {PHOTOS.name} |")]
    assert [row[1:4] for row in rows[:2]] == [["2", "panostitch", "2"], ["2", "cv2.Stitcher", "2"]]
    assert str(PHOTOS.parent) not in page.read_text()
