"""`panostitch detectors`: its table, its JSON, its picture, its exit codes."""

import json

import cv2
import pytest

from panostitch.cli.main import run
from panostitch.errors import EXIT_OK, NoOverlapError, OutputError
from panostitch.features import DETECTORS
from panostitch.matching import MATCHERS

QUICK = ["--work-megapixels", "0.12", "--max-features", "500"]
ROWS = len(DETECTORS) * len(MATCHERS)


@pytest.fixture(scope="module")
def photos(tmp_path_factory, views):
    folder = tmp_path_factory.mktemp("photos")
    for name, pixels in zip("ab", views, strict=False):
        cv2.imwrite(str(folder / f"{name}.png"), pixels[..., ::-1])
    return folder


def test_table_json_and_picture(photos, tmp_path, capsys):
    output = tmp_path / "detectors.png"
    assert run(["detectors", str(photos), "-o", str(output), "--json", *QUICK]) == EXIT_OK
    said = capsys.readouterr()
    data = json.loads(said.out)
    assert [trial["detector"] for trial in data["trials"]] == [name for name in DETECTORS for _ in MATCHERS]
    assert (data["pairs"], data["path"], data["exit_code"]) == ([["a.png", "b.png"]], str(output), EXIT_OK)
    lines = said.err.splitlines()
    assert lines[0].split()[:3] == ["detector", "matcher", "key"]
    assert [line.split()[0] for line in lines[1 : ROWS + 1]] == [trial["detector"] for trial in data["trials"]]
    assert all("1 of 1" in line for line in lines[1 : ROWS + 1])
    assert cv2.imread(str(output)).shape[0] % len(DETECTORS) == 0


def test_no_overlap_shows_the_table_then_fails(strangers, capsys):
    assert run(["detectors", str(strangers), "--retries", "none", *QUICK]) == NoOverlapError.exit_code
    lines = capsys.readouterr().err.splitlines()
    assert all("0 of 1      -         -" in line for line in lines[1 : ROWS + 1])
    assert "error: no two photos overlap" in lines


def test_existing_output_is_kept(photos, tmp_path, capsys):
    output = tmp_path / "detectors.png"
    output.write_text("mine")
    assert run(["detectors", str(photos), "-o", str(output)]) == OutputError.exit_code
    assert output.read_text() == "mine"
    assert "exists already" in capsys.readouterr().err
