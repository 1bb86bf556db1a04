"""`panostitch inspect`: lines and JSON on standard output, errors with their exit code."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from panostitch.io.sphere import PACKET

GPANO = (
    'GPano:ProjectionType="equirectangular" GPano:FullPanoWidthPixels="360" GPano:FullPanoHeightPixels="180" '
    'GPano:CroppedAreaImageWidthPixels="120" GPano:CroppedAreaImageHeightPixels="60"'
)
QUICK = ["--detector", "orb", "--max-features", "600", "--retries", "none", "--refine", "none", "-q"]


def told(result):
    """The lines as names and what is said of each."""
    return {line.split("  ")[0]: line.split("  ", 1)[1].strip() for line in result.out.splitlines()}


@pytest.fixture
def picture(tmp_path):
    pixels = np.full((60, 120, 3), 180, np.uint8)
    pixels[:, :16] = 0
    xmp = PACKET.format(properties=GPANO).encode()
    Image.fromarray(pixels).save(tmp_path / "given.jpg", quality=95, xmp=xmp)
    return "given.jpg"


def test_a_panorama(call, picture):
    result = call("inspect", picture)

    assert (result.code, result.err) == (0, "")
    lines = told(result)
    assert lines["size"].startswith("120 x 60 px")
    assert lines["projection"] == "equirectangular"
    assert lines["field of view"] == "120.0 x 60.0 degrees"
    assert "left 16, top 0, right 0, bottom 0 px" in lines["empty"]


def test_a_panorama_as_json(call, picture):
    data = json.loads(call("inspect", picture, "--json").out)

    assert (data["kind"], data["size"], data["bits"]) == ("picture", [120, 60], 8)
    assert data["field_of_view"] == [120.0, 60.0]
    assert data["border"]["left"] == 16


def test_a_project(call, photos, strays):
    inputs = [photos / "a.jpg", photos / "b.jpg", strays / "lonely.jpg"]
    assert call("align", *inputs, "-o", "given.pano.json", *QUICK).code == 3

    lines = told(call("inspect", "given.pano.json"))
    data = json.loads(call("inspect", "given.pano.json", "--json").out)

    assert lines["photos"] == "2: a.jpg, b.jpg"
    assert lines["left out"].startswith("lonely.jpg: overlaps no other photo")
    assert "before the crop" in lines["canvas"]
    assert data["kind"] == "project"
    assert [photo["name"] for photo in data["photos"]] == ["a.jpg", "b.jpg"]
    assert data["canvas"][0] > 400


@pytest.mark.parametrize("name", ["letter.jpg", "empty.jpg", "half.jpg", "half.png", "none.jpg"])
def test_what_cannot_be_read(name, call, strays):
    result = call("inspect", strays / name)

    assert (result.code, result.out) == (5, "")
    assert result.err.startswith("error: ")
    assert name in result.err.splitlines()[0]


def test_a_project_that_is_not_ours(call, tmp_path):
    (tmp_path / "given.pano.json").write_text('{"a": 1}')

    result = call("inspect", "given.pano.json")

    assert (result.code, result.out) == (5, "")
    assert "not a sound project file" in result.err


def test_a_panorama_is_scored_against_its_photos(call, photos):
    """Its own photo is all that a picture can be; a copy of which a part is moved is worse."""
    call("stitch", photos, "-o", "whole.png", *QUICK)
    picture = np.asarray(Image.open("whole.png")).copy()
    middle = picture.shape[1] // 2
    picture[:, middle:-6] = picture[:, middle + 6 :]
    Image.fromarray(picture).save("moved.png")

    whole, moved = (
        json.loads(call("inspect", name, "--photos", photos, "--json").out)["score"]
        for name in ("whole.png", "moved.png")
    )

    assert whole["total"] < moved["total"]
    assert abs(moved["worst"][0]["x"] - middle) < 40
    assert "score" in told(call("inspect", "moved.png", "--photos", photos))


def test_a_project_has_no_score(call, photos):
    assert call("inspect", "x.pano.json", "--photos", photos).code == 2


def test_a_reader_that_goes_away_is_no_bug(picture, tmp_path):
    reader, writer = os.pipe()
    os.close(reader)

    command = [sys.executable, "-m", "panostitch", "inspect", str(tmp_path / picture), "--json"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)

    assert (done.returncode, done.stderr) == (141, "")
