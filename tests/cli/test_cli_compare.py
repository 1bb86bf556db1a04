"""`panostitch compare`: its table, its JSON, its exit codes, and that it leaves nothing behind."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from functools import partial

import cv2
import numpy as np
import pytest

from panostitch.cli.compare import say_comparison
from panostitch.cli.main import run
from panostitch.errors import EXIT_INTERRUPTED, EXIT_LEFT_OUT, MissingError, NoOverlapError, OutputError
from panostitch.jobs.compare import Comparison, Misfit
from panostitch.jobs.contender import DONE, OURS, RIVAL, Outcome
from panostitch.model.photo import Photo
from panostitch.model.score import Score, Worst
from panostitch.synthetic.render import photograph
from panostitch.synthetic.scene import rig, sphere_scene
from panostitch.synthetic.textures import procedural_texture

MISFIT = 1.0  # px, median; observed 0.18 and, the rival, 0.34
FAULTS = 1.0  # of either panorama of an easy pair; observed 0.1 and, the rival, 0.2
PATIENCE = 20.0  # seconds until a child must have begun


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photos")
    scene = sphere_scene(procedural_texture(1536, 768, seed=3))
    for name, camera in zip("ab", rig(np.deg2rad([-13, 13]), size=(480, 360), focal=500), strict=True):
        cv2.imwrite(str(folder / f"{name}.jpg"), photograph(scene, camera, supersample=1)[..., ::-1])
    return folder


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A folder for temporary files, of which none may stay."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


@pytest.mark.usefixtures("temporary")
def test_json_and_picture(photos, strangers, tmp_path, capsys):
    output, page = tmp_path / "both.png", tmp_path / "both.html"
    stranger = str(strangers / "b.png")
    given = [str(photos), stranger, "-o", str(output), "--report", str(page)]
    assert run(["compare", *given, "--json"]) == EXIT_LEFT_OUT
    data = json.loads(capsys.readouterr().out)
    assert [entry["program"] for entry in data["programs"]] == [RIVAL, OURS]
    for entry in data["programs"]:
        assert entry["photos"] == ["a.jpg", "b.jpg"]
        assert entry["left_out"] == ["b.png"]
        assert entry["misfit"]["median"] < MISFIT
        assert 0 < entry["score"]["total"] < FAULTS
        assert entry["score"]["places"] > 100
    assert data["judge"]["detector"] == "akaze"
    assert data["exit_code"] == EXIT_LEFT_OUT
    height = sum(entry["size"][1] for entry in data["programs"])
    assert cv2.imread(str(output)).shape[0] > height
    text = page.read_text(encoding="utf-8")
    for entry in data["programs"]:
        assert f'alt="The panorama of {entry["program"]}"' in text
        assert f"{entry['score']['total']:.2f}</td>" in text
    assert text.count("without b.png</figcaption>") == 2


@pytest.mark.usefixtures("temporary")
def test_no_overlap_shows_the_rival_then_fails(strangers, tmp_path, capsys):
    output, page = tmp_path / "both.jpg", tmp_path / "both.html"
    given = [str(strangers), "-o", str(output), "--report", str(page)]
    assert run(["compare", *given]) == NoOverlapError.exit_code
    said = capsys.readouterr()
    assert "cv2.Stitcher: need more images" in said.err
    assert "0 of 2" in said.err
    assert "error: no two photos overlap" in said.err
    assert f"report: {page}" in said.err
    assert not output.exists()
    assert "need more images" in page.read_text(encoding="utf-8")


def test_a_rival_that_is_not_installed_is_said_before_anything_is_done(photos, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    output = tmp_path / "both.jpg"
    assert run(["compare", str(photos), "-o", str(output), "--with", "hugin"]) == MissingError.exit_code == 9
    said = capsys.readouterr().err
    assert "hugin_executor" in said
    assert "apt install hugin-tools enblend" in said
    assert not output.exists()


def test_existing_output_is_kept(photos, tmp_path, capsys):
    output = tmp_path / "both.jpg"
    output.write_text("mine")
    assert run(["compare", str(photos), "-o", str(output)]) == OutputError.exit_code
    assert output.read_text() == "mine"
    assert "exists already" in capsys.readouterr().err


def test_interrupt_leaves_nothing(photos, tmp_path, temporary):
    output = tmp_path / "both.jpg"
    command = [sys.executable, "-m", "panostitch", "compare", str(photos), "-o", str(output)]
    # a shell starts what runs in its background deaf to interrupts, and so would be all that the tests start
    listening = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, preexec_fn=listening)
    deadline = time.monotonic() + PATIENCE
    while not list(temporary.glob("*/*/task.pickle")) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert process.poll() is None
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == EXIT_INTERRUPTED
    assert said.decode().strip() == "interrupted; no half-written panorama is left behind"
    assert not output.exists()


def test_table_names_what_is_missing(capsys):
    photos = tuple(Photo(f"{name}.jpg", (480, 360), None) for name in "abc")
    camera = rig([0.0], size=(480, 360), focal=500)[0]
    rival = Outcome(RIVAL, "5.0", "crashed: aborted", seconds=1.5)
    ours = Outcome(OURS, "0.1", DONE, (camera, None, camera), (700, 350), 2.0, 3.0, 123.4)
    worst = (Worst(12.0, 34.0, 2.5, None, 5.0, 0.0, 0.0, None),)
    score = Score(0.25, 0.125, 1.5, None, 2.0, 0.0, 0.0625, 400, 0.5, worst)
    say_comparison(Comparison(photos, (rival, ours), (None, Misfit(0.5, np.inf, 2.0)), "akaze", 80, 1, (None, score)))
    lines = capsys.readouterr().err.splitlines()
    assert [" ".join(line.split()) for line in lines[1:3]] == [
        "cv2.Stitcher 5.0 0 of 3 - 1.50 - - - - -",
        "panostitch 0.1 2 of 3 700 x 350 2.00 3.00 123 0.50 inf 2.00",
    ]
    assert " ".join(lines[4].split()) == "panostitch 0.25 0.12 1.50 - 2.00 0.00 0.06 12/34"
    assert lines[5:7] == ["cv2.Stitcher: crashed: aborted", "panostitch leaves out b.jpg"]
